"""Splits the long edges of triangles, without T-junctions. Plain arrays: `benchharness.scene.subdivided` is what scenes use."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

MOST_FACES = 4_000_000
"""That a mesh may be split into: ten times the most of any scene here. The next round may make four times as many."""


def split_edges(
    v: np.ndarray, f: np.ndarray, attributes: np.ndarray, h_max: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices [V, 3], faces int64 [F, 3] and attributes [V, A] with every edge longer than `h_max` split at its midpoint,
    again and again until none is left. New vertices come last; their attributes are the mean of the edge's ends.

    Raises ValueError for more than MOST_FACES.
    """
    while True:
        edges = np.sort(np.stack([f, np.roll(f, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
        unique, inverse = np.unique(edges, axis=0, return_inverse=True)
        split = np.linalg.norm(v[unique[:, 0]] - v[unique[:, 1]], axis=1) > h_max
        if not split.any():
            return v, f, attributes
        middle = np.full(len(unique), -1, np.int64)
        middle[split] = len(v) + np.arange(split.sum())
        v = np.concatenate([v, v[unique[split]].mean(axis=1)])
        attributes = np.concatenate([attributes, attributes[unique[split]].mean(axis=1)])
        f, _ = split_faces(f, middle[inverse.reshape(-1, 3)], v)
        if len(f) > MOST_FACES:
            raise ValueError(f"h_max is {h_max:g}: over {MOST_FACES:,} triangles; accepted: a greater length")


def split_faces(f: np.ndarray, middle: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Faces int64 [F, 3] with `middle` [F, 3]: the new vertex on edge (k, k+1), or -1 -> faces of the next round, and the
    number of the one that each is cut from."""
    count = (middle >= 0).sum(axis=1)
    whole, once, twice, thrice = (np.flatnonzero(count == k) for k in range(4))
    out = [f[whole]]

    # One split edge: turn the face so that it is edge (0, 1).
    a, m = _turned(f[once], middle[once], lambda m: np.argmax(m >= 0, axis=1))
    out += [np.stack([a[:, 0], m[:, 0], a[:, 2]], axis=1), np.stack([m[:, 0], a[:, 1], a[:, 2]], axis=1)]

    # Two: turn it so that edge (2, 0) is whole, then cut the remaining quad along its shorter diagonal.
    a, m = _turned(f[twice], middle[twice], lambda m: (np.argmax(m < 0, axis=1) + 1) % 3)
    out.append(np.stack([m[:, 0], a[:, 1], m[:, 1]], axis=1))
    first = np.linalg.norm(v[a[:, 0]] - v[m[:, 1]], axis=1) <= np.linalg.norm(v[m[:, 0]] - v[a[:, 2]], axis=1)
    one, two = first[:, None], ~first[:, None]
    out += [
        (np.stack([a[:, 0], m[:, 0], m[:, 1]], axis=1))[one[:, 0]],
        np.stack([a[:, 0], m[:, 1], a[:, 2]], axis=1)[one[:, 0]],
    ]
    out += [
        (np.stack([a[:, 0], m[:, 0], a[:, 2]], axis=1))[two[:, 0]],
        np.stack([m[:, 0], m[:, 1], a[:, 2]], axis=1)[two[:, 0]],
    ]

    # Three: the corners and the middle.
    a, m = f[thrice], middle[thrice]
    out += [np.stack([a[:, k], m[:, k], m[:, (k + 2) % 3]], axis=1) for k in range(3)]
    out.append(m)
    parents = [whole, once, once, twice, *[twice[first]] * 2, *[twice[~first]] * 2, *[thrice] * 4]
    return np.concatenate(out), np.concatenate(parents)


def _turned(f: np.ndarray, middle: np.ndarray, first: Callable) -> tuple[np.ndarray, np.ndarray]:
    """Rotates each face's corners so that corner `first(middle)` [F] comes first."""
    order = (first(middle)[:, None] + np.arange(3)) % 3
    return np.take_along_axis(f, order, axis=1), np.take_along_axis(middle, order, axis=1)
