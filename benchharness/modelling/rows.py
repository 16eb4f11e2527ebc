"""Rows of numbers that are alike."""

from __future__ import annotations

import numpy as np


def distinct(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The first of every kind of row, numbers in their order, and of which kind each row is."""
    rows = rows.reshape(len(rows), -1)
    order = np.lexsort(rows.T)
    new = np.ones(len(rows), bool)
    new[1:] = (rows[order[1:]] != rows[order[:-1]]).any(axis=1)
    first = order[new]
    rank = np.empty(len(first), np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    kind = np.empty(len(rows), np.int64)
    kind[order] = rank[np.cumsum(new) - 1]
    return np.sort(first), kind
