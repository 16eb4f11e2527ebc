"""A mirror of two lobes, one before the other: what the rear one shows is hidden by the front one as the waist deepens."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Mesh, Reflector, Scene

from ..props.minimal import RED, eye, misplaced, sphere, stage, thing

REGIME = Regime(
    entry="F-26",
    title="A mirror before itself",
    severity="height of the lobes, in mean radii; from a fifth on the waist is hollow",
    severities=(0.0, 0.2, 0.35, 0.45, 0.6),
    symptom="share of the ball's images, its own and the true one, that is not in both",
    bound=0.2,
    why="a sickle 7 pixels wide: half a pixel along both sides",
    measure=misplaced(RED),
)


def lobes(severity: float) -> Scene:
    ball = sphere(fine=64)
    u, x = ball.normals, ball.normals[:, :1]
    r = 1 + severity * (2 * x * x - 1)
    slope = 4 * severity * x * (np.array([1.0, 0.0, 0.0]) - x * u)
    n = u - slope / r
    mesh = Mesh(r * u, ball.faces, n / np.linalg.norm(n, axis=1, keepdims=True))
    look = eye((5.0, 0.6, 0.4), (0.5, 0.85, 0.0), 13.0)
    return stage([thing("ball", sphere(0.9, (-1.9, 2.2, 0.0), 32), RED)], [Reflector("mirror", mesh, mesh)], look)
