"""Absence of an answer is no answer: what a method draws nothing for is the surroundings only where a ray can come from there,
and doubted where something may have been lost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from support.mirror_room import ball, lit, mirror_ball, scene, shaded, still
from support.small_room import box
from support.star_shapes import Bumpy
from support.tiers import first

from benchharness.measure.bench import Bench
from benchharness.render.reference import ReferenceOptions
from benchharness.scene import Mesh, Object, Reflector, merged
from methods.billboard_impostor import BillboardImpostor
from methods.depth_impostor import DepthImpostor
from methods.environment_map import EnvironmentMap
from methods.image_space_search import ImageSpaceSearch
from methods.newton import Newton
from methods.ray_traced import RayTraced
from methods.secant_triangle import SecantTriangle

SIZE = (80, 60)
SKY = (0.9, 0.2, 0.9)
SEVERAL = (Newton(multi=4), SecantTriangle(resolution=64, multi=4), ImageSpaceSearch(multi=4))
BY_IMAGE = (EnvironmentMap(), BillboardImpostor(), DepthImpostor(), RayTraced())

named = {"ids": lambda method: type(method).__name__}


def bumpy() -> Reflector:
    """A ball that is hollow in places, 0.9 across."""
    mesh = Bumpy(eps=0.3).mesh(3)
    mesh = replace(mesh, vertices=0.45 * mesh.vertices)
    return Reflector("mirror", mesh, mesh)


def room(sides: int = 6) -> Object:
    """A cube's first sides, seen from inside, as one mesh; the ceiling is the last."""
    whole = box((-2, -2, -2), (2, 2, 2), inside=True)
    four = [Mesh(whole.vertices[4 * k : 4 * k + 4], np.array([[0, 1, 2], [0, 2, 3]])) for k in range(6)]
    four.sort(key=lambda mesh: mesh.vertices[:, 2].min())
    return Object("walls", lit(merged(*four[:sides]), 0.5), "something on every side")


def octants() -> list[Object]:
    """A round room in eight pieces, as petals: pictures in planes through them leave gaps."""
    shell = trimesh.creation.icosphere(subdivisions=3, radius=2.0)
    corner = (shell.triangles_center > 0) @ [1, 2, 4]
    faces = [shell.faces[corner == k][:, ::-1] for k in range(8)]
    return [Object(f"petal {k}", lit(Mesh(shell.vertices, own), 1.0), "a piece of the wall") for k, own in enumerate(faces)]


@pytest.mark.exhaustive
@pytest.mark.parametrize("method", first(SEVERAL, SEVERAL[:1]), **named)
def test_within_walls_what_no_triangle_covers_is_not_found(method):
    """A third of the mirror. What triangles cover that should be behind others is wrong still, and half of that."""
    made = scene([room()], [bumpy()], background=SKY, frames=1)
    _, seen = Bench(made, SIZE, ReferenceOptions(max_depth=2, spp=2), None, 0, (1, 1)).show(0, "method", method)
    assert seen is not None
    known = seen.mask & seen.found
    assert np.isfinite(seen.distance[known]).all()
    assert 0.4 < known.sum() / seen.mask.sum() < 0.95
    assert seen.trusted().record["flip"] < 0.5 * seen.record["flip"]


@pytest.mark.parametrize("method", first(SEVERAL, SEVERAL[-1:]), **named)
def test_under_an_open_ceiling_what_was_lost_is_doubted_and_the_sky_is_not(method):
    """In a cube that is open above, float64: a ray reaches the sky if it comes to the plane above before that of a wall."""
    made = scene([room(5)], [bumpy()], background=SKY, frames=1)
    assert made.enclosed == (False,)
    (answer,) = shaded(method, made, 0, size=SIZE)
    p, n = (np.array(a, np.float64).T.reshape(*answer.active.shape, 3) for a in (answer.frame.p, answer.frame.n))
    v = np.asarray(made.camera(0.0).eye) - p
    v /= np.maximum(np.linalg.norm(v, axis=2, keepdims=True), 1e-300)
    d = 2 * (v * n).sum(axis=2, keepdims=True) * n - v
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(d > 0, (2 - p) / d, (-2 - p) / d)
    to_sky = (d[..., 2] > 0) & (t[..., 2] < np.minimum(t[..., 0], t[..., 1]))

    uncovered = answer.active & np.isinf(answer.distance)
    doubted = np.array(answer.reflection.doubt).reshape(answer.active.shape) | ~answer.found
    lost, sky = uncovered & ~to_sky, uncovered & to_sky
    assert min(lost.sum(), sky.sum()) > 0.05 * answer.active.sum()
    assert doubted[lost].mean() >= 0.95 and doubted[sky].mean() < 0.05
    assert answer.found[sky].all()


@pytest.mark.parametrize("method", (Newton(), SecantTriangle(resolution=64), ImageSpaceSearch()), **named)
def test_beside_a_convex_mirror_no_sky_is_doubted(method):
    """A vertex is reflected or hidden, so that no triangle is lost; edges' images are doubted within their bends."""
    made = scene(
        [Object("ball", ball(0.3, (0.9, -0.9, 0.4), (0.9, 0.1, 0.1)), "something near")], [mirror_ball()], background=SKY
    )
    (answer,) = shaded(method, made, 0, size=SIZE)
    sky = answer.active & np.isinf(answer.distance)
    assert sky.sum() > 0.5 * answer.active.sum()
    assert np.array(answer.reflection.doubt).reshape(sky.shape)[sky].mean() < 0.02


def angled() -> Object:
    """A room like an L around the corner (2, 2), 2 high, as one mesh seen from inside."""
    ring = np.array([[2, 2], [2, 4], [0, 4], [0, 0], [4, 0], [4, 2]], float)
    levels = [np.column_stack([ring, np.full(6, z)]) for z in (0.0, 2.0)]
    fan, i, k = [[0, j, j + 1] for j in range(1, 5)], np.arange(6), np.roll(np.arange(6), -1)
    caps = [fan, np.array(fan)[:, ::-1] + 6]
    sides = [np.stack([i, i + 6, k + 6], axis=1), np.stack([i, k + 6, k], axis=1)]
    return Object("walls", lit(Mesh(np.concatenate(levels), np.concatenate([*caps, *sides])), 0.5), "something on every side")


def test_a_map_taken_outside_of_the_room_has_no_answer_where_it_sees_the_surroundings():
    """Of two balls in the arms of an L, the middle is out beyond its corner."""
    balls = merged(*(mirror_ball("", (x, y, 1.0), 0.5, 32).mesh for x, y in ((3.2, 1.3), (1.3, 3.2))))
    camera = still((0.5, 0.5, 1.2), (1.9, 1.9, 1.0), 75.0)
    made = scene([angled()], [Reflector("mirror", balls, balls)], camera, background=SKY, frames=1)
    assert made.enclosed == (True,)
    for method in (EnvironmentMap(), RayTraced()):
        (answer,) = shaded(method, made, 0, size=SIZE)
        known = answer.active & answer.found
        assert np.isfinite(answer.distance[known]).all()
        assert (known.sum() < 0.9 * answer.active.sum()) == isinstance(method, EnvironmentMap)


@pytest.mark.parametrize("method", BY_IMAGE, **named)
@pytest.mark.parametrize("walls", ["whole", "petals"])
def test_within_walls_no_picture_shows_the_surroundings_and_says_that_it_found_them(method, walls):
    """Between petals, rays slip through."""
    made = scene(octants() if walls == "petals" else [room()], [mirror_ball(fine=48)], background=SKY, frames=1)
    assert made.enclosed == (True,)
    (answer,) = shaded(method, made, 0, size=SIZE)
    known = answer.active & answer.found
    assert np.isfinite(answer.distance[known]).all()
    assert walls != "whole" or known.sum() == answer.active.sum()
