"""Posts in a room, around the mirror: the more of them, the thinner. As seen from the mirror's middle, a ray passes behind one
post after the other."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime, Seen
from benchharness.scene import Scene

from ..props import shapes
from ..props.minimal import RED, room, stage, thing, turned

NEARER = 3.3  # radii of the mirror, along a reflected ray: posts end by 2.8, walls begin at 4


def mistaken(seen: Seen) -> float | None:
    """Share of the mirror's pixels whose distance is that of a wall where a post is, or the other way round."""
    off = (seen.distance < NEARER) != (seen.length < NEARER)
    return float(off[seen.mask].mean()) if seen.mask.any() else None


REGIME = Regime(
    entry="I-20",
    title="Posts before a wall",
    severity="posts",
    severities=(2, 4, 8, 16),
    symptom="share of pixels whose distance is a wall's for a post's, or a post's for a wall's",
    bound=0.08,
    why="a sixteenth, and half a pixel along the posts' edges",
    measure=mistaken,
)

AWAY, GATE = 2.2, 40.0  # of the posts, in radii of the mirror; half of the gap through which the eye looks, degrees


def palisade(severity: float) -> Scene:
    count = int(severity)
    step = (360.0 - 2 * GATE) / count
    half = AWAY * np.tan(0.25 * np.radians(step))
    post = shapes.box((-half, -1.6, AWAY), (half, 1.6, AWAY + 0.1), RED)
    posts = [thing(f"post {k}", turned(post, "y", GATE + (k + 0.5) * step), RED) for k in range(count)]
    return stage([thing("walls", room((-5.0,) * 3, (5.0,) * 3)), *posts])
