"""Flicker: the eye goes around the mirror in even steps; what changes from frame to frame and should not?"""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Camera, Scene

from ..props.minimal import grid, stage, thing

REGIME = Regime(
    entry="F-17",
    title="Flicker",
    severity="turn of the eye around the mirror, degrees per frame",
    severities=(0.1, 0.4, 1.6, 6.4),
    symptom="mean difference between the picture's change and the reference's, radiance",
    bound=0.03,
    why="of a floor with a contrast of 0.3, one pixel in ten may change when it should not; filters make 0.02 of it",
    measure="temporal_diff",
    frame=2,
)


def flicker(severity: float) -> Scene:
    def camera(time: float) -> Camera:
        angle = np.radians(10.0 + severity * time)
        return Camera((4.0 * np.sin(angle), 0.5, 4.0 * np.cos(angle)), (0.0, 0.0, 0.0), 32.0, (0.0, 1.0, 0.0))

    floor = grid((-4.0, -1.2, -4.0), (0.0, 0.0, 8.0), (8.0, 0.0, 0.0), (32, 32))
    return stage([thing("floor", floor)], camera=camera, frames=3, fps=1.0)
