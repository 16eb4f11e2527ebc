"""A card that turns until the mirror sees it from its edge."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props import shapes
from ..props.minimal import RED, misplaced, stage, thing

REGIME = Regime(
    entry="I-03",
    title="Card seen edge-on",
    severity="angle between the card and the line to the mirror's middle, degrees",
    severities=(90, 45, 15, 5, 1),
    symptom="share of the card's images, its own and the true one, that is not in both",
    bound=0.35,
    why="the image narrows to a few pixels",
    measure=misplaced(RED),
)


def edge_on(severity: float) -> Scene:
    angle = np.radians(severity)
    u = 0.8 * np.array([np.cos(angle), 0.0, np.sin(angle)])
    middle = np.array([1.6, 0.0, 1.4])
    axis = np.array([np.cos(0.72), 0.0, np.sin(0.72)])
    turn = np.column_stack([axis, [0.0, 1.0, 0.0], np.cross(axis, [0.0, 1.0, 0.0])])
    u, v = turn @ u, np.array([0.0, 0.8, 0.0])
    card = shapes.sheet(middle - 0.5 * (u + v), u, v, np.linspace(0, 1, 17), np.linspace(0, 1, 17), RED)
    return stage([thing("card", card, RED)])
