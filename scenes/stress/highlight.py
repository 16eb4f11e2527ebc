"""Highlights on a glossy floor, seen in a flat mirror."""

from __future__ import annotations

from benchharness.regime import Regime, Seen, miss
from benchharness.scene import Scene

from ..props.minimal import DARK, eye, flat, glossy_floor, stage


def shine(seen: Seen) -> float | None:
    """Where the picture is as bright as half of the highlight's true peak, or more."""
    least = 0.5 * seen.truth.max(axis=2, where=seen.mask[..., None], initial=0.0).max()
    return miss(*(seen.mask & (image.max(axis=2) > least) for image in (seen.image, seen.truth)))


REGIME = Regime(
    entry="P-04",
    title="Highlight in a flat mirror",
    severity="exponent of the highlight",
    severities=(5.0, 30.0, 200.0, 1000.0),
    symptom="share of where it is half as bright as its peak or brighter, in either picture, that is not in both",
    bound=0.25,
    why="a highlight of 100 to 1000 pixels: half a pixel along its border",
    measure=shine,
)


def highlight(severity: float) -> Scene:
    floor, lamp = glossy_floor(severity)
    return stage([floor], [flat((1.8, 1.0))], eye((0.0, 0.6, 4.0), fov_deg=36.0), background=DARK, lights=(lamp,))
