"""Images and a mask in, numbers out: the one place for masks, exposure, and what to do about NaN.

Everything is counted inside the reflector's mask only. Outside it both images are given the reference's pixels, so that
nothing but the reflection counts, not even through FLIP's filters, which reach about ten pixels; of what FLIP would see
just across the mask's border the error is therefore slightly lower than it would be in a wrong surrounding.

FLIP is LDR-FLIP of the pictures as a viewer sees them: radiance times 2^exposure, cut off at 1, in sRGB. Exposure and
pixels per degree are the scene's, so that numbers of different methods compare. What is brighter than white counts in
`relmse` and `rmse`, which take linear radiance as it is; `rmse` after the exposure, so that 1 is display white.

A pixel that is NaN, infinite or negative is no colour. FLIP would make a finite number of it; here, one such pixel in
the mask makes every error None, and `nonfinite_px` says how many there are. In a reference it raises ValueError.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from benchharness.render.reference import Reference

RELMSE_EPS = 1e-2
"""Added to the squared reference in `relmse`, (W/(m² sr))²."""

POP = 0.1
"""FLIP from which a pixel's change is noticed: 2.3 in CIELAB, the just noticeable difference of Mahy et al. 1994, goes
through FLIP's colour error, 0.95 2.3^0.7 / (0.4 41.3) of Andersson et al. 2020, to 0.10."""

NEGATIVE = -1e-6
"""Radiance below this is counted as negative; rounding may leave a little less than nothing."""


def evaluate(
    image: np.ndarray,
    reference: np.ndarray,
    mask: np.ndarray,
    *,
    ppd: float,
    exposure: float,
    found: np.ndarray | None = None,
    error: np.ndarray | None = None,
) -> dict[str, float | int | None]:
    """Errors of a picture inside the mask.

    image, reference  [H, W, 3] linear radiance
    mask              bool [H, W], the reflectors' pixels
    ppd               pixels per degree of visual angle
    exposure          stops
    found             bool [H, W], where the method had an answer
    error             their `flip_map`, where it is at hand

    rmse          root of the mean squared difference of radiance times 2^exposure
    relmse        mean of (x - y)² / (y² + 1e-2)
    flip          mean of the FLIP map; flip_p95 its 95th percentile
    coverage      share of the mask with `found`; None where that is not given
    nonfinite_px  pixels of the mask that are NaN, infinite or negative; where any, all errors are None

    All None, and 0 pixels, for an empty mask. Raises ValueError for shapes that do not fit.
    """
    mask = _checked(image, reference, mask)
    empty = dict.fromkeys(("rmse", "relmse", "flip", "flip_p95"))
    if not mask.any():
        return empty | {"coverage": None, "nonfinite_px": 0}
    coverage = None if found is None else float(np.mean(np.broadcast_to(found, mask.shape)[mask]))
    bad = int((~_sound(image) & mask).sum())
    if bad:
        return empty | {"coverage": coverage, "nonfinite_px": bad}
    x, y = image[mask].astype(np.float64), reference[mask].astype(np.float64)
    error = flip_map(image, reference, mask, ppd=ppd, exposure=exposure) if error is None else error
    flip = error[mask].astype(np.float64)
    return {
        "rmse": float(np.sqrt(np.mean((x - y) ** 2)) * 2.0**exposure),
        "relmse": float(np.mean((x - y) ** 2 / (y**2 + RELMSE_EPS))),
        "flip": float(flip.mean()),
        "flip_p95": float(np.percentile(flip, 95)),
        "coverage": coverage,
        "nonfinite_px": 0,
    }


def flip_map(image: np.ndarray, reference: np.ndarray, mask: np.ndarray, *, ppd: float, exposure: float) -> np.ndarray:
    """FLIP per pixel, float32 [H, W] in [0, 1]; 0 off the mask, NaN where `image` is no colour.

    The map is computed over the mask's bounding box and a margin wider than FLIP's filters, then masked.
    """
    import flip_evaluator

    mask = _checked(image, reference, mask)
    result = np.zeros(mask.shape, np.float32)
    if not mask.any():
        return result
    sound = _sound(image)

    # FLIP's widest filter ends 3 sigma out: 3 sqrt(0.04 / (2 pi²)) degrees for blue-yellow, 3 * 0.041 for features.
    margin = int(np.ceil(0.15 * ppd)) + 2
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    window = (
        slice(max(rows[0] - margin, 0), rows[-1] + margin + 1),
        slice(max(columns[0] - margin, 0), columns[-1] + margin + 1),
    )
    y = display(reference[window], exposure)
    x = np.where((mask & sound)[window][..., None], display(np.where(sound[..., None], image, 0)[window], exposure), y)
    if np.array_equal(x, y):
        error = np.zeros(x.shape[:2], np.float32)
    else:
        error = flip_evaluator.evaluate(y, x, "LDR", applyMagma=False, parameters={"ppd": float(ppd)})[0][..., 0]
    result[window] = np.where(mask[window], error, 0)
    result[mask & ~sound] = np.nan
    return result


def temporal_diff(x0: np.ndarray, x1: np.ndarray, y0: np.ndarray, y1: np.ndarray, mask: np.ndarray) -> float | None:
    """Mean of |(x1 - x0) - (y1 - y0)| inside the mask: how much of the change from frame to frame is not the scene's.

    x0, x1 are two frames of a method, y0, y1 of the reference, [H, W, 3] each; a mask of pixels that reflect in both.
    None for an empty mask and where a pixel of the mask is no colour.
    """
    _checked(x0, y0, mask)
    mask = _checked(x1, y1, mask)
    if not mask.any() or not (_sound(x0) & _sound(x1))[mask].all():
        return None
    x = x1[mask].astype(np.float64) - x0[mask]
    return float(np.abs(x - (y1[mask].astype(np.float64) - y0[mask])).mean())


def pops(
    x0: np.ndarray, x1: np.ndarray, y0: np.ndarray, y1: np.ndarray, mask: np.ndarray, *, ppd: float, exposure: float
) -> float | None:
    """Share of the mask that changes noticeably otherwise than the reference does: FLIP between x1 and x0 + (y1 - y0) over POP.

    Arguments as of `temporal_diff`, and None where that is. A picture that is wrong and stays so does not pop; an edge that
    is somewhere else than in the reference pops when it moves on by a pixel, in one place and in the other.
    """
    _checked(x0, y0, mask)
    mask = _checked(x1, y1, mask)
    if not mask.any() or not (_sound(x0) & _sound(x1))[mask].all():
        return None
    expected = np.where(mask[..., None], np.maximum(x0 + (y1 - y0), 0), y1)
    return float((flip_map(x1, expected, mask, ppd=ppd, exposure=exposure)[mask] > POP).mean())


def jitter_px(errors: np.ndarray) -> float | None:
    """Root mean square length of the second difference in time of screen errors [T, N, 2], in pixels.

    NaN marks a point that had none in that frame; triples with one are left out. None if no triple is left.
    """
    errors = np.asarray(errors, np.float64)
    if errors.ndim != 3 or errors.shape[2] != 2:
        raise ValueError(f"jitter_px: errors have shape {errors.shape}; accepted: [frames, points, 2]")
    squared = (np.diff(errors, n=2, axis=0) ** 2).sum(axis=2)
    squared = squared[np.isfinite(squared)]
    return float(np.sqrt(squared.mean())) if squared.size else None


def distance_error(distance: np.ndarray, reference_distance: np.ndarray, mask: np.ndarray) -> float | None:
    """Median of |d - d_ref| / d_ref inside the mask, over pixels where both are finite; None where there is none."""
    both = mask & np.isfinite(distance) & np.isfinite(reference_distance)
    truth = reference_distance[both].astype(np.float64)
    if not truth.size:
        return None
    return float(np.median(np.abs(distance[both] - truth) / np.maximum(truth, 1e-9)))


def noise(reference: Reference, *, ppd: float, exposure: float) -> float | None:
    """What the reference's own noise costs: mean FLIP inside the mask between it and another that is as noisy.

    The other is drawn from the reference's mean and variance, always with the same random numbers. 0 where there is no
    variance, None for an empty mask.
    """
    if not reference.mask.any():
        return None
    if not reference.variance[reference.mask].any():
        return 0.0
    draw = np.random.default_rng(0).normal(size=reference.image.shape)
    other = np.maximum(reference.image + np.sqrt(reference.variance) * draw, 0).astype(np.float32)
    error = flip_map(other, reference.image, reference.mask, ppd=ppd, exposure=exposure)
    return float(error[reference.mask].astype(np.float64).mean())


def display(image: np.ndarray, exposure: float) -> np.ndarray:
    """Radiance -> sRGB in [0, 1], float32: times 2^exposure, cut off at 0 and 1, encoded by IEC 61966-2-1."""
    linear = np.clip(np.asarray(image, np.float32) * np.float32(2.0**exposure), 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055).astype(np.float32)


def tonemap(image: np.ndarray, exposure: float) -> np.ndarray:
    """Radiance [H, W, 3] -> sRGB, uint8 [H, W, 3]. NaN becomes magenta, so that it is seen."""
    nan = np.asarray(np.any(np.isnan(image), axis=2))
    pixels = np.round(display(np.where(nan[..., None], 0, image), exposure) * 255).astype(np.uint8)
    pixels[nan] = (255, 0, 255)
    return pixels


def save_png(path: str | Path, pixels: np.ndarray) -> None:
    """Writes uint8 [H, W, 3] sRGB."""
    from PIL import Image

    if pixels.dtype != np.uint8 or pixels.ndim != 3 or pixels.shape[2] != 3:
        raise ValueError(f"save_png: pixels are {pixels.dtype} {pixels.shape}; accepted: uint8 [H, W, 3]")
    Image.fromarray(pixels).save(path, format="PNG", compress_level=3)


def error_picture(error: np.ndarray) -> np.ndarray:
    """Error map [H, W] in [0, 1] -> magma colours, uint8 [H, W, 3]; black is none, NaN is cyan (magma has none)."""
    from matplotlib import colormaps

    nan = np.asarray(np.isnan(error))
    pixels = colormaps["magma"](np.where(nan, 0, np.clip(error, 0, 1)), bytes=True)[..., :3].copy()
    pixels[nan] = (0, 255, 255)
    return pixels


def _sound(image: np.ndarray) -> np.ndarray:
    """Pixels that are colours: finite and not negative, bool [H, W]."""
    return np.asarray(np.all(np.isfinite(image) & (image >= NEGATIVE), axis=2))


def _checked(image: np.ndarray, reference: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """The mask as bool, once all shapes fit and the reference is sound."""
    if image.ndim != 3 or image.shape[2] != 3 or image.shape != reference.shape or mask.shape != image.shape[:2]:
        raise ValueError(
            f"metrics: image {image.shape}, reference {reference.shape}, mask {mask.shape}; "
            "accepted: [H, W, 3], the same, [H, W]"
        )
    mask = mask.astype(bool)
    if not _sound(reference).all():
        raise ValueError("metrics: the reference has NaN, infinite or negative pixels; accepted: radiance")
    return mask
