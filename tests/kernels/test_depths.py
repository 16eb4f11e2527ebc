"""Depths told from where the mirrors are: what is on the ray through a pixel projects to it, and is as deep as it was asked."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest

from benchharness.kernels import depths
from benchharness.render.frame import FAR, view_of
from benchharness.scene import Camera

WIDTH, HEIGHT = 96, 72


@pytest.mark.parametrize("distance", [3.0, 10_000.0])
def test_a_point_on_a_ray_projects_to_its_pixel_and_has_the_depth_that_was_asked_for(distance):
    camera = Camera((0.0, -distance, 0.3), (0.1, 0.0, 0.0), 2 * np.degrees(np.arctan(0.6 / distance)))
    view = view_of(camera, WIDTH, HEIGHT, 0.01)
    away = float(view.depth[0])
    assert (away > 0) == (distance >= FAR)
    wanted = np.array([-0.4, -0.1, 0.2, 0.5]) + (0.0 if away else distance)
    columns, rows = np.array([3.5, 40.0, 77.25, 95.0]), np.array([1.0, 70.5, 30.0, 12.5])
    p = np.array(depths.on_ray(view, mi.Float(columns), mi.Float(rows), mi.Float(wanted)), np.float64).T
    q = p @ camera.world_to_screen(WIDTH, HEIGHT)[:, :3].T + camera.world_to_screen(WIDTH, HEIGHT)[:, 3]
    # Float32 holds points near the origin to a millionth; seen from afar, a pixel is a hundredth of a unit there.
    np.testing.assert_allclose(q[:, :2] / q[:, 2:], np.stack([columns, rows], axis=1), atol=1e-3)
    np.testing.assert_allclose(q[:, 2], away + wanted, atol=2e-6 * max(1.0, away))
    np.testing.assert_allclose(np.array(depths.offset(view, mi.Point3f(p.T.astype(np.float32)))), wanted, atol=2e-6)
