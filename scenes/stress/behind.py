"""One object of two balls, one before the other, that part."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Scene, merged

from ..props.minimal import GREEN, RED, misplaced, sphere, stage, thing

REGIME = Regime(
    entry="I-14",
    title="Depth within an object",
    severity="distance between the balls, in radii of the mirror",
    severities=(0.0, 0.3, 1.0, 2.0),
    symptom="share of the near ball's images, its own and the true one, that is not in both",
    bound=0.2,
    why="an image of 300 pixels that is right but for half a pixel along its border",
    measure=misplaced(RED),
)


def behind(severity: float) -> Scene:
    direction = np.array([np.sin(0.8), 0.0, np.cos(0.8)])
    near, far = sphere(0.25, 1.6 * direction), sphere(0.5, (2.4 + severity) * direction)
    colours = np.concatenate([np.tile(RED, (len(near.vertices), 1)), np.tile(GREEN, (len(far.vertices), 1))])
    return stage([thing("balls", merged(near, far), colours)])
