"""The kitchen's table, and what stands on it beside the mirror."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchharness.scene import Mesh, Motion, Object, merged

from . import kitchen_room, kitchenware
from .shapes import bar, box, contact_sheet, placed, pose, tiles

TABLE = (-0.85, 0.85, -0.42, 0.62)
"""The table top: x from, to, y from, to, metres."""
HEIGHT = 0.75
"""Where the table top is, metres."""

RED, YELLOW, BLUE, GREEN = (0.62, 0.07, 0.05), (0.80, 0.58, 0.10), (0.08, 0.20, 0.42), (0.10, 0.30, 0.12)


@dataclass(frozen=True)
class Place:
    """Where a thing stands: x, y and the radius of its contact, metres; how it is turned, and how far above the top it is."""

    x: float
    y: float
    foot: float
    turn_deg: float = 0.0
    z: float = 0.0


@dataclass(frozen=True)
class Roll:
    """A ball of `radius` about the origin that rolls on the table, `start` to `end` (x, y), in `duration` seconds."""

    start: tuple[float, float]
    end: tuple[float, float]
    radius: float
    duration: float

    def __call__(self, time: float) -> np.ndarray:
        way = np.subtract(self.end, self.start) * np.clip(time / self.duration, 0.0, 1.0)
        length = float(np.linalg.norm(way))
        heading = np.degrees(np.arctan2(self.end[1] - self.start[1], self.end[0] - self.start[0]))
        turn = pose(turn_deg=heading + 90) @ pose(tilt_deg=np.degrees(length / self.radius)) @ pose(turn_deg=-heading - 90)
        return pose((self.start[0] + way[0], self.start[1] + way[1], HEIGHT + self.radius)) @ turn


@dataclass(frozen=True)
class Slide:
    """Slides on the table from `start` to `end` (x, y) in `duration` seconds, turned by `turn_deg` throughout."""

    start: tuple[float, float]
    end: tuple[float, float]
    turn_deg: float
    duration: float

    def __call__(self, time: float) -> np.ndarray:
        s = float(np.clip(time / self.duration, 0.0, 1.0))
        x, y = (1 - s) * np.asarray(self.start) + s * np.asarray(self.end)
        return pose((x, y, HEIGHT), self.turn_deg)


def table(spacing: float, feet: list[tuple[float, float, float]]) -> list[Object]:
    """The table, its cloth and its chairs. `spacing`: distance of base vertices on the top; `feet`: x, y and radius."""
    x0, x1, y0, y1 = TABLE
    top = contact_sheet((x0, y0), (x1, y1), HEIGHT, spacing, feet, kitchen_room.OAK)
    grain = 1.0 + 0.10 * np.sin(23.0 * top.vertices[:, 1:2] + 2.0 * np.sin(3.0 * top.vertices[:, :1]))
    top = Mesh(top.vertices, top.faces, top.normals, top.albedo * grain)
    wood, low = kitchen_room.DARK_OAK, HEIGHT - 0.035
    sides = box((x0, y0, low), (x1, y1, HEIGHT), kitchen_room.OAK, "+z -z", spacing)
    legs = [
        bar((x - 0.035, y - 0.035, 0), (x + 0.035, y + 0.035, low), wood)
        for x in (x0 + 0.08, x1 - 0.08)
        for y in (y0 + 0.08, y1 - 0.08)
    ]
    check = np.add.outer(np.arange(4), np.arange(6)) % 2
    cloth = np.where(check[..., None], (0.62, 0.10, 0.09), (0.80, 0.76, 0.68))
    seats = [placed(kitchen_room.chair(wood), at, turn) for at, turn in (((1.08, 0.15, 0), 90), ((-0.95, 0.95, 0), -150))]
    return [
        Object("table-top", top, "contact shadows around all that stands on it, the bowl's nearest surroundings"),
        Object("table-frame", merged(sides, *legs), "the table's edges and legs against the floor"),
        Object(
            "cloth",
            tiles((-0.80, -0.38, HEIGHT + 0.002), (0.42, 0, 0), (0, 0.28, 0), (6, 4), cloth),
            "a fine chequered pattern close to the bowl, where reflections are distorted most",
        ),
        Object("chairs", merged(*seats), "thin upright posts at middle distance"),
    ]


def things(n: int, duration: float, *, moving: bool) -> tuple[list[Object], dict[str, tuple[float, float, float]]]:
    """What stands on the table, and where, by name: x, y and radius of the contact.

    n         vertices around a can; other round things are scaled to it
    duration  of the animation, seconds
    moving    whether an orange rolls and a mug slides
    """
    objects, feet = [], {}
    for name, mesh, place, shows in _standing(n):
        objects.append(Object(name, placed(mesh, (place.x, place.y, HEIGHT + place.z), place.turn_deg), shows))
        if place.z == 0.0:
            feet[name] = (place.x, place.y, place.foot)
    for name, mesh, motion, foot, shows in _movable(n, duration):
        start = motion(0.0)
        objects.append(Object(name, mesh, shows, motion) if moving else Object(name, mesh.transformed(start), shows))
        feet[name] = (start[0, 3], start[1, 3], foot)
    return objects, feet


def _standing(n: int) -> list[tuple[str, Mesh, Place, str]]:
    """Name, mesh, place, and what it is there to show."""
    k = kitchenware
    kettle, cup, apple = k.kettle(n, (0.60, 0.12, 0.06)), k.mug(n, (0.20, 0.42, 0.34)), k.apple(n, (0.36, 0.45, 0.08))
    orange = placed(k.orange(n), (0, 0, 0.04))
    return [
        ("can-red", k.can(n, RED, k.WHITE), Place(0.45, 0.24, 0.042), "a red can with a white band, right of the bowl"),
        ("can-yellow", k.can(n, YELLOW, GREEN), Place(0.57, 0.13, 0.042), "a yellow can with a green band, right of the bowl"),
        ("can-blue", k.can(n, BLUE, YELLOW), Place(0.44, 0.06, 0.042), "a blue can with a yellow band, close to the bowl"),
        ("kettle", kettle, Place(-0.55, 0.36, 0.104, -35), "a red kettle: large, round, with thin parts"),
        ("bottle", k.bottle(n), Place(0.68, 0.42, 0.036), "a tall dark bottle that stretches along the mirror's rim"),
        ("mug-green", cup, Place(-0.40, 0.12, 0.04, 200), "a mug with a handle left of the bowl"),
        ("plate", k.plate(n, BLUE), Place(-0.62, -0.22, 0.075, z=0.003), "a flat round thing with a coloured rim"),
        ("apple-one", k.apple(n), Place(-0.65, -0.20, 0.02, z=0.0105), "a round red thing with a bright and a dark side"),
        ("apple-two", apple, Place(-0.56, -0.24, 0.02, 80, 0.0105), "a green apple beside the red one"),
        ("banana", k.banana(n), Place(0.60, -0.20, 0.02, 25), "a bent thing whose bend the mirror changes"),
        ("orange-two", orange, Place(0.36, -0.30, 0.012), "a second orange, farther from the bowl"),
    ]


def _movable(n: int, duration: float) -> list[tuple[str, Mesh, Motion, float, str]]:
    """Name, mesh, motion, radius of the contact, and what it is there to show."""
    rolls, slides = Roll((-0.24, -0.26), (0.22, -0.30), 0.04, duration), Slide((0.40, -0.12), (0.72, -0.02), -40, duration)
    mug = kitchenware.mug(n, (0.80, 0.74, 0.62))
    plain = "a plain bright ball in front of the bowl; rolls to the right if things move"
    return [
        ("orange", kitchenware.orange(n), rolls, 0.012, plain),
        ("mug-white", mug, slides, 0.04, "a pale mug right of the bowl; slides away if things move"),
    ]
