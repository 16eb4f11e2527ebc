"""A cut: the eye stands elsewhere from one frame to the next, and what is carried over is of no use."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Camera, Scene

from ..props.minimal import grid, stage, thing

REGIME = Regime(
    entry="F-19",
    title="Camera cut",
    severity="turn of the eye around the mirror from one frame to the next, degrees",
    severities=(0.0, 5.0, 20.0, 90.0, 180.0),
    symptom="FLIP in the mirror, just after the cut",
    bound=0.08,
    why="a checkered floor differs by this when its edges are a pixel off",
    measure="flip",
    frame=2,
)


def cut(severity: float) -> Scene:
    def camera(time: float) -> Camera:
        angle = np.radians(10.0 + (severity if time > 1.5 else 0.0))
        return Camera((4.0 * np.sin(angle), 0.5, 4.0 * np.cos(angle)), (0.0, 0.0, 0.0), 32.0, (0.0, 1.0, 0.0))

    floor = grid((-4.0, -1.2, -4.0), (0.0, 0.0, 8.0), (8.0, 0.0, 0.0), (32, 32))
    return stage([thing("floor", floor)], camera=camera, frames=3, fps=1.0)
