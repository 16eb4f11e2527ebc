"""Pictures of surfaces: files into linear RGB, and the colour that a triangle sees of one.

A picture's first row is its upper edge, and v goes up: (u, v) is column u W and row (1 - v) H, and a texel's centre is at half
a texel.
"""

from __future__ import annotations

import io
import math
from pathlib import Path

import numpy as np
from PIL import Image

from benchharness.assets.asset import Wrap

POINTS = 4096  # at which all triangles of a part together look at their picture, at least


def decoded(source: Path | bytes) -> np.ndarray:
    """The picture of a file or of its bytes, float32 [H, W, 3], linear, transparency dropped. Raises whatever Pillow does."""
    with Image.open(io.BytesIO(source) if isinstance(source, bytes) else source) as picture:
        if picture.mode.startswith("I"):  # 16 bits of grey
            grey = np.asarray(picture, np.float64) / 65535.0
            return linear(np.repeat(grey[:, :, None], 3, axis=2)).astype(np.float32)
        if picture.mode == "F":
            return np.repeat(np.asarray(picture, np.float32)[:, :, None], 3, axis=2)
        return _LINEAR[np.asarray(picture.convert("RGB"))]


def linear(encoded: np.ndarray) -> np.ndarray:
    """sRGB, 0 to 1, decoded (IEC 61966-2-1)."""
    encoded = np.clip(encoded, 0.0, 1.0)
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def looked_up(picture: np.ndarray, uv: np.ndarray, wrap: tuple[Wrap, Wrap]) -> np.ndarray:
    """The texels [N, 3] that contain the points `uv`, [N, 2]."""
    height, width = picture.shape[:2]
    u, v = _wrapped(uv[:, 0], wrap[0]), _wrapped(uv[:, 1], wrap[1])
    column = np.clip((u * width).astype(int), 0, width - 1)
    row = np.clip(((1.0 - v) * height).astype(int), 0, height - 1)
    return picture[row, column]


def mean(picture: np.ndarray, uv: np.ndarray, faces: np.ndarray, area: np.ndarray, wrap: tuple[Wrap, Wrap]) -> np.ndarray:
    """The mean colour [3] of a picture where triangles have it: points all over each, weighted by its area, float64 [F]."""
    weights = _spread(max(2, math.ceil(math.sqrt(POINTS / len(faces)))))
    points = np.einsum("sk,fki->fsi", weights, uv[faces]).reshape(-1, 2)
    seen = looked_up(picture, points, wrap).astype(np.float64)
    return np.average(seen, axis=0, weights=np.repeat(np.maximum(area, 1e-300), len(weights)))


def _spread(n: int) -> np.ndarray:
    """Barycentric coordinates of the middles of the n² triangles that a triangle is cut into, float64 [n², 3]."""
    i, j = np.nonzero(np.add.outer(np.arange(n), np.arange(n)) < n)
    k, l = np.nonzero(np.add.outer(np.arange(n), np.arange(n)) < n - 1)
    b, c = np.concatenate([3 * i + 1, 3 * k + 2]) / (3 * n), np.concatenate([3 * j + 1, 3 * l + 2]) / (3 * n)
    return np.stack([1.0 - b - c, b, c], axis=1)


def _wrapped(x: np.ndarray, wrap: Wrap) -> np.ndarray:
    """Coordinates within 0 and 1."""
    if wrap == "clamp":
        return np.clip(x, 0.0, 1.0)
    if wrap == "mirror":
        return 1.0 - np.abs(x % 2.0 - 1.0)
    return x % 1.0


_LINEAR = linear(np.arange(256) / 255.0).astype(np.float32)
