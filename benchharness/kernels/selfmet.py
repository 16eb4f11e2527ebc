"""Where a mirror may see itself: rays that leave a hollow of it, by the curvature there, or start below their own facet.

Let a pixel's mirror direction r leave p under the angle c to the normal n, in a plane in which the surface bends towards r with
radius q. The circle of that radius is met again at p + 2 q cos(c) r (the chord of a circle). If that point lies within the
mirror's box, the mirror is likely there: exact for a part of a sphere that fills its box; a guess elsewhere. Where the
surface bends away, it is met nowhere nearby.

The curvature comes from the neighbouring pixels: their points are p + u_i, their normals n + m_i. In the tangent plane r
has the direction t = a u_1 + b u_2, in which the normal turns by a m_1 + b m_2, and the curvature is t·(a m_1 + b m_2) / t·t.

The plane through the three points is nearly the facet's, whatever the smooth normals say: a ray that leaves p to its other
side starts within the mirror.
"""

from __future__ import annotations

from collections.abc import Sequence

import drjit as dr
import mitsuba as mi

SKEW = 1e-4  # of |u_1 x u_2|² to |u_1|² |u_2|²: below this the neighbours say nothing of one direction


@dr.syntax
def away(
    p: mi.Point3f,
    n: mi.Normal3f,
    r: mi.Vector3f,
    steps: Sequence[mi.Vector3f],
    turns: Sequence[mi.Vector3f],
    box: Sequence[mi.Vector4f],
    active: mi.Bool | bool = True,
) -> mi.Float:
    """How far along r the mirror is likely met again, inf where it is not.

    steps, turns  u_i and m_i, to the right and down; 0 where that neighbour is of something else: then inf
    box           three rows that take a point of the world to [-1, 1] across the mirror's box
    """
    u, v = steps
    e, f, g = dr.dot(turns[0], u), 0.5 * (dr.dot(turns[0], v) + dr.dot(turns[1], u)), dr.dot(turns[1], v)
    facet = dr.cross(u, v)
    known = active & (dr.squared_norm(facet) > SKEW * dr.squared_norm(u) * dr.squared_norm(v))
    below = known & (dr.dot(facet, r) * dr.dot(facet, mi.Vector3f(n)) < 0)
    t = dr.select(below, mi.Float(0), dr.inf)
    if known & ~below & ((e < 0) | (g < 0) | (e * g < f * f)):  # most mirrors bend away in every direction
        t = _again(p, n, r, steps, turns, box)
    return t


def _again(
    p: mi.Point3f,
    n: mi.Normal3f,
    r: mi.Vector3f,
    steps: Sequence[mi.Vector3f],
    turns: Sequence[mi.Vector3f],
    box: Sequence[mi.Vector4f],
) -> mi.Float:
    """The length of the chord where it ends in the box, else inf."""
    u, v = steps
    cosine = dr.dot(n, r)
    t = r - cosine * n
    uu, uv, vv, ut, vt = dr.dot(u, u), dr.dot(u, v), dr.dot(v, v), dr.dot(u, t), dr.dot(v, t)
    scale = dr.rcp(uu * vv - uv * uv)
    a, b = (vv * ut - uv * vt) * scale, (uu * vt - uv * ut) * scale
    curvature = dr.dot(t, a * turns[0] + b * turns[1])
    # t·t / curvature is the radius; a chord that goes nowhere bounded ends beyond every box.
    chord = -2 * cosine * dr.squared_norm(t) * dr.rcp(dr.minimum(curvature, -1e-9))
    q = p + chord * r
    inside = curvature < 0
    for row in box:
        inside &= dr.abs(dr.dot(row.xyz, mi.Vector3f(q)) + row.w) <= 1
    return dr.select(inside, chord, dr.inf)
