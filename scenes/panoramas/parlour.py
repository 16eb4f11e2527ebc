"""A parlour, as a panorama: windows, a wall of books, paintings, a fireplace, a rug, seen from the middle of the room.

As in `scenes.panoramas.surroundings`, a painter follows each ray to the wall that it meets and paints what is there, softened
over the footprint of one sample. Lengths are metres from the point it is seen from; z is up.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..panoramas.brushes import arch, between, checker, laid, rectangle, repeated, ripples, smooth, within

Array = np.ndarray

LEFT, RIGHT, NEAR, FAR, FLOOR, CEILING = -3.2, 2.9, -2.8, 3.1, -0.88, 2.02
"""Where the walls are."""
DAY = np.array([9.5, 10.0, 10.8])
"""Radiance of the sky behind the windows."""
PAPER, WOOD, WHITE = np.array([0.115, 0.215, 0.190]), np.array([0.155, 0.075, 0.035]), np.array([0.80, 0.76, 0.68])
GILT, DARK = np.array([0.52, 0.36, 0.12]), np.array([0.030, 0.022, 0.018])


def painter(height: int = 512) -> Callable[[Array], Array]:
    """The painter of the room for panoramas of `height` rows: unit directions [N, 3] -> radiance [N, 3]."""
    sample = np.pi / (height - 1)
    walls = (
        (0, LEFT, _windows),
        (0, RIGHT, _hearth),
        (1, NEAR, _paintings),
        (1, FAR, _books),
        (2, FLOOR, _floor),
        (2, CEILING, _ceiling),
    )

    def paint(d: Array) -> Array:
        d = np.where(abs(d) < 1e-9, 1e-9, d)
        reach = np.stack([np.where(d[:, axis] * at > 0, at / d[:, axis], np.inf) for axis, at, _ in walls])
        nearest, out = reach.argmin(axis=0), np.empty_like(d)
        for k, (axis, _, wall) in enumerate(walls):
            some = nearest == k
            t = reach[k][some]
            p = t[:, None] * d[some]
            u, v = np.delete(p, axis, axis=1).T
            wu, wv = (sample * t * np.hypot(1, x / p[:, axis]) for x in (u, v))
            out[some] = wall(u, v, wu, wv) * _light(p)[:, None]
        return out

    return paint


def _light(p: Array) -> Array:
    """What share of a white wall's light arrives at points [N, 3] of the walls: more near the windows, less in corners."""
    near = 0.55 + 0.75 * np.exp(-(p[:, 0] - LEFT) / 3.5)
    corner = np.ones(len(p))
    for k, (lo, hi) in enumerate(((LEFT, RIGHT), (NEAR, FAR), (FLOOR, CEILING))):
        gap = np.minimum(p[:, k] - lo, hi - p[:, k])
        # The wall that the point is on has a gap of nothing and casts no shade on itself.
        corner *= np.where(gap < 1e-6, 1.0, 0.72 + 0.28 * smooth(gap, 0.0, 0.7))
    return near * corner


def _bare(u: Array, z: Array, wu: Array, wz: Array) -> Array:
    """Papered wall with a stripe, panels below, a skirting, a rail and a cornice."""
    out = np.tile(PAPER, (len(u), 1))
    out = laid(out, 1.28 * PAPER, between(repeated(u, 0.24), -0.06, 0.06, wu))
    out = laid(out, 0.62 * WHITE, between(z, FLOOR, 0.10, wz))
    panel = rectangle(repeated(u, 0.78), z, (-0.31, FLOOR + 0.26), (0.31, -0.02), wu, wz)
    inner = rectangle(repeated(u, 0.78), z, (-0.27, FLOOR + 0.30), (0.27, -0.06), wu, wz)
    out = laid(laid(out, 0.40 * WHITE, panel), 0.68 * WHITE, inner)
    for lo, hi, tone in ((FLOOR, FLOOR + 0.14, 0.75), (0.10, 0.15, 0.9), (1.82, 1.90, 0.7), (1.90, CEILING, 0.95)):
        out = laid(out, tone * WHITE, between(z, lo, hi, wz))
    return out


def _windows(y: Array, z: Array, wy: Array, wz: Array) -> Array:
    """Three tall windows with round heads and bars, between curtains."""
    out = _bare(y, z, wy, wz)
    middle = repeated(y - 0.1, 1.75)
    there = (abs(y - 0.1) < 2.62).astype(np.float64)
    out = laid(out, 0.9 * WHITE, there * arch(middle, z, 0.56, -0.46, 1.12, wy, wz))
    green = smooth(z, 0.25, -0.35)[:, None]
    view = (1 - green) * DAY + green * np.array([2.4, 3.4, 1.5])
    view = view * (1 + 0.10 * ripples(np.column_stack([y, z]), 12, 0.9, 0.2, 3))[:, None]
    out = laid(out, view, there * arch(middle, z, 0.47, -0.38, 1.12, wy, wz))
    bars = np.maximum(between(middle, -0.022, 0.022, wy), between(repeated(z - 0.02, 0.55), -0.018, 0.018, wz))
    out = laid(out, 0.8 * WHITE, bars * there * arch(middle, z, 0.50, -0.42, 1.12, wy, wz))
    cloth = np.array([0.42, 0.075, 0.055]) * (0.75 + 0.35 * np.sin(58 * y))[:, None]
    hang = 0.62 + 0.10 * smooth(z, 0.2, 1.6)
    return laid(out, cloth, there * between(abs(middle), hang, 0.86, wy) * between(z, FLOOR + 0.02, 1.80, wz))


def _books(x: Array, z: Array, wx: Array, wz: Array) -> Array:
    """Shelves of books from wall to wall but for a doorway into a bright room."""
    out = _bare(x, z, wx, wz)
    shelves = between(x, LEFT + 0.25, 1.05, wx) * between(z, FLOOR, 1.78, wz)
    out = laid(out, WOOD, shelves)
    row, at = np.divmod(z - FLOOR - 0.10, 0.335)
    column, along = np.divmod(x + 0.011 * np.sin(7 * row), 0.052)
    rng = np.random.default_rng(5)
    hues = np.array(
        [
            (0.34, 0.06, 0.04),
            (0.08, 0.13, 0.26),
            (0.10, 0.20, 0.10),
            (0.42, 0.28, 0.12),
            (0.60, 0.52, 0.38),
            (0.16, 0.08, 0.06),
            (0.30, 0.16, 0.08),
        ]
    )
    which = (17 * row.astype(int) + column.astype(int)) % 512
    spine, tall = hues[rng.integers(0, len(hues), 512)[which]], (0.19 + 0.09 * rng.random(512))[which]
    case = between(repeated(x - 0.25, 1.12), -0.52, 0.52, wx) * shelves
    opening = case * between(at, 0.0, 0.30, np.maximum(wz, 1e-4))
    out = laid(out, DARK, opening)
    book = opening * between(at, 0.0, tall, wz) * between(along, 0.002, 0.050, wx)
    out = laid(out, spine, book)
    out = laid(out, 1.4 * GILT, book * np.maximum(between(at, 0.05, 0.062, wz), between(at, 0.14, 0.152, wz)))
    # The doorway
    out = laid(out, 0.9 * WHITE, rectangle(x, z, (1.38, FLOOR), (2.52, 1.32), wx, wz))
    bright = np.array([1.25, 1.05, 0.72]) * (0.8 + 0.35 * smooth(z, -0.8, 1.2))[:, None]
    out = laid(out, bright, rectangle(x, z, (1.50, FLOOR), (2.40, 1.22), wx, wz))
    lamp = within(np.hypot(x - 1.95, 1.2 * (z - 0.62)) - 0.13, np.maximum(wx, wz))
    return laid(out, np.array([6.0, 4.6, 2.6]), lamp)


def _hearth(y: Array, z: Array, wy: Array, wz: Array) -> Array:
    """A fireplace with a fire, and a round gilt clock above it; a painting at each side."""
    out = _bare(y, z, wy, wz)
    for lo, hi, tone in (((-0.85, FLOOR), (0.85, 0.22), 0.85), ((-0.98, 0.22), (0.98, 0.30), 1.0)):
        out = laid(out, tone * WHITE, rectangle(y, z, lo, hi, wy, wz))
    out = laid(out, DARK, arch(y, z, 0.48, FLOOR, -0.42, wy, wz))
    flame = 0.55 + 0.45 * ripples(np.column_stack([y, 0.5 * z]), 10, 0.30, 0.06, 9)
    away = np.hypot(y / 0.34, (z - FLOOR - 0.10) / 0.30)
    fire = np.clip(1.25 - away, 0, 1) * np.clip(flame, 0.1, 1.4)
    out = laid(out, np.array([7.5, 2.6, 0.5]), np.clip(fire, 0, 1) * arch(y, z, 0.46, FLOOR, -0.42, wy, wz))
    for radius, tone in ((0.30, 1.2 * GILT), (0.245, WHITE), (0.025, DARK)):
        out = laid(out, tone, within(np.hypot(y, z - 0.92) - radius, np.maximum(wy, wz)))
    for middle, seed in ((-1.75, 21), (1.85, 22)):
        out = _painting(out, y - middle, z - 0.85, wy, wz, (0.48, 0.60), seed)
    return out


def _paintings(x: Array, z: Array, wx: Array, wz: Array) -> Array:
    """Three paintings in gilt frames over a long sideboard."""
    out = _bare(x, z, wx, wz)
    for middle, half, seed in ((-1.95, (0.42, 0.52), 31), (-0.1, (0.92, 0.60), 32), (1.75, (0.42, 0.52), 33)):
        out = _painting(out, x - middle, z - 0.98, wx, wz, half, seed)
    out = laid(out, WOOD, rectangle(x, z, (-1.4, FLOOR + 0.12), (1.2, 0.02), wx, wz))
    door = rectangle(repeated(x + 0.1, 0.62), z, (-0.27, FLOOR + 0.18), (0.27, -0.06), wx, wz) * between(x, -1.34, 1.14, wx)
    out = laid(out, 1.7 * WOOD, door)
    for at in (-1.1, 0.9):
        out = laid(out, 0.8 * WHITE, rectangle(x, z, (at - 0.10, 0.14), (at + 0.10, 0.34), wx, wz))
    return out


def _painting(out: Array, u: Array, v: Array, wu: Array, wv: Array, half: tuple[float, float], seed: int) -> Array:
    """A landscape about u = v = 0, in a gilt frame around 2 `half`."""
    a, b = half
    out = laid(out, GILT, rectangle(u, v, (-a - 0.07, -b - 0.07), (a + 0.07, b + 0.07), wu, wv))
    out = laid(out, 0.5 * GILT, rectangle(u, v, (-a - 0.02, -b - 0.02), (a + 0.02, b + 0.02), wu, wv))
    hill = 0.16 * b * ripples(u[:, None], 8, 1.1, 0.25, seed) - 0.15 * b
    up = np.clip((v - hill) / b, 0, 1)[:, None]
    land = laid((1 - up) * [0.78, 0.62, 0.42] + up * [0.22, 0.36, 0.55], [0.14, 0.19, 0.07], within(v - hill, wv))
    land = laid(land, [0.07, 0.09, 0.04], within(v - 0.6 * hill + 0.42 * b, wv))
    return laid(out, land, rectangle(u, v, (-a, -b), (a, b), wu, wv))


def _floor(x: Array, y: Array, wx: Array, wy: Array) -> Array:
    """Parquet in squares, and a red rug with a border in the middle."""
    tone = checker(x, y, 0.30, wx, wy)[:, None]
    out = np.array([0.30, 0.165, 0.075]) * (1 + 0.22 * tone)
    for a, b, colour in (
        (1.9, 1.5, (0.36, 0.055, 0.040)),
        (1.75, 1.35, (0.52, 0.40, 0.22)),
        (1.66, 1.26, (0.07, 0.09, 0.20)),
        (1.42, 1.02, (0.40, 0.065, 0.045)),
    ):
        out = laid(out, colour, rectangle(x, y, (-a, -b), (a, b), wx, wy))
    diamond = abs(repeated(x, 0.36)) + abs(repeated(y, 0.36)) - 0.10
    return laid(out, [0.54, 0.42, 0.24], within(diamond, np.hypot(wx, wy)) * rectangle(x, y, (-1.4, -1), (1.4, 1), wx, wy))


def _ceiling(x: Array, y: Array, wx: Array, wy: Array) -> Array:
    """White, with a stucco rose and a lamp of frosted glass."""
    out = np.tile(0.85 * WHITE, (len(x), 1))
    border = np.minimum(np.minimum(x - LEFT, RIGHT - x), np.minimum(y - NEAR, FAR - y))
    out = laid(out, 0.55 * WHITE, between(border, 0.22, 0.28, np.maximum(wx, wy)))
    away, width = np.hypot(x, y), np.maximum(wx, wy)
    out = laid(out, 0.60 * WHITE, between(away, 0.52, 0.60, width))
    return laid(out, np.array([9.0, 7.6, 5.4]), within(away - 0.34, width))
