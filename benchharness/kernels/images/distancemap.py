"""Rays through a cube map that knows how far it sees: where a ray passes behind what the map's centre sees.

Told from the centre, a ray starts at x and goes in the direction r. Its point at the distance d is written as

    m / s,    m = s x + t a r,    d = a t / s,    t + s = 1,    a = |x|

so that t = 0 is the start, s = 0 is infinitely far, and neither needs a case of its own. Let D(v) be how far the map sees
in direction v. The ray is behind that where |m / s| > D(m), that is where its excess

    f = |m| / D(m) - s

is positive. As long as the map sees one plane, f is linear in t: one false position is exact. For every two points of the
ray it is the same as that in d of Szirmay-Kalos et al. (2005) for the ratio q = |m / s| / D(m), whose first guess is the one
between t = 0 and s = 0, as f = s (q - 1).

The map keeps 1 / depth, along the axis of each face, and not 1 / D: that is linear across the picture of a plane, so that
what lies between texels is exact too.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels import cubemap

CLOSE = 1e-4  # of the distance from the centre: so near to what is seen a search ends; a fortieth of a texel of 256
JUMP = 0.1  # of depth, between neighbouring texels: more is an edge; a plane is as steep as that 3 degrees from its horizon
TOUCHING = 0.02  # of the distance from the centre: a ray that starts no further behind what is seen starts at it
LEAST = 1e-6  # of |x|: a ray goes at least so far
AT_CENTRE = 1e-6  # metres: a ray starts at least so far from the centre


@dataclass
class DistanceMap:
    """1 / depth along the axis of each face, 0 for the surroundings; Float [6, n + 2, n + 2] as `kernels.cubemap` has it.

    first    the texel at which the map begins, among others of its size in the same buffer
    stepped  texels between whose depths there is an edge are not joined by a skin: each is as wide as a texel
    """

    nearness: mi.Float
    n: int
    first: mi.UInt32 | int = 0
    stepped: bool = False


@dataclass
class Ray:
    """A ray told from the map's centre. way: its unit direction times a, the length of its start."""

    start: mi.Vector3f
    way: mi.Vector3f
    a: mi.Float


@dataclass
class Spot:
    """A point of a ray: t and s as above, and the excess f there."""

    t: mi.Float
    s: mi.Float
    f: mi.Float


@dataclass
class Found:
    """Where a search has ended.

    spot    where; f is 0 there if it has found what the map sees
    hidden  the ray starts behind what the map sees
    """

    spot: Spot
    hidden: mi.Bool


def of_map(texels: mi.Float, n: int) -> DistanceMap:
    """What the finest level of a cube map knows of distances. texels: as `cubemap.capture` has them."""
    count = (n + 2) * (n + 2)
    lane = dr.arange(mi.UInt32, 6 * count)
    place = lane % count
    row = place // (n + 2)
    u, v = ((2 * mi.Float(k) - 1) / n - 1 for k in (place - row * (n + 2), row))
    return DistanceMap(dr.gather(mi.Float, texels, lane * 4 + 3) * dr.sqrt(1 + u * u + v * v), n)


def ray(x: mi.Vector3f, r: mi.Vector3f) -> Ray:
    """The ray from x, told from the centre, in the unit direction r."""
    length = dr.norm(x)
    a = dr.maximum(length, AT_CENTRE)
    return Ray(dr.select(length < AT_CENTRE, AT_CENTRE * r, x), a * r, a)


def direction(of: Ray, spot: Spot) -> mi.Vector3f:
    """Where a point of the ray is seen from the centre, unnormalised."""
    return dr.fma(spot.s, of.start, spot.t * of.way)


def length(of: Ray, spot: Spot) -> mi.Float:
    """How far the ray goes to one of its points; inf for the surroundings."""
    far = spot.s <= 0
    return dr.select(far, dr.inf, of.a * dr.maximum(spot.t, LEAST) / dr.select(far, 1, spot.s))


def around(map: DistanceMap, d: mi.Vector3f) -> tuple[list[mi.UInt32], mi.Float, mi.Float]:
    """The four texels around direction d, and where it is between them."""
    n = map.n
    face, u, v = cubemap.face_of(d)
    x, y = (u + 1) * (0.5 * n) + 0.5, (v + 1) * (0.5 * n) + 0.5
    column, row = dr.clip(mi.Int32(x), 0, n), dr.clip(mi.Int32(y), 0, n)
    first = map.first + (face * (n + 2) + mi.UInt32(row)) * (n + 2) + mi.UInt32(column)
    return [first + k for k in (0, 1, n + 2, n + 3)], x - mi.Float(column), y - mi.Float(row)


def corners(map: DistanceMap, d: mi.Vector3f, active: mi.Bool | bool) -> tuple[list[mi.Float], mi.Float, mi.Float]:
    """1 / depth at the four texels around direction d, and where it is between them."""
    texels, fx, fy = around(map, d)
    return [dr.gather(mi.Float, map.nearness, texel, active) for texel in texels], fx, fy


def seen(map: DistanceMap, d: mi.Vector3f, active: mi.Bool | bool) -> mi.Float:
    """1 / depth in direction d, along the axis of its face."""
    values, fx, fy = corners(map, d, active)
    one, two, three, four = values
    smooth = dr.lerp(dr.lerp(one, two, fx), dr.lerp(three, four, fx), fy)
    if not map.stepped:
        return smooth
    nearest = dr.select(fy < 0.5, dr.select(fx < 0.5, one, two), dr.select(fx < 0.5, three, four))
    return dr.select(_jumps(values), nearest, smooth)


def at(map: DistanceMap, of: Ray, t: mi.Float, s: mi.Float, active: mi.Bool | bool) -> Spot:
    """The point of a ray at t and s."""
    m = dr.fma(s, of.start, t * of.way)
    depth = dr.maximum(dr.maximum(dr.abs(m.x), dr.abs(m.y)), dr.abs(m.z))
    return Spot(t, s, depth * seen(map, m, active) - s)


def is_edge(map: DistanceMap, d: mi.Vector3f, active: mi.Bool | bool) -> mi.Bool:
    """Whether the depths of the four texels around direction d jump."""
    return _jumps(corners(map, d, active)[0])


def _jumps(values: list[mi.Float]) -> mi.Bool:
    nearest, farthest = dr.maximum(*values[:2]), dr.minimum(*values[:2])
    for value in values[2:]:
        nearest, farthest = dr.maximum(nearest, value), dr.minimum(farthest, value)
    return nearest - farthest > JUMP * nearest


def iterate(map: DistanceMap, of: Ray, iterations: int, active: mi.Bool) -> Found:
    """False position between the start and infinity: some point where the ray passes behind what the map sees.

    iterations  after the first guess; fewer where it is close. A ray that starts behind what is seen ends as one of `march`
    """
    start, end = (at(map, of, mi.Float(t), mi.Float(1 - t), active) for t in (0, 1))
    behind = start.f > TOUCHING
    return Found(false_position(map, of, either(behind, end, start), end, iterations, active), active & (start.f > CLOSE))


@dr.syntax
def false_position(map: DistanceMap, of: Ray, low: Spot, high: Spot, iterations: int, active: mi.Bool) -> Spot:
    """The point between `low`, in front of what is seen, and `high`, behind it, that is neither."""
    spot = between(map, of, low, high, active)
    k = mi.UInt32(0)
    while dr.hint(active & (k < iterations) & (dr.abs(spot.f) > CLOSE * spot.s), label="false position"):
        short = spot.f < 0
        low, high = either(short, spot, low), either(short, high, spot)
        spot = between(map, of, low, high, active)
        k += 1
    return spot


def either(first: mi.Bool, one: Spot, two: Spot) -> Spot:
    """Of two points of rays, lane by lane."""
    return Spot(dr.select(first, one.t, two.t), dr.select(first, one.s, two.s), dr.select(first, one.f, two.f))


def between(map: DistanceMap, of: Ray, low: Spot, high: Spot, active: mi.Bool) -> Spot:
    """Where f would be 0 if it were linear in t; `low` where it does not rise from below 0."""
    rise = high.f - low.f
    share = dr.select(rise > 0, dr.clip(-low.f / dr.select(rise > 0, rise, 1), 0, 1), 0)
    rest = dr.select(rise > 0, dr.clip(high.f / dr.select(rise > 0, rise, 1), 0, 1), 1)
    return at(map, of, rest * low.t + share * high.t, rest * low.s + share * high.s, active)


@dr.syntax
def march(map: DistanceMap, of: Ray, steps: int, iterations: int, active: mi.Bool) -> Found:
    """The first point where the ray passes behind what the map sees, but for what is thinner than a step.

    Steps are equally long in t, none shorter than a texel (Umenhoffer et al. 2007). A ray that starts behind what is seen
    goes on until it is in front; one that never is ends where it starts if it touches that, else at infinity.

    steps  at most so many
    """
    turn = dr.norm(dr.normalize(of.way) - of.start * dr.rcp(of.a))
    count = dr.clip(mi.UInt32(dr.ceil(turn * (0.5 * map.n))), 1, steps)
    per_step = dr.rcp(mi.Float(count))
    start = at(map, of, mi.Float(0), mi.Float(1), active)
    low, high = Spot(start.t, start.s, start.f), Spot(start.t, start.s, start.f)
    k, passed = mi.UInt32(0), mi.Bool(False)
    while dr.hint(active & ~passed & (k < count), label="march along a ray"):
        k += 1
        low = Spot(high.t, high.s, high.f)
        high = at(map, of, mi.Float(k) * per_step, mi.Float(count - k) * per_step, active)
        passed = (low.f < 0) & (high.f >= 0)
    # A ray that never was in front: what its start or infinity sees, and no search.
    lost = either(start.f > TOUCHING, high, start)
    low, high = either(passed, low, lost), either(passed, high, lost)
    return Found(false_position(map, of, low, high, iterations, active), active & (start.f > CLOSE))
