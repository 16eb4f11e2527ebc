"""Pictures of alpha: how opaque a surface is, from 0 to 1. Where a point is in one, and what is between the centres of its
pixels, is as for the colours (`benchharness.modelling.texture`), or all of a pixel is as its centre (`nearest`)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from benchharness.modelling.texture import Wrap, wrapped


@dataclass(frozen=True, eq=False)
class AlphaMap:
    """
    pixels   [H, W], rows from the top; kept as float64
    wrap     how it goes on beyond its edges, along u and along v
    nearest  whether nothing is interpolated
    """

    pixels: np.ndarray
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    nearest: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "pixels", np.ascontiguousarray(self.pixels, np.float64))

    def at(self, where: np.ndarray) -> np.ndarray:
        """Alpha at places [..., 2], column and row among the centres of pixels; float64 [...]."""
        height, width = self.pixels.shape
        if self.nearest:
            there = np.floor(where + 0.5).astype(np.int64)
            return self.pixels[wrapped(there[..., 1], height, self.wrap[1]), wrapped(there[..., 0], width, self.wrap[0])]
        corner = np.floor(where)
        x, y = np.moveaxis(where - corner, -1, 0)
        j, i = np.moveaxis(corner.astype(np.int64), -1, 0)
        left, right = (wrapped(j + k, width, self.wrap[0]) for k in (0, 1))
        above, below = (wrapped(i + k, height, self.wrap[1]) * width for k in (0, 1))
        flat = self.pixels.reshape(-1)
        a, b, c, d = flat[above + left], flat[above + right], flat[below + left], flat[below + right]
        upper, lower = a + x * (b - a), c + x * (d - c)
        return upper + y * (lower - upper)

    def halved(self) -> AlphaMap:
        """Half as many columns and rows, or one more where that is no whole number: means over areas."""
        return replace(self, pixels=_halved(_halved(self.pixels).T).T)


class Boxes:
    """Boxes of pixels of a picture that goes on beyond its edges: whether all of them, or any, are marked.

    Counted by a table of sums over all rows above and columns to the left (Crow 1984).
    """

    def __init__(self, marked: np.ndarray, wrap: tuple[Wrap, Wrap]) -> None:
        """`marked`: bool [H, W]."""
        self._wrap, self._shape = wrap, marked.shape
        for axis, way in ((1, wrap[0]), (0, wrap[1])):
            if way == "mirror":  # twice as much of it repeats
                marked = np.concatenate([marked, np.flip(marked, axis)], axis=axis)
        self._sums = np.zeros((marked.shape[0] + 1, marked.shape[1] + 1), np.int64)
        self._sums[1:, 1:] = marked.cumsum(axis=0, dtype=np.int64).cumsum(axis=1)

    def all_or_any(self, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of boxes from the pixel `low` to the pixel `high`, these included, float64 [N, 2], column and row: bool [N] each."""
        (left, right), (top, bottom) = (self._ends(low[:, axis], high[:, axis], axis) for axis in (0, 1))
        inside = self._sum(bottom, right) - self._sum(top, right) - self._sum(bottom, left) + self._sum(top, left)
        return inside == (right - left) * (bottom - top), inside > 0

    def _ends(self, low: np.ndarray, high: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
        """The first of a box's columns or rows and the one behind its last, from 0 on; no more than repeat themselves."""
        if self._wrap[axis] == "clamp":
            last = self._shape[1 - axis] - 1
            return np.clip(low, 0, last).astype(np.int64), np.clip(high, 0, last).astype(np.int64) + 1
        period = self._sums.shape[1 - axis] - 1
        first = (low % period).astype(np.int64)
        return first, first + np.minimum(high - low + 1, period).astype(np.int64)

    def _sum(self, row: np.ndarray, column: np.ndarray) -> np.ndarray:
        """How many are marked above a row and left of a column, of a picture that repeats."""
        sums, (down, i), (along, j) = self._sums, *map(np.divmod, (row, column), np.subtract(self._sums.shape, 1))
        return down * along * sums[-1, -1] + down * sums[-1, j] + along * sums[i, -1] + sums[i, j]


def _halved(pixels: np.ndarray) -> np.ndarray:
    """Half as many rows; one that lies in two of the new ones is shared out."""
    count = len(pixels)
    new = (count + 1) // 2
    total = np.concatenate([np.zeros((1, pixels.shape[1])), np.cumsum(pixels, axis=0)])
    at = np.arange(new + 1) * (count / new)
    row = np.minimum(at.astype(np.int64), count - 1)
    return np.diff(total[row] + (at - row)[:, None] * pixels[row], axis=0) * (new / count)
