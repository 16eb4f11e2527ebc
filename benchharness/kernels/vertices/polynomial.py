"""All reflection points of a vertex on a mesh with interpolated normals: polynomials that are bounded on triangles.

On a triangle the point P, the directions D_E = E - P to the eye and D_V = V - P to the vertex, and the normal N, interpolated
and not normalised, are linear in the weights b of the corners. With a_E = D_E . N and a_V = D_V . N, of degree 2, and

    C = N . (D_E x D_V)                      degree 2, since D_E x D_V is linear: the terms in P x P vanish
    F = a_E (D_V x N) + a_V (D_E x N)        degree 4; F . N = 0, so that two components are left

P reflects V to E exactly where F = 0, a_E > 0 and a_V > 0: the slopes of both directions against N are opposite. C = 0, normal
and directions in one plane, follows. This is the system of Fan, Guo, Wang et al., "Specular polynomials", SIGGRAPH 2024, who
take C and one component of F.

They eliminate one weight by a resultant and look for the roots of a polynomial of degree 8 in the other. That costs a triangle
without roots, as nearly all are, as much as one with some. Where eye and vertex lie in one direction along a sphere's or a
plane's normal, C is 0 everywhere, and nothing can be eliminated; F has its one root. On every mesh of a sphere, where N is
linear in P, the leading coefficients of C and F are 0, and so is the determinant of full degree but for rounding.

So nothing is eliminated here. A polynomial lies between the least and the greatest of its coefficients in Bernstein's basis,
and so do its derivatives. A triangle has no root where a_E, a_V, C, or F after its own Jacobian's inverse say so; it has one at
most where that makes the Jacobian nearly 1 all over it, and Newton's method finds it from anywhere; otherwise its four parts
are asked. No reflection is missed but for those of a triangle with more than ROOTS, and two that are nearer to each other than
what is left at DEPTH.

Which triangles are asked, and what their roots are to a mirror: `complete`.

Positions are in the mirror's own frame (`kernels.placement`).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import drjit as dr
import mitsuba as mi

from benchharness.kernels.placement import MirrorFrame, unit
from benchharness.kernels.vertices import mirrormesh
from benchharness.kernels.vertices.mirrormesh import MirrorMesh

ROOTS = 4  # of a triangle that are kept
DEPTH = 8  # times that a triangle is quartered
NODES = 512  # parts of a triangle that are asked
ROUNDING = 2e-6  # of coefficients, of vectors no longer than 1: float32 after some ten roundings
SINGLE = 1 / 3  # farthest of the Jacobian from 1 for which Newton's method converges from anywhere
STEPS = 12  # of Newton's method
ARRIVED = 1e-3  # of a part of a triangle: a step this short is the last, a root this far outside belongs to it
BLURRED = 0.5  # the same, of a part at DEPTH on which the Jacobian is not nearly 1
TWIN = 2e-3  # of a triangle; roots nearer to each other are one

# Polynomials in the weights of a triangle, by their coefficients in Bernstein's basis

PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))  # of corners, to which the coefficients of degree 2 belong
POWERS = tuple((i, j, 4 - i - j) for i in range(5) for j in range(5 - i))  # of the weights, of degree 4
CORNERS = tuple(POWERS.index(power) for power in ((4, 0, 0), (0, 4, 0), (0, 0, 4)))


def _ways(power: tuple[int, ...]) -> int:
    """The multinomial coefficient of a power of the weights."""
    ways = factorial(sum(power))
    for k in power:
        ways //= factorial(k)
    return ways


def _power(pair: tuple[int, int]) -> tuple[int, ...]:
    return tuple(pair.count(k) for k in range(3))


def _terms(power: tuple[int, int, int]) -> list[tuple[int, int, float]]:
    """Which coefficients of two polynomials of degree 2 make that of their product at a power, and the weights of these."""
    found = []
    for i, one in enumerate(PAIRS):
        for j, other in enumerate(PAIRS):
            a, b = _power(one), _power(other)
            if tuple(map(sum, zip(a, b, strict=True))) == power:
                found.append((i, j, _ways(a) * _ways(b) / _ways(power)))
    return found


TERMS = tuple(_terms(power) for power in POWERS)
# Numbers of the three coefficients of degree 4 whose differences are those of the derivatives, of degree 3.
RISES = tuple(
    tuple(POWERS.index((i + (k == 0), j + (k == 1), 3 - i - j + (k == 2))) for k in range(3))
    for i in range(4)
    for j in range(4 - i)
)


@dataclass
class Fields:
    """What is linear on a triangle, at its corners: directions to eye and vertex, scaled to 1 at most, and the normal; in axes
    of which the third is the mean normal."""

    E: list[mi.Vector3f]
    V: list[mi.Vector3f]
    N: list[mi.Vector3f]

    def part(self, o: mi.Point2f, s: mi.Float) -> Fields:
        """The same at the corners o, o + (s, 0) and o + (0, s) in the weights of the second and the third corner."""

        def moved(x: list[mi.Vector3f]) -> list[mi.Vector3f]:
            e1, e2 = x[1] - x[0], x[2] - x[0]
            first = x[0] + o.x * e1 + o.y * e2
            return [first, first + s * e1, first + s * e2]

        return Fields(moved(self.E), moved(self.V), moved(self.N))


def fields(mesh: MirrorMesh, local: MirrorFrame, triangle: mi.UInt32, active: mi.Bool | bool) -> Fields:
    """The fields of a triangle."""
    p, n = mirrormesh.corners(mesh, triangle, local.eye, active)
    z = unit(mi.Vector3f(n[0] + n[1] + n[2]))
    x, y = mi.coordinate_system(z)

    def turned(vectors: list[mi.Vector3f], scale: mi.Float) -> list[mi.Vector3f]:
        return [scale * mi.Vector3f(dr.dot(x, v), dr.dot(y, v), dr.dot(z, v)) for v in vectors]

    def scaled(end: mi.Point3f) -> list[mi.Vector3f]:
        to_end = [mi.Vector3f(end - q) for q in p]
        longest = dr.maximum(dr.maximum(dr.norm(to_end[0]), dr.norm(to_end[1])), dr.norm(to_end[2]))
        return turned(to_end, dr.rcp(dr.maximum(longest, 1e-20)))

    return Fields(scaled(local.eye), scaled(local.V), turned(n, mi.Float(1)))


def _products(a: list[mi.Vector3f], b: list[mi.Vector3f]) -> list[mi.Float]:
    """The scalar product of two linear fields."""
    return [dr.dot(a[i], b[i]) if i == j else 0.5 * (dr.dot(a[i], b[j]) + dr.dot(a[j], b[i])) for i, j in PAIRS]


def _turns(d: list[mi.Vector3f], n: list[mi.Vector3f]) -> tuple[list[mi.Float], list[mi.Float]]:
    """The first two components of the vector product of two linear fields."""

    def x(i: int, j: int) -> mi.Float:
        return dr.fma(d[i].y, n[j].z, -d[i].z * n[j].y)

    def y(i: int, j: int) -> mi.Float:
        return dr.fma(d[i].z, n[j].x, -d[i].x * n[j].z)

    first, second = ([f(i, j) if i == j else 0.5 * (f(i, j) + f(j, i)) for i, j in PAIRS] for f in (x, y))
    return first, second


def _least(values: list[mi.Float]) -> mi.Float:
    least = values[0]
    for value in values[1:]:
        least = dr.minimum(least, value)
    return least


def _greatest(values: list[mi.Float]) -> mi.Float:
    return -_least([-value for value in values])


@dataclass
class Bounded:
    """What bounds say of a part of a triangle.

    empty   there is no root
    one     there is one root at most,
    single  and Newton's method finds it from anywhere
    blur    share of the part by which rounding moves it
    """

    empty: mi.Bool
    one: mi.Bool
    single: mi.Bool
    blur: mi.Float


def faces_both(f: Fields) -> mi.Bool:
    """Whether E and V may be in front, and the normal in one plane with the directions to both, somewhere on a triangle."""
    w = [dr.cross(e, v) for e, v in zip(f.E, f.V, strict=True)]
    c = _products(w, f.N)
    front = (_greatest(_products(f.E, f.N)) > 0) & (_greatest(_products(f.V, f.N)) > 0)
    return front & (_least(c) <= ROUNDING) & (_greatest(c) >= -ROUNDING)


def bounded(f: Fields) -> Bounded:
    """The bounds of F on a triangle."""
    a_E, a_V = _products(f.E, f.N), _products(f.V, f.N)
    x, y = (
        [_summed(terms, a_E, of_V, a_V, of_E) for terms in TERMS]
        for of_V, of_E in zip(_turns(f.V, f.N), _turns(f.E, f.N), strict=True)
    )
    raw = (_least(x) > ROUNDING) | (_greatest(x) < -ROUNDING) | (_least(y) > ROUNDING) | (_greatest(y) < -ROUNDING)

    # After the inverse of the Jacobian, F is nearly (u - u*, v - v*) with the root in the weights u*, v*.
    a, b, c, d = (g[CORNERS[k]] - g[CORNERS[0]] for g in (x, y) for k in (1, 2))
    det = a * d - b * c
    usable = dr.abs(det) > 1e-4 * (dr.abs(a * d) + dr.abs(b * c)) + 1e-30
    per = dr.select(usable, dr.rcp(dr.select(usable, det, 1)), 0)
    u = [per * dr.fma(d, p, -b * q) for p, q in zip(x, y, strict=True)]
    v = [per * dr.fma(a, q, -c * p) for p, q in zip(x, y, strict=True)]
    both = [p + q for p, q in zip(u, v, strict=True)]
    blur_u, blur_v = (ROUNDING * dr.abs(per) * (dr.abs(p) + dr.abs(q)) for p, q in ((b, d), (a, c)))
    beside = (_least(u) > blur_u) | (_greatest(u) < -blur_u) | (_least(v) > blur_v) | (_greatest(v) < -blur_v)
    beside |= _greatest(both) < -blur_u - blur_v

    off = mi.Float(0)
    for g, along in ((u, (1, 0)), (v, (0, 1))):
        parts = [[dr.abs(4 * (g[r[k]] - g[r[0]]) - along[k - 1]) for r in RISES] for k in (1, 2)]
        off = dr.maximum(off, _greatest(parts[0]) + _greatest(parts[1]))
    return Bounded(raw | (usable & beside), usable & (off < 1), usable & (off < SINGLE), dr.select(usable, blur_u + blur_v, 1))


def _summed(
    terms: list[tuple[int, int, float]], a: list[mi.Float], b: list[mi.Float], c: list[mi.Float], d: list[mi.Float]
) -> mi.Float:
    """A coefficient of a b + c d, all of degree 2."""
    total = mi.Float(0)
    for i, j, weight in terms:
        total += weight * dr.fma(a[i], b[j], c[i] * d[j])
    return total


# The roots of a triangle


@dataclass
class TriangleRoots:
    """The roots of a triangle.

    b        the first ROOTS of them
    count    how many
    settled  all parts were asked, and none at DEPTH is left in which there may be several
    nodes    parts that were asked
    """

    b: list[mi.Point2f]
    count: mi.UInt32
    settled: mi.Bool
    nodes: mi.UInt32


def newton_step(f: Fields, b: mi.Point2f) -> tuple[mi.Vector2f, mi.Bool]:
    """Newton's step towards F = 0 at the weights b; whether E and V are in front there."""

    def at(x: list[mi.Vector3f]) -> tuple[mi.Vector3f, list[mi.Vector3f]]:
        e = [x[1] - x[0], x[2] - x[0]]
        return x[0] + b.x * e[0] + b.y * e[1], e

    (E, dE), (V, dV), (N, dN) = at(f.E), at(f.V), at(f.N)
    a_E, a_V, g_E, g_V = dr.dot(E, N), dr.dot(V, N), dr.cross(E, N), dr.cross(V, N)
    F, J = a_E * g_V + a_V * g_E, []
    for k in range(2):
        d_E, d_V = (dr.dot(dx[k], N) + dr.dot(x, dN[k]) for x, dx in ((E, dE), (V, dV)))
        t_E, t_V = (dr.cross(dx[k], N) + dr.cross(x, dN[k]) for x, dx in ((E, dE), (V, dV)))
        J.append(d_E * g_V + a_E * t_V + d_V * g_E + a_V * t_E)
    det = J[0].x * J[1].y - J[1].x * J[0].y
    usable = dr.abs(det) > 1e-30
    per = dr.select(usable, dr.rcp(dr.select(usable, det, 1)), 0)
    step = mi.Vector2f(J[1].x * F.y - J[1].y * F.x, J[0].y * F.x - J[0].x * F.y) * per
    return dr.select(usable, step, mi.Vector2f(1e9)), (a_E > 0) & (a_V > 0)


@dr.syntax
def converge(f: Fields, b: mi.Point2f, size: mi.Float, active: mi.Bool) -> tuple[mi.Point2f, mi.Float, mi.Bool]:
    """Newton's method from b, in steps of twice `size` at most: where it ends, the next step's length and whether E and V are
    in front."""
    step, front = newton_step(f, b)
    k = mi.UInt32(0)
    while dr.hint(active & (k < STEPS) & (dr.norm(step) > 0.01 * ARRIVED * size), label="solve the polynomials"):
        b = mi.Point2f(b + dr.clip(step, -2 * size, 2 * size))
        step, front = newton_step(f, b)
        k += 1
    return b, dr.norm(step), front


@dr.syntax
def roots_of(f: Fields, active: mi.Bool) -> TriangleRoots:
    """The roots of a triangle. Its parts are asked depth first, without a stack: where one lies among its parent's four follows
    from two bits of `path`."""
    b = [mi.Point2f(0) for _ in range(ROOTS)]
    count, settled = mi.UInt32(0), mi.Bool(True)
    nodes = mi.UInt32(0)  # parts asked so far,
    o = mi.Point2f(0)  # the first corner of the next one,
    s = mi.Float(1)  # its sides; negative for the one in the middle,
    path = mi.UInt32(0)  # which of four it and its ancestors are,
    level = mi.UInt32(0)  # and how many these are
    running = mi.Bool(active)
    while dr.hint(running, label="ask the parts of a triangle"):
        own = f.part(o, s)
        nodes += 1
        may = faces_both(own)
        one, single, blur = mi.Bool(False), mi.Bool(False), mi.Float(1)
        if may:
            bounds = bounded(own)
            may, one, single, blur = ~bounds.empty, mi.Bool(bounds.one), mi.Bool(bounds.single), mi.Float(bounds.blur)
        last = level == DEPTH
        if may & (single | last):
            size = dr.abs(s)
            slack = dr.maximum(ARRIVED, dr.select(single, 2 * blur, BLURRED))
            slack = dr.minimum(slack, BLURRED)
            x, left, front = converge(f, o + s / 3, size, may)
            at = (x - o) / s
            new = front & (left < slack * size) & (at.x > -slack) & (at.y > -slack) & (at.x + at.y < 1 + slack)
            for i in range(ROOTS):
                new &= (i >= count) | (dr.norm(x - b[i]) > TWIN)
            for i in range(ROOTS):
                b[i] = dr.select(new & (count == i), x, b[i])
            settled &= one & (~new | (count < ROOTS))
            count += dr.select(new & (count < ROOTS), mi.UInt32(1), 0)
        down = may & ~single & ~last
        if down:
            s *= 0.5
            path <<= 2
            level += 1
        else:
            while dr.hint((level > 0) & ((path & 3) == 3), label="go up"):
                o = mi.Point2f(o + mi.Vector2f(s))
                s *= -2
                path >>= 2
                level -= 1
            running &= level > 0
            place = path & 3
            o = mi.Point2f(o + mi.Vector2f(dr.select(place == 1, -s, s), dr.select(place == 1, s, 0)))
            s = dr.select(place == 2, -s, s)
            path += 1
        settled &= ~running | (nodes < NODES)
        running &= nodes < NODES
    return TriangleRoots(b, count, settled, nodes)
