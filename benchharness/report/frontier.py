"""Which points are on the frontier of time against error, when both are only known within intervals.

Less is better in both. A point j dominates i if it is no worse in both and better in one. With intervals that is
certain if it holds for all values in them, possible if it holds for some:

    certain    t_hi[j] <= t_lo[i]  and  e_hi[j] <= e_lo[i],  one of them strictly
    possible   t_lo[j] <= t_hi[i]  and  e_lo[j] <= e_hi[i],  one of them strictly

A point is dominated if some other certainly dominates it, undecided if some other only possibly does, and on the
frontier if none can.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

ON, DOMINATED, UNDECIDED, PARTIAL = "on the frontier", "dominated", "undecided", "partial"
"""PARTIAL is for a point that is a mean over fewer frames than the others: it takes no part."""


@dataclass(frozen=True)
class Place:
    """Where a point stands, and the indices of the others because of which: dominators, or rivals not told apart."""

    verdict: str
    by: tuple[int, ...] = ()


def classify(time_lo, time_hi, error_lo, error_hi) -> list[Place]:
    """Four arrays [N] of interval ends -> N places; `by` is ordered by time, then error, of its points.

    Raises ValueError for arrays of unlike length, ends that are not finite, and intervals that end before they start.
    """
    t_lo, t_hi, e_lo, e_hi = (np.asarray(a, np.float64).reshape(-1) for a in (time_lo, time_hi, error_lo, error_hi))
    if len({len(a) for a in (t_lo, t_hi, e_lo, e_hi)}) != 1:
        raise ValueError(f"frontier: lengths {[len(a) for a in (t_lo, t_hi, e_lo, e_hi)]}; accepted: four alike")
    for name, lo, hi in (("time", t_lo, t_hi), ("error", e_lo, e_hi)):
        bad = np.flatnonzero(~(np.isfinite(lo) & np.isfinite(hi) & (lo <= hi)))
        if len(bad):
            i = bad[0]
            raise ValueError(f"frontier: {name} of point {i} is [{lo[i]}, {hi[i]}]; accepted: finite, low <= high")

    certain = _no_worse(t_hi, t_lo, e_hi, e_lo)
    possible = _no_worse(t_lo, t_hi, e_lo, e_hi)
    np.fill_diagonal(certain, False)
    np.fill_diagonal(possible, False)
    order = np.lexsort((e_lo + e_hi, t_lo + t_hi))
    places = []
    for i in range(len(t_lo)):
        for verdict, matrix in ((DOMINATED, certain), (UNDECIDED, possible)):
            if matrix[:, i].any():
                places.append(Place(verdict, tuple(int(j) for j in order if matrix[j, i])))
                break
        else:
            places.append(Place(ON))
    return places


def _no_worse(t_j, t_i, e_j, e_i) -> np.ndarray:
    """bool [j, i]: point j, taken at one end of its intervals, is no worse than i at the given end, better in one."""
    t, e = t_j[:, None] - t_i[None, :], e_j[:, None] - e_i[None, :]
    return (t <= 0) & (e <= 0) & ((t < 0) | (e < 0))


def staircase(time, error) -> list[int]:
    """Indices of the points that no other dominates, intervals aside, by ascending time: the drawn frontier."""
    time, error = np.asarray(time, np.float64), np.asarray(error, np.float64)
    kept: list[int] = []
    for i in np.lexsort((error, time)):
        if not kept or error[i] < error[kept[-1]]:
            kept.append(int(i))
    return kept
