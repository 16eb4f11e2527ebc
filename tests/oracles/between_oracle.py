"""Which three of some points another one lies between: every triple tried, float64, one at a time."""

from __future__ import annotations

from itertools import combinations

import numpy as np


def weights(corners: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Three numbers of sum 1 with which corners [3, 3] give the point of their plane that is nearest to p."""
    sides = np.stack([corners[1] - corners[0], corners[2] - corners[0]], axis=1)
    s, t = np.linalg.lstsq(sides, p - corners[0], rcond=None)[0]
    return np.array([1 - s - t, s, t])


def bound(corners: np.ndarray, w: np.ndarray, p: np.ndarray) -> float:
    """What linear interpolation is off by: sum |w| d², and four times the reach for each metre from the corners' plane."""
    away = np.linalg.norm(corners - p, axis=1)
    return float((np.abs(w) * away**2).sum() + 4 * np.linalg.norm(w @ corners - p) * away.max())


def best(points: np.ndarray, p: np.ndarray, outside: float, above: float) -> float:
    """The least bound of all triples of points [N, 3]; inf where p lies in no triangle, or too far from its plane."""
    least = np.inf
    for triple in combinations(range(len(points)), 3):
        corners = points[list(triple)]
        a, b = corners[1] - corners[0], corners[2] - corners[0]
        if np.linalg.norm(np.cross(a, b)) < 0.05 * np.linalg.norm(a) * np.linalg.norm(b):
            continue
        w = weights(corners, p)
        far = np.linalg.norm(corners - p, axis=1).max()
        if w.min() >= -outside and np.linalg.norm(w @ corners - p) <= above * far:
            least = min(least, bound(corners, w, p))
    return least
