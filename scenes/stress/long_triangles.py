"""Long triangles: a straight bar over the mirror, cut into fewer and fewer pieces."""

from __future__ import annotations

from benchharness.regime import Regime
from benchharness.scene import Scene, subdivided

from ..props import shapes
from ..props.minimal import YELLOW, misplaced, stage, thing

REGIME = Regime(
    entry="F-14",
    title="Long triangles",
    severity="length of the bar's pieces, in radii of the mirror",
    severities=(0.06, 0.12, 0.25, 0.5, 1.0, 4.0),
    symptom="share of the bar's images, its own and the true one, that is not in both",
    bound=0.3,
    why="the bar's image is 2 to 5 pixels wide: half a pixel along both sides",
    measure=misplaced(YELLOW),
)


def long_triangles(severity: float) -> Scene:
    bar = shapes.bar((-2.0, 1.2, 0.7), (2.0, 1.4, 0.9), YELLOW)
    return stage([thing("bar", subdivided(bar, max(severity, 0.05)))])
