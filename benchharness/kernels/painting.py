"""Textures: pictures that colour what leaves a surface, looked up at the uv of its vertices, interpolated.

What a texture is and where in it a point lies, `benchharness.modelling.texture` says: u to the right, v up, bilinear between
pixels' centres, no other filter. All pictures of a scene are one buffer, a packet of 4 floats per pixel; each part has a window
into it. Normal maps of mirrors (`kernels.normalmap`) are kept and looked up likewise.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels import packets, raster
from benchharness.kernels.types import MeshLike, SceneLike

REPEAT, MIRROR, CLAMP = range(3)
WRAPS = {"repeat": REPEAT, "mirror": MIRROR, "clamp": CLAMP}


@dataclass
class Paint:
    """What textures need, beside points and triangles.

    uv       4 floats per vertex: u, v, free
    windows  4 integers per part: number of the first pixel, width, height, and what lies beyond the edges along u plus 4 times
             the same along v; a width of 0 for what has no texture
    pixels   4 floats per pixel of all pictures, rows from the top: RGB, free
    count    how many pixels there are: recordings are told apart by it
    """

    uv: mi.Float
    windows: mi.UInt32
    pixels: mi.Float
    count: int


def paint_of(scene: SceneLike) -> Paint | None:
    """What the textures of a scene's objects need; None where there are none."""
    return of_parts([*((o.mesh, o.mesh.texture) for o in scene.objects), *((r.mesh, None) for r in scene.reflectors)])


def of_parts(parts: Sequence[tuple[MeshLike, Any]]) -> Paint | None:
    """The same of the meshes of all parts of a scene, each with a picture at its uv, or None."""
    textures = tuple(dict.fromkeys(texture for _, texture in parts if texture is not None))
    if not textures:
        return None
    areas = [texture.pixels.shape[0] * texture.pixels.shape[1] for texture in textures]
    firsts = dict(zip(textures, np.cumsum([0, *areas]), strict=False))
    uv = [np.zeros((len(mesh.vertices), 4), np.float32) for mesh, _ in parts]
    windows = np.zeros((len(parts), 4), np.uint32)
    for i, (mesh, texture) in enumerate(parts):
        if texture is not None:
            height, width, _ = texture.pixels.shape
            along_u, along_v = (WRAPS[name] for name in texture.wrap)
            uv[i][:, :2] = mesh.uv
            windows[i] = firsts[texture], width, height, along_u + 4 * along_v
    pixels = _uploaded(textures, mi.variant())
    return Paint(mi.Float(np.concatenate(uv).ravel()), mi.UInt32(windows.ravel()), pixels, sum(areas))


@functools.lru_cache(maxsize=4)
def _uploaded(textures: tuple[Any, ...], variant: str) -> mi.Float:
    """`Paint.pixels`, once for all who ask for the same scene."""
    rows = [packets.of_rows(texture.pixels.reshape(-1, 3)) for texture in textures]
    return mi.Float(np.concatenate(rows).ravel())


def colour(paint: Paint, part: mi.UInt32, face: mi.Vector4u, weights: mi.Vector3f, active: mi.Bool) -> mi.Color3f:
    """The textures at points of triangles; 1 on what has none. `part`: of each triangle; `face` and `weights` as in
    `raster.interpolate`."""
    window = dr.gather(mi.Vector4u, paint.windows, part, active)
    painted = active & (window.y > 0)
    uv = raster.interpolate(paint.uv, face, weights, painted)
    columns, right = _between(uv.x, window.y, window.w & 3)
    rows, down = _between(1 - uv.y, window.z, window.w >> 2)
    corners = tuple(window.x + row * window.y + column for row in rows for column in columns)
    value = packets.bilinear(paint.pixels, corners, right, down, painted)
    return dr.select(painted, mi.Color3f(value.x, value.y, value.z), 1)


def _between(x: mi.Float, count: mi.UInt32, wrap: mi.UInt32) -> tuple[tuple[mi.UInt32, mi.UInt32], mi.Float]:
    """The two of `count` pixels in a row whose centres are around x, 0 and 1 the edges of the picture; how far x is on the way
    from the first to the second."""
    turns = dr.floor(x)
    there = 1 - dr.abs(x - 2 * dr.floor(0.5 * x) - 1)
    inside = dr.select(wrap == REPEAT, x - turns, dr.select(wrap == MIRROR, there, dr.clip(x, 0, 1)))
    place = inside * mi.Float(count) - 0.5
    before = dr.floor(place)
    first, last = mi.Int32(before), mi.Int32(count) - 1
    second = first + 1
    goes_on = wrap == REPEAT
    first = dr.select(first < 0, dr.select(goes_on, last, 0), first)
    second = dr.select(second > last, dr.select(goes_on, 0, last), second)
    return (mi.UInt32(first), mi.UInt32(second)), place - before
