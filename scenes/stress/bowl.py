"""A bowl that becomes deeper, until its wall shows its other wall. The reference shows all bounces; rays that are followed over
one mirror end black there."""

from __future__ import annotations

from benchharness.regime import Regime
from benchharness.scene import Reflector, Scene

from ..props.minimal import cap, eye, grid, sphere, stage, thing

REGIME = Regime(
    entry="F-22",
    title="Second bounce in a bowl",
    severity="depth of the bowl, in radii of its sphere",
    severities=(0.1, 0.25, 0.5, 0.75, 1.0),
    symptom="FLIP in the bowl",
    bound=0.1,
    why="a checkered floor differs by this when its edges are a pixel off; the reference shows all bounces",
    measure="flip",
    max_depth=16,
)


def bowl(severity: float) -> Scene:
    inside = Reflector("mirror", cap(sphere(), 1.0 - severity, inside_out=True))
    ceiling = grid((-8.0, -8.0, -4.0), (16.0, 0.0, 0.0), (0.0, 16.0, 0.0), (16, 16))
    return stage([thing("ceiling", ceiling)], [inside], eye((0.0, -1.2, -2.5), (0.0, 0.0, 1.0 - 0.5 * severity), 40.0))
