"""Our textures in Mitsuba: a factor of what a mesh reflects, or sends.

Mitsuba's own have one way to go on for both axes, and one picture each; ours may be many on one mesh. Written against Mitsuba's
interfaces; shares nothing with `benchharness.kernels`. `benchharness.modelling.texture` says what is where in a picture.
"""

# pyright: reportArgumentType=false, reportCallIssue=false, reportAttributeAccessIssue=false, reportOperatorIssue=false
# The type stubs of Mitsuba and Dr.Jit know neither NumPy arguments nor points and vectors in one expression.

from __future__ import annotations

from collections.abc import Sequence

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.scene import Mesh, Texture

WAYS = {"repeat": 0, "mirror": 1, "clamp": 2}
ATTRIBUTE = "vertex_picture"
"""u, v, and the number of the picture, 0 for none."""


def coloured(base: mi.Texture, meshes: Sequence[Mesh]) -> mi.Texture:
    """`base` times the textures of meshes that are one shape, which `describe` has to prepare; `base` itself without any."""
    pictures = _pictures(meshes)
    if not pictures:
        return base
    white = np.ones((1, 1, 3), np.float32)
    images = [white, *(picture.pixels for picture in pictures)]
    rows, columns = (mi.Int32([image.shape[axis] for image in images]) for axis in range(2))
    starts = mi.UInt32(np.cumsum([0, *(image.shape[0] * image.shape[1] for image in images[:-1])]).astype(np.uint32))
    ways = [mi.UInt32([0, *(WAYS[picture.along[axis]] for picture in pictures)]) for axis in range(2)]
    channels = [mi.Float(np.concatenate([image[..., c].ravel() for image in images])) for c in range(3)]

    class Coloured(mi.Texture):
        def __init__(self) -> None:
            super().__init__(mi.Properties())

        def eval(self, si, active=True):
            where = si.shape.eval_attribute_3(ATTRIBUTE, si, active)
            number = mi.UInt32(where.z + 0.5)
            height, width = (dr.gather(mi.Int32, sizes, number, active) for sizes in (rows, columns))
            along_u, along_v = (dr.gather(mi.UInt32, way, number, active) for way in ways)
            first = dr.gather(mi.UInt32, starts, number, active)
            # In pixels, from the centre of the first one of the first row.
            x, y = where.x * width - 0.5, (1 - where.y) * height - 0.5
            column, row = mi.Int32(dr.floor(x)), mi.Int32(dr.floor(y))
            value = mi.Color3f(0)
            for right in (0, 1):
                for down in (0, 1):
                    share = 1 - dr.abs(x - column - right), 1 - dr.abs(y - row - down)
                    j, i = _pixel(column + right, width, along_u), _pixel(row + down, height, along_v)
                    pixel = first + i * mi.UInt32(width) + j
                    value += mi.Color3f(*(dr.gather(mi.Float, c, pixel, active) for c in channels)) * (share[0] * share[1])
            return base.eval(si, active) * value

        def to_string(self) -> str:
            return f"Coloured[{base}, {len(pictures)} pictures]"

    return Coloured()


def describe(shape: mi.Mesh, meshes: Sequence[Mesh]) -> None:
    """Gives a shape that is made of `meshes`, in their order, what `coloured` reads; nothing without textures."""
    pictures = _pictures(meshes)
    if not pictures:
        return
    rows = []
    for mesh in meshes:
        where = np.zeros((len(mesh.vertices), 3))
        if mesh.texture is not None:
            where[:, :2], where[:, 2] = mesh.uv, 1 + pictures.index(mesh.texture)
        rows.append(where)
    shape.add_attribute(ATTRIBUTE, 3, np.float32(np.concatenate(rows)).ravel())


def _pictures(meshes: Sequence[Mesh]) -> list[Texture]:
    return list(dict.fromkeys(mesh.texture for mesh in meshes if mesh.texture is not None))


def _pixel(i: mi.Int32, count: mi.Int32, way: mi.UInt32) -> mi.UInt32:
    """Which of `count` pixels stands at place i of a row that goes on without end."""
    period = dr.select(way == WAYS["mirror"], 2 * count, count)
    turned = i - period * mi.Int32(dr.floor(mi.Float(i) / mi.Float(period)))
    turned = dr.select(turned < count, turned, 2 * count - 1 - turned)
    return mi.UInt32(dr.select(way == WAYS["clamp"], dr.clip(i, 0, count - 1), turned))
