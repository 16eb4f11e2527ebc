"""Where virtual triangles may show the wrong thing: their edges are straight, and the images that they stand for are bent.

From one end of an edge to the other the reflection point moves by c pixels and the mirror's normal turns by an angle a. An arc
of that chord and that turn is c a / 8 away from the chord in its middle: its sagitta. The image of the edge is about that far
from the edge between its images, or WIDER times as far, and nothing is known of the direction: all within that distance of an
edge is its *band*, and an edge is *bent* if that is more than WRONG_PX. Where an edge is cut at the mirror's outline, the
normal turns until it is at a right angle to the eye's ray.

Nothing of this is worked out where no doubt is asked for.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels import depths, raster
from benchharness.kernels.pixels import WRONG_PX
from benchharness.kernels.placement import unit
from benchharness.kernels.types import View

WIDER = 2.0  # what the sagitta is at most to be multiplied by; images turn by up to twice what the normal does


@dataclass
class Bands:
    """Three edges per triangle, with a rectangle each on the screen.

    doubted  per triangle, whether one is bent, or a corner is unsure
    packets  4 floats per corner of the rectangles: a point at which the eye sees it
    bent     per edge, twice in a row
    count    edges
    """

    doubted: mi.Bool
    packets: mi.Float
    bent: mi.Bool
    count: int


@dataclass
class End:
    """The end of an edge.

    x     pixel
    n     the mirror's normal there
    rest  the angle by which it has yet to turn to the mirror's outline, or 0
    """

    x: mi.Point2f
    n: mi.Vector3f
    rest: mi.Float


def reflected(view: View, at: mi.Float, unsure: mi.Float, index: mi.UInt32, pixel: mi.Point2f) -> End:
    """The end of an edge at reflected vertices `index`; `at` and `unsure` as `virtual.Images` has them."""
    R, n = dr.gather(mi.Vector4f, at, index).xyz, dr.gather(mi.Vector4f, unsure, index).xyz
    return End(pixel, n, dr.asin(dr.clip(dr.dot(n, unit(view.eye - R)), 0, 1)))


def sagitta(a: End, b: End) -> mi.Float:
    """The sagitta of an edge between two reflected vertices, pixels."""
    return 0.125 * dr.norm(a.x - b.x) * 2 * dr.asin(dr.minimum(0.5 * dr.norm(a.n - b.n), 1))


def sagitta_to_outline(a: End, x: mi.Point2f) -> mi.Float:
    """The sagitta of an edge that ends at pixel x of the mirror's outline, pixels."""
    return 0.125 * dr.norm(a.x - x) * a.rest


@dataclass
class Edge:
    """An edge of a virtual triangle: pixels of both ends, and its sagitta in pixels."""

    a: mi.Point2f
    b: mi.Point2f
    sagitta: mi.Float


def bands(view: View, f: mi.UInt32, count: int, edges: list[Edge], active: mi.Bool, unsure: mi.Bool) -> Bands:
    """The bands of `count` triangles, numbers f, by their three edges; those that are `unsure` are doubted in any case."""
    packets, bent = dr.empty(mi.Float, 3 * 16 * count), dr.empty(mi.Bool, 6 * count)
    doubted, offset = active & unsure, dr.select(view.depth > 0, 0, dr.maximum(2 * view.near, 1))
    for k, e in enumerate(edges):
        a, b = e.a, e.b
        is_bent = active & (WIDER * e.sagitta > WRONG_PX)
        doubted |= is_bent
        along = b - a
        length = dr.norm(along)
        along = dr.select(length > 0, along * dr.rcp(dr.maximum(length, 1e-6)), mi.Point2f(1, 0)) * (WIDER * e.sagitta)
        across = mi.Point2f(-along.y, along.x)
        edge = 3 * f + k
        for corner, x in enumerate((a - along - across, b + along - across, b + along + across, a - along + across)):
            q = depths.on_ray(view, x.x, x.y, offset)
            dr.scatter(packets, mi.Vector4f(q.x, q.y, q.z, 0), 4 * edge + corner)
        for half in range(2):
            dr.scatter(bent, is_bent, 2 * edge + half)
    return Bands(doubted, packets, bent, 3 * count)


def covered(made: Bands, view: View, limit: mi.Float) -> mi.UInt32:
    """The bands drawn, to be asked by `raster.winner_at`: `raster.NONE` at pixels in no band."""
    triangle = dr.arange(mi.UInt32, 2 * made.count)
    first = 4 * (triangle // 2)
    half = triangle % 2
    faces = dr.empty(mi.UInt32, 8 * made.count)
    dr.scatter(faces, mi.Vector4u(first, first + 1 + half, first + 2 + half, 0), triangle)
    return raster.rasterize(made.packets, faces, 2 * made.count, view, limit=limit, drawn=made.bent)
