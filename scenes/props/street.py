"""What stands and drives on a city square, each thing on z = 0 around the origin, as large as the real one (metres).

Vehicles head for +x. `n` is the number of vertices around a wheel; everything round is scaled to it. What is hidden by
whatever a thing stands on is left out; all else is closed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from benchharness.scene import Mesh, merged

from ..props.shapes import Colour, arc, ball, bar, box, lathe, placed, pose, tube

RUBBER: Colour = (0.05, 0.05, 0.055)
RIM: Colour = (0.55, 0.55, 0.56)
DARK: Colour = (0.09, 0.09, 0.10)
WINDOW: Colour = (0.06, 0.09, 0.12)
WHITE: Colour = (0.82, 0.80, 0.76)
LAMP: Colour = (0.85, 0.80, 0.60)
IRON: Colour = (0.08, 0.12, 0.10)
BARK: Colour = (0.20, 0.13, 0.08)
WATER: Colour = (0.16, 0.36, 0.44)
MARBLE: Colour = (0.66, 0.63, 0.57)


@dataclass(frozen=True)
class Drive:
    """Rolls along a street: straight, then a bend of `turn_deg` (left is positive), then straight on.

    start    x and y at time 0, metres
    z        height of the ground
    """

    start: tuple[float, float]
    heading_deg: float
    speed_ms: float
    z: float
    straight_m: float = 1e9
    radius_m: float = 5.0
    turn_deg: float = 0.0

    def __call__(self, time: float) -> np.ndarray:
        way = self.speed_ms * time
        bend = np.radians(abs(self.turn_deg)) * self.radius_m
        before = min(way, self.straight_m)
        turned = np.clip(way - self.straight_m, 0.0, bend) / self.radius_m
        after = max(0.0, way - self.straight_m - bend)
        side = np.sign(self.turn_deg)
        # In the vehicle's first frame: x ahead, y to the left.
        x = before + self.radius_m * np.sin(turned) + after * np.cos(turned)
        y = side * (self.radius_m * (1 - np.cos(turned)) + after * np.sin(turned))
        h = np.radians(self.heading_deg)
        at = (self.start[0] + x * np.cos(h) - y * np.sin(h), self.start[1] + x * np.sin(h) + y * np.cos(h), self.z)
        return pose(at, self.heading_deg + float(np.degrees(side * turned)))


def _wheel(n: int, radius: float, width: float) -> Mesh:
    """A wheel with its axle along y through the origin, its rim towards -y."""
    r, w = radius, 0.5 * width
    hub = lathe([(0, -w), (r, -w), (r, w), (0.58 * r, w), (0, 0.5 * w)][::1], n, [RUBBER, RUBBER, RUBBER, RIM])
    return placed(hub, tilt_deg=90)


def _wheels(n: int, radius: float, width: float, xs: list[float], half: float) -> list[Mesh]:
    wheel = _wheel(n, radius, width)
    return [placed(wheel, (x, side * half, radius), 0 if side < 0 else 180) for x in xs for side in (-1, 1)]


def _cab(n: int, colour: Colour, x0: float, x1: float, top: float) -> list[Mesh]:
    """A driver's cab between x0 and x1, with windscreen, side windows, bumper and lamps."""
    glass = WINDOW
    round_lamp = placed(lathe([(0.13, 0), (0.13, 0.03), (0, 0.06)], max(6, n // 2), LAMP), tilt_deg=90, turn_deg=90)
    middle = 0.5 * (x0 + x1)
    return [
        box((x0, -1.15, 0.55), (x1, 1.15, top), colour, "", 0.8, 0.10),
        box((x1 - 0.02, -0.98, 1.65), (x1 + 0.02, 0.98, top - 0.3), glass, "-x", 0.8, 0.015),
        *(box((middle - 0.35, y - 0.02, 1.65), (x1 - 0.2, y + 0.02, top - 0.3), glass, "", 0.8, 0.01) for y in (-1.15, 1.15)),
        box((x1 - 0.05, -1.18, 0.42), (x1 + 0.14, 1.18, 0.75), DARK, "", 0.8, 0.04),
        box((x1 - 0.02, -0.6, 0.95), (x1 + 0.03, 0.6, 1.35), DARK, "-x", 0.8, 0.01),
        *(placed(round_lamp, (x1, y, 1.0)) for y in (-0.88, 0.88)),
        *(bar((x1 - 0.1, y - 0.12, 1.75), (x1 - 0.02, y + 0.12, 2.2), DARK) for y in (-1.32, 1.32)),
    ]


def _chassis(n: int, x0: float, x1: float, axles: list[float]) -> list[Mesh]:
    return [box((x0, -0.9, 0.5), (x1, 0.9, 0.8), DARK, "", 1.0, 0.03), *_wheels(n, 0.5, 0.34, axles, 0.98)]


def box_truck(n: int, cab: Colour, stripe: Colour, spacing: float) -> Mesh:
    """A removal van: a white box with a broad stripe, behind a coloured cab."""
    lo, hi = (-3.7, -1.2, 0.85), (1.35, 1.2, 3.3)
    cargo = box(lo, hi, WHITE, "", spacing, 0.05)
    bands = []
    for side in (-1, 1):
        y = side * 1.21
        for x0, x1, z0, z1 in ((-3.4, 1.1, 1.3, 1.75), (-3.4, -0.4, 1.95, 2.8)):
            band = box((x0, min(y, side * 1.2), z0), (x1, max(y, side * 1.2), z1), stripe, "+y" if side < 0 else "-y", spacing)
            bands.append(band)
    doors = [bar((-3.74, y - 0.02, 1.0), (-3.70, y + 0.02, 3.2), DARK) for y in (-0.4, 0.4)]
    red = [bar((-3.76, y - 0.15, 0.62), (-3.68, y + 0.15, 0.76), (0.60, 0.03, 0.03)) for y in (-0.85, 0.85)]
    return merged(cargo, *bands, *doors, *red, *_cab(n, cab, 1.5, 3.3, 2.7), *_chassis(n, -3.7, 3.0, [-2.3, 2.3]))


def tanker(n: int, cab: Colour, tank: Colour) -> Mesh:
    """A milk tanker: a round tank with a coloured belt, lying on the chassis."""
    r, x0, x1 = 1.1, -3.7, 1.2
    outline = [(0, 0), (0.75 * r, 0.08), (r, 0.35)]
    ends = [(x1 - x0 - z) for _, z in outline][::-1]
    belt = 0.5 * (x1 - x0)
    mid = [(r, belt - 0.5), (r, belt + 0.5)]
    path = [*outline, *mid, *zip([q[0] for q in outline][::-1], ends, strict=True)]
    long = lathe(path, 2 * n, [WHITE, WHITE, WHITE, tank, WHITE, WHITE, WHITE], sharp_deg=60)
    body = placed(placed(long, (0, 0, x0), tilt_deg=0), (0, 0, 0), 90, 90)
    body = Mesh(body.vertices * [1, 1, 1] + [0, 0, 0.85 + r], body.faces, body.normals, body.albedo)
    hatch = [placed(lathe([(0.3, 0), (0.3, 0.18), (0, 0.2)], n, RIM), (x, 0, 0.85 + 2 * r - 0.03)) for x in (-2.6, -1.2, 0.2)]
    rail = [
        tube([(x0 + 0.3, y, 0.85 + r + 0.1), (x1 - 0.3, y, 0.85 + r + 0.1)], 0.05, max(5, n // 3), tank) for y in (-1.13, 1.13)
    ]
    return merged(body, *hatch, *rail, *_cab(n, cab, 1.5, 3.3, 2.7), *_chassis(n, -3.7, 3.0, [-2.9, -1.6, 2.3]))


def flatbed(n: int, cab: Colour, spacing: float) -> Mesh:
    """A lorry with low boards, loaded with crates and barrels."""
    wood, board = (0.46, 0.29, 0.14), (0.10, 0.32, 0.20)
    bed = [
        box((-3.7, -1.2, 0.85), (1.3, 1.2, 1.0), wood, "", spacing, 0.02),
        *(box((-3.7, y - 0.03, 1.0), (1.3, y + 0.03, 1.5), board, "-z", spacing, 0.015) for y in (-1.17, 1.17)),
        *(box((x - 0.03, -1.14, 1.0), (x + 0.03, 1.14, 1.5), board, "-z", spacing, 0.015) for x in (-3.67, 1.27)),
    ]
    crate = box((-0.55, -0.5, 0), (0.55, 0.5, 1.0), (0.60, 0.40, 0.16), "-z", spacing, 0.04)
    load = [
        placed(crate, at, turn)
        for at, turn in (((-2.9, -0.5, 1.0), 4), ((-2.9, 0.55, 1.0), -3), ((-1.6, 0.5, 1.0), 7), ((-2.75, 0.0, 2.0), 15))
    ]
    barrel = lathe(
        [(0.34, 0), (0.42, 0.3), (0.42, 0.62), (0.34, 0.92), (0.30, 0.92), (0, 0.9)],
        n,
        [BLUE, (0.75, 0.62, 0.1), BLUE, BLUE, BLUE],
        sharp_deg=50,
    )
    load += [placed(barrel, at) for at in ((-1.55, -0.6, 1.0), (-0.6, -0.6, 1.0), (-0.5, 0.45, 1.0), (0.5, -0.1, 1.0))]
    return merged(*bed, *load, *_cab(n, cab, 1.5, 3.3, 2.7), *_chassis(n, -3.7, 3.0, [-2.3, 2.3]))


BLUE: Colour = (0.08, 0.18, 0.42)


def car(n: int, colour: Colour) -> Mesh:
    """A small saloon car."""
    cabin = box((-1.25, -0.68, 0.9), (0.75, 0.68, 1.42), WINDOW, "-z", 0.8, 0.16)
    roof = box((-1.0, -0.58, 1.40), (0.5, 0.58, 1.47), colour, "-z", 0.8, 0.03)
    lamps = [bar((2.0, y - 0.18, 0.55), (2.06, y + 0.18, 0.72), LAMP) for y in (-0.55, 0.55)]
    return merged(
        box((-2.0, -0.82, 0.32), (2.02, 0.82, 0.92), colour, "", 0.8, 0.12),
        cabin,
        roof,
        *lamps,
        *_wheels(n, 0.33, 0.22, [-1.25, 1.3], 0.72),
    )


def tree(n: int, seed: int, height: float = 6.5) -> Mesh:
    """A leafy tree: trunk, and a lumpy crown of a few balls, lighter on top."""
    rng = np.random.default_rng(seed)
    crown = 0.45 * height
    trunk = tube([(0, 0, 0), (0.03, 0, 0.4 * height), (0.1, 0.05, 0.62 * height)], [0.2, 0.14, 0.1], max(6, n // 2), BARK)
    parts = [trunk]
    for k in range(5):
        a = 2 * np.pi * k / 4 + rng.uniform(0, 1)
        out = 0.0 if k == 4 else 0.20 * height
        at = np.array([out * np.cos(a), out * np.sin(a), (0.82 if k == 4 else rng.uniform(0.55, 0.68)) * height])
        lump = ball((0.5 if k == 4 else rng.uniform(0.40, 0.5)) * crown, n, max(6, 2 * n // 3), (0.2, 0.3, 0.1))
        d = lump.normals
        swell = 1 + 0.10 * np.sin(5 * d[:, 0] + 3 * k) * np.sin(6 * d[:, 1] + k) + 0.08 * np.sin(9 * d[:, 2] + 4 * d[:, 0])
        v = lump.vertices * swell[:, None] + at
        light = np.clip(0.5 + 0.45 * d[:, 2:] + 0.25 * np.sin(7 * d[:, :1] + 5 * d[:, 1:2] + seed), 0, 1)
        parts.append(
            Mesh(v, lump.faces, albedo=(1 - light) * np.array([0.07, 0.16, 0.04]) + light * np.array([0.28, 0.42, 0.10]))
        )
    return merged(*parts)


def lamp_post(n: int) -> Mesh:
    """A cast-iron lamp with an opal globe."""
    post = lathe([(0.17, 0), (0.17, 0.3), (0.08, 0.45), (0.055, 3.3), (0.13, 3.45), (0, 3.46)], max(6, n // 2), IRON)
    return merged(post, placed(ball(0.26, n, max(6, n // 2 + 1), (0.85, 0.83, 0.78)), (0, 0, 3.68)))


PRISM = np.array([[0, 1, 2], [5, 4, 3], [0, 3, 4], [0, 4, 1], [1, 4, 5], [1, 5, 2], [2, 5, 3], [2, 3, 0]])
"""Faces of two triangles back to back and what joins them."""


def garland(start, end, sag_m: float, flags: int) -> Mesh:
    """Pennants on a cord from `start` to `end` [3] that hangs `sag_m` in the middle."""
    start, end = np.asarray(start, np.float64), np.asarray(end, np.float64)
    hanging = lambda t: start + np.multiply.outer(t, end - start) - np.multiply.outer(4 * sag_m * t * (1 - t), [0, 0, 1])  # noqa: E731
    across = np.cross(end - start, [0, 0, 1])
    across *= 0.01 / np.linalg.norm(across)
    colours = [(0.75, 0.08, 0.06), (0.85, 0.62, 0.08), (0.08, 0.28, 0.60), (0.80, 0.80, 0.78), (0.10, 0.42, 0.18)]
    parts = [tube(hanging(np.linspace(0, 1, flags // 2 + 1)), 0.03, 3, DARK)]
    for k in range(flags):
        a, b = hanging(np.array([k + 0.15, k + 0.85]) / flags)
        flag = np.stack([a, b, 0.5 * (a + b) - [0, 0, 1.0]])
        parts.append(Mesh(np.concatenate([flag - across, flag + across]), PRISM, albedo=colours[k % 5]))
    return merged(*parts)


def bench() -> Mesh:
    """A bench that looks towards -y."""
    wood = (0.45, 0.22, 0.10)
    seat = [bar((-0.9, y, 0.42), (0.9, y + 0.13, 0.47), wood) for y in (-0.25, -0.09, 0.07)]
    back = [bar((-0.9, 0.22, z), (0.9, 0.26, z + 0.13), wood) for z in (0.56, 0.74)]
    feet = [bar((x - 0.04, -0.22, 0), (x + 0.04, 0.25, 0.42), IRON) for x in (-0.7, 0.7)]
    return merged(*seat, *back, *feet, *(bar((x - 0.04, 0.2, 0.42), (x + 0.04, 0.25, 0.87), IRON) for x in (-0.7, 0.7)))


def fountain(n: int) -> Mesh:
    """A round basin with water and a column that carries a bowl and a ball."""
    basin = lathe([(2.0, 0), (2.0, 0.5), (2.1, 0.56), (2.1, 0.66), (1.75, 0.66), (1.75, 0.5)], 2 * n, MARBLE)
    water = lathe([(1.75, 0.5), (1.2, 0.5), (0.6, 0.5), (0.25, 0.5)], 2 * n, WATER)
    column = lathe([(0.34, 0.5), (0.34, 0.65), (0.2, 0.8), (0.16, 1.3), (0.3, 1.45), (0.85, 1.75), (0.85, 1.82)], n, MARBLE)
    bowl = lathe([(0.85, 1.82), (0.75, 1.78), (0.15, 1.76)], n, WATER)
    top = lathe([(0.15, 1.76), (0.1, 2.1), (0.13, 2.2)], n, MARBLE)
    return merged(basin, water, column, bowl, top, placed(ball(0.24, n, max(6, n // 2 + 1), (0.72, 0.50, 0.12)), (0, 0, 2.4)))


def parasol(n: int, colour: Colour) -> Mesh:
    """A café table with two stools under a parasol of coloured gores."""
    count = 2 * max(4, n // 4)
    cone = lathe([(1.35, 2.2), (0.75, 2.48), (0, 2.66)], count, colour, sharp_deg=60)
    gores = []
    for k in range(count):
        a, b = 2 * np.pi * k / count, 2 * np.pi * (k + 1) / count
        rim, mid = (
            [[np.cos(t) * 1.35, np.sin(t) * 1.35, 2.2] for t in (a, b)],
            [[np.cos(t) * 0.75, np.sin(t) * 0.75, 2.48] for t in (a, b)],
        )
        v = [*rim, *mid, [0, 0, 2.66]]
        gores.append(Mesh(np.array(v), np.array([[0, 1, 3], [0, 3, 2], [2, 3, 4]]), albedo=colour if k % 2 else WHITE))
    # It meets the gores at the rim.
    lower = cone.vertices - [0, 0, 0.03] * (1 - np.linalg.norm(cone.vertices[:, :2], axis=1, keepdims=True) / 1.35)
    inside = replace(cone, vertices=lower, faces=cone.faces[:, ::-1], normals=-cone.normals)
    pole = tube([(0, 0, 0), (0, 0, 2.5)], 0.035, 6, WHITE)
    table = lathe([(0.45, 0.70), (0.45, 0.74), (0, 0.74)], n, WHITE)
    under = lathe([(0, 0.70), (0.45, 0.70)], n, WHITE)
    stools = [
        placed(lathe([(0.2, 0), (0.2, 0.45), (0, 0.45)], max(6, n // 2), colour), (x, y, 0))
        for x, y in ((0.75, 0.1), (-0.7, 0.3))
    ]
    return merged(*gores, inside, pole, table, under, *stools)


def person(n: int, coat: Colour, trousers: Colour, height: float = 1.74) -> Mesh:
    """Somebody who looks up, towards +x; one arm points."""
    s = height / 1.74
    skin = (0.62, 0.42, 0.30)
    outline = [
        (0.13, 0),
        (0.15, 0.45),
        (0.17, 0.85),
        (0.2, 0.86),
        (0.19, 1.1),
        (0.23, 1.38),
        (0.09, 1.5),
        (0.06, 1.56),
        (0, 1.57),
    ]
    body = lathe(
        np.array(outline) * s, max(6, n // 2), [trousers, trousers, trousers, coat, coat, coat, skin, skin], sharp_deg=60
    )
    body = replace(body, vertices=body.vertices * [0.75, 1.0, 1.0])
    head = placed(ball(0.12 * s, max(8, 2 * n // 3), max(6, n // 3 + 1), skin), (0.02, 0, 1.63 * s))
    hair = head.vertices[:, 2:] - 1.63 * s > 0.35 * (head.vertices[:, :1] - 0.02) + 0.01
    head = replace(head, albedo=np.where(hair, (0.12, 0.07, 0.04), skin))
    arm = tube(
        arc((0.0, 0.21 * s, 1.33 * s), (0.5 * s, 0.0, 0.25 * s), (0, 0, -0.1 * s), 60, 0, 4), 0.05 * s, max(5, n // 3), coat
    )
    other = tube(
        [(0, -0.24 * s, 1.36 * s), (0.02, -0.28 * s, 1.05 * s), (0.08, -0.26 * s, 0.8 * s)], 0.05 * s, max(5, n // 3), coat
    )
    return merged(body, head, arm, other)
