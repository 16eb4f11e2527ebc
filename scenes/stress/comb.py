"""A comb whose teeth become more and thinner."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime
from benchharness.scene import Scene, merged

from ..props import shapes
from ..props.minimal import RED, misplaced, stage, thing

REGIME = Regime(
    entry="I-12, I-13",
    title="Comb",
    severity="teeth",
    severities=(3, 6, 12, 24),
    symptom="share of the comb's images, its own and the true one, that is not in both",
    bound=0.35,
    why="teeth of 2 to 8 pixels, right but for half a pixel along their sides",
    measure=misplaced(RED),
)


def comb(severity: float) -> Scene:
    count = int(severity)
    x = np.linspace(-0.9, 0.9, 2 * count)
    teeth = [shapes.bar((a, 0.3, 1.6), (b, 1.3, 1.7), RED) for a, b in zip(x[::2], x[1::2], strict=True)]
    back = shapes.bar((-0.9, 1.3, 1.6), (0.9, 1.45, 1.7), RED)
    return stage([thing("comb", merged(back, *teeth), RED)])
