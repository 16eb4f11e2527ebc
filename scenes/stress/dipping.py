"""A rod that stands on the mirror, and is pushed deeper and deeper into it."""

from __future__ import annotations

from benchharness.regime import Regime
from benchharness.scene import Scene, subdivided

from ..props import shapes
from ..props.minimal import RED, eye, misplaced, stage, thing, towards, turned

REGIME = Regime(
    entry="F-30",
    title="Object in the mirror",
    severity="depth of the rod's end in the mirror, in its radii",
    severities=(0.0, 0.1, 0.3, 0.6, 1.2),
    symptom="share of the rod's images, its own and the true one, that is not in both",
    bound=0.15,
    why="an image of 17 by 12 pixels, which the rod's part in the mirror does not change: half a pixel along its border",
    measure=misplaced(RED),
)

ANGLE = 60.0


def dipping(severity: float) -> Scene:
    rod = subdivided(shapes.box((-0.1, -0.1, 1 - severity), (0.1, 0.1, 1.6), RED), 0.1)
    return stage([thing("rod", turned(rod, "y", ANGLE), RED)], camera=eye(target=0.9 * towards(ANGLE), fov_deg=16.0))
