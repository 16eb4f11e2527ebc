"""A concave mirror: what is in front of it comes nearer to the focus, and passes it."""

from __future__ import annotations

from benchharness.regime import Regime
from benchharness.scene import Reflector, Scene

from ..props.minimal import RED, cap, eye, sphere, stage, thing

REGIME = Regime(
    entry="F-20, F-21",
    title="Concave mirror",
    severity="distance of the ball from the mirror's bottom, in radii; the focus is at 0.5",
    severities=(0.2, 0.35, 0.5, 0.7, 0.9),
    symptom="FLIP in the mirror",
    bound=0.1,
    why="the ball covers a tenth to half of the mirror, its border differs",
    measure="flip",
)


def concave(severity: float) -> Scene:
    bowl = cap(sphere(), 0.75, inside_out=True)
    ball = thing("ball", sphere(0.08, (0.0, 0.0, 1.0 - severity), 24), RED)
    return stage([ball], [Reflector("mirror", bowl)], eye((0.4, 0.0, -1.5), (0.0, 0.0, 0.9), 34.0))
