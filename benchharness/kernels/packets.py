"""Packets: four numbers side by side in one buffer, stored and loaded at once, 16 bytes a time.

Three of them are mostly a vector and the fourth what goes with it. A gather of one packet reads one piece of memory where
four gathers of four arrays read four.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np


def stored(value: Any, count: int) -> Any:
    """A buffer of `count` packets, one per lane of `value`: `mi.Float` of `mi.Vector4f`, `mi.UInt32` of `mi.Vector4u`."""
    buffer = dr.empty(dr.value_t(type(value)), 4 * count)
    dr.scatter(buffer, value, dr.arange(mi.UInt32, count))
    return buffer


def joined(vectors: mi.Point3f | mi.Vector3f, fourth: mi.Float, count: int) -> mi.Float:
    """A buffer of packets of `count` vectors with a fourth number each."""
    return stored(mi.Vector4f(vectors.x, vectors.y, vectors.z, fourth), count)


def of_rows(vectors: np.ndarray, fourth: float | np.ndarray = 0.0) -> np.ndarray:
    """Packets of vectors [N, 3] with a fourth number each, float32 [N, 4]."""
    return np.column_stack([vectors, np.broadcast_to(fourth, len(vectors))]).astype(np.float32)


def bilinear(
    buffer: mi.Float, corners: tuple[mi.UInt32, ...], fx: mi.Float, fy: mi.Float, active: mi.Bool | bool
) -> mi.Vector4f:
    """The packet between four: upper left, upper right, lower left, lower right, at fx to the right and fy down in [0, 1]."""
    a, b, c, d = (dr.gather(mi.Vector4f, buffer, corner, active) for corner in corners)
    return dr.lerp(dr.lerp(a, b, fx), dr.lerp(c, d, fx), fy)
