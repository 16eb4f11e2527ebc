"""What minimal scenes are made of: light is given, not baked, so that a scene costs nothing to make.

"eye4" is an eye at (0, 0, 4) that looks at the origin, 32 degrees high; "S1" is a mirror sphere of radius 1 there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchharness.scene import Camera, Mesh, Motion, Object, Reflector, Scene
from scenes import shapes

RED, GREEN, BLUE, YELLOW = (0.85, 0.1, 0.08), (0.1, 0.65, 0.2), (0.12, 0.25, 0.85), (0.9, 0.75, 0.1)
GREY, SKY = (0.45, 0.45, 0.45), (0.3, 0.36, 0.45)
FINE = 48


def lit(mesh: Mesh, colour=None) -> Mesh:
    """The mesh, shining with one colour [3], or with a colour per vertex [V, 3]; its albedo if none is given."""
    colour = mesh.albedo if colour is None else colour
    return Mesh(mesh.vertices, mesh.faces, mesh.normals, radiance=np.broadcast_to(colour, mesh.vertices.shape))


def thing(name: str, mesh: Mesh, colour=None, motion: Motion | None = None) -> Object:
    return Object(name, lit(mesh, colour), "what the regime is about", motion)


def sphere(radius: float = 1.0, at=(0.0, 0.0, 0.0), fine: int = FINE) -> Mesh:
    """A ball of 2 `fine` segments and `fine` rings, exact normals."""
    ball = shapes.unit_sphere(2 * fine, fine)
    v = np.asarray(ball.vertices)
    return Mesh(radius * v + np.asarray(at), np.asarray(ball.faces), v / np.linalg.norm(v, axis=1, keepdims=True))


def cap(mesh: Mesh, above: float, inside_out: bool = False) -> Mesh:
    """The faces of a mesh that lie wholly above a height z, and no other vertex; `inside_out`: seen from the other side."""
    faces = mesh.faces[(mesh.vertices[mesh.faces][:, :, 2] >= above - 1e-9).all(axis=1)]
    used, renumbered = np.unique(faces, return_inverse=True)
    faces, sign = renumbered.reshape(-1, 3), -1 if inside_out else 1
    return Mesh(mesh.vertices[used], faces[:, ::sign], sign * mesh.normals[used])


def s1(radius: float = 1.0, at=(0.0, 0.0, 0.0), fine: int = FINE) -> Reflector:
    mesh = sphere(radius, at, fine)
    return Reflector("mirror", mesh, mesh)


def eye(at=(0.0, 0.0, 4.0), target=(0.0, 0.0, 0.0), fov_deg: float = 32.0, up=(0.0, 1.0, 0.0)):
    camera = Camera(tuple(at), tuple(target), fov_deg, up)
    return lambda time: camera


def stage(
    objects: Sequence[Object], mirrors: Sequence[Reflector] = (), camera=None, background=SKY, frames: int = 1, **more
) -> Scene:
    """A scene of given light, seen by eye4 if no camera is given; S1 if no mirrors are."""
    return Scene("stress", tuple(objects), tuple(mirrors) or (s1(),), camera or eye(), frames, background=background, **more)


def grid(origin, u, v, cells: tuple[int, int], one=GREY, other=(0.75, 0.75, 0.72)) -> Mesh:
    """A checkered parallelogram, its squares with vertices of their own."""
    rows, columns = cells
    colours = np.where((np.add.outer(np.arange(rows), np.arange(columns)) % 2 == 0)[..., None], one, other)
    return shapes.tiles(origin, u, v, cells, colours)
