"""A mirror of two lobes with a waist, one before the other."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Mesh, Reflector, Scene
from scenes.stress.minimal import checkered_floor, eye, sphere, stage

REGIME = Regime(
    entry="F-26",
    title="A mirror before itself",
    severity="height of the lobes, in mean radii; from a third on the waist is hollow",
    severities=(0.0, 0.1, 0.2, 0.3, 0.45),
    symptom="FLIP in the mirror",
    bound=0.1,
    why="a checkered floor differs by this when its edges are a pixel off; second bounces are black on both sides",
    measure="flip",
)


def lobes(severity: float) -> Scene:
    ball = sphere(fine=64)
    u, x = ball.normals, ball.normals[:, :1]
    r = 1 + severity * (2 * x * x - 1)
    slope = 4 * severity * x * (np.array([1.0, 0.0, 0.0]) - x * u)
    n = u - slope / r
    mesh = Mesh(r * u, ball.faces, n / np.linalg.norm(n, axis=1, keepdims=True))
    return stage([checkered_floor(-1.4)], [Reflector("mirror", mesh, mesh)], eye((4.0, 1.2, 1.8), fov_deg=36.0))
