"""Surroundings far away, as a panorama: an arcaded courtyard under the sky.

A painter takes unit directions, float64 [N, 3], to linear RGB radiance [N, 3]: it follows each ray from where it stands to
the plane that it meets first and paints what is there, softened over the footprint of one sample of a panorama with
`height` rows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..panoramas.brushes import arch, between, checker, laid, rectangle, repeated, ripples, smooth, within
from ..props.shapes import Colour
from ..props.ways import way_to

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
    sample = np.pi / (height - 1)
    sides = ((0, -HALF_WIDTH, LIT), (0, HALF_WIDTH, DIM), (1, FAR, 0.55 * LIT + 0.45 * DIM), (1, NEAR, DIM))

    def paint(d: Array) -> Array:
        d = np.where(abs(d) < 1e-6, 1e-6, d)  # rays straight up and down: they too meet some wall, far away
        out, up = np.empty_like(d), d[:, 2] > 0
        out[up], out[~up] = sky(d[up]), _ground(d[~up], ground, eye_height, sample)
        reach = np.stack([_reach(d[:, axis], at) for axis, at, _ in sides])
        nearest = reach.argmin(axis=0)
        for k, (axis, _, light) in enumerate(sides):
            t = reach[k]
            z = eye_height + t * d[:, 2]
            wz = np.minimum(sample * t * np.hypot(1, d[:, 2] / d[:, axis]), 0.5 + abs(z))  # straight up, the wall ends
            some = np.flatnonzero((nearest == k) & (z > -wz) & (z < TOP + wz))
            t, z, wz, (along, dn) = t[some], z[some], wz[some], d[some][:, [1 - axis, axis]].T
            front = _front if axis == 0 else _end
            wall = front(t * along, z, sample * t * np.hypot(1, along / dn), wz, out[some], light, 11 + k)
            out[some] = laid(out[some], wall, within(z - TOP, wz) * within(-z, wz))
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
