"""Brushes for panoramas: edges as wide as what a sample stands for, so that nothing is jagged or flickers.

Each takes coordinates on a surface, float64 [N], and the `width` [N] of a sample's footprint there, in the same unit. What
is inside a shape is a share from 0 to 1, and `laid` mixes colours [N, 3] or [3] by it.
"""

from __future__ import annotations

import numpy as np

Array = np.ndarray


def laid(under: Array, over, share: Array) -> Array:
    """`over` on top of `under` [N, 3] where `share` [N] says so."""
    return under + share[:, None] * (np.asarray(over, np.float64) - under)


def within(distance: Array, width: Array) -> Array:
    """Share of a footprint that is inside an edge; `distance` to it is negative inside."""
    return np.clip(0.5 - distance / width, 0.0, 1.0)


def between(x: Array, lo, hi, width: Array) -> Array:
    """Share of the footprint around `x` that is between `lo` and `hi`: exact."""
    half = 0.5 * width
    return np.clip(np.minimum(x + half, hi) - np.maximum(x - half, lo), 0.0, None) / width


def rectangle(u: Array, v: Array, lo, hi, wu: Array, wv: Array) -> Array:
    """Share inside the rectangle from `lo` to `hi` (u, v)."""
    return between(u, lo[0], hi[0], wu) * between(v, lo[1], hi[1], wv)


def arch(u: Array, v: Array, half: float, foot: float, spring: float, wu: Array, wv: Array) -> Array:
    """Share inside a round-headed opening about u = 0, from `foot` up to a half circle of radius `half` above `spring`."""
    straight = rectangle(u, v, (-half, foot), (half, spring), wu, wv)
    away = np.hypot(u, np.maximum(v - spring, 0.0))
    return straight + within(away - half, np.maximum(wu, wv)) * between(v, spring, np.inf, wv)


def repeated(u: Array, period: float) -> Array:
    """From the middle of the nearest repetition, -period / 2 to period / 2; the middles are at whole multiples."""
    return u - period * np.round(u / period)


def checker(x: Array, y: Array, square: float, wx: Array, wy: Array) -> Array:
    """Mean of a checker over a footprint wx by wy, -1 to 1: +1 is the square from (0, 0) to (square, square). Where squares
    are smaller than footprints it tends to 0."""

    def stripes(x: Array, width: Array) -> Array:
        def mean_to(x: Array) -> Array:  # integral of +1 (first half of the period), -1 (second half)
            phase = np.mod(x / square, 2.0)
            return square * np.minimum(phase, 2.0 - phase)

        width = np.maximum(width, 1e-9)
        return (mean_to(x + 0.5 * width) - mean_to(x - 0.5 * width)) / width

    return stripes(x, wx) * stripes(y, wy)


def ripples(points: Array, waves: int, coarsest: float, finest: float, seed: int) -> Array:
    """Smooth random numbers of about unit variance at `points` [N, D]: sines with wavelengths between the two, the
    longer the stronger."""
    rng = np.random.default_rng(seed)
    length = np.geomspace(coarsest, finest, waves)
    way = rng.normal(size=(waves, points.shape[1]))
    way *= (2 * np.pi / length / np.linalg.norm(way, axis=1))[:, None]
    strength = length**0.8
    strength *= np.sqrt(2.0 / (strength**2).sum())
    total = np.zeros(len(points))
    for k, phase, amplitude in zip(way, rng.uniform(0, 2 * np.pi, waves), strength, strict=True):
        total += amplitude * np.sin(points @ k + phase)
    return total


def smooth(x: Array, lo: float, hi: float) -> Array:
    """0 below `lo`, 1 above `hi`, cubic between."""
    t = np.clip((x - lo) / (hi - lo), 0.0, 1.0)
    return t * t * (3 - 2 * t)
