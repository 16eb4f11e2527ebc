"""Frames beside one: what is timed was never asked for before, so that an answer that is kept from an earlier call is no use.

The camera stands a pixel aside, every time in another direction: further than rounding reaches, so near that the work is
the same. For updates, what moves is a moment earlier, every time another one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import count

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.api import Frame, View
from benchharness.render.frame import FrameRenderer, opaque, view_of
from benchharness.scene import Camera

ASIDE_PX = 1.0  # how far the eye stands aside, as it is seen in the distance of the camera's target
EARLIER = 0.05  # of the time since the frame before
GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)  # its multiples are spread evenly in [0, 1), however many there are


class Beside:
    """Beside the last of `frames`, which follow each other in the animation."""

    def __init__(self, renderer: FrameRenderer, frames: list[Frame]) -> None:
        self.renderer, self.frame = renderer, frames[-1]
        self.before = frames[-2].time if len(frames) > 1 else None
        self.camera = renderer.scene.camera(self.frame.time)
        # One box for all, so that no size changes with the camera; the square of these four contains the circle.
        corners = [self._aside(angle, np.sqrt(2.0) * ASIDE_PX) for angle in np.pi * np.array([0.0, 0.5, 1.0, 1.5])]
        self.boxes = [_union(boxes) for boxes in zip(*(renderer.boxes(c, self.frame.time) for c in corners), strict=True)]
        self._views, self._times = (GOLDEN * k % 1.0 for k in count(1)), (GOLDEN * k % 1.0 for k in count(1))

    def view(self) -> View:
        """The next camera."""
        camera = self._aside(2 * np.pi * next(self._views), ASIDE_PX)
        return view_of(camera, self.renderer.width, self.renderer.height, self.renderer.scene.near_plane)

    def drawn(self, view: View) -> Frame:
        """The frame as `view` sees it."""
        return replace(self.renderer.draw(self.frame.index, view), boxes=self.boxes)

    def several(self, number: int) -> list[Frame]:
        """So many next ones, evaluated."""
        frames = [self.drawn(self.view()) for _ in range(number)]
        dr.eval(frames)
        return frames

    def moved(self) -> Iterator[Frame]:
        """Frames to update to, without end: of every next one number, time and poses are others, where anything moves."""
        scene, now = self.renderer.scene, self.frame.time
        while True:
            share = next(self._times)
            if self.before is None or not scene.moves(self.before, now):
                yield self.frame
                continue
            time = now + (self.before - now) * EARLIER * share
            poses = opaque(mi.Float, scene.poses(time).astype(np.float32).ravel())
            yield replace(self.frame, index=int(share * scene.frames), time=time, poses=poses)

    def _aside(self, angle: float, pixels: float) -> Camera:
        """The camera with its eye aside by so many pixels, in a direction of the picture; it looks at what it looked at."""
        eye, (right, down, _) = np.asarray(self.camera.eye, np.float64), self.camera.axes()
        focal = 0.5 * self.renderer.height / np.tan(0.5 * np.radians(self.camera.fov_deg))
        reach = pixels * np.linalg.norm(self.camera.target - eye) / focal
        x, y, z = eye + reach * (np.cos(angle) * right + np.sin(angle) * down)
        return replace(self.camera, eye=(float(x), float(y), float(z)))


def _union(boxes: tuple[tuple[int, int, int, int], ...]) -> tuple[int, int, int, int]:
    left, top, right, bottom = zip(*boxes, strict=True)
    return min(left), min(top), max(right), max(bottom)
