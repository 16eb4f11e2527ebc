"""Posts in a room, around the mirror: the more of them, the thinner. As seen from the mirror's middle, a ray passes behind one
post after the other."""

from __future__ import annotations

import numpy as np

from benchharness.regime import Regime, Seen
from benchharness.scene import Scene, merged

from ..props import shapes
from ..props.minimal import RED, room, stage, thing, turned


def elsewhere(seen: Seen) -> float | None:
    """Share of the mirror's pixels whose distance is off by more than a fifth: a post for a wall, or a wall for a post."""
    off = np.abs(seen.distance - seen.length) > 0.2 * seen.length
    return float(off[seen.mask].mean()) if seen.mask.any() else None


REGIME = Regime(
    entry="I-20",
    title="Posts before a wall",
    severity="posts",
    severities=(2, 4, 8, 16),
    symptom="share of pixels whose distance is off by more than a fifth",
    bound=0.1,
    why="a sixteenth, and half a pixel along the posts' edges",
    measure=elsewhere,
)

AWAY, GATE = 2.2, 40.0  # of the posts, in radii of the mirror; half of the gap through which the eye looks, degrees


def palisade(severity: float) -> Scene:
    count = int(severity)
    step = (360.0 - 2 * GATE) / count
    half = AWAY * np.tan(0.25 * np.radians(step))
    post = shapes.box((-half, -1.6, AWAY), (half, 1.6, AWAY + 0.1), RED)
    posts = [turned(post, "y", GATE + (k + 0.5) * step) for k in range(count)]
    return stage([thing("walls", room((-5.0,) * 3, (5.0,) * 3)), thing("posts", merged(*posts), RED)])
