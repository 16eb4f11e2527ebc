"""A ribbon whose middle line comes to lie in one plane with the eye and the mirror's axis."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props import shapes
from ..props.minimal import YELLOW, misplaced, stage, thing

REGIME = Regime(
    entry="F-02",
    title="Eye, vertex and axis in one plane",
    severity="distance of the ribbon's middle line from the plane, in radii of the mirror",
    severities=(0.5, 0.1, 0.01, 0.0001, 0.0),
    symptom="share of the ribbon's images, its own and the true one, that is not in both",
    bound=0.25,
    why="the ribbon's image is 4 to 8 pixels wide: half a pixel along both sides",
    measure=misplaced(YELLOW),
)


def in_plane(severity: float) -> Scene:
    ribbon = shapes.sheet(
        (severity - 0.2, 1.3, 0.6), (0.4, 0, 0), (0, 0, 2.4), np.linspace(0, 1, 3), np.linspace(0, 1, 25), YELLOW
    )
    return stage([thing("ribbon", ribbon, YELLOW)])
