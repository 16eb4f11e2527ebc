"""An object around the mirror: a ring of beads that closes in on it."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Scene, merged

from ..props.minimal import RED, misplaced, sphere, stage, thing

REGIME = Regime(
    entry="I-04",
    title="Object around the mirror",
    severity="radius of the ring, in radii of the mirror",
    severities=(6.0, 3.0, 2.0, 1.5, 1.25),
    symptom="share of the beads' images, their own and the true ones, that is not in both",
    bound=0.35,
    why="twelve images of 20 to 100 pixels, right but for half a pixel along their borders",
    measure=misplaced(RED),
)


def around(severity: float) -> Scene:
    angles = np.linspace(0, 2 * np.pi, 13)[:-1]
    beads = [sphere(0.15 * severity, severity * np.array([np.cos(a), 0.25, np.sin(a)]), 16) for a in angles]
    return stage([thing("beads", merged(*beads), RED)])
