"""A wheel of spokes at all angles, which become thinner."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Scene, merged, subdivided

from ..props import shapes
from ..props.minimal import RED, eye, misplaced, placed, stage, thing, towards, turned

REGIME = Regime(
    entry="I-16, I-17",
    title="Spokes at all angles",
    severity="width of the spokes, in radii of the mirror",
    severities=(0.2, 0.12, 0.08, 0.05),
    symptom="share of the spokes' images, its own and the true one, that is not in both",
    bound=0.4,
    why="spokes of 1 to 5 pixels, right but for half a pixel along their sides",
    measure=misplaced(RED),
)


def spokes(severity: float) -> Scene:
    bar = subdivided(shapes.box((0.2, -0.5 * severity, -0.05), (0.8, 0.5 * severity, 0.05), RED), 0.15)
    wheel = merged(*(turned(bar, "z", angle) for angle in np.linspace(0, 360, 11)[:-1]))
    return stage(
        [thing("wheel", placed(turned(wheel, "y", 40.0), 1.7 * towards(40.0)), RED)],
        camera=eye(target=0.95 * towards(20.0), fov_deg=16.0),
    )
