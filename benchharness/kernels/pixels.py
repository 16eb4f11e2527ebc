"""From the pixels that show mirrors, one lane each, to all pixels of the picture."""

from __future__ import annotations

import drjit as dr


def spread(values: list, frame) -> list:
    """Arrays with a lane for each of `frame.pixels` -> with one for each pixel, 0 elsewhere. `frame`: benchharness.api.Frame."""
    count = frame.view.width * frame.view.height
    full = [dr.zeros(type(value), count) for value in values]
    for target, value in zip(full, values, strict=True):
        if dr.width(frame.pixels) > 0:
            dr.scatter(target, value, frame.pixels)
    return full
