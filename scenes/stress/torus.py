"""A ring: two shells in every direction from its middle, and saddles inside."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Mesh, Reflector, Scene

from ..props.minimal import eye, grid, stage, thing

REGIME = Regime(
    entry="F-11, F-23, F-25",
    title="Ring",
    severity="radius of the tube, in radii of the ring",
    severities=(0.15, 0.3, 0.45, 0.6),
    symptom="FLIP in the mirror",
    bound=0.1,
    why="a checkered floor differs by this when its edges are a pixel off; second bounces are black on both sides",
    measure="flip",
)


def torus(severity: float) -> Scene:
    a, b = np.meshgrid(np.linspace(0, 2 * np.pi, 97)[:-1], np.linspace(0, 2 * np.pi, 49)[:-1], indexing="ij")
    n = np.stack([np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b)], axis=-1).reshape(-1, 3)
    ring = np.stack([np.cos(a), np.sin(a), 0 * a], axis=-1).reshape(-1, 3)
    i, j = (x.ravel() for x in np.meshgrid(np.arange(96), np.arange(48), indexing="ij"))
    first, right, up, both = (48 * (p % 96) + q % 48 for p, q in ((i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)))
    mesh = Mesh(ring + severity * n, np.concatenate([np.stack([first, right, both], 1), np.stack([first, both, up], 1)]), n)
    floor = grid((-4.0, -1.8, -4.0), (0.0, 0.0, 8.0), (8.0, 0.0, 0.0), (32, 32))
    return stage([thing("floor", floor)], [Reflector("mirror", mesh, mesh)], eye((0.0, 2.0, 5.0), fov_deg=34.0))
