"""Into a mirror's own space and back."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
from scipy.spatial.transform import Rotation
from support.placed import HEIGHT, WIDTH, camera, host, place, points, rows

from benchharness.kernels import placement

POSE = np.eye(4)
POSE[:3, :3] = Rotation.from_rotvec((0.7, -1.1, 0.4)).as_matrix()
POSE[:3, 3] = [2.0, -1.0, 3.0]
EYE = np.array([1.0, 5.0, -2.0])
V = np.random.default_rng(0).normal(size=(50, 3))


def test_there_is_where_the_inverse_pose_takes_it():
    where = place(V, EYE, (0.3, 0.1, 0.2), pose=POSE)
    np.testing.assert_allclose(host(where.V), (V - POSE[:3, 3]) @ POSE[:3, :3], atol=2e-6)
    np.testing.assert_allclose(host(where.eye), [(EYE - POSE[:3, 3]) @ POSE[:3, :3]], atol=2e-6)


def test_a_point_has_the_pixel_that_it_has_in_the_world():
    local = (V - POSE[:3, 3]) @ POSE[:3, :3]
    x, y = place(V, EYE, (0.3, 0.1, 0.2), pose=POSE).pixel(points(local))
    q = np.column_stack([V, np.ones(len(V))]) @ camera(EYE, (0.3, 0.1, 0.2)).world_to_screen(WIDTH, HEIGHT).T
    # Float32 of coordinates of a few metres and 800 pixels.
    np.testing.assert_allclose(np.array([x, y]).T, q[:, :2] / q[:, 2:], atol=2e-3)


def test_back_again_points_move_and_normals_turn():
    there = points((V - POSE[:3, 3]) @ POSE[:3, :3])
    np.testing.assert_allclose(host(placement.point_to_world(rows(POSE), there)), V, atol=2e-6)
    np.testing.assert_allclose(
        host(placement.normal_to_world(rows(POSE), mi.Normal3f(points(V)))), V @ POSE[:3, :3].T, atol=2e-6
    )


def test_poses_are_read_by_part():
    poses = np.stack([np.eye(4)[:3], POSE[:3], np.arange(12.0).reshape(3, 4)])
    for part in range(3):
        read = placement.pose_of(mi.Float(poses.astype(np.float32).ravel()), mi.UInt32(part))
        np.testing.assert_allclose(np.array([np.array(row).ravel() for row in read]), poses[part], atol=1e-6)


def test_the_direction_of_nothing_is_nothing_and_of_all_else_has_length_one():
    v = np.array([[0, 0, 0], [1e-15, 0, 0], [3e5, -4e5, 0], [0, 0, -2]], float)
    got = host(placement.unit(mi.Vector3f(points(v))))
    np.testing.assert_allclose(got, [[0, 0, 0], [1, 0, 0], [0.6, -0.8, 0], [0, 0, -1]], atol=1e-6)
