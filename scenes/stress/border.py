"""A floor that ends, and goes on in the panorama behind it."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Environment, Scene

from ..props.minimal import GREY, eye, grid, stage, thing

REGIME = Regime(
    entry="I-08, I-09",
    title="The floor's border",
    severity="half a side of the floor, in radii of the mirror",
    severities=(8.0, 4.0, 2.0, 1.2),
    symptom="FLIP in the mirror",
    bound=0.08,
    why="a checkered floor differs by this when its edges are a pixel off; the reference has the panorama at infinity",
    measure="flip",
)


OTHER, SQUARE, BELOW = (0.75, 0.75, 0.72), 0.5, 1.2


def border(severity: float) -> Scene:
    count = round(2 * severity / SQUARE / 2) * 2
    half = 0.5 * SQUARE * count
    floor = grid((-half, -half, -BELOW), (2 * half, 0.0, 0.0), (0.0, 2 * half, 0.0), (count, count))
    around = Environment.painted(lambda d: painted(d, count // 2 % 2), 512, ground="floor")
    lens = eye((0.0, -4.0, 0.5), up=(0.0, 0.0, 1.0))
    return stage([thing("floor", floor)], camera=lens, background=(0.0, 0.0, 0.0), environment=around)


def painted(d: np.ndarray, odd: int) -> np.ndarray:
    """The floor's checker goes on to the horizon, where it turns grey; a blue sky above. d [N, 3] -> radiance [N, 3]."""
    down = np.maximum(-d[:, 2], 1e-6)
    at = d[:, :2] * (BELOW / down)[:, None]
    even = np.floor(at / SQUARE).sum(axis=1).astype(np.int64) % 2 == 0
    mean, sky = 0.5 * np.add(GREY, OTHER), np.array([0.25, 0.4, 0.7])
    clear = np.exp(-((np.linalg.norm(at, axis=1) / 12.0) ** 2))[:, None]
    checker = np.where(even[:, None], GREY, OTHER)
    return np.where(d[:, 2:] < 0, clear * checker + (1 - clear) * mean, sky)
