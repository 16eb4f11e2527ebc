"""An eye that comes down to the plane of a flat mirror."""

from __future__ import annotations

from dataclasses import replace

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props.minimal import RED, eye, flat, grid, pose, sphere, stage, thing

REGIME = Regime(
    entry="P-02, P-09",
    title="Eye near a flat mirror's plane",
    severity="height of the eye above the plane, metres",
    severities=(0.5, 0.2, 0.1, 0.05, 0.02),
    symptom="FLIP in the mirror",
    bound=0.1,
    why="a checkered wall, filtered and a pixel off, differs by this",
    measure="flip",
)


def skimming(severity: float) -> Scene:
    mirror = flat((3.0, 3.0))
    lying = replace(mirror, mesh=mirror.mesh.transformed(pose("x", -90.0)))
    wall = grid((-3.0, 0.05, -2.9), (6.0, 0.0, 0.0), (0.0, 3.0, 0.0), (24, 12))
    ball = sphere(0.25, (0.5, 0.5, -1.0), 24)
    look = eye((0.0, severity, 2.5), (0.0, severity - 0.3, 0.0), 40.0)
    return stage([thing("wall", wall), thing("ball", ball, RED)], [lying], look)
