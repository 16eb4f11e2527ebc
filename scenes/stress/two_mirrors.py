"""Two mirrors that come near each other. The reference shows all bounces; rays that are followed over one mirror end black."""

from __future__ import annotations

from benchharness.regime import Regime
from benchharness.scene import Scene

from ..props.minimal import eye, grid, s1, stage, thing

REGIME = Regime(
    entry="F-35, I-07",
    title="Mirrors in mirrors",
    severity="gap between the mirrors, in radii",
    severities=(3.0, 1.0, 0.3, 0.1, 0.0),
    symptom="FLIP in the mirrors",
    bound=0.1,
    why="a checkered floor differs by this when its edges are a pixel off; the reference shows all bounces",
    measure="flip",
    max_depth=16,
)


def two_mirrors(severity: float) -> Scene:
    half = 1.0 + 0.5 * severity
    mirrors = [s1(1.0, (-half, 0.0, 0.0)), s1(1.0, (half, 0.0, 0.0))]
    floor = grid((-6.0, -1.2, -6.0), (0.0, 0.0, 12.0), (12.0, 0.0, 0.0), (48, 48))
    return stage([thing("floor", floor)], mirrors, eye((0.0, 1.0, 8.0), fov_deg=40.0))
