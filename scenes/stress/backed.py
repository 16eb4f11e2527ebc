"""A flat mirror that tilts, with a box of one colour behind it and a ball of the same colour before it."""

from __future__ import annotations

from dataclasses import replace

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props import shapes
from ..props.minimal import RED, flat, misplaced, placed, pose, sphere, stage, thing

REGIME = Regime(
    entry="P-11",
    title="Something behind a tilted flat mirror",
    severity="tilt of the mirror, degrees",
    severities=(0.0, 30.0, 45.0, 60.0),
    symptom="share of the ball's images, its own and the true one, and of what is shown like it, that is not in both",
    bound=0.15,
    why="an image of 300 to 600 pixels that is right but for half a pixel along its border",
    measure=misplaced(RED),
)


def backed(severity: float) -> Scene:
    turn, mirror = pose("x", -severity), flat((1.5, 1.5))
    box = shapes.box((-1.2, -1.2, -1.0), (1.2, 1.2, -0.05), RED, spacing=0.6).transformed(turn)
    ball = placed(sphere(0.3, fine=32), (turn @ [-0.6, 0.3, 0.5, 1.0])[:3])
    things = [thing("box", box), thing("ball", ball, RED)]
    return stage(things, [replace(mirror, mesh=mirror.mesh.transformed(turn))])
