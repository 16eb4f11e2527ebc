"""Directions of the texels of cube maps, and directions as the device has them."""

from __future__ import annotations

import mitsuba as mi
import numpy as np


def vectors(rows: np.ndarray) -> mi.Vector3f:
    return mi.Vector3f(np.ascontiguousarray(rows.T.astype(np.float32)))


def directions(n: int) -> np.ndarray:
    """Of the texels of a cube map with its border, [6 (n + 2)², 3], 1 along the axis of their face."""
    k, found = (2 * np.arange(-1, n + 1) + 1) / n - 1, []
    for axis in range(3):
        for sign in (1, -1):
            v, u = np.meshgrid(k, k, indexing="ij")
            d = np.zeros((n + 2, n + 2, 3))
            d[..., axis], d[..., (axis + 1) % 3], d[..., (axis + 2) % 3] = sign, u, v
            found.append(d.reshape(-1, 3))
    return np.concatenate(found)
