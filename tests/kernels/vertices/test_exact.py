"""What a pixel's own ray meets of the triangles that its surroundings name, against every triangle in float64."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from oracles import ray_oracle
from support.answers import hollow
from support.mirror_room import ball, balls, lit, mirror_ball, scene, shaded, smooth, still
from support.small_room import box, quad

from benchharness.kernels import raster
from benchharness.kernels.vertices import adjacency
from benchharness.scene import Gloss, Mesh, Object, PointLight, Reflector
from methods.image_space_search import ImageSpaceSearch
from methods.newton import Newton
from methods.ray_traced import RayTraced
from methods.secant_triangle import SecantTriangle

METHODS = {"newton": Newton, "secant_triangle": SecantTriangle, "image_space_search": ImageSpaceSearch}
every_method = pytest.mark.parametrize("name", METHODS)
most_exhaustively = pytest.mark.parametrize(
    "name", [name if name == "newton" else pytest.param(name, marks=pytest.mark.exhaustive) for name in METHODS]
)


def coarse_room(**more):
    """Walls of two triangles each, and three balls."""
    mesh = box((-2, -2, -2), (2, 2, 2), inside=True)
    room = Object("walls", replace(mesh, radiance=smooth(mesh.vertices)), "triangles whose images bend by many pixels")
    return scene((room, *balls()), (mirror_ball(),), **more)


def truth(made, answer, mirror: int = 0):
    """What the ray of each pixel of a mirror meets: [N] arrays in the order of `answer.L[seen(answer, mirror)]`."""
    frame, active = answer.frame, seen(answer, mirror).ravel()
    p, n, v = (np.array(a, np.float64).T[active] for a in (frame.p, frame.n, frame.v))
    d = 2 * (v * n).sum(1, keepdims=True) * n - v
    return ray_oracle.reflected_hits(made, frame.time, p, d, mirror)


def seen(answer, mirror: int = 0) -> np.ndarray:
    return np.array(answer.frame.reflector).reshape(answer.active.shape) == mirror


def unmet(answer) -> int:
    return int(np.array(answer.reflection.counters["unmet"]).sum())


# Which triangles lie beside which


def brute_neighbours(vertices: np.ndarray, faces: np.ndarray) -> list[set[int]]:
    """Per edge opposite to a corner, flat [3 F], all other faces with an edge at the same place."""

    def ends(f: int, k: int) -> frozenset:
        return frozenset(tuple(np.round(vertices[faces[f, (k + i) % 3]], 6)) for i in (1, 2))

    return [
        {g for g in range(len(faces)) if g != f and any(ends(g, j) == ends(f, k) for j in range(3))}
        for f in range(len(faces))
        for k in range(3)
    ]


@pytest.mark.parametrize("welded", [True, False])
def test_across_every_edge_lies_what_shares_it(welded):
    mesh = ball(0.5, (1, 2, 3), (1, 1, 1), 1)
    fin = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]])
    parts = [(mesh.vertices, mesh.faces), (fin, np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]]))]
    if not welded:
        parts = [(v[f].reshape(-1, 3), np.arange(f.size).reshape(-1, 3)) for v, f in parts]
    objects = [Object(str(i), Mesh(v, f, radiance=np.ones(3)), "a part") for i, (v, f) in enumerate(parts)]
    sheet = Reflector("sheet", quad((0, 9, 0), (1, 0, 0), (0, 0, 1)))
    beside = np.array(adjacency.neighbours(scene(objects, (sheet,)))).reshape(-1, 4)
    start = 0
    for v, f in [*parts, (sheet.mesh.vertices, sheet.mesh.faces)]:
        own = beside[start : start + len(f), :3].ravel().astype(np.int64)
        for found, others in zip(own, brute_neighbours(v, f), strict=True):
            assert (found == raster.NONE) if not others else (found - start in others)
        start += len(f)
    # All that hangs together is one piece.
    pieces = beside[:, 3]
    sizes = [len(mesh.faces), 3, 2]
    assert [len(np.unique(p)) for p in np.split(pieces, np.cumsum(sizes)[:-1])] == [1, 1, 1] and len(np.unique(pieces)) == 3
    # Around an edge of three faces one comes back to where one began.
    edge = {f: beside[len(mesh.faces) + f, 2] - len(mesh.faces) for f in range(3)}
    assert sorted(edge.values()) == [0, 1, 2] and edge[edge[edge[0]]] == 0


# Pixels


@every_method
def test_a_room_of_twelve_triangles_is_as_traced(name):
    made = coarse_room()
    ways = ({"split_px": 0}, {"resolve": "ray"})
    straight, answer = (shaded(METHODS[name](**way), made, 0)[0] for way in ways)
    which, distance, L, clear = truth(made, answer)
    assert clear.mean() > 0.97 and (which >= 0).all()
    off, before = (np.abs(a.L[a.active] - L).max(axis=1) > 1e-3 for a in (answer, straight))
    assert before[clear].mean() > 0.5
    assert not off[clear].any()
    np.testing.assert_allclose(answer.distance[answer.active][clear], distance[clear], rtol=1e-4, atol=1e-5)
    assert answer.found[answer.active].all() and unmet(answer) == 0


def test_a_flat_mirror_of_which_images_are_straight_is_as_traced_everywhere():
    sheet = Reflector("sheet", quad((-0.6, 0, -0.5), (1.2, 0, 0), (0, 0, 1.0)))
    made = replace(coarse_room(), reflectors=(sheet,))
    answer = shaded(Newton(resolve="ray"), made, 0)[0]
    _, distance, L, clear = truth(made, answer)
    assert answer.active.sum() > 2000
    np.testing.assert_allclose(answer.L[answer.active][clear], L[clear], atol=1e-4)
    np.testing.assert_allclose(answer.distance[answer.active][clear], distance[clear], rtol=1e-4)
    assert unmet(answer) == 0


def in_the_open(objects, **more):
    return scene(objects, (mirror_ball(),), background=(0.2, 0.4, 0.9), **more)


@most_exhaustively
def test_what_stands_in_the_open_ends_where_its_rays_say(name):
    """A card of two triangles before the sky: its straight image reaches where the sky is seen, and not where the card is."""
    card = Object("card", card_mesh((0.9, 0.1, 0.1)), "a silhouette")
    made = in_the_open((card,))
    straight, answer = (shaded(METHODS[name](resolve=way, split_px=0), made, 0)[0] for way in ("interpolate", "ray"))
    which, _, L, clear = truth(made, answer)
    red = which >= 0
    assert 300 < red.sum() < 0.5 * len(red)
    wrong, before = ((np.isfinite(a.distance[a.active]) != red) & clear for a in (answer, straight))
    assert before.sum() > 0.05 * red.sum()
    assert wrong.sum() <= 0.1 * before.sum()
    sky = clear & ~red & ~wrong
    np.testing.assert_allclose(answer.L[answer.active][sky], L[sky], atol=1e-5)


def card_mesh(colour) -> Mesh:
    corners = np.array([[1.1, -1.2, -0.5], [1.1, 0.4, -0.5], [1.1, 0.4, 0.9], [1.1, -1.2, 0.9]])
    return Mesh(corners, np.array([[0, 2, 1], [0, 3, 2]]), radiance=np.array(colour, float))


def test_a_pixel_whose_ray_meets_nothing_that_is_named_is_counted_and_doubted():
    """The same card: where the straight image covers the sky."""
    made = in_the_open((Object("card", card_mesh((1, 1, 1)), "a silhouette"),))
    straight, answer = (shaded(Newton(resolve=way, split_px=0), made, 0)[0] for way in ("interpolate", "ray"))
    covered, met = (np.isfinite(a.distance) & a.active for a in (straight, answer))
    lost = covered & ~met
    assert lost.sum() > 20
    assert unmet(answer) == lost.sum()
    assert np.array(answer.reflection.doubt).reshape(lost.shape)[lost].all()


@most_exhaustively
@pytest.mark.parametrize("bowl", ["concave", "torus"])
def test_several_reflections_are_exact_too(name, bowl):
    made = scene((coarse_room().objects[0],), (hollow(bowl),), still((0.2, -1.0, 0.5)))
    straight, answer = (shaded(METHODS[name](resolve=way, multi=4), made, 0)[0] for way in ("interpolate", "ray"))
    _, _, L, clear = truth(made, answer)
    # Where the mirror shows itself it is black, which this truth does not know.
    seen = clear & (answer.L[answer.active].max(axis=1) > 0) & (straight.L[straight.active].max(axis=1) > 0)
    off, before = (np.abs(a.L[a.active] - L).max(axis=1) > 1e-3 for a in (answer, straight))
    assert seen.sum() > 500
    assert off[seen].mean() < 0.2 * before[seen].mean()


def test_a_part_of_a_piece_that_hides_another_part_of_it_is_seen():
    """A strip that is bent to a U: one piece, of which the near wing hides half of the far one."""
    x = np.array([0.9, 0.9, 1.7, 1.7])
    y = np.array([-1.2, 0.0, 0.0, -1.2])
    corners = np.concatenate([np.stack([x, y, np.full(4, z)], 1) for z in (-0.2, 0.3)])
    corners[[2, 3, 6, 7], 2] *= 5
    faces = np.concatenate([[[i, i + 4, i + 5], [i, i + 5, i + 1]] for i in range(3)])
    colours = np.repeat([[0.9, 0.1, 0.1], [0.1, 0.1, 0.9]], 2, axis=0)
    strip = Object("strip", Mesh(corners, faces, radiance=np.concatenate([colours, colours])), "hides itself")
    made = in_the_open((strip,))
    straight, answer = (shaded(Newton(resolve=way, split_px=0), made, 0)[0] for way in ("interpolate", "ray"))
    which, _, L, clear = truth(made, answer)
    assert (which >= 4).sum() > 60 and np.isin(which, (0, 1)).sum() > 100
    wrong, before = ((np.abs(a.L[a.active] - L).max(axis=1) > 1e-2) & clear for a in (answer, straight))
    assert before.sum() > 100
    assert wrong.sum() <= 0.03 * before.sum()


def test_small_triangles_far_away_leave_no_cracks():
    """All that the eye sees in the mirror is a wall of triangles a two-hundredth as wide as they are far away: volumes of rays
    and edges cancel to the last digits."""
    far = Object("wall", lit(quad((-13, -30, -7), (0, 0, 16), (16, 0, 0)), 0.18, 15.0), "small triangles far away")
    near = still((0.2, -1.7, 0.25), (0, -0.49, 0.05), 3.0)
    made = scene((far,), (mirror_ball(fine=256),), near)
    answer = shaded(Newton(resolve="ray"), made, 0, size=(64, 48))[0]
    assert answer.found[answer.active].all() and unmet(answer) == 0
    p = np.array(answer.frame.p, np.float64).T[answer.active.ravel()]
    n, v = (np.array(a, np.float64).T[answer.active.ravel()] for a in (answer.frame.n, answer.frame.v))
    d = 2 * (v * n).sum(1, keepdims=True) * n - v
    distance = (-30 - p[:, 1]) / d[:, 1]
    assert len(far.mesh.faces) > 30_000 and answer.active.all()
    np.testing.assert_allclose(answer.distance[answer.active], distance, rtol=1e-5)


BALLS = (mirror_ball("left", (-0.3, -0.3, 0), 0.4, 32), mirror_ball("right", (0.3, 0.3, 0), 0.4, 32))


@most_exhaustively
def test_in_two_mirrors_each_is_black_in_the_other_and_doubted(name):
    made = replace(coarse_room(), reflectors=BALLS)
    answer = shaded(METHODS[name](resolve="ray"), made, 0)[0]
    first = sum(len(o.mesh.faces) for o in made.objects)
    doubt = np.array(answer.reflection.doubt).reshape(answer.active.shape)
    for mirror in range(2):
        which, distance, L, clear = truth(made, answer, mirror)
        other = which >= first
        assert other.sum() > 50
        here = seen(answer, mirror)
        off = (np.abs(answer.L[here] - L).max(axis=1) > 1e-3) & clear
        assert off.mean() < 0.005
        right = clear & ~off
        np.testing.assert_allclose(answer.distance[here][right], distance[right], rtol=1e-3, atol=1e-5)
        assert doubt[here][other & right].all() and doubt[here].mean() < 0.6
        assert answer.L[here][other & right].max() == 0


def test_other_mirrors_that_are_left_out_hide_nothing():
    made = replace(coarse_room(), reflectors=BALLS)
    answer = shaded(Newton(resolve="ray", other_mirrors="omitted"), made, 0)[0]
    for mirror in range(2):
        here = seen(answer, mirror)
        _, _, L, clear = truth(replace(made, reflectors=(BALLS[mirror],)), _only(answer, mirror))
        assert (np.abs(answer.L[here] - L).max(axis=1) > 1e-3)[clear].mean() < 0.005


def _only(answer, mirror: int):
    """An answer in which a mirror is the only one."""
    only = np.where(np.array(answer.frame.reflector) == mirror, 0, -1)
    return SimpleNamespace(frame=SimpleNamespace(**vars(answer.frame) | {"reflector": only}), active=answer.active)


def test_what_moves_is_asked_where_it_is():
    def motion(time: float) -> np.ndarray:
        pose = np.eye(4)
        pose[:3, 3] = (0.0, 6.0 * time, 0.0)
        return pose

    red, *others = balls()
    made = replace(coarse_room(), objects=(coarse_room().objects[0], replace(red, motion=motion), *others))
    first, second = shaded(Newton(resolve="ray"), made, 0, 2)
    for answer in (first, second):
        _, _, L, clear = truth(made, answer)
        assert (np.abs(answer.L[answer.active] - L).max(axis=1) > 1e-3)[clear].mean() < 0.002
    assert np.abs(first.L - second.L).max() > 0.3


def test_whoever_asks_for_no_doubt_sees_the_same_picture():
    asked, not_asked = (shaded(Newton(resolve="ray"), coarse_room(), 0, doubts=doubts)[0] for doubts in (True, False))
    assert not_asked.reflection.doubt is None
    assert asked.L.tobytes() == not_asked.L.tobytes() and asked.distance.tobytes() == not_asked.distance.tobytes()


@every_method
def test_a_frame_without_a_mirror_has_no_pixels_to_ask(name):
    answer = shaded(METHODS[name](resolve="ray"), coarse_room(camera=still((0.2, -1.7, 0.25), (0.2, -1.9, 0.25))), 0)[0]
    assert not answer.active.any() and unmet(answer) == 0


def glossy_room():
    room, *things = coarse_room().objects
    look = Gloss((0.4, 0.4, 0.4), 20.0)
    lit_by = [replace(o, mesh=replace(o.mesh, visibility=np.ones((len(o.mesh.vertices), 1))), gloss=look) for o in things]
    return replace(coarse_room(), objects=(room, *lit_by), lights=(PointLight((0.3, -1.0, 1.2), (6.0, 6.0, 6.0)),))


def test_highlights_are_those_that_the_reflection_point_sees():
    made, seen_by = glossy_room(), []
    for method in (Newton(resolve="ray"), RayTraced()):
        seen_by.append(shaded(method, made, 0)[0])
    ours, traced = seen_by
    here = ours.active
    assert traced.L[here].max() > 1.2 * 0.75  # more than the room's own light
    assert (np.abs(ours.L - traced.L)[here].max(axis=1) > 0.01).mean() < 0.01


def test_by_hand_what_a_ray_meets():
    """A card at x = 1.1 to 1.9 in steps: rays along x from the origin's height, and one that misses."""
    made = in_the_open((Object("card", card_mesh((0.5, 0.25, 0.125)), "a card"),))
    o, d = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2.0]]), np.array([[1.0, 0, 0], [1.0, 0, 0]])
    which, distance, L, clear = ray_oracle.reflected_hits(made, 0.0, o, d, 0)
    assert which.tolist() in ([0, -1], [1, -1]) and clear.all()
    np.testing.assert_allclose(distance, [1.1, np.inf])
    np.testing.assert_allclose(L, [[0.5, 0.25, 0.125], [0.2, 0.4, 0.9]])
