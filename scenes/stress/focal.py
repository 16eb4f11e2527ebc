"""A small ball at the focus of a concave mirror: its image grows to infinity."""

from __future__ import annotations

from benchharness.regime import Regime
from benchharness.scene import Reflector, Scene

from ..props.minimal import RED, cap, eye, sphere, stage, thing

REGIME = Regime(
    entry="F-21",
    title="At the focus",
    severity="distance of the ball's middle from the focus, towards the mirror, in the mirror's radii of curvature",
    severities=(0.3, 0.1, 0.03, 0.01, 0.0),
    symptom="FLIP in the mirror",
    bound=0.08,
    why="the ball's image grows from a hundredth to half of the mirror: a pixel along its border",
    measure="flip",
)


EYE = (0.3, 0.0, -1.5)
FOCUS = 0.625  # from the bottom: 1 / d_E + 1 / d_V = 2 on the axis, with the eye 2.5 away


def focal(severity: float) -> Scene:
    dish = Reflector("mirror", cap(sphere(fine=96), 0.9, inside_out=True))
    ball = sphere(0.02, (-0.3 * (FOCUS - severity) / 2.5, 0.0, 1.0 - FOCUS + severity), 24)
    return stage([thing("ball", ball, RED)], [dish], eye(EYE, (0.0, 0.0, 1.0), 22.0))
