"""One curved sheet without a back that turns away from the eye."""

from __future__ import annotations

from benchharness.regime import Regime
from benchharness.scene import Reflector, Scene

from ..props.minimal import cap, checkered_floor, pose, sphere, stage

REGIME = Regime(
    entry="F-27",
    title="Sheet without a back",
    severity="turn of the sheet away from the eye, degrees; from 60 on its back is seen too",
    severities=(0.0, 40.0, 75.0, 100.0),
    symptom="FLIP in the mirror",
    bound=0.1,
    why="a checkered floor differs by this when its edges are a pixel off",
    measure="flip",
)


def sheet(severity: float) -> Scene:
    turn = pose("y", severity)
    return stage([checkered_floor()], [Reflector("mirror", cap(sphere(), 0.5), motion=lambda time: turn)])
