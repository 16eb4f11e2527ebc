"""An eye that comes near the mirror."""

from __future__ import annotations

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props.minimal import eye, grid, stage, thing

REGIME = Regime(
    entry="F-31",
    title="Eye near the mirror",
    severity="distance of the eye from the mirror, in its radii",
    severities=(3.0, 1.0, 0.4, 0.15, 0.05),
    symptom="FLIP in the mirror",
    bound=0.1,
    why="a checkered floor differs by this when its edges are a pixel off",
    measure="flip",
)


def near_eye(severity: float) -> Scene:
    floor = grid((-4.0, -1.2, -4.0), (0.0, 0.0, 8.0), (8.0, 0.0, 0.0), (64, 64))
    return stage([thing("floor", floor)], camera=eye((0.0, 0.0, 1.0 + severity), fov_deg=50.0), near=1e-3)
