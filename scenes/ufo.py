"""A flying saucer lands in a city square, between houses, while (in `paper` detail) trucks drive through.

The saucer (`scenes.props.saucer`) is the mirror: closed, smooth, large in the picture and moving. Its lower side shows the
square like a bent map: the rosette it lands on, the road with its trucks, the houses all around (`scenes.props.city`,
`scenes.props.street`). Ground, parasols, onlookers and trucks come within a few metres of it, so that where a reflection comes
from matters as much as its direction.

Two details of the same square. `paper` has as many vertices as the city of Estalella et al. 2006: 63,884 as built and
81,977 after `refined`, within 1 %. `lean` is what the picture needs: about 15,000, 5,338 of them the hull's, without SPARED,
and drawn as it is built.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from benchharness.scene import Camera, Mesh, Motion, Object, Scene, merged

from .props import city, saucer, street
from .props.lean import without
from .props.shapes import Colour, lathe, placed

DetailName = Literal["lean", "paper"]


@dataclass(frozen=True)
class Detail:
    """How finely the square is modelled.

    near      vertices around a truck's wheel; other round things near the saucer are scaled to it
    far       the same for trees and lamps along the houses
    hull      vertices around the saucer and from pole to pole
    tile      edge of a paving stone, metres
    road      distance of base vertices on roads and pavements, metres
    wall      the same on houses
    sills     whether windows towards the square have sills and two panes
    body      the same on trucks
    h_max     longest edge that is drawn, metres; None: as built
    """

    near: int
    far: int
    hull: tuple[int, int]
    tile: float
    road: float
    wall: float
    sills: bool
    body: float
    h_max: float | None


DETAILS: dict[str, Detail] = {
    "lean": Detail(near=8, far=6, hull=(92, 60), tile=1.0, road=3.0, wall=5.0, sills=False, body=2.6, h_max=None),
    "paper": Detail(near=28, far=18, hull=(120, 84), tile=0.34, road=1.2, wall=1.0, sills=True, body=0.3, h_max=1.2),
}

SPARED = "kerb road-lines fountain lamps parasols garlands benches cars truck-red truck-tanker truck-flatbed".split()
"""What the lean square does without: with all of them or with none, no method's error differs by more than its interval. (Trees
and people would be missed as little, but not with all the rest; the saucer stands on the legs, and the sun lights it.)"""

FRAMES, FPS = 100, 25.0
STILL_S = (FRAMES - 1) / FPS
"""The moment at which everything stands if nothing moves: the saucer has landed."""
SKY = (0.36, 0.52, 0.80)
"""Radiance of the clear sky."""
SUN_AT = (-84.0, -62.0, 92.0)
SUN_RADIUS = 14.0
SUN_RADIANCE = (69.0, 59.0, 44.0)
"""The sun: wider and dimmer than the real one, so that its few pixels in the mirror do not outweigh all others.
About 2 W/m² of irradiance on a surface that faces it, beside the sky's 1.1 to 2.5 on the ground."""


def ufo(detail: DetailName = "lean", *, moving: bool = True) -> Scene:
    """The square.

    detail   how finely it is modelled, and how many things are there
    moving   whether the saucer comes down and what trucks are there drive; else it has landed and they have stopped

    Raises ValueError for anything else.
    """
    if detail not in get_args(DetailName):
        raise ValueError(f"ufo: detail is {detail!r}; accepted: {', '.join(get_args(DetailName))}")
    if not isinstance(moving, bool):
        raise ValueError(f"ufo: moving is {moving!r}; accepted: true or false")
    d = DETAILS[detail]
    descent = saucer.Descent()
    flight: Motion = descent if moving else Held(descent, STILL_S)
    scene = Scene(
        name="ufo",
        objects=without(
            (
                *city.ground(d.tile, d.road),
                *city.houses(d.wall, sills=d.sills),
                *_greenery(d),
                *_furniture(d),
                *_people(d),
                *_trucks(d, moving=moving),
                *_on_the_saucer(d, flight),
                _sun(),
            ),
            SPARED if detail == "lean" else (),
        ),
        reflectors=(saucer.reflector(*d.hull, flight),),
        camera=Approach(flight),
        frames=FRAMES,
        fps=FPS,
        background=SKY,
        exposure=0.0,
        detail=detail,
        h_max=d.h_max,
    )
    scene.source.update(detail=detail, moving=moving, base_vertices=scene.vertices, h_max=d.h_max)
    return scene


@dataclass(frozen=True)
class Held:
    """A motion stopped at `at_s` seconds."""

    motion: Motion
    at_s: float

    def __call__(self, time: float) -> np.ndarray:
        return self.motion(self.at_s)


@dataclass(frozen=True)
class Approach:
    """The camera: from above the road it comes down to the height of the onlookers, its eyes on the saucer.

    It sets out looking `below` the saucer, so that both it and the square are in the picture, arrives after `arrive_s` and
    goes on sideways all the time, `drift` metres in all.
    """

    flight: Motion
    start: tuple[float, float, float] = (5.8, -17.0, 6.4)
    end: tuple[float, float, float] = (1.2, -9.7, 2.0)
    below: tuple[float, float] = (2.4, 0.1)
    drift: float = -1.4
    arrive_s: float = 2.6

    def __call__(self, time: float) -> Camera:
        s = float(np.clip(time / self.arrive_s, 0.0, 1.0))
        s = s * s * (3 - 2 * s)
        eye = (1 - s) * np.asarray(self.start) + s * np.asarray(self.end) + [self.drift * time / STILL_S, 0.0, 0.0]
        target = self.flight(time)[:3, 3] - [0.0, 0.0, (1 - s) * self.below[0] + s * self.below[1]]
        return Camera(tuple(eye.tolist()), tuple(target.tolist()), fov_deg=46.0)


def _sun() -> Object:
    """A disc that faces the square, at a finite distance: near enough to parallel light."""
    disc = lathe([(SUN_RADIUS, 0), (0, 0)], 12, (0.05, 0.05, 0.05))
    way = -np.asarray(SUN_AT) / np.linalg.norm(SUN_AT)
    azimuth = np.degrees(np.arctan2(way[1], way[0]))
    tilt = np.degrees(np.arccos(way[2]))
    mesh = placed(disc, SUN_AT, azimuth + 90.0, tilt)
    mesh = Mesh(mesh.vertices, mesh.faces, mesh.normals, mesh.albedo, SUN_RADIANCE)
    return Object("sun", mesh, "light from one side, which tells fronts from sides, and a glint on the hull")


def _greenery(d: Detail) -> list[Object]:
    places = [(-14.4, -17.0), (-14.4, -1.5), (14.5, -9.0), (14.5, 0.5), (-10.5, 14.0), (-1.0, 14.1), (9.0, 14.0), (3.0, -20.1)]
    trees = [placed(street.tree(d.far, k, 5.4 + 0.7 * ((7 * k) % 3)), (x, y, 0), 40.0 * k) for k, (x, y) in enumerate(places)]
    return [Object("trees", merged(*trees), "round green things before the fronts all around")]


def _furniture(d: Detail) -> list[Object]:
    lamps = [(x, y) for x in (-6.8, 6.8) for y in (-12.3, -5.0, 6.3)] + [(x, 13.6) for x in (-13.0, -5.5, 4.0, 13.0)]
    cars = [
        ((12.6, -5.5), 90, (0.55, 0.05, 0.04)),
        ((12.6, -10.2), 90, (0.10, 0.22, 0.42)),
        ((1.5, -18.0), 0, (0.70, 0.60, 0.14)),
    ]
    parasols = [((-6.1, 2.6), (0.62, 0.08, 0.06)), ((-6.0, -1.6), (0.07, 0.22, 0.50)), ((5.9, 3.3), (0.80, 0.52, 0.06))]
    benches = [((6.4, -3.0), 90), ((6.4, 0.2), 90), ((3.0, 6.4), 0), ((-3.0, 6.4), 0)]
    return [
        Object("fountain", placed(street.fountain(d.near), (-4.4, -9.2, 0)), "water and stone rings in the island's corner"),
        Object(
            "lamps",
            merged(*(placed(street.lamp_post(d.far), (*at, 0)) for at in lamps)),
            "thin posts, which the hull bends into hooks",
        ),
        Object(
            "parasols",
            merged(*(placed(street.parasol(d.near, colour), (*at, 0)) for at, colour in parasols)),
            "striped cones beside the saucer, just below its rim",
        ),
        Object(
            "garlands",
            merged(
                street.garland((-15.4, -7.5, 12.6), (15.4, -7.0, 12.6), 0.9, 24),
                street.garland((-15.4, 10.0, 12.8), (15.4, 10.5, 12.8), 0.7, 24),
            ),
            "coloured pennants high above: their rows are bows before the sky in the upper hull",
        ),
        Object(
            "benches",
            merged(*(placed(street.bench(), (*at, 0), turn) for at, turn in benches)),
            "slats close together at the island's edge",
        ),
        Object(
            "cars",
            merged(*(placed(street.car(d.far, colour), (*at, -city.KERB), turn) for at, turn, colour in cars)),
            "small coloured boxes parked along the road",
        ),
    ]


def _people(d: Detail) -> list[Object]:
    coats: list[Colour] = [
        (0.60, 0.07, 0.06),
        (0.80, 0.66, 0.20),
        (0.10, 0.24, 0.50),
        (0.75, 0.73, 0.70),
        (0.12, 0.34, 0.18),
        (0.55, 0.22, 0.40),
    ]
    places = [(-3.6, -5.2), (-2.7, -5.7), (3.9, -4.6), (5.2, -1.0), (-5.2, 4.6), (4.6, 5.2)]
    people = [
        placed(
            street.person(d.near, coats[k], ((0.10, 0.12, 0.18), (0.25, 0.20, 0.14))[k % 2], 1.62 + 0.05 * (k % 4)),
            (x, y, 0),
            float(np.degrees(np.arctan2(-y, -x))),
        )
        for k, (x, y) in enumerate(places)
    ]
    return [Object("people", merged(*people), "onlookers around the landing place: small upright figures close to the hull")]


def _trucks(d: Detail, *, moving: bool) -> list[Object]:
    n, low = d.near, -city.KERB
    trucks = [
        (
            "truck-red",
            street.box_truck(n, (0.58, 0.05, 0.04), (0.58, 0.05, 0.04), d.body),
            street.Drive((-9.0, -20.0), 90.0, 7.0, low, straight_m=22.5, radius_m=6.0, turn_deg=-90.0),
            "a red and white van that comes from the south, passes on the left and turns behind the saucer",
        ),
        (
            "truck-tanker",
            street.tanker(n, (0.06, 0.20, 0.46), (0.06, 0.34, 0.56)),
            street.Drive((21.0, 11.5), 180.0, 6.5, low),
            "a tanker that crosses behind the saucer, seen beside its own image",
        ),
        (
            "truck-flatbed",
            street.flatbed(n, (0.82, 0.52, 0.05), d.body),
            street.Drive((20.0, -14.5), 180.0, 5.5, low),
            "a yellow lorry behind the camera, seen in the mirror alone",
        ),
    ]
    return [
        Object(name, mesh, shows, drive) if moving else Object(name, mesh.transformed(drive(STILL_S)), shows)
        for name, mesh, drive, shows in trucks
    ]


def _on_the_saucer(d: Detail, flight: Motion) -> list[Object]:
    return [
        Object("legs", saucer.legs(d.near), "where the saucer stands, and the nearest things that its hull mirrors", flight),
        Object(
            "saucer-lamps",
            saucer.lamps(max(8, d.near // 2)),
            "beads that show that the saucer turns, and touch their images",
            flight,
        ),
    ]
