"""Thin layers: a coarse sticker lies just above a fine floor."""

from __future__ import annotations

from benchharness.regime import Regime
from benchharness.scene import Scene, subdivided

from ..props import shapes
from ..props.minimal import RED, grid, misplaced, stage, thing

REGIME = Regime(
    entry="F-16",
    title="Thin layers fight",
    severity="gap between sticker and floor, in radii of the mirror",
    severities=(0.2, 0.1, 0.05, 0.02, 0.005),
    symptom="share of the sticker's images, its own and the true one, that is not in both",
    bound=0.2,
    why="a border a pixel wide around 400 pixels",
    measure=misplaced(RED),
)


def layers(severity: float) -> Scene:
    floor = grid((-3.0, -1.3, -2.0), (0.0, 0.0, 6.0), (6.0, 0.0, 0.0), (60, 60))
    y = -1.3 + severity
    sticker = subdivided(shapes.sheet((-0.5, y, 1.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), [0.0, 1.0], [0.0, 1.0], RED), 0.5)
    return stage([thing("floor", floor), thing("sticker", sticker, RED)])
