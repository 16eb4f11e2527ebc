"""What lies flush with a mirror's facets: a hair behind them nothing is seen of it; where it cuts them, what is before."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from support.mirror_room import EYE, mirror_ball, plain, scene, shaded, walls
from support.tiers import first

from benchharness.scene import Mesh, Object
from methods.image_space_search import ImageSpaceSearch
from methods.newton import Newton
from methods.ray_traced import RayTraced
from methods.secant_triangle import SecantTriangle

METHODS = [ImageSpaceSearch, SecantTriangle, Newton]
BALL = mirror_ball(fine=48)
SIZE = float(np.linalg.norm(np.ptp(BALL.mesh.vertices, axis=0)))
DIFFERS = 0.1  # of radiance; the patch and the walls differ by more, two walls' neighbouring pixels by less
CHANGED = 2e-3  # share of the mirror's pixels, at the patch's edge
CUT = 0.03  # share where it cuts: triangles end within a quarter pixel of an edge that leaves the facet at a ten-thousandth


def patch(before: float, tilted: bool) -> Object:
    """The facets that face the eye, apart from each other, moved along their normals by `before` of the mirror's size; tilted:
    one end before and the other behind."""
    mesh = BALL.mesh
    facing = mesh.vertices[mesh.faces].mean(axis=1) @ (np.array(EYE) / np.linalg.norm(EYE)) > 0.42
    p = mesh.vertices[mesh.faces[facing]]
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    side = np.sign((p - p.mean(axis=1, keepdims=True)) @ [0.3, 0.5, 0.8]) if tilted else np.ones(p.shape[:2])
    p = p + before * SIZE * side[..., None] * normal[:, None]
    made = Mesh(p.reshape(-1, 3), np.arange(3 * len(p)).reshape(-1, 3))
    return Object("patch", plain(made, (0.9, 0.1, 0.1)), "what is flush")


@cache
def answer(method: type, before: float | None, tilted: bool = False):
    objects = (walls(),) if before is None else (walls(), patch(before, tilted))
    return shaded(method(), scene(objects, (BALL,)), 0)[0]


def differs(one, other) -> np.ndarray:
    return one.active & other.active & (np.abs(one.L - other.L).max(axis=-1) > DIFFERS)


@pytest.mark.parametrize("before", first([-1e-6, -1e-5, -5e-5, -2e-4], [-1e-6, -2e-4]))
@pytest.mark.parametrize("method", METHODS)
def test_a_hair_behind_the_facets_nothing_of_it_is_seen(method, before):
    without, seen = answer(method, None), answer(method, before)
    assert seen.active.sum() == without.active.sum() > 4000
    assert differs(without, seen).sum() <= CHANGED * seen.active.sum()


@pytest.mark.parametrize("before", first([1e-6, 1e-5, 5e-5, 2e-4], [1e-6, 2e-4]))
@pytest.mark.parametrize("method", METHODS)
def test_where_it_cuts_the_facets_the_rest_of_the_mirror_shows_the_room(method, before):
    exact, seen = answer(RayTraced, before, True), answer(method, before, True)
    assert 0.3 < seen.active.sum() / answer(method, None).active.sum() < 0.9
    assert differs(exact, seen).sum() <= CUT * seen.active.sum()
