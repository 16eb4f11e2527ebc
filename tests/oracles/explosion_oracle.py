"""Where a mirror sends the eye's rays on a sphere about it, float64, arrays [N, 3]."""

from __future__ import annotations

import numpy as np


def unit(x):
    return x / np.linalg.norm(x, axis=-1, keepdims=True)


def mirrored(P, n, eye):
    """Unit direction of the eye's ray through P, reflected at a mirror with unit normal n."""
    d = unit(P - eye)
    return d - 2 * (d * n).sum(axis=1, keepdims=True) * n


def arrival(P, n, eye, centre, radius):
    """Where on the sphere it arrives: the farther root of |P + t r - centre| = radius."""
    r = mirrored(P, n, eye)
    found = np.empty_like(P)
    for k in range(len(P)):
        x = P[k] - centre
        t = np.roots([1.0, 2 * x @ r[k], x @ x - radius**2]).real.max()
        found[k] = P[k] + t * r[k]
    return found


def away(D, to_eye, size):
    """Texels of the map from its middle to where a direction is: size / 2 times the sine of half the angle to the eye's."""
    return 0.5 * size * np.sin(0.5 * np.arccos(np.clip(D @ to_eye, -1, 1)))
