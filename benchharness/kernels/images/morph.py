"""Cube maps at regular places of a mirror's box, and how a reflected ray's colour is interpolated between them.

A mirror's box, along its walls or the main axes of its vertices (`kernels.images.roombox.settled`), is cut into cells that are
about cubes, with a map in the middle of each, of everything but the mirror. A reflected ray that starts at p is shown by the
eight maps around p, with the weights w_i of linear interpolation along three axes; beyond the outermost maps, by those. Their
pictures are brought to p before they are blended (view interpolation, Chen and Williams 1993): the map at c_i sees as far as
D_i along the ray's own direction r, the ray is taken to end after

    t = sum w_i D_i

and every map is looked up where that is, in the direction p + t r - c_i. Of a plane D is linear in c: where all eight see one
plane along r, t is exact, with weights that go on linearly beyond the outermost maps, too. Such maps differ by no more than a
plane that touches the box allows. Where they differ by more, or some see the surroundings, t is the mean of those that see
something near: if the ray meets that, all maps are looked up there. If it does not, they show what is behind that point, to all
sides of what they should, which is right in the mean where that is smooth.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels import cubemap, differentials, geometry, packets, selfmet
from benchharness.kernels.differentials import FirstHits, RayDifferential
from benchharness.kernels.frozen import frozen
from benchharness.kernels.images import distancemap, parallax, probe, probegrid, proxy, roombox
from benchharness.kernels.types import SceneLike, View

AGREE = 3.2
"""Times: along a ray a plane that does not cut the box is at most three times as far from one map of a cell as from another, as
maps stand half a cell from the box's sides; and what is between texels."""
LEAST = 1e-3  # of how far the nearest of the maps sees: a ray goes at least so far
FARTHEST = 1e12  # units: what sees nothing, in a comparison of distances


@dataclass
class Plan:
    """Where a mirror's maps are to be, in its own space.

    rows    three that take a point to [-1, 1] across the box
    nodes   packets, x slowest: places
    counts  maps along each axis of the box
    """

    rows: list[mi.Vector4f]
    nodes: mi.Float
    counts: tuple[int, int, int]

    @property
    def count(self) -> int:
        return self.counts[0] * self.counts[1] * self.counts[2]


@dataclass
class Grid:
    """A mirror's maps, in the world.

    maps, distances  of all places, in their order, in one buffer each
    places, rows     as `Plan` has them
    box              rows that take a point of the world to [-1, 1] across the mirror's box, as `selfmet.away` has it
    """

    maps: cubemap.Pyramid
    distances: distancemap.DistanceMap
    places: mi.Float
    rows: list[mi.Vector4f]
    counts: tuple[int, int, int]
    box: list[mi.Vector4f]


@dataclass
class State:
    """What is kept of a scene. objects: how many parts are no mirrors."""

    mirrors: probe.State
    plans: list[Plan]
    objects: int
    grids: list[Grid]


def begun(scene: SceneLike, samples: int) -> State:
    """The state of a scene of which no map has been taken. samples: maps along the longest side of a mirror's box."""
    return State(
        probe.begun(scene), [_planned(scene, i, samples) for i in range(len(scene.reflectors))], len(scene.objects), []
    )


def _planned(scene: SceneLike, mirror: int, samples: int) -> Plan:
    """A map that would stand within a closed object, at the scene's start, stands where the nearest that does not stands."""
    reflector = scene.reflectors[mirror]
    mesh = reflector.closed or reflector.mesh
    box = roombox.settled(mesh.vertices, mesh.faces)
    counts = np.maximum(np.rint(samples * box.half / box.half.max()), 1).astype(int)
    steps = [(2 * np.arange(n) + 1) / n - 1 for n in counts]
    nodes = box.centre + (box.half * np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)) @ box.axes
    pose = reflector.pose(0.0)
    free = ~probegrid.buried(scene, nodes @ pose[:3, :3].T + pose[:3, 3])
    if free.any():
        apart = np.linalg.norm(nodes[:, None] - nodes[free], axis=2)
        nodes = nodes[free][apart.argmin(axis=1)]
    scaled = box.axes / box.half[:, None]
    offsets = -(scaled @ box.centre)
    rows = [mi.Vector4f([*axis, offset]) for axis, offset in zip(scaled.tolist(), offsets.tolist(), strict=True)]
    dr.make_opaque(rows)
    x, y, z = (int(n) for n in counts)
    return Plan(rows, mi.Float(packets.of_rows(nodes).ravel()), (x, y, z))


def updated(state: State, poses: mi.Float, resolution: int, *, mip: bool) -> State:
    """All maps of all mirrors, where `poses` puts them, `resolution` texels per edge of a face."""
    mirrors, grids = state.mirrors, []
    world = geometry.placed(mirrors.geometry, poses)
    owners = probe.owners(world)
    for i, plan in enumerate(state.plans):
        part = dr.opaque(mi.UInt32, state.objects + i)
        places, rows = _placed(plan, poses, part)
        maps, nearness = [], []
        for k in range(plan.count):
            place = mi.Point3f(dr.gather(mi.Vector4f, places, dr.opaque(mi.UInt32, k)).xyz)
            texels = cubemap.capture(world, owners != part, place, resolution, mirrors.near, mirrors.surroundings)
            maps.append(probe.pyramid(texels, resolution, mip=mip))
            nearness.append(distancemap.of_map(texels, resolution).nearness)
        distances = distancemap.DistanceMap(dr.concat(nearness), resolution)
        box = probe.placed(poses, part, mirrors.centres[i], mirrors.halves[i])[1]
        grids.append(Grid(cubemap.together(maps), distances, places, rows, plan.counts, box))
    return replace(state, grids=grids)


def _placed(plan: Plan, poses: mi.Float, part: mi.UInt32) -> tuple[mi.Float, list[mi.Vector4f]]:
    """Places and rows in the world: a·q + b with q = Rᵀ (p - T)."""
    pose = [dr.gather(mi.Vector4f, poses, part * 3 + k) for k in range(3)]
    node = dr.gather(mi.Vector4f, plan.nodes, dr.arange(mi.UInt32, plan.count))
    q = mi.Vector4f(node.x, node.y, node.z, 1)
    places = packets.stored(mi.Vector4f(*(dr.dot(row, q) for row in pose), node.w), plan.count)
    shift, rows = mi.Vector3f(*(row.w for row in pose)), []
    for row in plan.rows:
        a = mi.Vector3f(*(dr.dot(line.xyz, row.xyz) for line in pose))
        rows.append(mi.Vector4f(a.x, a.y, a.z, row.w - dr.dot(a, shift)))
    return places, rows


@dataclass
class Cell:
    """Between which maps a point is: the lower one's number along each axis, and how far it is from there, in cells; below 0
    and above 1 beyond the outermost maps. 0 where there is one map."""

    lower: list[mi.UInt32]
    reach: list[mi.Float]


def cell_of(grid: Grid, p: mi.Point3f) -> Cell:
    """The cell around a point of the world."""
    u, lower, reach = proxy.within(grid.rows, p), [], []
    for k, n in enumerate(grid.counts):
        along = (u[k] + 1) * (0.5 * n) - 0.5
        first = dr.clip(dr.floor(along), 0, max(n - 2, 0))
        lower.append(mi.UInt32(first))
        reach.append(along - first if n > 1 else mi.Float(0))
    return Cell(lower, reach)


def corner(grid: Grid, cell: Cell, k: mi.UInt32) -> tuple[mi.UInt32, mi.Float, mi.Float]:
    """Corner k of eight: the map's number, its weight in a colour, and in a distance, which may be negative."""
    number, share, stretch = mi.UInt32(0), mi.Float(1), mi.Float(1)
    for axis, n in enumerate(grid.counts):
        upper = ((k >> axis) & 1) == 1
        number = number * n + dr.minimum(cell.lower[axis] + dr.select(upper, mi.UInt32(1), 0), n - 1)
        reach = cell.reach[axis]
        inner = dr.clip(reach, 0, 1)
        share *= dr.select(upper, inner, 1 - inner)
        stretch *= dr.select(upper, reach, 1 - reach)
    return number, share, stretch


@frozen
def looked_up(
    grids: list[Grid], view: View, hits: FirstHits, active: mi.Bool, *, morph: bool, doubts: bool, plain: bool
) -> tuple[mi.Color3f, mi.Float, mi.Bool]:
    """Radiance, the distance of the surface with the largest share of it (inf for surroundings alone), and doubt if asked for.

    morph  pictures are moved before they are blended
    plain  the surroundings are the same in all directions
    """
    p, n = hits.p, hits.n
    r, differential, bends = differentials.reflected(hits, view)
    L, distance, doubt = mi.Color3f(0), mi.Float(0), mi.Bool(False)
    for i, grid in enumerate(grids):
        own = active & (hits.reflector == i)
        black = len(grids) > 1
        blend = blended(grid, p, r, differential, own, morph=morph, doubts=doubts, plain=plain, black=black)
        L, distance = dr.select(own, blend.L, L), dr.select(own, blend.distance, distance)
        if doubts:
            doubt |= own & blend.doubt
            doubt |= own & (selfmet.away(p, n, r, differential.dp, bends, grid.box, own) < blend.distance)
    return L, distance, doubt


@dr.syntax
def blended(
    grid: Grid,
    p: mi.Point3f,
    r: mi.Vector3f,
    differential: RayDifferential,
    active: mi.Bool,
    *,
    morph: bool,
    doubts: bool,
    plain: bool,
    black: bool,
) -> probegrid.Blend:
    """What the maps around p show of the ray along r. black: doubted is what shows another mirror, which is black in a map."""
    cell = cell_of(grid, p)
    stride = dr.width(grid.maps.texels) // (4 * grid.counts[0] * grid.counts[1] * grid.counts[2])
    t = length(grid, cell, r, active) if morph else mi.Float(dr.inf)
    L, distance, most, wrong = mi.Color3f(0), mi.Float(dr.inf), mi.Float(0), mi.Float(0)
    k = mi.UInt32(0)
    while dr.hint(active & (k < 8), label="interpolate between maps"):
        number, share, _ = corner(grid, cell, k)
        shown = active & (share > 0)
        if shown:
            x = mi.Vector3f(p - mi.Point3f(dr.gather(mi.Vector4f, grid.places, number, shown).xyz))
            d = proxy.towards(x, r, t)
            map = replace(grid.maps, first=number * stride)
            value = cubemap.lookup_mip(map, d, probe.level(grid.maps, turned(differential, x, r, t)), shown)
            value, d = parallax.sky_is_far(map, value, r, d, differential, shown)
            L += share * mi.Color3f(value.x, value.y, value.z)
            larger = (value.w > 0) & (share > most)
            distance, most = dr.select(larger, parallax.shown_at(x, d, value.w), distance), dr.select(larger, share, most)
            if dr.hint(doubts, mode="scalar"):
                off = parallax.misplaced(map, x, r, d, value.w, differential, shown, plain=plain)
                if dr.hint(black, mode="scalar"):
                    off |= (value.w > 0) & (dr.max(value.xyz) <= 0)
                wrong += dr.select(off, share, 0)
        k += 1
    return probegrid.Blend(L, distance, wrong > probegrid.SEEN)


@dr.syntax
def length(grid: Grid, cell: Cell, r: mi.Vector3f, active: mi.Bool) -> mi.Float:
    """How far a ray along r is taken to go, inf to the surroundings."""
    stride = cubemap.texels_of(grid.distances.n)
    depth = dr.maximum(dr.maximum(dr.abs(r.x), dr.abs(r.y)), dr.abs(r.z))
    k, straight, nearest, farthest = mi.UInt32(0), mi.Float(0), mi.Float(FARTHEST), mi.Float(0)
    while dr.hint(active & (k < 8), label="ask how far maps see"):
        number, _, stretch = corner(grid, cell, k)
        asked = active & (stretch != 0)
        inverse = depth * distancemap.seen(replace(grid.distances, first=number * stride), r, asked)
        away = dr.rcp(dr.maximum(inverse, 1 / FARTHEST))
        straight += dr.select(asked, stretch * away, 0)
        nearest = dr.select(asked, dr.minimum(nearest, away), nearest)
        farthest = dr.select(asked, dr.maximum(farthest, away), farthest)
        k += 1
    limit, near, total = AGREE * nearest, mi.Float(0), mi.Float(0)
    k = mi.UInt32(0)
    while dr.hint(active & (farthest > limit) & (k < 8), label="ask again those that see something near"):
        number, share, stretch = corner(grid, cell, k)
        asked = active & (stretch != 0)
        inverse = depth * distancemap.seen(replace(grid.distances, first=number * stride), r, asked)
        counts = asked & (inverse * limit >= 1)
        near += dr.select(counts, share * dr.rcp(dr.select(counts, inverse, 1)), 0)
        total += dr.select(counts, share, 0)
        k += 1
    mean = dr.select(total > 0, near * dr.rcp(dr.select(total > 0, total, 1)), nearest)
    t = dr.select(farthest <= limit, dr.maximum(straight, LEAST * nearest), mean)
    return dr.select(nearest < 0.5 * FARTHEST, t, dr.inf)


def turned(differential: RayDifferential, x: mi.Vector3f, r: mi.Vector3f, t: mi.Float) -> mi.Float:
    """By how much the direction from a map to x + t r turns from one pixel to the next, radians, as if all were as long."""
    met = dr.isfinite(t)
    far = dr.select(met, t, 0)
    across = [dr.norm(dp + far * dd) for dp, dd in zip(differential.dp, differential.dd, strict=True)]
    return dr.select(met, dr.maximum(*across) * dr.rcp(dr.maximum(dr.norm(x + far * r), 1e-9)), differential.turn)
