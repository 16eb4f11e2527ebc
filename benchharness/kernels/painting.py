"""Textures and light maps: what is looked up on surfaces finer than at their vertices, where these say that it is.

What a texture is and where in it a point lies, `benchharness.modelling.texture` says: u to the right, v up, bilinear between
pixels' centres, no other filter. What a light map is, `benchharness.modelling.lightmap` says: linear between the three samples
around a point. All pictures of a scene are one buffer, a packet of 4 floats per pixel, and all samples another; each part has
a window into each. Normal maps of mirrors (`kernels.normalmap`) are kept and looked up as textures are.
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
    """What textures and light maps need, beside points and triangles; None for what there is none of.

    uv       4 floats per vertex: u, v, and where in its part's map it is, x, y: negative where its light is its own
    windows  4 integers per part: number of the first pixel, width, height, and what lies beyond the edges along u plus 4 times
             the same along v; a width of 0 for what has no texture
    pixels   4 floats per pixel of all pictures, rows from the top: RGB, free
    count    how many pixels there are: recordings are told apart by it
    maps     4 integers per part: number of the first sample, how many in a row, rows, free; 0 in a row for what has no map
    samples  4 floats per sample of all maps, row by row: RGB, free
    lit      how many samples there are, likewise
    """

    uv: mi.Float
    windows: mi.UInt32 | None
    pixels: mi.Float | None
    count: int
    maps: mi.UInt32 | None = None
    samples: mi.Float | None = None
    lit: int = 0


def paint_of(scene: SceneLike) -> Paint | None:
    """What the textures and light maps of a scene's objects need; None where there are none."""
    objects = [(o.mesh, o.mesh.texture, o.mesh.light) for o in scene.objects]
    return of_parts([*objects, *((r.mesh, None, None) for r in scene.reflectors)])


def of_parts(parts: Sequence[tuple[MeshLike, Any, Any]]) -> Paint | None:
    """The same of the meshes of all parts of a scene, each with a picture at its uv, or None, and a light map, or None."""
    meshes, pictures, maps = ([part[k] for part in parts] for k in range(3))
    if not any(pictures) and not any(maps):
        return None
    uv = [np.zeros((len(mesh.vertices), 4), np.float32) for mesh in meshes]
    for own, mesh, picture, light in zip(uv, meshes, pictures, maps, strict=True):
        own[:, 2:] = -1 if light is None else mesh.light_at
        if picture is not None:
            own[:, :2] = mesh.uv
    windows, pixels, count = _windows(pictures, "pixels", len(parts))
    lights, samples, lit = _windows(maps, "samples", len(parts))
    if windows is not None:
        wraps = [(0, 0) if one is None else [WRAPS[name] for name in one.wrap] for one in pictures]
        windows[:, 3] = [along_u + 4 * along_v for along_u, along_v in wraps]
    windows, lights = (None if one is None else mi.UInt32(one.ravel()) for one in (windows, lights))
    return Paint(mi.Float(np.concatenate(uv).ravel()), windows, pixels, count, lights, samples, lit)


def _windows(sheets: list[Any], name: str, parts: int) -> tuple[np.ndarray | None, mi.Float | None, int]:
    """Where in one buffer the sheet of each part is, that buffer, and how long it is; None without any. `name`: of what is in a
    sheet, [H, W, 3]."""
    different = tuple(dict.fromkeys(sheet for sheet in sheets if sheet is not None))
    if not different:
        return None, None, 0
    shapes = [getattr(sheet, name).shape for sheet in different]
    firsts = np.cumsum([0, *(height * width for height, width, _ in shapes)])
    windows = np.zeros((parts, 4), np.uint32)
    for i, sheet in enumerate(sheets):
        if sheet is not None:
            number = different.index(sheet)
            windows[i, :3] = firsts[number], shapes[number][1], shapes[number][0]
    return windows, _uploaded(different, name, mi.variant()), int(firsts[-1])


@functools.lru_cache(maxsize=4)
def _uploaded(sheets: tuple[Any, ...], name: str, variant: str) -> mi.Float:
    """`Paint.pixels` or `samples`, once for all who ask for the same scene."""
    rows = [packets.of_rows(getattr(sheet, name).reshape(-1, 3)) for sheet in sheets]
    return mi.Float(np.concatenate(rows).ravel())


def seen(
    paint: Paint, light: mi.Color3f, part: mi.UInt32, face: mi.Vector4u, weights: mi.Vector3f, active: mi.Bool
) -> mi.Color3f:
    """What leaves triangles: their light, coloured. `light`: of their vertices, which those have that have no map; the rest as
    in `colour`."""
    return lit(paint, light, part, face, weights, active) * colour(paint, part, face, weights, active)


def lit(
    paint: Paint, light: mi.Color3f, part: mi.UInt32, face: mi.Vector4u, weights: mi.Vector3f, active: mi.Bool
) -> mi.Color3f:
    """The light of maps at points of triangles, without textures; `light` on what has none."""
    if paint.maps is None or paint.samples is None:
        return light
    window = dr.gather(mi.Vector4u, paint.maps, part, active)
    there = active & (window.y > 0)
    at = raster.interpolate(paint.uv, face, weights, there)
    there &= at.z >= 0
    x, y = at.z, at.w
    column = dr.clip(mi.Int32(dr.floor(x)), 0, mi.Int32(window.y) - 2)
    row = dr.clip(mi.Int32(dr.floor(y)), 0, mi.Int32(window.z) - 2)
    right, down = x - mi.Float(column), y - mi.Float(row)
    far = right + down > 1
    first = window.x + mi.UInt32(row) * window.y + mi.UInt32(column)
    corner = dr.gather(mi.Vector4f, paint.samples, dr.select(far, first + window.y + 1, first), there)
    beside = dr.gather(mi.Vector4f, paint.samples, first + 1, there)
    below = dr.gather(mi.Vector4f, paint.samples, first + window.y, there)
    value = corner * dr.abs(1 - right - down)
    value += beside * dr.select(far, 1 - down, right) + below * dr.select(far, 1 - right, down)
    return dr.select(there, mi.Color3f(value.x, value.y, value.z), light)


def colour(paint: Paint, part: mi.UInt32, face: mi.Vector4u, weights: mi.Vector3f, active: mi.Bool) -> mi.Color3f:
    """The textures at points of triangles; 1 on what has none. `part`: of each triangle; `face` and `weights` as in
    `raster.interpolate`."""
    if paint.windows is None or paint.pixels is None:
        return mi.Color3f(1)
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
