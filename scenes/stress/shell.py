"""Dots on a sphere about the mirror, which grows beyond the one that a map of exploded triangles takes for the scene."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props.minimal import RED, cap, misplaced, sphere, stage, thing, turned

REGIME = Regime(
    entry="F-32",
    title="Surroundings off the map's sphere",
    severity="distance of the dots from the mirror's middle, in radii of the mirror",
    severities=(3.0, 3.3, 4.0, 8.0, 40.0),
    symptom="share of the dots' images, their own and the true ones, that is not in both",
    bound=0.25,
    why="eight images, 230 pixels together, that are right but for half a pixel along their borders",
    measure=misplaced(RED),
)


def shell(severity: float) -> Scene:
    dot = cap(sphere(fine=37), np.cos(np.radians(15.0)), inside_out=True)
    far = replace(dot, vertices=severity * dot.vertices)
    ways = [(aside, 90.0 * k + 20.0) for aside in (35.0, 80.0) for k in range(4)]
    return stage([thing(f"dot {n}", turned(turned(far, "x", a), "z", b), RED) for n, (a, b) in enumerate(ways)])
