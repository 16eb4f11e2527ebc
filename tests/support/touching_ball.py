"""A red ball that touches a mirror sphere: how much of its image a method gets right, and whether the image reaches the mirror.

Unit mirror sphere at the origin, eye at (0, 0, 4), a ball of radius 0.3 that touches the sphere 50 degrees from the view
axis. The exact image lies 27.0 to 52.9 degrees from it on the sphere, pixels 117 to 188 from the middle of the picture.
The ball itself would hide part of its image. So a method is told of the scene with the ball in place, and asked for a frame
in which it is out of the eye's sight: it must answer from what it was told.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from support.mirror_room import Answer, ball, scene
from support.small_room import sphere

from benchharness.render.frame import FrameRenderer
from benchharness.scene import Camera, Object, Reflector, Scene

SIZE = (460, 460)
EYE, FIELD, RADIUS, POLAR = (0.0, 0.0, 4.0), 32.0, 0.3, 50.0
AWAY = 50.0  # metres behind the mirror


def touching_ball(gap: float = 0.0, polar: float = POLAR) -> Scene:
    """The ball at `gap` metres from the mirror, `polar` degrees from the view axis; out of sight from the second frame on."""

    def moved(time: float) -> np.ndarray:
        pose = np.eye(4)
        pose[2, 3] = 0.0 if time == 0 else -AWAY
        return pose

    angle = np.radians(polar)
    centre = (1 + RADIUS + gap) * np.array([np.sin(angle), 0.0, np.cos(angle)])
    red = Object("ball", ball(RADIUS, centre, (1.0, 0.0, 0.0), 4), "touches the mirror", motion=moved)
    camera = Camera(EYE, (0.0, 0.0, 0.0), FIELD, up=(0.0, 1.0, 0.0))
    return scene((red,), (Reflector("mirror", sphere(slices=192, stacks=96)),), lambda time: camera, frames=2)


@dataclass
class Image:
    """Of the ball in the mirror. `mask`: where, bool [H, W]; `polar`: degrees from the view axis on the sphere, NaN off it."""

    answer: Answer
    mask: np.ndarray
    polar: np.ndarray

    @property
    def ends(self) -> tuple[float, float]:
        """From where to where the image reaches along the line through the ball's middle, degrees."""
        row = self.mask.shape[0] // 2
        seen = self.polar[row][self.mask[row]]
        return float(seen.min()), float(seen.max())

    @property
    def ends_px(self) -> tuple[int, int]:
        """The same in pixels from the middle of the picture."""
        row = np.flatnonzero(self.mask[self.mask.shape[0] // 2]) - self.mask.shape[1] // 2
        return int(row.min()), int(row.max())


def image(method, made: Scene | None = None, size: tuple[int, int] = SIZE) -> Image:
    """What a method shows of `touching_ball`: told of the first frame, asked for the second."""
    made = made or touching_ball()
    renderer = FrameRenderer(made, *size)
    state = method.update(method.prepare(made), renderer.render(0))
    asked = renderer.render(1)
    reflection, state = method.shade(state, asked)
    answer = Answer(asked, reflection, state)
    p = np.array(asked.p).T.reshape(*answer.active.shape, 3)
    polar = np.degrees(np.arctan2(np.hypot(p[..., 0], p[..., 1]), p[..., 2]))
    return Image(answer, answer.active & (answer.L[..., 0] > 0.5), np.where(answer.active, polar, np.nan))


def overlap(one: Image, other: Image) -> float:
    """Intersection over union of two masks."""
    return float((one.mask & other.mask).sum() / (one.mask | other.mask).sum())


def overlap_of_ends(one: Image, other: Image) -> float:
    """Intersection over union of the arcs on the sphere between the ends of two images."""
    (a, b), (c, d) = one.ends, other.ends
    return max(min(b, d) - max(a, c), 0.0) / (max(b, d) - min(a, c))


def contact_gap_px(found: Image, exact: Image) -> int:
    """How many pixels the end of the image at which the ball touches the mirror lies short of the exact one."""
    return exact.ends_px[1] - found.ends_px[1]
