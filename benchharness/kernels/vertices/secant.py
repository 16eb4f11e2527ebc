"""Secant triangle: the reflection point as the root of a gradient (Roger and Holzschuch 2006, 3.2 and 3.3).

Light from the vertex V by way of the mirror's point P to the eye E travels l(P) = |EP| + |PV|; P reflects V where the gradient
of l along the mirror vanishes. Three sample points A, B, C on the mirror and their gradients say where it would vanish if
it were linear: that point, moved on to the mirror along its ray from the centre, replaces the worst of the three.

The first three are the directions to V and E and an apex (the paper), or lie around where a sphere would reflect. Where such a
direction leaves through the opening of a hollow mirror, its opposite is taken, which is on the mirror.

Gradients. With e = unit(P - E) + unit(P - V), P = O + r(u) u:

    "param"    (u.e) grad r + e - (u.e) u    the derivative of l in u. The paper's equation (1) prints its transpose, which
               vanishes at the reflection points of a sphere about O and of nothing else
    "surface"  e - (e.n) n                   the part of e in the tangent plane, zero at the same points

Step. (alpha, beta) minimise |alpha a + beta b + c| with a = gA - gC, b = gB - gC, c = gC. In cross products, with d = a x b:
alpha = -d.(c x b) / d.d, beta = -d.(a x c) / d.d, which float32 stands better than the determinant of the normal equations.
If a and b are parallel, the sample discarded last comes back for one that is not the newest.

The triangle's last area ("area", the paper) is no bound: a sliver has none. Its longest edge ("edge") is one in practice. What
a search ends with is tested: half vector and normal agree, and both E and V are in front.

All positions here are in the mirror's own frame, in which its map never changes.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels.placement import MirrorFrame, unit
from benchharness.kernels.vertices import starmap

PARALLEL = 1e-8  # square of the sine between two gradients' differences below which they span no plane
SAME = 1e-3  # distance of two first samples, relative to the mirror, below which they are one
AGREED = 1e-2  # |gradient| / |e| of a reflection point
SHORTEST_E = 1e-3  # |e| = 2 cos(incidence) at a reflection point; 0 where EV pierces the mirror, which is none
SPREAD = 0.12  # share of the angle between V and E that the first triangle spans, started near the answer
SPREAD_LEAST, SPREAD_MOST = 0.004, 0.15  # radians
OUTLINE_HALVINGS = 14  # of the angle between E and V, to find the mirror's outline between them
RETURNS = 0.25  # pixels; how near a triangle one texel wide leads back to an answer of which only the map is asked
SPREAD_WARM = 0.01  # radians, of a triangle around the last frame's answer


Triangle = tuple["Sample", "Sample", "Sample"]


@dataclass
class Sample:
    """A point of the mirror, the gradient of the path's length there, and its pixel."""

    p: mi.Point3f
    g: mi.Vector3f
    x: mi.Float
    y: mi.Float


@dataclass
class Solution:
    """What a search ended with, one lane per vertex.

    u, R, n     direction, reflection point and unit normal on the side of the eye: of the best sample
    e           |unit(R - E) + unit(R - V)|
    converged   the triangle closed in, and R is a reflection point: half vector and normal agree, E and V are in front
    behind      V is behind the mirror at R, or R lies on EV: what a search for a hidden vertex ends with
    iterations  samples taken after the first three; 0 for inactive lanes
    backtracks  times that a discarded sample came back
    """

    u: mi.Vector3f
    R: mi.Point3f
    n: mi.Normal3f
    e: mi.Float
    converged: mi.Bool
    behind: mi.Bool
    residual: mi.Float
    iterations: mi.UInt32
    backtracks: mi.UInt32


def evaluate(kind: str, star: starmap.StarMap, local: MirrorFrame, u: mi.Vector3f, active: mi.Bool | bool) -> Sample:
    """The mirror's point in direction u and the gradient of the path's length there."""
    r, gradient = starmap.sample(star, u, active)
    p = mi.Point3f(star.centre + r * u)
    e = unit(p - local.eye) + unit(p - local.V)
    if kind == "param":
        along = dr.dot(u, e)
        g = along * gradient + e - along * u
    else:
        n = dr.normalize(u - gradient)
        g = e - dr.dot(e, n) * n
    return Sample(p, mi.Vector3f(g), *local.pixel(p))


def directions_of(star: starmap.StarMap, local: MirrorFrame) -> tuple[mi.Vector3f, mi.Vector3f]:
    """Directions from the centre to V and to E; up for an eye in the centre, towards the eye for a vertex there."""
    to_V, to_E = unit(local.V - star.centre), unit(local.eye - star.centre)
    to_E = dr.select(dr.squared_norm(to_E) > 0.5, to_E, mi.Vector3f(0, 0, 1))
    return dr.select(dr.squared_norm(to_V) > 0.5, to_V, to_E), to_E


def _on_mirror(star: starmap.StarMap, u: mi.Vector3f, active: mi.Bool | bool) -> mi.Vector3f:
    """u, or its opposite if u leaves through an opening: a hollow mirror reflects what is before its opening across it."""
    return dr.select(starmap.is_covered(star, u, active), u, -u)


def near_answer(star: starmap.StarMap, local: MirrorFrame, active: mi.Bool | bool) -> mi.Vector3f:
    """A direction close to the reflection point's: exact to first order on a sphere.

    Seen from the centre, R lies between E and V; for small angles, those to E and to V are as h / (r + h) of either, with h
    their heights above the surface.
    """
    to_V, to_E = directions_of(star, local)
    share = []
    for p, u in ((local.V, to_V), (local.eye, to_E)):
        distance = dr.norm(p - star.centre)
        height = dr.abs(distance - starmap.sample(star, u, active)[0])
        share.append(height / dr.maximum(distance, 1e-6 * height))
    mixed = to_V * share[1] + to_E * share[0]
    return _on_mirror(star, dr.select(dr.squared_norm(mixed) > 1e-12, unit(mixed), to_E), active)


def _paper_start(kind: str, star: starmap.StarMap, local: MirrorFrame, active: mi.Bool) -> Triangle:
    """V and E as seen from the centre, and the apex of an equilateral triangle on them."""
    to_V, to_E = (_on_mirror(star, u, active) for u in directions_of(star, local))
    across = mi.coordinate_system(to_E)[0]
    one = evaluate(kind, star, local, to_V, active)
    two = evaluate(kind, star, local, to_E, active)
    scale = dr.maximum(dr.norm(two.p - star.centre), 1e-20)
    same = dr.norm(one.p - two.p) < SAME * scale
    u = dr.select(same, unit(to_E + 0.05 * across), to_V)
    one = evaluate(kind, star, local, u, active)
    side = dr.cross(one.p - star.centre, two.p - star.centre)
    side = dr.select(dr.norm(side) > 1e-6 * dr.square(scale), side, across)
    apex = 0.5 * (one.p + two.p) + 0.5 * dr.sqrt(3) * dr.norm(one.p - two.p) * unit(side)
    return one, two, evaluate(kind, star, local, unit(apex - star.centre), active)


def _around(
    kind: str, star: starmap.StarMap, local: MirrorFrame, u: mi.Vector3f, spread: mi.Float, active: mi.Bool
) -> Triangle:
    """A small equilateral triangle around direction u."""
    s, t = mi.coordinate_system(u)
    corners = [(0.0, 1.0), (-0.8660254, -0.5), (0.8660254, -0.5)]
    one, two, three = (evaluate(kind, star, local, unit(u + spread * (a * s + b * t)), active) for a, b in corners)
    return one, two, three


def start(
    kind: str,
    how: str,
    star: starmap.StarMap,
    local: MirrorFrame,
    last: mi.Vector3f,
    warm: mi.Bool,
    active: mi.Bool,
) -> Triangle:
    """The first three samples: "paper" or "near" the answer; around `last` where `warm`."""
    if how == "paper":
        first = _paper_start(kind, star, local, active & ~warm)
        again = _around(kind, star, local, last, mi.Float(SPREAD_WARM), active & warm)
        one, two, three = (dr.select(warm, one, other) for one, other in zip(again, first, strict=True))
        return one, two, three
    to_V, to_E = directions_of(star, local)
    u = dr.select(warm, last, near_answer(star, local, active & ~warm))
    spread = dr.clip(SPREAD * dr.norm(to_V - to_E), SPREAD_LEAST, SPREAD_MOST)
    return _around(kind, star, local, u, dr.select(warm, SPREAD_WARM, spread), active)


def _closed_in(kind: str, a: Sample, b: Sample, c: Sample, tau: mi.Float) -> mi.Bool:
    """Whether the triangle is small on the screen: its area (pixels squared) or its longest edge (pixels) is below `tau`."""
    ux, uy, vx, vy = b.x - a.x, b.y - a.y, c.x - a.x, c.y - a.y
    if kind == "area":
        return dr.abs(ux * vy - uy * vx) < 2 * tau
    longest = dr.maximum(ux * ux + uy * uy, vx * vx + vy * vy)
    return dr.maximum(longest, dr.square(ux - vx) + dr.square(uy - vy)) < tau * tau


def _plane(a: Sample, b: Sample, c: Sample) -> tuple[mi.Vector3f, mi.Bool]:
    """(gA - gC) x (gB - gC), and whether it is too small to span a plane."""
    one, two = a.g - c.g, b.g - c.g
    d = dr.cross(one, two)
    return d, ~(dr.squared_norm(d) > PARALLEL * dr.squared_norm(one) * dr.squared_norm(two))


@dr.syntax
def close_in(
    kind: str,
    stop: str,
    star: starmap.StarMap,
    local: MirrorFrame,
    first: Triangle,
    active: mi.Bool,
    tau: mi.Float,
    max_iter: mi.UInt32,
) -> tuple[Sample, mi.Bool, mi.UInt32, mi.UInt32]:
    """The best sample that secant steps end with, whether the triangle is small on the screen there, and how many samples were
    taken and came back."""
    a, b, c = first  # the triangle; c is the newest
    last = Sample(mi.Point3f(a.p), mi.Vector3f(a.g), mi.Float(a.x), mi.Float(a.y))  # the sample discarded last,
    has_last = mi.Bool(False)  # if there is one
    iterations = mi.UInt32(0)  # samples taken
    backtracks = mi.UInt32(0)  # times that a discarded sample came back
    closed = _closed_in(stop, a, b, c, tau)  # whether the triangle is small on the screen
    running = mi.Bool(active)
    while dr.hint(running, label="close in by secants"):
        # Where gradients span no plane, bring the discarded sample back for the one that leaves more of a plane.
        d, flat = _plane(a, b, c)
        one, two = _plane(last, b, c)[0], _plane(a, last, c)[0]
        for_a = dr.squared_norm(one) * dr.squared_norm(a.g - c.g) >= dr.squared_norm(two) * dr.squared_norm(b.g - c.g)
        back = flat & has_last
        evicted = dr.select(for_a, a, b)
        a, b = dr.select(back & for_a, last, a), dr.select(back & ~for_a, last, b)
        last = dr.select(back, evicted, last)
        backtracks += dr.select(back, 1, 0)
        d, flat = _plane(a, b, c)

        # The point where the interpolated gradient is least.
        one, two, three = a.g - c.g, b.g - c.g, c.g
        scale = -dr.rcp(dr.select(flat, 1, dr.squared_norm(d)))
        alpha, beta = dr.dot(d, dr.cross(three, two)) * scale, dr.dot(d, dr.cross(one, three)) * scale
        offset = (c.p - star.centre) + alpha * (a.p - c.p) + beta * (b.p - c.p)
        length = dr.norm(offset)
        lost = flat | ~dr.isfinite(length) | (length < 1e-9 * dr.norm(c.p - star.centre))
        u = dr.select(lost, mi.Vector3f(0, 0, 1), offset * dr.rcp(dr.select(lost, 1, length)))
        new = evaluate(kind, star, local, u, running & ~lost)

        # It replaces the worst.
        ga, gb, gc = dr.squared_norm(a.g), dr.squared_norm(b.g), dr.squared_norm(c.g)
        drop_a = (ga >= gb) & (ga >= gc)
        drop_b = ~drop_a & (gb >= gc)
        last = dr.select(lost, last, dr.select(drop_a, a, dr.select(drop_b, b, c)))
        a, b = dr.select(lost | ~drop_a, a, c), dr.select(lost | ~drop_b, b, c)
        c = dr.select(lost, c, new)
        has_last = mi.Bool(True)
        iterations += dr.select(lost, 0, 1)
        closed = ~lost & _closed_in(stop, a, b, c, tau)
        running &= ~closed & ~lost & (iterations < max_iter)
    ga, gb, gc = dr.squared_norm(a.g), dr.squared_norm(b.g), dr.squared_norm(c.g)
    best = dr.select((ga < gb) & (ga < gc), a, dr.select(gb < gc, b, c))
    return best, closed, dr.select(active, iterations, 0), dr.select(active, backtracks, 0)


def judged(
    star: starmap.StarMap,
    local: MirrorFrame,
    u: mi.Vector3f,
    closed: mi.Bool,
    iterations: mi.UInt32,
    backtracks: mi.UInt32,
    active: mi.Bool,
) -> Solution:
    """What a search that ended in direction u has found."""
    r, gradient = starmap.sample(star, u, active)
    R = mi.Point3f(star.centre + r * u)
    n = star.side * dr.normalize(u - gradient)
    w_E, w_V = unit(local.eye - R), unit(local.V - R)
    s = w_E + w_V
    e = dr.norm(s)
    h = s * dr.rcp(dr.maximum(e, 1e-6))
    in_front = dr.dot(n, w_V) > 0
    agreed = (dr.norm(s - dr.dot(s, n) * n) < AGREED * e) & (e > SHORTEST_E)
    converged = active & closed & agreed & in_front & (dr.dot(n, w_E) > 0) & starmap.is_covered(star, u, active)
    behind = active & (~in_front | (e <= SHORTEST_E))
    return Solution(
        u=u,
        R=R,
        n=mi.Normal3f(n),
        e=e,
        converged=converged,
        behind=behind,
        residual=dr.norm(h - n),
        iterations=dr.select(active, iterations, 0),
        backtracks=dr.select(active, backtracks, 0),
    )


def settled(kind: str, star: starmap.StarMap, local: MirrorFrame, s: Solution, active: mi.Bool) -> mi.Bool:
    """Whether the map alone says that s.R is a reflection point: a triangle around it, one texel of the map wide, leads back
    to it within RETURNS, and all of the triangle is on the mirror.

    A triangle of a pixel closes in wherever its own gradients agree. Across an edge, a rim, or where r changes too fast for the
    map's texels, a wider one sees other gradients.
    """
    a, b, c = _around(kind, star, local, s.u, mi.Float(2 / star.n), active)
    # Gradients lie in planes of their own. Out of that in the middle they turn with the gradient's length.
    axis = s.u if kind == "param" else mi.Vector3f(s.n)
    a, b, c = (Sample(k.p, k.g - dr.dot(k.g, axis) * axis, k.x, k.y) for k in (a, b, c))
    d, flat = _plane(a, b, c)
    one, two, three = a.g - c.g, b.g - c.g, c.g
    scale = -dr.rcp(dr.select(flat, 1, dr.squared_norm(d)))
    alpha, beta = dr.dot(d, dr.cross(three, two)) * scale, dr.dot(d, dr.cross(one, three)) * scale
    (x0, y0), (x1, y1) = local.pixel(s.R), local.pixel(c.p + alpha * (a.p - c.p) + beta * (b.p - c.p))
    on_mirror = mi.Bool(active)
    for corner in (a, b, c):
        on_mirror &= starmap.is_covered(star, unit(corner.p - star.centre), active)
    return on_mirror & ~flat & (dr.square(x1 - x0) + dr.square(y1 - y0) < RETURNS * RETURNS)


@dataclass
class Options:
    """What the kernel is compiled for: `residual` "param" or "surface", `stop` "area" or "edge", `start` "paper" or "near"."""

    residual: str
    stop: str
    start: str


def solve(
    options: Options,
    star: starmap.StarMap,
    local: MirrorFrame,
    last: mi.Vector3f,
    warm: mi.Bool,
    active: mi.Bool,
    tau: mi.Float,
    max_iter: mi.UInt32,
) -> Solution:
    """The reflection point of every active vertex.

    last, warm   direction to start around, and where to
    tau          pixels ("edge") or pixels squared ("area") at which to stop
    """
    first = start(options.residual, options.start, star, local, last, warm, active)
    best, closed, iterations, backtracks = close_in(options.residual, options.stop, star, local, first, active, tau, max_iter)
    u = dr.select(active, unit(best.p - star.centre), mi.Vector3f(0, 0, 1))
    return judged(star, local, u, closed, iterations, backtracks, active)


@dr.syntax
def outline(star: starmap.StarMap, local: MirrorFrame, active: mi.Bool | bool) -> mi.Point3f:
    """The point of the mirror's outline, as the eye sees it, between the directions to E and to V."""
    to_V, to_E = directions_of(star, local)
    cosine = dr.clip(dr.dot(to_V, to_E), -1, 1)
    across = to_V - cosine * to_E
    opposite = dr.squared_norm(across) < 1e-10  # then any way round leads there
    across = dr.select(opposite, mi.coordinate_system(to_E)[0], unit(across))
    low, high, step = mi.Float(0), dr.acos(cosine), mi.UInt32(0)
    R = mi.Point3f(0)
    while dr.hint(active & (step < OUTLINE_HALVINGS), label="find the outline"):
        middle = 0.5 * (low + high)
        turn = dr.sincos(middle)
        u = turn[1] * to_E + turn[0] * across
        r, gradient = starmap.sample(star, u, active)
        R = mi.Point3f(star.centre + r * u)
        turned = star.side * dr.dot(u - gradient, local.eye - R) > 0
        low, high = dr.select(turned, middle, low), dr.select(turned, high, middle)
        step += 1
    return R
