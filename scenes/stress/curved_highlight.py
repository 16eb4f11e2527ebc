"""Highlights on a glossy floor, seen in a mirror that is curved more and more."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Mesh, Reflector, Scene

from ..props import shapes
from ..props.minimal import DARK, GREY, eye, glossy_floor, stage
from ..stress.highlight import shine

REGIME = Regime(
    entry="P-04",
    title="Highlight in a curved mirror",
    severity="curvature of the mirror, per metre",
    severities=(0.01, 0.1, 0.25, 0.5),
    symptom="share of where it is half as bright as its peak or brighter, in either picture, that is not in both",
    bound=0.35,
    why="a highlight of 40 to 200 pixels: half a pixel along its border",
    measure=shine,
)


def curved_highlight(severity: float) -> Scene:
    floor, lamp = glossy_floor(200.0)
    mirror = Reflector("mirror", bulging(severity))
    return stage([floor], [mirror], eye((0.0, 0.6, 4.0), fov_deg=36.0), background=DARK, lights=(lamp,))


def bulging(curvature: float) -> Mesh:
    """A rectangle of a sphere that bulges towards +z, its middle at the origin."""
    flat = shapes.sheet((-1.5, -1.0, 0.0), (3.0, 0.0, 0.0), (0.0, 2.0, 0.0), np.linspace(0, 1, 49), np.linspace(0, 1, 33), GREY)
    radius = 1.0 / curvature
    n = flat.vertices / radius
    n[:, 2] = np.sqrt(1 - (n[:, :2] ** 2).sum(axis=1))
    return Mesh(radius * (n - [0.0, 0.0, 1.0]), flat.faces, n)
