"""Morphed reflections: against closed forms, exact where maps agree, and how that is lost as they are farther apart."""

from __future__ import annotations

from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from oracles import impostor_oracle
from oracles import morph_oracle as oracle
from oracles.proxy_oracle import turned
from support.cube_texels import directions, vectors
from support.mirror_room import balls, mirror_ball, mirror_room, plain, scene, shaded, still, walls
from support.proxy_rooms import SIZE, WAY, Truth, dome, hall, red
from support.small_room import box, quad

from benchharness.kernels import cubemap
from benchharness.kernels.differentials import RayDifferential
from benchharness.kernels.images import distancemap, morph
from benchharness.render.frame import FrameRenderer
from benchharness.scene import Object, Reflector
from methods.environment_map import EnvironmentMap
from methods.probe_blend import ProbeBlend
from methods.reflection_morph import ReflectionMorph
from scenes.stress.comb import comb
from scenes.stress.contact import contact

EMPTY = impostor_oracle.Room(np.array([-3.0, -2, -1.5]), np.array([2.0, 3, 1.5]), np.zeros(3))
OCCUPIED = replace(EMPTY, ball=np.array([1.0, 0.2, 0.1]), radius=0.3)
LOW, HIGH = np.array([-0.5, -0.5, -0.5]), np.array([0.5, 0.5, 0.5])
FRAME = turned(np.array([1.0, 2.0, -1.5]), 50.0)
GREY = (0.5, 0.5, 0.5)


def gridded(room: oracle.Surroundings, low, high, counts: tuple[int, int, int], n: int = 64) -> morph.Grid:
    """Maps whose colour is the point that they show."""
    d, texels = directions(n), []
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    at = oracle.places(low, high, counts)
    for c in at:
        away = room.first_hit(np.broadcast_to(c, d.shape), d)
        texels.append(np.column_stack([c + away[:, None] * d, 1 / away]))
    maps = [mi.Float(one.ravel().astype(np.float32)) for one in texels]
    half, middle = 0.5 * (high - low), 0.5 * (high + low)
    rows = [mi.Vector4f([*(np.eye(3)[k] / half[k]).tolist(), float(-middle[k] / half[k])]) for k in range(3)]
    return morph.Grid(
        maps=cubemap.Pyramid(dr.concat(maps), mi.UInt32([0]), n, 1),
        distances=distancemap.DistanceMap(dr.concat([distancemap.of_map(one, n).nearness for one in maps]), n),
        places=mi.Float(np.column_stack([at, np.zeros(len(at))]).astype(np.float32).ravel()),
        rows=rows,
        counts=counts,
        box=rows,
    )


def blended(grid: morph.Grid, p: np.ndarray, r: np.ndarray, *, moved: bool) -> np.ndarray:
    """What the kernel shows of rays, [M, 3]."""
    nothing = [dr.zeros(mi.Vector3f, len(p)) for _ in range(2)]
    every, plain_sky = dr.full(mi.Bool, True, len(p)), False
    found = morph.blended(
        grid,
        mi.Point3f(vectors(p)),
        vectors(r),
        RayDifferential(nothing, nothing),
        every,
        morph=moved,
        doubts=False,
        plain=plain_sky,
        black=False,
    )
    return np.array(found.L).T.astype(np.float64)


def expected(room: oracle.Surroundings, low, high, counts, p, r, *, moved: bool) -> oracle.Shown:
    held, straight = oracle.weights(p, low, high, counts)
    return oracle.shown(room, p, r, oracle.places(low, high, counts), held, straight, morph=moved)


def truly(room: oracle.Surroundings, p: np.ndarray, r: np.ndarray) -> np.ndarray:
    return p + room.first_hit(p, r)[:, None] * r


def apart(one: np.ndarray, two: np.ndarray) -> np.ndarray:
    return np.linalg.norm(one - two, axis=1)


# The kernel


@pytest.mark.parametrize("moved", [False, True], ids=["blended", "morphed"])
@pytest.mark.parametrize("counts", [(2, 2, 2), (3, 1, 2)], ids=str)
def test_of_any_ray_it_shows_what_closed_forms_do(moved, counts):
    """A ball in a room; starts on a mirror ball, so between the maps and beyond them. What differs are texels at edges."""
    p, r = impostor_oracle.rays(np.random.default_rng(2), 1500, 0.5, OCCUPIED)
    told = expected(OCCUPIED, LOW, HIGH, counts, p, r, moved=moved)
    sure = np.abs(told.ratio - 3.2).min(axis=1) > 0.1
    assert (told.ratio[sure].max(axis=1) > 3.3).sum() > 10
    off = apart(blended(gridded(OCCUPIED, LOW, HIGH, counts), p, r, moved=moved), told.point)
    assert np.median(off[sure]) < 2e-3 and np.quantile(off[sure], 0.85) < 0.02
    # And where maps disagree along the ray, of which more end at edges.
    assert np.median(off[sure & (told.ratio.max(axis=1) > 3.3)]) < 0.05


def test_where_maps_see_one_plane_a_morph_is_exact_and_a_blend_is_not():
    """Beyond the outermost maps too, up to where the mirror touches a wall: x = 0.5 here, 0.25 from the outermost maps."""
    room = replace(EMPTY, high=np.array([0.5, 3, 1.5]))
    p, r = impostor_oracle.rays(np.random.default_rng(3), 3000, 0.5, room)
    told, true = expected(room, LOW, HIGH, (2, 2, 2), p, r, moved=True), truly(room, p, r)
    on = [np.abs(told.points - np.where(side, room.high, room.low)) < 1e-9 for side in (False, True)]
    one = np.zeros(len(p), bool)
    for walls_ in on:
        one |= np.any(np.array(np.all(walls_ | ~told.used[..., None], axis=1)), axis=1)
    # And what they see along the ray is that wall.
    one &= apart(told.point, true) < 1e-9
    near = one & (np.abs(true[:, 0] - 0.5) < 1e-9)
    assert one.mean() > 0.4 and near.sum() > 150
    grid = gridded(room, LOW, HIGH, (2, 2, 2))
    found = apart(blended(grid, p, r, moved=True), true)
    assert np.quantile(found[one], 0.99) < 6e-3 and np.median(found[near]) < 1e-3
    assert np.median(apart(blended(grid, p, r, moved=False), true)[near]) > 0.1


def test_at_a_maps_own_place_both_are_exact_and_a_blend_is_off_in_proportion_to_the_way_from_there():
    """One map, so that nothing else can help: 0, 2, 4 and 8 cm beside it."""
    rng = np.random.default_rng(4)
    r = rng.normal(size=(800, 3))
    r /= np.linalg.norm(r, axis=1, keepdims=True)
    grid, way = gridded(EMPTY, LOW, HIGH, (1, 1, 1), 128), np.array([0.6, -0.64, 0.48])
    means = []
    for step in (0.0, 0.02, 0.04, 0.08):
        p = np.broadcast_to(step * way, r.shape)
        for moved in (False, True):
            off = apart(blended(grid, p, r, moved=moved), truly(EMPTY, p, r))
            means.append(np.median(off))
    plain_, moved_ = means[::2], means[1::2]
    assert plain_[0] < 1e-3 and moved_[0] < 1e-3
    for one, two in ((1, 2), (2, 3)):
        assert plain_[two] / plain_[one] == pytest.approx(2, abs=0.15)
    assert all(b < 0.2 * a for a, b in zip(plain_[1:], moved_[1:], strict=True))


def test_a_blend_errs_with_the_square_of_the_spacing_in_smooth_surroundings_and_a_morph_by_less():
    """A mirror in a dome away from its middle; starts within the inner half of its box."""
    room = oracle.Dome(np.array([0.7, -0.4, 0.3]), 2.5)
    rng = np.random.default_rng(5)
    r = rng.normal(size=(500, 3))
    r /= np.linalg.norm(r, axis=1, keepdims=True)
    errors = []
    for spacing in (1.0, 0.5, 0.25):
        p = rng.uniform(-0.5, 0.5, r.shape) * spacing
        grid = gridded(room, -np.full(3, spacing), np.full(3, spacing), (2, 2, 2), 128)
        errors.append([apart(blended(grid, p, r, moved=moved), truly(room, p, r)).mean() for moved in (False, True)])
    slopes = np.polyfit(np.log([1.0, 0.5, 0.25]), np.log(errors), 1)[0]
    assert slopes[0] == pytest.approx(2, abs=0.3)
    assert all(moved < 0.3 * plain_ for plain_, moved in errors)


def test_a_map_that_would_stand_within_an_object_stands_beside_it():
    """At a corner of the ball's box, outside of the ball, in a block."""
    block = Object("block", plain(box((0.3, 0.3, 0.3), (0.45, 0.45, 0.45)), GREY), "around a place")
    one, other = (
        np.array(morph.begun(scene((walls(), *more), (mirror_ball(),)), 4).plans[0].nodes).reshape(-1, 4)
        for more in ((), (block,))
    )
    moved = np.flatnonzero(np.abs(one - other).max(axis=1) > 1e-6)
    assert len(one) == 64 and len(moved) == 1
    np.testing.assert_allclose(one[moved[0], :3], 0.375, atol=0.01)
    gaps = np.linalg.norm(np.delete(one, moved, axis=0) - other[moved], axis=1)
    assert gaps.min() < 1e-6 and np.linalg.norm(one[moved] - other[moved]) < 0.26


# Pictures


@pytest.fixture(scope="module")
def room():
    return Truth(mirror_room())


@pytest.fixture(scope="module")
def turned_hall():
    return Truth(hall(FRAME, (5.0, -3.0, 2.0)))


def test_one_map_that_is_not_moved_is_the_environment_map(room):
    one, other = room.of(ReflectionMorph(samples=1, morph=False, resolution=256)), room.of(EnvironmentMap())
    np.testing.assert_allclose(one.L[one.active], other.L[one.active], atol=1e-5)


def test_in_an_empty_room_more_maps_are_better_and_a_morph_is_much_better(turned_hall):
    """Of any place and turn. What is left of a morph is at the room's edges, where maps see two walls along a ray."""
    environment = turned_hall.error(EnvironmentMap())
    plain_ = [turned_hall.error(ReflectionMorph(samples=n, morph=False, resolution=64)) for n in (1, 2, 3)]
    moved = [turned_hall.error(ReflectionMorph(samples=n)) for n in (1, 2)]
    assert plain_[0] == pytest.approx(environment, rel=0.05)
    assert plain_[1] < 0.6 * plain_[0] and plain_[2] < 0.65 * plain_[1]
    assert moved[0] < 0.5 * plain_[0] and moved[1] < 0.35 * plain_[1] and moved[1] < 0.7 * moved[0]
    true, found = turned_hall.answer.distance[turned_hall.inner], turned_hall.of(ReflectionMorph()).distance[turned_hall.inner]
    assert np.median(np.abs(found / true - 1)) < 3e-3


def test_where_all_is_far_it_is_the_environment_map():
    for made in (scene((walls(4000.0),), (mirror_ball(),)), scene((), (mirror_ball(),), background=(0.1, 0.2, 0.3))):
        renderer = FrameRenderer(made, *SIZE)
        one, *others = (
            shaded(m, made, 0, renderer=renderer)[0]
            for m in (EnvironmentMap(), ReflectionMorph(), ReflectionMorph(morph=False))
        )
        for other in others:
            assert np.abs(other.L - one.L)[one.active].max() < 3e-3 and other.found[one.active].all()
            assert (np.isinf(other.distance) == np.isinf(one.distance)).all()


def test_a_thing_off_the_wall_is_there_half_where_a_blend_has_nothing_of_it():
    """Of the red pixels, the method's and the true ones, those that are not both, of a ball 0.4 from the mirror: 0.58 with two
    maps along a side, 0.25 with four; 0.87 blended, 0.95 of a map alone."""
    truth = Truth(dome(red(0.9 * WAY)))
    two, three, plain_ = (
        truth.missed(m) for m in (ReflectionMorph(), ReflectionMorph(samples=3), ReflectionMorph(morph=False))
    )
    assert three < two - 0.05 and two < 0.7 and min(plain_, truth.missed(EnvironmentMap())) > 0.8


def test_a_room_of_one_colour_keeps_it():
    made = scene(
        (Object("walls", plain(box((-2, -2, -2), (2, 2, 2), inside=True), GREY), "one colour"),),
        (mirror_ball(center=(1.0, 0.4, 0.3), radius=0.3),),
        still((1.1, -1.2, 0.5), (1.0, 0.4, 0.3)),
    )
    for method in (ReflectionMorph(samples=3, resolution=16), ReflectionMorph(morph=False, resolution=16)):
        (found,) = shaded(method, made, 0, size=SIZE)
        np.testing.assert_allclose(found.L[found.active], 0.5, rtol=1e-4)


def test_maps_of_a_leaning_sheet_stand_in_its_plane_and_show_a_wall_beside_it():
    u, v = np.array([1.6, 0.4, 0.3]), np.array([0.05, -0.1, 0.8])
    corner = np.array([-0.8, 1.2, -0.5])
    sheet = Reflector("sheet", quad(corner, u, v))
    truth = Truth(scene((walls(), *balls()), (sheet,), still((0.3, -1.5, 0.2), tuple(corner + 0.5 * (u + v)))))
    answer = truth.of(ReflectionMorph(samples=4))
    (grid,) = answer.state.grids
    places = np.array(grid.places).reshape(-1, 4)
    n = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
    assert sorted(grid.counts) == [1, 2, 4] and np.abs((places[:, :3] - corner) @ n).max() < 1e-4
    assert truth.error(ReflectionMorph(samples=4)) < 0.4 * truth.error(EnvironmentMap())


# Doubt


def test_what_is_wrong_is_doubted_and_little_else(room, turned_hall):
    for truth, most in ((Truth(contact(0.0)), 0.35), (Truth(comb(6)), 0.35), (room, 0.12)):
        wrong, recall, wolf = truth.judged(ReflectionMorph())
        assert wrong > 0.005 and recall > 0.85 and wolf < most
    assert turned_hall.judged(ReflectionMorph())[2] < 0.05


def test_it_is_better_than_maps_of_the_room(room):
    assert room.error(ReflectionMorph()) < room.error(ProbeBlend())


def test_mirrors_that_are_black_in_others_are_doubted_and_doubt_changes_nothing():
    mirrors = (mirror_ball("one", (-0.45, 0.0, 0.0), 0.35), mirror_ball("two", (0.45, 0.1, 0.0), 0.35))
    made = scene((walls(), *balls()), mirrors)
    one, silent = (shaded(ReflectionMorph(resolution=32), made, 0, size=SIZE, doubts=doubts)[0] for doubts in (True, False))
    doubt = np.array(one.reflection.doubt).reshape(one.active.shape)
    black = one.active & (one.L.max(axis=2) == 0)
    assert black.sum() > 20 and doubt[black].all()
    assert silent.reflection.doubt is None and one.same(silent)


def test_bad_values_are_refused_with_what_is_accepted():
    with pytest.raises(ValueError, match="resolution is 100; accepted: a power of two"):
        ReflectionMorph(resolution=100)
