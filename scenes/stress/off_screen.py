"""A card over a mirror on the ground rises out of the picture, which shows its image alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props import shapes
from ..props.minimal import RED, eye, flat, misplaced, pose, room, stage, thing

REGIME = Regime(
    entry="I-24",
    title="Out of the picture",
    severity="height of the card's middle, metres; it is seen up to 1.2",
    severities=(0.45, 0.8, 1.2, 1.6),
    symptom="share of the card's images, its own and the true one, that is not in both",
    bound=0.2,
    why="an image of 115 pixels that is right but for half a pixel along its border",
    measure=misplaced(RED),
)


def off_screen(severity: float) -> Scene:
    mirror, fine = flat((2.5, 3.4)), np.linspace(0, 1, 9)
    lying = replace(mirror, mesh=mirror.mesh.transformed(pose("x", -90.0, (0.0, 0.0, 3.0))))
    card = shapes.sheet((-0.4, severity - 0.35, -0.5), (0.8, 0, 0), (0, 0.7, 0), fine, fine, RED)
    walls = room((-4.0, -0.05, -4.0), (4.0, 4.0, 7.0))
    return stage([thing("walls", walls), thing("card", card)], [lying], eye((0.0, 1.2, 3.5), (0.0, 0.0, 1.42), 50.0))
