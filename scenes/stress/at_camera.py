"""The camera that takes an object's depth map comes to stand in the mirror."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props.minimal import RED, eye, misplaced, s1, sphere, stage, thing, towards

REGIME = Regime(
    entry="I-10, I-11",
    title="Mirror around the depth map's camera",
    severity="distance of the camera from the mirror's middle, in radii of the mirror",
    severities=(8.0, 4.0, 2.0, 1.0, 0.0),
    symptom="share of the ball's images, its own and the true one, that is not in both",
    bound=0.3,
    why="an image of 60 to 200 pixels that is right but for half a pixel along its border",
    measure=misplaced(RED),
)


MIRROR, DISTANCE = 0.3, 6.0
FIELD_DEG = 10.0  # a camera sees an object at this angle: it stands radius / sin(5 degrees) away, between object and mirror


def at_camera(severity: float) -> Scene:
    radius = (DISTANCE - severity * MIRROR) * np.sin(np.radians(0.5 * FIELD_DEG))
    return stage(
        [thing("ball", sphere(radius, DISTANCE * towards(60.0)), RED)],
        [s1(MIRROR)],
        eye(target=MIRROR * towards(29.0), fov_deg=1.5),
    )
