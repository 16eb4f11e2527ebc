"""Near and far: moved within a ball, looked up beyond, against brute force in float64; no gaps; what is taken when."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from oracles import near_far_oracle as oracle
from scipy.ndimage import binary_erosion
from support.mirror_room import CENTRE, EYE, RADIUS, ball, balls, lit, mirror_ball, plain, scene, shaded, still, walls
from support.proxy_rooms import Truth
from support.small_room import box, quad

from benchharness.kernels.eye import eye_of
from benchharness.kernels.images import nearfar, refresh
from benchharness.render.frame import FrameRenderer
from benchharness.scene import Object, Reflector, subdivided
from benchharness.study import params
from methods.environment_map import EnvironmentMap
from methods.near_far import NearFar
from methods.newton import Newton
from methods.ray_traced import RayTraced

SIZE = (96, 72)
GREY = (0.5, 0.5, 0.5)


def thing(name: str, mesh, motion=None) -> Object:
    return Object(name, mesh, "something to reflect", motion)


def room():
    """Walls beyond the ball, three balls within, one beyond, and a floor that reaches from one to the other. Coarse: brute
    force tries every triangle at every pixel."""
    near = [replace(o, mesh=ball(0.15, o.mesh.vertices.mean(axis=0), np.asarray(o.mesh.radiance)[0], 1)) for o in balls()]
    floor = lit(quad((-1.9, -1.9, -0.75), (3.8, 0, 0), (0, 3.8, 0)), 0.4, 0.25)
    far = ball(0.25, (-0.9, -1.3, 0.7), (0.9, 0.8, 0.1), 1)
    return scene((walls(h=1.0), *near, thing("floor", floor), thing("far", far)), (mirror_ball(),))


@pytest.fixture(scope="module")
def asked():
    """The room's pictures: its renderer, a frame on the host, the truth."""
    made = room()
    renderer = FrameRenderer(made, *SIZE)
    (truth,) = shaded(RayTraced(), made, 0, renderer=renderer)
    return made, renderer, truth


def rms(one, other, where) -> float:
    return float(np.sqrt(((one.L - other.L)[where] ** 2).mean()))


def host(values) -> np.ndarray:
    return np.array(values, np.float64).T


# Against float64


def test_a_pixel_shows_what_is_moved_within_the_ball_and_else_the_map_of_what_lies_beyond(asked):
    """All pixels but those at edges, which texels blend over two pixels. A ball 1.2 times as large puts 9 to 14 % off."""
    (made, renderer, _), split, overlap = asked, 2.4, 0.75
    method = NearFar(split=split, overlap=overlap, resolution=512)
    (found,) = shaded(method, made, 0, renderer=renderer)
    lanes = np.flatnonzero(found.active.ravel())
    p, n = (host(a)[lanes] for a in (found.frame.p, found.frame.n))
    v = np.array(EYE) - p
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    r = 2 * (v * n).sum(axis=1, keepdims=True) * n - v
    extent = found.state.division.mirrors[0].extent
    assert extent == pytest.approx(RADIUS, rel=1e-6)
    shown, moved, clear = oracle.composed(made, p, r, np.array(CENTRE), split * extent, overlap)
    inner = clear & binary_erosion(found.active, iterations=2).ravel()[lanes]
    off = np.abs(found.L.reshape(-1, 3)[lanes] - shown).max(axis=1)
    assert inner.mean() > 0.8 and 0.1 < moved[inner].mean() < 0.9
    assert np.median(off[inner]) < 5e-3
    assert (off[inner & moved] > 0.05).mean() < 0.02 and (off[inner & ~moved] > 0.05).mean() < 0.12


def positions(mirror: nearfar.Mirror) -> np.ndarray:
    return mirror.corners.mean(axis=1)


@pytest.mark.parametrize(("away", "within"), [(30.0, 0.12), (600.0, 0.04)])
def test_the_parallax_of_a_ball_is_how_far_the_maps_image_is_from_the_true_one(away, within):
    """To the first order in 1 / distance; normals are interpolated, which is 3 % of what they turn by at a slant."""
    mirror = nearfar.Mirror.of(mirror_ball(radius=1.0, fine=192))
    eye, focal = np.array([0.5, -3.0, 1.0]), 400.0
    predicted = nearfar.parallax(mirror, np.eye(3, 4), eye, focal) / away
    points = positions(mirror)
    points = points[((eye - points) * mirror.normals.mean(axis=1)).sum(axis=1) > 0]
    assert len(points) == len(predicted) > 80
    judged = 0
    for p, pixels in zip(points, predicted, strict=True):
        n = oracle.unit(p)
        v = oracle.unit(eye - n)
        if not 0.25 < n @ v < 0.995:
            continue
        r = 2 * (v @ n) * n - v
        along = n @ r
        V = n + (np.sqrt(along**2 - 1 + away**2) - along) * r
        true, shown = oracle.on_ball(eye, V, 1.0), oracle.on_ball_towards(eye, oracle.unit(V), 1.0)
        np.testing.assert_allclose(true, n, atol=1e-9)
        assert focal * oracle.apart(eye, true, shown) == pytest.approx(pixels, rel=within)
        judged += 1
    assert judged > 40


@pytest.mark.parametrize(("away", "within"), [(30.0, 0.12), (600.0, 0.01)])
def test_the_parallax_of_a_wall_is_that_of_its_image(away, within):
    """A flat mirror shows a radian as large as the eye does: nothing but its own extent counts, whatever its pose."""
    pose = np.column_stack([oracle_turn(), [0.3, 2.0, -0.4]])
    mesh = quad((-1.0, -0.5, 0.2), (2.0, 0, 0), (0, 1.0, 0))
    mirror = nearfar.Mirror.of(Reflector("wall", mesh))
    eye = pose[:, :3] @ np.array([0.4, 0.3, 3.0]) + pose[:, 3]
    normal, centre = pose[:, 2], pose[:, :3] @ mirror.centre + pose[:, 3]
    predicted = nearfar.parallax(mirror, pose, eye, 500.0) / away
    assert len(predicted) == len(mirror.corners) == 2
    for p, pixels in zip(positions(mirror) @ pose[:, :3].T + pose[:, 3], predicted, strict=True):
        v = oracle.unit(eye - p)
        r = 2 * (v @ normal) * normal - v
        V = p + away * r
        true = oracle.on_wall(eye, V, centre, normal)
        shown = oracle.on_wall_towards(eye, oracle.unit(V - centre), centre, normal)
        np.testing.assert_allclose(true, p, atol=1e-9)
        assert 500.0 * oracle.apart(eye, true, shown) == pytest.approx(pixels, rel=within)


def oracle_turn() -> np.ndarray:
    c, s = np.cos(0.7), np.sin(0.7)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def test_triangles_are_as_far_as_their_nearest_point():
    """Of faces, edges and corners each some, and triangles without area."""
    rng = np.random.default_rng(2)
    triangles = rng.normal(size=(60, 3, 3))
    triangles[:5, 2] = triangles[:5, 1]
    triangles[5:8] = triangles[5:8, :1]
    triangles[8:30] *= [1, 1, 0.05]
    shift_ = np.array([1.0, 2.0, 3.0])
    found = nearfar.distances(triangles + shift_, shift_)
    expected = [oracle.distance(triangle, np.zeros(3)) for triangle in triangles]
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-6)


# What it is for


def test_it_is_more_right_than_a_map_and_searches_less_than_moving_everything(asked):
    made, renderer, truth = asked
    inner = binary_erosion(truth.active, iterations=2)
    both, near, far = (shaded(m, made, 0, renderer=renderer)[0] for m in (NearFar(), Newton(), EnvironmentMap()))
    off = [rms(answer, truth, inner) for answer in (both, far)]
    assert off[0] < 0.4 * off[1], off
    work = [int(np.array(a.reflection.counters["iterations"], np.int64).sum()) for a in (both, near)]
    assert 0 < work[0] < 0.85 * work[1], work


def test_a_map_that_is_asked_where_its_distances_put_things_shows_them_nearer_to_their_places(asked):
    made, renderer, truth = asked
    inner = np.array(binary_erosion(truth.active, iterations=2), bool)
    plainly, again = (shaded(NearFar(split=2.4, far=far), made, 0, renderer=renderer)[0] for far in ("direction", "distance"))
    off = [rms(answer, truth, inner) for answer in (plainly, again)]
    assert off[1] < 0.7 * off[0], off
    apart = [float(np.median(np.abs(a.distance[inner] / truth.distance[inner] - 1))) for a in (plainly, again)]
    assert apart[1] < 0.01 and apart[1] < apart[0]


def test_what_is_wrong_is_doubted():
    """With a ball about the mirror alone, an environment map of nearly everything; with one that holds what is near. Two
    pixels off is not doubted, and colours change by less than this within."""
    truth = Truth(room())
    for method in (NearFar(split=1.05), NearFar(split=2.4)):
        wrong, recall, wolf = truth.judged(method, 0.25)
        assert wrong > 0.01 and recall > 0.75 and wolf < 0.5


def test_with_everything_near_it_is_newtons_method_and_with_nothing_an_environment_map(asked):
    made, renderer, _ = asked
    everything, near = (shaded(m, made, 0, renderer=renderer)[0] for m in (NearFar(split=1e3), Newton()))
    assert np.array_equal(everything.L[near.found & near.active], near.L[near.found & near.active])
    alone = replace(made, objects=made.objects[:1])
    nothing, far = (shaded(m, alone, 0, size=SIZE)[0] for m in (NearFar(split=1.0), EnvironmentMap()))
    assert nothing.counted("near_triangles") == 0 and "iterations" not in nothing.reflection.counters
    np.testing.assert_allclose(nothing.L[far.active], far.L[far.active], atol=1e-6)


def test_what_is_near_is_seen_once():
    """A red ball near the mirror before grey walls: with everything in the map, it is seen where the map has it, too."""
    near = thing("red", ball(0.12, (0.3, -0.65, 0.1), (0.9, 0.1, 0.1)))
    made = scene((thing("walls", plain(box((-2, -2, -2), (2, 2, 2), inside=True), GREY)), near), (mirror_ball(),))
    renderer = FrameRenderer(made, 192, 144)
    methods = (RayTraced(), NearFar(split=2.4), NearFar(split=2.4, overlap=0.0))
    true, once, twice = (shaded(m, made, 0, renderer=renderer)[0] for m in methods)
    red = [answer.active & (answer.L[..., 0] > 0.52) for answer in (true, once, twice)]
    assert red[0].sum() > 60
    assert (red[0] ^ red[1]).sum() < 0.05 * red[0].sum() + 2
    assert (red[2] & ~red[0]).sum() > 10 + (red[1] & ~red[0]).sum()


def shell(overlap: float, split: float) -> tuple[int, int]:
    """Pixels, and those that are not grey: a grey room whose walls are 0.65 to 2 m from the mirror, in a red one."""
    grey = subdivided(plain(box((-0.8, -2.0, -0.65), (1.1, 1.5, 1.2), inside=True), GREY), 0.3)
    red = plain(box((-3, -3, -3), (3, 3, 3), inside=True), (0.9, 0.0, 0.0))
    made = scene((thing("grey", grey), thing("red", red)), (mirror_ball(),), still((0.1, -1.7, 0.2)))
    (found,) = shaded(NearFar(split=split, overlap=overlap, resolution=64), made, 0, size=SIZE, doubts=False)
    assert found.found[found.active].all()
    inner = binary_erosion(found.active, iterations=1)
    return int(inner.sum()), int((np.abs(found.L - 0.5).max(axis=2) > 1e-3)[inner].sum())


@pytest.mark.parametrize("split", [1.3, 1.7, 2.2, 3.1])
def test_no_gap_opens_where_a_wall_crosses_the_border_of_the_ball(split):
    count, off = shell(NearFar().overlap, split)
    assert count > 1000 and off <= 2


def test_without_an_overlap_there_are_gaps():
    count, off = shell(1.0, 2.2)
    assert off > 0.1 * count


# How far the ball reaches


def test_the_ball_reaches_where_the_parallax_is_what_is_allowed():
    made = room()
    frame = FrameRenderer(made, *SIZE).render(0)
    mirror, eye, pose = nearfar.Mirror.of(made.reflectors[0]), eye_of(frame), refresh.matrices(frame.poses)[-1]
    off = nearfar.parallax(mirror, pose, eye.place, eye.focal)
    reaches = [nearfar.wanted(mirror, pose, eye.place, eye.focal, pixels, 0.0) for pixels in (500.0, 2.0, 1.0, 0.5)]
    assert reaches[0] == pytest.approx(RADIUS / np.sqrt(nearfar.SLACK), rel=1e-6)  # the mirror lies within
    for pixels, reach in zip((2.0, 1.0, 0.5), reaches[1:], strict=True):
        assert (off / reach <= pixels).mean() >= nearfar.QUANTILE
        assert np.quantile(off / reach, nearfar.QUANTILE) == pytest.approx(np.sqrt(nearfar.SLACK) * pixels, rel=1e-6)
        for before, kept in ((0.99 * reach, True), (1.15 * reach, True), (0.8 * reach, False), (1.25 * reach, False)):
            found = nearfar.wanted(mirror, pose, eye.place, eye.focal, pixels, before)
            assert (found == before) == kept and (kept or found == reach)


def test_the_ball_stays_while_the_eye_moves_a_little_and_grows_when_it_comes_near():
    """15 steps towards the mirror and 15 back: few other balls, and no more maps than balls."""
    way = [*np.linspace(3.5, 2.0, 15), *np.linspace(2.0, 3.5, 15)]

    def camera(time: float):
        return still((0.1, -way[round(25 * time)], 0.2))(time)

    made = scene((walls(), *balls()), (mirror_ball(),), camera, frames=30)
    answers = shaded(NearFar(parallax_px=1.0, resolution=16), made, *range(30), size=(64, 48), doubts=False)
    reach = np.array([answer.state.division.reach[0] for answer in answers])
    maps = [id(answer.state.probes.probes[0].map.texels) for answer in answers]
    changes = int((np.diff(reach) != 0).sum())
    assert reach[14] > 1.5 * reach[0] and 2 <= changes <= 10
    assert len(set(maps)) <= changes + 1
    lists = [id(answer.state.ends[0].choice) for answer in answers if answer.state.ends]
    assert len(set(lists)) <= changes + 1


def test_lists_are_made_anew_once_a_share_of_the_ball_and_not_whenever_a_triangle_comes_near():
    """A ball comes in 60 steps, some of its 1280 triangles with each."""
    coming = thing("coming", ball(0.3, (0.0, 0.0, 0.0), (0.9, 0.1, 0.1)))
    begun = nearfar.Division.begun(scene((coming,), (mirror_ball(),)))
    lists = {}
    for keeps in (True, False):
        division, lists[keeps] = begun, []
        for away in np.linspace(2.0, 1.0, 60):
            there = np.eye(3, 4)
            there[0, 3] = away
            division = division.moved(np.stack([there, np.eye(3, 4)])).reaching([1.2], keeps=keeps)
            assert (division.near.faces | (division.nearest >= 1.2)).all()
            lists[keeps].append(division.near)
    made = {keeps: len(set(map(id, some))) for keeps, some in lists.items()}
    assert made[False] > 25 and made[True] < 10, made


def shift(x: float, y: float = 0.0, z: float = 0.0):
    def motion(time: float) -> np.ndarray:
        pose = np.eye(4)
        pose[:3, 3] = 25 * time * np.array([x, y, z])
        return pose

    return motion


def test_a_map_is_taken_again_when_something_moves_that_it_shows_or_its_mirror():
    near = thing("near", ball(0.1, (0.0, -0.7, 0.0), (0.9, 0.1, 0.1)))
    far = thing("far", ball(0.2, (1.3, -0.6, 0.4), (0.1, 0.1, 0.9)))
    room_ = thing("walls", plain(box((-2, -2, -2), (2, 2, 2), inside=True), GREY))
    slow = 0.02
    for moving, taken in ((near, False), (far, True), (None, True)):
        objects = [replace(o, motion=shift(slow)) if o is moving else o for o in (room_, near, far)]
        mirror = mirror_ball() if moving is not None else replace(mirror_ball(), motion=shift(0, slow))
        made = scene(objects, (mirror,))
        answers = shaded(NearFar(split=2.4, resolution=16), made, 0, 1, size=(32, 24), doubts=False)
        maps = [answer.state.probes.probes[0].map.texels for answer in answers]
        assert (maps[0] is not maps[1]) == taken
        fresh = shaded(NearFar(split=2.4, resolution=16, warm=False), made, 1, size=(32, 24), doubts=False)[0]
        assert (np.abs(answers[1].L - fresh.L).max(axis=2) > 0.01).mean() < 0.01


def test_what_moves_costs_its_map_in_update_and_not_in_shade():
    """Once an eye has decided how far the ball reaches."""
    far = thing("far", ball(0.2, (1.3, -0.6, 0.4), (0.1, 0.1, 0.9)), shift(0.02))
    made = scene((walls(), far), (mirror_ball(),))
    renderer, method = FrameRenderer(made, 32, 24), NearFar(resolution=16)
    first, second = (renderer.render(k) for k in range(2))
    _, before = method.shade(method.update(method.prepare(made), first), first)
    updated = method.update(before, second)
    _, after = method.shade(updated, second)
    maps = [state.probes.probes[0].map.texels for state in (before, updated, after)]
    assert maps[0] is not maps[1] and maps[1] is maps[2]


def test_vertices_that_stay_near_start_from_where_they_were():
    """The list changes as a ball comes near; what was in it before is found in fewer steps than anew."""
    coming = thing("coming", ball(0.1, (0.0, -0.2, 1.6), (0.9, 0.1, 0.1)), shift(0, 0, -0.25))
    made = scene((walls(), *balls(), coming), (mirror_ball(),))
    method = NearFar(split=2.4, resolution=16)
    one, _, three = shaded(method, made, 0, 1, 3, size=(64, 48), doubts=False)
    assert one.state.division.near is not three.state.division.near
    anew = shaded(replace(method, warm=False), made, 3, size=(64, 48), doubts=False)[0]
    work = [int(np.array(a.reflection.counters["iterations"], np.int64).sum()) for a in (three, anew)]
    assert work[0] < 0.8 * work[1]
    assert (np.abs(three.L - anew.L).max(axis=2) > 0.01).mean() < 0.01


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("split", 0.5, "at least 1"),
        ("parallax_px", 0.0, "more than 0"),
        ("overlap", 1.5, "at most 1"),
        ("resolution", 2, "at least 4"),
    ],
)
def test_a_bad_value_is_refused_with_what_is_accepted(name, value, text):
    with pytest.raises(ValueError, match=rf"{name} is .*; accepted: .*{text}"):
        params.sweep({name: value}, params.of_method(NearFar), "study.toml: [methods.near_far]")


def test_a_resolution_that_is_no_power_of_two_is_refused_at_once():
    with pytest.raises(ValueError, match="resolution is 100; accepted: a power of two"):
        NearFar(resolution=100)
