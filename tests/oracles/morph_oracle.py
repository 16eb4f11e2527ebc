"""Interpolation between maps that are taken at regular places of a box, in closed form, float64.

A map is a room and a place: what it shows in a direction is where the ray from the place ends. Told is not a colour but that
point, so that errors are in metres.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np


class Surroundings(Protocol):
    def first_hit(self, x: np.ndarray, r: np.ndarray) -> np.ndarray: ...


@dataclass
class Dome:
    """A sphere that is seen from within."""

    middle: np.ndarray
    radius: float

    def first_hit(self, x: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Distances along rays from x [N, 3] in unit directions r [N, 3]."""
        o = x - self.middle
        b = (o * r).sum(axis=1)
        return -b + np.sqrt(b * b - (o * o).sum(axis=1) + self.radius**2)


def along(low: float, high: float, count: int) -> np.ndarray:
    """The middles of `count` equal parts."""
    edges = np.linspace(low, high, count + 1)
    return 0.5 * (edges[:-1] + edges[1:])


def places(low: np.ndarray, high: np.ndarray, counts: tuple[int, int, int]) -> np.ndarray:
    """The maps' places [N, 3], those along z next to each other."""
    x, y, z = (along(*ends) for ends in zip(low, high, counts, strict=True))
    return np.array([(a, b, c) for a in x for b in y for c in z])


def weights(p: np.ndarray, low: np.ndarray, high: np.ndarray, counts: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Of every map for points p [M, 3], [M, N] each: held beyond the outermost maps, and going on in a line there."""
    held, straight = np.ones((len(p), 1)), np.ones((len(p), 1))
    for axis in range(3):
        at = along(low[axis], high[axis], counts[axis])
        hats = np.stack([np.interp(p[:, axis], at, one) for one in np.eye(len(at))], axis=1)
        lines = np.stack([_line(p[:, axis], at, one) for one in np.eye(len(at))], axis=1)
        held = (held[:, :, None] * hats[:, None, :]).reshape(len(p), -1)
        straight = (straight[:, :, None] * lines[:, None, :]).reshape(len(p), -1)
    return held, straight


def _line(x: np.ndarray, at: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Linear between the two places of `at` on either side of x, or the two nearest."""
    if len(at) == 1:
        return np.full(len(x), values[0])
    k = np.clip(np.searchsorted(at, x) - 1, 0, len(at) - 2)
    slope = (values[k + 1] - values[k]) / (at[k + 1] - at[k])
    return values[k] + slope * (x - at[k])


@dataclass
class Shown:
    """Per ray: the blended point [M, 3]; how far maps see along it, over the nearest of those around it [M, N]; and the points
    that they show [M, N, 3], which `used` [M, N] have a share in."""

    point: np.ndarray
    ratio: np.ndarray
    points: np.ndarray
    used: np.ndarray


def shown(
    room: Surroundings, p: np.ndarray, r: np.ndarray, at: np.ndarray, held: np.ndarray, straight: np.ndarray, *, morph: bool
) -> Shown:
    """What maps at `at` [N, 3] show of rays from p [M, 3] in unit directions r [M, 3]."""
    seen = np.stack([room.first_hit(np.broadcast_to(c, p.shape), r) for c in at], axis=1)
    around = straight != 0
    nearest, farthest = np.where(around, seen, np.inf).min(axis=1), np.where(around, seen, 0).max(axis=1)
    line = (straight * seen).sum(axis=1)
    close = around & (seen < 3.2 * nearest[:, None])
    weight = (held * close).sum(axis=1)
    mean = np.where(weight > 0, (held * close * seen).sum(axis=1) / np.where(weight > 0, weight, 1), nearest)
    t = np.where(farthest < 3.2 * nearest, np.maximum(line, 0), mean)
    points = np.empty((len(p), len(at), 3))
    for k, c in enumerate(at):
        v = p + t[:, None] * r - c if morph else r
        v = v / np.linalg.norm(v, axis=1, keepdims=True)
        points[:, k] = c + room.first_hit(np.broadcast_to(c, p.shape), v)[:, None] * v
    return Shown((held[:, :, None] * points).sum(axis=1), seen / nearest[:, None], points, held > 0)
