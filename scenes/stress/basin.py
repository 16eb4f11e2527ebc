"""A ball jumps before a concave mirror, from beyond its focus to within: last frame's point is another kind of root."""

from __future__ import annotations

from benchharness.regime import Regime
from benchharness.scene import Reflector, Scene

from ..props.minimal import RED, cap, eye, misplaced, pose, sphere, stage, thing

REGIME = Regime(
    entry="F-19",
    title="Jump through the focus",
    severity="jump from the last frame to this one, in radii of the mirror",
    severities=(0.0, 0.1, 0.3, 0.6, 1.2),
    symptom="share of the ball's images, its own and the true one, that is not in both",
    bound=0.2,
    why="the picture is the same for all jumps: an image of 200 pixels that is right but for half a pixel along its border",
    measure=misplaced(RED),
    frame=2,
)


def basin(severity: float) -> Scene:
    def moved(time: float):
        return pose(at=(0.0, 0.0, 0.75 if time > 1.5 else 0.75 - severity))

    dish = Reflector("mirror", cap(sphere(), 0.8, inside_out=True))
    look = eye((0.7, 0.0, -1.5), (0.0, 0.0, 0.9), 26.0)
    return stage([thing("ball", sphere(0.06, fine=24), RED, moved)], [dish], look, frames=3, fps=1.0)
