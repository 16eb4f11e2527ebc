"""Proxies: simple surfaces in place of the scene's, on which a reflected ray ends before a cube map is asked what is there.

A map shows its centre the scene by direction. From another point the same direction shows something else, unless all is
infinitely far away. If the scene lay on the proxy, the ray from p along r would end on it after t metres, and the map with
the centre c would show that in the direction p + t r - c.

    Sphere  about the map's centre: |x + t r| = radius with x = p - c, so t = -b + sqrt(b² - q), b = x·r, q = x·x - radius²
            (Bjorke 2004). r has length 1.
    Box     of any place and turn: in its own axes the ray leaves slab k after (±half_k - x_k) / r_k, and the box with the first
            of them (Lagarde and Zanuttini 2012). Point and direction are turned into the box; t is the same in the world.

A ray that starts outside ends where it leaves the proxy, if it meets it. If it does not, t is inf, and the direction is
looked up as it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels import cubemap

LARGEST = 1e6  # units: the radius of a sphere in which nothing is near


@dataclass
class Sphere:
    """About the map's centre; `radius` in units."""

    radius: mi.Float


@dataclass
class Box:
    """Three rows that take a point of the world to the box's own axes, its middle at 0, in units; half its sides."""

    rows: list[mi.Vector4f]
    half: mi.Vector3f


Proxy = Sphere | Box


def reach(proxy: Proxy, p: mi.Point3f, r: mi.Vector3f, centre: mi.Point3f) -> mi.Float:
    """How far the ray from p along the unit vector r goes until it leaves the proxy, inf where it never does.

    centre  of the map
    """
    if isinstance(proxy, Sphere):
        return _leaves_sphere(mi.Vector3f(p - centre), r, proxy.radius)
    return _leaves_box(within(proxy.rows, p), mi.Vector3f(*(dr.dot(row.xyz, r) for row in proxy.rows)), proxy.half)


def _leaves_sphere(x: mi.Vector3f, r: mi.Vector3f, radius: mi.Float) -> mi.Float:
    """The larger root of |x + t r| = radius where it lies ahead."""
    b = dr.dot(x, r)
    determinant = dr.square(b) - (dr.squared_norm(x) - dr.square(radius))
    t = -b + dr.sqrt(dr.maximum(determinant, 0))
    return dr.select((determinant >= 0) & (t > 0), t, dr.inf)


def within(rows: list[mi.Vector4f], p: mi.Point3f) -> mi.Vector3f:
    """A point of the world in the axes of a box with these rows."""
    return mi.Vector3f(*(dr.dot(row.xyz, mi.Vector3f(p)) + row.w for row in rows))


def _leaves_box(x: mi.Vector3f, r: mi.Vector3f, half: mi.Vector3f) -> mi.Float:
    """Where the last of the slabs is left, in a box's own axes."""
    enter, leave = crossed(x, r, half)
    return dr.select((leave > 0) & (enter <= leave), leave, dr.inf)


def crossed(x: mi.Vector3f, r: mi.Vector3f, half: mi.Vector3f) -> tuple[mi.Float, mi.Float]:
    """When the ray from x along r has entered all three slabs |x_k| <= half_k, from 0 on, and when it leaves the first of them.

    Along a slab it never leaves it, and is within it or outside all the way: there is no 0 * inf where it runs in a side."""
    enter, leave = mi.Float(0), mi.Float(dr.inf)
    for k in range(3):
        moves = r[k] != 0
        per_metre = dr.rcp(dr.select(moves, r[k], 1))
        one, two = (-half[k] - x[k]) * per_metre, (half[k] - x[k]) * per_metre
        beside = dr.select(dr.abs(x[k]) <= half[k], mi.Float(-dr.inf), dr.inf)
        enter = dr.maximum(enter, dr.select(moves, dr.minimum(one, two), beside))
        leave = dr.minimum(leave, dr.select(moves, dr.maximum(one, two), dr.inf))
    return enter, leave


def towards(x: mi.Vector3f, r: mi.Vector3f, t: mi.Float) -> mi.Vector3f:
    """The unit direction from the map's centre to x + t r; r itself where t is inf."""
    met = dr.isfinite(t)
    end = x + dr.select(met, t, 0) * r
    length = dr.norm(end)
    return dr.select(met & (length > 0), end * dr.rcp(dr.maximum(length, 1e-12)), r)


def fitted(map: cubemap.Pyramid) -> Sphere:
    """The sphere of a map's mean distance, over all directions in which its finest level shows a surface, divided by their
    share: surroundings count as far. Without a surface it is as large as LARGEST."""
    n, width = map.n, map.n + 2
    lane = dr.arange(mi.UInt32, 6 * width * width)
    cell = lane % (width * width)
    row, column = cell // width, cell % width
    u, v = ((2 * mi.Float(k) - 1) / n - 1 for k in (column, row))
    inner = (row > 0) & (row <= n) & (column > 0) & (column <= n)
    solid = dr.select(inner, dr.power(1 + u * u + v * v, -1.5), 0)
    inverse = dr.gather(mi.Float, map.texels, 4 * lane + 3)
    near = inverse > 0
    surface = dr.sum(dr.select(near, solid, 0))
    total = dr.sum(dr.select(near, solid * dr.rcp(dr.select(near, inverse, 1)), 0))
    shown = surface > 0
    radius = total * dr.sum(solid) / dr.square(dr.select(shown, surface, 1))
    return Sphere(dr.select(shown, dr.minimum(radius, LARGEST), LARGEST))
