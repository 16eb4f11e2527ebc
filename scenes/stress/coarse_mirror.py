"""A mirror of fewer and fewer triangles, with smooth normals."""

from __future__ import annotations

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props.minimal import grid, s1, stage, thing

REGIME = Regime(
    entry="F-33",
    title="Coarse mirror",
    severity="rings of the mirror's mesh",
    severities=(64, 32, 16, 8, 5),
    symptom="FLIP in the mirror",
    bound=0.1,
    why="a checkered floor differs by this when its edges are a pixel off",
    measure="flip",
)


def coarse_mirror(severity: float) -> Scene:
    floor = grid((-4.0, -1.2, -4.0), (0.0, 0.0, 8.0), (8.0, 0.0, 0.0), (32, 32))
    return stage([thing("floor", floor)], [s1(fine=int(severity))])
