"""Flat mirrors in rooms of few triangles, for brute force in float64; light is given."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from support.mirror_room import Answer, plain, scene, shaded, smooth, still
from support.small_room import box, quad

from benchharness.render.frame import FrameRenderer
from benchharness.scene import Mesh, Object, Reflector, Scene

SIZE = (120, 90)
RED, GREEN, BLUE, SKY = (0.9, 0.1, 0.1), (0.1, 0.8, 0.1), (0.1, 0.2, 0.9), (0.3, 0.4, 0.6)


def thing(name: str, mesh: Mesh, colour=None, **more) -> Object:
    """In one colour, or in `smooth` ones."""
    shown = replace(mesh, radiance=smooth(mesh.vertices)) if colour is None else plain(mesh, colour)
    return Object(name, shown, "seen in a mirror", **more)


def room(half: float = 2.0) -> Object:
    return thing("walls", box((-half, -half, -half), (half, half, half), inside=True))


def pose(axis: str = "x", degrees: float = 0.0, at=(0.0, 0.0, 0.0)) -> np.ndarray:
    """Turned about an axis through the origin, right-handed, then moved."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    made = np.eye(4)
    made[i, i] = made[j, j] = c
    made[i, j], made[j, i] = -s, s
    made[:3, 3] = at
    return made


def sheet(half=(0.8, 0.6), turn: np.ndarray | None = None, name: str = "mirror", **more) -> Reflector:
    """A rectangle about the origin in the plane y = 0 that faces -y, moved by `turn`."""
    x, z = half
    mesh = quad((-x, 0, -z), (2 * x, 0, 0), (0, 0, 2 * z))
    return Reflector(name, mesh if turn is None else mesh.transformed(turn), **more)


def tilted(degrees: float, *, behind: bool = False, sky: bool = False) -> Scene:
    """A mirror that leans back, a red cube that touches it, a green box in the room; `behind` it a blue one."""
    turn = pose("x", -degrees)
    cube = box((-0.35, -0.4, -0.15), (0.05, 0.0, 0.25)).transformed(turn)
    things = [thing("cube", cube, RED), thing("box", box((0.3, -1.2, -0.5), (0.8, -0.8, 0.3)), GREEN)]
    if behind:
        things.append(thing("behind", box((-0.5, 0.08, -0.5), (0.6, 0.5, 0.5)).transformed(turn), BLUE))
    things += [] if sky else [room()]
    return scene(things, [sheet(turn=turn)], still((0.25, -1.9, 0.15)), 1, background=SKY if sky else (0, 0, 0))


def facing(metal: tuple | None = None) -> Scene:
    """Two parallel mirrors 2 m apart, one behind the eye, and a small cube between them; the sky around. `metal`: eta and k."""
    eta, k = metal or (None, None)
    front = sheet((1.1, 0.9), pose(at=(0, 1, 0)), "front", eta=eta, k=k)
    back = sheet((1.1, 0.9), pose("z", 180, (0, -1, 0)), "back", eta=eta, k=k)
    cube = thing("cube", box((-0.07, -0.07, -0.07), (0.07, 0.07, 0.07)).transformed(pose(at=(0.1, 0.25, 0.12))), RED)
    return scene([cube], [front, back], still((0.9, -0.7, 0.4), (0.4, 1.0, 0.2), 45.0), 1, background=SKY)


def asked(made: Scene, *methods, size=SIZE, index: int = 0) -> list[Answer]:
    renderer = FrameRenderer(made, *size)
    return [shaded(method, made, index, renderer=renderer)[0] for method in methods]


def off(answer: Answer, L: np.ndarray, by: float = 1e-3) -> np.ndarray:
    """Pixels of mirrors that show another radiance, [H, W]."""
    return answer.active & (np.abs(answer.L - L).max(axis=-1) > by)


def doubted(answer: Answer) -> np.ndarray:
    return np.array(answer.reflection.doubt).reshape(answer.active.shape) & answer.active


def renders(answer: Answer) -> int:
    return int(answer.counted("renders")[0])
