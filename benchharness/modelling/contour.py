"""The contour of alpha on triangles: which of them it misses, in which it is as good as straight, where it meets their edges.

Lengths are in pixels of the picture of alpha. Triangles longer than COARSE are whole, gone or split by what is in the box of
pixels around them; of others alpha is sampled half a pixel apart, and a cut straight across has to leave every sample within
FLAT of it on its side. So nothing farther than half a pixel from the contour ends up on its wrong side, and most is far nearer.
Without a picture alpha is linear on a triangle, and its contour straight.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from benchharness.modelling.alpha import AlphaMap, Boxes
from benchharness.modelling.texture import among_pixels

PLACE, NORMAL, UV, ALPHA = slice(0, 3), slice(3, 6), slice(6, 8), 8
"""What the columns of vertices are: where, unit normals, uv, and their own alpha."""

COARSE = 8.0
FLAT = 0.125
SHORTEST = 0.25  # of a triangle's longest edge: below this it is cut whatever runs through it
ORDERS = (4, 8, 16)  # parts of the edges of triangles between samples, up to 2 COARSE
AT_ONCE = 1 << 19  # samples
HALVINGS = 30  # of an edge, until what meets it is found
ROUNDING = 1e-9  # of alpha: what is so little below its cutoff is there, or edges along the contour would be cut by rounding


@dataclass(frozen=True, eq=False)
class Holes:
    """A surface is where alpha, that of a picture times that of vertices times a factor, is at least a cutoff.

    picture        None for 1 everywhere
    scale, offset  take uv to those of this picture: uv * scale + offset
    """

    cutoff: float
    picture: AlphaMap | None = None
    factor: float = 1.0
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)

    @property
    def least(self) -> float:
        """The least alpha of what is there."""
        return self.cutoff - ROUNDING

    def coarser(self) -> Holes:
        """The same with half as many pixels each way; with their mean alone at last."""
        if self.picture is None:
            return self
        picture = self.picture.halved()
        if picture.pixels.size > 1:
            return replace(self, picture=picture)
        return replace(self, picture=None, factor=self.factor * float(picture.pixels[0, 0]))

    def seen(self, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where vertices [..., 9 or more] are among the pixels, [..., 2], and by what the picture's alpha counts, [...]."""
        share = self.factor * columns[..., ALPHA]
        if self.picture is None:
            return np.zeros((*share.shape, 2)), share
        return among_pixels(columns[..., UV] * self.scale + self.offset, *self.picture.pixels.shape), share

    def value(self, where: np.ndarray, share: np.ndarray) -> np.ndarray:
        """How much alpha is above the cutoff."""
        return (share if self.picture is None else share * self.picture.at(where)) - self.least


class Contour:
    """Where alpha is at its cutoff, on triangles whose vertices have alphas of a range."""

    def __init__(self, holes: Holes, alphas: np.ndarray) -> None:
        """`alphas`: of all vertices there are."""
        self.holes = holes
        if holes.picture is not None:
            pixels, factors = holes.picture.pixels, (holes.factor * alphas.min(), holes.factor * alphas.max())
            self._least, self._most = (Boxes(pixels * factor >= holes.least, holes.picture.wrap) for factor in factors)

    def value(self, columns: np.ndarray) -> np.ndarray:
        """How much alpha is above the cutoff at vertices, [..., 9 or more] -> [...]."""
        return self.holes.value(*self.holes.seen(columns))

    def root(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Where the contour meets edges between vertices on either side of it, as a share of the way from `one` to `other`."""
        ends = self.holes.seen(one), self.holes.seen(other)
        count = len(one)
        return self._root(ends, np.zeros(count), np.ones(count), self.holes.value(*ends[0]) >= 0, HALVINGS)

    def judged(self, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of triangles [F, 3, 9 or more]: which are there at all, bool [F], and which of their edges, from one corner to the
        next, have to be split before the triangle can be cut straight across, bool [F, 3]."""
        where, share = self.holes.seen(columns)
        if self.holes.picture is None:
            somewhere: np.ndarray = np.any(share >= self.holes.least, axis=1)
            return somewhere, np.zeros(share.shape, bool)
        there, split = np.ones(len(where), bool), np.zeros(len(where), bool)
        side = np.linalg.norm(np.roll(where, -1, axis=1) - where, axis=2)
        longest = side.max(axis=1)
        coarse = longest > COARSE
        low, high = np.floor(where[coarse].min(axis=1)), np.floor(where[coarse].max(axis=1)) + 1
        there[coarse] = self._most.all_or_any(low, high)[1]
        split[coarse] = there[coarse] & ~self._least.all_or_any(low, high)[0]
        left = ~coarse
        for order in ORDERS:
            mine = np.flatnonzero(left & (longest <= 0.5 * order))
            left[mine] = False
            step = max(1, AT_ONCE // len(_lattice(order)[0]))
            for some in (mine[k : k + step] for k in range(0, len(mine), step)):
                there[some], split[some] = self._sampled(where[some], share[some], order)
        split &= longest > SHORTEST
        return there, split[:, None] & (2 * side >= longest[:, None])

    def _sampled(self, where: np.ndarray, share: np.ndarray, order: int) -> tuple[np.ndarray, np.ndarray]:
        """Of triangles [F, 3, 2], whose edges are divided into so many parts: which have a sample that is there, and which have
        one on the wrong side of a cut across; bool [F] each."""
        above = self.holes.value(where, share) >= 0
        count = above.sum(axis=1)
        odd = np.where(count == 2, above.argmin(axis=1), above.argmax(axis=1))  # the corner that is alone on its side
        turn = (odd[:, None] + np.arange(3)) % 3
        where, share = np.take_along_axis(where, turn[:, :, None], axis=1), np.take_along_axis(share, turn, axis=1)
        weights, (left, right, opposite) = _lattice(order)
        points = weights @ where
        value = self.holes.value(points, share @ weights.T)
        above = value >= 0
        there: np.ndarray = np.any(above, axis=1)

        # The contour meets the two edges of the odd corner once each.
        changes = [np.diff(above[:, edge], axis=1) for edge in (left, right, opposite)]
        once = (changes[0].sum(axis=1) == 1) & (changes[1].sum(axis=1) == 1) & ~changes[2].any(axis=1)
        ends = []
        for k in (0, 1):
            before = changes[k].argmax(axis=1) / order
            edge = (where[:, 0], share[:, 0]), (where[:, k + 1], share[:, k + 1])
            t = self._root(edge, before, before + 1 / order, above[:, left[0]], 8)
            ends.append(where[:, 0] + t[:, None] * (where[:, k + 1] - where[:, 0]))

        # How far samples are from the line between these, positive on the odd corner's side.
        along = ends[1] - ends[0]
        length = np.linalg.norm(along, axis=1)
        offset = points - ends[0][:, None]
        aside = along[:, None, 0] * offset[:, :, 1] - along[:, None, 1] * offset[:, :, 0]
        aside *= (np.sign(aside[:, left[0]]) / np.where(length > 0, length, 1.0))[:, None]
        wrong = ((aside > 0) != (above == above[:, left[:1]])) & (np.abs(aside) > FLAT)
        return there, there & ~above.all(axis=1) & ~(once & ~wrong.any(axis=1))

    def _root(
        self,
        ends: tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]],
        low: np.ndarray,
        high: np.ndarray,
        above: np.ndarray,
        times: int,
    ) -> np.ndarray:
        """Shares of the way between two ends, each places [N, 2] and shares [N], where it ceases to be as at the first, `above`
        or not: between `low` and `high`, halved so often."""
        (where, share), (other, others) = ends
        for _ in range(times):
            t = 0.5 * (low + high)
            same = (self.holes.value(where + t[:, None] * (other - where), share + t * (others - share)) >= 0) == above
            low, high = np.where(same, t, low), np.where(same, high, t)
        return 0.5 * (low + high)


@lru_cache
def _lattice(order: int) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Points of a triangle whose edges have so many parts: what each corner counts at them, float64 [S, 3], and the numbers of
    those on the edges from the first corner to the second, to the third, and from there to the second."""
    i, j = np.nonzero(np.add.outer(np.arange(order + 1), np.arange(order + 1)) <= order)
    weights = np.stack([order - i - j, i, j], axis=1) / order
    return weights, (np.flatnonzero(j == 0), np.flatnonzero(i == 0), np.flatnonzero(i + j == order))
