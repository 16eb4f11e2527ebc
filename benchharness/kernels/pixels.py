"""From the pixels that show mirrors, one lane each, to all pixels of the picture."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi


def spread(values: list, lanes: mi.UInt32, view) -> list:
    """Arrays with a lane for each of `lanes`, at least one, -> with one for each pixel of the picture of a view.

    lanes  `benchharness.api.Frame.pixels`

    Other pixels hold what was in memory: nobody reads them, and clearing it takes a third of the time of a simple method.
    """
    count = view.width * view.height
    full = [dr.empty(type(value), count) for value in values]
    for target, value in zip(full, values, strict=True):
        dr.scatter(target, value, lanes)
    return full
