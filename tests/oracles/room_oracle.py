"""A mirror ball in a box of linear colours, and its picture in closed form: float64, spheres and planes, no mesh.

Radiance is linear in the position, so that interpolating it over triangles of any size is exact. The ball of the scene is a
mesh; at FINE segments its facets lie within r (1 - cos(π / FINE)) = 1.4e-4 radii of the ball.
"""

from __future__ import annotations

import numpy as np
from support.small_room import box, sphere

from benchharness.scene import Camera, Mesh, Object, Reflector, Scene, subdivided

HALF, RADIUS, FINE = 2.0, 0.5, 192
EYE, FOV_DEG = np.array([0.4, -1.7, 0.5]), 40.0


def radiance(p: np.ndarray) -> np.ndarray:
    """At points [N, 3] of a room of half size HALF around the origin, [N, 3] in [0.2, 0.8]."""
    return 0.5 + 0.2 * (p + 0.5 * np.roll(p, 1, axis=1)) / HALF


def room(scale: float = 1.0, at=(0.0, 0.0, 0.0), h: float = 0.35, inside: bool = True) -> Scene:
    """The scene, `scale` times as large around `at`; edges of walls are at most `h` long, before scaling."""
    at = np.asarray(at, float)
    walls = subdivided(box(-HALF * np.ones(3), HALF * np.ones(3), inside=inside), h)
    ball = sphere(RADIUS, (0, 0, 0), FINE, FINE // 2)
    camera = Camera(tuple(scale * EYE + at), tuple(at), FOV_DEG)
    shown = Mesh(scale * walls.vertices + at, walls.faces, radiance=radiance(walls.vertices))
    mirror = Mesh(scale * ball.vertices + at, ball.faces, ball.normals)
    return Scene(
        "room", (Object("walls", shown, "something on every side"),), (Reflector("ball", mirror, mirror),), lambda t: camera, 1
    )


def picture(size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Radiance [H, W, 3] and the ball's mask [H, W], rays through pixel centres."""
    width, height = size
    forward = -EYE / np.linalg.norm(EYE)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    focal = 0.5 * height / np.tan(0.5 * np.radians(FOV_DEG))
    x, y = np.meshgrid(np.arange(width) + 0.5 - 0.5 * width, np.arange(height) + 0.5 - 0.5 * height)
    d = forward + (x[..., None] * right + y[..., None] * down) / focal
    d = (d / np.linalg.norm(d, axis=-1, keepdims=True)).reshape(-1, 3)
    o = np.broadcast_to(EYE, d.shape)

    # The ball: |o + t d| = r; from its first point the ray goes on mirrored.
    b, c = (o * d).sum(axis=1), (o * o).sum(axis=1) - RADIUS**2
    mask = b * b > c
    t = np.where(mask, -b - np.sqrt(np.where(mask, b * b - c, 0)), 0)
    p = o + t[:, None] * d
    n = p / RADIUS
    d = np.where(mask[:, None], d - 2 * (d * n).sum(axis=1, keepdims=True) * n, d)

    # The box from within: the nearest of the planes ahead.
    with np.errstate(divide="ignore"):
        t = ((np.where(d > 0, HALF, -HALF) - p) / d).min(axis=1)
    return radiance(p + t[:, None] * d).reshape(height, width, 3), mask.reshape(height, width)
