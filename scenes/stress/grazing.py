"""Grazing incidence: small balls whose images move to the mirror's outline."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props.minimal import RED, misplaced, sphere, stage, thing

REGIME = Regime(
    entry="F-01",
    title="Grazing incidence",
    severity="angle of the ball from the eye's axis, degrees",
    severities=(60, 100, 120, 130, 136),
    symptom="share of the ball's images, its own and the true one, that is not in both",
    bound=0.35,
    why="the image is a sliver at the outline, 2 to 6 pixels wide",
    measure=misplaced(RED),
)


def grazing(severity: float) -> Scene:
    angle = np.radians(severity)
    return stage([thing("ball", sphere(0.35, 2.2 * np.array([np.sin(angle), 0.0, np.cos(angle)])), RED)])
