"""A tuft of upright leaves, which become narrower."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Scene, merged, subdivided

from ..props import shapes
from ..props.minimal import GREEN, eye, misplaced, placed, stage, thing, towards, turned

REGIME = Regime(
    entry="I-06",
    title="Foliage",
    severity="width of the leaves, in radii of the mirror",
    severities=(0.3, 0.15, 0.1, 0.06),
    symptom="share of the leaves' images, its own and the true one, that is not in both",
    bound=0.35,
    why="leaves of 1 to 6 pixels, right but for half a pixel along their sides",
    measure=misplaced(GREEN),
)


def foliage(severity: float) -> Scene:
    rng = np.random.default_rng(3)
    leaf = subdivided(shapes.box((-0.5 * severity, -0.5, -0.01), (0.5 * severity, 0.5, 0.01), GREEN), 0.15)
    leaves = []
    for angle in np.linspace(0, 360, 15)[:-1]:
        foot = rng.uniform(0.2, 0.5) * towards(angle)
        leaves.append(placed(turned(turned(leaf, "x", 20.0), "y", angle), 1.9 * towards(45.0) + foot))
    look = eye(target=0.95 * towards(24.0), fov_deg=16.0)
    return stage([thing("leaves", merged(*leaves), GREEN)], camera=look)
