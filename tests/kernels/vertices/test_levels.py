"""Simplified meshes against brute force: how far they are off, and which triangle each of theirs stands for."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from support.mirror_room import ball
from support.small_room import box

from benchharness.kernels.vertices import levels
from benchharness.scene import subdivided


def distances(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Of each point [N, 3] to each triangle [F, 3, 3], float [N, F]: to its inside, its edges, or its corners."""
    best = np.full((len(points), len(corners)), np.inf)
    for k in range(3):
        a, b = corners[:, k], corners[:, (k + 1) % 3]
        along = b - a
        t = ((points[:, None] - a) * along).sum(-1) / np.maximum((along**2).sum(-1), 1e-30)
        best = np.minimum(best, np.linalg.norm(a + np.clip(t, 0, 1)[..., None] * along - points[:, None], axis=-1))
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    n /= np.maximum(np.linalg.norm(n, axis=1), 1e-30)[:, None]
    height = ((points[:, None] - corners[:, 0]) * n).sum(-1)
    foot = points[:, None] - height[..., None] * n
    inside = np.ones(height.shape, bool)
    for k in range(3):
        a, b = corners[:, k], corners[:, (k + 1) % 3]
        inside &= (np.cross(b - a, foot - a) * n).sum(-1) >= 0
    return np.where(inside, np.abs(height), best)


def grid(n: int = 12) -> tuple[np.ndarray, np.ndarray]:
    """A flat square of 2 n n triangles."""
    x, y = np.meshgrid(np.linspace(0, 3, n + 1), np.linspace(0, 3, n + 1))
    at = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    a, b, c, d = at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]), faces


MESHES = {
    "ball": lambda: (lambda m: (m.vertices, m.faces))(ball(0.5, (1, 2, 3), (1, 1, 1), 3)),
    "grid": grid,
    "box": lambda: (lambda m: (m.vertices, m.faces))(subdivided(box((0, 0, 0), (1, 2, 3)), 0.3)),
}


@pytest.mark.parametrize("name", MESHES)
def test_no_vertex_is_farther_from_a_level_than_it_says(name):
    vertices, faces = MESHES[name]()
    chain = levels.chain(vertices, faces)
    assert len(chain) >= 2 and chain[0].error == 0
    for level in chain:
        apart = distances(np.asarray(vertices), level.vertices[level.faces]).min(axis=1).max()
        assert apart <= level.error + 1e-6
        # and it says not much more: it looks at few triangles for each vertex
        assert level.error <= 1.5 * apart + 0.002 * np.linalg.norm(np.ptp(vertices, axis=0))
    assert [x.error for x in chain] == sorted(x.error for x in chain)
    sizes = [len(x.faces) for x in chain]
    assert all(b <= levels.SHRINKS * a for a, b in pairwise(sizes)) and sizes[-1] < len(faces) / 6


@pytest.mark.parametrize("name", MESHES)
def test_a_triangle_names_the_nearest_of_the_mesh(name):
    vertices, faces = MESHES[name]()
    for level in levels.chain(vertices, faces):
        middles = level.vertices[level.faces].mean(axis=1)
        apart = distances(middles, np.asarray(vertices)[faces])
        size = np.linalg.norm(np.ptp(vertices, axis=0))
        np.testing.assert_allclose(apart[np.arange(len(middles)), level.names], apart.min(axis=1), atol=0.002 * size)


@pytest.mark.parametrize("scale", [1e-5, 1e-2, 1e5])
def test_a_millimetre_is_simplified_as_a_metre(scale):
    one = ball(0.5, (1, 2, 3), (1, 1, 1), 3)
    usual, other = (levels.chain(s * one.vertices, one.faces) for s in (1.0, scale))
    assert [len(level.faces) for level in other] == [len(level.faces) for level in usual]
    assert [level.error for level in other] == pytest.approx([scale * level.error for level in usual], rel=1e-6)


def test_what_is_flat_takes_few_triangles():
    vertices, faces = grid()
    flat = [level for level in levels.chain(vertices, faces) if level.error < 1e-6]
    assert len(flat[-1].faces) < len(faces) / 3


def test_vertices_at_one_place_are_one():
    made = ball(0.5, (0, 0, 0), (1, 1, 1), 2)
    torn = made.vertices[made.faces].reshape(-1, 3)
    first = levels.chain(torn, np.arange(len(torn)).reshape(-1, 3))[0]
    assert len(first.vertices) == len(made.vertices) and (first.names == np.arange(len(made.faces))).all()
    corners = first.vertices[first.faces]
    np.testing.assert_array_equal(corners, made.vertices[made.faces])


def test_triangles_without_area_are_left_out_and_a_mesh_of_nothing_else_stays():
    vertices, faces = grid(3)
    more = np.concatenate([[[0, 0, 1]], faces])
    assert (levels.chain(vertices, more)[0].names == np.arange(1, len(more))).all()
    (only,) = levels.chain(vertices[:2], np.array([[0, 1, 1]]))
    assert only.faces.shape == (1, 3) and only.error == 0
