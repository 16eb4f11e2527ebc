"""Pictures on surfaces in plain float64 NumPy, one point at a time, as `benchharness.modelling.texture` has them."""

from __future__ import annotations

import math

import numpy as np
from oracles.light_oracle import on_sheet

from benchharness.scene import Mesh


def pixel(i: int, count: int, way: str) -> int:
    """Which of `count` pixels stands at place i of a row that goes on on both sides."""
    if way == "clamp":
        return min(max(i, 0), count - 1)
    if way == "repeat":
        return i % count
    there_and_back = [*range(count), *reversed(range(count))]
    return there_and_back[i % (2 * count)]


def looked_up(pixels: np.ndarray, wrap: tuple[str, str], uv: np.ndarray) -> np.ndarray:
    """The picture [H, W, 3] at uv [N, 2], [N, 3]."""
    height, width, _ = pixels.shape
    out = np.zeros((len(uv), 3))
    for lane, (u, v) in enumerate(np.asarray(uv, np.float64)):
        column, row = u * width - 0.5, (1 - v) * height - 0.5
        j, i = math.floor(column), math.floor(row)
        for down in (0, 1):
            for right in (0, 1):
                share = (1 - abs(column - (j + right))) * (1 - abs(row - (i + down)))
                at = pixels[pixel(i + down, height, wrap[1]), pixel(j + right, width, wrap[0])]
                out[lane] += share * np.asarray(at, np.float64)
    return out


def shown(mesh: Mesh, face: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """What leaves a mesh at points `weights` [N, 3] of one of its triangles, [N, 3]."""
    assert mesh.radiance is not None
    light = weights @ mesh.radiance[face]
    if mesh.light is not None and mesh.light_at is not None and mesh.light_at[face[0], 0] >= 0:
        light = on_sheet(mesh.light.samples, weights @ mesh.light_at[face])
    if mesh.texture is None:
        return light
    assert mesh.uv is not None
    return light * looked_up(mesh.texture.pixels, mesh.texture.along, weights @ mesh.uv[face])
