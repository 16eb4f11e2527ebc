"""Contact: a ball comes nearer and nearer to a mirror, until it touches it."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props.minimal import RED, misplaced, sphere, stage, thing

RADIUS = 0.3


REGIME = Regime(
    entry="I-01, I-02, F-29",
    title="Contact",
    severity="gap between ball and mirror, in radii of the mirror",
    severities=(2.0, 1.0, 0.3, 0.1, 0.0),
    symptom="share of the ball's images, its own and the true one, that is not in both",
    bound=0.2,
    why="an image of 300 pixels that is right but for half a pixel along its border",
    measure=misplaced(RED),
)


def contact(severity: float) -> Scene:
    angle = np.radians(50.0)
    direction = np.array([np.sin(angle), 0.0, np.cos(angle)])
    return stage([thing("ball", sphere(RADIUS, (1 + severity + RADIUS) * direction), RED)])
