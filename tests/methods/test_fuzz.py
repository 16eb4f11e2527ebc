"""Half a million vertices with known reflections, over random mirrors: all is numbers, all ends, no wrong root is called right.

Truth is made backwards: a point of a mirror in closed form, its normal, and a vertex somewhere along the ray that it reflects.
Whatever method reports vertices is tested, whoever wrote it. These mirrors are fine enough for closed forms to be the truth; of
all others, `test_roots` solves for it on the mesh.
"""

from __future__ import annotations

import functools

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from support.hollow_shapes import Bowl, Ring, Sheet
from support.mirror_room import scene, shaded, still
from support.star_shapes import Bumpy, Ellipsoid
from support.stress_rooms import law
from support.truth_shapes import unit

from benchharness.kernels.pixels import WRONG_PX
from benchharness.measure import truth
from benchharness.scene import Camera, Mesh, Object, Reflector
from benchharness.study import params, plugins

METHODS = {name: plugin.target for name, plugin in plugins.discover("method").items()}
COUNT = 24_000  # vertices of an example
EXAMPLES = 7  # per mirror and method: with three methods, 24,000 · 7 · 3 is half a million
SIZE = (320, 240)
FOV_DEG = 40.0
FEWEST_STEPS = 250  # more than any method's limit


def reflected(shape, eye, seed: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points [count, 3] of a shape that face the eye, and vertices that they reflect to it; visible if it is convex."""
    rng = np.random.default_rng(seed)
    P = shape.points(rng, 12 * count)
    n, w = shape.normal(P), unit(eye - P)
    P, n, w = (a[(n * w).sum(axis=1) > 0.1][:count] for a in (P, n, w))
    assert len(P) == count
    away = 2 * (n * w).sum(axis=1, keepdims=True) * n - w
    return P, P + np.exp(rng.uniform(np.log(0.05), np.log(20.0), (count, 1))) * away


def points_of(V: np.ndarray) -> Object:
    """Vertices of triangles without area: nothing of them is drawn."""
    one = np.arange(len(V))[:, None].repeat(3, axis=1)
    return Object("points", Mesh(V, one, np.tile([0.0, 0, 1], (len(V), 1)), radiance=np.ones((len(V), 3))), "reflections")


def world(shape, eye, seed: int):
    """A mirror, and vertices [COUNT, 3] that it reflects to the eye at points [COUNT, 3]."""
    P, V = reflected(shape, eye, seed, COUNT)
    mesh = shape.mesh(5)
    camera = still(tuple(eye), (0.0, 0.0, 0.0), FOV_DEG)
    return scene([points_of(V)], [Reflector("mirror", mesh, mesh)], camera, frames=1), P, V


def asked(name: str, made) -> dict[str, np.ndarray]:
    """What a method reports of the vertices of the first object."""
    reported = shaded(METHODS[name](), made, 0, size=SIZE)[0].reflection.vertices
    count = len(made.objects[0].mesh.vertices)
    return {key: np.array(value).T[:count] for key, value in vars(reported).items() if key != "further"}


@functools.cache
def reporting() -> list[str]:
    """Methods that report vertices."""
    made, _, _ = world(Ellipsoid(half=(0.8, 0.8, 0.8)), np.array([0.0, -3.0, 0.5]), 0)
    answers = {name: shaded(method(), made, 0, size=(32, 24))[0].reflection for name, method in METHODS.items()}
    return [name for name, answer in answers.items() if answer.vertices is not None]


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
common = settings(
    max_examples=EXAMPLES, deadline=None, derandomize=True, database=None, phases=(Phase.explicit, Phase.generate),
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)  # fmt: skip


def placed(direction, distance: float) -> np.ndarray:
    z, angle = direction
    return distance * np.array([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z])


@pytest.mark.parametrize("name", METHODS)
@common
@given(
    half=st.tuples(*[st.floats(0.5, 1.0)] * 3), direction=directions, distance=st.floats(2.5, 6.0), seed=st.integers(0, 10**6)
)
def test_of_a_convex_mirror_no_wrong_point_is_called_right(name, half, direction, distance, seed):
    if name not in reporting():
        pytest.skip("reports no vertices")
    shape, eye = Ellipsoid(half=half), placed(direction, distance)
    made, P, V = world(shape, eye, seed)
    found = asked(name, made)
    sound(found, shape, eye, V, 0.03)
    converged = found["converged"]
    assert converged.mean() > 0.8
    camera = made.camera(0.0)
    one, other = (truth.on_screen(p[converged], camera, *SIZE) for p in (found["R"].astype(np.float64), P))
    assert np.linalg.norm(one - other, axis=1).max() < WRONG_PX


@pytest.mark.parametrize("name", METHODS)
@settings(common, max_examples=4)
@given(eps=st.floats(-0.3, 0.3), direction=directions, distance=st.floats(2.5, 6.0), seed=st.integers(0, 10**6))
def test_of_a_mirror_with_hollows_what_is_called_right_obeys_the_law(name, eps, direction, distance, seed):
    if name not in reporting():
        pytest.skip("reports no vertices")
    shape, eye = Bumpy(eps=eps), placed(direction, distance)
    made, _, V = world(shape, eye, seed)
    sound(asked(name, made), shape, eye, V, 0.03)


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


@pytest.mark.parametrize("name", METHODS)
@settings(common, max_examples=8)
@given(
    shape=hollow_shapes, tilt=st.floats(0.02, 0.7), turn=st.floats(0, 2 * np.pi), distance=st.floats(2.0, 6.0),
    seed=st.integers(0, 10**6),
)  # fmt: skip
def test_of_a_mirror_with_several_reflections_one_of_them_is_called_right(name, shape, tilt, turn, distance, seed):
    if name not in reporting():
        pytest.skip("reports no vertices")
    eye = distance * np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)])
    _, V = reflected(shape, eye, seed, FEWER)
    camera = Camera(tuple(eye), (0.0, 0.0, 0.0), FOV_DEG, (0.0, 1.0, 0.0))
    made = scene([points_of(V)], [shape.mirror()], lambda time: camera, frames=1)
    if METHODS[name]().refuses(made) is not None:
        return  # as it may, of what it cannot show
    found = asked(name, made)
    limit = params.of_method(METHODS[name]).get("max_iter")  # a search may be followed by another one from its end
    assert found["iterations"].max() <= (FEWEST_STEPS if limit is None else 2 * limit.default)
    assert found["converged"].mean() > LEAST_FOUND
    one_of_the_reflections(shape, made, found, V)
