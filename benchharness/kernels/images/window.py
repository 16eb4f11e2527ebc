"""A pinhole camera of our own making: what looks at a part of the scene to keep a picture of it."""

from __future__ import annotations

from dataclasses import dataclass

import mitsuba as mi


@dataclass
class Window:
    """The fields of `benchharness.api.View`, as `kernels.raster` reads them."""

    eye: mi.Point3f
    x: mi.Vector4f
    y: mi.Vector4f
    w: mi.Vector4f
    right: mi.Vector3f
    down: mi.Vector3f
    axis: mi.Vector3f
    depth: mi.Float
    origin: mi.Point3f
    near: mi.Float
    width: int
    height: int
