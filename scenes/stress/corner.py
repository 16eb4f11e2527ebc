"""A far ball that moves to the corner of a cube map."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props.minimal import RED, misplaced, sphere, stage, thing

REGIME = Regime(
    entry="I-26",
    title="Corner of the cube",
    severity="angle between the ball and (1, 1, 1), degrees",
    severities=(40.0, 15.0, 5.0, 1.0, 0.0),
    symptom="share of the ball's images, its own and the true one, that is not in both",
    bound=0.25,
    why="an image of 150 pixels, right but for half a pixel along its border, and for a degree of parallax",
    measure=misplaced(RED),
)


FAR = 60.0


def corner(severity: float) -> Scene:
    diagonal, aside = np.array([1.0, 1.0, 1.0]) / np.sqrt(3), np.array([-1.0, 2.0, -1.0]) / np.sqrt(6)
    angle = np.radians(severity)
    return stage([thing("ball", sphere(0.25 * FAR, FAR * (np.cos(angle) * diagonal + np.sin(angle) * aside)), RED)])
