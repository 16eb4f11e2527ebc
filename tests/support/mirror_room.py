"""Small scenes with light given, not baked: a room of smooth colours, plain balls in it, mirrors; and how to ask a method."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np
import trimesh
from support.small_room import box, quad, sphere

from benchharness.api import Frame, Reflection
from benchharness.render import reference
from benchharness.render.frame import FrameRenderer
from benchharness.scene import Camera, Mesh, Object, Reflector, Scene, subdivided

SIZE = (160, 120)
EYE, CENTRE, RADIUS = (0.2, -1.7, 0.25), (0.0, 0.0, 0.0), 0.5


def smooth(vertices, scale: float = 1.0):
    """Radiance that differs in every direction and place, [V, 3] in [0.25, 0.75]."""
    return 0.5 + 0.25 * np.sin(1.3 * vertices / scale + [0.0, 1.0, 2.0])


def lit(mesh: Mesh, h: float, scale: float = 1.0) -> Mesh:
    fine = subdivided(mesh, h)
    return replace(fine, radiance=smooth(fine.vertices, scale))


def plain(mesh: Mesh, colour) -> Mesh:
    return replace(mesh, radiance=np.asarray(colour, float))


def ball(radius: float, center, colour, subdivisions: int = 3) -> Mesh:
    made = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return plain(Mesh(made.vertices + np.asarray(center), made.faces), colour)


def walls(half: float = 2.0, h: float = 0.4) -> Object:
    mesh = box((-half, -half, -half), (half, half, half), inside=True)
    return Object("walls", lit(mesh, h * half / 2, half / 2), shows="something on every side")


def balls() -> tuple[Object, ...]:
    where = {"red": (0.55, -0.75, 0.1), "green": (-0.65, -0.6, 0.0), "blue": (0.05, -0.7, -0.5)}
    colours = {"red": (0.9, 0.1, 0.1), "green": (0.1, 0.8, 0.1), "blue": (0.1, 0.2, 0.9)}
    return tuple(Object(name, ball(0.15, where[name], colours[name]), shows="something near") for name in where)


def mirror_ball(name: str = "mirror", center=CENTRE, radius: float = RADIUS, fine: int = 96, **more) -> Reflector:
    return Reflector(name, sphere(radius, center, slices=fine, stacks=fine // 2), **more)


def mirror_for(method) -> Reflector:
    """A mirror ball, or a sheet in its place for a method that refuses it."""
    ball = mirror_ball()
    if method.refuses(Scene("ball", (), (ball,), still(), 1)) is None:
        return ball
    return Reflector("mirror", quad((-0.6, 0.0, -0.5), (1.2, 0.3, 0.1), (0.05, 0.2, 1.0)))


def still(eye=EYE, target=CENTRE, fov_deg: float = 45.0):
    camera = Camera(tuple(eye), tuple(target), fov_deg)
    return lambda time: camera


def orbit(degrees_per_frame: float, fps: float = 25.0, eye=EYE):
    """Round the z axis."""

    def camera(time: float) -> Camera:
        angle = np.radians(degrees_per_frame * time * fps)
        c, s = np.cos(angle), np.sin(angle)
        return Camera((c * eye[0] - s * eye[1], s * eye[0] + c * eye[1], eye[2]), CENTRE, 45.0)

    return camera


def scene(objects, reflectors, camera=None, frames: int = 3, **more) -> Scene:
    return Scene("mirror_room", tuple(objects), tuple(reflectors), camera or still(), frames, **more)


def mirror_room(**more) -> Scene:
    """A mirror ball in a room of smooth colours, with three balls near it."""
    return scene((walls(), *balls()), (mirror_ball(),), **more)


@dataclass
class Answer:
    """A method's answer to one frame on the host: [H, W, ...] arrays and the raw reflection."""

    frame: Frame
    reflection: Reflection
    state: Any

    def __post_init__(self) -> None:
        shape = (self.frame.view.height, self.frame.view.width)
        self.active = np.array(self.frame.active).reshape(shape)
        # Nobody reads other lanes: they may hold anything.
        self.L = np.where(self.active[..., None], np.array(self.reflection.L).T.reshape(*shape, 3), 0)
        self.distance = np.where(self.active, np.array(self.reflection.distance).reshape(shape), 0)
        self.found = np.array(self.reflection.found).reshape(shape)

    def counted(self, name: str) -> np.ndarray:
        """A counter that has a number for each pixel of mirrors, as [H, W], 0 elsewhere; or its one number."""
        values, out = np.array(self.reflection.counters[name]), np.zeros(self.active.size, np.int64)
        if values.size == 1:
            return values
        out[np.array(self.frame.pixels)] = values
        return out.reshape(self.active.shape)

    def same(self, other: Answer) -> bool:
        """Bit for bit, counters and vertices included."""
        pairs = [(self.L, other.L), (self.distance, other.distance), (self.found, other.found)]
        pairs += [
            (np.array(self.reflection.counters[k]), np.array(other.reflection.counters[k])) for k in self.reflection.counters
        ]
        if self.reflection.vertices is not None:
            one, two = vars(self.reflection.vertices), vars(other.reflection.vertices)
            pairs += [(np.array(one[k]), np.array(two[k])) for k in one]
        return all(a.tobytes() == b.tobytes() for a, b in pairs)


def shaded(
    method, scene: Scene, *indices: int, size=SIZE, renderer: FrameRenderer | None = None, doubts: bool = True
) -> list[Answer]:
    """The method's answers to frames in order, from a fresh state; updated where something moved. `doubts`: asked for."""
    renderer = renderer or FrameRenderer(scene, *size)
    state, answers, last = method.prepare(scene), [], None
    for index in indices:
        frame = replace(renderer.render(index), doubts=doubts)
        if last is None or scene.moves(last, frame.time):
            state = method.update(state, frame)
        reflection, state = method.shade(state, frame)
        dr.eval(reflection, state)
        answers.append(Answer(frame, reflection, state))
        last = frame.time
    return answers


def error(answer: Answer, truth: reference.Reference) -> float:
    """Root mean square of radiance where both see a mirror; for ideal mirrors, whose reflectance is 1."""
    both = answer.active & truth.mask
    return float(np.sqrt(((answer.L - truth.image)[both] ** 2).mean()))
