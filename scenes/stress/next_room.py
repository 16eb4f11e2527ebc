"""A mirror that moves through an opening into the next room, out of the box that stood for the first one."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Camera, Mesh, Reflector, Scene, merged

from ..props import shapes
from ..props.minimal import GREY, RED, misplaced, pose, room, sphere, stage, thing

REGIME = Regime(
    entry="I-22",
    title="Mirror that leaves its box",
    severity="way of the mirror, in that from the middle of its room to the next one's",
    severities=(0.0, 0.3, 0.5, 0.7, 1.0),
    symptom="share of the cards' images, their own and the true ones, that is not in both",
    bound=0.25,
    why="images of 30 to 300 pixels that are right but for half a pixel along their borders",
    measure=misplaced(RED),
    frame=1,
)

HALF = 3.0


def next_room(severity: float) -> Scene:
    def middle(time: float) -> np.ndarray:
        return np.array([2 * HALF * severity * time - HALF, 0.0, 0.0])

    def camera(time: float) -> Camera:
        x = float(middle(time)[0])
        return Camera((x - 2.0, 0.4, 1.7), (x, 0.0, 0.0), 22.0, (0.0, 1.0, 0.0))

    lines = [-HALF, -1.2, 1.2, HALF]
    partition = shapes.sheet((0, 0, 0), (0, 0, 1), (0, 1, 0), lines, lines, GREY, hole=(-1.2, 1.2, -1.2, 1.2))
    ball = sphere(0.5)
    objects = [
        thing("walls", merged(room((-2 * HALF, -HALF, -HALF), (0, HALF, HALF), "+x"), partition)),
        thing("next walls", room((0, -HALF, -HALF), (2 * HALF, HALF, HALF), "-x")),
        thing("cards", _cards(-HALF), RED),
        thing("next cards", _cards(HALF), RED),
    ]
    mirror = Reflector("mirror", ball, ball, motion=lambda time: pose(at=middle(time)))
    return stage(objects, [mirror], camera, frames=2, fps=1.0)


def _cards(x: float) -> Mesh:
    """On the four walls around the axis and on the one at the end, facing inwards."""
    fine, off = np.linspace(-1.2, 1.2, 5), HALF - 0.1
    u, v = ((0, 1, 0), (0, 0, 1)) if x < 0 else ((0, 0, 1), (0, 1, 0))
    return merged(
        shapes.sheet((x, -off, 0), (0, 0, 1), (1, 0, 0), fine, fine, RED),
        shapes.sheet((x, off, 0), (1, 0, 0), (0, 0, 1), fine, fine, RED),
        shapes.sheet((x, 0, -off), (1, 0, 0), (0, 1, 0), fine, fine, RED),
        shapes.sheet((x, 0, off), (0, 1, 0), (1, 0, 0), fine, fine, RED),
        shapes.sheet((np.sign(x) * (2 * HALF - 0.1), 0, 0), u, v, fine, fine, RED),
    )
