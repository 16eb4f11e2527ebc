"""Hidden: a wall behind the mirror, most of which the mirror cannot show."""

from __future__ import annotations

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props.minimal import grid, stage, thing

REGIME = Regime(
    entry="F-06, F-12, F-13",
    title="Hidden vertices",
    severity="edge of the wall's triangles, in radii of the mirror",
    severities=(0.1, 0.25, 0.5, 1.0, 2.0),
    symptom="FLIP in the mirror",
    bound=0.08,
    why="a checkered wall at a slant differs by this when its edges are a pixel off",
    measure="flip",
)


def hidden(severity: float) -> Scene:
    count = max(1, round(8 / severity))
    return stage([thing("wall", grid((-4.0, -4.0, -2.0), (8.0, 0.0, 0.0), (0.0, 8.0, 0.0), (count, count)))])
