"""Textures of reflection points in closed form, for the search in image space."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
from support.truth_shapes import Plane, Quadric

from benchharness.scene import Camera

SIZE = 256
EYE = np.array([0.0, -4.0, 0.0])
SHAPES = {
    "sphere": Quadric((1.0, 1.0, 1.0)),
    "ellipsoid": Quadric((1.0, 1 / 0.6**2, 1 / 1.4**2)),
    "cylinder": Quadric((1.0, 1.0, 0.0)),
    "plane": Plane(),
}


def camera(fov_deg=40.0, eye=EYE):
    return Camera(tuple(eye), (0.0, 0.0, 0.0), fov_deg)


def texture(shape, cam, size=SIZE):
    right, down, forward = cam.axes()
    focal = 0.5 * size / np.tan(0.5 * np.radians(cam.fov_deg))
    x, y = np.meshgrid(np.arange(size) + 0.5 - 0.5 * size, np.arange(size) + 0.5 - 0.5 * size)
    d = forward + x[..., None] / focal * right + y[..., None] / focal * down
    t = shape.hit(np.asarray(cam.eye), d)
    n = shape.normal(np.asarray(cam.eye) + np.nan_to_num(t)[..., None] * d)
    covered = np.isfinite(t)[..., None]
    texels = np.where(covered, np.concatenate([np.nan_to_num(t)[..., None], n], axis=-1), 0)
    return mi.Float(texels.astype(np.float32).ravel())


def on_screen(points, cam=None, size=SIZE):
    M = (cam or camera()).world_to_screen(size, size)
    q = np.asarray(points) @ M[:, :3].T + M[:, 3]
    return q[:, :2] / q[:, 2:]
