"""Few boxes that hold a scene: what none of them is met by, meets nothing of it. NumPy on arrays.

Each part begins in one box. The box with the most room in it is opened, until there are as many as are wanted: of a part,
what faces the same way goes together, so that a room becomes its walls; of those, a cut across an axis leaves the least
surface, weighted by what is on either side (MacDonald and Booth 1990). A box stands along the axes, or along the main axes
of what it holds if that makes it smaller, as it does for a wall that is turned.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

CELLS = 24  # per axis of a part: of what faces one way, triangles are first put together in so many
PAD = 1e-4  # of a part's size: so much wider is a box than what it holds, on each side
SMALLER = 0.7  # of the surface along the axes: a box that is turned is taken from here on


def boxes(parts: Sequence[tuple[np.ndarray, np.ndarray]], most: int) -> tuple[np.ndarray, np.ndarray]:
    """About `most` boxes, at least one per part, of parts given as vertices [V, 3] and faces [F, 3].

    Rows that take a point of the part's space to [-1, 1] across each box, float64 [B, 3, 4], and the number of its part [B].
    """
    cells = [_Cells.of(vertices[faces]) for vertices, faces in parts]
    leaves = [_Leaf(part, own, np.arange(len(own.low)), whole=True) for part, own in enumerate(cells)]
    while len(leaves) < most:
        roomy = max(leaves, key=lambda leaf: leaf.room)
        if roomy.room <= 0:
            break
        leaves.remove(roomy)
        leaves += roomy.opened()
    rows = []
    for leaf in leaves:
        vertices, faces = parts[leaf.part]
        pad = PAD * float(np.linalg.norm(np.ptp(vertices, axis=0)))
        rows.append(_rows(vertices[faces[leaf.cells.triangles(leaf.own)]].reshape(-1, 3).T, pad))
    return np.array(rows).reshape(-1, 3, 4), np.array([leaf.part for leaf in leaves], int)


@dataclass
class _Cells:
    """A part's triangles, put together by which way they face and where their middles are.

    low, high  their boxes, [C, 3] each; facing: 2 * axis + sign, [C]
    order      the triangles, cell by cell; `starts` [C + 1]: where each begins
    """

    low: np.ndarray
    high: np.ndarray
    facing: np.ndarray
    order: np.ndarray
    starts: np.ndarray

    @staticmethod
    def of(corners: np.ndarray) -> _Cells:
        """The cells of triangles [F, 3, 3]."""
        a, b, c = np.moveaxis(corners, 1, 0)
        low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
        normal = np.cross(b - a, c - a)
        axis = np.abs(normal).argmax(axis=1)
        facing = 2 * axis + (normal[np.arange(len(axis)), axis] < 0)
        middle = low + high
        place = (CELLS * (middle - middle.min(axis=0)) / np.maximum(np.ptp(middle, axis=0), 1e-300)).astype(int)
        key = np.minimum(place, CELLS - 1) @ [CELLS * CELLS, CELLS, 1] + CELLS**3 * facing
        order = np.argsort(key, kind="stable")
        starts = np.flatnonzero(np.concatenate([[True], np.diff(key[order]) > 0]))
        boxes = np.minimum.reduceat(low[order], starts), np.maximum.reduceat(high[order], starts)
        return _Cells(*boxes, facing[order[starts]], order, np.append(starts, len(order)))

    def triangles(self, own: np.ndarray) -> np.ndarray:
        return np.concatenate([self.order[self.starts[k] : self.starts[k + 1]] for k in own])


class _Leaf:
    """Cells `own` of a part; `whole`: all of it. `room`: the volume of its box, 0 for one that cannot be opened."""

    def __init__(self, part: int, cells: _Cells, own: np.ndarray, *, whole: bool = False) -> None:
        self.part, self.cells, self.own, self.whole = part, cells, own, whole
        self.low, self.high = cells.low[own], cells.high[own]
        self.room = float((self.high.max(axis=0) - self.low.min(axis=0)).prod()) if len(own) > 1 else 0.0

    def opened(self) -> list[_Leaf]:
        facing = self.cells.facing[self.own]
        if self.whole and facing.min() < facing.max():
            return [_Leaf(self.part, self.cells, self.own[facing == k]) for k in np.unique(facing)]
        best, order, cut = np.inf, self.own, 1
        count = np.arange(1, len(self.own))
        for axis in range(3):
            along = np.argsort(self.low[:, axis] + self.high[:, axis], kind="stable")
            before = _growing(self.low[along], self.high[along])[:-1]
            after = _growing(self.low[along[::-1]], self.high[along[::-1]])[-2::-1]
            cost = before * count + after * count[::-1]
            if cost.min() < best:
                best, order, cut = float(cost.min()), self.own[along], int(cost.argmin()) + 1
        return [_Leaf(self.part, self.cells, own) for own in (order[:cut], order[cut:])]


def _growing(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The surface of the box around the first, the first two, and so on."""
    return _surface(np.maximum.accumulate(high) - np.minimum.accumulate(low))


def _surface(size: np.ndarray) -> np.ndarray:
    """Half the surface of a box."""
    x, y, z = np.moveaxis(size, -1, 0)
    return x * y + y * z + z * x


def _rows(points: np.ndarray, pad: float) -> np.ndarray:
    """The box around points [3, N], float64 [3, 4]."""
    points = np.ascontiguousarray(points)
    main = np.linalg.eigh(np.cov(points, bias=True))[1].T
    along, turned = (np.ptp(axes @ points, axis=1) + 2 * pad for axes in (np.eye(3), main))
    axes = main if _surface(turned) < SMALLER * _surface(along) else np.eye(3)
    q = axes @ points
    half, middle = 0.5 * np.ptp(q, axis=1) + pad, 0.5 * (q.min(axis=1) + q.max(axis=1))
    return np.column_stack([axes / half[:, None], -middle / half])
