"""Half a million vertices with known reflections, over random mirrors: all is numbers, all ends, no wrong root is called right.

Truth is made backwards: a point of a mirror in closed form, its normal, and a vertex somewhere along the ray that it reflects.
Whatever method reports vertices is tested, whoever wrote it. These mirrors are fine enough for closed forms to be the truth; of
all others, `test_roots` solves for it on the mesh.

The first tier tries two mirrors of each kind with each method: the simplest, and one that is drawn; the rest tries the others.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, assume, given, settings
from hypothesis import strategies as st
from support.hollow_shapes import Bowl, Ring, Sheet
from support.known_reflections import (
    FOV_DEG,
    METHODS,
    SEARCHING,
    SIZE,
    VERTEXWISE,
    asked,
    points_of,
    reflected,
    reporting,
    world,
)
from support.mirror_room import scene
from support.star_shapes import Bumpy, Ellipsoid
from support.stress_rooms import law
from support.tiers import exhaustive
from support.truth_shapes import unit

from benchharness.kernels.pixels import WRONG_PX
from benchharness.measure import truth
from benchharness.scene import Camera
from benchharness.study import params

FEWEST_STEPS = 250  # more than any method's limit


def sound(found, shape, eye, V, tolerance: float) -> None:
    """Numbers, an end, and the law of reflection wherever a method claims it, by the mirror's own normal in closed form."""
    for key, value in found.items():
        assert np.isfinite(value).all(), key
    assert found["iterations"].max() < FEWEST_STEPS
    R = found["R"][found["converged"]].astype(np.float64)
    n, to_eye, to_vertex = shape.normal(R), unit(eye - R), unit(V[found["converged"]] - R)
    assert np.abs(shape.height(R)).max() < 0.01
    off = np.linalg.norm(unit(to_eye + to_vertex) - n, axis=1)
    assert np.quantile(off, 0.999) < tolerance and ((n * to_vertex).sum(axis=1) > -0.02).mean() > 0.999


directions = st.tuples(st.floats(-1, 1), st.floats(0, 2 * np.pi))
distances, seeds = st.floats(2.5, 6.0), st.integers(0, 10**6)
common = settings(
    deadline=None, derandomize=True, database=None, phases=(Phase.explicit, Phase.generate),
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
)  # fmt: skip


def placed(direction, distance: float) -> np.ndarray:
    z, angle = direction
    return distance * np.array([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z])


def over(cases: range, judge: Callable[..., None], **strategies: st.SearchStrategy) -> None:
    """Judges as many cases as asked for, always the same ones, but for those before the range, which another tier judges; those
    that `judge` assumes away are not among them."""
    drawn = judged = 0

    @settings(common, max_examples=cases.stop)
    @given(st.fixed_dictionaries(strategies))
    def one(case) -> None:
        nonlocal drawn, judged
        drawn += 1
        if drawn > cases.start:
            judge(**case)
            judged += 1

    one()
    assert judged >= len(cases)


def tiers(cases: int):
    """Two cases in the first tier, others in the rest. With three methods, 24,000 vertices in 7 cases are half a million."""
    return pytest.mark.parametrize("cases", [range(2), pytest.param(range(2, cases), marks=exhaustive)], ids=str)


@pytest.mark.parametrize("name", SEARCHING)
@tiers(7)
def test_of_a_convex_mirror_no_wrong_point_is_called_right(name, cases):
    def judge(half, direction, distance, seed) -> None:
        shape, eye = Ellipsoid(half=half), placed(direction, distance)
        made, P, V = world(shape, eye, seed)
        found = asked(name, made)
        sound(found, shape, eye, V, 0.03)
        converged = found["converged"]
        assert converged.mean() > 0.8
        camera = made.camera(0.0)
        one, other = (truth.on_screen(p[converged], camera, *SIZE) for p in (found["R"].astype(np.float64), P))
        assert np.linalg.norm(one - other, axis=1).max() < WRONG_PX

    over(cases, judge, half=st.tuples(*[st.floats(0.5, 1.0)] * 3), direction=directions, distance=distances, seed=seeds)


@pytest.mark.parametrize("name", SEARCHING)
@tiers(4)
def test_of_a_mirror_with_hollows_what_is_called_right_obeys_the_law(name, cases):
    def judge(eps, direction, distance, seed) -> None:
        shape, eye = Bumpy(eps=eps), placed(direction, distance)
        made, _, V = world(shape, eye, seed)
        sound(asked(name, made), shape, eye, V, 0.03)

    over(cases, judge, eps=st.floats(-0.3, 0.3), direction=directions, distance=distances, seed=seeds)


# Mirrors with several reflections: no promise which one, but what is called right is one of them.

LEAST_FOUND = 0.05  # share of vertices: a climb over a thin ring stops at its outlines
FEWER = 4_000  # vertices of an example; of SOLVED of them, all reflections are solved for
SOLVED = 300
GONE = 0.005  # share of points at a caustic whose two roots have just met and gone, while another root is far away
MARGIN = 2.0  # over the bound to first order


def one_of_the_reflections(shape, made, found, V) -> None:
    """What is called converged obeys the law of the shape's own normal, and is a reflection point within WRONG_PX.

    To first order there is a root within |half vector - normal| / σ of R, with σ the least singular value of the derivative of
    their difference along the mirror. Where that is less than WRONG_PX, the law proves it. Where it is more, R is near a focus,
    the law says little about the place, and R has to be as near as that to one of the roots that are found by solving for
    them, if any is found: two may have met and gone, or one may lie beyond the rim.
    """
    camera, mirror = made.camera(0.0), made.reflectors[0]
    for key, value in found.items():
        assert np.isfinite(value).all(), key
    chosen = np.flatnonzero(found["converged"])
    chosen = chosen[:: max(1, len(chosen) // SOLVED)]
    R, V = found["R"][chosen].astype(np.float64), V[chosen]
    eye = np.asarray(camera.eye)
    n, to_eye, to_vertex = shape.normal(R), unit(eye - R), unit(V - R)
    if mirror.closed is None:  # a sheet is a mirror on both sides
        n = np.where((n * to_eye).sum(axis=1, keepdims=True) < 0, -n, n)
    own = np.linalg.norm(unit(to_eye + to_vertex) - n, axis=1)
    assert np.abs(shape.height(R)).max() < 0.01
    assert np.quantile(own, 0.99) < 0.03 and ((n * to_vertex).sum(axis=1) > -0.02).mean() > 0.99

    mesh = mirror.mesh
    judged = law(mesh, mirror.closed is None, R, V, camera, SIZE[1])
    points, valid = truth.reflection_points(mesh.vertices, mesh.normals, mesh.faces, eye, V, R)
    apart = np.linalg.norm(truth.nearest(points, valid, R) - R, axis=1)
    on_screen = (truth.on_screen(p, camera, *SIZE) for p in (R, truth.nearest(points, valid, R)))
    off_px = np.linalg.norm(np.subtract(*on_screen), axis=1)
    bound = MARGIN * (judged.off / judged.least + judged.height)
    proven, near = bound <= WRONG_PX * judged.pixel, (off_px <= WRONG_PX) | (apart <= bound)
    right = proven | near | ~np.isfinite(apart)
    gone = f"{(~right).sum()} of {len(R)} are no reflection: {apart[~right][:3]} off, {bound[~right][:3]} allowed"
    assert (~right).mean() <= GONE, gone
    assert near.mean() > 0.9  # so that it is not the bound alone that judges


hollow_shapes = st.one_of(
    st.builds(Bowl, st.tuples(*[st.floats(0.5, 1.0)] * 3), st.floats(0.0, 0.6)),
    st.builds(Sheet, st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)),
    st.builds(Ring, st.floats(0.15, 0.6)),
)


@pytest.mark.parametrize("name", SEARCHING)
@tiers(8)
def test_of_a_mirror_with_several_reflections_one_of_them_is_called_right(name, cases):
    def judge(shape, tilt, turn, distance, seed) -> None:
        eye = distance * np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)])
        _, V = reflected(shape, eye, seed, FEWER)
        camera = Camera(tuple(eye), (0.0, 0.0, 0.0), FOV_DEG, (0.0, 1.0, 0.0))
        made = scene([points_of(V)], [shape.mirror()], lambda time: camera, frames=1)
        assume(METHODS[name]().refuses(made) is None)
        found = asked(name, made)
        limit = params.of_method(METHODS[name]).get("max_iter")  # a search may be followed by another one from its end
        assert found["iterations"].max() <= (FEWEST_STEPS if limit is None else 2 * limit.default)
        assert found["converged"].mean() > LEAST_FOUND
        one_of_the_reflections(shape, made, found, V)

    tilts, turns, away = st.floats(0.02, 0.7), st.floats(0, 2 * np.pi), st.floats(2.0, 6.0)
    over(cases, judge, shape=hollow_shapes, tilt=tilts, turn=turns, distance=away, seed=seeds)


def test_those_that_report_vertices_are_all_that_are_tested():
    """A method that is new among them belongs into `VERTEXWISE`."""
    assert sorted(reporting()) == sorted(VERTEXWISE)
