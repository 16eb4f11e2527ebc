"""Where more model stops to matter, against numbers worked out by hand and errors of known spread."""

from __future__ import annotations

import numpy as np
import pytest

from benchharness.needs.knee import TILE, Error, error_of, knee_of


def sure(*means: float) -> list[Error]:
    return [Error(mean, mean, mean) for mean in means]


@pytest.mark.parametrize(
    ("errors", "knee"),
    [
        (sure(0.5, 0.2, 0.1), 2),
        (sure(0.5, 0.105, 0.1), 1),  # within five hundredths of the last
        (sure(0.5, 0.1051, 0.1), 2),
        (sure(0.1, 0.1, 0.1), 0),
        (sure(0.1, 0.3, 0.1), 2),  # what is as good by chance, and worse again, is no knee
        (sure(0.05, 0.09, 0.1), 0),  # less model may be better
        ([*sure(0.5, 0.14), Error(0.1, 0.05, 0.15)], 1),  # inside the interval of the last
        (sure(0.3), 0),
        (sure(0.0, 0.0), 0),
    ],
)
def test_the_knee_is_the_smallest_model_from_which_on_all_are_as_good_as_the_largest(errors, knee):
    assert knee_of(errors) == knee


def test_the_mean_is_over_the_pixels_of_all_masks():
    rng = np.random.default_rng(0)
    maps = [rng.random((70, 45)), rng.random((33, 20))]
    masks = [rng.random(one.shape) < 0.3 for one in maps]
    every = np.concatenate([one[mask] for one, mask in zip(maps, masks, strict=True)])
    error = error_of(maps, masks)
    assert error.mean == pytest.approx(every.mean(), rel=1e-12)
    assert error.low < error.mean < error.high


def test_the_interval_holds_the_truth_as_often_as_it_says_where_tiles_are_independent():
    """Every tile is of one value, drawn from a normal distribution around 1."""
    rng, held = np.random.default_rng(1), 0
    for _ in range(200):
        tiles = rng.normal(1.0, 0.3, (8, 8))
        values = np.kron(tiles, np.ones((TILE, TILE)))
        error = error_of([values], [np.ones(values.shape, bool)])
        held += error.low <= 1.0 <= error.high
    assert 0.88 < held / 200 < 0.99


def test_pixels_beside_each_other_make_it_no_surer():
    values = np.kron(np.random.default_rng(2).random((6, 6)), np.ones((TILE, TILE)))
    error = error_of([values], [np.ones(values.shape, bool)])
    assert error.high - error.low > 0.1  # of as many independent pixels it would be a thousandth


def test_masks_without_a_pixel_are_refused():
    with pytest.raises(ValueError, match="no pixel shows a mirror; accepted: frames in which one is seen"):
        error_of([np.ones((8, 8))], [np.zeros((8, 8), bool)])
