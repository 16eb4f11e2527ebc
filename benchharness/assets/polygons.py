"""Polygons into triangles: a fan where they are convex, and by cutting ears where they are not (Meisters 1975).

A polygon is flat as far as is needed: it is judged in the plane of its own normal (Newell's). An ear is a corner that turns
left and whose triangle has no other corner of the polygon in it. Of a polygon that crosses itself, what no longer has an ear
is cut as it comes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

FLAT = 1e-12  # of a polygon's squared size: areas below this are none


def triangulated(points: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, int]:
    """Corners of triangles, int [T, 3], numbers of rows of `points`, float64 [C, 3]; and how many polygons cross themselves.

    The rows of `points` are the corners of the polygons one after the other, `sizes`, int [P], corners each, 3 or more.
    Triangles come in the order of their polygons, and go round as these do.
    """
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64)
    triangles, polygon, crossing = [], [], 0
    for size in np.unique(sizes):
        which = np.flatnonzero(sizes == size)
        fan = np.stack([np.zeros(size - 2, np.int64), np.arange(1, size - 1), np.arange(2, size)], axis=1)
        if size > 3:
            flat = _flattened(points[starts[which][:, None] + np.arange(size)])
            bent = ~_convex(flat)
            for one, corners in zip(which[bent], flat[bent], strict=True):
                cut, crosses = _ears(corners)
                triangles.append(starts[one] + np.array(cut))
                polygon.append(np.full(len(cut), one))
                crossing += crosses
            which = which[~bent]
        triangles.append((starts[which][:, None, None] + fan).reshape(-1, 3))
        polygon.append(np.repeat(which, size - 2))
    order = np.argsort(np.concatenate(polygon), kind="stable")
    return np.concatenate(triangles)[order], crossing


def owners(sizes: np.ndarray) -> np.ndarray:
    """Which polygon each triangle of `triangulated` is of, int [T]."""
    return np.repeat(np.arange(len(sizes)), sizes - 2)


def _flattened(corners: np.ndarray) -> np.ndarray:
    """Polygons of equal size, [P, n, 3], each in the plane that its normal is upright on, [P, n, 2]: counter-clockwise."""
    centred = corners - corners.mean(axis=1, keepdims=True)
    normal = np.cross(centred, np.roll(centred, -1, axis=1)).sum(axis=1)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.where(length > 0, normal / np.maximum(length, 1e-300), [0.0, 0.0, 1.0])
    aside = np.eye(3)[np.abs(normal).argmin(axis=1)]
    x = np.cross(aside, normal)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    y = np.cross(normal, x)
    return np.stack([np.einsum("pni,pi->pn", centred, x), np.einsum("pni,pi->pn", centred, y)], axis=2)


def _convex(flat: np.ndarray) -> np.ndarray:
    """Which polygons turn left at every corner, and once around in all; bool [P]."""
    along = np.roll(flat, -1, axis=1) - flat
    turn = np.roll(along, -1, axis=1)
    cross = along[..., 0] * turn[..., 1] - along[..., 1] * turn[..., 0]
    angle = np.arctan2(cross, (along * turn).sum(axis=2)).sum(axis=1)
    size = np.square(flat).sum(axis=2).max(axis=1)
    return (cross > FLAT * size[:, None]).all(axis=1) & (angle < 3 * np.pi)


def _ears(flat: np.ndarray) -> tuple[Sequence[tuple[int, int, int]], bool]:
    """The triangles of one polygon [n, 2], and whether an ear was missing."""
    left, cut, crosses = list(range(len(flat))), [], False
    least = FLAT * float(np.square(flat).sum(axis=1).max())
    while len(left) > 3:
        around = flat[left]
        before, after = np.roll(around, 1, axis=0), np.roll(around, -1, axis=0)
        area = _doubled(before, around, after)
        ear = next((k for k in range(len(left)) if area[k] > least and not _holds(around, k, least)), None)
        if ear is None:
            crosses |= bool((area < -least).any())
            ear = int(np.abs(area).argmin())  # with the least harm: what is in one line, if anything is
        cut.append((left[ear - 1], left[ear], left[(ear + 1) % len(left)]))
        del left[ear]
    crosses |= bool(_doubled(*flat[left]) < -least)
    return [*cut, (left[0], left[1], left[2])], crosses


def _holds(around: np.ndarray, ear: int, least: float) -> bool:
    """Whether another corner is in the triangle of corner `ear`, or on the cut that would take it off."""
    a, b, c = around[ear - 1], around[ear], around[(ear + 1) % len(around)]
    inside = (_doubled(a, b, around) > least) & (_doubled(b, c, around) > least) & (_doubled(c, a, around) >= -least)
    own = (around == a).all(axis=1) | (around == b).all(axis=1) | (around == c).all(axis=1)
    return bool((inside & ~own).any())


def _doubled(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Twice the areas of triangles in the plane, positive counter-clockwise."""
    ab, ac = b - a, c - a
    return ab[..., 0] * ac[..., 1] - ab[..., 1] * ac[..., 0]


def of_strip(vertices: np.ndarray) -> np.ndarray:
    """Triangles of a strip, int [n - 2, 3] of [n]: every second one goes the other way round, and is turned."""
    triangles = np.stack([vertices[:-2], vertices[1:-1], vertices[2:]], axis=1)
    triangles[1::2] = triangles[1::2][:, [1, 0, 2]]
    return triangles


def of_fan(vertices: np.ndarray) -> np.ndarray:
    """Triangles around the first of some vertices, int [n - 2, 3] of [n]."""
    return np.stack([vertices[1:-1], vertices[2:], np.full(max(len(vertices) - 2, 0), vertices[0])], axis=1)
