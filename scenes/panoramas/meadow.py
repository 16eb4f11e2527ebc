"""A meadow under a summer sky, as a panorama: sun, clouds, hills, a line of trees, grass with flowers.

Everything is soft or large, so that what a mirror makes of it can be followed by eye. Radiance is linear RGB.
"""

from __future__ import annotations

import numpy as np

from ..props.ways import way_to

SUN_DEG = (-118.0, 60.0)
"""Azimuth and elevation of the sun."""
SUN_RADIUS_DEG, SUN = 9.0, (15.5, 14.0, 11.5)
"""Its radius, and its radiance in the middle: larger and dimmer than the real one, with softer shadows."""


def painted(directions: np.ndarray) -> np.ndarray:
    """Radiance [N, 3] that arrives from unit directions [N, 3], z up."""
    d = directions
    azimuth = np.arctan2(d[:, 1], d[:, 0])
    elevation = np.degrees(np.arcsin(np.clip(d[:, 2], -1, 1)))
    colour, above, below = np.zeros_like(d), elevation > -0.5, elevation < 0.5
    colour[above] = _sky(d[above], elevation[above])
    layers = (
        # Elevation in degrees, colour at the foot and at the top, how sharp the outline is
        (10.0 + 5.0 * _waves(azimuth, (2, 3, 5), 1.7), (0.40, 0.52, 0.62), (0.36, 0.46, 0.60), 0.15),
        (6.0 + 3.2 * _waves(azimuth, (3, 4, 7), 0.4), (0.27, 0.38, 0.27), (0.22, 0.34, 0.30), 0.12),
        (2.6 + 1.3 * _waves(azimuth, (4, 7, 9), 2.9) + _trees(azimuth), (0.10, 0.17, 0.06), (0.13, 0.23, 0.07), 0.12),
    )
    for outline, foot, top, soft in layers:
        share = np.clip(elevation / np.maximum(outline, 0.5), 0, 1)[:, None]
        body = (1 - share) * np.asarray(foot) + share * np.asarray(top)
        colour = _over(colour, body, (outline - elevation) / soft)
    colour[below] = _over(colour[below], _grass(d[below]), -elevation[below] / 0.10)
    return colour


def _over(below: np.ndarray, above: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """`above` where `inside` [N] is positive, with a border of about one unit."""
    share = 1 / (1 + np.exp(-np.clip(2 * inside, -40, 40)))[:, None]
    return (1 - share) * below + share * above


def _waves(azimuth: np.ndarray, orders: tuple[int, ...], phase: float) -> np.ndarray:
    """A sum of waves around the horizon, within -1 and 1."""
    return np.mean([np.sin(k * azimuth + phase * (i + 1)) for i, k in enumerate(orders)], axis=0)


def _trees(azimuth: np.ndarray) -> np.ndarray:
    """Height of round crowns above the nearest hill, degrees; they stand in groups."""
    grove = np.clip(np.sin(2 * azimuth + 0.8) + 0.5 * np.sin(5 * azimuth), 0, 1)
    crowns = np.maximum(abs(np.sin(31 * azimuth)), 0.8 * abs(np.sin(47 * azimuth + 1))) ** 0.5
    return grove * (2.0 + 4.6 * crowns)


def _sky(d: np.ndarray, elevation: np.ndarray) -> np.ndarray:
    """Blue, paler towards the horizon, with the sun and white clouds on a plane overhead."""
    share = np.clip(elevation / 90, 0, 1)[:, None] ** 0.55
    colour = (1 - share) * np.array([0.78, 0.90, 1.02]) + share * np.array([0.13, 0.30, 0.72])
    up = np.maximum(d[:, 2], 0.02)
    where = d[:, :2] / (up + 0.16)[:, None]
    thick = 0.55 * _noise(1.3 * where, 3) + 0.28 * _noise(2.9 * where, 5) + 0.17 * _noise(6.1 * where, 8)
    cover = _step((thick - 0.47) / 0.22) * _step((elevation - 3) / 14)
    lit = (0.80 + 0.55 * _step((0.85 - thick) / 0.4))[:, None] * np.array([1.05, 1.04, 1.02])
    colour = colour + 0.85 * cover[:, None] * (lit - colour)
    away = np.degrees(np.arccos(np.clip(d @ way_to(*SUN_DEG), -1, 1)))
    glow = 0.9 * np.exp(-away / 9)[:, None] * np.array([1.0, 0.9, 0.7])
    return _over(colour + glow, np.broadcast_to(SUN, colour.shape), (SUN_RADIUS_DEG - away) / 0.8)


def _grass(d: np.ndarray) -> np.ndarray:
    """Below the horizon: a plane of grass in broad patches, with flowers near by."""
    down = np.maximum(-d[:, 2], 0.004)
    where = d[:, :2] / down[:, None]
    near = np.clip(down / 0.25, 0, 1)[:, None]
    patch = _step((_noise(0.55 * where, 11) - 0.35) / 0.3)[:, None]
    tuft = (_noise(5.0 * where, 13)[:, None] - 0.5) * near
    colour = (1 - patch) * np.array([0.13, 0.24, 0.055]) + patch * np.array([0.24, 0.33, 0.075])
    colour = colour * (1 + 0.5 * tuft) + (1 - near) ** 3 * np.array([0.05, 0.05, 0.03])
    for seed, petals in ((17, (0.80, 0.76, 0.62)), (23, (0.78, 0.58, 0.06)), (29, (0.55, 0.16, 0.30))):
        spots = _noise(5.0 * where + seed, seed) * _noise(0.9 * where - seed, seed + 1)
        colour = _over(colour, np.broadcast_to(petals, colour.shape), np.minimum((spots - 0.62) / 0.03, 14 * near[:, 0] - 5))
    return colour


def _step(x: np.ndarray) -> np.ndarray:
    """From 0 to 1 as x does, with level ends."""
    x = np.clip(x, 0, 1)
    return x * x * (3 - 2 * x)


def _noise(p: np.ndarray, seed: int) -> np.ndarray:
    """Smooth noise of a plane [N, 2], within 0 and 1: random numbers at whole coordinates, and in between what lies between."""
    table = np.random.default_rng(seed).random((64, 64))
    cell = np.floor(p).astype(np.int64)
    s, t = _step(p - cell).T
    i, j = (cell % 64).T
    k, l = (i + 1) % 64, (j + 1) % 64
    return (1 - s) * ((1 - t) * table[i, j] + t * table[i, l]) + s * ((1 - t) * table[k, j] + t * table[k, l])
