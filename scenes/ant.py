"""Four large ants around lumps of sugar, among cans on a picnic cloth: their eight eyes are the mirrors.

The eyes are closed, convex and small, many at once, and grow out of heads that they mirror where they touch them. Cans
have labels of strips as long as the can. (`scenes.props.insects`, `scenes.props.picnic`.)

Two details of the same scene. `paper` has as many vertices as the ants of Estalella et al. 2006: 14,859 as built and
30,153 after `refined` (14,969 and 30,133 here). `lean` is what the picture needs: about 8,500, three tenths of it eyes, without
SPARED, and drawn as it is built.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import trimesh

from benchharness.scene import Camera, Mesh, Motion, Object, Reflector, Scene, merged

from .props import insects, picnic
from .props.insects import Fineness
from .props.lean import without
from .props.shapes import Colour, placed, pose
from .props.ways import gently, mixed, way_to

DetailName = Literal["lean", "paper"]
EYES = 8

BRONZE_ETA = (2.866, 2.119, 1.940)
BRONZE_K = (3.032, 2.056, 1.616)
"""Complex index of refraction of vanadium nitride for red, green and blue (as used in Mitsuba's `VN`): a dark bronze."""


@dataclass(frozen=True)
class Detail:
    """How finely the scene is modelled.

    ants   vertices around their parts
    can    vertices around a can
    far    vertices around meadow and hills
    rings  vertices of the meadow from cloth to hills
    h_max  longest edge that is drawn, metres; None: as built
    """

    ants: Fineness
    can: int
    far: int
    rings: int
    h_max: float | None


DETAILS: dict[str, Detail] = {
    "lean": Detail(Fineness(body=12, leg=5, antenna=11, head=14, head_rings=10, eye=24, eye_rings=17), 12, 16, 4, 0.2),
    "paper": Detail(Fineness(body=16, leg=6, antenna=14, head=18, head_rings=12, eye=26, eye_rings=17), 28, 22, 5, 0.0875),
}

SPARED = "can-cola can-peas can-beans can-on-top can-lemon can-peach can-orange can-blue can-corn".split()
"""What the lean scene does without: with all of them or with none, no method's error differs by more than its interval. (The
eyes show little of the sugar and of three bodies, but the ants are around the one, and heads sit on the others.)"""

COUNCIL = np.array([0.0, -0.50, 0.0])
"""What all ants look at, metres."""
FRAMES, FPS = 100, 25.0


@dataclass(frozen=True)
class Place:
    """One of the four ants: bearing of its head from `COUNCIL`, degrees from +x; distance, height of its feet, metres."""

    name: str
    bearing_deg: float
    away: float
    height: float
    colour: Colour
    look: tuple[float, float]


PLACES = (
    Place("rust", 144.0, 0.41, 0.0, (0.46, 0.13, 0.05), (10.0, 2.0)),
    Place("chestnut", 108.0, 0.58, 0.10, (0.28, 0.10, 0.05), (-4.0, -8.0)),
    Place("black", 71.0, 0.48, 0.0, (0.11, 0.065, 0.05), (6.0, 6.0)),
    Place("amber", 35.0, 0.42, 0.0, (0.56, 0.24, 0.07), (-14.0, 3.0)),
)
NODS, WAVES = ("rust", "black"), "amber"
"""Whose heads nod, and whose antennae wave, if things move."""


def ant(detail: DetailName = "lean", eyes: int = EYES, *, moving: bool = True) -> Scene:
    """The ants.

    detail   how finely the scene is modelled, and how many cans are there
    eyes     how many of the eyes are mirrors, 1 to 8; the others are dark and dull, of the same shape
    moving   whether two heads nod, antennae wave and a can rolls

    Raises ValueError for anything else.
    """
    if detail not in get_args(DetailName):
        raise ValueError(f"ant: detail is {detail!r}; accepted: {', '.join(get_args(DetailName))}")
    if isinstance(eyes, bool) or not isinstance(eyes, int) or not 1 <= eyes <= EYES:
        raise ValueError(f"ant: eyes is {eyes!r}; accepted: whole numbers from 1 to {EYES}")
    if not isinstance(moving, bool):
        raise ValueError(f"ant: moving is {moving!r}; accepted: true or false")
    d = DETAILS[detail]
    objects: list[Object] = [
        picnic.cloth(),
        picnic.meadow(d.far, d.rings),
        picnic.hills(d.far + d.far // 2),
        picnic.clouds(max(6, d.can // 4)),
        picnic.sun(16, (48.0, 42.0, 34.0)),
        Object(
            "sugar",
            placed(picnic.sugar(), (COUNCIL[0] + 0.02, COUNCIL[1] + 0.09, 0)),
            "white lumps in front of all ants: straight edges that each eye bends in its own way",
        ),
        *_cans(d.can, moving=moving),
    ]
    mirrors: list[Reflector] = []
    for place in PLACES:
        parts, pair = _ant(place, d.ants, moving=moving)
        objects += parts
        for side, (mesh, motion) in zip(("left", "right"), pair, strict=True):
            name = f"{place.name}-eye-{side}"
            if len(mirrors) < eyes:
                mirrors.append(Reflector(name, mesh, None, BRONZE_ETA, BRONZE_K, motion))
            else:
                objects.append(Object(name, mesh, "an eye that mirrors nothing, in the place of one that does", motion))
    scene = Scene(
        name="ant",
        objects=without(objects, SPARED if detail == "lean" else ()),
        reflectors=tuple(mirrors),
        camera=Approach(),
        frames=FRAMES,
        fps=FPS,
        background=(0.36, 0.55, 0.90),
        exposure=0.0,
        detail=detail,
        h_max=d.h_max,
    )
    scene.source.update(detail=detail, eyes=eyes, moving=moving, base_vertices=scene.vertices, h_max=d.h_max)
    return scene


@dataclass(frozen=True)
class Approach:
    """The camera: sinks towards the ants' heads and goes around them a little, setting out and arriving gently."""

    azimuth_deg: tuple[float, float] = (-106.0, -90.0)
    elevation_deg: tuple[float, float] = (30.0, 15.0)
    distance: tuple[float, float] = (1.34, 1.04)
    target: tuple[float, float, float] = (0.0, -0.12, 0.155)
    duration: float = (FRAMES - 1) / FPS

    def __call__(self, time: float) -> Camera:
        s = gently(time, self.duration)
        way = way_to(mixed(self.azimuth_deg, s), mixed(self.elevation_deg, s))
        distance = mixed(self.distance, s)
        return Camera(tuple((np.asarray(self.target) + distance * way).tolist()), self.target, fov_deg=38.0)


@dataclass(frozen=True)
class Swing:
    """Turns to and fro about `axis` through `pivot`; as built at time 0."""

    pivot: tuple[float, float, float]
    axis: tuple[float, float, float]
    angle_deg: float
    period_s: float

    def __call__(self, time: float) -> np.ndarray:
        angle = np.radians(self.angle_deg) * np.sin(2 * np.pi * time / self.period_s)
        return trimesh.transformations.rotation_matrix(angle, self.axis, self.pivot)


@dataclass(frozen=True)
class Roll:
    """Rolls on z = 0 from `start`, the middle of a lying can, by `way` (x, y), at right angles to its axis."""

    start: tuple[float, float, float]
    way: tuple[float, float]
    duration: float = FRAMES / FPS

    def __call__(self, time: float) -> np.ndarray:
        share = float(np.clip(time / self.duration, 0.0, 1.0))
        length = float(np.hypot(*self.way))
        axis = [-self.way[1] / length, self.way[0] / length, 0.0]
        matrix = trimesh.transformations.rotation_matrix(share * length / self.start[2], axis, self.start)
        matrix[:2, 3] += share * np.asarray(self.way)
        return matrix


def _ant(place: Place, d: Fineness, *, moving: bool) -> tuple[list[Object], list[tuple[Mesh, Motion | None]]]:
    """The objects of an ant, and its eyes, left and right, each with its motion."""
    bearing = np.radians(place.bearing_deg)
    turn = place.bearing_deg + 90
    head = COUNCIL + place.away * np.array([np.cos(bearing), np.sin(bearing), 0])
    at = head + insects.HEAD_AT[1] * np.array([np.cos(bearing), np.sin(bearing), 0]) + [0, 0, place.height]
    feet = {name: (0.9 * x, 0.9 * y) for name, (x, y) in insects.FEET.items()} if place.height else insects.FEET
    made = insects.ant(pose(at, turn), d, place.colour, place.look, feet)
    neck, across = _triple(made.neck), _triple(made.across)
    nod: Motion | None = Swing(neck, across, 7.0, 2.0) if moving and place.name in NODS else None
    wave: Motion | None = Swing(neck, across, 5.0, 1.0) if moving and place.name == WAVES else nod
    name = place.name
    return [
        Object(f"{name}-body", made.body, f"the {name} ant's body and legs: a smooth shape on thin bent tubes", None),
        Object(f"{name}-head", made.head, "the head that the eyes grow out of: what a mirror touches", nod),
        Object(f"{name}-antennae", merged(*made.antennae), "thin bent tubes close in front of the eyes", wave),
    ], [(mesh, nod) for mesh in made.eyes]


def _triple(v: np.ndarray) -> tuple[float, float, float]:
    x, y, z = v.tolist()
    return x, y, z


RED, WHITE, BLUE, GOLD = (0.66, 0.05, 0.04), (0.84, 0.82, 0.78), (0.05, 0.16, 0.46), (0.80, 0.52, 0.08)
GREEN, ORANGE, TEAL, CREAM = (0.08, 0.34, 0.12), (0.84, 0.34, 0.05), (0.05, 0.38, 0.40), (0.80, 0.72, 0.55)
LABELS: dict[str, list[tuple[float, Colour]]] = {
    "cola": [(0.18, RED), (0.08, WHITE), (0.24, RED), (0.18, RED), (0.08, WHITE), (0.24, RED)],
    "lemon": [(0.16, GOLD), (0.09, GREEN), (0.25, GOLD), (0.16, GOLD), (0.09, GREEN), (0.25, GOLD)],
    "tonic": [(0.125, BLUE), (0.125, WHITE)] * 4,
    "soup": [(0.30, RED), (0.20, CREAM)] * 2,
    "peas": [(0.34, GREEN), (0.16, CREAM)] * 2,
    "beans": [(0.32, BLUE), (0.18, CREAM)] * 2,
    "peach": [(0.25, ORANGE), (0.25, CREAM)] * 2,
    "tuna": [(0.125, TEAL), (0.125, CREAM)] * 4,
    "orange": [(0.25, ORANGE), (0.25, WHITE)] * 2,
    "blue": [(0.4, BLUE), (0.1, GOLD)] * 2,
    "corn": [(0.3, GOLD), (0.2, GREEN)] * 2,
}
"""What is printed on the cans: shares of the circumference and their colours."""


def _stand(name: str, mesh: Mesh, x: float, y: float, turn_deg: float, shows: str) -> Object:
    return Object(name, placed(mesh, (x, y, -0.002), turn_deg), shows)


def _lie(name: str, mesh: Mesh, at: tuple[float, float], turn_deg: float, shows: str) -> Object:
    """A tin on its side."""
    return Object(name, picnic.lying(mesh, 0.103, *at, turn_deg, 20.0), shows)


def _cans(n: int, *, moving: bool) -> list[Object]:
    """Cans around the ants and behind the camera; one rolls."""
    place = PLACES[1]
    bearing = np.radians(place.bearing_deg)
    x, y = COUNCIL[:2] + (place.away + 0.21) * np.array([np.cos(bearing), np.sin(bearing)])
    roll = Roll((0.25, -0.64, 0.085), (0.18, 0.03))
    across = np.degrees(np.arctan2(roll.way[1], roll.way[0]))
    rolling = picnic.lying(picnic.soda(n, LABELS["tonic"]), 0.085, *roll.start[:2], across)
    return [
        _stand(
            "can-tuna",
            picnic.tin(n + n // 2, LABELS["tuna"], 0.245, place.height + 0.008),
            x,
            y,
            10,
            "a flat tin that the second ant stands on",
        ),
        _stand(
            "can-cola", picnic.soda(n, LABELS["cola"]), -0.60, 0.30, 0, "a tall red can behind the ants: long thin triangles"
        ),
        _stand("can-peas", picnic.tin(n, LABELS["peas"]), 0.02, 0.50, 30, "a green tin between the ants, half hidden by them"),
        _stand("can-beans", picnic.tin(n, LABELS["beans"]), 0.235, 0.56, -20, "a blue tin beside the green one"),
        Object(
            "can-on-top",
            placed(picnic.tin(n, LABELS["soup"]), (0.13, 0.535, 0.24), 55),
            "a tin on two others, against the hills",
        ),
        _stand("can-lemon", picnic.soda(n, LABELS["lemon"]), 0.52, 0.36, 60, "a tall yellow can behind the ants"),
        _lie("can-peach", picnic.tin(n, LABELS["peach"]), (0.80, 0.62), 60, "a tin that lies on its side, far right"),
        _stand(
            "can-soup", picnic.tin(n, LABELS["soup"]), -0.72, -0.62, 80, "a red and white tin beside the leftmost ant's eyes"
        ),
        _stand(
            "can-orange",
            picnic.soda(n, LABELS["orange"]),
            0.80,
            -0.62,
            20,
            "an orange can beside the rightmost ant's eyes",
        ),
        _stand(
            "can-blue",
            picnic.soda(n, LABELS["blue"]),
            -0.46,
            -1.20,
            0,
            "a blue can behind the camera, mirrored in all eyes",
        ),
        _lie(
            "can-corn",
            picnic.tin(n, LABELS["corn"]),
            (0.46, -1.26),
            75,
            "a lying yellow tin behind the camera, mirrored in all eyes",
        ),
        Object("can-rolling", rolling, "upright stripes that turn: a can that rolls, seen in eyes", roll if moving else None),
    ]
