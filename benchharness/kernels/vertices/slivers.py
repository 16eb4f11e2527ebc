"""Triangles so small that they may cover no pixel's centre: each is kept at the pixel in which its middle is seen, the nearest
of several. Towards the outline of a convex mirror images are narrower than a pixel, and what is there would be in no pixel's
list."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from benchharness.kernels import depths, raster
from benchharness.kernels.frozen import frozen
from benchharness.kernels.types import View

LARGEST = 8.0  # pixels squared: those that may be long and thinner than a pixel, too


@frozen
def slivers(
    points: mi.Float,
    faces: mi.UInt32,
    face_count: int,
    view: View,
    limit: mi.Float,
    layers: tuple[mi.UInt32, mi.UInt32] | None,
    drawn: mi.Bool,
) -> mi.UInt32:
    """Per pixel of the view, the nearest of the triangles smaller than LARGEST whose middle is seen there, `raster.NONE` for
    none; arguments as `raster.rasterize` has them. Of two as near, the lower number."""
    triangle = dr.arange(mi.UInt32, face_count)
    _, corner = raster.corners(points, faces, triangle, drawn)
    x, y, front = [], [], mi.Bool(drawn)
    for q in corner:
        p = mi.Vector4f(q.x, q.y, q.z, 1)
        w = dr.dot(view.w, p)
        front &= w > view.near
        scale = dr.rcp(dr.maximum(w, view.near))
        x.append(dr.dot(view.x, p) * scale)
        y.append(dr.dot(view.y, p) * scale)
    area = 0.5 * dr.abs((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]))
    column, row = (mi.Int32(dr.floor((a[0] + a[1] + a[2]) / 3)) for a in (x, y))
    here = front & (area < LARGEST) & (column >= 0) & (row >= 0) & (column < view.width) & (row < view.height)
    pixel = mi.UInt32(row * view.width + column)
    middle = mi.Point3f((corner[0].xyz + corner[1].xyz + corner[2].xyz) / 3)
    near = depths.nearness(view, depths.offset(view, middle))
    here &= near <= dr.gather(mi.Float, limit, pixel, here)
    if layers is not None:
        here &= layers[0] == dr.gather(mi.UInt32, layers[1], pixel, here)
    best = dr.zeros(mi.UInt64, view.width * view.height)
    bits = dr.reinterpret_array(mi.UInt32, near)
    bits = dr.select(near < 0, ~bits, bits | 0x8000_0000)  # in the order of the numbers
    dr.scatter_reduce(dr.ReduceOp.Max, best, (mi.UInt64(bits) << 32) | mi.UInt64(~triangle), pixel, here, dr.ReduceMode.Direct)
    return dr.select(best == 0, raster.NONE, ~mi.UInt32(best & 0xFFFF_FFFF))
