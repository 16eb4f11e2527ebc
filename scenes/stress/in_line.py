"""Vertices on the line through the eye and the mirror's middle, before it and behind it."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Mesh, Scene

from ..props.minimal import GREEN, RED, misplaced, stage, thing

REGIME = Regime(
    entry="F-03, F-08",
    title="Vertices on the axis",
    severity="distance of both discs' middle vertices from the axis, in radii of the mirror",
    severities=(1.0, 0.3, 0.1, 0.01, 0.0),
    symptom="share of either disc's images, its own and the true one, that is not in both; the worse of both",
    bound=0.12,
    why="a ring of 12 pixels and a disc of 18, right but for half a pixel along their borders",
    measure=misplaced(RED, GREEN),
)


def in_line(severity: float) -> Scene:
    front, rear = disc(2.5, 10, (severity, 0.0, 5.0), -1.0), disc(8.0, 80, (severity, 0.0, -2.5), 1.0)
    return stage([thing("behind the eye", front, RED), thing("behind the mirror", rear, GREEN)])


def disc(radius: float, rings: int, at, side: float) -> Mesh:
    """A disc that faces along z times `side`, its middle a vertex."""
    segments = 64
    r, a = np.meshgrid(radius * np.arange(1, rings + 1) / rings, 2 * np.pi * np.arange(segments) / segments, indexing="ij")
    points = np.concatenate([np.zeros((1, 3)), np.stack([r * np.cos(a), r * np.sin(a), 0 * r], axis=-1).reshape(-1, 3)])
    k = np.arange(segments)
    right = (k + 1) % segments
    faces = [np.stack([0 * k, 1 + k, 1 + right], axis=1)]
    for ring in range(rings - 1):
        inner, outer = 1 + segments * ring, 1 + segments * (ring + 1)
        faces += [np.stack([inner + k, outer + k, outer + right], 1), np.stack([inner + k, outer + right, inner + right], 1)]
    faces = np.concatenate(faces)[:, :: int(side)]
    return Mesh(points + np.asarray(at), faces, np.tile([0.0, 0.0, side], (len(points), 1)))
