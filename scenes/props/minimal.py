"""What minimal scenes are made of: light is given, not baked, so that a scene costs nothing to make.

"eye4" is an eye at (0, 0, 4) that looks at the origin, 32 degrees high; "S1" is a mirror sphere of radius 1 there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from benchharness.regime import Seen, miss
from benchharness.scene import Camera, Gloss, Mesh, Motion, Object, PointLight, Reflector, Scene

from ..props import shapes

RED, GREEN, BLUE, YELLOW = (0.85, 0.1, 0.08), (0.1, 0.65, 0.2), (0.12, 0.25, 0.85), (0.9, 0.75, 0.1)
GREY, SKY, DARK = (0.45, 0.45, 0.45), (0.3, 0.36, 0.45), (0.05, 0.06, 0.08)
FINE = 48


def misplaced(*colours: tuple[float, float, float]) -> Callable[[Seen], float | None]:
    """A symptom: share of a colour's images, the method's and the true one, that is not in both; the worst of several."""

    def measured(seen: Seen) -> float | None:
        found = [value for colour in colours if (value := miss(*seen.like(colour))) is not None]
        return max(found, default=None)

    return measured


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


def cap(mesh: Mesh, above: float, *, inside_out: bool = False) -> Mesh:
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
    along_u, along_v = cells
    colours = np.where((np.add.outer(np.arange(along_v), np.arange(along_u)) % 2 == 0)[..., None], one, other)
    return shapes.tiles(origin, u, v, cells, colours)


WALLS = (
    (0.30, 0.36, 0.45), (0.46, 0.48, 0.40), (0.24, 0.36, 0.30), (0.50, 0.50, 0.56), (0.36, 0.33, 0.42), (0.40, 0.46, 0.50),
)  # fmt: skip
"""Of a room's sides, in the order of `shapes.FACES`; none is like the colours above."""


def room(lo, hi, omit: str = "") -> Mesh:
    """A box that is seen from inside, each side of a colour of its own, but for those of `omit`, such as "-z +y"."""
    box = shapes.box(lo, hi, GREY, omit, 1.0)
    side = 2 * np.abs(box.normals).argmax(axis=1) + (box.normals.sum(axis=1) > 0)
    return Mesh(box.vertices, box.faces[:, ::-1], -box.normals, np.asarray(WALLS)[side])


def turned(mesh: Mesh, axis: str, degrees: float) -> Mesh:
    """The mesh turned about an axis through the origin, right-handed."""
    return mesh.transformed(pose(axis, degrees))


def pose(axis: str = "y", degrees: float = 0.0, at=(0.0, 0.0, 0.0)) -> np.ndarray:
    """Float64 [4, 4]: turned about an axis through the origin, right-handed, then moved to `at`."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    made = np.eye(4)
    made[i, i] = made[j, j] = c
    made[i, j], made[j, i] = -s, s
    made[:3, 3] = at
    return made


def placed(mesh: Mesh, at) -> Mesh:
    return replace(mesh, vertices=mesh.vertices + np.asarray(at))


def flat(half: tuple[float, float], name: str = "mirror") -> Reflector:
    """A flat mirror of two triangles in the plane z = 0, around the origin, that faces +z."""
    x, y = half
    return Reflector(name, shapes.sheet((-x, -y, 0.0), (2 * x, 0, 0), (0, 2 * y, 0), [0.0, 1.0], [0.0, 1.0], GREY))


def slab(half: tuple[float, float], thickness: float) -> Reflector:
    """A closed box that is a mirror all over; its front is `flat`."""
    x, y = half
    mesh = shapes.box((-x, -y, -thickness), (x, y, 0.0), GREY)
    return Reflector("mirror", mesh, mesh)


def towards(degrees: float) -> np.ndarray:
    """Unit vector in the plane y = 0, turned from the eye's axis z towards x."""
    return np.array([np.sin(np.radians(degrees)), 0.0, np.cos(np.radians(degrees))])


def checkered_floor(y: float = -1.2, half: float = 4.0, cells: int = 32) -> Object:
    """A square floor that faces up."""
    return thing("floor", grid((-half, y, -half), (0.0, 0.0, 2 * half), (2 * half, 0.0, 0.0), (cells, cells)))


def glossy_floor(exponent: float) -> tuple[Object, PointLight]:
    """A dark floor with a highlight of this exponent, before the plane z = 0, and a light over it that nothing hides."""
    fine = np.linspace(0, 1, 41)
    mesh = lit(shapes.sheet((-3.0, -1.0, 0.0), (0.0, 0.0, 6.0), (6.0, 0.0, 0.0), fine, fine, GREY), (0.045, 0.045, 0.045))
    mesh = replace(mesh, visibility=np.ones((len(mesh.vertices), 1)))
    intensity = 700.0 / (exponent + 8)  # so that the peak does not depend on the exponent
    floor = Object("floor", mesh, "its highlight", gloss=Gloss((0.9, 0.9, 0.9), exponent))
    return floor, PointLight((0.8, 0.0, 4.0), (intensity, intensity, intensity))
