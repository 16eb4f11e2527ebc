"""A screen before a card that stands on a mirror on the ground: it hides the card from the eye, and not from the mirror."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props import shapes
from ..props.minimal import GREEN, RED, eye, flat, misplaced, pose, room, stage, thing

REGIME = Regime(
    entry="I-24",
    title="Hidden in the picture",
    severity="width of the screen, in that which hides the card",
    severities=(0.05, 0.4, 0.8, 1.2),
    symptom="share of the card's images, its own and the true one, that is not in both",
    bound=0.2,
    why="an image of 115 pixels that is right but for half a pixel along its border",
    measure=misplaced(RED),
)


def screened(severity: float) -> Scene:
    mirror, fine = flat((2.5, 3.4)), np.linspace(0, 1, 9)
    lying = replace(mirror, mesh=mirror.mesh.transformed(pose("x", -90.0, (0.0, 0.0, 3.0))))
    card = shapes.sheet((-0.4, 0.1, -0.5), (0.8, 0, 0), (0, 0.7, 0), fine, fine, RED)
    wide = 0.52 * severity
    screen = shapes.sheet((-0.5 * wide, 0.45, 1.0), (wide, 0, 0), (0, 0.65, 0), fine, fine, GREEN)
    look = eye((0.0, 1.2, 3.5), (0.0, 0.0, 1.42), 50.0)
    walls = room((-4.0, -0.05, -4.0), (4.0, 4.0, 7.0))
    return stage([thing("walls", walls), thing("card", card), thing("screen", screen)], [lying], look)
