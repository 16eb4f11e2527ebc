"""Mirror optics against their laws, in float64 NumPy."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from oracles.fresnel_oracle import fresnel_by_amplitudes

from benchharness.kernels import optics


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def directions(seed, n=200):
    return unit(np.random.default_rng(seed).normal(size=(n, 3)))


def points(kind, values):
    return kind(np.asarray(values, np.float32).T)


def test_reflection_keeps_length_and_angle_and_lies_in_the_plane_of_incidence():
    w, n = directions(0), directions(1)
    r = np.array(optics.reflect(points(mi.Vector3f, w), points(mi.Normal3f, n))).T
    np.testing.assert_allclose((r * n).sum(1), (w * n).sum(1), atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(r, axis=1), 1, atol=1e-6)
    np.testing.assert_allclose((np.cross(w, n) * r).sum(1), 0, atol=1e-6)


def test_half_vector_bisects_and_is_undefined_only_between_eye_and_vertex():
    rng = np.random.default_rng(2)
    p, eye, vertex = rng.normal(size=(3, 100, 3))
    vertex[0] = 2 * p[0] - eye[0]  # p halfway between
    h, defined = optics.half_vector(points(mi.Point3f, p), points(mi.Point3f, eye), points(mi.Point3f, vertex))
    h, defined = np.array(h).T, np.array(defined)
    assert not defined[0] and defined[1:].all()
    assert np.isfinite(h).all()
    w_e, w_v = unit(eye - p), unit(vertex - p)
    np.testing.assert_allclose((h * w_e).sum(1)[1:], (h * w_v).sum(1)[1:], atol=1e-5)


def test_mirrored_lies_on_the_other_side_at_the_same_distance():
    rng = np.random.default_rng(3)
    V, R = rng.normal(size=(2, 100, 3))
    n = directions(4, 100)
    image = np.array(optics.mirrored(points(mi.Point3f, V), points(mi.Point3f, R), points(mi.Normal3f, n))).T
    # The paper's printed equation (1) keeps the sign of (V - R).n; the mirror image turns it round.
    np.testing.assert_allclose(((image - R) * n).sum(1), -((V - R) * n).sum(1), atol=1e-5)
    np.testing.assert_allclose(np.cross(image - V, n), 0, atol=1e-5)


def test_on_ray_and_mirrored_agree_at_an_exact_reflection_point():
    rng = np.random.default_rng(5)
    R, n, w = rng.normal(size=(100, 3)), directions(6, 100), directions(7, 100)
    w *= np.sign((w * n).sum(1, keepdims=True))
    r = 2 * (w * n).sum(1, keepdims=True) * n - w
    eye, V = R + 1.7 * w, R + rng.uniform(0.2, 4, (100, 1)) * r
    args = (points(mi.Point3f, V), points(mi.Point3f, R))
    one = np.array(optics.on_ray(*args, points(mi.Point3f, eye))).T
    other = np.array(optics.mirrored(*args, points(mi.Normal3f, n))).T
    np.testing.assert_allclose(one, other, atol=2e-5)


def test_conductor_reflectance_equals_that_of_the_complex_amplitudes():
    cos_theta = np.linspace(0.0, 1.0, 65)
    eta, k = np.array([0.2, 1.5, 3.1]), np.array([3.9, 7.3, 0.4])
    F = np.array(optics.fresnel_conductor(mi.Float(cos_theta), mi.Color3f(*eta.tolist()), mi.Color3f(*k.tolist()))).T
    np.testing.assert_allclose(F, fresnel_by_amplitudes(cos_theta[:, None], eta, k), atol=2e-5)
    # At normal incidence: ((eta - 1)^2 + k^2) / ((eta + 1)^2 + k^2).
    np.testing.assert_allclose(F[-1], ((eta - 1) ** 2 + k**2) / ((eta + 1) ** 2 + k**2), atol=1e-6)
    assert dr.all(mi.Bool(bool((F[0] > 0.999).all())))
