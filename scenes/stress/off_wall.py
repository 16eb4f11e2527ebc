"""A card by the wall of a room leaves the wall and comes near the mirror. It shrinks, so that its image stays as large."""

from __future__ import annotations

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props import shapes
from ..props.minimal import RED, misplaced, room, stage, thing

REGIME = Regime(
    entry="I-28",
    title="Object off the walls",
    severity="distance of the card from the wall, in that of the wall from the mirror's middle",
    severities=(0.05, 0.2, 0.35, 0.6, 0.75),
    symptom="share of the card's images, its own and the true one, that is not in both",
    bound=0.2,
    why="an image of 350 pixels that is right but for half a pixel along its border",
    measure=misplaced(RED),
)

HALF = 5.0


def off_wall(severity: float) -> Scene:
    at = HALF * (1 - severity)
    size, fine = 0.35 * at, [-1.0, -0.5, 0.0, 0.5, 1.0]
    card = shapes.sheet((at, 0.2 * at, 0.1 * at), (0, 0, size), (0, size, 0), fine, fine, RED)
    return stage([thing("walls", room((-HALF,) * 3, (HALF,) * 3)), thing("card", card)])
