"""Normals of faces that came without."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from benchharness.modelling.creases import BY_ANGLE, FLAT, creased, smoothed

CUBE = trimesh.creation.box()


def test_a_box_of_eight_vertices_has_a_crease_along_every_edge():
    vertices, faces, normals = creased(CUBE.vertices, CUBE.faces)
    assert len(vertices) == 24
    assert np.abs(normals).max(axis=1) == pytest.approx(np.ones(24), abs=1e-12)
    flat = np.cross(*np.moveaxis(np.diff(vertices[faces], axis=1), 1, 0))
    assert np.einsum("fi,fki->fk", flat, normals[faces]).min() > 0.99


@pytest.mark.parametrize("subdivisions", [0, 1, 3])
def test_a_ball_is_smooth_however_coarse_and_its_normals_are_nearly_exact(subdivisions):
    ball = trimesh.creation.icosphere(subdivisions=subdivisions)
    vertices, _, normals = creased(ball.vertices, ball.faces)
    assert len(vertices) == len(ball.vertices)
    assert np.abs(normals - vertices).max() < 0.02


def test_a_seam_in_the_file_is_no_crease():
    ball = trimesh.creation.icosphere(subdivisions=2)
    soup = ball.vertices[ball.faces].reshape(-1, 3)
    vertices, _, normals = creased(soup, np.arange(len(soup)).reshape(-1, 3))
    assert len(vertices) == len(ball.vertices)
    assert np.abs(normals - vertices).max() < 0.02


def test_faces_wound_at_random_get_the_normals_of_faces_wound_alike():
    ball = trimesh.creation.icosphere(subdivisions=2)
    turn = np.random.default_rng(1).random(len(ball.faces)) < 0.3
    vertices, _, normals = creased(ball.vertices, np.where(turn[:, None], ball.faces[:, ::-1], ball.faces))
    assert np.abs(normals - vertices).max() < 0.02


def test_the_angle_decides():
    # Two squares that meet at 50 degrees: smooth below the crease's 60, not below 45.
    c, s = np.cos(np.radians(50)), np.sin(np.radians(50))
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [-c, 0, s], [-c, 1, s]], float)
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 5], [0, 5, 4]])
    assert [len(creased(vertices, faces, angle)[0]) for angle in (60.0, 45.0)] == [6, 8]


def test_a_hexagonal_prism_has_a_crease_along_every_edge_however_it_is_turned_and_rounded():
    # Its sides turn by 60 degrees, up to rounding. Each of 6 sides has 4 vertices, each end 6 and the one in its middle.
    prism = trimesh.creation.cylinder(radius=1.0, height=1.0, sections=6)
    rng = np.random.default_rng(0)
    for _ in range(5):
        turned = prism.vertices @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
        assert len(creased(turned.astype(np.float32).astype(float), prism.faces)[0]) == 38


def test_smoothing_groups_decide_in_place_of_the_angle():
    group = np.arange(len(CUBE.faces)) // 6  # half of the triangles each
    whole = smoothed(CUBE.vertices, CUBE.faces, groups=np.ones(12, int))
    assert len(whole[1]) == 8
    assert len(smoothed(CUBE.vertices, CUBE.faces, groups=np.full(12, FLAT))[1]) == 36
    vertex, normals = smoothed(CUBE.vertices, CUBE.faces, groups=group + 1)
    assert not {*vertex[group == 0].reshape(-1)} & {*vertex[group == 1].reshape(-1)}
    assert len(normals) > 8
    by_angle = smoothed(CUBE.vertices, CUBE.faces, groups=np.full(12, BY_ANGLE))
    assert len(by_angle[1]) == 24 == len(smoothed(CUBE.vertices, CUBE.faces)[1])
