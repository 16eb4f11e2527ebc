"""A cube stands on a flat mirror that tilts away from the eye."""

from __future__ import annotations

from dataclasses import replace

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props import shapes
from ..props.minimal import RED, flat, misplaced, pose, stage, thing

REGIME = Regime(
    entry="P-01",
    title="Tilted flat mirror that is touched",
    severity="tilt of the mirror, degrees",
    severities=(30.0, 45.0, 60.0, 75.0),
    symptom="share of the cube's images, its own and the true one, that is not in both",
    bound=0.15,
    why="an image of 300 to 600 pixels that is right but for half a pixel along its border",
    measure=misplaced(RED),
)


def tilted(severity: float) -> Scene:
    turn, mirror = pose("x", -severity), flat((1.5, 1.5))
    cube = shapes.box((-1.1, -0.3, 0.0), (-0.5, 0.3, 0.6), RED).transformed(turn)
    return stage([thing("cube", cube, RED)], [replace(mirror, mesh=mirror.mesh.transformed(turn))])
