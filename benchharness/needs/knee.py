"""Where more model stops to matter: plateau and knee of a curve of errors, and how sure the errors are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

TILE = 32  # pixels: errors beside each other hang together, so that tiles are drawn and not pixels
DRAWS = 1000
NEAR = 0.05  # of the plateau's error; what is within is as good


@dataclass(frozen=True)
class Error:
    """A mean FLIP in mirrors, and its 95 % interval."""

    mean: float
    low: float
    high: float


def error_of(maps: Sequence[np.ndarray], masks: Sequence[np.ndarray]) -> Error:
    """The mean of error maps [H, W] over masks [H, W], of several frames; the interval by drawing tiles of all of them anew.
    Deterministic. Raises ValueError where all masks are empty."""
    sums, counts = (
        np.concatenate([_tiles(np.where(mask, value, 0.0)).ravel() for value, mask in zip(values, masks, strict=True)])
        for values in (maps, [np.ones_like(value) for value in maps])
    )
    sums, counts = sums[counts > 0], counts[counts > 0]
    if not counts.size:
        raise ValueError("needs: no pixel shows a mirror; accepted: frames in which one is seen")
    drawn = np.random.default_rng(0).integers(0, len(counts), (DRAWS, len(counts)))
    means = sums[drawn].sum(axis=1) / counts[drawn].sum(axis=1)
    return Error(float(sums.sum() / counts.sum()), *(float(q) for q in np.quantile(means, (0.025, 0.975))))


def _tiles(values: np.ndarray) -> np.ndarray:
    """Sums over tiles, of which those at the right and below may be smaller."""
    rows, columns = (np.arange(0, n, TILE) for n in values.shape)
    return np.add.reduceat(np.add.reduceat(values.astype(np.float64), rows, axis=0), columns, axis=1)


def knee_of(errors: Sequence[Error]) -> int:
    """The number of the smallest model from which on all are as good as the largest, the last: within NEAR of its error, or
    inside its interval."""
    plateau = errors[-1]
    enough = max((1 + NEAR) * plateau.mean, plateau.high)
    knee = len(errors) - 1
    while knee > 0 and errors[knee - 1].mean <= enough:
        knee -= 1
    return knee
