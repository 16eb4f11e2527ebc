"""Triangle setup: from three vertices to what tells, for every pixel centre, whether it is inside and how near the triangle is.

Fill rule. A pixel centre is inside where all three edge functions are positive, or zero on an edge that owns its points
("top-left"). An edge function is evaluated from its two end points in an order that does not depend on the triangle, so
that the two triangles at an edge see the same number with opposite signs: no holes, no double hits.

Depth is 1/w, which is linear on the screen and keeps its relative precision at all distances; from an eye far away, its
difference to that of the mirrors (`kernels.depths.nearness`).

Near plane. Nothing is cut: a triangle that crosses it keeps its edges in homogeneous form (Olano and Greer 1997, "Triangle
scan conversion using 2D homogeneous coordinates"), its box is that of the part in front, and pixels in front of the plane
are refused one by one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import drjit as dr
import mitsuba as mi

from benchharness.kernels import depths
from benchharness.kernels.types import View

CLOSED = 0x8000_0000  # in the fourth number of a triangle: its back is never seen
NO_SLOPE = 1e-30  # square of how much an edge function changes from pixel to pixel, below which it is the same in all
OFF_SCREEN = -1e6  # a row above every picture

Cull = Literal["", "back", "front"]
"""What is not drawn: nothing; triangles marked CLOSED that turn their clockwise side to the eye; all that turn their
counter-clockwise side to it."""


@dataclass
class DrawCall:
    """What is to be drawn.

    points  packets of the vertices: x, y, z and one that is ignored here
    faces   packets of the triangles: three vertices and one whose highest bit is CLOSED
    count   how many triangles
    view    the camera
    drawn   bool [count], the triangles to draw; None for all
    cull    what of those is dropped
    values  a second value, per vertex and linear on the screen; None where nothing asks for it
    order   what is sorted by; None for nearness
    """

    points: mi.Float
    faces: mi.UInt32
    count: int
    view: View
    drawn: mi.Bool | None = None
    cull: Cull = ""
    values: mi.Float | None = None
    order: depths.Order | None = None


@dataclass
class Edge:
    """A (px - x) + B (py - y), times the triangle's orientation: positive inside. `owns`: points with value 0 are inside."""

    x: mi.Float
    y: mi.Float
    A: mi.Float
    B: mi.Float
    owns: mi.Bool


@dataclass
class Setup:
    """A triangle ready to be walked.

    edges          three
    plane          nearness at a pixel's centre: x + y px + z py
    second         the second value there, likewise; None without
    left, top      first pixel of the triangle's box
    columns, rows  its size; 0 where nothing is to be drawn
    """

    edges: list[Edge]
    plane: mi.Vector3f
    second: mi.Vector3f | None
    left: mi.Int32
    top: mi.Int32
    columns: mi.Int32
    rows: mi.Int32


@dataclass
class Corner:
    """A vertex on the screen.

    h      homogeneous: column and row times depth, depth
    x, y   column and row; meaningless where not in front
    near   nearness, likewise; `near_h`: times depth
    front  it lies beyond the near plane
    """

    h: mi.Vector3f
    x: mi.Float
    y: mi.Float
    near: mi.Float
    near_h: mi.Float
    front: mi.Bool


def setup(draw: DrawCall) -> Setup:
    """Loads, projects and prepares all triangles, one lane each."""
    view = draw.view
    active = mi.Bool(True) if draw.drawn is None else draw.drawn
    face = dr.gather(mi.Vector4u, draw.faces, dr.arange(mi.UInt32, draw.count), active)
    vertices = (face.x, face.y, face.z)
    row = depths.row(view) if draw.order is None else draw.order.row
    corners = [_projected(view, row, dr.gather(mi.Vector4f, draw.points, i, active)) for i in vertices]
    a, b, c = corners

    # Orientation and the plane of nearness, from the screen where the triangle is whole, else from homogeneous coordinates.
    whole = a.front & b.front & c.front
    d1x, d1y, d2x, d2y = b.x - a.x, b.y - a.y, c.x - a.x, c.y - a.y
    area = d1x * d2y - d1y * d2x
    lines = [dr.cross(p.h, q.h) for p, q in ((a, b), (b, c), (c, a))]
    size = dr.select(whole, area, dr.dot(c.h, lines[0]))
    per_size = dr.rcp(size)
    line = (c.near_h * lines[0] + a.near_h * lines[1] + b.near_h * lines[2]) * per_size

    def linear(of_a: mi.Float, of_b: mi.Float, of_c: mi.Float) -> mi.Vector3f:
        """The plane through a number at each corner of a whole triangle."""
        v1, v2 = of_b - of_a, of_c - of_a
        gx, gy = (v1 * d2y - v2 * d1y) * per_size, (v2 * d1x - v1 * d2x) * per_size
        return mi.Vector3f(of_a - gx * a.x - gy * a.y, gx, gy)

    on_screen = linear(a.near, b.near, c.near)
    plane = dr.select(whole, on_screen, mi.Vector3f(line.z, line.x, line.y))
    second = None
    if draw.values is not None:
        # A triangle that crosses the near plane has no such plane: it passes every test.
        of_screen = linear(*(dr.gather(mi.Float, draw.values, i, active) for i in vertices))
        second = dr.select(whole, of_screen, mi.Vector3f(1e30, 0, 0))

    left, top, columns, rows = _box(corners, view)
    drawn = active & dr.isfinite(per_size) & (size != 0) & (a.front | b.front | c.front) & (columns > 0) & (rows > 0)
    # y points down: counter-clockwise in space is negative on the screen.
    if draw.cull == "back":
        drawn &= (size < 0) | ((face.w & CLOSED) == 0)
    elif draw.cull == "front":
        drawn &= size > 0
    return Setup(
        edges=[_edge(p, q, size > 0) for p, q in ((a, b), (b, c), (c, a))],
        plane=plane,
        second=second,
        left=left,
        top=top,
        columns=dr.select(drawn, columns, 0),
        rows=dr.select(drawn, rows, 0),
    )


def _projected(view: View, row: mi.Vector4f, packet: mi.Vector4f) -> Corner:
    """A vertex on the screen of a view. `row`: of what is sorted by."""
    p = mi.Vector4f(packet)
    p.w = 1.0
    h = mi.Vector3f(dr.dot(view.x, p), dr.dot(view.y, p), dr.dot(view.w, p))
    near_h, per_depth = dr.dot(row, p), dr.rcp(h.z)
    return Corner(h, h.x * per_depth, h.y * per_depth, near_h * per_depth, near_h, h.z > view.near)


def _box(corners: list[Corner], view: View) -> tuple[mi.Int32, mi.Int32, mi.Int32, mi.Int32]:
    """The pixels of the part in front of the near plane: first column and row, how many columns and rows."""
    low_x, low_y, high_x, high_y = mi.Float(dr.inf), mi.Float(dr.inf), mi.Float(-dr.inf), mi.Float(-dr.inf)
    for k in range(3):
        a, b = corners[k], corners[(k + 1) % 3]
        cut = dr.lerp(a.h, b.h, (view.near - a.h.z) / (b.h.z - a.h.z)) / view.near
        for x, y, counts in ((a.x, a.y, a.front), (cut.x, cut.y, a.front ^ b.front)):
            low_x, low_y = dr.select(counts & (x < low_x), x, low_x), dr.select(counts & (y < low_y), y, low_y)
            high_x, high_y = dr.select(counts & (x > high_x), x, high_x), dr.select(counts & (y > high_y), y, high_y)
    left, columns = _pixels(low_x, high_x, view.width)
    top, rows = _pixels(low_y, high_y, view.height)
    return left, top, columns, rows


def _pixels(low: mi.Float, high: mi.Float, count: int) -> tuple[mi.Int32, mi.Int32]:
    """First pixel whose centre is at or after `low`, and how many from there up to `high`, within [0, count)."""
    start = mi.Int32(dr.ceil(dr.clip(low, 0.5, count + 0.5) - 0.5))
    stop = mi.Int32(dr.floor(dr.clip(high, -0.5, count - 0.5) - 0.5))
    return start, stop - start + 1


def _edge(one: Corner, other: Corner, positive: mi.Bool) -> Edge:
    """The edge between two corners, computed in the order of their coordinates and not in the triangle's."""
    both = one.front & other.front
    swap = dr.select(both, (other.x < one.x) | ((other.x == one.x) & (other.y < one.y)), _before(other.h, one.h))
    a, b = dr.select(swap, other, one), dr.select(swap, one, other)

    line = dr.cross(a.h, b.h)
    slope = dr.square(line.x) + dr.square(line.y)
    foot = -line.z * dr.rcp(dr.maximum(slope, NO_SLOPE))
    # An edge at depth 0 is seen nowhere: all of the triangle that is in front of the eye is inside.
    nowhere = ~a.front & ~b.front & (slope < NO_SLOPE)
    x = dr.select(a.front, a.x, dr.select(b.front, b.x, dr.select(nowhere, 0, foot * line.x)))
    y = dr.select(a.front, a.y, dr.select(b.front, b.y, dr.select(nowhere, OFF_SCREEN, foot * line.y)))
    sign = dr.select(swap ^ positive, mi.Float(1), mi.Float(-1))
    A = dr.select(nowhere, 0, sign * dr.select(both, a.y - b.y, line.x))
    B = dr.select(nowhere, 1, sign * dr.select(both, b.x - a.x, line.y))
    return Edge(x, y, A, B, (A > 0) | ((A == 0) & (B > 0)))


def _before(a: mi.Vector3f, b: mi.Vector3f) -> mi.Bool:
    """Whether a's coordinates come before b's."""
    return (a.x < b.x) | ((a.x == b.x) & ((a.y < b.y) | ((a.y == b.y) & (a.z < b.z))))
