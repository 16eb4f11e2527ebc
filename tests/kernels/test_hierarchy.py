"""Rays meet what is there: nothing slips through edges, and what moves is met where it stands, whichever way it is served."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from support.mirror_room import ball, balls, lit, mirror_ball, scene, shaded, still, walls
from support.small_room import box, quad

from benchharness.kernels import geometry, hierarchy
from benchharness.scene import Mesh, Object, Reflector, Scene
from methods.ray_traced import RayTraced
from scenes.props.minimal import pose

ODD = (501, 401)  # the middle row and column of pixels look along the room's planes of symmetry, where edges are
WAYS = (hierarchy.ANEW, hierarchy.BODIES)


def rolling(time: float) -> np.ndarray:
    return pose("z", 400 * time, (0.3 * time, -2.0 * time, 0.5 * time))


def swinging(time: float) -> np.ndarray:
    return pose("x", -300 * time, (-1.0 * time, 0.2, 0.0))


def busy_room() -> Scene:
    """Two mirrors, one of which moves together with a ball; another ball moves by itself, a third stands still."""
    red, green, blue = balls()
    mirrors = (
        mirror_ball("one", (-0.5, 0.3, 0.0), 0.4, 48),
        mirror_ball("two", (0.5, 0.3, 0.0), 0.4, 48, motion=swinging, eta=(0.2, 0.9, 1.1), k=(3.9, 2.4, 2.1)),
    )
    return scene((walls(), replace(red, motion=rolling), replace(green, motion=swinging), blue), mirrors, frames=4)


def frozen_at(made: Scene, time: float) -> Scene:
    """The same scene without motions, every part built where it stands at `time`."""

    def placed(part):
        mesh = part.mesh.transformed(part.pose(time))
        return replace(part, mesh=mesh, motion=None)

    return replace(made, objects=tuple(map(placed, made.objects)), reflectors=tuple(map(placed, made.reflectors)))


# Edges


def grid_mirrored() -> Scene:
    """A flat mirror, and behind the eye a wall of squares of 1/8: rays of the middle row run along its edges."""
    wall = Object("wall", lit(quad((-4, -2, -4), (0, 0, 8), (8, 0, 0)), 0.126), shows="edges")
    mirror = Reflector("mirror", quad((-1, 0, -1), (2, 0, 0), (0, 0, 2)))
    return scene((wall,), (mirror,), still((0.0, -1.0, 0.0), (0.0, 0.0, 0.0), 60.0))


def ball_room() -> Scene:
    return scene((walls(),), (mirror_ball(),), still((0.0, -1.7, 0.0), fov_deg=36.0))


@pytest.mark.parametrize("made", [ball_room, grid_mirrored])
def test_no_ray_slips_through_an_edge_between_triangles(made):
    """All that the mirror can show is a wall without holes: a ray that goes on for ever went through an edge."""
    robust, fast = (shaded(RayTraced(robust=robust), made(), 0, size=ODD)[0] for robust in (True, False))
    lost = [int(np.isinf(answer.distance[answer.active]).sum()) for answer in (robust, fast)]
    assert lost[0] == 0
    assert lost[1] > 0  # else these are not the rays to try

    # Elsewhere both are right: they differ by the rounding of a triangle's plane, at a size of a few metres.
    kept = fast.active & np.isfinite(fast.distance)
    np.testing.assert_allclose(fast.distance[kept], robust.distance[kept], atol=1e-5)
    assert lost[1] < 0.01 * fast.active.sum()


# Motion


@pytest.mark.parametrize("bounces", [1, 3])
def test_all_ways_to_follow_what_moves_show_the_same(bounces):
    made = busy_room()
    anew, bodies = (shaded(RayTraced(bounces, hierarchies=way), made, 0, 1, 2, 3) for way in WAYS)
    assert np.abs(anew[0].L - anew[3].L).max() > 0.3
    for one, other in zip(anew, bodies, strict=True):
        # A ray taken into a body's space is rounded once more; at an outline, one in thousands falls on the other side.
        same = np.abs(one.distance - other.distance) < 1e-4
        assert same.mean() > 0.9995
        assert (np.abs(one.L - other.L).max(axis=2) > 1e-4).mean() < 0.001
        counts = [np.array(a.reflection.counters["rays"], np.int64) for a in (one, other)]
        assert (counts[0] != counts[1]).mean() < 0.001
        assert bounces == 1 or counts[0].sum() > 1.05 * one.active.sum()
        doubts = [np.array(a.reflection.doubt)[np.array(a.frame.pixels)] for a in (one, other)]
        assert (doubts[0] != doubts[1]).mean() < 0.001 and doubts[0].any()


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("bounces", [1, 3])
def test_what_moved_is_shown_where_it_stands(way, bounces):
    made = busy_room()
    for index, answer in enumerate(shaded(RayTraced(bounces, hierarchies=way), made, 0, 1, 2, 3)):
        expected = shaded(RayTraced(bounces), frozen_at(made, made.time(index)), 0)[0]
        both = answer.active & expected.active
        assert (answer.active != expected.active).mean() < 0.001
        # Vertices of other roundings: what differs is at outlines, where a ray falls on the other side.
        assert (np.abs(answer.L - expected.L).max(axis=2)[both] > 1e-3).mean() < 0.002
        assert (np.abs(answer.distance - expected.distance)[both] > 1e-3).mean() < 0.002


@pytest.mark.parametrize("robust", [True, False])
@pytest.mark.parametrize("way", WAYS)
def test_a_scene_where_all_parts_move_is_seen_as_one_where_none_does(way, robust):
    made = busy_room()
    parts = [tuple(replace(p, motion=lambda time: np.eye(4)) for p in some) for some in (made.objects, made.reflectors)]
    moving = replace(made, objects=parts[0], reflectors=parts[1])
    answers = [shaded(RayTraced(robust=robust, hierarchies=way), m, 1)[0] for m in (moving, frozen_at(moving, 0.0))]
    assert (np.abs(answers[0].distance - answers[1].distance) > 1e-5).mean() < 0.0005


def test_parts_that_share_a_motion_are_one_body_and_those_without_come_first():
    a, b = swinging, rolling
    assert hierarchy.rigid([a, None, b, a, None]) == [[1, 4], [0, 3], [2]]
    assert hierarchy.rigid([a, a]) == [[0, 1]]
    assert hierarchy.rigid([None, None]) == [[0, 1]]


def test_following_what_moves_builds_nothing():
    made = busy_room()
    triangles = geometry.of_scene(made)
    before = hierarchy.of_scene(made, triangles, 0.0)
    after = hierarchy.moved(before, mi.Float(made.poses(0.1).astype(np.float32).ravel()))
    assert [tree.scene for tree in after.trees] == [tree.scene for tree in before.trees]
    assert len(before.trees) == 3
    # What was given still stands where it stood.
    assert np.array(before.poses)[:24] == pytest.approx(made.poses(0.0).ravel()[:24])


# Rays, one by one


def first(meshes: list[Mesh], o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """By brute force, float64: distance [R], number of the part [R] (-1 for none), and how far the answer is from being
    another: from an edge, a second triangle, or starting on one [R]."""
    best, part, margin = np.full(len(o), np.inf), np.full(len(o), -1), np.full(len(o), np.inf)
    for number, mesh in enumerate(meshes):
        for face in mesh.faces:
            a, b, c = (mesh.vertices[i] - o for i in face)
            volumes = np.stack([(d * np.cross(x, y)).sum(1) for x, y in ((b, c), (c, a), (a, b))], axis=1)
            with np.errstate(divide="ignore", invalid="ignore"):
                weights = volumes / volumes.sum(1, keepdims=True)
                n = np.cross(b - a, c - a)
                t = (a * n).sum(1) / (d * n).sum(1)
            ahead = np.isfinite(t) & (t > 0)
            # A ray that starts in the triangle's plane may or may not meet it.
            margin = np.minimum(margin, np.abs((a * n).sum(1)) / np.linalg.norm(n, axis=1))
            margin = np.where(ahead, np.minimum(margin, np.abs(weights).min(1)), margin)
            inside = ahead & (weights >= 0).all(1)
            margin = np.where(inside & np.isfinite(best), np.minimum(margin, np.abs(t - best)), margin)
            nearer = inside & (t < best)
            best, part = np.where(nearer, t, best), np.where(nearer, number, part)
    return best, part, margin


def met(made: Scene, time: float, way: Any, o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distance, part, and the point that the weights say, float64."""
    triangles = geometry.of_scene(made)
    trees = hierarchy.of_scene(made, triangles, 0.0, way)
    poses = mi.Float(made.poses(time).astype(np.float32).ravel())
    trees = hierarchy.moved(trees, poses)
    ray = mi.Ray3f(mi.Point3f(o.T.astype(np.float32)), mi.Vector3f(d.T.astype(np.float32)))
    hit = hierarchy.meet(trees, ray)
    world = np.array(geometry.posed(triangles.points, triangles.vertex_count, poses), np.float64).reshape(-1, 4)
    corners = world[np.array(hit.face).T[:, :3]][..., :3]
    point = (np.array(hit.weights, np.float64).T[..., None] * corners).sum(1)
    found = np.array(hit.found)
    return np.array(hit.t, np.float64), np.where(found, np.array(geometry.part_of(hit.face), int), -1), point


@pytest.mark.parametrize("way", WAYS)
def test_rays_meet_what_brute_force_finds_first(way):
    def black(mesh: Mesh) -> Mesh:
        return replace(mesh, radiance=np.zeros_like(mesh.vertices))

    made = scene(
        (
            Object("box", black(box((-3, -3, -3), (3, 3, 3), inside=True)), shows="the end of every ray"),
            Object("sheet", black(quad((-0.5, -0.5, 0), (1, 0, 0), (0, 1, 0))), shows="a flat body", motion=swinging),
            Object("ball", ball(0.4, (1.0, 0.4, 0.2), (0, 0, 0), 1), shows="a round one", motion=rolling),
            Object("cube", black(box((-1.5, -0.4, -0.4), (-0.9, 0.4, 0.4))), shows="with the ball", motion=rolling),
        ),
        (Reflector("mirror", box((0.2, -1.6, -0.5), (0.8, -1.1, 0.5))),),
    )
    rng = np.random.default_rng(1)
    axes = np.vstack([np.eye(3), -np.eye(3)])
    o = rng.uniform(-2, 2, (6000, 3)).astype(np.float32).astype(float)
    d = rng.normal(size=(6000, 3))
    d[:1500] = axes[rng.integers(0, 6, 1500)]  # two of three components are zero
    o[500:1500] = np.round(o[500:1500] * 2) / 2  # and some start in the plane of a box's side
    d = (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32).astype(float)
    for time in (0.0, 0.13, 0.4):
        t, part, margin = first([p.mesh.transformed(p.pose(time)) for p in made.parts], o, d)
        found, owner, point = met(made, time, way, o, d)
        clear = margin > 1e-4  # elsewhere the rounding of a float32, at 3 metres, may choose another triangle
        assert clear.mean() > 0.7
        assert len(set(part[clear])) == 5
        np.testing.assert_array_equal(owner[clear], part[clear])
        # 1e-6 of 6 metres, and some of the angle at which grazing rays meet a triangle
        np.testing.assert_allclose(found[clear], t[clear], atol=2e-4)
        np.testing.assert_allclose(point[clear], (o + t[:, None] * d)[clear], atol=2e-4)
        # Nor does anything slip through where the answer is not clear.
        assert np.isfinite(found).all()


def test_a_ray_in_the_plane_of_a_bodys_side_meets_its_border():
    """Its distance to that plane would be 0 / 0. A border belongs to its triangle: no gap beside a neighbour."""
    sheet = quad((1, -1, -1), (0, 2, 0), (0, 0, 2))
    sheet = replace(sheet, radiance=np.zeros_like(sheet.vertices))
    made = scene((Object("sheet", sheet, shows="a border", motion=lambda time: np.eye(4)),), (mirror_ball(center=(5, 0, 0)),))
    start = np.array([[0, y, z] for y in (-1.0, 1.0, 0.25) for z in (-1.0, 1.0, 0.5)])
    for forward in (1.0, -1.0):
        t, part, _ = met(
            made, 0.0, hierarchy.BODIES, start * [forward, 1, 1] + [1 - forward, 0, 0], np.tile([forward, 0, 0], (9, 1))
        )
        np.testing.assert_allclose(t, 1, atol=1e-6)
        assert (part == 0).all()
