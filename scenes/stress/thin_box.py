"""A thin box before a flat mirror, which sees its other side."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props import shapes
from ..props.minimal import GREEN, RED, eye, flat, misplaced, stage, thing

REGIME = Regime(
    entry="P-03",
    title="Back faces in a flat mirror",
    severity="thickness of the box, in widths of it",
    severities=(0.5, 0.1, 0.02, 0.004),
    symptom="share of the images of the red side, which is turned to the mirror, its own and the true one, that is not in both",
    bound=0.15,
    why="an image of 500 pixels that is right but for half a pixel along its border",
    measure=misplaced(RED),
)


def thin_box(severity: float) -> Scene:
    box = shapes.box((-0.4, -0.4, 0.8), (0.4, 0.4, 0.8 + 0.8 * severity), RED)
    to_mirror = box.normals[:, 2] < -0.5
    return stage([thing("box", box, np.where(to_mirror[:, None], RED, GREEN))], [flat((1.6, 1.2))], eye((1.8, 1.2, 3.2)))
