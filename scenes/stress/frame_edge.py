"""A ball whose image moves out of a small flat mirror."""

from __future__ import annotations

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props.minimal import RED, eye, flat, misplaced, sphere, stage, thing

REGIME = Regime(
    entry="P-07",
    title="Edge of a flat mirror",
    severity="how far the ball stands to the side, in half widths of the mirror",
    severities=(0.0, 0.5, 1.0, 1.3, 1.5),
    symptom="share of the ball's images, its own and the true one, that is not in both",
    bound=0.25,
    why="an image of 150 pixels that is cut down to 20: half a pixel along its border",
    measure=misplaced(RED),
)


def frame_edge(severity: float) -> Scene:
    return stage([thing("ball", sphere(0.3, (0.6 * severity, 0.0, 1.0), 32), RED)], [flat((0.6, 0.9))], eye((0.0, 1.8, 3.5)))
