"""Cube maps in layers, which know how far they see, so that rays find what near things hide from the map's centre.

The first layer is what the centre sees; each further one is what comes next behind it in the same direction, front or back, as
depth peeling finds it (Everitt 2001). A ray is followed through all layers at once, and ends where it first passes through one
of them (Umenhoffer, Patow, Szirmay-Kalos 2007), from the centre's side or from the other: what is hidden shows its back to it.

Along an outline a layer steps from one surface to another. With one layer, a skin closes that step, since nothing is known of
what is behind. With several, most steps are what the ray goes through: a search that does not close in on a surface has met
one, and the ray goes on. A surface so steep that its neighbouring texels count as a step ends in such stairs; a search that
comes near enough to them ends there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi

from benchharness.kernels import cubemap, geometry, packets
from benchharness.kernels.images import distancemap, probe
from benchharness.kernels.images.distancemap import DistanceMap, Ray, Spot

APART = 2e-4  # of depth: what lies nearer behind a layer than this belongs to it
MET = 0.01  # of the distance: a search that ends further from a layer than this has met a step
CLOSE_BY = 0.05  # of the distance: so near to a step a ray may have met what ends there


@dataclass
class Layers:
    """One mirror's layers, the nearest first, in one buffer each; of `distances`, stepped, `first` is left to who asks."""

    maps: cubemap.Pyramid
    distances: DistanceMap
    count: int

    def at(self, layer: mi.UInt32) -> tuple[cubemap.Pyramid, DistanceMap]:
        """The maps of one layer, lane by lane."""
        texels = dr.width(self.maps.texels) // (4 * self.count)
        return replace(self.maps, first=layer * texels), replace(
            self.distances, first=layer * cubemap.texels_of(self.distances.n)
        )


@dataclass
class Met:
    """Where a march through layers has ended.

    spot    where
    layer   through which
    lost    it has passed through none, and shows what the first layer has in its direction; or started within what it touches
    beside  it has passed close by the end of something on its way
    """

    spot: Spot
    layer: mi.UInt32
    lost: mi.Bool
    beside: mi.Bool


def taken(state: probe.State, poses: mi.Float, resolution: int, count: int, *, mip: bool) -> list[Layers]:
    """`count` layers of every mirror, of which `state` has the first."""
    world = geometry.placed(state.geometry, poses)
    owners, objects = probe.owners(world), dr.width(poses) // 12 - len(state.centres)
    found = []
    for i, one in enumerate(state.probes):
        drawn = owners != dr.opaque(mi.UInt32, objects + i)
        maps, nearness = [one.map], [distancemap.of_map(one.map.texels, resolution).nearness]
        for _ in range(count - 1):
            behind = nearness[-1] * (1 - APART)
            texels = cubemap.capture(world, drawn, one.place, resolution, state.near, state.surroundings, behind=behind)
            if state.enclosed[i]:
                texels = filled(texels, maps[-1].texels, cubemap.texels_of(resolution))
            maps.append(probe.pyramid(texels, resolution, mip=mip))
            nearness.append(distancemap.of_map(texels, resolution).nearness)
        found.append(together(maps, nearness, resolution))
    return found


def filled(texels: mi.Float, nearer: mi.Float, count: int) -> mi.Float:
    """A layer within walls: where there is nothing in it, the colour is that of the layer before, still at no distance. So what
    is behind a thing goes on beside it, and texels along its outline are not mixed with surroundings that nobody sees."""
    lane = dr.arange(mi.UInt32, count)
    own, other = (dr.gather(mi.Vector4f, values, lane) for values in (texels, nearer))
    return packets.stored(dr.select(own.w > 0, own, mi.Vector4f(other.x, other.y, other.z, 0)), count)


def together(maps: Sequence[cubemap.Pyramid], nearness: Sequence[mi.Float], n: int) -> Layers:
    """Layers out of their maps, and 1 / depth of each as `DistanceMap` has it."""
    return Layers(cubemap.together(maps), DistanceMap(dr.concat(list(nearness)), n, stepped=True), len(maps))


@dr.syntax
def march(layers: Layers, of: Ray, steps: int, iterations: int, active: mi.Bool) -> Met:
    """Where the ray first passes through a layer, but for what is thinner than a step.

    Steps are those of `distancemap.march`. A layer is passed through from behind only by a ray that was in front of it before:
    starts are on the mirror, and what they are behind of is what they touch.

    steps       at most so many
    iterations  of false position, and as many of halving between
    """
    distances, layer_count = layers.distances, layers.count
    n = distances.n
    turn = dr.norm(dr.normalize(of.way) - of.start * dr.rcp(of.a))
    count = dr.clip(mi.UInt32(dr.ceil(turn * (0.5 * n))), 1, steps)
    per_step = dr.rcp(mi.Float(count))
    spot, layer = Spot(mi.Float(2), mi.Float(0), mi.Float(0)), mi.UInt32(0)
    found, beside, front = mi.Bool(False), mi.Bool(False), mi.UInt32(0)
    k = mi.UInt32(0)
    while dr.hint(active & ~found & (k < count), label="march along a ray through layers"):
        t, s = mi.Float(k) * per_step, mi.Float(count - k) * per_step
        k += 1
        u, v = mi.Float(k) * per_step, mi.Float(count - k) * per_step
        j = mi.UInt32(0)
        while dr.hint(active & (j < layer_count), label="ask every layer"):
            map = replace(distances, first=j * cubemap.texels_of(n))
            one, two = distancemap.at(map, of, t, s, active), distancemap.at(map, of, u, v, active)
            bit = mi.UInt32(1) << j
            before = one.f < 0
            front |= dr.select(before, bit, 0)
            crossed = active & (before != (two.f < 0)) & ((front & bit) != 0)
            fore, back = distancemap.either(before, one, two), distancemap.either(before, two, one)
            end, near = closed_in(map, of, fore, back, iterations, crossed)
            met = crossed & (near <= MET)
            beside |= crossed & ~met & ((near <= CLOSE_BY) | (j + 1 == layer_count))
            first = met & (end.t < spot.t)
            spot, layer = distancemap.either(first, end, spot), dr.select(first, j, layer)
            found |= met
            j += 1
    start = distancemap.at(distances, of, mi.Float(0), mi.Float(1), active)
    sky = distancemap.at(distances, of, mi.Float(1), mi.Float(0), active)
    touches = (start.f >= 0) & (start.f <= distancemap.TOUCHING)
    spot = distancemap.either(found, spot, distancemap.either(touches, start, sky))
    lost = active & ~found & ~(touches & (start.f <= distancemap.CLOSE))
    return Met(spot, layer, lost, active & beside)


@dr.syntax
def closed_in(map: DistanceMap, of: Ray, low: Spot, high: Spot, iterations: int, active: mi.Bool) -> tuple[Spot, mi.Float]:
    """The point nearest to a layer between `low`, in front of it, and `high`, behind it; and how near that is, of its distance.

    False position and halving by turns: at a step of the layer the first alone does not close in."""
    spot = distancemap.between(map, of, low, high, active)
    k = mi.UInt32(0)
    while dr.hint(active & (k < 2 * iterations) & (dr.abs(spot.f) > distancemap.CLOSE * spot.s), label="close in on a layer"):
        short = spot.f < 0
        low, high = distancemap.either(short, spot, low), distancemap.either(short, high, spot)
        straight = distancemap.between(map, of, low, high, active)
        middle = distancemap.at(map, of, 0.5 * (low.t + high.t), 0.5 * (low.s + high.s), active)
        spot = distancemap.either((k & 1) == 1, straight, middle)
        k += 1
    for other in (low, high):
        spot = distancemap.either(_off(other) < _off(spot), other, spot)
    return spot, _off(spot)


def _off(spot: Spot) -> mi.Float:
    """How far a point is from a layer, of its own distance; 0 at infinity, where surroundings are."""
    return dr.select(spot.s > 0, dr.abs(spot.f) / dr.maximum(spot.s, 1e-12), dr.select(spot.f > 0, dr.inf, 0))
