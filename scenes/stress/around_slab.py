"""The eye goes around a flat mirror to its back."""

from __future__ import annotations

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props.minimal import GREEN, RED, eye, misplaced, slab, sphere, stage, thing, towards

REGIME = Regime(
    entry="P-08",
    title="Eye behind a flat mirror",
    severity="angle of the eye from the front's normal, degrees",
    severities=(30.0, 60.0, 80.0, 100.0, 150.0),
    symptom="share of the front's or the back's ball's images that is not in both pictures; the worse of both",
    bound=0.25,
    why="images of 50 to 200 pixels that are right but for half a pixel along their borders",
    measure=misplaced(RED, GREEN),
)


def around_slab(severity: float) -> Scene:
    balls = [thing("front", sphere(0.4, (0.0, 0.0, 0.9), 32), RED), thing("back", sphere(0.4, (0.0, 0.0, -1.0), 32), GREEN)]
    return stage(balls, [slab((1.2, 0.9), 0.1)], eye(4.0 * towards(severity) + (0.0, 0.8, 0.0)))
