"""The explosion map: exact for what lies on its sphere, and worse the farther a vertex is from it."""

from __future__ import annotations

from functools import cache

import drjit as dr
import mitsuba as mi
import numpy as np
from oracles import angle_oracle
from oracles import explosion_oracle as oracle
from support.placed import host, off_px, points
from support.star_shapes import Ellipsoid, Sphere

from benchharness.kernels.vertices import explosion, mirrormesh

EYE, CENTRE = np.array([1.2, -2.5, 2.9]), np.zeros(3)
SIZE, RADIUS = 1024, 1.5
BALL, EGG = Sphere(), Ellipsoid(half=(1.0, 0.6, 0.9), turn=(0.4, -0.7, 0.2))


@cache
def made(shape):
    mesh = shape.mesh(5)
    walked = mirrormesh.build(mesh.vertices, mesh.normals, mesh.faces)
    sphere = explosion.Sphere(mi.Point3f(*CENTRE.tolist()), mi.Float(RADIUS))
    eye = mi.Point3f(*EYE.tolist())
    dr.make_opaque(sphere, eye)
    view = explosion.view(SIZE)
    return walked, explosion.exploded(walked, len(mesh.vertices), len(mesh.faces), sphere, eye, view)


def facing(shape, low: float = 0.3, high: float = 1.0, count: int = 400):
    """Points of a mirror whose cosine of incidence is in a range, and their normals."""
    rng = np.random.default_rng(7)
    P = shape.points(rng, 200 * count)
    n = shape.normal(P)
    cosine = (n * oracle.unit(EYE - P)).sum(axis=1)
    chosen = (cosine > low) & (cosine < high)
    return P[chosen][:count], n[chosen][:count]


def found(shape, V):
    walked, map_ = made(shape)
    active = dr.full(mi.Bool, True, len(V))
    on, there = explosion.looked_up(walked, map_, mi.Point3f(points(V)), active)
    R = mirrormesh.position(walked, on, there)
    return host(R), np.array(there)


def test_the_oracle_on_a_case_worked_by_hand():
    """From (3, 0, 2) to a ball's top, at 45 degrees off the normal: on to (-3, 0, 2), and half of 90 degrees in the map."""
    P, n, eye = np.array([[0.0, 0, 1]]), np.array([[0.0, 0, 1]]), np.array([1.0, 0, 2])
    np.testing.assert_allclose(oracle.arrival(P, n, eye, CENTRE, np.sqrt(5)), [[-1.0, 0, 2]], atol=1e-12)
    np.testing.assert_allclose(oracle.away(np.array([[1.0, 0, 0]]), np.array([0.0, 0, 1]), 8), [4 * np.sqrt(0.5)])


def test_vertices_are_laid_out_where_the_oracle_has_them_and_the_singular_direction_is_in_the_shadow():
    P, n = facing(EGG)
    to_eye = EYE / np.linalg.norm(EYE)
    D = oracle.arrival(P, n, EYE, CENTRE, RADIUS) / RADIUS
    sphere = explosion.Sphere(mi.Point3f(0), mi.Float(RADIUS))
    there = explosion.arrival(sphere, points(P), mi.Vector3f(points(oracle.mirrored(P, n, EYE))))
    np.testing.assert_allclose(host(there), D, atol=1e-6)
    s, t = explosion.laid_out(mi.Vector3f(points(D)), mi.Vector3f(*to_eye.tolist()), SIZE)
    off = np.hypot(np.array(s) - SIZE / 2, np.array(t) - SIZE / 2)
    np.testing.assert_allclose(off, oracle.away(D, to_eye, SIZE), atol=2e-3)
    assert not found(EGG, -2.0 * to_eye[None])[1].any()


def test_what_lies_on_the_sphere_is_found_where_it_is_reflected():
    """Between corners a hundredth of a radius apart; and not where a map by the ray's own direction has it."""
    for shape in (BALL, EGG):
        P, n = facing(shape)
        V = oracle.arrival(P, n, EYE, CENTRE, RADIUS)
        R, there = found(shape, V)
        assert there.all() and off_px(R, P, EYE).max() < 0.3
        assert np.median(off_px(R, P, EYE)) < 0.1
        by_direction = found(shape, RADIUS * oracle.mirrored(P, n, EYE))[0]
        assert np.median(off_px(by_direction, P, EYE)) > 10


def test_at_the_outline_it_is_as_exact_and_holds_as_far_as_there_are_reflections():
    for shape in (BALL, EGG):
        P, n = facing(shape, 0.005, 0.03)
        R, there = found(shape, oracle.arrival(P, n, EYE, CENTRE, RADIUS))
        assert there.all() and np.quantile(np.linalg.norm(R - P, axis=1), 0.9) < 2e-3


def test_the_error_grows_with_the_distance_from_the_sphere():
    """F-32: pixels by distance from the centre, over vertices in the same directions."""
    P, n = facing(BALL)
    D = oracle.arrival(P, n, EYE, CENTRE, RADIUS) / RADIUS
    D = D[(D @ EYE) / np.linalg.norm(EYE) > -0.3]  # seen over the ball from any distance
    off = []
    for distance in (1.1, 1.2, 1.35, 1.5, 1.8, 2.5, 5.0, 20.0):
        V = distance * D
        off.append(np.median(off_px(found(BALL, V)[0], angle_oracle.reflection(EYE, V, 1.0), EYE)))
    assert off[3] < 0.1
    assert (np.diff(off[:4]) < -0.5).all() and (np.diff(off[3:]) > 0.5).all()
    assert off[0] > 5 and off[-1] > 10
