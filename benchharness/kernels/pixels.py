"""From the pixels that show mirrors, one lane each, to all pixels of the picture."""

from __future__ import annotations

import drjit as dr


def spread(values: list, frame) -> list:
    """Arrays with a lane for each of `benchharness.api.Frame.pixels`, at least one -> with one for each pixel of the picture.

    Other pixels hold what was in memory: nobody reads them, and clearing it takes a third of the time of a simple method.
    """
    count = frame.view.width * frame.view.height
    full = [dr.empty(type(value), count) for value in values]
    for target, value in zip(full, values, strict=True):
        dr.scatter(target, value, frame.pixels)
    return full
