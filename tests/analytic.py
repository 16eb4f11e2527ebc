"""Frames of the mirror ball of `check.tiny_scene` without a rasterizer: the sphere is met by formula, in float64."""

from __future__ import annotations

import mitsuba as mi
import numpy as np

from benchharness.api import Frame, View

RADIUS = 0.6


class Renderer:
    """Stands in for `frame.FrameRenderer`."""

    def __init__(self, scene, width, height):
        self.scene, self.width, self.height = scene, width, height

    def render(self, index: int) -> Frame:
        camera = self.scene.camera(self.scene.time(index))
        eye, (right, down, forward) = np.array(camera.eye), camera.axes()
        pixel = 2.0 * np.tan(0.5 * np.radians(camera.fov_deg)) / self.height
        y, x = (np.mgrid[: self.height, : self.width] + 0.5).reshape(2, -1, 1)
        d = forward + (x - 0.5 * self.width) * pixel * right + (y - 0.5 * self.height) * pixel * down
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        # |eye + t d| = RADIUS, the nearer root.
        b, c = d @ eye, eye @ eye - RADIUS**2
        active = b * b > c
        t = np.where(active, -b - np.sqrt(np.where(active, b * b - c, 0.0)), 1.0)[:, None]
        p = eye + t * d
        flat = [mi.Vector4f(0.0)] * 3 + [mi.Vector3f(0.0)] * 3
        return Frame(
            index=index,
            time=self.scene.time(index),
            view=View(mi.Point3f(*eye.tolist()), *flat, mi.Float(0.01), self.width, self.height),
            poses=mi.Float(self.scene.poses(self.scene.time(index)).ravel().astype(np.float32)),
            reflector=mi.Int32(np.where(active, 0, -1)),
            active=mi.Bool(active),
            pixels=mi.UInt32(np.flatnonzero(active)),
            p=mi.Point3f(np.float32(p.T)),
            n=mi.Normal3f(np.float32((p / RADIUS).T)),
            v=mi.Vector3f(np.float32(-d.T)),
            radiance=mi.Color3f(0.0),
            surfaces=[],
            proxies=[],
        )
