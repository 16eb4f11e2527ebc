"""A small mirror, with a ball beside it, goes from the middle of an eighth of a room, where a map is, to the room's middle,
from where eight maps are equally far."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props.minimal import RED, eye, misplaced, room, s1, sphere, stage, thing

REGIME = Regime(
    entry="I-23",
    title="Midway between maps",
    severity="distance of the mirror from the middle of a room's eighth, in that of the room's middle",
    severities=(0.0, 0.05, 0.2, 0.5, 1.0),
    symptom="share of the ball's images, its own and the true one, that is not in both",
    bound=0.25,
    why="an image of 200 pixels that is right but for half a pixel along its border, and for the mirror's own radius",
    measure=misplaced(RED),
)

HALF = 4.0


def between_maps(severity: float) -> Scene:
    at = 0.5 * HALF * (1 - severity) * np.ones(3)
    ball = sphere(0.7, np.add(at, [-2.2, 0.6, -0.6]), 24)
    look = eye(np.add(at, [-0.5, 0.0, -1.1]), at, 17.0)
    return stage([thing("walls", room((-HALF,) * 3, (HALF,) * 3)), thing("ball", ball, RED)], [s1(0.15, at)], look)
