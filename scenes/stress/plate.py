"""A square plate that fills its picture turns by 45 degrees."""

from __future__ import annotations

from benchharness.regime import Regime
from benchharness.scene import Scene, subdivided

from ..props import shapes
from ..props.minimal import RED, misplaced, placed, stage, thing, towards, turned

REGIME = Regime(
    entry="I-18",
    title="Corners of a turned plate",
    severity="turn of the plate, degrees",
    severities=(0.0, 15.0, 30.0, 45.0),
    symptom="share of the plate's images, its own and the true one, that is not in both",
    bound=0.15,
    why="an image of 500 pixels that is right but for half a pixel along its border",
    measure=misplaced(RED),
)


def plate(severity: float) -> Scene:
    square = subdivided(shapes.box((-0.6, -0.6, -0.05), (0.6, 0.6, 0.05), RED), 0.1)
    upright = turned(turned(square, "z", severity), "y", 40.0)
    return stage([thing("plate", placed(upright, 1.9 * towards(40.0)), RED)])
