"""Where rays leave spheres and boxes, where a map shows that, and weights of maps: float64, one ray at a time.

A sphere by the roots of its quadratic polynomial, a box by its six sides, each asked for the point where the ray meets it.
"""

from __future__ import annotations

import numpy as np


def leaves_sphere(x: np.ndarray, r: np.ndarray, radius: float) -> float:
    """How far from x along r the sphere |y| = radius is left; inf where it is not met ahead."""
    roots = np.roots([r @ r, 2 * x @ r, x @ x - radius**2])
    ahead = [root.real for root in roots if abs(root.imag) < 1e-12 and root.real > 0]
    return max(ahead, default=np.inf)


def leaves_box(p: np.ndarray, r: np.ndarray, axes: np.ndarray, centre: np.ndarray, half: np.ndarray) -> float:
    """The same of a box with the unit rows `axes`: the last of its sides that the ray meets within the side's own edges."""
    met = []
    for k in range(3):
        for sign in (-1.0, 1.0):
            normal = sign * axes[k]
            speed = normal @ r
            if speed == 0:
                continue
            t = half[k] * (1 / speed) - normal @ (p - centre) / speed
            at = axes @ (p + t * r - centre)
            others = [j for j in range(3) if j != k]
            if t > 0 and all(abs(at[j]) <= half[j] * (1 + 1e-9) for j in others):
                met.append(t)
    return max(met, default=np.inf)


def shares(p: np.ndarray, middles: np.ndarray, extent: np.ndarray, blend: np.ndarray) -> tuple[np.ndarray, float]:
    """The share of every map with its middle at `middles` [N, 3], and what is left for the environment.

    Along an axis a weight is 1 up to the distance extent - d, 0 from the extent on, and linear between.
    """
    weights = []
    for middle in middles:
        along = []
        for k in range(3):
            d = min(blend[k], extent[k])
            along.append(np.interp(abs(p[k] - middle[k]), [extent[k] - d, extent[k]], [1.0, 0.0]))
        weights.append(np.prod(along) ** 2)
    weights = np.array(weights)
    if weights.sum() > 1:
        weights = weights / weights.sum()
    return weights, 1 - weights.sum()


def turned(axis: np.ndarray, degrees: float) -> np.ndarray:
    """Rows of a frame that is turned about an axis (Rodrigues)."""
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    angle = np.radians(degrees)
    return (np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K).T
