"""Pictures side by side on a sheet, and one after the other where they are kept."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from oracles.depth_oracle import BACKGROUND
from support.depth_objects import as_array, built, comb, device

from benchharness.kernels.images import atlas, depthmap, depthrows, shelf


@pytest.mark.parametrize("seed", range(4))
def test_squares_do_not_overlap_and_lie_at_multiples_of_their_size(seed):
    rng = np.random.default_rng(seed)
    sizes = 2 ** rng.integers(3, 8, rng.integers(1, 60))
    columns, rows, width, height = atlas.placed(sizes)
    used = np.zeros((height, width), int)
    for size, column, row in zip(sizes, columns, rows, strict=True):
        assert column % size == 0 and row % size == 0
        used[row : row + size, column : column + size] += 1
    assert used.max() == 1 and used.sum() == (sizes**2).sum()
    assert width % sizes.max() == 0 and height % sizes.max() == 0


def sheet_of(pictures: list[np.ndarray], mip: bool) -> tuple[atlas.Sheet, np.ndarray, np.ndarray]:
    """A sheet that holds pictures [s, s, 4], whose depths are their first numbers."""
    sizes = np.array([len(p) for p in pictures])
    columns, rows, width, height = atlas.placed(sizes)
    whole = np.full((height, width, 4), 9.0)
    for picture, column, row in zip(pictures, columns, rows, strict=True):
        whole[row : row + len(picture), column : column + len(picture)] = picture
    texels = atlas.with_levels(device(whole), width, height, atlas.levels_of(int(sizes.max()), mip))
    return atlas.Sheet(texels, device(whole[..., 0]), width, height), columns, rows


def kept(own: shelf.Shelf, slot: int, mip: bool) -> list[np.ndarray]:
    """The levels of a slot."""
    texels, first, size, levels = np.array(own.texels).reshape(-1, 4), own.firsts[slot], int(own.sizes[slot]), []
    for level in range(atlas.levels_of(size, mip)):
        across = size >> level
        levels.append(texels[first : first + across**2].reshape(across, across, 4))
        first += across**2
    return levels


def agree(own: shelf.Shelf, slot: int, picture: np.ndarray, mip: bool) -> None:
    levels = kept(own, slot, mip)
    assert len(levels[-1]) == (4 if mip else len(picture))
    for level in levels:
        np.testing.assert_allclose(level, picture, atol=1e-6)
        picture = 0.25 * (picture[::2, ::2] + picture[1::2, ::2] + picture[::2, 1::2] + picture[1::2, 1::2])


@pytest.mark.parametrize("mip", [True, False])
def test_pictures_keep_their_texels_while_others_are_taken_grow_and_go(mip):
    rng = np.random.default_rng(1)

    def noise(size: int) -> np.ndarray:
        return rng.uniform(0, 1, (size, size, 4))

    own, there = shelf.empty(5), {}
    steps = [
        {0: 8, 2: 32, 3: 16, 4: 8},  # the first of all; one has none
        {2: 32},  # the same size again
        {1: 64, 3: 8},  # one comes, one shrinks: all others move
        {0: 0, 4: 0},  # two go
        {0: 16, 2: 32},
    ]
    for step in steps:
        there = {slot: p for slot, p in there.items() if slot not in step}
        new = {slot: noise(size) for slot, size in step.items() if size > 0}
        there |= new
        sizes = np.array([len(there[slot]) if slot in there else 0 for slot in range(5)])
        if new:
            sheet, columns, rows = sheet_of(list(new.values()), mip)
            own = shelf.put(own, sizes, sheet, shelf.New(np.array(list(new)), columns, rows), mip=mip)
        else:
            own = shelf.Shelf(sizes, own.firsts, own.texels)
        for slot, picture in there.items():
            agree(own, slot, picture, mip)
        np.testing.assert_array_equal(np.array(own.places).reshape(-1, 4)[:, 1], sizes)


def test_what_is_put_in_leaves_the_pictures_before_as_they_were():
    rng = np.random.default_rng(2)
    one, other = rng.uniform(0, 1, (2, 8, 8, 4))
    sheets = [sheet_of([p], False) for p in (one, other)]
    first = shelf.put(shelf.empty(1), np.array([8]), sheets[0][0], shelf.New(np.array([0]), *sheets[0][1:]), mip=False)
    second = shelf.put(first, np.array([8]), sheets[1][0], shelf.New(np.array([0]), *sheets[1][1:]), mip=False)
    agree(first, 0, one, False)
    agree(second, 0, other, False)


def test_rows_that_are_as_wide_as_their_samples_end_half_a_sample_further_and_nowhere_before_the_map():
    """The comb's first tooth is samples 4 to 7; one that stands alone is one sample wide already."""
    depth = comb()
    depth[90] = BACKGROUND
    depth[90, [0, 1, 9]] = 0.5
    layout, rows, _ = built(depth, 1, 8)
    wide, _ = depthrows.build(device(depth), layout, wide=True)
    plain, wide = as_array(layout, rows)[0, 0], as_array(layout, wide)[0, 0]
    np.testing.assert_array_equal(plain[60, :2, 0], [4, -8])
    np.testing.assert_array_equal(wide[60, :2, 0], [3.5, -8.5])
    np.testing.assert_array_equal(plain[90, :3, 0], [0, -2, -10])
    np.testing.assert_array_equal(wide[90, :3, 0], [0, -2.5, -10])
    np.testing.assert_array_equal(plain[..., 1], wide[..., 1])


def test_maps_of_sizes_of_their_own_have_the_rows_that_each_has_alone():
    rng = np.random.default_rng(3)
    maps = [np.where(rng.uniform(size=(w, w)) < 0.7, rng.uniform(size=(w, w)), BACKGROUND) for w in (16, 8, 32)]
    n, m, sizes = 5, 8, np.array([16, 8, 32])
    firsts, starts = np.cumsum(sizes**2) - sizes**2, np.cumsum(n * sizes) - n * sizes
    places = np.stack([firsts, sizes, starts, 0 * sizes], axis=1)
    layout = depthmap.Layout(3, 32, n, m, mi.UInt32(places.ravel()))
    owners = mi.UInt32(np.repeat(np.arange(3), n * sizes))
    rows, dropped = depthrows.build(device(np.concatenate([own.ravel() for own in maps])), layout, None, owners)
    dr.eval(rows, dropped)
    rows, dropped = np.array(rows).reshape(-1, m, 2), np.array(dropped)
    for own, start in zip(maps, starts, strict=True):
        single, alone, dropped_alone = built(own, n, m)
        count = n * len(own)
        np.testing.assert_array_equal(rows[start : start + count], as_array(single, alone).reshape(-1, m, 2))
        np.testing.assert_array_equal(dropped[start : start + count], np.array(dropped_alone))
