"""An ellipsoid, the same at all severities, on which the pole of its mesh moves to where a ball is reflected."""

from __future__ import annotations

from benchharness.regime import Regime
from benchharness.scene import Mesh, Reflector, Scene

from ..props.minimal import RED, eye, misplaced, sphere, stage, thing, towards, turned

REGIME = Regime(
    entry="F-24",
    title="Pole of the mesh",
    severity="angle between the pole and the reflection point, degrees",
    severities=(60.0, 20.0, 5.0, 1.0, 0.0),
    symptom="share of the ball's images, its own and the true one, that is not in both",
    bound=0.2,
    why="the mirror stays the same: an image of 250 pixels that is right but for half a pixel along its border",
    measure=misplaced(RED),
)


HALF = (1.0, 0.5, 1.2)


def pole(severity: float) -> Scene:
    ball = turned(sphere(), "x", severity)
    mesh = Mesh(ball.vertices * HALF, ball.faces, ball.normals / HALF)
    mesh = Mesh(mesh.vertices, mesh.faces, mesh.normals / (mesh.normals**2).sum(axis=1, keepdims=True) ** 0.5)
    where = (0.0, 0.0, HALF[2]) + 1.5 * towards(-25.0)
    seen_from = (0.0, 0.0, HALF[2]) + 3.0 * towards(25.0)
    return stage(
        [thing("ball", sphere(0.5, where), RED)],
        [Reflector("mirror", mesh, mesh)],
        eye(seen_from, (0.0, 0.0, HALF[2]), fov_deg=16.0),
    )
