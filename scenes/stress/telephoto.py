"""A telephoto lens on a small ball's image: texels and pixels are smaller than single precision likes.

Not below a quarter of a degree, where a pixel of the ball is as small as what a ray of the reference starts above the mirror.
"""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props.minimal import RED, eye, misplaced, sphere, stage, thing, towards

REGIME = Regime(
    entry="F-18",
    title="Narrow field of view",
    severity="field of view, degrees",
    severities=(8.0, 2.0, 1.0, 0.5, 0.25),
    symptom="share of the ball's images, its own and the true one, that is not in both",
    bound=0.1,
    why="an image of 1000 pixels, the same for all fields of view, right but for half a pixel along its border",
    measure=misplaced(RED),
)


TURN = 25.0  # degrees from the axis to the reflection point
AWAY = 1.5  # from there to the ball


def telephoto(severity: float) -> Scene:
    R, at = towards(TURN), np.array([0.0, 0.0, 4.0])
    to_eye = (at - R) / np.linalg.norm(at - R)
    ball = R + AWAY * (2 * (to_eye @ R) * R - to_eye)
    radius = 2.5 * np.linalg.norm(at - R) * np.tan(np.radians(0.25 * severity))
    return stage([thing("ball", sphere(radius, ball), RED)], camera=eye(at, R, severity))
