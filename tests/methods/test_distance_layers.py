"""Layers of distance impostors: what near things hide from the map's centre, which one layer cannot show."""

from __future__ import annotations

from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from oracles import impostor_oracle as oracle
from scipy.ndimage import binary_erosion
from support.cube_texels import directions, vectors
from support.mirror_room import Answer, ball, balls, mirror_ball, mirror_room, plain, scene, shaded, still, walls
from support.proxy_rooms import RED, Truth, reddish
from support.small_room import quad

from benchharness.kernels import cubemap
from benchharness.kernels.images import distancemap, layered
from benchharness.render.frame import FrameRenderer
from benchharness.scene import Object, Reflector
from methods.distance_impostor import DistanceImpostor
from methods.ray_traced import RayTraced

OCCUPIED = oracle.Room(np.array([-3.0, -2, -1.5]), np.array([2.0, 3, 1.5]), np.array([1.3, 0.2, 0.1]), 0.35)


def layers_of(room: oracle.Room, n: int, count: int) -> layered.Layers:
    """The room's layers, their texels from the closed form."""
    maps, nearness = [], []
    for inverse in (1 / room.surfaces(directions(n))).T[:count]:
        texels = np.zeros((len(inverse), 4))
        texels[:, 3] = inverse
        on_device = mi.Float(texels.ravel().astype(np.float32))
        maps.append(cubemap.pyramid([on_device], n))
        nearness.append(distancemap.of_map(on_device, n).nearness)
    return layered.together(maps, nearness, n)


def marched(layers: layered.Layers, x: np.ndarray, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lengths of rays, and whether there is reason to doubt them."""
    of, every = distancemap.ray(vectors(x), vectors(r)), dr.full(mi.Bool, True, len(x))
    met = layered.march(layers, of, 64, 6, every)
    return np.array(distancemap.length(of, met.spot), np.float64), np.array(met.lost | met.beside)


# The kernel


def hidden_on_ball(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of the ball's far side, and starts that see them from beside the ball."""
    way = OCCUPIED.ball / np.linalg.norm(OCCUPIED.ball)
    n, w = (v / oracle.length(v)[:, None] for v in rng.normal(size=(2, 40 * count, 3)))
    q = OCCUPIED.ball + OCCUPIED.radius * n
    x = q + rng.uniform(0.3, 1.5, (len(q), 1)) * w
    within = ((x > OCCUPIED.low + 0.01) & (x < OCCUPIED.high - 0.01)).all(axis=1)
    beside = (x @ way) / oracle.length(x) < np.sqrt(1 - (OCCUPIED.radius / np.linalg.norm(OCCUPIED.ball)) ** 2) - 0.01
    kept = np.flatnonzero((n @ way > 0.3) & ((n * w).sum(axis=1) > 0.2) & within & beside)[:count]
    return x[kept], q[kept]


def hidden_on_walls(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of the walls behind the ball, and starts that see them."""
    empty = replace(OCCUPIED, radius=0.0)
    d = OCCUPIED.ball + 0.9 * OCCUPIED.radius * rng.uniform(-0.55, 0.55, (8 * count, 3))
    q = d * (empty.seen(d) / oracle.length(d))[:, None]
    x = rng.uniform(-0.9, 0.9, d.shape)
    w = q - x
    clear = np.abs(OCCUPIED.first_hit(x, w / oracle.length(w)[:, None]) / oracle.length(w) - 1) < 1e-9
    kept = np.flatnonzero(clear & (oracle.length(q) > OCCUPIED.seen(q) * 1.01))[:count]
    return x[kept], q[kept]


@pytest.fixture(scope="module")
def asked():
    """Rays to what the middle does not see, the ball's far side and walls behind it, and of a mirror ball: starts, directions,
    lengths, and of which of the three kinds they are."""
    rng = np.random.default_rng(3)
    x, q = (np.concatenate(pair) for pair in zip(hidden_on_ball(rng, 200), hidden_on_walls(rng, 200), strict=True))
    r = (q - x) / oracle.length(q - x)[:, None]
    kind = np.repeat([0, 1], 200)
    other = oracle.rays(rng, 2000, 0.5, OCCUPIED)
    p = other[0] + OCCUPIED.first_hit(*other)[:, None] * other[1]
    seen = np.abs(oracle.length(p) / OCCUPIED.seen(p) - 1) < 1e-6
    x, r = (np.concatenate([one, two[seen]]) for one, two in zip((x, r), other, strict=True))
    kind = np.concatenate([kind, np.full(seen.sum(), 2)])
    true = OCCUPIED.first_hit(x, r)
    assert (
        len(kind) > 2200
        and (oracle.length(x + true[:, None] * r) > 1.01 * OCCUPIED.seen(x + true[:, None] * r))[kind < 2].all()
    )
    return x, r, true, kind


def test_surfaces_behind_one_another_are_those_of_a_case_by_hand():
    room = replace(OCCUPIED, ball=np.array([1.0, 0, 0]), radius=0.4)
    np.testing.assert_allclose(room.surfaces(np.array([[2.0, 0, 0], [0, 1, 0]])), [[0.6, 1.4, 2.0], [3, np.inf, np.inf]])


def test_one_layer_shows_nothing_of_what_the_middle_does_not_see_and_three_show_it_right(asked):
    """A closed ball is two layers, and what is behind it the third."""
    x, r, true, kind = asked
    right, unsure = {}, {}
    for count in (1, 2, 3):
        found, unsure[count] = marched(layers_of(OCCUPIED, 128, count), x, r)
        right[count] = [(np.abs(found / true - 1) < 0.02)[kind == k].mean() for k in range(3)]
    assert max(right[1][:2]) < 0.1
    assert right[2][0] > 0.95 and right[2][1] < 0.1 and unsure[2][kind == 1].mean() > 0.98
    assert min(right[3][:2]) > 0.98 and right[3][2] > 0.995 and unsure[3][kind == 2].mean() < 0.003
    of, every = distancemap.ray(vectors(x), vectors(r)), dr.full(mi.Bool, True, len(x))
    skinned = replace(layers_of(OCCUPIED, 128, 1).distances, stepped=False)
    single = np.array(distancemap.length(of, distancemap.march(skinned, of, 64, 6, every).spot), np.float64)
    assert (np.abs(single / true - 1) < 0.02)[kind < 2].mean() < 0.1


def test_where_a_search_closes_in_layers_are_as_exact_as_one(asked):
    """Of all rays but those that end at texels of an outline."""
    x, r, true, kind = asked
    found, _ = marched(layers_of(OCCUPIED, 128, 3), x, r)
    off = np.abs(found / true - 1)
    assert all(np.quantile(off[kind == k], 0.9) < 3e-3 for k in range(3))


def test_layers_of_a_scene_are_what_lies_behind_one_another():
    """A ball of facets in a room: its front, its back, the walls, and nothing; of every texel but at the ball's outline."""
    at, radius = np.array([0.9, 0.2, 0.1]), 0.4
    thing = Object("ball", ball(radius, at, RED, 5), "something to look behind")
    made = scene((walls(), thing), (mirror_ball(radius=0.2),))
    (answer,) = shaded(DistanceImpostor(layers=4, resolution=64), made, 0, size=(32, 24))
    (layers,) = answer.state.layers
    room = oracle.Room(np.full(3, -2.0), np.full(3, 2.0), at, radius)
    told = 1 / room.surfaces(directions(64))
    nearness = np.array(layers.distances.nearness, np.float64).reshape(4, -1)
    length = np.linalg.norm(directions(64), axis=1)
    inner = np.isfinite(room.surfaces(directions(64))[:, 2])
    sine = np.linalg.norm(np.cross(directions(64) / length[:, None], at), axis=1)
    clear = np.abs(sine / radius - 1) > 0.05
    assert (inner & clear).sum() > 300
    for k in range(3):
        np.testing.assert_allclose(nearness[k][clear] / length[clear], told[clear, k], rtol=5e-3, atol=1e-6)
    assert (nearness[3] == 0).all()


# Pictures


def behind_a_card():
    """A red ball that a card hides from the mirror's middle, and not from the part of the mirror that the eye looks at."""
    card = quad((0.7, -0.12, -0.12), (0, 0.24, 0), (0, 0, 0.24))
    things = (
        Object("card", plain(card, (0.1, 0.8, 0.1)), "what is in the way"),
        Object("red", ball(0.25, (1.6, 0.0, 0.0), RED, 4), "what is behind it"),
    )
    return scene((walls(), *things), (mirror_ball(),), still((0.2, -1.7, 0.25), (0.3, -0.4, 0.0), 15.0))


def test_what_a_card_hides_from_the_middle_is_there_with_layers_alone():
    """The card's half is 0.17 of its distance, the ball's radius 0.16: from the middle the card hides all of it."""
    truth = Truth(behind_a_card())
    red = reddish(truth.answer)
    inner = np.asarray(binary_erosion(red), bool)
    assert inner.sum() > 60
    shares = {n: reddish(truth.of(DistanceImpostor(layers=n)))[inner].mean() for n in (1, 2, 4)}
    assert shares[1] < 0.1 and shares[4] > 0.85
    # The card is one layer, the ball's front the second; its back, which the ray does not meet, the third.
    assert shares[2] > 0.85
    assert truth.error(DistanceImpostor(layers=4)) < 0.5 * truth.error(DistanceImpostor())


def hidden_by_balls(found: Answer) -> np.ndarray:
    """Pixels whose true ray ends where one of the balls hides it from the mirror's middle, bool [H, W]."""
    p, n, v = (
        np.array(a).T.reshape(*found.active.shape, 3).astype(float) for a in (found.frame.p, found.frame.n, found.frame.v)
    )
    end = p + found.distance[..., None] * (2 * (n * v).sum(axis=2, keepdims=True) * n - v)
    away = np.linalg.norm(end, axis=2)
    hidden = np.zeros(away.shape, bool)
    for thing in balls():
        at = 0.5 * (thing.mesh.vertices.min(axis=0) + thing.mesh.vertices.max(axis=0))
        along = end @ at / np.maximum(away, 1e-9)
        chord = 0.15**2 - (at @ at - along**2)
        hidden |= (chord > 0) & (along > 0) & (along - np.sqrt(np.maximum(chord, 0)) < away - 0.02)
    return hidden & found.active


def test_among_balls_layers_show_what_they_hide_and_doubt_the_rest():
    """Two in a hundred pixels show what balls hide from the middle. One layer has none; what several miss is at outlines."""
    truth = Truth(mirror_room())
    hidden = hidden_by_balls(truth.answer)
    assert hidden.sum() > 50

    def off(found: Answer) -> np.ndarray:
        return found.active & (np.abs(found.distance / np.where(found.active, truth.answer.distance, 1) - 1) > 0.05)

    one, three = truth.of(DistanceImpostor()), truth.of(DistanceImpostor(layers=3))
    assert off(one)[hidden].mean() > 0.9 and off(three)[hidden].mean() < 0.2
    doubt = np.array(three.reflection.doubt).reshape(three.active.shape)
    assert doubt[off(three)].mean() > 0.6 and doubt[three.active].mean() < 0.03
    # The rest is what coarser levels of the pyramid blur.
    assert truth.judged(DistanceImpostor(layers=3))[0] < 0.6 * truth.judged(DistanceImpostor())[0]
    assert truth.judged(DistanceImpostor(layers=3, mip=False))[0] < 0.3 * truth.judged(DistanceImpostor(mip=False))[0]


def test_in_the_open_what_no_layer_has_is_the_sky():
    sky = scene(balls(), (mirror_ball(),), background=(0.1, 0.2, 0.4))
    renderer = FrameRenderer(sky, 120, 90)
    found, true = (shaded(m, sky, 0, renderer=renderer)[0] for m in (DistanceImpostor(layers=4), RayTraced()))
    wrong = found.active & (np.isinf(found.distance) != np.isinf(true.distance))
    assert wrong.sum() < 0.03 * found.active.sum() and found.found[found.active].all()


def test_a_flat_mirror_in_its_wall_still_shows_the_room():
    """Starts lie behind the first layer there, which they touch."""
    sheet = Reflector("sheet", quad((-0.5, 1.9, -0.5), (1.0, 0, 0), (0, 0, 1.0)))
    truth = Truth(scene((walls(), *balls()), (sheet,), still((0.3, -1.5, 0.2), (0, 1.9, 0))))
    assert truth.error(DistanceImpostor(layers=3)) < 1.3 * truth.error(DistanceImpostor())


def test_layers_are_no_option_of_an_iteration():
    with pytest.raises(ValueError, match="layers is 2; accepted: 1, or search = 'march'"):
        DistanceImpostor(search="iterate", layers=2)
