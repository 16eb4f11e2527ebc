"""A strip of few pieces between two strips of many: their images part along the edges that they share."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from benchharness.regime import Regime, Seen
from benchharness.scene import Scene

from ..props import shapes
from ..props.minimal import GREEN, RED, SKY, stage, thing

BAND = 3  # pixels to either side of a shared edge


def cracks(seen: Seen) -> float | None:
    """Among the pixels near the shared edges' true images, the share that shows what is behind the strips."""
    true = [seen.mask & (np.abs(seen.truth - colour).max(axis=2) < 0.02) for colour in (RED, GREEN)]
    near = [np.asarray(ndimage.binary_dilation(mask, iterations=BAND), bool) for mask in true]
    edge = near[0] & near[1] & (true[0] | true[1])
    through = edge & (np.abs(seen.image - SKY).max(axis=2) < 0.02)
    return float(through.sum() / edge.sum()) if edge.any() else None


REGIME = Regime(
    entry="F-15",
    title="T-junctions",
    severity="pieces of the strip in the middle; its neighbours have 64",
    severities=(64, 16, 8, 4, 2, 1),
    symptom="share of pixels by the shared edges that show what is behind",
    bound=0.01,
    why="neighbours that agree along their edge leave no hole: three pixels of 300 for rounding",
    measure=cracks,
)


def t_junctions(severity: float) -> Scene:
    def strip(z: float, pieces: int):
        corner = (-2.0, -1.2, z), (0.0, 0.0, 0.5), (4.0, 0.0, 0.0)
        return shapes.sheet(*corner, np.linspace(0, 1, 9), np.linspace(0, 1, pieces + 1), RED)

    return stage(
        [
            thing("far", strip(0.3, 64), RED),
            thing("middle", strip(0.8, int(severity)), GREEN),
            thing("near", strip(1.3, 64), RED),
        ]
    )
