"""Depths told from where the mirrors are, and not from the eye.

Depth is measured along the view axis. From an eye 10,000 units away, float32 holds a depth to a thousandth of a unit; how much
deeper a point is than `view.depth` it holds as well as the point itself. Where a view's `depth` is 0, all is told from the
eye.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels.frozen import frozen
from benchharness.kernels.types import View


@dataclass
class Order:
    """What a rasterizer sorts by: larger is nearer.

    row    with (P, 1) and divided by depth, the value of P: it is linear on the screen
    first  what has more than this is not drawn
    last   what has no more than this is not drawn
    """

    row: mi.Vector4f
    first: mi.Float
    last: mi.Float


def order(view: View) -> Order:
    """By nearness, from the near plane to infinity."""
    end = nowhere(view)
    return Order(row(view), dr.rcp(view.near) + end, end)


def offset(view: View, p: mi.Point3f | mi.Vector3f) -> mi.Float:
    """How much deeper a point is than `view.depth`."""
    return dr.dot(view.w.xyz, mi.Vector3f(p - view.origin))


def nearness(view: View, offset: mi.Float) -> mi.Float:
    """What the rasterizer sorts by, of a depth `view.depth` + offset: 1 / depth - 1 / `view.depth`, or 1 / depth."""
    shifted, per_depth = _shift(view)
    return dr.select(shifted, -offset * per_depth, 1) * dr.rcp(view.depth + offset)


def row(view: View) -> mi.Vector4f:
    """With (P, 1) and divided by depth, the nearness of P: it is linear on the screen."""
    shifted, per_depth = _shift(view)
    axis = view.w.xyz * per_depth
    return dr.select(
        shifted, mi.Vector4f(-axis.x, -axis.y, -axis.z, dr.dot(axis, mi.Vector3f(view.origin))), mi.Vector4f(0, 0, 0, 1)
    )


def nowhere(view: View) -> mi.Float:
    """The nearness of what is infinitely far away."""
    return -_shift(view)[1]


def _shift(view: View) -> tuple[mi.Bool, mi.Float]:
    """Whether depths are told from `view.depth`, and 1 / that depth, 0 where not."""
    shifted = view.depth > 0
    return shifted, dr.select(shifted, dr.rcp(dr.select(shifted, view.depth, 1)), 0)


def on_ray(view: View, column: mi.Float, row: mi.Float, offset: mi.Float) -> mi.Point3f:
    """The point of a depth `view.depth` + offset on the ray through column, row (pixels, centres at + 0.5)."""
    return view.origin + offset * view.axis + (view.depth + offset) * (column * view.right + row * view.down)


@frozen
def moved(view: View, columns: mi.Float | mi.Int32, rows: mi.Float | mi.Int32, width: int, height: int) -> View:
    """The camera at the same place, of another size, whose column 0 and row 0 are at `columns` and `rows` of this one's."""
    columns, rows = mi.Float(columns), mi.Float(rows)
    step = columns * view.right + rows * view.down
    return dataclasses.replace(
        view,
        x=view.x - columns * view.w,
        y=view.y - rows * view.w,
        axis=view.axis + step,
        origin=view.origin + view.depth * step,
        width=width,
        height=height,
    )
