"""A ball that is far away, and as large as it has to be to be seen."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props.minimal import RED, misplaced, sphere, stage, thing

REGIME = Regime(
    entry="F-34, I-27",
    title="Far vertices",
    severity="distance of the ball, in radii of the mirror",
    severities=(3.0, 30.0, 300.0, 30000.0, 1000000.0),
    symptom="share of the ball's images, its own and the true one, that is not in both",
    bound=0.2,
    why="an image of 300 pixels that is right but for half a pixel along its border",
    measure=misplaced(RED),
)


def far_away(severity: float) -> Scene:
    angle = np.radians(50.0)
    return stage([thing("ball", sphere(0.3 * severity, severity * np.array([np.sin(angle), 0.0, np.cos(angle)])), RED)])
