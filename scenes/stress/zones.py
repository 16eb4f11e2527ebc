"""Several images in a bowl: far from it, a ball has one, upside down; nearer than the focus, the wall shows it three times."""

from __future__ import annotations

from benchharness.regime import MISSING, Regime
from benchharness.scene import Reflector, Scene

from ..props.minimal import RED, cap, eye, sphere, stage, thing

REGIME = Regime(
    entry="F-20",
    title="Several images in a bowl",
    severity="distance of the ball from the bowl's bottom, in radii; one image per vertex down to 0.6, three at 0.35",
    severities=(0.9, 0.6, 0.45, 0.35, 0.2),
    symptom="share of the vertices' visible reflections that are not found; FLIP in the mirror where a method has no vertices",
    bound=0.1,
    why="a vertex right at a caustic has two reflections that are nearly one; as FLIP, the ball's border differs",
    measure=MISSING,
)


def zones(severity: float) -> Scene:
    bowl = cap(sphere(), 0.0, inside_out=True)
    ball = thing("ball", sphere(0.08, (0.1, 0.0, 1.0 - severity), 24), RED)
    return stage([ball], [Reflector("mirror", bowl)], eye((0.25, 0.0, -1.2), (0.0, 0.0, 0.6), 60.0))
