"""A dressing room with three flat mirrors: two that face each other, and one that leans against the wall and is touched.

What a mirrored camera has to get right is here once each: images of images between the facing mirrors, an edge that bounds a
mirror, something that touches a mirror that is not across the view, a highlight that belongs to the mirrored eye. About 1,500
vertices: images of straight edges are straight, and light is all that vertices are for. Drawn as built.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from benchharness.scene import Camera, Gloss, Mesh, Object, PointLight, Reflector, Scene, merged

from .props.shapes import Colour, box, lathe, pose, sheet, steps, tiles, tube
from .props.ways import gently, mixed

DetailName = Literal["lean", "paper"]
SPACING = {"lean": 0.5, "paper": 0.2}
"""Distance of base vertices on walls and ceiling, metres."""

X, Y, Z = 2.0, 2.2, 2.5
"""Half the room's width and depth, and its height, metres."""
OFF = 0.03  # of a mirror from the wall behind it, metres
LEAN_DEG, FOOT = 18.0, (-1.35, 0.55, 0.0)
"""How far the third mirror leans from upright, and the middle of its lower edge."""
FRAMES, FPS = 100, 25.0
EYES = ((1.25, -1.55, 1.55), (0.75, -1.35, 1.45))
TARGET = (-0.55, 1.5, 0.92)
ETA, K = (0.155, 0.145, 0.135), (4.2, 3.3, 2.4)  # of silver, about 620, 550 and 450 nm

OAK: Colour = (0.48, 0.30, 0.16)
PLUM: Colour = (0.40, 0.14, 0.22)
TEAL: Colour = (0.10, 0.34, 0.36)


def mirrors(detail: DetailName = "lean") -> Scene:
    """The dressing room.

    detail   how finely walls carry light; the same things either way

    Raises ValueError for anything else.
    """
    if detail not in SPACING:
        raise ValueError(f"mirrors: detail is {detail!r}; accepted: {', '.join(get_args(DetailName))}")
    scene = Scene(
        name="mirrors",
        objects=(*_room(SPACING[detail]), *_frames(), *_things()),
        reflectors=(
            _hung("wall", (-0.95, Y - OFF, 0.55), (1.5, 0.0, 0.0), (0.0, 0.0, 1.45)),
            _hung("opposite", (1.1, -Y + OFF, 0.45), (-2.2, 0.0, 0.0), (0.0, 0.0, 1.65)),
            Reflector("leaning", _leaning(0.75, 1.5), eta=ETA, k=K),
        ),
        camera=_camera,
        frames=FRAMES,
        fps=FPS,
        detail=detail,
        lights=(PointLight((0.5, 0.2, 2.2), (1.6, 1.5, 1.35)),),
    )
    scene.source.update(detail=detail, base_vertices=scene.vertices)
    return scene


def _camera(time: float) -> Camera:
    """Steps aside, so that images pass each other."""
    s = gently(time, (FRAMES - 1) / FPS)
    eye = tuple(mixed((a, b), s) for a, b in zip(*EYES, strict=True))
    return Camera((eye[0], eye[1], eye[2]), TARGET, fov_deg=52.0)


def _hung(name: str, corner, u, v) -> Reflector:
    """A mirror on a wall: a parallelogram that faces u x v."""
    return Reflector(name, sheet(corner, u, v, [0.0, 1.0], [0.0, 1.0], (0.5, 0.5, 0.5)), eta=ETA, k=K)


def _lean() -> np.ndarray:
    """From x across the mirror that leans, y into it and z up along it, to the room."""
    return pose(FOOT, turn_deg=90.0, tilt_deg=0.0) @ pose(tilt_deg=-LEAN_DEG)


def _leaning(width: float, height: float) -> Mesh:
    flat = sheet((-0.5 * width, 0, 0), (width, 0, 0), (0, 0, height), [0.0, 1.0], [0.0, 1.0], (0.5, 0.5, 0.5))
    return flat.transformed(_lean())


def _room(spacing: float) -> list[Object]:
    chequer = (np.add.outer(np.arange(11), np.arange(10)) % 2)[..., None]
    floor = np.where(chequer, (0.36, 0.33, 0.30), (0.72, 0.68, 0.60)) * np.ones((11, 10, 1))
    across, along, up = steps(-X, X, spacing), steps(-Y, Y, spacing), steps(0.0, Z, spacing)
    paint: Colour = (0.62, 0.66, 0.60)
    walls = merged(
        sheet((0, Y, 0), (1, 0, 0), (0, 0, 1), across, up, paint),
        sheet((0, -Y, 0), (-1, 0, 0), (0, 0, 1), across, up, (0.68, 0.58, 0.46)),
        sheet((-X, 0, 0), (0, 1, 0), (0, 0, 1), along, up, paint),
        sheet((X, 0, 0), (0, -1, 0), (0, 0, 1), along, up, (0.52, 0.58, 0.66)),
    )
    return [
        Object("floor", tiles((-X, -Y, 0), (2 * X, 0, 0), (0, 2 * Y, 0), (10, 11), floor), "straight lines that stay straight"),
        Object("walls", walls, "a colour for each side, which tells what is seen over how many mirrors"),
        Object("ceiling", sheet((0, 0, Z), (1, 0, 0), (0, -1, 0), across, along, (0.8, 0.8, 0.78)), "sends the light down"),
        Object(
            "panel",
            sheet((0, 0, Z - 0.02), (1, 0, 0), (0, -1, 0), [-0.6, 0.6], [-0.5, 0.5], (0.9, 0.9, 0.9), (7.0, 6.8, 6.2)),
            "lights the room",
        ),
    ]


def _frames() -> list[Object]:
    """What bounds the mirrors, and stands out before them."""
    w = 0.05
    x0, x1, z0, z1, y = -0.95, 0.55, 0.55, 2.0, Y - OFF
    hung = merged(
        *(box((a, y - 0.02, b), (c, Y, d), OAK, "+y") for a, b, c, d in (
            (x0 - w, z0 - w, x1 + w, z0), (x0 - w, z1, x1 + w, z1 + w), (x0 - w, z0, x0, z1), (x1, z0, x1 + w, z1)))
    )  # fmt: skip
    board = box((-0.395, 0.004, -0.02), (0.395, 0.03, 1.52), OAK).transformed(_lean())
    return [
        Object("frame", hung, "bounds a mirror, and is seen in the other one from the front"),
        Object("board", board, "lies behind the mirror that leans: none of it may come into its picture"),
    ]


def _things() -> list[Object]:
    crate = box((FOOT[0], 0.25, 0.0), (FOOT[0] + 0.34, 0.6, 0.3), TEAL, "-z")
    tip = _lean() @ np.array([0.18, -0.012, 1.05, 1.0])
    stick = tube([[-0.75, 0.98, 0.012], tip[:3].tolist()], 0.012, 8, PLUM)
    stool = merged(
        lathe([(0.0, 0.42), (0.17, 0.42), (0.18, 0.44), (0.17, 0.46), (0.0, 0.46)], 20, OAK),
        lathe([(0.15, 0.0), (0.15, 0.02), (0.03, 0.04), (0.03, 0.42)], 14, OAK),
    )
    vase = lathe(
        [(0.0, 0.0), (0.06, 0.0), (0.1, 0.07), (0.11, 0.14), (0.08, 0.22), (0.04, 0.27), (0.045, 0.31), (0.035, 0.31)], 28, PLUM
    )
    at = (0.05, 0.75)
    return [
        Object("crate", crate, "touches the mirror that leans along an edge: a near plane cuts it"),
        Object("stick", stick, "touches the mirror that leans with its tip, where it meets its image"),
        Object("stool", stool.transformed(pose((*at, 0.0))), "stands between the mirrors that face each other"),
        Object(
            "vase",
            vase.transformed(pose((*at, 0.46))),
            "has a highlight, which a mirror shows where the mirrored eye sees it",
            gloss=Gloss((0.25, 0.25, 0.25), 80.0),
        ),
    ]
