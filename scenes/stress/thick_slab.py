"""A flat mirror whose body grows behind it."""

from __future__ import annotations

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props.minimal import RED, eye, misplaced, slab, sphere, stage, thing, towards

REGIME = Regime(
    entry="P-10",
    title="Flat mirror with a thick back",
    severity="thickness of the mirror, in its half widths",
    severities=(0.02, 0.2, 0.5, 1.0, 2.0),
    symptom="share of the ball's images, its own and the true one, that is not in both",
    bound=0.2,
    why="an image of 250 pixels that is right but for half a pixel along its border",
    measure=misplaced(RED),
)


def thick_slab(severity: float) -> Scene:
    ball = thing("ball", sphere(0.35, (-0.3, 0.0, 0.35), 32), RED)
    return stage([ball], [slab((1.0, 0.8), severity)], eye(4.0 * towards(40.0) + (0.0, 0.6, 0.0)))
