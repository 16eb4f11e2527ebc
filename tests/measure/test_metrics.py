"""Metrics against numbers worked by hand, and the traps of the metric libraries."""

from __future__ import annotations

from types import SimpleNamespace

import flip_evaluator
import numpy as np
import pytest
from PIL import Image

from benchharness.measure import metrics

PINNED = {"ppd": 67.0, "exposure": 0.0}


def noisy(height: int = 64, width: int = 80, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).random((height, width, 3)).astype(np.float32)


def flat(value: float, size: int = 4) -> np.ndarray:
    return np.full((size, size, 3), value, np.float32)


def everywhere(image: np.ndarray) -> np.ndarray:
    return np.ones(image.shape[:2], bool)


def test_errors_of_two_pixels_are_those_worked_by_hand() -> None:
    # Two pixels in the mask, differences 0.1 and 0.3 in all channels, references 0.5 and 1.
    # rmse = sqrt((0.01 + 0.09) / 2) = 0.2236; relmse = (0.01 / 0.26 + 0.09 / 1.01) / 2 = 0.06379.
    reference, image, mask = flat(1.0), flat(1.0), np.zeros((4, 4), bool)
    mask[1, 1] = mask[2, 3] = True
    reference[1, 1], image[1, 1] = 0.5, 0.6
    image[2, 3] = 0.7
    image[0, 0] = 40.0  # off the mask: must not count
    found = np.zeros((4, 4), bool)
    found[2, 3] = found[0, 0] = True
    result = metrics.evaluate(image, reference, mask, found=found, **PINNED)
    assert result["rmse"] == pytest.approx(0.223607, rel=1e-4)
    assert result["relmse"] == pytest.approx((0.01 / 0.26 + 0.09 / 1.01) / 2, rel=1e-4)
    assert result["coverage"] == 0.5
    assert result["nonfinite_px"] == 0


def test_exposure_scales_rmse_and_not_relmse() -> None:
    one = metrics.evaluate(flat(0.2), flat(0.1), np.ones((4, 4), bool), ppd=67, exposure=0)
    two = metrics.evaluate(flat(0.2), flat(0.1), np.ones((4, 4), bool), ppd=67, exposure=2)
    assert two["rmse"] == pytest.approx(4 * one["rmse"])
    assert two["relmse"] == one["relmse"]


def test_the_same_image_has_no_error() -> None:
    image = noisy()
    result = metrics.evaluate(image, image, everywhere(image), **PINNED)
    assert [result[name] for name in ("rmse", "relmse", "flip", "flip_p95")] == [0, 0, 0, 0]


def test_black_against_white_is_the_largest_flip() -> None:
    result = metrics.evaluate(flat(0, 40), flat(1, 40), np.ones((40, 40), bool), **PINNED)
    # HyAB of black and white lies in the compressed range above 0.95.
    assert 0.95 < result["flip"] <= 1


def test_flip_sees_the_picture_at_the_exposure_of_the_scene() -> None:
    # Two stops up, both 0.5 and 0.6 are white.
    image, reference = flat(0.6, 40), flat(0.5, 40)
    mask = np.ones((40, 40), bool)
    assert metrics.evaluate(image, reference, mask, ppd=67, exposure=0)["flip"] > 0.02
    assert metrics.evaluate(image, reference, mask, ppd=67, exposure=2)["flip"] == 0


def test_windowed_flip_equals_that_of_the_full_frame() -> None:
    reference = noisy(120, 140)
    mask = np.zeros((120, 140), bool)
    mask[50:70, 60:90] = True
    image = np.where(mask[..., None], noisy(120, 140, seed=1), reference)
    x, y = metrics.display(image, 0), metrics.display(reference, 0)
    full = flip_evaluator.evaluate(y, x, "LDR", applyMagma=False, parameters={"ppd": 67.0})[0][..., 0]
    window = metrics.flip_map(image, reference, mask, **PINNED)
    # Single precision sums in another order.
    assert np.abs(window - full)[mask].max() < 1e-5
    assert full[~mask].max() > 0.01
    assert (window[~mask] == 0).all()


def test_what_is_off_the_mask_does_not_leak_through_the_filters() -> None:
    reference = noisy()
    mask = np.zeros((64, 80), bool)
    mask[20:40, 20:40] = True
    wild = np.where(mask[..., None], reference, 1 - reference)
    assert metrics.evaluate(wild, reference, mask, **PINNED)["flip"] == 0


def test_two_black_images_have_no_error_and_do_not_end_the_process() -> None:
    result = metrics.evaluate(flat(0), flat(0), np.ones((4, 4), bool), **PINNED)
    assert result["flip"] == result["rmse"] == result["relmse"] == 0


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, -0.5])
def test_a_pixel_that_is_no_colour_is_counted_and_no_error_is_given(value: float) -> None:
    reference = noisy()
    image = reference.copy()
    image[3, 4, 1] = image[5, 6, 2] = value
    result = metrics.evaluate(image, reference, everywhere(image), **PINNED)
    assert result["nonfinite_px"] == 2
    assert [result[name] for name in ("rmse", "relmse", "flip", "flip_p95")] == [None] * 4
    error = metrics.flip_map(image, reference, everywhere(image), **PINNED)
    assert np.isnan(error[3, 4])
    assert np.isnan(error).sum() == 2


def test_a_pixel_that_is_no_colour_off_the_mask_does_not_matter() -> None:
    reference = noisy()
    image = reference.copy()
    image[3, 4] = np.nan
    mask = everywhere(image)
    mask[3, 4] = False
    result = metrics.evaluate(image, reference, mask, **PINNED)
    assert result["nonfinite_px"] == 0
    assert result["flip"] == 0


def test_a_reference_that_is_no_colour_is_refused() -> None:
    reference = noisy()
    reference[0, 0] = np.nan
    with pytest.raises(ValueError, match="reference"):
        metrics.evaluate(noisy(), reference, everywhere(reference), **PINNED)


def test_an_empty_mask_has_no_errors_rather_than_zero() -> None:
    image = noisy()
    result = metrics.evaluate(image, image, np.zeros(image.shape[:2], bool), found=everywhere(image), **PINNED)
    assert result == dict.fromkeys(("rmse", "relmse", "flip", "flip_p95", "coverage")) | {"nonfinite_px": 0}


def test_shapes_that_do_not_fit_are_refused_by_name() -> None:
    with pytest.raises(ValueError, match=r"mask \(3, 4\)"):
        metrics.evaluate(flat(0), flat(0), np.ones((3, 4), bool), **PINNED)


def test_a_method_that_covers_less_does_not_hide_it() -> None:
    image = noisy()
    found = everywhere(image)
    found[:16] = False  # a quarter of 64 rows
    assert metrics.evaluate(image, image, everywhere(image), found=found, **PINNED)["coverage"] == 0.75


def test_a_constant_error_does_not_flicker_and_a_changing_one_does() -> None:
    y0, y1 = noisy(seed=0), noisy(seed=1)
    mask = everywhere(y0)
    assert metrics.temporal_diff(y0 + 0.5, y1 + 0.5, y0, y1, mask) == pytest.approx(0, abs=1e-6)
    assert metrics.temporal_diff(y0, y1 + 0.25, y0, y1, mask) == pytest.approx(0.25, rel=1e-5)
    assert metrics.temporal_diff(y0, y1 * np.nan, y0, y1, mask) is None
    assert metrics.temporal_diff(y0, y1, y0, y1, ~mask) is None


def test_jitter_is_the_second_difference() -> None:
    # Linear drift has none; 0, 1, 0 has a second difference of -2 along x, and (0, 0), (3, 4), (0, 0) of length 10.
    drift = np.arange(5.0)[:, None, None] * np.array([1.0, 2.0])
    assert metrics.jitter_px(drift) == pytest.approx(0, abs=1e-12)
    assert metrics.jitter_px(np.array([[[0, 0]], [[1, 0]], [[0, 0]]])) == 2
    assert metrics.jitter_px(np.array([[[0, 0]], [[3, 4]], [[0, 0]]])) == 10
    gap = np.array([[[0, 0], [0, 0]], [[1, 0], [np.nan, 0]], [[0, 0], [0, 0]]])
    assert metrics.jitter_px(gap) == 2
    assert metrics.jitter_px(np.zeros((2, 1, 2))) is None


def test_distance_error_is_the_median_where_both_are_finite() -> None:
    # Relative errors 0.1, 0.5, 0.2 -> median 0.2; inf and NaN are left out, and so is the last, off the mask.
    truth = np.array([[1.0, 2.0, 10.0, np.inf, 5.0, 1.0]], np.float32)
    given = np.array([[1.1, 3.0, 8.0, 4.0, np.nan, 100.0]], np.float32)
    mask = np.array([[True, True, True, True, True, False]])
    assert metrics.distance_error(given, truth, mask) == pytest.approx(0.2, rel=1e-5)
    assert metrics.distance_error(given, truth * np.inf, mask) is None


def test_noise_is_the_flip_of_another_draw_and_grows_with_the_variance() -> None:
    shape = (40, 50)
    image, mask = np.full((*shape, 3), 0.4, np.float32), np.ones(shape, bool)

    def noise(deviation: float) -> float | None:
        variance = np.full((*shape, 3), deviation**2, np.float32)
        reference = SimpleNamespace(image=image, variance=variance, mask=mask)
        return metrics.noise(reference, ppd=67.0, exposure=0.0)

    levels = [noise(0.0), noise(0.01), noise(0.05), noise(0.2)]
    assert levels[0] == 0
    assert levels == sorted(levels) and levels[1] > 0
    # By hand: the same draw, looked at by FLIP.
    draw = np.random.default_rng(0).normal(size=image.shape)
    other = np.maximum(image + np.float32(0.05) * draw, 0).astype(np.float32)
    expected = metrics.evaluate(other, image, mask, ppd=67.0, exposure=0.0)["flip"]
    assert levels[2] == pytest.approx(expected, rel=1e-3)


def test_tonemap_follows_srgb() -> None:
    # Linear 0.5 is 188 in sRGB, 0.25 one stop up the same, 0.002 in the linear piece is 0.02584 * 255 = 6.6.
    image = np.array([[[0.5] * 3, [0.002] * 3, [7.0] * 3, [np.nan] * 3]], np.float32)
    assert metrics.tonemap(image, 0)[0].tolist() == [[188] * 3, [7] * 3, [255] * 3, [255, 0, 255]]
    assert metrics.tonemap(image / 2, 1)[0, 0].tolist() == [188] * 3


def test_pictures_go_through_a_file_unchanged(tmp_path) -> None:
    pixels = metrics.error_picture(np.array([[0.0, 0.5, 1.0, np.nan]]))
    metrics.save_png(tmp_path / "error.png", pixels)
    assert np.array_equal(np.asarray(Image.open(tmp_path / "error.png")), pixels)
    assert pixels[0, 0].max() < 10  # magma starts near black
    assert pixels[0, 3].tolist() == [0, 255, 255]
    with pytest.raises(ValueError, match="uint8"):
        metrics.save_png(tmp_path / "no.png", np.zeros((2, 2, 3)))
