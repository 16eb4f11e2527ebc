"""One object of two balls that come near each other."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Scene, merged

from ..props.minimal import RED, eye, misplaced, sphere, stage, thing, towards

REGIME = Regime(
    entry="I-13",
    title="Gap between two balls",
    severity="gap between the balls, in radii of the mirror",
    severities=(1.0, 0.5, 0.2, 0.1, 0.05),
    symptom="share of the balls' images, its own and the true one, that is not in both",
    bound=0.2,
    why="two images of 150 pixels, right but for half a pixel along their borders",
    measure=misplaced(RED),
)


def gap(severity: float) -> Scene:
    across = np.array([0.0, 0.3 + 0.5 * severity, 0.0])
    balls = [sphere(0.3, 1.8 * towards(45.0) + side * across, 32) for side in (-1, 1)]
    return stage([thing("balls", merged(*balls), RED)], camera=eye(target=0.95 * towards(24.0), fov_deg=14.0))
