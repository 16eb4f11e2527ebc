"""From the pixels that show mirrors, one lane each, to all pixels of the picture."""

from __future__ import annotations

import drjit as dr


def spread(values: list, frame) -> list:
    """Arrays with a lane for each of `benchharness.api.Frame.pixels`, at least one -> with one for each pixel, else 0."""
    count = frame.view.width * frame.view.height
    full = [dr.zeros(type(value), count) for value in values]
    for target, value in zip(full, values, strict=True):
        dr.scatter(target, value, frame.pixels)
    return full
