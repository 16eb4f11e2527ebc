"""Newton's method, and secant triangles with it: closed forms, degenerate places, stars that are not convex."""

from __future__ import annotations

import numpy as np
import pytest
from oracles import secant_oracle as oracle
from oracles.secant_oracle import newton, secant, solve
from scipy.spatial.transform import Rotation
from support.star_shapes import Bumpy, Cylinder, Ellipsoid, Sphere, leaves, truths
from support.truth_shapes import alhazen, unit

EYE = np.array([0.0, 0.0, 4.0])
MOVED = {"origin": (0.3, -0.2, 0.5), "turn": (0.4, -0.7, 0.2)}


def around(seed, count):
    """Vertices around unit shapes."""
    rng = np.random.default_rng(seed)
    return unit(rng.normal(size=(count, 3))) * rng.uniform(1.8, 5, (count, 1))


def all_finite(found):
    return all(np.isfinite(value).all() for value in vars(found).values())


def test_newton_alone_needs_few_steps_and_squares_its_error():
    for shape in (Sphere(), Ellipsoid()):
        V, R = truths(shape, EYE, 0, 300)
        found = newton(shape, EYE, V)
        print(f"\nnewton on {shape}: {found.iterations.mean():.1f} iterations, at most {found.iterations.max()}")
        assert found.converged.all()
        np.testing.assert_allclose(found.R, R, atol=1e-9)
        assert found.iterations.mean() < 5
        assert found.iterations.max() <= 10
        # Half as far off, one step leaves a quarter.
        t = oracle.any_tangent(unit(R))
        left = [np.median(newton(shape, EYE, V, unit(shape.direction(R) + d * t), max_iter=1).slope) for d in (0.02, 0.01)]
        assert left[0] / left[1] == pytest.approx(4, rel=0.15)


@pytest.mark.parametrize("shape", [Sphere(), Sphere(centre=(0.3, -0.2, 0.4), origin=(-0.3, 0.2, -0.4))], ids=["centred", "off"])
def test_on_a_sphere_the_points_are_alhazens_wherever_its_origin(shape):
    V = around(6, 120)
    found = solve(shape, EYE, V, stop="edge")
    np.testing.assert_array_equal(found.converged, ~found.hidden)
    seen = np.flatnonzero(found.converged)
    assert len(seen) > 90
    np.testing.assert_allclose(found.R[seen], [alhazen(EYE, V[i]) for i in seen], atol=1e-10)


def test_on_a_cylinder_the_points_are_the_circles_at_heights_by_the_ways_ratio():
    V, _ = truths(Cylinder(), np.array([3.0, 1.0, 0.5]), 7, 100, 0.1)
    eye = np.array([3.0, 1.0, 0.5])
    found = solve(Cylinder(), eye, V, stop="edge")
    flat = [1.0, 1.0, 0.0]
    R = np.array([alhazen(eye * flat, v * flat) for v in V])
    to_eye, to_V = np.linalg.norm(eye * flat - R, axis=1), np.linalg.norm(V * flat - R, axis=1)
    R[:, 2] = (eye[2] * to_V + V[:, 2] * to_eye) / (to_eye + to_V)
    assert found.converged.all()
    np.testing.assert_allclose(found.R, R, atol=1e-9)


SOMEWHERE = np.array([0.3, -0.2, 0.9])  # of the sphere's lit side, to be made unit
PLACES = {
    # place: (V, reflection point or None). On the axis, R is under the eye.
    "on the axis": ((0, 0, 3), (0, 0, 1)),
    "in the eye": ((0, 0, 4), (0, 0, 1)),
    "behind the eye": ((0, 0, 9), (0, 0, 1)),
    "hidden on the axis": ((0, 0, -3), None),
    "the antipode": ((0, 0, -1), None),
    "the origin": ((0, 0, 0), None),
    "inside": ((0.3, 0.1, 0.4), None),
    "on the surface": (tuple(unit(SOMEWHERE)), None),
    "a hundredth above": (tuple(1.01 * unit(SOMEWHERE)), "law"),
    "a millionth above": (tuple((1 + 1e-6) * unit(SOMEWHERE)), "law"),
    "a million away": ((3e5, -9e5, 1e4), "law"),
    "a million away and hidden": ((0, 1e5, -1e6), None),
}


@pytest.mark.parametrize("stop", ["area", "edge"])
@pytest.mark.parametrize("start", ["paper", "bisector"])
@pytest.mark.parametrize("place", PLACES)
def test_degenerate_places_are_finite_and_honest(place, start, stop):
    V, R = PLACES[place]
    V = np.array([V], float)
    found, polished = (f(Sphere(), EYE, V, stop=stop, start=start) for f in (secant, solve))
    assert all_finite(found)
    assert all_finite(polished)
    assert found.iterations[0] <= 60
    if found.converged[0]:
        assert found.slope[0] < 1e-2
    if R is None:
        assert not found.converged[0]
        assert not polished.converged[0]
        assert found.hidden[0] or place == "on the surface"
    else:
        assert polished.converged[0]
        assert not polished.hidden[0]
        assert polished.residual[0] < 1e-8
        np.testing.assert_allclose(polished.R[0], alhazen(EYE, V[0]) if R == "law" else R, atol=1e-9)


def test_far_vertices_reflect_like_directions():
    # In the limit w_V is the direction d itself; what is left falls like 1 / distance.
    d = unit(np.array([3.0, -9.0, 0.1]))
    far = [solve(Sphere(), EYE, t * d[None], stop="edge").R[0] for t in (1e4, 1e6, 1e8)]
    limit = alhazen(EYE, 1e12 * d)
    off = [np.linalg.norm(R - limit) for R in far]
    assert off[0] < 1e-4
    assert off[1] < 1e-6
    assert off[2] < 1e-8
    np.testing.assert_allclose(unit(unit(EYE - limit) + d), limit, atol=1e-10)


@pytest.mark.parametrize("shape", [Ellipsoid, Bumpy])
def test_rigid_motion_of_everything_moves_the_points_with_it(shape):
    turn, move = Rotation.from_rotvec(MOVED["turn"]).as_matrix(), np.asarray(MOVED["origin"])
    V, _ = truths(shape(), EYE, 8, 100)
    V[0] = V[1] * [1e-9, 1e-9, 1] if shape is Ellipsoid else V[0]  # over the pole
    here, there = solve(shape(), EYE, V, stop="edge"), solve(shape(**MOVED), turn @ EYE + move, V @ turn.T + move, stop="edge")
    np.testing.assert_array_equal(here.converged, there.converged)
    ok = here.converged
    np.testing.assert_allclose(there.R[ok], here.R[ok] @ turn.T + move, atol=1e-8)


# A star that is not convex.


def test_on_a_bumpy_star_newton_returns_to_minima_saddles_and_maxima():
    shape = Bumpy(eps=0.3)
    V, R = truths(shape, EYE, 9, 300)
    g, H, _, _ = oracle._local(shape, EYE, V, shape.direction(R))
    assert np.linalg.norm(g, axis=1).max() < 1e-12
    values = np.linalg.eigvalsh(H)
    saddle, maximum = (values[:, 0] < 0) & (values[:, 1] > 0), values[:, 1] < 0
    assert saddle.sum() > 20
    assert maximum.sum() > 0
    away = 1e-2 * oracle.any_tangent(shape.direction(R))
    found = newton(shape, EYE, V, unit(shape.direction(R) + away))
    back = np.linalg.norm(found.R - R, axis=1) < 1e-6
    # A hundredth may be over a fold of the image where an eigenvalue is small; elsewhere all return.
    steep = np.abs(values).min(axis=1) > 0.1
    assert back[steep].all()
    assert steep[saddle].sum() > 20
    assert back.mean() > 0.95


@pytest.mark.parametrize("shape", [Sphere(centre=(0.3, -0.2, 0.4)), Ellipsoid(half=(1.0, 0.6, 1.7), **MOVED), Bumpy(**MOVED)])
def test_newtons_hessian_is_the_second_derivative_of_length_at_reflection_points(shape):
    V, R = truths(shape, EYE, 10, 100, 0.1)
    _, H, T, _ = oracle._local(shape, EYE, V, shape.direction(R))
    h = 1e-4

    def length(a, b):  # where the gradient vanishes, any way back to the surface gives the same second derivative
        P = shape.P(shape.direction(R + h * (a * T[:, 0] + b * T[:, 1])))
        return np.linalg.norm(P - EYE, axis=1) + np.linalg.norm(P - V, axis=1)

    first = (length(1, 0) - 2 * length(0, 0) + length(-1, 0)) / h**2
    second = (length(0, 1) - 2 * length(0, 0) + length(0, -1)) / h**2
    mixed = (length(1, 1) - length(1, -1) - length(-1, 1) + length(-1, -1)) / (4 * h**2)
    # h² l'''' with d_V from 0.1: 1e-8 · 1e3; rounding 1e-15 / h² = 1e-7.
    for seen, value in [(first, H[:, 0, 0]), (second, H[:, 1, 1]), (mixed, H[:, 0, 1])]:
        np.testing.assert_allclose(seen, value, atol=1e-4)


def test_on_a_bumpy_star_what_converges_obeys_the_law_and_often_is_the_point_it_was_made_from():
    V, R = truths(Bumpy(eps=0.1), EYE, 11, 200)
    found = solve(Bumpy(eps=0.1), EYE, V, stop="edge")
    np.testing.assert_allclose(found.R[found.converged], R[found.converged], atol=1e-8)
    assert found.converged.mean() > 0.98
    shape = Bumpy(eps=0.3)
    V, R = truths(shape, EYE, 11, 200)
    for start in ("paper", "bisector"):
        found = solve(shape, EYE, V, stop="edge", start=start)
        ok = found.converged
        h = unit(unit(EYE - found.R) + unit(V - found.R))
        np.testing.assert_allclose(h[ok], shape.normal(found.R)[ok], atol=1e-9)
        same = np.linalg.norm(found.R - R, axis=1) < 1e-6
        # The others are reflections too: a vertex has several.
        print(f"\nbumpy 0.3, {start}: {ok.mean():.2f} converged, {same.mean():.2f} to the point they were made from")
        assert ok.mean() > 0.8
        assert same.mean() > 0.4
        assert leaves(shape, found.R[ok & ~same], EYE).sum() > 10
