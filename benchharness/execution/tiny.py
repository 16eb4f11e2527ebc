"""The scenes on which methods are checked: the second is for those that refuse the first."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import trimesh

from benchharness.scene import Camera, Mesh, Object, Reflector, Scene, subdivided


def scene() -> Scene:
    """A mirror ball in a coloured box, radiance given: smooth and different in every direction. Two frames."""
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.6)
    mesh = Mesh(ball.vertices, ball.faces, ball.vertices / 0.6)
    return _with(Reflector("mirror", mesh, closed=mesh))


def flat() -> Scene:
    """The same with a flat mirror."""
    corners = np.array([[-0.9, 0.5, -0.7], [0.9, 0.7, -0.7], [0.9, 0.8, 0.7], [-0.9, 0.6, 0.7]])
    return _with(Reflector("mirror", Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]]))))


def _with(mirror: Reflector) -> Scene:
    """A mirror in the box."""

    def lit(mesh: Any, *, inward: bool = False) -> Mesh:
        faces = mesh.faces[:, ::-1] if inward else mesh.faces
        made = subdivided(Mesh(mesh.vertices, faces), 0.8)
        return replace(made, radiance=0.5 + 0.2 * np.sin(1.3 * made.vertices + [0.0, 1.0, 2.0]))

    def shift(time: float) -> np.ndarray:
        pose = np.eye(4)
        pose[:3, 3] = [1.2, -0.8 + 5.0 * time, 0.3]
        return pose

    return Scene(
        name="tiny",
        objects=(
            Object("box", lit(trimesh.creation.box((4, 4, 4)), inward=True), "surroundings on every side"),
            Object("ball", lit(trimesh.creation.icosphere(subdivisions=1, radius=0.25)), "something that moves", shift),
        ),
        reflectors=(mirror,),
        camera=lambda time: Camera((0.4 + 5.0 * time, -1.8, 0.3), (0.0, 0.0, 0.0), 50.0),
        frames=2,
    )
