"""A ball whose far side, seen from the mirror's middle, has another colour: an eye at a slant sees it in the mirror."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime, Seen
from benchharness.scene import Scene

from ..props.minimal import GREEN, RED, eye, flat, sphere, stage, thing, towards


def differing(seen: Seen) -> float | None:
    """Among the pixels that show the ball in either picture, the share that does not show the same side of it in both."""
    (own_red, red), (own_green, green) = seen.like(RED), seen.like(GREEN)
    same, all_of_it = (own_red & red) | (own_green & green), own_red | red | own_green | green
    return None if not all_of_it.any() else 1.0 - float(same.sum() / all_of_it.sum())


REGIME = Regime(
    entry="I-05, I-15, I-19",
    title="The other side",
    severity="angle of the eye from the line through the mirror's middle and the ball, degrees",
    severities=(20.0, 40.0, 60.0, 75.0),
    symptom="share of the ball's images, its own and the true one, that is not the same side of it in both",
    bound=0.2,
    why="an image of 800 pixels, right but for half a pixel along its borders, and for a sickle that is 2 pixels wide at first",
    measure=differing,
)


def other_side(severity: float) -> Scene:
    ball = sphere(0.3, (0.0, 0.0, 1.0), 48)
    side = np.where((ball.vertices[:, 2] > 1.0 + 1e-6)[:, None], RED, GREEN)
    look = eye(5.0 * towards(severity) + (0.0, 1.0, 0.0), (0.0, 0.0, -0.5), 16.0)
    return stage([thing("ball", ball, side)], [flat((5.0, 1.5))], look)
