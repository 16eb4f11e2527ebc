"""What lies near a mirror and what an environment map makes of the rest: float64, one point or one pixel at a time.

Points of a ball by bisection in the plane of eye, ball and thing; of a wall by straight lines through mirrored points; how far
a triangle is by non-negative least squares; what a pixel shows by trying every triangle.
"""

from __future__ import annotations

import numpy as np
from oracles.ray_oracle import reflected_hits
from scipy.optimize import nnls

from benchharness.scene import Scene


def unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v)


def _plane(eye: np.ndarray, towards: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Axes of the plane of two vectors, the first towards the eye, and the angle of the second in it."""
    a = unit(eye)
    b = unit(towards - (towards @ a) * a)
    return a, b, float(np.arctan2(towards @ b, towards @ a))


def _bisected(below, low: float, high: float) -> float:
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if below(middle) else (low, middle)
    return 0.5 * (low + high)


def on_ball(eye: np.ndarray, thing: np.ndarray, radius: float) -> np.ndarray:
    """The point of a ball around the origin that reflects a thing to the eye: both are seen under one angle to the normal."""
    a, b, end = _plane(eye, thing)

    def below(angle: float) -> bool:
        n = np.cos(angle) * a + np.sin(angle) * b
        return bool(n @ unit(eye - radius * n) > n @ unit(thing - radius * n))

    return radius * (lambda t: np.cos(t) * a + np.sin(t) * b)(_bisected(below, 0.0, end))


def on_ball_towards(eye: np.ndarray, way: np.ndarray, radius: float) -> np.ndarray:
    """The point of a ball around the origin that reflects the eye's ray along a direction."""
    a, b, end = _plane(eye, way)

    def below(angle: float) -> bool:
        n = np.cos(angle) * a + np.sin(angle) * b
        v = unit(eye - radius * n)
        r = 2 * (v @ n) * n - v
        return bool(np.arctan2(r @ b, r @ a) < end)

    return radius * (lambda t: np.cos(t) * a + np.sin(t) * b)(_bisected(below, 0.0, end))


def on_wall(eye: np.ndarray, thing: np.ndarray, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Where a flat mirror through a point reflects a thing to the eye: on the straight line to its image."""
    image = thing - 2 * ((thing - point) @ normal) * normal
    share = ((point - eye) @ normal) / ((image - eye) @ normal)
    return eye + share * (image - eye)


def on_wall_towards(eye: np.ndarray, way: np.ndarray, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Where it reflects the eye's ray along a direction."""
    before = way - 2 * (way @ normal) * normal
    return eye + ((point - eye) @ normal) / (before @ normal) * before


def apart(eye: np.ndarray, one: np.ndarray, other: np.ndarray) -> float:
    """The angle between two points as the eye sees them."""
    a, b = unit(one - eye), unit(other - eye)
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def distance(triangle: np.ndarray, point: np.ndarray) -> float:
    """How far a triangle [3, 3] is from a point: the least |sum of w_k corner_k - point| of weights that are not negative and
    whose sum is 1, which here weighs a million times as much."""
    heavy = 1e6 * np.abs(triangle - point).max()
    rows = np.vstack([(triangle - point).T, np.full(3, heavy)])
    weights, _ = nnls(rows, np.array([0.0, 0.0, 0.0, heavy]))
    return float(np.linalg.norm(weights / weights.sum() @ (triangle - point)))


def composed(made: Scene, p: np.ndarray, r: np.ndarray, centre: np.ndarray, reach: float, overlap: float):
    """What pixels show whose rays start at p along r, [N, 3] each, in mirror number 0: radiance [N, 3], whether it is moved,
    and whether rounding leaves it what it is, [N] each."""
    _, t, near, clear = reflected_hits(made, 0.0, p, r, 0)
    away = np.linalg.norm(p + np.where(np.isfinite(t), t, 0)[:, None] * r - centre, axis=1)
    moved = np.isfinite(t) & (away < reach)
    far, distance_, sure = _beyond(made, centre, r, overlap * reach)
    # Where its ray leaves the ball, by the roots of |p + s r - c|² = reach².
    x = p - centre
    half, rest = (x * r).sum(axis=1), (x**2).sum(axis=1) - reach**2
    s = -half + np.sqrt(half**2 - rest)
    to_border = x + s[:, None] * r
    to_border /= np.linalg.norm(to_border, axis=1, keepdims=True)
    other, other_distance, other_sure = _beyond(made, centre, to_border, overlap * reach)
    again = (distance_ < reach) & (other_distance >= reach)
    shown = np.where(moved[:, None], near, np.where(again[:, None], other, far))
    at_border = np.abs(away - reach) < 0.01 * reach
    unsure = np.where(moved, ~clear, ~sure | ((distance_ < reach) & ~other_sure)) | at_border
    return shown, moved, ~unsure


def _beyond(made: Scene, centre: np.ndarray, d: np.ndarray, start: float):
    """What lies along directions from a centre, beyond a distance: radiance, distance, whether that is clear."""
    _, t, radiance, clear = reflected_hits(made, 0.0, centre + start * d, d, 0)
    return radiance, t + start, clear
