"""Holes where alpha is below a cutoff: what is left covers what it should, hangs together, and is not many triangles."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from oracles import cutout_oracle

from benchharness.modelling.alpha import AlphaMap, Boxes
from benchharness.modelling.contour import ALPHA, NORMAL, PLACE, UV, Holes
from benchharness.modelling.cutout import Sheet, TooMany, cut
from benchharness.modelling.texture import Wrap

MANY = 100_000
WITHIN = 0.5  # pixels from the contour, as `benchharness.modelling.contour` says
ROUNDING = 1e-6  # of alpha on the contour: thirty halvings of an edge, or ...
SNAPPED = 0.02  # ... a cut moved to the end of an edge: 1e-3 of 8 pixels, in each of which alpha changes by at most 2


def sheet(holes: Holes | None, bent: float = 0.0, cells: int = 1, low=(0.0, 0.0), high=(1.0, 1.0), at=(0.0, 0.0)) -> Sheet:
    """A square of 1 whose corner is at `at`, uv from `low` to `high` over it; `bent` out of its plane; so many cells a side."""
    steps = np.linspace(0, 1, cells + 1)
    x, y = (grid.reshape(-1) for grid in np.meshgrid(steps, steps))
    columns = np.ones((len(x), 10))
    columns[:, 0], columns[:, 1] = x + at[0], y + at[1]
    columns[:, 2] = bent * np.sin(3 * columns[:, 0]) * np.cos(2 * columns[:, 1])
    columns[:, NORMAL] = np.column_stack([0.3 * x, 0.3 * y, np.ones(len(x))])
    columns[:, NORMAL] /= np.linalg.norm(columns[:, NORMAL], axis=1, keepdims=True)
    columns[:, UV] = np.array(low) + np.column_stack([x, y]) * np.subtract(high, low)
    columns[:, ALPHA + 1] = 3 * x - 2 * y
    a = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).reshape(-1)
    faces = np.concatenate([np.column_stack([a, a + 1, a + cells + 2]), np.column_stack([a, a + cells + 2, a + cells + 1])])
    return Sheet(columns, faces, holes)


def grid(height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """u and v of the centres of pixels."""
    return np.meshgrid((np.arange(width) + 0.5) / width, 1 - (np.arange(height) + 0.5) / height)


def disc(size: int = 32, radius: float = 0.3) -> np.ndarray:
    """One half at `radius` from the middle, and smooth around there."""
    u, v = grid(size, size)
    return np.clip(0.5 + 4 * (radius**2 - (u - 0.5) ** 2 - (v - 0.5) ** 2), 0, 1)


def half_plane(size: int = 16) -> np.ndarray:
    """One half on the line u + v / 2 = 0.7, linear around it."""
    u, v = grid(size, size)
    return np.clip(0.5 + 2 * (0.7 - u - v / 2), 0, 1)


def leaves(size: int = 32) -> np.ndarray:
    """0 or 1: a grid of lenses, narrower than a pixel at their ends."""
    u, v = grid(size, size)
    x, y = (3 * u) % 1 - 0.5, (2 * v) % 1 - 0.5
    return ((x + 0.6) ** 2 + y**2 < 0.5) * ((x - 0.6) ** 2 + y**2 < 0.5) * 1.0


def wires(size: int = 24) -> np.ndarray:
    """0 or 1: one pixel wide, eight apart, both ways."""
    rows = np.arange(size) % 8 == 3
    return 1.0 * (rows[:, None] | rows[None, :])


def noise(height: int = 7, width: int = 9) -> np.ndarray:
    return np.random.default_rng(5).random((height, width))


def area(made: Sheet) -> float:
    a, b, c = np.moveaxis(made.columns[:, PLACE][made.faces], 1, 0)
    return 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())


def agrees(made: Sheet, of: Sheet, seed: int = 0, count: int = 600) -> None:
    """Random points of a square are covered where the oracle's alpha is, and what is there is as it was before."""
    holes = of.holes
    assert holes is not None and holes.picture is not None
    picture = holes.picture

    def there(uv: np.ndarray) -> np.ndarray:
        return cutout_oracle.alpha(picture.pixels, picture.wrap, uv, picture.nearest) >= holes.cutoff

    low, high = of.columns[:, UV].min(axis=0), of.columns[:, UV].max(axis=0)
    uv = low + np.random.default_rng(seed).random((count, 2)) * (high - low)
    seen = cutout_oracle.interpolated(made.columns[:, UV], made.faces, made.columns, uv)
    covered = ~np.isnan(seen[:, 0])
    wrong = uv[covered != there(uv)]
    assert len(wrong) < 0.05 * count
    assert cutout_oracle.on_both_sides(there, wrong, picture.pixels.shape, WITHIN).all()
    was = cutout_oracle.interpolated(of.columns[:, UV], of.faces, of.columns, uv)
    for columns in (PLACE, UV, slice(ALPHA, None)):
        assert seen[covered][:, columns] == pytest.approx(was[covered][:, columns], abs=1e-9)
    assert np.linalg.norm(made.columns[:, NORMAL], axis=1) == pytest.approx(np.ones(len(made.columns)), abs=1e-12)


def whole(made: Sheet, of: Sheet) -> None:
    """Edges of one triangle alone lie on the contour, or on the rim of a square at the origin; triangles go round as before."""
    holes = of.holes
    assert holes is not None and holes.picture is not None
    a, b, c = np.moveaxis(made.columns[:, :2][made.faces], 1, 0)
    assert ((b - a)[:, 0] * (c - a)[:, 1] > (b - a)[:, 1] * (c - a)[:, 0]).all()
    ends = cutout_oracle.open_edges(made.columns[:, PLACE], made.faces)
    rim = ((ends[:, :, :2] == 0).all(axis=1) | (ends[:, :, :2] == 1).all(axis=1)).any(axis=1)
    uv = {tuple(row[PLACE].tolist()): row[UV] for row in made.columns + 0.0}
    on = np.array([uv[tuple(end)] for end in (ends[~rim] + 0.0).reshape(-1, 3).tolist()]).reshape(-1, 2)
    off = np.abs(cutout_oracle.alpha(holes.picture.pixels, holes.picture.wrap, on) - holes.cutoff)
    assert len(off) and off.max() < SNAPPED and np.median(off) < ROUNDING


def test_the_oracle_is_right_of_one_square():
    at, faces = np.array([[0, 0], [2, 0], [2, 2], [0, 2.0]]), np.array([[0, 1, 2], [0, 2, 3]])
    seen = cutout_oracle.interpolated(at, faces, at @ [[1, 0], [10, 1]], np.array([[1.5, 0.5], [0.5, 1.0], [2.5, 1.0]]))
    assert seen[:2] == pytest.approx(np.array([[6.5, 0.5], [10.5, 1.0]])) and np.isnan(seen[2]).all()
    edges = cutout_oracle.open_edges(np.column_stack([at, np.zeros(4)]), faces)
    assert len(edges) == 4 and np.abs(edges[:, 0] - edges[:, 1]).sum(axis=1).tolist() == [2] * 4
    # A surface that is left of u = 0.5, of ten pixels a row: half a pixel is 0.05.
    near = cutout_oracle.on_both_sides(
        lambda uv: uv[:, 0] < 0.5, np.array([[0.44, 0.1], [0.46, 0.1], [0.54, 0.9]]), (3, 10), 0.5
    )
    assert near.tolist() == [False, True, True]
    assert cutout_oracle.alpha(np.array([[0.0, 1.0]]), ("clamp", "clamp"), np.array([[0.4, 0.5], [0.9, 0.1]])).tolist() == (
        pytest.approx([0.3, 1.0])
    )


PICTURES = {"disc": disc(), "half plane": half_plane(), "leaves": leaves(), "wires": wires(), "noise": noise()}


@pytest.mark.parametrize("name", PICTURES)
@pytest.mark.parametrize(("cells", "bent"), [(1, 0.0), (3, 0.2)], ids=["quad", "curved patch"])
def test_what_is_left_is_where_alpha_is_and_hangs_together(name, cells, bent):
    of = sheet(Holes(0.5, AlphaMap(PICTURES[name], ("clamp", "clamp"))), bent, cells)
    (made,) = cut([of], MANY)
    agrees(made, of)
    whole(made, of)


@pytest.mark.parametrize("u", get_args(Wrap))
@pytest.mark.parametrize("v", get_args(Wrap))
def test_alpha_goes_on_beyond_its_picture_as_it_is_told(u, v):
    of = sheet(Holes(0.6, AlphaMap(noise(), (u, v))), low=(-2.3, -0.6), high=(2.1, 1.9))
    (made,) = cut([of], MANY)
    agrees(made, of, count=400)


def test_alpha_of_large_triangles_far_from_its_picture():
    """Longer than many pictures, and the same again from another side."""
    of = sheet(Holes(0.5, AlphaMap(disc(16), ("repeat", "mirror"))), low=(-7.0, 5.0), high=(-1.0, 1.0))
    (made,) = cut([of], MANY)
    agrees(made, of, count=300)
    # 24 pictures in a square of 1. Of a radius of 4.8 pixels chords cut off 1/8 pixel at the most, two thirds of which is area.
    assert 1 - 2 * (2 / 3) * (1 / 8) / 4.8 < area(made) / (np.pi * 0.3**2) < 1.005


def test_pixels_that_are_not_interpolated_are_cut_along_their_edges():
    picture = (np.random.default_rng(2).random((6, 5)) < 0.5).astype(float)
    of = sheet(Holes(0.5, AlphaMap(picture, nearest=True)))
    (made,) = cut([of], MANY)
    agrees(made, of)
    # At each of 30 corners a triangle with sides of a quarter of a pixel at the most is on the wrong side, of 30 pixels.
    assert area(made) == pytest.approx(picture.mean(), abs=1 / 32)


def test_areas_are_those_of_a_disc_and_of_a_half_plane():
    (made,) = cut([sheet(Holes(0.5, AlphaMap(disc(64), ("clamp", "clamp"))))], MANY)
    # Chords cut off segments no higher than 1/8 pixel, two thirds of which are area, around a circle of 0.6 π: 0.0025.
    assert np.pi * 0.3**2 - 0.0026 < area(made) < np.pi * 0.3**2 + 1e-4
    (made,) = cut([sheet(Holes(0.5, AlphaMap(half_plane(), ("clamp", "clamp"))))], MANY)
    # Left of a line that goes from u = 0.7 below to u = 0.2 above; at its ends, half a pixel, pixels of the rim go on.
    assert area(made) == pytest.approx(0.45, abs=2e-3)
    for corner in (0.0, 0.25, 0.75):
        (made,) = cut([sheet(Holes(0.5, AlphaMap(np.array([[corner, 1.0]]), ("clamp", "clamp"))))], MANY)
        # Two pixels: linear between u = 1/4 and 3/4.
        assert area(made) == pytest.approx(0.75 - 0.5 * (0.5 - corner) / (1 - corner) if corner < 0.5 else 1, abs=1e-6)


def test_alpha_of_vertices_cuts_too_and_multiplies_that_of_a_picture():
    of = sheet(Holes(0.25))
    of.columns[:, ALPHA] = of.columns[:, 0]
    (made,) = cut([of], MANY)
    assert area(made) == pytest.approx(0.75, abs=1e-6) and made.columns[:, 0].min() == pytest.approx(0.25, abs=1e-6)
    both = replace(of, holes=Holes(0.25, AlphaMap(np.ones((8, 8))), factor=0.5))
    (made,) = cut([both], MANY)
    assert area(made) == pytest.approx(0.5, abs=1e-3) and made.columns[:, 0].min() == pytest.approx(0.5, abs=1e-3)


def test_neighbours_stay_joined_whatever_is_cut_in_them():
    """A sheet with holes up to its edges; beside it the picture mirrored, so that alpha is the same along the edge they share;
    and one without holes."""
    holes = Holes(0.5, AlphaMap(wires(), ("clamp", "clamp")))
    sheets = [sheet(holes, 0.2, 2), sheet(holes, 0.2, 2, low=(1, 0), high=(0, 1), at=(1, 0)), sheet(None, 0.2, 2, at=(0, 1))]
    made = cut(sheets, MANY)
    starts = np.cumsum([0, *(len(one.columns) for one in made)])
    columns = np.concatenate([one.columns for one in made])
    faces = np.concatenate([one.faces + start for one, start in zip(made, starts, strict=False)])
    ends = cutout_oracle.open_edges(columns[:, PLACE], faces)
    within = (ends[:, :, 0] == 1).all(axis=1) & (ends[:, :, 1] < 1).any(axis=1)
    assert not within.any()  # what is there on one side of the edge is on the other
    assert area(made[2]) == pytest.approx(area(sheets[2]), rel=1e-12) and len(made[2].faces) > len(sheets[2].faces)
    # Every vertex on the edge to the sheet without holes is one of that sheet's.
    lower = {tuple(row) for row in made[0].columns[:, PLACE].tolist() if row[1] == 1}
    upper = {tuple(row) for row in made[2].columns[:, PLACE].tolist() if row[1] == 1}
    corners = {end for edge in ends.tolist() for end in map(tuple, edge) if end[1] == 1 and end[0] <= 1}
    assert lower - upper <= corners and len(lower & upper) > 2 and len(lower - upper) == 4


def test_what_is_far_from_the_contour_stays_large():
    def fence(u: np.ndarray) -> np.ndarray:
        return 1.0 * ((8 * u) % 1 < 0.5)

    straight = sheet(Holes(0.5, AlphaMap(fence(grid(256, 256)[0]))))
    (made,) = cut([straight], MANY)
    # Sixteen straight edges of 256 pixels, in pieces of 4 to 8 pixels, some five triangles each.
    assert area(made) == pytest.approx(0.5, abs=1e-6) and len(made.faces) < 16 * 256 / 4 * 5
    (made,) = cut([sheet(Holes(0.5, AlphaMap(disc(512, 0.05))))], MANY)
    assert len(made.faces) < 1000


def test_what_is_not_cut_is_the_same_thing_and_what_is_gone_has_no_faces():
    full, empty, none = Holes(0.5, AlphaMap(np.ones((4, 4)))), Holes(0.5, AlphaMap(np.zeros((4, 4)))), None
    sheets = [sheet(full), sheet(empty, at=(5, 0)), sheet(none, at=(9, 0))]
    made = cut(sheets, MANY)
    assert made[0] is sheets[0] and made[2] is sheets[2] and not len(made[1].faces)


def test_too_many_triangles_are_none_and_fewer_on_a_coarser_picture():
    holes = Holes(0.5, AlphaMap(np.random.default_rng(0).random((128, 128))))
    with pytest.raises(TooMany):
        cut([sheet(holes)], 5000)
    for _ in range(7):
        holes = holes.coarser()
    assert holes.picture is None and holes.factor == pytest.approx(0.5, abs=0.02)
    assert holes.coarser() is holes


@pytest.mark.parametrize("wrap", [("repeat", "clamp"), ("mirror", "repeat"), ("clamp", "mirror"), ("mirror", "mirror")])
def test_boxes_of_pixels_are_counted_as_one_by_one(wrap):
    rng = np.random.default_rng(1)
    marked = rng.random((4, 5)) < 0.7
    low = rng.integers(-13, 13, (300, 2)).astype(float)
    high = low + rng.integers(0, 12, (300, 2)) * (rng.random((300, 2)) < 0.6)
    every, some = Boxes(marked, wrap).all_or_any(low, high)
    for number, ((left, top), (right, bottom)) in enumerate(zip(low, high, strict=True)):
        columns, rows = np.arange(left, right + 1), np.arange(top, bottom + 1)
        uv = np.array([((x + 0.5) / 5, 1 - (y + 0.5) / 4) for x in columns for y in rows])
        inside = cutout_oracle.alpha(marked * 1.0, wrap, uv, nearest=True)
        assert (every[number], some[number]) == (inside.all(), inside.any())
    assert every.sum() > 10 and (~some).sum() > 10


def test_half_a_picture_has_its_mean_and_its_places():
    picture = noise(7, 12)
    half = AlphaMap(picture).halved().pixels
    assert half.shape == (4, 6) and half.mean() == pytest.approx(picture.mean(), abs=1e-12)
    assert half[0, 0] == pytest.approx((picture[0, :2].sum() + 0.75 * picture[1, :2].sum()) / 3.5, abs=1e-12)
