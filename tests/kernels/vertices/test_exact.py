"""What a pixel's own ray meets of the triangles that its surroundings name, against every triangle in float64."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from oracles import ray_oracle
from support.answers import hollow
from support.mirror_room import ball, balls, mirror_ball, scene, shaded, smooth, still
from support.small_room import box, quad

from benchharness.kernels import raster
from benchharness.kernels.vertices import adjacency
from benchharness.scene import Mesh, Object, Reflector
from methods.image_space_search import ImageSpaceSearch
from methods.newton import Newton
from methods.secant_triangle import SecantTriangle

METHODS = {"newton": Newton, "secant_triangle": SecantTriangle, "image_space_search": ImageSpaceSearch}
every_method = pytest.mark.parametrize("name", METHODS)


def coarse_room(**more):
    """Walls of two triangles each, and three balls."""
    mesh = box((-2, -2, -2), (2, 2, 2), inside=True)
    room = Object("walls", replace(mesh, radiance=smooth(mesh.vertices)), "triangles whose images bend by many pixels")
    return scene((room, *balls()), (mirror_ball(),), **more)


def truth(made, answer):
    """What each mirror pixel's ray meets: [N] arrays in the order of `answer.L[answer.active]`."""
    frame, active = answer.frame, answer.active.ravel()
    p, n, v = (np.array(a, np.float64).T[active] for a in (frame.p, frame.n, frame.v))
    d = 2 * (v * n).sum(1, keepdims=True) * n - v
    return ray_oracle.reflected_hits(made, 0.0, p, d, 0)


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
    straight, answer = (shaded(METHODS[name](resolve=way), made, 0)[0] for way in ("interpolate", "ray"))
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


@every_method
def test_what_stands_in_the_open_ends_where_its_rays_say(name):
    """A card of two triangles before the sky: its straight image reaches where the sky is seen, and not where the card is."""
    card = Object("card", card_mesh((0.9, 0.1, 0.1)), "a silhouette")
    made = in_the_open((card,))
    straight, answer = (shaded(METHODS[name](resolve=way), made, 0)[0] for way in ("interpolate", "ray"))
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
    straight, answer = (shaded(Newton(resolve=way), made, 0)[0] for way in ("interpolate", "ray"))
    covered, met = (np.isfinite(a.distance) & a.active for a in (straight, answer))
    lost = covered & ~met
    assert lost.sum() > 20
    assert unmet(answer) == lost.sum()
    assert np.array(answer.reflection.doubt).reshape(lost.shape)[lost].all()


@every_method
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
