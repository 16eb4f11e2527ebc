"""Specular polynomials: all reflections of mirrors that show things several times, beside closed forms and searches."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from support.answers import hollow, lanes
from support.known_reflections import points_of
from support.mirror_room import mirror_room, scene, shaded, still, walls
from support.truth_shapes import alhazen, alhazen_inside

from benchharness.kernels.vertices import problems
from benchharness.measure import completeness, truth
from benchharness.scene import Mesh, Reflector
from methods.newton import Newton
from methods.ray_traced import RayTraced
from methods.specular_polynomial import SpecularPolynomial
from scenes.props.minimal import sphere
from scenes.stress.bumps import bumps
from scenes.stress.zones import zones

EYE = np.array([0.1, 0.05, -0.6])
SIZE = (96, 72)
METHOD = SpecularPolynomial(split_px=0.0)


def slots(answer) -> list:
    vertices = answer.reflection.vertices
    return [vertices, *vertices.further]


def places(answer) -> tuple[np.ndarray, np.ndarray]:
    """Reflection points [N, K, 3] of the vertices of a scene with one mirror, and whether there is one [N, K]."""
    all_ = slots(answer)
    return np.stack([lanes(v.R) for v in all_], 1), np.stack([np.array(v.region) == problems.REFLECTED for v in all_], 1)


def counted(method, made, size=(160, 120)) -> tuple[int, int]:
    """(found, all) reflections that the eye can see, of a sample of vertices."""
    told = [
        {k: np.array(v).T for k, v in vars(s).items() if k != "further"} for s in slots(shaded(method, made, 0, size=size)[0])
    ]
    seen = SimpleNamespace(vertices=told[0] | {"further": told[1:]}, scene=made, time=0.0, mask=np.zeros(size[::-1]))
    both = completeness.counted(seen)  # pyright: ignore[reportArgumentType]
    assert both is not None
    return both


@cache
def inside_a_ball():
    """Points within a ball of which the eye sees the inside, and Alhazen's reflection points of each."""
    V = np.random.default_rng(0).uniform(-0.5, 0.5, (400, 3))
    ball = sphere(fine=64)
    inside = Reflector("inside", Mesh(ball.vertices, ball.faces[:, ::-1], -ball.normals))
    made = scene([points_of(V)], [inside], still(tuple(EYE), (0.6, 0.4, 1.0), 100.0), frames=1)
    return made, [alhazen_inside(EYE, v) for v in V]


def test_inside_a_sphere_there_are_as_many_as_alhazen_counts_and_where():
    """T2: two or four. A chord of 2 pi / 128 sags by 3e-4: where two are about to meet, they move by the root of that."""
    made, roots = inside_a_ball()
    answer = shaded(METHOD, made, 0, size=SIZE)[0]
    R, filled = places(answer)
    in_view = np.array([((at := truth.on_screen(r, made.camera(0.0), *SIZE)) == at).all() for r in roots])
    found, expected, strange = [], [], 0
    for own, there, true, all_ in zip(R, filled, roots, in_view, strict=False):
        near = np.linalg.norm(own[there][:, None] - true, axis=2)
        apart = np.linalg.norm(true[:, None] - true, axis=2) + 9 * np.eye(len(true))
        strange += int((near.min(axis=1, initial=9) > 0.05).sum())
        if not all_ or apart.min() < 0.1:
            continue
        found.append(len(near))
        expected.append(len(true))
        assert (near.min(axis=0, initial=9) < 0.02).all()
    assert strange == 0
    assert set(expected) == {2, 4} and len(expected) > 20
    assert found == expected


def test_outside_a_sphere_there_is_one_and_right_on_the_eye_s_axis_too():
    """Coplanarity holds all over a sphere for a vertex on the line from its centre to the eye."""
    eye = np.array([0.0, -1.7, 0.25])
    V = np.concatenate([np.random.default_rng(1).uniform(-1.5, 1.5, (60, 3)), [0.7 * eye, 0.5 * eye, 1.5 * eye]])
    ball = sphere(0.5, fine=48)
    made = scene([points_of(V)], [Reflector("ball", ball, ball)], still(tuple(eye)), frames=1)
    vertices = shaded(METHOD, made, 0, size=SIZE)[0].reflection.vertices
    assert vertices is not None and not vertices.further
    converged, R = np.array(vertices.converged)[: len(V)], lanes(vertices.R)[: len(V)]
    way = V - eye
    nearest = eye + np.clip(-(way @ eye) / (way**2).sum(axis=1), 0, 1)[:, None] * way
    hidden = np.linalg.norm(nearest, axis=1) < 0.5
    clear = np.abs(np.linalg.norm(nearest, axis=1) - 0.5) > 0.01
    assert (converged == ~hidden)[clear].all() and converged[-3:].all() and hidden.any()
    true = np.array([0.5 * alhazen(2 * eye, 2 * v) for v in V[converged]])
    assert np.linalg.norm(R[converged] - true, axis=1).max() < 2e-3


@pytest.mark.parametrize("made", [bumps(0.05), zones(0.35)], ids=["bumps", "bowl"])
def test_every_reflection_that_can_be_seen_is_found(made):
    found, total = counted(METHOD, made)
    assert total > 30 and found == total


def shown(method, made, size=SIZE):
    """Share of a mirror's pixels that are another colour than rays show, which see one bounce, and are not black."""
    one, other = (shaded(m, made, 0, size=size)[0] for m in (method, RayTraced(bounces=1)))
    return (np.abs(one.L - other.L).max(axis=2) > 0.1)[one.active & (one.L.max(axis=2) > 0)].mean()


def test_the_picture_in_a_bowl_is_as_good_as_from_searches():
    made = zones(0.35)
    assert shown(METHOD, made) < 0.02
    assert shown(METHOD, made) <= shown(Newton(multi=4), made) + 0.005


def test_with_room_for_fewer_reflections_than_there_are_it_has_not_converged():
    made = zones(0.35)
    shares = []
    for multi in (2, 4):
        answer = shaded(replace(METHOD, multi=multi), made, 0, size=SIZE)[0]
        objects = len(made.objects[0].mesh.vertices)
        assert len(slots(answer)) == multi
        shares.append(np.array(slots(answer)[0].converged)[:objects].mean())
        assert np.array(answer.reflection.counters["reflections"])[:objects].mean() == pytest.approx(3, abs=0.15)
    assert shares[0] < 0.3 and shares[1] > 0.9


def test_a_convex_mirror_beside_a_hollow_one_and_nothing_remembered():
    """Mirrors of both kinds in one scene, whose edges are split where the mirror is convex; twice the same."""
    ball = mirror_room().reflectors[0]
    apart = replace(
        ball, motion=lambda time: np.block([[np.eye(3), np.array([[0.9], [0.0], [0.1]])], [np.zeros(3), np.ones(1)]])
    )
    made = scene((walls(), *mirror_room().objects[1:]), (hollow("concave"), apart))
    first, second = shaded(SpecularPolynomial(), made, 0, 0, size=SIZE)
    assert np.array_equal(first.L, second.L) and np.array_equal(first.found, second.found)
    rays = shaded(RayTraced(bounces=1), made, 0, size=SIZE)[0]
    reflector = np.array(first.frame.reflector).reshape(first.active.shape)
    for number, most in ((0, 0.15), (1, 0.06)):
        own = (reflector == number) & (first.L.max(axis=2) > 0)
        assert own.sum() > 100
        assert np.abs(first.L - rays.L)[own].max(axis=1).mean() < most


def test_levels_of_detail_without_rays_are_refused():
    with pytest.raises(ValueError, match='specular_polynomial: lod_px 1 with resolve "interpolate"; accepted: 0, or "ray"'):
        SpecularPolynomial(lod_px=1.0)
