"""Pictures keep their texels when others come and go, whatever has been recorded for shelves of other lengths."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest

from benchharness.kernels.images import atlas, shelf

STAYS, COMES = 64, 32


@pytest.mark.parametrize("depths", [True, False])
def test_what_stays_and_what_comes_is_right_however_large_that_was_which_goes(depths):
    """All of these have the same numbers, and shelves of different widths before."""
    floats = 1 if depths else 4
    page = 0.25 + np.arange(floats * COMES**2)
    sheet = atlas.Sheet(mi.Float(page), mi.Float(page), COMES, COMES)
    for goes in (32, 64, 256, 512, 32, 1024):
        before = np.array([STAYS, goes, 0])
        first = np.array([0, STAYS**2, 0])
        texels = np.arange(floats * (STAYS**2 + goes**2), dtype=np.float32)
        now = np.array([STAYS, 0, COMES])
        new = shelf.New(np.array([2]), np.array([0]), np.array([0]))
        after = shelf.put(shelf.Shelf(before, first, mi.Float(texels)), now, sheet, new, mip=False, depths=depths)
        seen = np.array(after.texels)
        here = [seen[floats * f : floats * (f + s**2)] for f, s in zip(after.firsts, now, strict=True)]
        assert np.array_equal(here[0], texels[: floats * STAYS**2]), goes
        assert np.array_equal(here[2], page.astype(np.float32)), goes
