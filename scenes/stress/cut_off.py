"""A mirror that leaves the picture: what it shows comes from outside of what is seen."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props.minimal import eye, grid, stage, thing

REGIME = Regime(
    entry="F-10",
    title="Mirror at the picture's border",
    severity="share of the mirror that is out of the picture",
    severities=(0.0, 0.2, 0.4, 0.6, 0.8),
    symptom="FLIP in the mirror",
    bound=0.08,
    why="a checkered floor differs by this when its edges are a pixel off",
    measure="flip",
)


def cut_off(severity: float) -> Scene:
    floor = grid((-4.0, -1.2, -4.0), (0.0, 0.0, 8.0), (8.0, 0.0, 0.0), (32, 32))
    width = 4.0 * np.tan(np.radians(16.0)) * 4.0 / 3.0
    aside = severity and width - 1.0 + 2.0 * severity
    return stage([thing("floor", floor)], camera=eye((aside, 0.0, 4.0), (aside, 0.0, 0.0)))
