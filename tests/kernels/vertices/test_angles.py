"""Turning a direction by half vector less normal: every step beside float64, where it runs away, and where it comes to."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from oracles import angle_oracle as oracle
from support.placed import EYE, host, mapped, off_px, place, points
from support.star_shapes import Ellipsoid, Sphere, truths

from benchharness.kernels.vertices import angles

DAMPINGS = ("naive", "half", "local")
PLACES = ((1.2, 0.6), (4.0, 0.1), (3.0, 2.0))  # from the ball to the eye, and from the reflection point to the vertex
BALL = Sphere()


def reflected(d_E: float, d_V: float, count: int = 400):
    """An eye, and vertices with the directions of their reflection points on a ball of radius 1; incidence up to 84 degrees."""
    rng = np.random.default_rng(4)
    u = oracle.unit(rng.normal(size=(8 * count, 3)))
    eye = np.array([0.0, 0.0, 1.0 + d_E])
    w = oracle.unit(eye - u)
    cosine = oracle.dot(w, u)
    chosen = (cosine > 0.1)[:, 0]
    u, w, cosine = u[chosen][:count], w[chosen][:count], cosine[chosen][:count]
    return eye, u + d_V * (2 * cosine * u - w), u


def beside(u, eye, away: float, across: bool):
    """Directions an angle away from u, in the plane of u and the eye or across it."""
    normal = oracle.unit(np.cross(eye, u))
    return oracle.unit(u + away * (normal if across else np.cross(normal, u)))


def ended(damping: str, shape, V, eye, first=None, max_iter: int = 60):
    star, local = mapped(shape), place(V, eye)
    u = angles.first_guess(star, local) if first is None else mi.Vector3f(points(first))
    s = angles.iterate(damping, star, local, u, dr.full(mi.Bool, True, len(V)), mi.UInt32(max_iter))
    dr.eval(s)
    return s


# The oracle.


def test_the_bisection_finds_what_a_vertex_was_made_from():
    eye, V, u = reflected(1.2, 0.6)
    np.testing.assert_allclose(oracle.reflection(eye, V, 1.0), u, atol=1e-9)


def test_a_case_worked_by_hand():
    """E and V two radii above the ball's top to both sides, as far away: R is the top; d = 2 sqrt(2), cos = 1 / sqrt(2), and
    rho = cos / 2 (2 / d) = 1 / 4. Across the plane it is twice that: 1 / cos^2 = 2."""
    E, V, top = np.array([2.0, 0.0, 3.0]), np.array([-2.0, 0.0, 3.0]), np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(oracle.reflection(E, V, 1.0), top, atol=1e-12)
    cosine, rho = oracle.incidence(E, V, top, 1.0)
    np.testing.assert_allclose([cosine[0], rho[0]], [np.sqrt(0.5), 0.25])
    np.testing.assert_allclose(oracle.factors("naive", cosine, rho), [[0.25], [0.5]])
    np.testing.assert_allclose(oracle.factors("one", cosine, rho), [[0.0], [0.2]], atol=1e-12)


@pytest.mark.parametrize("damping", [*DAMPINGS, "one"])
@pytest.mark.parametrize("across", [False, True])
def test_a_step_of_the_oracle_multiplies_a_small_error_as_its_formula_says(damping, across):
    eye, V, u = reflected(1.2, 0.6)
    first = beside(u, eye, 1e-6, across)
    ratio = oracle.length(oracle.step(damping, eye, V, first, 1.0) - u) / oracle.length(first - u)
    np.testing.assert_allclose(ratio, oracle.factors(damping, *oracle.incidence(eye, V, u, 1.0))[across], atol=2e-3)


def test_one_share_for_both_directions_runs_away_at_grazing_incidence():
    """And so does the all-over optimum of the plane alone, lam = 1 / (1 + rho), though nothing says so within the plane."""
    eye, V, u = reflected(1.2, 0.6)
    cosine, rho = oracle.incidence(eye, V, u, 1.0)
    within, across = oracle.factors("one", cosine, rho)
    assert within.max() < 1e-9 and (across > 1).mean() > 0.2
    now = {damping: beside(u, eye, 1e-4, True) for damping in ("one", "local")}
    for _ in range(60):
        now = {damping: oracle.step(damping, eye, V, w, 1.0) for damping, w in now.items()}
    off = {damping: oracle.length(w - u) for damping, w in now.items()}
    assert off["local"].max() < 1e-12 and (off["one"][across > 1.1] > 1e-3).all()


# The kernel.


@pytest.mark.parametrize("damping", DAMPINGS)
@pytest.mark.parametrize("across", [False, True])
def test_a_step_is_the_oracles_and_shrinks_the_error_by_the_bound(damping, across):
    for d_E, d_V in PLACES:
        eye, V, u = reflected(d_E, d_V)
        first = beside(u, eye, 2e-3, across)
        at = angles.look(damping, mapped(BALL), place(V, eye), mi.Vector3f(points(first)), True)
        there = oracle.unit(host(at.u) + host(at.step))
        np.testing.assert_allclose(there, oracle.step(damping, eye, V, first, 1.0), atol=3e-6)
        bound = oracle.factors(damping, *oracle.incidence(eye, V, u, 1.0))[across]
        ratio = oracle.length(there - u) / oracle.length(first - u)
        near = (oracle.incidence(eye, V, u, 1.0)[0] > 0.3)[:, 0]  # at grazing incidence 2e-3 is no small error
        assert (ratio <= bound + 0.06)[near].all()


@pytest.mark.parametrize("damping", DAMPINGS)
def test_it_converges_exactly_where_the_bound_is_below_one(damping):
    """From beside the point, in either direction; (1.2, 0.6) and (4, 0.1) are where lam = 1 has nothing to hold on to."""
    for d_E, d_V in PLACES:
        eye, V, u = reflected(d_E, d_V)
        factor = np.maximum(*oracle.factors(damping, *oracle.incidence(eye, V, u, 1.0)))[:, 0]
        first = beside(beside(u, eye, 5e-3, True), eye, 5e-3, False)
        s = ended(damping, BALL, V, eye, first)
        converged = np.array(s.converged)
        assert converged[factor < 0.7].all() and not converged[factor > 1.1].any()
        assert off_px(host(s.R)[converged], u[converged], eye).max(initial=0) < 0.05
        if damping == "local":
            assert converged.all() and np.array(s.iterations).max() <= 8
        elif d_V < 0.2:
            assert not converged.any()  # rho is at least 0.5, and 1 / cos^2 times that at least 3


def test_from_its_own_start_a_ball_is_done_in_a_few_steps():
    for d_E, d_V in PLACES:
        eye, V, u = reflected(d_E, d_V)
        s = ended("local", BALL, V, eye)
        assert np.array(s.converged).all() and np.array(s.iterations).mean() < 6
        assert off_px(host(s.R), u, eye).max() < 0.05


def test_on_an_ellipsoid_what_converges_is_the_reflection_point():
    shape = Ellipsoid(half=(1.0, 0.6, 1.4), origin=(0.2, -0.1, 0.1), turn=(0.4, -0.7, 0.2))
    V, R = truths(shape, EYE, 3, 300)
    for damping, least in (("naive", 0.2), ("half", 0.6), ("local", 0.95)):
        s = ended(damping, shape, V, EYE)
        converged = np.array(s.converged)
        assert converged.mean() > least
        assert np.quantile(off_px(host(s.R)[converged], R[converged]), 0.98) < 0.3  # texels of a map of 128


def test_a_limit_is_kept_and_what_it_stops_has_not_converged():
    eye, V, _ = reflected(1.2, 0.6)
    s = ended("half", BALL, V, eye, max_iter=2)
    assert np.array(s.iterations).max() == 2 and np.array(s.converged).mean() < 0.05
