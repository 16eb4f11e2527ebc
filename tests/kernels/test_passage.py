"""Boxes that hold a scene, and rays past them: closed forms, and float64 rays through triangles."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.mirror_room import mirror_ball, plain, scene, walls
from support.placed import points
from support.small_room import box, sphere

from benchharness.kernels import boxes, passage
from benchharness.scene import Object, subdivided


def arrays(*meshes):
    return [(mesh.vertices, mesh.faces) for mesh in meshes]


def turned(mesh, degrees: float):
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec([0, 0, np.radians(degrees)]).as_matrix()
    return mesh.transformed(pose)


ROOM = subdivided(box((-2, -2, -2), (2, 2, 2), inside=True), 0.3)
BALL = sphere(0.5, (0.0, 1.0, 0.0), 32, 16)


@pytest.mark.parametrize("most", [1, 7, 64])
def test_every_triangle_is_in_a_box_of_its_part(most):
    parts = arrays(ROOM, BALL, turned(ROOM, 30))
    rows, owner = boxes.boxes(parts, most)
    assert max(most, len(parts)) <= len(rows) < max(most, len(parts)) + 6
    for part, (vertices, faces) in enumerate(parts):
        q = (
            np.einsum("bij,fkj->bfki", rows[owner == part][:, :, :3], vertices[faces])
            + rows[owner == part][:, None, None, :, 3]
        )
        assert (np.abs(q).max(axis=(2, 3)) <= 1).any(axis=0).all()


@pytest.mark.parametrize("degrees", [0, 30, 45])
def test_the_boxes_of_a_room_are_its_walls_however_it_is_turned(degrees):
    """Its middle, four fifths as wide, is in none."""
    rows, _ = boxes.boxes(arrays(turned(ROOM, degrees)), 64)
    inside = (
        np.random.default_rng(0).uniform(-1.6, 1.6, (500, 3)) @ Rotation.from_rotvec([0, 0, np.radians(degrees)]).as_matrix().T
    )
    held = (np.abs(np.einsum("bij,nj->bni", rows[:, :, :3], inside) + rows[:, None, :, 3]) <= 1).all(axis=2)
    assert held.any(axis=0).mean() < 0.05


def met(made, own: int, o, d) -> np.ndarray:
    poses = mi.Float(made.poses(0.0).astype(np.float32).ravel())
    there = passage.meets(
        passage.of_scene(made),
        poses,
        mi.UInt32(np.full(len(o), own)),
        points(o),
        mi.Vector3f(points(d)),
        mi.Bool([True] * len(o)),
    )
    return np.array(there)


def test_a_ray_meets_the_box_of_a_part_where_it_stands_and_its_own_part_never():
    """A box is its own box: slabs in float64 say what is met."""

    def pose(time):
        made = np.eye(4)
        made[:3, :3], made[:3, 3] = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix(), [1.0, 0.5, -0.3]
        return made

    half = np.array([0.6, 0.2, 0.4])
    thing = Object("thing", plain(box(-half, half), (0.5, 0.5, 0.5)), "stands turned", pose)
    made = scene([thing], [mirror_ball(fine=8)])
    rng = np.random.default_rng(1)
    o, d = rng.normal(size=(2, 20000, 3)) + pose(0)[:3, 3] * [[[1]], [[0]]]
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    p, w = (o - pose(0)[:3, 3]) @ pose(0)[:3, :3], d @ pose(0)[:3, :3]

    def hit(size):
        one, two = (-size - p) / w, (size - p) / w
        return np.maximum(np.minimum(one, two).max(axis=1), 0) <= np.maximum(one, two).min(axis=1)

    # The mirror stands there too, its box is not asked; boxes are padded by a few ten thousandths.
    found = met(made, 1, o, d)
    assert (found >= hit(half - 1e-5)).all() and (found <= hit(half + 1e-3)).all()
    assert 1000 < found.sum() < 19000
    assert not met(scene([], [mirror_ball(fine=8)]), 0, o, d).any()


def test_a_ray_along_a_wall_is_no_division_by_zero():
    made = scene([walls()], [mirror_ball(fine=8)])
    o, d = np.array([[0.0, 0, 0], [0, 0, 3], [0, 0, 2]]), np.array([[1.0, 0, 0], [1, 0, 0], [1, 0, 0]])
    assert met(made, 1, o, d).tolist() == [True, False, True]
