"""Panoramas of surroundings far away: an arcaded courtyard under the sky, a living room.

A painter takes unit directions, float64 [N, 3], to linear RGB radiance [N, 3]: it follows each ray from where it stands to
the plane that it meets first and paints what is there, softened over the footprint of one sample of a panorama with
`height` rows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from scenes.brushes import arch, between, checker, laid, rectangle, repeated, ripples, smooth, within
from scenes.shapes import Colour, way_to

Array = np.ndarray
Painter = Callable[[Array], Array]

HALF_WIDTH, FAR, NEAR, TOP = 18.0, 54.0, -38.0, 13.6
"""The courtyard: x of its long sides, y of its ends, height of its cornice, metres."""
BAY = 4.0
"""From column to column, metres."""
SUN = way_to(-42.0, 57.0)
STONE, TRIM, SHADE = np.array([0.56, 0.43, 0.29]), np.array([0.74, 0.64, 0.50]), np.array([0.105, 0.075, 0.055])
GLASS = np.array([0.10, 0.12, 0.15])
LIT, DIM = np.array([2.35, 2.1, 1.75]), np.array([0.78, 0.84, 0.98])
"""Radiance of a white wall in the sun's soft light, and in the shade."""


@dataclass(frozen=True)
class Ground:
    """The checkered ground of a courtyard.

    square   length of a square's side, metres; a corner lies at the origin
    colours  albedo of the square from there towards +x, +y, and of the other
    light    radiance of a white ground: its irradiance over π, RGB
    """

    square: float
    colours: tuple[Colour, Colour]
    light: Colour


def gallery(ground: Ground, eye_height: float, height: int = 512) -> Painter:
    """A courtyard between two long arcaded fronts, seen from `eye_height` metres above the origin of its ground."""
    sides = ((0, -HALF_WIDTH, LIT), (0, HALF_WIDTH, DIM), (1, FAR, 0.55 * LIT + 0.45 * DIM), (1, NEAR, DIM))

    def beyond(d: Array) -> Array:
        out, up = np.empty_like(d), d[:, 2] > 0
        out[up], out[~up] = sky(d[up]), _ground(d[~up], ground, eye_height, np.pi / (height - 1))
        return out

    def wall(k: int, u: Array, z: Array, wu: Array, wz: Array, out: Array) -> Array:
        return (_front if sides[k][0] == 0 else _end)(u, z, wu, wz, out, sides[k][2], 11 + k)

    return walled([side[:2] for side in sides], (0.0, 0.0, eye_height), TOP, height, beyond, wall)


def walled(sides: Sequence[tuple[int, float]], eye: Sequence[float], top: float, height: int, beyond: Painter, wall) -> Painter:
    """Painter of upright walls on z = 0, `top` metres high, around `eye`.

    sides   of each wall the axis across it, 0 or 1, and its coordinate there, metres
    height  rows of the panorama
    beyond  paints what is above and below the walls
    wall    paints: number of the wall, coordinate along it and z, widths of the footprint, what is beyond -> radiance
    """
    sample = np.pi / (height - 1)

    def paint(d: Array) -> Array:
        d = np.where(abs(d) < 1e-6, 1e-6, d)  # rays straight up and down: they too meet some wall, far away
        out = beyond(d)
        reach = np.stack([_reach(d[:, axis], at - eye[axis]) for axis, at in sides])
        nearest = reach.argmin(axis=0)
        for k, (axis, _) in enumerate(sides):
            t = reach[k]
            z = eye[2] + t * d[:, 2]
            wz = np.minimum(sample * t * np.hypot(1, d[:, 2] / d[:, axis]), 0.5 + abs(z))  # straight up, the wall ends
            some = np.flatnonzero((nearest == k) & (z > -wz) & (z < top + wz))
            t, z, wz, (along, dn) = t[some], z[some], wz[some], d[some][:, [1 - axis, axis]].T
            wu = sample * t * np.hypot(1, along / dn)
            painted = wall(k, eye[1 - axis] + t * along, z, wu, wz, out[some])
            out[some] = laid(out[some], painted, within(z - top, wz) * within(-z, wz))
        return out

    return paint


def sky(d: Array) -> Array:
    """A summer sky with some cloud and a veiled sun."""
    up = np.maximum(d[:, 2], 0.0)
    out = laid(np.tile([1.75, 1.9, 2.05], (len(d), 1)), [0.58, 0.88, 1.45], up**0.55)
    cloud = ripples(d[:, :2] / (up + 0.35)[:, None], 48, 1.6, 0.09, 5)
    share = smooth(cloud, 0.15, 1.7) * smooth(up, 0.02, 0.35)
    thick = smooth(cloud, 0.9, 2.6)[:, None]
    out = laid(out, (1 - thick) * [3.6, 3.4, 3.1] + thick * [2.5, 2.45, 2.4], 0.9 * share)
    away = np.degrees(np.arccos(np.clip(d @ SUN, -1, 1)))[:, None]
    return out + np.exp(-((away / 5.5) ** 2)) * [48.0, 39.0, 26.0] + np.exp(-away / 16.0) * [4.2, 3.4, 2.3]


def _reach(step: Array, at: float) -> Array:
    """How far rays go to the plane at `at` whose coordinate grows by `step` [N] per metre; 1e12 where they never do."""
    return np.where(step * at > 0, at / step, 1e12)


def _ground(d: Array, ground: Ground, eye_height: float, sample: float) -> Array:
    down = np.minimum(d[:, 2], -1e-4)
    t = -eye_height / down
    x, y = t * d[:, 0], t * d[:, 1]
    wx, wy = (sample * t * np.sqrt(1 + (d[:, k] / down) ** 2) for k in range(2))
    one, other = np.asarray(ground.colours, np.float64)
    pattern = checker(x, y, ground.square, wx, wy)[:, None]
    return (0.5 * (one + other) + 0.5 * pattern * (one - other)) * ground.light


def _stone(u: Array, z: Array, light: Array, seed: int) -> Array:
    """Bare wall: weathered, darker towards the ground and under the cornice."""
    weather = 1 + 0.07 * ripples(np.column_stack([u, z]), 14, 9.0, 1.4, seed)
    weather *= (0.80 + 0.20 * smooth(z, 0.0, 7.0)) * (1 - 0.16 * smooth(z, 11.6, 12.7))
    return weather[:, None] * STONE * light


def _front(u: Array, z: Array, wu: Array, wz: Array, _: Array, light: Array, seed: int) -> Array:
    """A long side: an arcade, windows with pediments, windows under the cornice."""
    out = _stone(u, z, light, seed)
    middle = repeated(u, BAY)
    out = _arcade(out, middle, z, wu, wz, light)

    # First floor: window, its frame, and the gable above.
    frame = rectangle(middle, z, (-0.90, 6.35), (0.90, 9.0), wu, wz)
    gable = within(np.maximum(abs(middle) * 0.45 + (z - 9.62), 9.0 - z), np.maximum(wu, wz))
    out = laid(out, TRIM * light, np.maximum(frame, gable))
    out = laid(out, 0.75 * STONE * light, within(np.maximum(abs(middle) * 0.45 + (z - 9.42), 9.12 - z), np.maximum(wu, wz)))
    out = _window(out, middle, z, (0.66, 6.6, 8.8), wu, wz, light)

    # Second floor.
    out = laid(out, TRIM * light, rectangle(middle, z, (-0.72, 10.45), (0.72, 12.05), wu, wz))
    out = _window(out, middle, z, (0.52, 10.65, 11.85), wu, wz, light)
    return _bands(out, z, wz, light)


def _arcade(out: Array, middle: Array, z: Array, wu: Array, wz: Array, light: Array) -> Array:
    """Round arches on columns, and the dark of the walk behind them."""
    out = laid(out, TRIM * light, arch(middle, z, 1.72, 0.0, 3.0, wu, wz))
    depth = (0.35 + 0.9 * smooth(-z, -3.0, 0.0))[:, None] * SHADE * (0.4 + 0.9 * light)
    out = laid(out, depth, arch(middle, z, 1.48, 0.0, 3.0, wu, wz))
    post = abs(abs(middle) - 0.5 * BAY)  # from the middle of the pillar
    body = between(post, -0.30, 0.30, wu) * between(z, 0.0, 3.0, wz)
    round_ = 0.62 + 0.38 * np.sqrt(np.maximum(1 - (post / 0.34) ** 2, 0))
    out = laid(out, round_[:, None] * TRIM * light, body)
    for lo, hi, half in ((0.0, 0.35, 0.46), (2.72, 3.06, 0.50)):
        out = laid(out, TRIM * light, between(post, -half, half, wu) * between(z, lo, hi, wz))
    return out


def _window(out: Array, middle: Array, z: Array, opening: tuple[float, float, float], wu: Array, wz: Array, light) -> Array:
    """Panes that show some sky, with bars; `opening`: half width, foot, top."""
    half, foot, top = opening
    pane = (0.7 + 0.9 * (z - foot) / (top - foot))[:, None] * GLASS * (0.6 + 0.5 * light)
    out = laid(out, pane, rectangle(middle, z, (-half, foot), (half, top), wu, wz))
    bars = np.maximum(
        between(middle, -0.05, 0.05, wu), between(z, 0.62 * top + 0.38 * foot, 0.62 * top + 0.38 * foot + 0.1, wz)
    )
    return laid(out, 0.5 * STONE * light, bars * rectangle(middle, z, (-half, foot), (half, top), wu, wz))


def _bands(out: Array, z: Array, wz: Array, light: Array) -> Array:
    """Ledges between the floors and the cornice, each over its own shadow."""
    for lo, hi in ((5.15, 5.75), (9.72, 10.05), (12.7, 13.25)):
        shadow = between(z, lo - 0.28, lo, wz)
        out = laid(out, 0.45 * STONE * light, shadow)
        out = laid(out, 1.05 * TRIM * light, between(z, lo, hi, wz))
    out = laid(out, 0.6 * STONE * light, between(z, 5.36, 5.46, wz))
    return laid(out, np.array([0.42, 0.20, 0.12]) * light, between(z, 13.25, 14.5, wz))


def _end(u: Array, z: Array, wu: Array, wz: Array, beyond: Array, light: Array, seed: int) -> Array:
    """An end: a high arch that is open to the sky, between two lower ones, under windows."""
    out = _stone(u, z, light, seed)
    out = _arcade(out, repeated(u, BAY), z, wu, wz, light)
    plain = rectangle(u, z, (-4.1, 0.0), (4.1, 9.72), wu, wz)
    out = laid(out, _stone(u, z, light, seed + 1), plain)
    middle = repeated(u, BAY)
    outside = 1 - between(u, -4.1, 4.1, wu)
    out = laid(out, TRIM * light, outside * rectangle(middle, z, (-0.90, 6.35), (0.90, 9.0), wu, wz))
    high = _window(out, middle, z, (0.66, 6.6, 8.8), wu, wz, light)
    out = laid(out, high, outside)
    out = laid(out, TRIM * light, rectangle(middle, z, (-0.72, 10.45), (0.72, 12.05), wu, wz))
    out = _window(out, middle, z, (0.52, 10.65, 11.85), wu, wz, light)
    out = _bands(out, z, wz, light)

    # The arch, its frame and pillars, and the light of what is beyond it.
    out = laid(out, TRIM * light, arch(u, z, 3.35, 0.0, 5.4, wu, wz))
    out = laid(out, 0.62 * TRIM * light, arch(u, z, 2.95, 0.0, 5.4, wu, wz))
    haze = laid(np.tile([1.15, 1.2, 1.3], (len(u), 1)), np.minimum(beyond, 3.0), smooth(z, 1.0, 6.0))
    hill = 1.6 + 0.5 * np.sin(0.7 * u + 1) + 0.25 * np.sin(1.9 * u)
    haze = laid(haze, [0.42, 0.50, 0.42], within(z - hill, wz))
    return laid(out, haze, arch(u, z, 2.6, 0.0, 5.4, wu, wz))


ROOM, CEILING = ((-2.5, 2.5), (-2.8, 2.8)), 2.7
"""The living room: x and y of its walls, and its height, metres."""
WINDOWS, LAMP = ((-2.5, -1.05, 1.5), (-2.5, 1.05, 1.5)), (1.75, 2.25, 1.45)
"""Middles of what lights it, metres: the windows, in the wall towards -x, and the lamp."""
DAY, EVENING = np.array([1.0, 1.04, 1.1]), np.array([1.0, 0.66, 0.34])
PAPER, OAK, WALNUT, PLASTER = np.array([[0.44, 0.47, 0.36], [0.40, 0.25, 0.12], [0.19, 0.095, 0.05], [0.80, 0.77, 0.70]])

BINDINGS = np.array([
    [0.34, 0.07, 0.05], [0.09, 0.16, 0.10], [0.08, 0.11, 0.24], [0.42, 0.26, 0.10], [0.55, 0.47, 0.33], [0.20, 0.10, 0.06],
])  # fmt: skip
"""Of the books."""


def room(eye: tuple[float, float, float] = (0.0, 0.0, 1.1), height: int = 512) -> Painter:
    """A living room with windows, lamp and books, seen from `eye`: metres from the middle of its floor."""
    sides = [(axis, at) for axis in (0, 1) for at in ROOM[axis]]
    sample = np.pi / (height - 1)

    def beyond(d: Array) -> Array:
        out = np.empty_like(d)
        for chosen, z, painter in ((d[:, 2] > 0, CEILING, _ceiling), (d[:, 2] <= 0, 0.0, _boards)):
            t = (z - eye[2]) / d[chosen, 2]
            x, y = (np.clip(eye[k] + t * d[chosen, k], *ROOM[k]) for k in (0, 1))
            wx, wy = (sample * t * np.hypot(1, d[chosen, k] / d[chosen, 2]) for k in (0, 1))
            p = np.column_stack([x, y, np.full(len(x), z)])
            out[chosen] = painter(p, abs(wx), abs(wy))
        return out

    def wall(k: int, u: Array, z: Array, wu: Array, wz: Array, _: Array) -> Array:
        axis, at = sides[k]
        p = np.insert(np.column_stack([u, z]), axis, at, axis=1)
        light = _lamps(p, np.eye(3)[axis] * -np.sign(at))
        stripes = 1 + 0.05 * np.clip(repeated(u, 0.24) / 0.03, -1, 1) * np.clip(0.24 / wu - 2, 0, 1)
        out = stripes[:, None] * PAPER
        out = laid(out, 0.9 * PLASTER, between(z, 0.0, 0.85, wz))
        for lo, hi in ((0.0, 0.16), (0.82, 0.90), (2.58, CEILING)):
            out = laid(out, PLASTER * (0.92 if lo else 0.75), between(z, lo, hi, wz))
        return (_window_wall, _picture_wall, _door_wall, _book_wall)[k](out, light, u, z, wu, wz)

    return walled(sides, eye, CEILING, height, beyond, wall)


def _lamps(p: Array, n: Array) -> Array:
    """Radiance [N, 3] of a white surface at `p` [N, 3] with normal `n` [3] or [N, 3]."""
    out = np.tile([0.30, 0.28, 0.25], (len(p), 1))
    for middle in WINDOWS:
        way = np.asarray(middle) - p
        square = (way**2).sum(axis=1) + 0.5
        shine = np.maximum((way * n).sum(axis=1) / np.sqrt(square), 0) * abs(way[:, 0]) / np.sqrt(square) / square
        out += 2.6 * shine[:, None] * DAY
    way = np.asarray(LAMP) - p
    square = (way**2).sum(axis=1) + 0.12
    return out + (0.42 * (0.25 + np.maximum((way * n).sum(axis=1), 0) / np.sqrt(square)) / square)[:, None] * EVENING


def _ceiling(p: Array, wx: Array, wy: Array) -> Array:
    out = np.tile(PLASTER, (len(p), 1))
    for k, w in ((0, wx), (1, wy)):
        out = laid(out, 0.86 * PLASTER, between(abs(p[:, k]), ROOM[k][1] - 0.16, ROOM[k][1] - 0.12, w))
    return out * _lamps(p, np.array([0.0, 0.0, -1.0]))


def _boards(p: Array, wx: Array, wy: Array) -> Array:
    """Oak boards along y, and a carpet with a border."""
    x, y = p[:, 0], p[:, 1]
    board = np.floor(x / 0.14)
    tone = 1 + 0.16 * np.sin(12.9 * board + 1) * np.clip(0.14 / wx - 0.5, 0, 1)
    tone = tone * (1 + 0.05 * np.sin(9 * y + 7 * np.sin(5.3 * board)))
    out = tone[:, None] * OAK
    out = laid(out, 0.35 * OAK, between(repeated(x, 0.14), -0.004, 0.004, wx))
    for half, colour in (
        (0.0, (0.33, 0.06, 0.05)),
        (0.10, (0.70, 0.60, 0.42)),
        (0.16, (0.10, 0.12, 0.24)),
        (0.40, (0.42, 0.09, 0.07)),
    ):
        lo, hi = (-1.5 + half, -1.9 + half), (1.5 - half, 1.9 - half)
        out = laid(out, colour, rectangle(x, y, lo, hi, wx, wy))
    return out * _lamps(p, np.array([0.0, 0.0, 1.0]))


def _window_wall(out: Array, light: Array, u: Array, z: Array, wu: Array, wz: Array) -> Array:
    """Two windows on a garden, with curtains."""
    out = out * light
    for _, middle, _ in WINDOWS:
        v = u - middle
        out = laid(out, 0.55 * PLASTER, rectangle(v, z, (-0.68, 0.62), (0.68, 2.38), wu, wz))
        garden = laid(np.tile([5.6, 5.9, 6.2], (len(u), 1)), [7.6, 8.2, 9.0], smooth(z, 1.3, 2.3))
        hedge = 1.22 + 0.08 * np.sin(5 * u) + 0.05 * np.sin(13 * u + 1)
        garden = laid(garden, [0.30, 0.52, 0.16], smooth(hedge - z, -0.03, 0.05))
        garden = laid(garden, [0.62, 0.95, 0.30], smooth(0.92 - z, -0.02, 0.02))
        out = laid(out, garden, rectangle(v, z, (-0.58, 0.74), (0.58, 2.28), wu, wz))
        bars = np.maximum(between(v, -0.03, 0.03, wu), np.maximum(between(z, 1.24, 1.28, wz), between(z, 1.76, 1.80, wz)))
        out = laid(out, 0.62 * PLASTER, bars * rectangle(v, z, (-0.58, 0.74), (0.58, 2.28), wu, wz))
        out = laid(out, 0.95 * PLASTER, rectangle(v, z, (-0.76, 0.58), (0.76, 0.64), wu, wz))
        for side in (-1, 1):
            fold = 0.75 + 0.25 * np.sin(v * 60)
            cloth = fold[:, None] * [0.62, 0.22, 0.10] * (0.5 + light)
            edge = 0.60 + 0.06 * np.cos(2.2 * (z - 1.3))
            out = laid(out, cloth, between(side * v, edge, 0.92, wu) * between(z, 0.1, 2.46, wz))
        out = laid(out, WALNUT * light, rectangle(v, z, (-1.0, 2.46), (1.0, 2.50), wu, wz))
    return out


def _picture_wall(out: Array, light: Array, u: Array, z: Array, wu: Array, wz: Array) -> Array:
    """A landscape in a golden frame above a sideboard, small pictures beside it."""
    for lo, hi, edge in (
        ((-0.75, 1.25), (0.75, 2.25), 0.07),
        ((1.2, 1.45), (1.65, 2.05), 0.04),
        ((-1.65, 1.45), (-1.2, 2.05), 0.04),
    ):
        out = laid(out, (0.62, 0.42, 0.14), rectangle(u, z, lo, hi, wu, wz))
        out = laid(out, (0.30, 0.19, 0.07), rectangle(u, z, np.add(lo, 0.6 * edge), np.subtract(hi, 0.6 * edge), wu, wz))
        s, t = (u - lo[0]) / (hi[0] - lo[0]), (z - lo[1]) / (hi[1] - lo[1])
        view = laid(np.tile([0.72, 0.62, 0.42], (len(u), 1)), [0.30, 0.45, 0.62], smooth(t, 0.45, 0.95))
        view = laid(view, [0.24, 0.30, 0.34], smooth(0.52 + 0.07 * np.sin(9 * s) - t, -0.02, 0.02))
        view = laid(view, [0.20, 0.27, 0.10], smooth(0.36 + 0.06 * np.sin(5 * s + 2) - t, -0.02, 0.02))
        view = laid(
            view, [0.55, 0.52, 0.40], smooth(0.05 - abs(s - 0.5 - 0.25 * (0.3 - t)), -0.02, 0.02) * smooth(0.3 - t, 0, 0.05)
        )
        out = laid(out, view, rectangle(u, z, np.add(lo, edge), np.subtract(hi, edge), wu, wz))
    out = laid(out, WALNUT, rectangle(u, z, (-1.1, 0.12), (1.1, 0.88), wu, wz))
    out = laid(out, 1.5 * WALNUT, rectangle(u, z, (-1.16, 0.88), (1.16, 0.94), wu, wz))
    for k in range(4):
        middle = -0.825 + 0.55 * k
        out = laid(out, 1.3 * WALNUT, rectangle(u - middle, z, (-0.24, 0.2), (0.24, 0.8), wu, wz))
        out = laid(out, (0.6, 0.45, 0.2), within(np.hypot(u - middle - 0.19 * (-1) ** k, z - 0.52) - 0.022, np.maximum(wu, wz)))
    for middle, half, colour in ((-0.85, 0.10, (0.10, 0.20, 0.42)), (0.85, 0.12, (0.66, 0.30, 0.16))):  # vases
        shape = half * (0.55 + 0.45 * np.sin(np.clip((z - 0.94) / 0.3, 0, 1) * 2.6))
        out = laid(out, colour, within(abs(u - middle) - shape, wu) * between(z, 0.94, 1.24, wz))
    return out * light


def _door_wall(out: Array, light: Array, u: Array, z: Array, wu: Array, wz: Array) -> Array:
    """A panelled door and a sofa."""
    out = laid(out, 0.95 * PLASTER, rectangle(u, z, (0.72, 0.0), (1.88, 2.20), wu, wz))
    out = laid(out, 0.80 * PLASTER, rectangle(u, z, (0.82, 0.0), (1.78, 2.10), wu, wz))
    for lo, hi in (
        ((0.93, 0.2), (1.25, 0.9)),
        ((1.35, 0.2), (1.67, 0.9)),
        ((0.93, 1.05), (1.25, 1.95)),
        ((1.35, 1.05), (1.67, 1.95)),
    ):
        out = laid(out, 0.62 * PLASTER, rectangle(u, z, lo, hi, wu, wz))
        out = laid(out, 0.84 * PLASTER, rectangle(u, z, np.add(lo, 0.03), np.subtract(hi, 0.03), wu, wz))
    out = laid(out, (0.62, 0.45, 0.18), within(np.hypot(u - 0.88, z - 1.0) - 0.03, np.maximum(wu, wz)))
    cloth = np.array([0.10, 0.24, 0.26])
    for left, right, foot, top, tone in (
        (-1.9, 0.2, 0.1, 0.42, 0.75), (-1.75, 0.05, 0.40, 0.86, 1.15), (-1.75, -0.87, 0.36, 0.54, 1.45),
        (-0.83, 0.05, 0.36, 0.54, 1.45), (-2.0, -1.72, 0.1, 0.66, 1.0), (0.02, 0.30, 0.1, 0.66, 1.0),
    ):  # fmt: skip
        out = laid(out, tone * cloth, rectangle(u, z, (left, foot), (right, top), wu, wz))
    for middle, colour in ((-1.5, (0.70, 0.42, 0.10)), (-0.2, (0.62, 0.14, 0.10))):  # cushions
        away = np.maximum(abs(u - middle + 0.2 * (z - 0.7)), abs(z - 0.70 - 0.2 * (u - middle)))
        out = laid(out, colour, within(away - 0.17, np.maximum(wu, wz)))
    return out * light


def _book_wall(out: Array, light: Array, u: Array, z: Array, wu: Array, wz: Array) -> Array:
    """A bookcase, and the lamp on its pole."""
    inside = rectangle(u, z, (-2.0, 0.0), (1.0, 2.3), wu, wz)
    out = laid(out, WALNUT, inside)
    for foot in np.arange(0.14, 2.1, 0.36):
        level = round(float(foot) / 0.36)
        out = laid(out, 0.35 * WALNUT, rectangle(u, z, (-1.94, foot), (0.94, foot + 0.32), wu, wz))
        book = np.floor((u + 0.011 * level) / 0.055)
        chance = np.sin(np.outer(book + 37 * level, [12.9, 78.2, 37.7])) * 43758.5
        chance -= np.floor(chance)
        tall = foot + 0.20 + 0.10 * chance[:, 2]
        colour = BINDINGS[(chance[:, 0] * len(BINDINGS)).astype(int)] * (0.6 + 0.6 * chance[:, 1:2])
        spine = within(abs(repeated(u + 0.011 * level - 0.0275, 0.055)) - 0.024, wu) * between(z, foot, tall, wz)
        spine *= (chance[:, 2] > 0.08) * between(u, -1.93, 0.93, wu)
        out = laid(out, colour, spine)
        out = laid(out, (0.66, 0.52, 0.26), spine * between(z, tall - 0.06, tall - 0.045, wz) * (chance[:, 1] > 0.4))
    for middle in (-2.0, -0.5, 1.0):
        out = laid(out, 1.3 * WALNUT, rectangle(u - middle, z, (-0.03, 0.0), (0.03, 2.34), wu, wz))
    out = laid(out, 1.4 * WALNUT, rectangle(u, z, (-2.06, 2.28), (1.06, 2.36), wu, wz)) * light
    x, _, top = LAMP
    out = laid(out, (0.05, 0.04, 0.03), rectangle(u - x, z, (-0.015, 0.05), (0.015, top), wu, wz))
    out = laid(out, (0.05, 0.04, 0.03), rectangle(u - x, z, (-0.16, 0.02), (0.16, 0.06), wu, wz))
    shade = within(abs(u - x) - (0.24 - 0.30 * (z - top + 0.14)), wu) * between(z, top - 0.14, top + 0.18, wz)
    glow = 1.2 + 3.0 * np.exp(-((np.hypot(u - x, 1.6 * (z - top)) / 0.17) ** 2))
    return laid(out, glow[:, None] * EVENING * [1.5, 1.45, 1.4], shade)
