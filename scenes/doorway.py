"""Two rooms that a doorway joins, and a mirror ball on a stand that is pushed from one into the other.

What a map of a room has to know is here once each: walls that a box can stand for, and others behind a doorway, for which that
box is wrong; a picture and books in the walls, a chest that stands off them, a vase that is nearer than they are; a door that
is seen from its edge, a thin stand; two lights of two colours. The hall's box is the one that the mirror starts in; halfway the
mirror is in the doorway, and in the end outside of the box. About 4,400 vertices, 1,800 of them the ball's. Drawn as built.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, get_args

import numpy as np

from benchharness.scene import Camera, Mesh, Object, Reflector, Scene, merged

from .props.courtyard import METALS
from .props.shapes import Colour, bar, box, lathe, placed, pose, sheet, steps, tiles, tube, unit_sphere, with_breaks
from .props.ways import gently, mixed

DetailName = Literal["lean", "paper"]
SPACING = {"lean": 0.5, "paper": 0.2}
"""Distance of base vertices on walls and ceilings, metres."""


@dataclass(frozen=True)
class Room:
    """A box: x and y from, to, and its height, metres. Its floor is at z = 0."""

    x: tuple[float, float]
    y: tuple[float, float]
    z: float

    def corners(self) -> list[tuple[float, float]]:
        """Clockwise, as seen from above, from least x and y on."""
        (x0, x1), (y0, y1) = self.x, self.y
        return [(x0, y0), (x0, y1), (x1, y1), (x1, y0)]


Opening = tuple[float, float, float, float]
"""In a wall, metres: from, to, along the way around the room; lower and upper edge."""

HALL = Room((-3.4, -0.1), (-1.6, 1.6), 2.4)
STUDY = Room((0.1, 3.0), (-2.0, 1.7), 2.9)
DOOR, TRIM = (-0.5, 0.5, 0.0, 2.05), 0.09
"""The doorway: y from, to, z from, to; and how wide the frame around it is, metres."""

RADIUS, HEIGHT = 0.22, 1.12
"""Of the ball, and of its middle over the floor, metres."""
WAY = (-1.5, 1.3)
"""The ball's x at the beginning and at the end; its y is 0."""
FRAMES, FPS = 100, 25.0
EYES = ((-3.0, -0.95, 1.5), (-0.85, -0.42, 1.4))

WHITE: Colour = (0.80, 0.79, 0.75)
OAK: Colour = (0.46, 0.28, 0.14)
IRON: Colour = (0.06, 0.06, 0.07)
OCHRE: Colour = (0.72, 0.52, 0.24)
SAGE: Colour = (0.34, 0.46, 0.38)
TEAL: Colour = (0.08, 0.36, 0.40)
PLUM: Colour = (0.42, 0.12, 0.20)


def doorway(detail: DetailName = "lean") -> Scene:
    """The two rooms.

    detail   how finely walls carry light; the same things either way

    Raises ValueError for anything else.
    """
    if detail not in SPACING:
        raise ValueError(f"doorway: detail is {detail!r}; accepted: {', '.join(get_args(DetailName))}")
    spacing = SPACING[detail]
    ball = unit_sphere(60, 32)
    v = np.asarray(ball.vertices)
    mirror = Mesh(RADIUS * v, np.asarray(ball.faces), v / np.linalg.norm(v, axis=1, keepdims=True))
    eta, k = METALS["silver"]
    scene = Scene(
        name="doorway",
        objects=(*_hall(spacing), *_study(spacing), *_between(spacing), *_things(), _stand()),
        reflectors=(Reflector("ball", mirror, mirror, eta, k, _moved),),
        camera=_camera,
        frames=FRAMES,
        fps=FPS,
        detail=detail,
    )
    scene.source.update(detail=detail, base_vertices=scene.vertices)
    return scene


def _share(time: float) -> float:
    """Of the way, at a time in seconds."""
    return gently(time, (FRAMES - 1) / FPS)


def _moved(time: float) -> np.ndarray:
    return pose((mixed(WAY, _share(time)), 0.0, HEIGHT))


def _camera(time: float) -> Camera:
    """Follows the ball through the hall, and looks at it through the doorway in the end."""
    eye = tuple(mixed((a, b), _share(time)) for a, b in zip(*EYES, strict=True))
    return Camera((eye[0], eye[1], eye[2]), (mixed(WAY, _share(time)), 0.0, HEIGHT), fov_deg=30.0)


# What the rooms are made of


def _walls(room: Room, spacing: float, colours: list[Colour], openings: dict[int, Opening]) -> Mesh:
    """Four walls that face inwards, each from one corner of the room to the next, at most one opening in each."""
    corners = np.array([*room.corners(), room.corners()[0]])
    made = []
    for number, (a, b) in enumerate(pairwise(corners)):
        length, hole = float(np.linalg.norm(b - a)), openings.get(number)
        along = with_breaks(0.0, length, spacing, hole[:2] if hole else ())
        up = with_breaks(0.0, room.z, spacing, hole[2:] if hole else ())
        made.append(sheet((*a, 0.0), (*(b - a) / length, 0.0), (0, 0, 1), along, up, colours[number], hole=hole))
    return merged(*made)


def _ceiling(room: Room, spacing: float, colour: Colour, hole: Opening | None = None) -> Mesh:
    """hole: x from, to, and -y from, to."""
    across = with_breaks(*room.x, spacing, hole[:2] if hole else ())
    along = with_breaks(-room.y[1], -room.y[0], spacing, hole[2:] if hole else ())
    return sheet((0, 0, room.z), (1, 0, 0), (0, -1, 0), across, along, colour, hole=hole)


def _hall(spacing: float) -> list[Object]:
    """Floor, walls, ceiling, lamp, and what hangs and stands along the walls."""
    (x0, x1), (y0, y1) = HALL.x, HALL.y
    chequer = (np.add.outer(np.arange(8), np.arange(8)) % 2)[..., None]
    floor = np.where(chequer, (0.40, 0.17, 0.10), (0.70, 0.60, 0.45)) * np.ones((8, 8, 1))
    picture, lamp, chest = (1.0, 1.9, 1.15, 1.75), (-2.3, -1.3, -0.4, 0.4), (-1.9, -0.9, 0.0, 0.8)
    door = (y1 - DOOR[1] - TRIM, y1 - DOOR[0] + TRIM, 0.0, DOOR[3] + TRIM)
    behind = (x1 - chest[1], x1 - chest[0], *chest[2:])
    walls = _walls(HALL, spacing, [OCHRE, (0.74, 0.66, 0.50), OCHRE, (0.66, 0.38, 0.24)], {1: picture, 2: door, 3: behind})
    return [
        Object(
            "hall floor",
            tiles((x0, y0, 0), (x1 - x0, 0, 0), (0, y1 - y0, 0), (8, 8), floor),
            "a regular pattern, which bends where a map is looked up in the wrong place",
        ),
        Object("hall walls", walls, "the box that stands for the room in which the mirror starts"),
        Object("hall ceiling", _ceiling(HALL, spacing, WHITE, lamp), "closes the room, and sends the light down"),
        Object(
            "hall lamp",
            sheet((0, 0, HALL.z), (1, 0, 0), (0, -1, 0), lamp[:2], lamp[2:], WHITE, (11.0, 8.4, 5.4)),
            "warm light, of which the other room has little",
        ),
        Object("picture", _picture((x0, y1), picture), "lies in the wall, where a box is right"),
        Object(
            "chest",
            box((chest[0], y0, 0.0), (chest[1], y0 + 0.4, chest[3]), OAK, "-z -y", 0.4),
            "stands off the wall: a box puts its front into the wall; only the mirror shows it",
        ),
    ]


def _picture(corner: tuple[float, float], opening: Opening) -> Mesh:
    """Hills under an evening sky, four by three fields, in the hole of a wall that goes from the corner along +x."""
    s0, s1, z0, z1 = opening
    sky, sun, hill, field = (0.78, 0.45, 0.30), (0.85, 0.75, 0.30), (0.20, 0.26, 0.42), (0.24, 0.36, 0.14)
    colours = np.array([[field, field, field, field], [hill, hill, field, hill], [sky, sky, sun, sky]])
    return tiles((corner[0] + s0, corner[1], z0), (s1 - s0, 0, 0), (0, 0, z1 - z0), (4, 3), colours)


def _study(spacing: float) -> list[Object]:
    """Floor, walls, ceiling, window, bookcase."""
    (x0, x1), (y0, y1) = STUDY.x, STUDY.y
    rng = np.random.default_rng(5)
    boards = np.broadcast_to((0.44, 0.32, 0.20), (9, 3, 3)) * rng.uniform(0.75, 1.2, (9, 3, 1))
    window, shelves = (1.0, 2.3, 0.9, 2.4), (-0.75, 0.75, 0.0, 1.9)
    door = (DOOR[0] - TRIM - y0, DOOR[1] + TRIM - y0, 0.0, DOOR[3] + TRIM)
    behind = (y1 - shelves[1], y1 - shelves[0], *shelves[2:])
    glass = (x1 - window[1], x1 - window[0], *window[2:])
    walls = _walls(STUDY, spacing, [SAGE, (0.30, 0.40, 0.52), SAGE, (0.52, 0.56, 0.50)], {0: door, 2: behind, 3: glass})
    middle = 0.5 * (window[0] + window[1])
    bars = merged(
        bar((middle - 0.025, y0 - 0.01, window[2]), (middle + 0.025, y0 + 0.03, window[3]), WHITE),
        bar((window[0], y0 - 0.01, 1.85), (window[1], y0 + 0.03, 1.9), WHITE),
    )
    return [
        Object(
            "study floor",
            tiles((x0, y0, 0), (x1 - x0, 0, 0), (0, y1 - y0, 0), (3, 9), boards),
            "boards, so that it is plain which room's floor is shown",
        ),
        Object("study walls", walls, "another room, which the hall's box does not have, and its colours"),
        Object("study ceiling", _ceiling(STUDY, spacing, WHITE), "is higher than the hall's"),
        Object(
            "window",
            sheet((x1, y0, 0), (-1, 0, 0), (0, 0, 1), glass[:2], glass[2:], WHITE, (5.8, 7.0, 8.4)),
            "daylight, which the hall sees through the doorway alone",
        ),
        Object("window bars", bars, "straight lines against the light"),
        Object("bookcase", _bookcase(shelves), "small things along a wall, which a box nearly has"),
    ]


def _bookcase(opening: Opening) -> Mesh:
    """Four shelves of books along the wall of greatest x; y from, to, and height are the opening's."""
    y0, y1, _, top = opening
    x, back, thick, deep = STUDY.x[1], STUDY.x[1] - 0.3, 0.03, 0.06
    rng = np.random.default_rng(11)
    covers = np.array([PLUM, TEAL, OCHRE, (0.20, 0.24, 0.42), (0.60, 0.52, 0.40), (0.30, 0.34, 0.16)])
    levels = np.linspace(0.0, top - thick, 5)
    boards = [box((back, y0, z), (x, y1, z + thick), OAK, "+x") for z in levels]
    sides = [box((back, y, 0.0), (x, y + thick, top), OAK, "+x -z") for y in (y0, y1 - thick)]
    rows = []
    for z in levels[:-1]:
        chosen, tones = covers[rng.integers(0, len(covers), 9)], rng.uniform(0.7, 1.2, (9, 1))
        height, from_y = rng.uniform(0.3, 0.38), y1 - thick
        rows.append(
            tiles((back + deep, from_y, z + thick), (0, y0 + 2 * thick - y1, 0), (0, 0, height), (9, 1), (chosen * tones)[None])
        )
    panel = sheet((x, y1, 0), (0, -1, 0), (0, 0, 1), steps(0, y1 - y0, 0.4), steps(0, top, 0.4), (0.30, 0.20, 0.12))
    return merged(panel, *boards, *sides, *rows)


def _between(spacing: float) -> list[Object]:
    """The doorway's frame, which closes the gap between the rooms, and the door."""
    (y0, y1, _, top), w, t = DOOR, TRIM, STUDY.x[0]
    up, x, z = steps(0.0, top, spacing), (1, 0, 0), (0, 0, 1)
    flat = [
        sheet((side * t, 0, 0), (0, side, 0), z, sorted(side * np.array(ys)), zs, WHITE)
        for side in (-1, 1)
        for ys, zs in (((y0 - w, y0), up), ((y1, y1 + w), up), ((y0 - w, y0, y1, y1 + w), (top, top + w)))
    ]
    deep = [
        sheet((0, y1, 0), x, z, (-t, t), up, WHITE),
        sheet((0, y0, 0), (-1, 0, 0), z, (-t, t), up, WHITE),
        sheet((0, 0, top), x, (0, -1, 0), (-t, t), (y0, y1), WHITE),
        sheet((0, 0, 0), x, (0, 1, 0), (-t, t), (y0, y1), OAK),
    ]
    leaf = placed(box((0.0, -0.02, 0.01), (0.96, 0.02, top - 0.01), TEAL, spacing=0.7), (t + 0.03, y1 + 0.05, 0.0), 20.0)
    return [
        Object("door frame", merged(*flat, *deep), "the edge between what one room's box has and what it has not"),
        Object("door", leaf, "a plate along the mirror's way: its middle sees it from the edge, and its side from the front"),
    ]


# What stands in the rooms


def _things() -> list[Object]:
    pillar = lathe(
        [(0.19, 0.0), (0.19, 0.05), (0.13, 0.08), (0.11, 0.12), (0.11, 0.82), (0.17, 0.86), (0.17, 0.9), (0.0, 0.9)], 14, WHITE
    )
    vase = lathe(
        [(0.0, 0.0), (0.06, 0.0), (0.11, 0.09), (0.12, 0.16), (0.08, 0.25), (0.04, 0.3), (0.05, 0.36), (0.0, 0.36)], 20, TEAL
    )
    top = lathe([(0.0, 0.69), (0.4, 0.69), (0.42, 0.71), (0.4, 0.73), (0.0, 0.73)], 20, OAK)
    leg = lathe([(0.22, 0.0), (0.2, 0.03), (0.04, 0.06), (0.04, 0.69)], 12, OAK)
    globe = lathe([(0.07, 0.0), (0.02, 0.03), (0.02, 0.07), (0.13, 0.16), (0.15, 0.22), (0.13, 0.29), (0.0, 0.36)], 18, PLUM)
    pole = tube([(0, 0, 0.02), (0, 0, 1.7)], 0.016, 8, IRON)
    hooks = [tube([(0, 0, 1.62), (0.16 * c, 0.16 * s, 1.72)], 0.012, 6, IRON) for c, s in ((1, 0), (-0.5, 0.87), (-0.5, -0.87))]
    foot = lathe([(0.2, 0.0), (0.2, 0.02), (0.0, 0.05)], 14, IRON)
    return [
        Object("pillar", placed(pillar, (-1.75, 0.72, 0.0)), "stands free on the floor of the hall, under the vase"),
        Object("vase", placed(vase, (-1.75, 0.72, 0.9)), "is near the mirror at first, and on no proxy"),
        Object("coat stand", placed(merged(pole, *hooks, foot), (-0.6, 1.1, 0.0)), "thin, before a wall: rays pass by it"),
        Object("table", placed(merged(top, leg), (1.95, -0.95, 0.0)), "stands free in the other room, against the light"),
        Object("lamp foot", placed(globe, (1.95, -0.95, 0.73)), "is near the mirror in the end, and on no proxy"),
    ]


def _stand() -> Object:
    """Touches the ball from below along a ring, and goes with it; told from the ball's middle."""
    z = -HEIGHT
    ring = [(0.02, -0.28), (0.08, -0.22), (0.0815, -0.2046), (0.04, -0.222), (0.0, -0.2235)]
    column = lathe([(0.17, z), (0.17, z + 0.02), (0.03, z + 0.05), (0.02, z + 0.1), *ring], 18, IRON)
    return Object("stand", column, "touches the mirror and moves with it: contact that no map keeps", _moved)
