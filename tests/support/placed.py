"""Vertices before a mirror's kernels: the oracles' eye, a picture with a focal length of 800 px, and answers on the host."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
from support.star_shapes import Star

from benchharness.kernels import placement
from benchharness.kernels.vertices import starmap
from benchharness.render.frame import view_of
from benchharness.scene import Camera

EYE, FPX = np.array([0.0, 0.0, 4.0]), 800.0
WIDTH, HEIGHT = 720, 512


def camera(eye=EYE, target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0)) -> Camera:
    return Camera(tuple(eye), tuple(target), 2 * np.degrees(np.arctan(0.5 * HEIGHT / FPX)), tuple(up))


def view(eye=EYE, target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0)):
    return view_of(camera(eye, target, up), WIDTH, HEIGHT, 0.01)


def points(values) -> mi.Point3f:
    return mi.Point3f(np.ascontiguousarray(np.asarray(values, np.float32).T))


def host(array) -> np.ndarray:
    """A point array, float64 [N, 3]."""
    return np.array(array, np.float64).T


def rows(pose) -> list[mi.Vector4f]:
    """A pose [4, 4] as the kernels take it."""
    return [mi.Vector4f(*(float(v) for v in row)) for row in np.asarray(pose)[:3]]


def place(V, eye=EYE, target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), pose=None) -> placement.MirrorFrame:
    """Vertices [N, 3] and the eye, of the world, for a mirror with a pose."""
    return placement.mirror_frame(rows(np.eye(4) if pose is None else pose), points(V), view(eye, target, up))


def off_px(one, other, eye=EYE, target=(0.0, 0.0, 0.0)) -> np.ndarray:
    """Distance in the picture between points of the world [N, 3]."""
    matrix = camera(eye, target).world_to_screen(WIDTH, HEIGHT)

    def pixel(p):
        q = np.asarray(p, float) @ matrix[:, :3].T + matrix[:, 3]
        return q[..., :2] / q[..., 2:]

    return np.linalg.norm(pixel(one) - pixel(other), axis=-1)


def mapped(shape: Star, n: int = 128, side: float = 1.0) -> starmap.StarMap:
    """A shape's closed form at the texels of a map with n per edge of a face."""
    d = starmap.directions(n)
    return starmap.packed(shape.r(d)[:, 0], shape.grad_r(d), np.ones(len(d), bool), shape.origin, side, n)
