"""An open mirror: only a cap of the sphere is there, less and less of it."""

from __future__ import annotations

from benchharness.regime import Regime
from benchharness.scene import Reflector, Scene

from ..props.minimal import cap, grid, sphere, stage, thing

REGIME = Regime(
    entry="F-09",
    title="Open mirror",
    severity="height from which the cap is left, in radii",
    severities=(-0.5, 0.0, 0.4, 0.7, 0.9),
    symptom="FLIP in the mirror",
    bound=0.08,
    why="a checkered floor differs by this when its edges are a pixel off",
    measure="flip",
)


def open_cap(severity: float) -> Scene:
    whole = sphere()
    floor = grid((-4.0, -1.2, -4.0), (0.0, 0.0, 8.0), (8.0, 0.0, 0.0), (32, 32))
    return stage([thing("floor", floor)], [Reflector("mirror", cap(whole, severity), whole)])
