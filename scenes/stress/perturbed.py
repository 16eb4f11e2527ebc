"""Perturbation: vertices are moved by ever larger parts of a float's rounding, and by a little more."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props.minimal import grid, s1, sphere, stage, thing

REGIME = Regime(
    entry="F-15",
    title="Perturbed vertices",
    severity="noise of the vertices, mirror included, in radii of the mirror",
    severities=(0.0, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3),
    symptom="FLIP in the mirror",
    bound=0.08,
    why="a checkered floor differs by this when its edges are a pixel off; the reference is of the same vertices",
    measure="flip",
)


def perturbed(severity: float) -> Scene:
    rng = np.random.default_rng(0)

    def noisy(mesh):
        return replace(mesh, vertices=mesh.vertices + severity * rng.standard_normal(mesh.vertices.shape))

    floor, ball, mirror = (
        grid((-4.0, -1.2, -4.0), (0.0, 0.0, 8.0), (8.0, 0.0, 0.0), (32, 32)),
        sphere(0.4, (1.6, 0.0, 0.8)),
        s1(),
    )
    mesh = noisy(mirror.mesh)
    return stage([thing("floor", noisy(floor)), thing("ball", noisy(ball))], [replace(mirror, mesh=mesh, closed=mesh)])
