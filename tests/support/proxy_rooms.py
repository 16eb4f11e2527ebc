"""Rooms that are proxies themselves, a thing in them that is not, and how far from the truth a method shows them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import binary_erosion
from support.mirror_room import ball, lit, mirror_ball, scene, shaded, smooth, still
from support.small_room import box

from benchharness.render.frame import FrameRenderer
from benchharness.scene import Object, Scene
from methods.ray_traced import RayTraced

RED = (0.9, 0.1, 0.1)
SIZE = (120, 90)
WAY = np.array([0.8, -0.45, 0.4]) / np.linalg.norm([0.8, -0.45, 0.4])


def red(at, radius: float = 0.2) -> Object:
    return Object("red", ball(radius, at, RED), "something that is not on the proxy")


def dome(*things: Object, radius: float = 2.0) -> Scene:
    """A sphere of smooth colours about a mirror ball; facets leave it by a thousandth of the radius."""
    shape = ball(radius, (0, 0, 0), (0, 0, 0), 5)
    walls = replace(shape, faces=shape.faces[:, ::-1], normals=-shape.normals, radiance=smooth(shape.vertices, radius / 2))
    return scene((Object("dome", walls, "something on every side"), *things), (mirror_ball(),))


def hall(axes: np.ndarray, at, half=(4.0, 2.0, 1.25), mirror=(1.5, 0.4, -0.3), *things: Object) -> Scene:
    """A box of unlike sides, turned and shifted, with a mirror ball away from its middle."""
    at, half = np.asarray(at, float), np.asarray(half, float)
    walls = lit(box(-half, half, inside=True), 0.4)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = axes.T, at

    def there(p) -> tuple[float, ...]:
        return tuple((np.asarray(p, float) @ axes + at).tolist())

    middle = np.asarray(mirror, float)
    camera = still(there(middle + np.array([0.2, -1.4, 0.3])), there(middle))
    return scene((Object("walls", walls.transformed(pose), "walls"), *things), (mirror_ball(center=there(middle)),), camera)


class Truth:
    """A scene traced once, for methods to be held against."""

    def __init__(self, made: Scene) -> None:
        self.scene, self.renderer = made, FrameRenderer(made, *SIZE)
        self.answer = self.of(RayTraced())
        self.inner: np.ndarray = np.array(binary_erosion(self.answer.active, iterations=2), bool)

    def of(self, method):
        return shaded(method, self.scene, 0, renderer=self.renderer)[0]

    def error(self, method) -> float:
        """Root mean square of radiance, away from the outline."""
        off = np.square(self.of(method).L - self.answer.L)
        return float(np.sqrt(off[self.inner].mean()))

    def missed(self, method) -> float:
        """Share of the red pixels, the method's and the true ones, that are not both."""
        seen, true = (reddish(answer) for answer in (self.of(method), self.answer))
        return float((seen ^ true).sum() / (seen | true).sum())

    def judged(self, method, off: float = 0.1) -> tuple[float, float, float]:
        """Shares: wrong by more than `off`; doubted of the wrong; doubted of what is right within a pixel around."""
        one = self.of(method)
        doubt = np.array(one.reflection.doubt).reshape(one.active.shape) & one.active
        wrong = one.active & (np.abs(one.L - self.answer.L).max(axis=2) > off)
        near = wrong.copy()
        for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1)):
            near |= np.roll(wrong, step, axis)
        right = one.active & ~near
        recall = (doubt & wrong).sum() / max(int(wrong.sum()), 1)
        return float(wrong.sum() / one.active.sum()), float(recall), float((doubt & right).sum() / right.sum())


def reddish(answer) -> np.ndarray:
    return answer.active & (np.abs(answer.L - RED).max(axis=2) < 0.1)
