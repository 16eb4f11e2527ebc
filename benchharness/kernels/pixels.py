"""Pixels: from those that show mirrors, one lane each, to the whole picture; and how many of them are too far."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from benchharness.kernels.types import View

WRONG_PX = 2.0
"""On the screen: what is shown further off than this is the wrong point, and not the right one less exactly. Searches end in
triangles and texels about a pixel wide, which leaves a pixel for what is interpolated between them."""


def spread(values: list, lanes: mi.UInt32, view: View) -> list:
    """Arrays with a lane for each pixel of the picture, from arrays with one for each of `lanes`, at least one.

    lanes  `benchharness.api.Frame.pixels`

    Other pixels hold what was in memory: nobody reads them, and clearing it takes a third of the time of a simple method.
    """
    count = view.width * view.height
    full = [dr.empty(type(value), count) for value in values]
    for target, value in zip(full, values, strict=True):
        dr.scatter(target, value, lanes)
    return full
