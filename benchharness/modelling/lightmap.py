"""Light on surfaces, finer than their vertices: samples on a regular grid of each triangle, and where in them a point is.

After mesh colours (Yuksel, Keyser and House 2010): a triangle whose sides are cut into R parts has (R + 1) (R + 2) / 2 samples,
and between the three that are around a point, light is linear. So what is seen is just what a mesh would show whose triangles
are cut into R² alike ones, with light at its vertices.

Where we differ: a point is found by coordinates that vertices carry and triangles interpolate, as those of a picture are, and
not by the number of its triangle. What is cut, split, copied or moved on its way into a mirror goes on to know where it is. For
that, the corners of a triangle that has a grid are its own, and the grids lie side by side in one sheet, two of a size in
each rectangle, the second turned by half a turn:

    a sample in row i, column j of the sheet is at x = j, y = i; between samples, the sheet is triangles, of which one half of
    each square holds (j, i), (j + 1, i), (j, i + 1), and the other (j + 1, i + 1), (j, i + 1), (j + 1, i)

Around each grid there is a rim of one more sample, as large as the nearest of the grid: a point that rounding has put beside it
finds what is on its edge.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256

import numpy as np

from benchharness.modelling.lightmesh import DEEPEST, LightMesh
from benchharness.modelling.panorama import read_only

NOWHERE = -1.0  # x and y of a vertex whose light is its own


@dataclass(frozen=True, eq=False)
class LightMap:
    """A sheet of samples (`benchharness.modelling.lightmap` says what is where).

    samples  float32 [H, W, 3], radiance

    Raises ValueError for other shapes, and for what is not finite.
    """

    samples: np.ndarray

    def __post_init__(self) -> None:
        samples = np.ascontiguousarray(self.samples, np.float32)
        if samples.ndim != 3 or samples.shape[2] != 3 or min(samples.shape[:2]) < 2:
            raise ValueError(f"light map: samples have shape {samples.shape}; accepted: [H, W, 3], H and W at least 2")
        if not np.isfinite(samples).all():
            raise ValueError("light map: a sample is not finite; accepted: radiance")
        object.__setattr__(self, "samples", read_only(samples))

    @cached_property
    def digest(self) -> str:
        """Of the samples, for content hashes."""
        return sha256(repr(self.samples.shape).encode() + self.samples.tobytes()).hexdigest()

    def looked_up(self, at: np.ndarray) -> np.ndarray:
        """Radiance at points x, y of the sheet [N, 2], float64 [N, 3]."""
        height, width, _ = self.samples.shape
        j, i = (np.clip(np.floor(at[:, k]).astype(int), 0, size - 2) for k, size in ((0, width), (1, height)))
        right, down = at[:, 0] - j, at[:, 1] - i
        far = right + down > 1
        a = self.samples[i + far, j + far] * np.abs(1 - right - down)[:, None]
        b = self.samples[i, j + 1] * np.where(far, 1 - down, right)[:, None]
        return a + b + self.samples[i + 1, j] * np.where(far, 1 - right, down)[:, None]


def cost(depth: np.ndarray) -> np.ndarray:
    """Samples that triangles take of a sheet, which were cut so often at most."""
    parts = 1 << np.asarray(depth)
    return np.where(parts > 1, (parts + 6) * (parts + 3) // 2, 0)


def sheet(mesh: LightMesh, values: np.ndarray, first: int, count: int) -> tuple[LightMap | None, np.ndarray]:
    """The map of `count` triangles, number `first` and those that follow, and where in it their corners are, float64
    [count, 3, 2]: NOWHERE for triangles that are not cut, whose light is their corners' own. None where none is cut.

    values   radiance at the vertices, float64 [V, 3], `settled`
    """
    mine = (mesh.whole >= first) & (mesh.whole < first + count)
    whole, depth, faces, grid = mesh.whole[mine] - first, mesh.depth[mine], mesh.faces[mine], mesh.at[mine]
    deepest, at = np.zeros(count, np.int64), np.full((count, 3, 2), NOWHERE)
    np.maximum.at(deepest, whole, depth)
    if not deepest.any():
        return None, at
    sizes = [int(d) for d in np.unique(deepest[deepest > 0])[::-1]]
    width = max((1 << sizes[0]) + 6, int(np.ceil(np.sqrt(cost(deepest).sum()))))
    blocks, top = [], 0
    for d in sizes:
        parts = 1 << d
        triangles = np.flatnonzero(deepest == d)
        number, turned = np.divmod(np.arange(len(triangles)), 2)
        across = width // (parts + 6)
        place = np.stack([number % across * (parts + 6), top + number // across * (parts + 3)], axis=1)
        place += turned[:, None] * [parts + 5, parts + 2]
        top += (int(number[-1]) // across + 1) * (parts + 3)
        blocks.append((d, triangles, place, np.where(turned, -1, 1)))
    samples = np.zeros((top, width, 3), np.float32)
    for d, triangles, place, sign in blocks:
        rank = np.full(count, -1)
        rank[triangles] = np.arange(len(triangles))
        here = rank[whole] >= 0
        values_there = _grids(rank[whole[here]], grid[here], depth[here], values[faces[here]], d)
        i, j, near_i, near_j = _rimmed(1 << d)
        column, row = (place[:, [k]] + sign[:, None] * (index + 1) for k, index in ((0, i), (1, j)))
        samples[row, column] = values_there[:, near_i, near_j]
        corners = 1 + (np.array([[0, 0], [1, 0], [0, 1]]) << d)
        at[triangles] = place[:, None] + sign[:, None, None] * corners
    return LightMap(samples), at


def _grids(whole: np.ndarray, at: np.ndarray, depth: np.ndarray, values: np.ndarray, deepest: int) -> np.ndarray:
    """Values [N, R + 1, R + 1, 3] at the samples of triangles number `whole`, of pieces with values [P, 3, 3] at their corners:
    by the weights of the second and the third corner of the whole, in R-ths."""
    out = np.zeros((int(whole.max()) + 1, (1 << deepest) + 1, (1 << deepest) + 1, 3), np.float32)
    for d in np.unique(depth):
        of_d, parts = depth == d, 1 << (deepest - int(d))
        b, c = np.nonzero(np.add.outer(np.arange(parts + 1), np.arange(parts + 1)) <= parts)
        weights = np.stack([parts - b - c, b, c], axis=1)
        place = np.einsum("sk,pkc->psc", weights, at[of_d] >> (DEEPEST - deepest)) // parts
        filled = np.einsum("sk,pkc->psc", weights / parts, values[of_d])
        out[whole[of_d, None], place[..., 0], place[..., 1]] = filled
    return out


def _rimmed(parts: int) -> tuple[np.ndarray, ...]:
    """Numbers of the samples of a grid with its rim, -1 to R + 1, and of the samples of the grid that these are as large as."""
    i, j = (index - 1 for index in np.nonzero(np.add.outer(np.arange(parts + 3), np.arange(parts + 3)) <= parts + 3))
    near_i, near_j = np.maximum(i, 0), np.maximum(j, 0)
    over = np.maximum(near_i + near_j - parts, 0)
    less = np.minimum(over, near_i)
    return i, j, near_i - less, near_j - (over - less)
