"""A ball with bumps: hills and hollows show the same thing again and again."""

from __future__ import annotations

import numpy as np

from benchharness.regime import MISSING, Regime
from benchharness.scene import Mesh, Reflector, Scene

from ..props.minimal import grid, sphere, stage, thing

WAVE = 5.0  # radians per radius along each axis

REGIME = Regime(
    entry="F-25, F-26",
    title="Bumps",
    severity="height of the bumps, in radii; the ball is not convex from 0.02 on",
    severities=(0.0, 0.02, 0.05, 0.1, 0.2),
    symptom="share of the vertices' visible reflections that are not found; FLIP in the mirror where a method has no vertices",
    bound=0.1,
    why="a vertex right at a caustic has two reflections that are nearly one; as FLIP, edges of the checkered floor differ",
    measure=MISSING,
)


def bumpy(height: float) -> Mesh:
    """r(u) = 1 + height sin(kx) sin(ky) sin(kz) for unit u = (x, y, z), with its exact normals."""
    ball = sphere()
    u = ball.normals
    s, c = np.sin(WAVE * u), np.cos(WAVE * u)
    r = 1 + height * s.prod(axis=1)
    across = height * WAVE * c * np.stack([s[:, 1] * s[:, 2], s[:, 2] * s[:, 0], s[:, 0] * s[:, 1]], axis=1)
    across -= (across * u).sum(axis=1, keepdims=True) * u
    n = r[:, None] * u - across
    return Mesh(r[:, None] * u, ball.faces, n / np.linalg.norm(n, axis=1, keepdims=True))


def bumps(severity: float) -> Scene:
    mesh = bumpy(severity)
    floor = grid((-4.0, -1.3, -4.0), (0.0, 0.0, 8.0), (8.0, 0.0, 0.0), (32, 32))
    return stage([thing("floor", floor)], [Reflector("mirror", mesh, mesh)])
