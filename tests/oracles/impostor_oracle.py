"""Distance impostors in closed form, float64: rays in a box, of which only what its middle sees is known.

Everything is told from the middle, where the map is. `Room.seen` is the map, without texels: how far it sees in a direction.
`Room.first_hit` is the truth. The searches are written as in the papers, in distances along the ray.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Seen = Callable[[np.ndarray], np.ndarray]


@dataclass
class Room:
    """A box from `low` to `high` around the origin, and a ball of `radius` at `ball` in it; 0 for none."""

    low: np.ndarray
    high: np.ndarray
    ball: np.ndarray
    radius: float = 0.0

    def first_hit(self, x: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Distances along rays from x [N, 3] in unit directions r [N, 3]."""
        with np.errstate(divide="ignore"):
            t = ((np.where(r > 0, self.high, self.low) - x) / r).min(axis=1)
        o = x - self.ball
        b, c = (o * r).sum(axis=1), (o * o).sum(axis=1) - self.radius**2
        met = (b * b > c) & (b < 0) & (self.radius > 0)
        return np.where(met, -b - np.sqrt(np.where(met, b * b - c, 0)), t)

    def surfaces(self, v: np.ndarray) -> np.ndarray:
        """Distances from the middle of all that lies in directions v [N, 3], one behind the other, [N, 3]; inf for none."""
        unit = v / np.linalg.norm(v, axis=1, keepdims=True)
        with np.errstate(divide="ignore"):
            wall = np.where(unit == 0, np.inf, np.where(unit > 0, self.high, self.low) / unit).min(axis=1)
        nearest = unit @ self.ball
        beside = self.ball - nearest[:, None] * unit
        chord = np.sqrt(np.maximum(self.radius**2 - (beside**2).sum(axis=1), 0))
        met = (chord > 0) & (nearest > 0)
        ends = np.where(met[:, None], np.stack([nearest - chord, nearest + chord], axis=1), np.inf)
        return np.sort(np.column_stack([ends, wall]), axis=1)

    def seen(self, v: np.ndarray) -> np.ndarray:
        """Distances from the middle in directions v [N, 3] of any length."""
        unit = v / np.linalg.norm(v, axis=1, keepdims=True)
        return self.first_hit(np.zeros_like(unit), unit)


def length(v: np.ndarray) -> np.ndarray:
    return np.linalg.norm(v, axis=1)


def iterated(seen: Seen, x: np.ndarray, r: np.ndarray, iterations: int) -> np.ndarray:
    """Szirmay-Kalos et al. 2005: a guess from a plane, then false position. Distances along the rays [N]."""
    far, start = seen(r), length(x) / seen(x)
    d = far * (1 - start)
    under_d, under_q = np.zeros(len(x)), start
    over_d, over_q = np.full(len(x), np.nan), np.full(len(x), np.nan)
    for _ in range(iterations):
        point = x + d[:, None] * r
        q = length(point) / seen(point)
        short, past = q < 1, q > 1
        under_d, under_q = np.where(short, d, under_d), np.where(short, q, under_q)
        over_d, over_q = np.where(past, d, over_d), np.where(past, q, over_q)
        with np.errstate(invalid="ignore", divide="ignore"):
            slope = (over_q - under_q) / (over_d - under_d)
        d = np.where(np.isnan(over_d), under_d + far * (1 - under_q), under_d + (1 - under_q) / slope)
    return d


def marched(seen: Seen, x: np.ndarray, r: np.ndarray, steps: int, iterations: int) -> np.ndarray:
    """Umenhoffer et al. 2007: d = |x| t / (1 - t) until the ray has passed behind what is seen, then secants."""
    return np.array([_marched(seen, one, way, steps, iterations) for one, way in zip(x, r, strict=True)])


def _marched(seen: Seen, x: np.ndarray, r: np.ndarray, steps: int, iterations: int) -> float:
    def ratio(d: float) -> float:
        point = (x + d * r)[None]
        return float((length(point) / seen(point))[0])

    a, far = np.linalg.norm(x), float(seen(r[None])[0])
    d, q = 0.0, ratio(0.0)
    for t in np.arange(1, steps) / steps:
        low, d = (d, q), a * t / (1 - t)
        q = ratio(d)
        if low[1] < 1 <= q:
            high = d, q
            for _ in range(iterations + 1):
                d = low[0] + (high[0] - low[0]) * (1 - low[1]) / (high[1] - low[1])
                q = ratio(d)
                low, high = ((d, q), high) if q < 1 else (low, (d, q))
            return d
    # The last step ends at infinity, where the ratio grows by 1 in every `far`.
    for _ in range(iterations + 1):
        if q < 1:
            d += far * (1 - q)
            q = ratio(d)
    return d


def rays(rng: np.random.Generator, count: int, radius: float, room: Room) -> tuple[np.ndarray, np.ndarray]:
    """What a mirror ball of `radius` around the origin reflects of eyes anywhere in the room: starts and unit directions."""
    n = rng.normal(size=(6 * count, 3))
    n /= length(n)[:, None]
    eye = rng.uniform(room.low, room.high, n.shape)
    x = radius * n
    w = eye - x
    w /= length(w)[:, None]
    cosine = (w * n).sum(axis=1)
    kept = np.flatnonzero((cosine > 0) & (length(eye) > radius))[:count]
    return x[kept], (2 * cosine[:, None] * n - w)[kept]


def off_deg(x: np.ndarray, r: np.ndarray, d: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Angles between where two distances along rays are seen from the middle."""
    one, two = x + d[:, None] * r, x + true[:, None] * r
    cosine = (one * two).sum(axis=1) / (length(one) * length(two))
    sine = length(np.cross(one, two)) / (length(one) * length(two))
    return np.degrees(np.arctan2(sine, cosine))
