"""Cube maps at regular places of a room, and how a reflected ray's colour is blended of them.

The room's box is cut into n x n x n cells, with a map in the middle of each, of everything but the mirrors. A map's influence
ends beyond its cell: along each axis, with p from the map's place, e the half of its influence and d the part of it over which
it falls off,

    a = clamp(1 - (|p| - e + d) / d, 0, 1),    d = min(blend, e),    weight = (a_x a_y a_z)²

Here e reaches d beyond the cell, so that within the room some weight is 1, and the next cell's falls to 0 at the other end of
the border. Weights are divided by their sum where that is more than 1, whatever the order of the maps; what is missing to 1, an
environment fills: the map nearest to the middle of the room, looked up by direction alone.

Colours are blended, and not directions: midway between two maps that disagree about where something is, it is there twice.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels import cubemap, differentials, geometry, selfmet
from benchharness.kernels.differentials import FirstHits
from benchharness.kernels.frozen import frozen
from benchharness.kernels.images import parallax, probe, proxy, roombox
from benchharness.kernels.types import SceneLike, View

SEEN = 0.2  # share of a pixel's colour from which on it matters that maps are wrong
INSIDE = 0.5  # of a turn of a closed surface around a point


@dataclass
class Grid:
    """Places and weights.

    box     in which reflected rays end, and in whose axes the cells are
    places  packets: in the world; middles: packets, in the box's axes
    extent  half of an influence; blend: over how much of it it falls off; both along the box's axes
    count   how many maps there are
    rest    the number of the one that is the environment
    """

    box: proxy.Box
    places: mi.Float
    middles: mi.Float
    extent: mi.Vector3f
    blend: mi.Vector3f
    count: int
    rest: int


def planned(scene: SceneLike, per_axis: int, blend: float) -> tuple[Grid, np.ndarray]:
    """The grid of a scene at its start, and the places of its maps in the world, float64 [maps, 3].

    Places within a closed object are left out. If all are, one map in the middle remains, without influence.

    blend  over how much of half a cell a weight falls off
    """
    box = _room(scene)
    steps = (2 * np.arange(per_axis) + 1) / per_axis - 1
    middles = box.half * np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    places = box.centre + middles @ box.axes
    kept = ~buried(scene, places)
    cell = box.half / per_axis
    extent, falloff = (1 + blend) * cell, blend * cell
    if kept.any():
        middles, places = middles[kept], places[kept]
    else:
        middles, places, extent = np.zeros((1, 3)), box.centre[None], np.full(3, -1.0)
    grid = Grid(
        box=box.uploaded(),
        places=mi.Float(_packed(places)),
        middles=mi.Float(_packed(middles)),
        extent=mi.Vector3f(extent.tolist()),
        blend=mi.Vector3f(falloff.tolist()),
        count=len(places),
        rest=int(np.linalg.norm(middles, axis=1).argmin()),
    )
    dr.make_opaque(grid.places, grid.middles, grid.extent, grid.blend)
    return grid, places


def _packed(points: np.ndarray) -> np.ndarray:
    return np.column_stack([points, np.zeros(len(points))]).astype(np.float32).ravel()


def _room(scene: SceneLike) -> roombox.HostBox:
    """The box around all mirrors' boxes."""
    first, *others = roombox.around_mirrors(scene)
    for other in others:
        first = first.joined(other)
    return first


def buried(scene: SceneLike, places: np.ndarray) -> np.ndarray:
    """Which places [N, 3] lie within a closed object that is wound outwards, as it stands at the scene's start, bool [N]."""
    within = np.zeros(len(places), bool)
    for part in scene.objects:
        mesh = part.mesh.transformed(part.pose(0.0))
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        near = np.flatnonzero(((places > low) & (places < high)).all(axis=1) & ~within)
        if not len(near):
            continue
        corners = mesh.vertices[mesh.faces[geometry.oriented_closed_faces(mesh.vertices, mesh.faces)]]
        for k in near:
            within[k] = _turns(corners - places[k]) > INSIDE
    return within


def _turns(corners: np.ndarray) -> float:
    """How many times triangles [F, 3, 3] surround the origin: their solid angles over 4 π (Van Oosterom and Strackee 1983)."""
    a, b, c = np.moveaxis(corners, 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("ij,ij->i", v, w) for v, w in ((a, b), (b, c), (c, a)))
    return float(2 * np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb).sum() / (4 * np.pi))


@dataclass
class State:
    """What is kept of a scene.

    places    where maps are taken, in the world
    mirrors   as `kernels.images.probe` has them: no map of them is taken, but their boxes are asked
    objects   how many parts are no mirrors
    maps      all in one buffer, one after the other
    boxes     per mirror the rows that take a point of the world to [-1, 1] across it
    """

    grid: Grid
    places: list[mi.Point3f]
    mirrors: probe.State
    objects: int
    maps: cubemap.Pyramid | None = None
    boxes: list[list[mi.Vector4f]] | None = None


def begun(scene: SceneLike, per_axis: int, blend: float) -> State:
    """The state of a scene of which no map has been taken."""
    grid, places = planned(scene, per_axis, blend)
    points = [mi.Point3f(place.tolist()) for place in places]
    dr.make_opaque(points)
    return State(grid, points, probe.begun(scene), len(scene.objects))


def updated(state: State, poses: mi.Float, resolution: int, *, mip: bool) -> State:
    """All maps, and where the mirrors are."""
    mirrors = state.mirrors
    world = geometry.placed(mirrors.geometry, poses)
    drawn = probe.owners(world) < state.objects
    taken = [cubemap.capture(world, drawn, place, resolution, mirrors.near, mirrors.surroundings) for place in state.places]
    maps = [probe.pyramid(texels, resolution, mip=mip) for texels in taken]
    boxes = []
    for i, (centre, half) in enumerate(zip(mirrors.centres, mirrors.halves, strict=True)):
        boxes.append(probe.placed(poses, dr.opaque(mi.UInt32, state.objects + i), centre, half)[1])
    return replace(state, maps=cubemap.together(maps), boxes=boxes)


def weight(p: mi.Vector3f, extent: mi.Vector3f, blend: mi.Vector3f) -> mi.Float:
    """The weight of a map at p from its place, before weights are made to sum to 1 at most."""
    product = mi.Float(1)
    for k in range(3):
        d = dr.maximum(dr.minimum(blend[k], extent[k]), 1e-9)
        product *= dr.clip(1 - (dr.abs(p[k]) - extent[k] + d) / d, 0, 1)
    return dr.square(product)


@dr.syntax
def total_weight(grid: Grid, p: mi.Point3f, active: mi.Bool) -> mi.Float:
    """The sum of all weights at a point of the world."""
    here = proxy.within(grid.box.rows, p)
    k, total = mi.UInt32(0), mi.Float(0)
    while dr.hint(active & (k < grid.count), label="sum the weights of maps"):
        total += weight(here - dr.gather(mi.Vector4f, grid.middles, k, active).xyz, grid.extent, grid.blend)
        k += 1
    return total


@dataclass
class Blend:
    """What maps show together; `distance`: of the one with the largest share that shows a surface, else inf."""

    L: mi.Color3f
    distance: mi.Float
    doubt: mi.Bool


@frozen
def looked_up(
    grid: Grid,
    maps: cubemap.Pyramid,
    boxes: list[list[mi.Vector4f]],
    view: View,
    hits: FirstHits,
    active: mi.Bool,
    *,
    doubts: bool,
    plain: bool,
) -> tuple[mi.Color3f, mi.Float, mi.Bool]:
    """Radiance, the distance of the surface with the largest share of it (inf for surroundings alone), and doubt if asked for.

    plain  the surroundings are the same in all directions
    """
    p, n = hits.p, hits.n
    r, differential, bends = differentials.reflected(hits, view)
    stride = dr.width(maps.texels) // 4 // grid.count
    blend = _blended(grid, maps, stride, p, r, differential, active, doubts=doubts, plain=plain)
    doubt = blend.doubt
    for i, box in enumerate(boxes if doubts else ()):
        own = active & (hits.reflector == i)
        doubt |= own & (selfmet.away(p, n, r, differential.dp, bends, box, own) < blend.distance)
        enter, leave = proxy.crossed(proxy.within(box, p), mi.Vector3f(*(dr.dot(row.xyz, r) for row in box)), mi.Vector3f(1))
        doubt |= active & ~own & (enter <= leave) & (enter < blend.distance)
    return blend.L, blend.distance, doubt


@dr.syntax
def _blended(
    grid: Grid,
    maps: cubemap.Pyramid,
    stride: int,
    p: mi.Point3f,
    r: mi.Vector3f,
    differential: differentials.RayDifferential,
    active: mi.Bool,
    *,
    doubts: bool,
    plain: bool,
) -> Blend:
    """The blend of all maps, and of the environment as the last."""
    here, t = proxy.within(grid.box.rows, p), mi.Float(0)
    scale = dr.rcp(dr.maximum(total_weight(grid, p, active), 1))
    L, distance, most, left, wrong = mi.Color3f(0), mi.Float(dr.inf), mi.Float(0), mi.Float(1), mi.Float(0)
    k = mi.UInt32(0)
    while dr.hint(active & (k <= grid.count), label="blend maps"):
        last = k == grid.count
        number = dr.select(last, grid.rest, k)
        share = scale * weight(here - dr.gather(mi.Vector4f, grid.middles, number, active).xyz, grid.extent, grid.blend)
        share = dr.select(last, dr.maximum(left, 0), share)
        left -= share
        shown = active & (share > 0)
        if shown:
            place = mi.Point3f(dr.gather(mi.Vector4f, grid.places, number, shown).xyz)
            x = mi.Vector3f(p - place)
            t = dr.select(last, dr.inf, proxy.reach(grid.box, p, r, place))
            d = proxy.towards(x, r, t)
            turn = parallax.turned(grid.box, p, r, d, differential, place)
            turn = dr.select(last, differential.turn, turn)
            map = replace(maps, first=number * stride)
            value = cubemap.lookup_mip(map, d, probe.level(maps, turn), shown)
            value, d = parallax.sky_is_far(map, value, r, d, differential, shown)
            L += share * mi.Color3f(value.x, value.y, value.z)
            away = parallax.shown_at(x, d, value.w)
            larger = (value.w > 0) & (share > most)
            distance, most = dr.select(larger, away, distance), dr.select(larger, share, most)
            if dr.hint(doubts, mode="scalar"):
                off = parallax.misplaced(map, x, r, d, value.w, differential, shown, plain=plain)
                wrong += dr.select(off, share, 0)
        k += 1
    return Blend(L, distance, wrong > SEEN)
