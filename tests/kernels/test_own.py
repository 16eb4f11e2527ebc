"""Mirrors that are not convex, in themselves: where one hides its own point, and where its reflection meets it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.answers import lanes
from support.mirror_room import mirror_room, shaded

from benchharness.render.frame import FrameRenderer
from methods.image_space_search import ImageSpaceSearch
from methods.newton import Newton
from methods.ray_traced import RayTraced
from methods.secant_triangle import SecantTriangle
from scenes.stress.lobes import lobes
from scenes.stress.zones import zones

ALL = {"newton": Newton(), "secant_triangle": SecantTriangle(resolution=64), "image_space_search": ImageSpaceSearch()}
every_method = pytest.mark.parametrize("name", ALL)
SIZE = (96, 72)
SHORT = 0.995  # of the way from the eye to a point: facets beside it bulge less than the rest


def first_met(eye: np.ndarray, to: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Share of the way from `eye` to each point [N, 3] at which a mesh is first met, inf if it is not; Cramer's rule."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    e1, e2, s = b - a, c - a, eye - a
    q = np.cross(s, e1)
    found = []
    for d in to - eye:
        h = np.cross(d, e2)
        det = (e1 * h).sum(1)
        with np.errstate(divide="ignore", invalid="ignore"):
            u, v, t = (s * h).sum(1) / det, q @ d / det, (e2 * q).sum(1) / det
        found.append(np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), t, np.inf).min())
    return np.array(found)


@every_method
def test_no_reflection_point_is_where_the_mirror_hides_it_from_the_eye(name):
    """F-26. Rays against all triangles, one by one."""
    made = lobes(0.6)
    (answer,) = shaded(ALL[name], made, 0, size=SIZE)
    vertices, mesh = answer.reflection.vertices, made.reflectors[0].mesh
    assert vertices is not None
    called = np.array(vertices.converged)
    assert called.sum() > 20
    R = lanes(vertices.R)[called]
    assert (first_met(np.array(made.camera(0.0).eye, float), R, mesh.vertices, mesh.faces) > SHORT).all()


@every_method
def test_a_mirror_is_black_where_it_meets_itself_and_else_shows_what_is_behind(name):
    """But for triangles that lie nearer by mistake: with one reflection per vertex, corners may have different roots."""
    made = zones(0.35)
    renderer = FrameRenderer(made, *SIZE)
    methods = (ALL[name], replace(ALL[name], self_reflection="omitted"), RayTraced(bounces=1))
    black, omitted, truth = (shaded(method, made, 0, size=SIZE, renderer=renderer)[0] for method in methods)
    meets = truth.active & (truth.L.max(axis=2) == 0)
    assert meets.sum() > 0.3 * truth.active.sum()
    assert (black.L[meets].max(axis=1) == 0).mean() > 0.9
    assert (omitted.L[meets].max(axis=1) > 0).mean() > 0.9
    same = truth.active & ~meets & (black.L.max(axis=2) > 0)
    assert same.sum() > 0.9 * (truth.active & ~meets).sum() and (black.L == omitted.L)[same].all()


@every_method
def test_a_convex_mirror_does_not_ask(name):
    black, omitted = (shaded(replace(ALL[name], self_reflection=own), mirror_room(), 0)[0] for own in ("black", "omitted"))
    assert black.same(omitted)
