"""A ball jumps: what was found for its vertices in the last frame is of no use."""

from __future__ import annotations

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props.minimal import RED, checkered_floor, misplaced, pose, sphere, stage, thing, towards

REGIME = Regime(
    entry="F-19",
    title="Object that jumps",
    severity="jump from the last frame to this one, degrees around the mirror",
    severities=(0.0, 20.0, 60.0, 120.0, 180.0),
    symptom="share of the ball's images, its own and the true one, that is not in both",
    bound=0.2,
    why="the picture is the same for all jumps: an image of 250 pixels that is right but for half a pixel along its border",
    measure=misplaced(RED),
    frame=2,
)


def jump(severity: float) -> Scene:
    def moved(time: float):
        return pose(at=1.9 * towards(50.0 if time > 1.5 else 50.0 + severity))

    ball = thing("ball", sphere(0.35), RED, moved)
    return stage([ball, checkered_floor()], frames=3, fps=1.0)
