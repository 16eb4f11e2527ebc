"""Distance impostors: against closed forms in a box, against rays that are traced, and beside the environment map."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from oracles import impostor_oracle as oracle
from scipy.ndimage import binary_erosion
from support.mirror_room import balls, mirror_ball, mirror_room, scene, shaded, still, walls
from support.small_room import quad

from benchharness.kernels import cubemap
from benchharness.kernels.images import distancemap
from benchharness.render.frame import FrameRenderer
from benchharness.scene import Reflector
from methods.distance_impostor import DistanceImpostor
from methods.environment_map import EnvironmentMap
from methods.ray_traced import RayTraced

EMPTY = oracle.Room(np.array([-2.0, -2, -2]), np.array([2.0, 2, 2]), np.zeros(3))
LONG = oracle.Room(np.array([-3.0, -2, -1.5]), np.array([2.0, 3, 1.5]), np.zeros(3))
OCCUPIED = replace(LONG, ball=np.array([1.0, 0.2, 0.1]), radius=0.4)


def vectors(a: np.ndarray) -> mi.Vector3f:
    return mi.Vector3f(a.T.astype(np.float32))


def mapped(room: oracle.Room, n: int) -> distancemap.DistanceMap:
    """The room's map, its texels from the closed form."""
    k = (2 * np.arange(-1, n + 1) + 1) / n - 1
    texels = []
    for axis in range(3):
        for sign in (1, -1):
            v, u = np.meshgrid(k, k, indexing="ij")
            d = np.zeros((n + 2, n + 2, 3))
            d[..., axis], d[..., (axis + 1) % 3], d[..., (axis + 2) % 3] = sign, u, v
            texels.append(np.zeros((n + 2, n + 2, 4)))
            texels[-1][..., 3] = 1 / room.seen(d.reshape(-1, 3)).reshape(n + 2, n + 2)
    return distancemap.of_map(mi.Float(np.stack(texels).ravel().astype(np.float32)), n)


def followed(map: distancemap.DistanceMap, x, r, steps: int | None, iterations: int) -> np.ndarray:
    """Lengths of rays; by iteration where there are no steps."""
    of, every = distancemap.ray(vectors(x), vectors(r)), dr.full(mi.Bool, True, len(x))
    if steps is None:
        found = distancemap.iterate(map, of, iterations, every)
    else:
        found = distancemap.march(map, of, steps, iterations, every)
    return np.array(distancemap.length(of, found.spot), np.float64)


# What the papers say, and the kernel


@pytest.mark.parametrize("room", [EMPTY, LONG], ids=["cube", "off centre"])
def test_each_iteration_brings_an_empty_box_nearer_as_false_position_does(room):
    """The mean angle between what is shown and what should be falls to a sixth in each of the first four, at least."""
    x, r = oracle.rays(np.random.default_rng(0), 2000, 0.5, room)
    true, map = room.first_hit(x, r), mapped(room, 128)
    means = []
    for iterations in range(7):
        expected = oracle.iterated(room.seen, x, r, iterations)
        found = followed(map, x, r, None, iterations)
        means.append(oracle.off_deg(x, r, expected, true).mean())
        # Texels round the edges of the box; their share of the rays is about a texel's width in the directions.
        apart = oracle.off_deg(x, r, found, expected)
        assert np.median(apart) < 1e-3 and (apart > 0.05).mean() < 0.03
    environment = oracle.off_deg(x, r, np.full(len(x), 1e9), true).mean()
    assert 9.5 < environment < 10.5 and 1.1 < means[0] < 1.3 and means[1] < 0.04 and means[3] < 2e-3 and means[6] < 1e-4
    assert all(two < 0.3 * one for one, two in pairwise(means[:5]))


@pytest.mark.parametrize(("steps", "n"), [(None, 16), (1, 16), (40, 64)])
def test_where_start_and_end_see_one_plane_the_first_guess_is_exact(steps, n):
    """However few texels there are: 1 / depth is linear across a plane's picture."""
    x, r = oracle.rays(np.random.default_rng(1), 4000, 0.5, LONG)
    true = LONG.first_hit(x, r)

    def wall(v):
        with np.errstate(divide="ignore"):
            axis = np.argmin((np.where(v > 0, LONG.high, LONG.low) / v), axis=1)
        return 2 * axis + (np.take_along_axis(v, axis[:, None], axis=1)[:, 0] > 0)

    # All texels of the cells of start and end see one wall.
    one = wall(x) == wall(r)
    for d in (x, r):
        for corner in np.stack(np.meshgrid(*3 * [[-2.0 / n, 2.0 / n]]), axis=-1).reshape(-1, 3):
            one &= wall(d / np.abs(d).max(axis=1, keepdims=True) + corner) == wall(x)
    assert one.sum() > 100
    found = followed(mapped(LONG, n), x[one], r[one], steps, 0)
    np.testing.assert_allclose(found, true[one], rtol=3e-5)


def test_of_a_ball_in_the_room_a_march_misses_only_what_the_middle_does_not_see():
    """Rays that end more than 5 % off, by the closed forms: of one in thirty the iteration finds some other point; a march
    is wrong where the ball hides the true one from the middle. The kernel is as wrong as they are, but for its texels."""
    x, r = oracle.rays(np.random.default_rng(3), 1500, 0.5, OCCUPIED)
    outside = oracle.length(x - OCCUPIED.ball) > OCCUPIED.radius
    x, r = x[outside], r[outside]
    true = OCCUPIED.first_hit(x, r)
    p = x + true[:, None] * r
    seen = np.abs(oracle.length(p) / OCCUPIED.seen(p) - 1) < 1e-6
    assert 0.005 < (~seen).mean() < 0.05

    def off(d):
        return np.abs(d / true - 1) > 0.05

    iterated, marched = oracle.iterated(OCCUPIED.seen, x, r, 8), oracle.marched(OCCUPIED.seen, x[:300], r[:300], 64, 8)
    assert 0.01 < off(iterated)[seen].mean() < 0.03
    assert (np.abs(marched / true[:300] - 1) > 0.05)[seen[:300]].mean() < 0.004
    map = mapped(OCCUPIED, 128)
    by_iteration, by_march = (off(followed(map, x, r, steps, 8)) for steps in (None, 64))
    assert (by_iteration != off(iterated)).mean() < 0.01
    assert by_march[seen].mean() < 0.004 and by_march[seen].mean() < 0.2 * by_iteration[seen].mean()


def test_rays_that_start_behind_what_is_seen_end_somewhere():
    """Starts beyond the walls, on them, at the middle; ways along an axis, into the wall, and back."""
    x = np.array([[2.5, 0, 0], [2.5, 0, 0], [2.0, 0.1, 0], [2.0, 0.1, 0], [0, 0, 0], [0, 0, 1.9], [30.0, 30, 30]], float)
    r = np.array([[1.0, 0, 0], [-1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 1], [0, -1, 0]], float)
    map = mapped(EMPTY, 32)
    for steps in (None, 64):
        found = followed(map, x, r, steps, 8)
        assert not np.isnan(found).any() and (found > 0).all()
        np.testing.assert_allclose(found[[4, 5]], [2.0, 0.1], rtol=1e-4)  # as any other start
        assert found[2] < 0.01  # touching: where it starts
        assert steps is not None or np.isinf(found[1])  # an iteration finds nothing: an environment map's answer
    assert found[1] == pytest.approx(4.5, rel=1e-4)  # a march comes out of the wall and goes to the other


def test_a_step_of_depth_is_an_edge_and_a_slanted_wall_is_none():
    map = mapped(OCCUPIED, 128)
    centre = OCCUPIED.ball / np.linalg.norm(OCCUPIED.ball)
    aside = np.cross(centre, [0, 0, 1.0])
    aside /= np.linalg.norm(aside)
    half = np.arcsin(OCCUPIED.radius / np.linalg.norm(OCCUPIED.ball))
    d = np.stack([np.cos(a) * centre + np.sin(a) * aside for a in (0.0, half, half + 0.05, 1.0)])
    assert np.array(distancemap.is_edge(map, vectors(d), True)).tolist() == [False, True, False, False]
    assert cubemap.levels_of(128)[0] == map.n


# Pictures


@pytest.fixture(scope="module")
def rooms():
    """Per scene: its renderer and the truth."""
    sky = scene(balls(), (mirror_ball(),), background=(0.1, 0.2, 0.4))
    made = {"empty": scene((walls(),), (mirror_ball(),)), "room": mirror_room(), "sky": sky}
    out = {}
    for name, one in made.items():
        renderer = FrameRenderer(one, 160, 120)
        out[name] = one, renderer, shaded(RayTraced(), one, 0, renderer=renderer)[0]
    return out


def asked(rooms, name, method):
    made, renderer, truth = rooms[name]
    answer = shaded(method, made, 0, renderer=renderer)[0]
    doubt = np.broadcast_to(np.array(answer.reflection.doubt), answer.active.size).reshape(answer.active.shape)
    return answer, truth, doubt & answer.active


def rms(answer, truth) -> float:
    return float(np.sqrt(((answer.L - truth.L)[answer.active] ** 2).mean()))


@pytest.mark.parametrize("search", ["iterate", "march"])
def test_in_an_empty_room_what_is_near_is_in_its_place(rooms, search):
    """Where an environment map is off by an eighth of the radiance's range. At the outline a pixel shows half the room."""
    answer, truth, doubt = asked(rooms, "empty", DistanceImpostor(search=search))
    rival, _, _ = asked(rooms, "empty", EnvironmentMap())
    inner = np.asarray(binary_erosion(answer.active, iterations=2), bool)
    assert np.abs(answer.L - truth.L)[inner].max() < 0.04
    assert rms(answer, truth) < 0.15 * rms(rival, truth)
    np.testing.assert_allclose(answer.distance[inner], truth.distance[inner], rtol=3e-3)
    assert answer.found[answer.active].all() and doubt[inner].mean() < 0.002


def test_among_balls_a_march_is_wrong_behind_them_and_says_so(rooms):
    shares = {}
    for method in (EnvironmentMap(), DistanceImpostor(search="iterate"), DistanceImpostor()):
        answer, truth, doubt = asked(rooms, "room", method)
        wrong = answer.active & (np.abs(answer.L - truth.L).max(axis=2) > 0.1)
        shares[method] = rms(answer, truth)
        if isinstance(method, DistanceImpostor):
            assert 0.01 < wrong.sum() / answer.active.sum() < 0.08
            assert doubt[wrong].mean() > 0.7 and doubt[answer.active & ~wrong].mean() < 0.01
    environment, iterated, marched = shares.values()
    assert marched < 0.5 * iterated < 0.5 * environment


def test_in_the_open_what_is_beside_the_balls_is_the_sky(rooms):
    answer, truth, doubt = asked(rooms, "sky", DistanceImpostor())
    sky = answer.active & np.isinf(truth.distance)
    # The rest is behind the balls, as seen from the middle.
    assert np.isinf(answer.distance[sky]).mean() > 0.95 and answer.found[sky].all()
    assert doubt[sky & np.isfinite(answer.distance)].mean() > 0.7
    ball = answer.active & np.isfinite(truth.distance)
    right = ball & ~doubt
    assert right.sum() > 0.5 * ball.sum()
    off = np.abs(answer.distance / np.where(right, truth.distance, 1) - 1)[right]
    assert np.median(off) < 0.01


def test_a_flat_mirror_whose_wall_is_all_that_its_middle_sees_beside_it_shows_the_room():
    """In its plane the map sees the wall behind it, at no distance: starts are behind that."""
    sheet = Reflector("sheet", quad((-0.5, 1.9, -0.5), (1.0, 0, 0), (0, 0, 1.0)))
    made = scene((walls(), *balls()), (sheet,), still((0.3, -1.5, 0.2), (0, 1.9, 0)))
    renderer = FrameRenderer(made, 80, 60)
    answer, truth, rival = (
        shaded(m, made, 0, renderer=renderer)[0] for m in (DistanceImpostor(), RayTraced(), EnvironmentMap())
    )
    assert answer.active.sum() > 300 and rms(answer, truth) < 0.4 * rms(rival, truth)


def test_what_is_coarser_than_the_picture_or_not_closed_in_is_doubted(rooms):
    """Eight texels per face of a picture with pixels of half a degree to the ball's middle; first guesses alone; few steps."""
    for method, recall, less, most in (
        (DistanceImpostor(resolution=8), 0.7, 0.3, 1.0),
        (DistanceImpostor(search="iterate", iterations=0), 0.7, 0.05, 0.4),
        (DistanceImpostor(steps=1), 0.7, 0.02, 0.2),
        (DistanceImpostor(steps=2, iterations=0), 0.55, 0.04, 0.1),
    ):
        answer, truth, doubt = asked(rooms, "room", method)
        wrong = answer.active & (np.abs(answer.L - truth.L).max(axis=2) > 0.1)
        assert doubt[wrong].mean() > recall and less < doubt[answer.active].mean() < most, method


def test_two_mirrors_show_one_another_black_and_doubt_that():
    mirrors = (mirror_ball("one", (-0.45, 0.0, 0.0), 0.35), mirror_ball("two", (0.45, 0.1, 0.0), 0.35))
    made = scene((walls(),), mirrors)
    renderer = FrameRenderer(made, 160, 120)
    answer, truth = (shaded(m, made, 0, renderer=renderer)[0] for m in (DistanceImpostor(), RayTraced()))
    black, truly = ((a.active & (a.L.max(axis=2) == 0)) for a in (answer, truth))
    doubt = np.array(answer.reflection.doubt).reshape(black.shape)
    assert black.sum() > 50 and doubt[black].all() and doubt[truly].mean() > 0.8


def test_what_is_not_asked_for_is_not_done(rooms):
    made, renderer, _ = rooms["room"]
    told, plain = (shaded(DistanceImpostor(), made, 0, renderer=renderer, doubts=d)[0] for d in (True, False))
    assert plain.reflection.doubt is None and told.same(plain)


def test_a_resolution_that_is_no_power_of_two_is_refused():
    with pytest.raises(ValueError, match="distance_impostor: resolution is 100; accepted: a power of two"):
        DistanceImpostor(resolution=100)
