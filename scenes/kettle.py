"""A metal kettle on a table and the hand of a figure who comes near and touches it: the scene of Roger and Holzschuch.

After figures 1, 8 and 9 of Roger and Holzschuch 2006, the three things that an environment map cannot show: a hand that
comes near and meets its own image (`touch`), a handle that starts from the mirror itself, and the back of a chair that
is seen from the front of the kettle but not from its axis. The chair stands beside the picture: the rear of its back is
in view of the camera in no frame, and seen in the kettle's right side in all of them. (It could not be hidden by
facing away: a plane that has both the eye and a sphere's centre behind it has all the sphere's points that mirror it
to that eye behind it, too.)

The mirror is the kettle's body with its lid (`kettle_body`); handle, spout and knob are diffuse and touch it. The jug
beside it (`GLOSSY`) is glazed: a point light on the right gives it a highlight that moves with the one who
looks, and so is elsewhere in the mirror.

The paper states no vertex count for this scene, only that its method serves up to 40,000 polygons. `paper` is made for
that size: 20,000 vertices (33,000 triangles) as built and about 30,000 (50,000) after `refined`. `lean` is what the
picture needs: about 10,000, 3,900 of them the kettle's, without SPARED, and drawn as it is built. The chair stays out of
pictures that are at most 1.4 times as wide as high.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from benchharness.scene import Camera, Gloss, Mesh, Object, PointLight, Scene, merged

from .props import kettle_body, kettle_figure, kettle_room, kitchen_room, kitchenware
from .props.kettle_room import CLOTH, HEIGHT
from .props.lean import without
from .props.shapes import Colour, arc, ball, lathe, placed, tube
from .props.ways import gently, mixed, way_to

DetailName = Literal["lean", "paper"]


@dataclass(frozen=True)
class Detail:
    """How finely the scene is modelled.

    near   vertices around a can on the table; what else is round is scaled to it
    hand   vertices around the palm
    table  distance of base vertices on the table top, metres; closer around what stands there
    wall   distance of base vertices on walls and ceiling, metres
    h_max  longest edge that is drawn, metres; None: as built
    """

    near: int
    hand: int
    table: float
    wall: float
    h_max: float | None


DETAILS: dict[str, Detail] = {
    "lean": Detail(near=12, hand=12, table=0.14, wall=0.6, h_max=None),
    "paper": Detail(near=26, hand=22, table=0.031, wall=0.22, h_max=0.2),
}

SPARED = "lamp-rod cup plate fruit vase".split()
"""What the lean scene does without: with all of them or with none, no method's error differs by more than its interval. (The
kettle shows little of its trivet and of the arm, and nothing of the table's frame; but they hold what is seen.)"""

GLAZE = Gloss((0.4, 0.4, 0.4), 60.0)
LIGHT = PointLight((0.62, -0.62, 1.15), (0.9, 0.85, 0.75))
GLOSSY = "jug"
"""The object that looks glazed."""
TRIVET = 0.012
"""Height of what the kettle stands on, metres."""
CENTRE = (0.0, 0.0, HEIGHT + CLOTH + TRIVET + kettle_body.FOOT)
"""The origin of the body's support function: on its axis, 117 mm over its lowest point."""
FRAMES, FPS = 100, 25.0
TOUCH_FRAME = 60
"""The first frame in which the nail is on the kettle."""
TOUCH_VERTEX = (27, 54)
"""Ring (from the bottom) and segment (from +x) of the body's vertex that is touched: normal 20° up, 216° around."""

FIGURE, FIGURE_DEG = (-0.66, 0.27, 0.0), -24.0
"""Where the figure sits, and where it looks: azimuth, degrees."""


def kettle(detail: DetailName = "lean", *, moving: bool = True) -> Scene:
    """The kettle.

    detail   how finely it is modelled, and how many things are there
    moving   whether the hand comes from 0.2 m away; otherwise it rests where it touches

    Raises ValueError for anything else.
    """
    if detail not in get_args(DetailName):
        raise ValueError(f"kettle: detail is {detail!r}; accepted: {', '.join(get_args(DetailName))}")
    if not isinstance(moving, bool):
        raise ValueError(f"kettle: moving is {moving!r}; accepted: true or false")
    d = DETAILS[detail]
    spared = SPARED if detail == "lean" else []
    things, feet = _on_the_table(d.near)
    standing = [foot for name, foot in feet.items() if name not in spared]
    scene = Scene(
        name="kettle",
        objects=without(
            (
                *kettle_room.shell(d.wall),
                *kettle_room.pictures(),
                *kitchen_room.window(14.0),
                *kitchen_room.lamp((15.0, 12.0, 8.0), d.near),
                *kettle_room.table(d.table, standing),
                *kettle_room.chair(),
                *things,
                *kettle_figure.sitter(d.near, FIGURE, FIGURE_DEG),
                *_arm(d.hand, moving=moving),
                *kettle_body.attached(CENTRE, d.near),
            ),
            spared,
        ),
        reflectors=(kettle_body.body(CENTRE),),
        camera=Orbit(),
        frames=FRAMES,
        fps=FPS,
        lights=(LIGHT,),
        exposure=0.25,
        detail=detail,
        h_max=d.h_max,
    )
    scene.source.update(detail=detail, moving=moving, base_vertices=scene.vertices, h_max=d.h_max)
    return scene


def touch() -> tuple[np.ndarray, int]:
    """Where the nail touches the kettle, and from which frame on.

    Returns the world point, float64 [3], metres: a vertex of the mirror, so that it is on its true surface and on its
    triangles; and the first frame of the contact, which lasts to the last frame. With `moving=False` the contact is
    there in all frames. In the picture, the gap between the nail and its image is twice the nail's distance from the
    surface, seen from the side, and closes to nothing at this point.
    """
    return kettle_body.vertex(*TOUCH_VERTEX, CENTRE)[0], TOUCH_FRAME


@dataclass(frozen=True)
class Orbit:
    """The camera: goes around the kettle to the left and draws a little nearer, setting out and arriving gently.

    From and to are azimuth and elevation (degrees) and distance (metres) of the eye from `target`.
    """

    target: tuple[float, float, float] = (-0.08, 0.0, CENTRE[2] + 0.030)
    azimuth_deg: tuple[float, float] = (-78.0, -98.0)
    elevation_deg: tuple[float, float] = (13.0, 17.0)
    distance: tuple[float, float] = (0.71, 0.57)
    duration: float = (FRAMES - 1) / FPS

    def __call__(self, time: float) -> Camera:
        s = gently(time, self.duration)
        way = way_to(mixed(self.azimuth_deg, s), mixed(self.elevation_deg, s))
        eye = np.asarray(self.target) + mixed(self.distance, s) * way
        return Camera(tuple(eye.tolist()), self.target, fov_deg=42.0)


def reach(hand: Mesh) -> kettle_figure.Reach:
    """The way of the hand to the kettle, so that the tip of its nail arrives at the point of `touch`."""
    x = np.array([0.985, 0.02, -0.17])
    x /= np.linalg.norm(x)
    roll = np.radians(38.0)
    y = np.cross([0, 0, 1.0], x)
    y /= np.linalg.norm(y)
    z = np.cross(x, y)
    turn = np.stack([x, np.cos(roll) * y + np.sin(roll) * z, np.cos(roll) * z - np.sin(roll) * y], axis=1)
    wrist = touch()[0] - turn @ hand.vertices[kettle_figure.tip(hand)]
    rows: tuple = tuple(map(tuple, turn.tolist()))
    away = (-0.15, -0.06, 0.12)
    return kettle_figure.Reach(tuple(wrist.tolist()), rows, away, start=4 / FPS, arrival=TOUCH_FRAME / FPS)


def _arm(n: int, *, moving: bool) -> list[Object]:
    hand = kettle_figure.hand(n)
    path, joint = reach(hand), kettle_figure.shoulder(FIGURE, FIGURE_DEG)
    out = (-0.1, -0.8, -0.45)
    parts = [
        (
            "upper-arm",
            kettle_figure.upper_arm(n),
            "joins hand and figure in the mirror",
            kettle_figure.Arm(path, joint, out, fore=False),
        ),
        (
            "forearm",
            kettle_figure.forearm(n),
            "leads from the picture's edge to the hand",
            kettle_figure.Arm(path, joint, out, fore=True),
        ),
        ("hand", hand, "comes near and touches the mirror with a red nail, whose tip meets its own image", path),
    ]
    return [
        Object(name, mesh, shows, motion) if moving else Object(name, mesh.transformed(motion(path.arrival)), shows)
        for name, mesh, shows, motion in parts
    ]


def _jug(n: int, colour: Colour) -> Mesh:
    """A small glazed milk jug, round-bellied, white inside, its handle towards +x."""
    outside = [
        (0.030, 0),
        (0.041, 0.014),
        (0.047, 0.032),
        (0.0465, 0.047),
        (0.040, 0.065),
        (0.033, 0.080),
        (0.032, 0.090),
        (0.037, 0.102),
    ]
    inside = [(0.0345, 0.102), (0.029, 0.088), (0.036, 0.060), (0.030, 0.025), (0, 0.020)]
    count = len(outside) + len(inside) - 1
    pot = lathe(
        outside + inside,
        n + n // 2,
        [colour] * (len(outside) - 1) + [kitchenware.WHITE] * (count - len(outside) + 1),
        sharp_deg=75,
    )
    grip = tube(
        arc((0.036, 0, 0.062), (0.034, 0, 0), (0, 0, 0.028), -84, 84, max(7, n // 2 + 2)), 0.0052, max(6, n // 3), colour
    )
    return merged(pot, grip)


def _vase(n: int) -> Mesh:
    """A blue vase with three tulips."""
    profile = [(0.030, 0), (0.046, 0.025), (0.050, 0.055), (0.040, 0.095), (0.020, 0.130), (0.024, 0.150), (0, 0.146)]
    parts = [lathe(profile, n, (0.09, 0.20, 0.44), sharp_deg=75)]
    green, petals = (0.10, 0.28, 0.07), [(0.78, 0.10, 0.12), (0.84, 0.52, 0.06), (0.80, 0.30, 0.42)]
    for (x, y, z), colour in zip([(-0.055, 0.01, 0.27), (0.05, -0.03, 0.25), (0.015, 0.045, 0.30)], petals, strict=True):
        stem = [(0.15 * x, 0.15 * y, 0.13), (0.45 * x, 0.45 * y, 0.20), (x, y, z)]
        parts.append(tube(stem, 0.0035, max(5, n // 3), green))
        cup = lathe(
            [(0.004, -0.004), (0.021, 0.008), (0.024, 0.024), (0.017, 0.046), (0, 0.040)],
            max(8, 2 * n // 3),
            colour,
            sharp_deg=75,
        )
        parts.append(placed(cup, (x, y, z), tilt_deg=-400 * y))
    return merged(*parts)


def _on_the_table(n: int) -> tuple[list[Object], dict[str, tuple[float, float, float]]]:
    """What stands on the table, and by name x, y and radius of its contact where it stands on the wood."""
    blue = (0.10, 0.24, 0.45)
    trivet = lathe([(0.084, 0), (0.087, 0.006), (0.084, TRIVET), (0.04, TRIVET), (0, TRIVET)], 2 * n, (0.44, 0.27, 0.13))
    saucer = kitchenware.plate(n, (0.75, 0.55, 0.12), radius=0.072)
    cup = placed(kitchenware.mug(n, (0.82, 0.62, 0.16), radius=0.037, height=0.072), (0, 0, 0.008), 215)
    dish = (-0.16, 0.40)
    fruit = [
        placed(kitchenware.apple(n), (dish[0] - 0.045, dish[1] - 0.03, HEIGHT + 0.0075), 40),
        placed(kitchenware.apple(n, (0.36, 0.45, 0.08)), (dish[0] + 0.015, dish[1] + 0.052, HEIGHT + 0.0075), 200),
        placed(ball(0.037, n, max(6, n // 2 + 1), (0.85, 0.36, 0.04)), (dish[0] + 0.045, dish[1] - 0.028, HEIGHT + 0.0445)),
    ]
    plate = kitchenware.plate(n, blue, radius=0.125)
    on_cloth = HEIGHT + CLOTH
    objects = [
        Object("trivet", placed(trivet, (0, 0, on_cloth)), "a cork mat on which the mirror stands: the lower contact"),
        Object("cup", placed(merged(saucer, cup), (-0.41, -0.05, HEIGHT)), "a yellow cup whose handle shows how it is turned"),
        Object("plate", placed(plate, (*dish, HEIGHT)), "a flat round thing with a blue rim, seen beside and in the kettle"),
        Object("fruit", merged(*fruit), "round bright things behind the kettle, mirrored near its outline"),
        Object("vase", placed(_vase(n), (0.19, 0.42, HEIGHT)), "thin stems and bright heads against the wall"),
        Object(
            GLOSSY,
            placed(_jug(n, (0.07, 0.20, 0.42)), (-0.145, -0.180, on_cloth), -130),
            "a glazed thing close to the kettle: its highlight is where the one who looks sees it",
            gloss=GLAZE,
        ),
    ]
    return objects, {"cup": (-0.41, -0.05, 0.042), "plate": (*dish, 0.072), "vase": (0.19, 0.42, 0.03)}
