"""A ball whose far side has another colour, which a large mirror sees from its ends."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Reflector, Scene
from scenes import shapes
from scenes.stress.minimal import GREEN, RED, eye, misplaced, sphere, stage, thing

REGIME = Regime(
    entry="I-05, I-15, I-19",
    title="The other side",
    severity="width of the mirror, in distances of the ball from it",
    severities=(0.5, 1.0, 2.0, 4.0),
    symptom="share of the red side's images, its own and the true one, that is not in both",
    bound=0.3,
    why="the red side is a sickle of 30 to 100 pixels",
    measure=misplaced(RED),
)


def other_side(severity: float) -> Scene:
    ball = sphere(0.3, (0.0, 0.0, 1.0), 32)
    side = np.where((np.abs(ball.vertices[:, 0]) > 0.12)[:, None], RED, GREEN)
    half = 0.5 * severity
    mirror = shapes.sheet((-half, -0.6, 0.0), (2 * half, 0.0, 0.0), (0.0, 1.2, 0.0), [0.0, 1.0], [0.0, 1.0], GREEN)
    return stage([thing("ball", ball, side)], [Reflector("mirror", mirror)], eye((0.0, 1.2, 3.5), (0.0, 0.0, 0.0), 50.0))
