"""What things cost, counted: operations of Dr.Jit's own code, reads of maps, texels. Times are another matter.

An operation is one instruction of a kernel before LLVM has it: an addition as well as a square root, and a read. The arc cosine
and the arc tangent are polynomials there.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from catalogue.catalogue_row import Row, within
from oracles import secant_oracle as oracle
from support.mirror_room import Answer, mirror_room, shaded
from support.placed import EYE, host, mapped, off_px, place, points
from support.secant_cases import classed, star_of
from support.star_shapes import Ellipsoid, truths

from benchharness.kernels import cubemap, optics, surroundings
from benchharness.kernels.images import distancemap, layered
from benchharness.kernels.vertices import secant
from benchharness.measure import timing
from methods.distance_impostor import DistanceImpostor

CLASSES = ((0.5, 1.0), (0.2, 0.5), (0.02, 0.2))  # cosines of incidence


def operations(made: Callable[[], object]) -> list[int]:
    """Of each kernel that is launched to evaluate what `made` returns."""
    return [kernel["operation_count"] for kernel in timing.kernels_of(made) if kernel["type"] == dr.KernelType.JIT]


# RH06 3.1: Alhazen's polynomial, solved in closed form, beside secants.


def ferrari(E: mi.Point3f, V: mi.Point3f) -> mi.Point3f:
    """The reflection point of V on the unit sphere, by the roots of a quartic in t = tan(angle from the eye / 2).

    With the eye at a and V at (p, q) in their plane, it is q (a + 1) t^4 + (4 a p + 2 (a + p)) t^3 - 6 a q t^2
    + (2 (a + p) - 4 a p) t + q (a - 1) = 0, and of its four real roots one is between the directions to the eye and to V.
    """
    a = dr.norm(E)
    x = mi.Vector3f(E) * dr.rcp(a)
    p = dr.dot(V, x)
    y = mi.Vector3f(V) - p * x
    q = dr.norm(y)
    y *= dr.rcp(q)
    lead = dr.rcp(q * (a + 1))
    b, c, d, e = (k * lead for k in (4 * a * p + 2 * (a + p), -6 * a * q, 2 * (a + p) - 4 * a * p, q * (a - 1)))

    # t = s - b / 4 takes the cubic term away: s^4 + P s^2 + Q s + R = 0.
    b2 = b * b
    P, Q = c - 0.375 * b2, d - 0.5 * b * c + 0.125 * b * b2
    R = e - 0.25 * b * d + b2 * c / 16 - 3 * b2 * b2 / 256

    # The largest of three real roots of the resolvent m^3 + P m^2 + (P^2 / 4 - R) m - Q^2 / 8 = 0.
    u, v = P * P / 36 + R / 3, P * P * P / 216 - P * R / 6 + Q * Q / 16
    radius = dr.sqrt(dr.maximum(u, 0))
    angle = dr.acos(dr.clip(v * dr.rcp(dr.maximum(radius * radius * radius, 1e-30)), -1, 1)) / 3
    m = dr.maximum(2 * radius * dr.cos(angle) - P / 3, 1e-30)

    s = dr.sqrt(2 * m)
    inner, outer = -2 * (P + m), 2 * Q * dr.rcp(s)
    one, two = (dr.sqrt(dr.maximum(inner + sign * outer, 0)) for sign in (-1, 1))
    roots = [0.5 * (s + one) - 0.25 * b, 0.5 * (s - one) - 0.25 * b, 0.5 * (two - s) - 0.25 * b, -0.5 * (s + two) - 0.25 * b]
    length = dr.norm(V)
    end = q * dr.rcp(length + p)  # tan of half the angle to V
    t, off = mi.Float(0), mi.Float(dr.inf)
    for root in roots:
        beyond = dr.maximum(-root, root - end)
        t, off = dr.select(beyond < off, root, t), dr.minimum(beyond, off)
    scale = dr.rcp(1 + t * t)
    return mi.Point3f((1 - t * t) * scale * x + 2 * t * scale * y)


def searching(V):
    """A function that starts the paper's search for V, and one that goes on until all have stopped."""
    star, where, count = star_of("sphere"), place(V), len(V)
    every, no = dr.full(mi.Bool, True, count), dr.full(mi.Bool, False, count)
    last = mi.Vector3f(dr.zeros(mi.Float, count))

    def begun():
        first = secant.start("param", "paper", star, where, last, no, every)
        dr.eval(first)
        return first

    def gone_on(first):
        return secant.close_in(
            "param", "edge", star, where, first, every, dr.opaque(mi.Float, oracle.TAU["edge"]), dr.opaque(mi.UInt32, 60)
        )

    return begun, gone_on


@cache
def of_a_step() -> float:
    """Operations of one sample of a search by secants, the whole loop run kernel by kernel."""
    begun, gone_on = searching(classed("sphere", 0.5, 1.0)[0])
    first = begun()
    with dr.scoped_set_flag(dr.JitFlag.SymbolicLoops, False):
        counts = operations(lambda: gone_on(first))
    return float(np.median(counts))


@cache
def of_a_closed_form() -> float:
    V = points(classed("sphere", 0.5, 1.0)[0])
    E = mi.Point3f(*map(float, EYE))
    dr.make_opaque(E)
    return float(sum(operations(lambda: ferrari(E, V))))


@cache
def closed(low: float, high: float) -> np.ndarray:
    """px off, of the closed form in float32, 300 vertices."""
    V, R = classed("sphere", low, high)
    return off_px(host(ferrari(mi.Point3f(*map(float, EYE)), points(V))), R)


# RH06 3.3.7: directions into angles.


def of_a_lookup(angles: bool) -> float:
    """Operations of a bilinear lookup of four numbers, in a map by angles or in a cube map."""
    d = points(np.random.default_rng(0).normal(size=(1000, 3)))
    dr.make_opaque(d)
    if angles:
        far = surroundings.Surroundings(None, dr.zeros(mi.Float, 4 * 128 * 257), 128, 256)
        dr.make_opaque(far.texels)
        return float(sum(operations(lambda: surroundings.radiance(far, mi.Vector3f(d)))))
    texels = dr.zeros(mi.Float, 4 * cubemap.texels_of(74))
    dr.make_opaque(texels)
    return float(sum(operations(lambda: cubemap.lookup(texels, 74, mi.Vector3f(d)))))


# PMDS06 3.2: ground and four walls as a box, or as quads.


def quad(o, d, middle, a, b, k):
    """Distance along a ray to a quad [middle; axes over half lengths; normal], inf for a miss."""
    t = dr.dot(middle - o, k) * dr.rcp(dr.dot(d, k))
    offset = o + t * d - middle
    met = (t > 0) & (dr.abs(dr.dot(offset, a)) <= 1) & (dr.abs(dr.dot(offset, b)) <= 1)
    return dr.select(met, t, dr.inf)


def open_box(o, d, middle, a, b, up):
    """(distance, which side) where a ray from within a box that is open above leaves it: 0 for the ground, 1 to 4 for walls, 5
    for the top."""
    start, step = (mi.Vector3f(*(dr.dot(v, axis) for axis in (a, b, up))) for v in (o - middle, d))
    t = (dr.select(step >= 0, 1, -1) - start) * dr.rcp(step)
    nearest = dr.minimum(t.x, dr.minimum(t.y, t.z))
    wall = dr.select(nearest == t.x, dr.select(step.x > 0, mi.UInt32(1), 2), dr.select(step.y > 0, mi.UInt32(3), 4))
    return nearest, dr.select(nearest == t.z, dr.select(step.z > 0, mi.UInt32(5), 0), wall)


def nearest(o, d, frames):
    """(distance, which) of the first of some quads that a ray meets."""
    t, which = mi.Float(dr.inf), mi.UInt32(0)
    for number, frame in enumerate(frames):
        met = quad(o, d, *frame)
        t, which = dr.minimum(t, met), dr.select(met < t, mi.UInt32(number), which)
    return t, which


def of_quads(count: int) -> float:
    """Operations of `nearest`."""
    o, d, frames = rays_and_frames(count)
    return float(sum(operations(lambda: nearest(o, d, frames))))


def of_a_box() -> float:
    o, d, (frame,) = rays_and_frames(1)
    return float(sum(operations(lambda: open_box(o, d, *frame))))


def rays_and_frames(count: int, rays: int = 1000):
    """Origins and directions of rays, and any quads."""
    rng = np.random.default_rng(0)
    o, d = (mi.Vector3f(points(v)) for v in rng.normal(size=(2, rays, 3)))
    frames = [[mi.Vector3f(*map(float, v)) for v in rng.normal(size=(4, 3))] for _ in range(count)]
    dr.make_opaque(o, d, frames)
    return o, d, frames


def quads_for_a_box() -> float:
    """How many quads cost as many operations as the box: each further quad adds the same."""
    one, five = of_quads(1), of_quads(5)
    return 1 + (of_a_box() - one) / ((five - one) / 4)


# PMDS06 2 and 6: rays through layers.


def rays_of(answer: Answer) -> tuple[distancemap.Ray, mi.Bool]:
    """The reflected rays of a mirror ball about the origin, and which there are: all."""
    p, n, v = (np.array(a).T[answer.active.ravel()] for a in (answer.frame.p, answer.frame.n, answer.frame.v))
    r = optics.reflect(mi.Vector3f(points(v)), mi.Normal3f(points(n)))
    of, every = distancemap.ray(mi.Vector3f(points(p)), r), dr.full(mi.Bool, True, len(p))
    dr.eval(of, every)
    return of, every


@cache
def reads(layers: int) -> float:
    """Reads of distance, four texels each, per ray of a mirror among balls; one layer, or so many."""
    (answer,) = shaded(DistanceImpostor(layers=layers, resolution=128), mirror_room(), 0, size=(80, 60))
    of, every = rays_of(answer)
    count = dr.width(every)
    lane, counted, asked = dr.arange(mi.UInt32, count), dr.zeros(mi.UInt32, count), distancemap.seen
    dr.eval(lane, counted)

    def counting(map, d, active):
        dr.scatter_add(counted, mi.UInt32(1), lane, mi.Bool(active))
        return asked(map, d, active)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(distancemap, "seen", counting)
        if layers > 1:
            dr.eval(layered.march(answer.state.layers[0], of, 64, 6, every).spot.t)
        else:
            dr.eval(distancemap.march(answer.state.distances[0], of, 64, 6, every).spot.t)
    return float(np.array(counted).mean())


# EMDT06 2: a mirror that changes its shape.


@cache
def changed(kept: bool) -> float:
    """px off, median, of 300 vertices before an ellipsoid that has become thicker by a sixth: by the map of what it was, or by
    one made anew."""
    was, now = Ellipsoid(half=(1.0, 0.6, 1.4)), Ellipsoid(half=(1.0, 0.7, 1.4))
    V, R = truths(now, EYE, 0, 300, 0.2, 1.0)
    star, count = mapped(was if kept else now, 256), len(V)
    no, cold = dr.full(mi.Bool, False, count), mi.Vector3f(dr.zeros(mi.Float, count))
    options = secant.Options("param", "edge", "near")
    s = secant.solve(options, star, place(V), cold, no, ~no, mi.Float(0.1), mi.UInt32(60))
    return float(np.median(off_px(host(s.R), R)))


LAYERS = {1: 39.8, 2: 156, 3: 231, 4: 307}
OWN = "our own, pinned; as Dr.Jit has them, from version to version"

ROWS: list[Row] = [
    Row("RH06 3.1", "operations of a sample by secants", "fewer than the closed form's", of_a_step, *within(580, 0.25), OWN),
    Row("RH06 3.1", "operations of the closed form", "more than all samples'", of_a_closed_form, *within(274, 0.25), OWN),
    *(Row("RH06 3.1", f"px off, median, closed form in float32, cosines {low} to {high}", "-",
          lambda low=low, high=high: np.median(closed(low, high)), 0, 1e-3, "rounding") for low, high in CLASSES),
    Row("RH06 3.1", "px off, largest, closed form in float32, head-on", "-", lambda: closed(0.5, 1.0).max(), 0.5, 80,
        "V nearly in line with eye and centre: the quartic's first coefficient goes to 0"),
    Row("RH06 3.3.7", "operations of a lookup by angles", "much more than in a cube map", lambda: of_a_lookup(True),
        *within(139, 0.25), OWN),
    Row("RH06 3.3.7", "operations of a lookup in a cube map", "-", lambda: of_a_lookup(False), *within(117, 0.25), OWN),
    Row("PMDS06 3.2", "quads that cost as many operations as a box of ground and walls", "3", quads_for_a_box, 1.2, 1.9, OWN),
    *(Row("PMDS06 6", f"reads per ray, {n} {'layer' if n == 1 else 'layers'}", "considerably slower in layers",
          lambda n=n: reads(n), *within(value, 0.05), "our own, pinned") for n, value in LAYERS.items()),
    Row("EMDT06 2", "texels that secants' map of a mirror has, 256 per edge", "-", lambda: cubemap.texels_of(256),
        399384, 399384, "6 faces of 258 x 258"),
    Row("EMDT06 2", "px off, median, by the map of what the mirror was", "-", lambda: changed(True), 13.5, 15.2,
        "our own, pinned"),
    Row("EMDT06 2", "px off, median, by a map made anew", "-", lambda: changed(False), 0, 0.01, "rounding"),
]  # fmt: skip
