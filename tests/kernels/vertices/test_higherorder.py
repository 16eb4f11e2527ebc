"""Mirrors in mirrors of exact pixels, in float64: by way of two spheres, searched densely, and against every triangle."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import trimesh
from oracles.fresnel_oracle import fresnel_by_amplitudes
from oracles.second_oracle import chained, entered, second_point, shot
from support.answers import reflector_of
from support.depth_scenes import turned
from support.mirror_room import ball, mirror_ball, plain, scene, shaded, smooth, still
from support.small_room import box, quad

from benchharness.kernels.vertices import higherorder
from benchharness.scene import Mesh, Object, Reflector
from methods.angle_iteration import AngleIteration
from methods.explosion_map import ExplosionMap
from methods.image_space_search import ImageSpaceSearch
from methods.newton import Newton
from methods.secant_triangle import SecantTriangle

METHODS = {
    "newton": Newton,
    "image_space_search": ImageSpaceSearch,
    "secant_triangle": SecantTriangle,
    "angle_iteration": AngleIteration,
    "explosion_map": ExplosionMap,
}
REFLECTIVE: dict[str, Any] = {"resolve": "ray", "other_mirrors": "reflective"}
SILVER: dict[str, Any] = {"eta": (0.155, 0.117, 0.138), "k": (4.828, 3.122, 2.147)}


def room(radiance=smooth) -> Object:
    """Two triangles to a wall."""
    mesh = box((-2, -2, -2), (2, 2, 2), inside=True)
    return Object("walls", replace(mesh, radiance=radiance(mesh.vertices)), "something on every side")


def egg(name: str, **more) -> Reflector:
    """A mirror whose normals turn as it turns."""
    made = trimesh.creation.icosphere(subdivisions=2, radius=1.0)
    axes = np.array([0.45, 0.25, 0.3])
    n = made.vertices / axes
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    mesh = Mesh(made.vertices * axes, made.faces, normals=n)
    return Reflector(name, mesh, mesh, **more)


def truth(made, answer, step: int = 1):
    """Of every so many-th pixel whose ray meets a mirror: what is seen, whether that is doubted, and what `chained` says."""
    frame = answer.frame
    lanes = np.flatnonzero(answer.counted("second_order"))[::step]
    p, n, v = (np.array(a, np.float64).T[lanes] for a in (frame.p, frame.n, frame.v))
    d = 2 * (v * n).sum(1, keepdims=True) * n - v
    reflector, orders = np.array(frame.reflector)[lanes], higherorder.ORDERS
    L, met, clear = np.zeros((len(p), 3)), np.zeros(len(p), int), np.zeros(len(p), bool)
    for k in range(len(made.reflectors)):
        own = reflector == k
        L[own], met[own], clear[own] = chained(made, frame.time, p[own], d[own], k, orders)
    assert (met[clear] > 0).mean() > 0.99
    return answer.L.reshape(-1, 3)[lanes], np.array(answer.reflection.doubt)[lanes], L, met, clear


def test_oracles_by_hand():
    """Two spheres of radius 1 at x = +-2, alike on both sides of x = 0: from a on the right, whose normal is 60 degrees off the
    line between them, a ray goes straight to b on the left, and comes and goes at 120 degrees to it."""
    A, B = (np.array([2.0, 0, 0]), 1.0), (np.array([-2.0, 0, 0]), 1.0)
    half, high = 0.5, np.sqrt(0.75)
    a = np.array([2 - half, high, 0.0])
    out = np.array([half, high, 0.0])
    found, off = second_point(a + 3 * out, [-1, 1, 1] * (a + 2 * out), A, B)
    np.testing.assert_allclose(found, a, atol=1e-6)
    assert off < 1e-6

    # Two parallel sheets: straight between them and out, by way of one, two and three of them.
    sheets = [Reflector(str(z), quad((-1, -1, z), (4, 0, 0), (0, 2, 0)), **SILVER) for z in (0.0, 1.0)]
    lamp = Object("lamp", plain(quad((3.5, -1, -9), (0, 2, 0), (0, 0, 20)), (1, 2, 3)), "the end")
    made = scene((lamp,), sheets)
    d = np.array([[1.0, 0, 1.0]]) / np.sqrt(2)
    silver = [fresnel_by_amplitudes(np.sqrt(0.5), eta, k) for eta, k in zip(SILVER["eta"], SILVER["k"], strict=True)]
    for x, mirrors in ((2.4, 0), (1.4, 1), (0.4, 2), (-0.6, 3)):
        light, met, _ = chained(made, 0.0, np.array([[x, 0.1, 0.0]]), d, 0, 4)
        np.testing.assert_allclose(light[0], np.array(silver) ** mirrors * [1, 2, 3])
        assert met.tolist() == [mirrors]
    light, met, _ = chained(made, 0.0, np.array([[-0.6, 0.1, 0.0]]), d, 0, 3)
    assert not light.any() and met.tolist() == [3]


def test_two_balls_show_a_point_where_a_dense_search_finds_it():
    """The room's radiance is linear in the place, and tells it. Each pixel's place is searched for by way of both balls, and is
    seen in that pixel: balls of flat facets are off by less than a twentieth of a pixel."""
    places = ((-0.5, 0, 0), (0.5, 0.1, 0.1))
    mirrors = [mirror_ball(str(k), at, 0.4, 96) for k, at in enumerate(places)]
    made = scene((room(lambda p: 0.5 + 0.2 * p),), mirrors)
    answer = shaded(Newton(**REFLECTIVE), made, 0)[0]
    second = answer.counted("second_order") > 0
    sure = second & ~np.array(answer.reflection.doubt).reshape(second.shape)
    balls = [(np.array(at), 0.4) for at in places]
    which, p = reflector_of(answer), np.array(answer.frame.p, np.float64).T.reshape(*second.shape, 3)
    camera = made.camera(0.0)
    eye = np.asarray(camera.eye)
    compared = 0
    for row, column in np.argwhere(sure)[:: sure.sum() // 12]:
        V = (answer.L[row, column] - 0.5) / 0.2
        A, B = balls[which[row, column]], balls[1 - which[row, column]]
        d = p[[row], column] - eye
        a, b, after = shot(eye, d / np.linalg.norm(d), A, B)
        slant = min(-(d * (a - A[0])).sum() / np.linalg.norm(d), (after * (b - B[0])).sum())
        if slant < 0.15 * 0.4 or np.isfinite(entered(b, after, *A)).all():  # at an outline; by way of three
            continue
        found, off = second_point(eye, V, A, B)
        turn = np.linalg.norm(np.cross(found - eye, p[row, column] - eye)) / np.dot(found - eye, p[row, column] - eye)
        per_pixel = 2 * np.tan(np.radians(22.5)) / 120
        assert off < 1e-3 and turn < 0.05 * per_pixel, (row, column, off, turn / per_pixel)
        compared += 1
    assert compared >= 6 and sure.sum() > 0.9 * second.sum()


def spinning(time: float) -> np.ndarray:
    """By 70 degrees and 5 cm from frame to frame."""
    return turned(25.0 * 70 * time, (0.4, 0.1 + 25 * 0.05 * time, 0.05))


def crowded(**more):
    """Three mirrors near each other, one an egg of metal that turns and shifts, in a room of twelve triangles with a ball."""
    thing = Object("red", ball(0.15, (0.1, -0.7, 0.45), (0.9, 0.1, 0.1), 2), "something near")
    mirrors = (
        mirror_ball("left", (-0.5, 0, -0.1), 0.35, 24),
        egg("egg", **SILVER, motion=spinning),
        mirror_ball("low", (-0.1, -0.35, -0.45), 0.25, 24, **SILVER),
    )
    return scene((room(), thing), mirrors, still((0.2, -1.8, 0.25)), **more)


def test_mirrors_show_mirrors_as_every_triangle_says_also_when_they_move():
    made = crowded()
    for answer in shaded(Newton(**REFLECTIVE), made, 0, 1, size=(112, 84)):
        seen, doubt, L, met, clear = truth(made, answer, 2)
        assert clear.sum() > 120 and (met > 1).sum() > 8
        off = np.abs(seen - L).max(axis=1) > 2e-3
        assert off[clear].mean() < 0.01
        assert doubt[clear & (met < higherorder.ORDERS)].mean() < 0.3


def test_the_last_mirror_is_black_and_doubted():
    """Two sheets face each other, a little askew: rays that need more mirrors than they are followed over."""
    sheets = [
        Reflector("front", quad((-0.9, 0.5, -0.6), (1.8, 0, 0), (0, 0.03, 1.2))),
        Reflector("back", quad((0.9, -1.1, -0.6), (-1.8, 0, 0), (0, 0.02, 1.2))),
    ]
    made = scene((room(),), sheets, still((0.0, -1.0, 0.1), (0.02, 0.5, 0.12), 70.0))
    answer = shaded(Newton(**REFLECTIVE), made, 0, size=(112, 84))[0]
    seen, doubt, L, met, clear = truth(made, answer)
    last = clear & (met == higherorder.ORDERS)
    assert last.sum() > 50 and (clear & ~last).sum() > 300
    assert not seen[last].any() and doubt[last].all()
    np.testing.assert_allclose(seen[clear & ~last], L[clear & ~last], atol=2e-3)


def test_in_the_open_rays_from_the_second_mirror_end_at_what_is_infinitely_far():
    floor = Object("floor", plain(quad((-2, -2, -0.6), (4, 0, 0), (0, 4, 0)), (0.9, 0.1, 0.1)), "something near")
    mirrors = (mirror_ball("left", (-0.42, 0, 0), 0.4, 24), mirror_ball("right", (0.42, 0, 0), 0.4, 24, **SILVER))
    made = scene((floor,), mirrors, still((0.2, -2.2, 0.9), fov_deg=24.0), background=(0.2, 0.4, 0.9))
    answer = shaded(Newton(**REFLECTIVE), made, 0)[0]
    seen, doubt, L, _, clear = truth(made, answer)
    off, red = np.abs(seen - L).max(axis=1) > 2e-3, clear & (L[:, 0] > L[:, 2])
    assert clear.sum() > 200 and red.sum() > 40 and (clear & ~red).sum() > 40 and off[clear].mean() < 0.01
    assert answer.found[answer.active].all()
    assert (off & clear & ~doubt).mean() < 0.005 and doubt[clear].mean() < 0.25


def test_what_the_second_mirror_does_not_see_from_its_middle_is_found_or_doubted():
    """A strip behind a card, of which the right mirror's middle sees nothing; rays from its left side pass beside the card."""
    card = Object("card", plain(quad((0.2, -1.0, -0.6), (0.5, 0, 0), (0, 0, 1.2)), (0.1, 0.9, 0.1)), "hides")
    strip = Object("strip", plain(quad((0.03, -1.85, -0.5), (0.24, 0, 0), (0, 0, 1.0)), (0.9, 0.1, 0.1)), "hidden")
    mirrors = (mirror_ball("left", (-0.42, 0, 0), 0.4, 24), mirror_ball("right", (0.42, 0, 0), 0.4, 24))
    made = scene((room(), card, strip), mirrors, still((-0.6, -1.7, 0.6), (-0.1, 0, 0), 24.0))
    answer = shaded(Newton(**REFLECTIVE), made, 0)[0]
    seen, doubt, L, _, clear = truth(made, answer)
    off, red = np.abs(seen - L).max(axis=1) > 2e-3, clear & (L[:, 0] > 0.85) & (L[:, 1] < 0.15)
    assert red.sum() > 12 and (red & off).sum() > 5 and doubt[red & off].all()
    assert (clear & off & ~doubt).mean() < 0.02 and doubt[clear].mean() < 0.25


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", [name for name in METHODS if name != "newton"])
def test_every_method_goes_on_alike(name):
    """Where the methods show the same of the first mirror, they show the same of the second: to the bit."""
    made = crowded()
    ours, theirs = (shaded(kind(**REFLECTIVE), made, 0, size=(112, 84))[0] for kind in (Newton, METHODS[name]))
    both = (ours.counted("second_order") > 0) & (theirs.counted("second_order") > 0) & (ours.distance == theirs.distance)
    assert both.sum() > 200
    assert (ours.L[both] == theirs.L[both]).all(axis=1).mean() > 0.99


def test_a_mirror_alone_shows_what_it_shows():
    made = scene((room(),), (mirror_ball(fine=32),))
    ways = (Newton(resolve="ray"), Newton(**REFLECTIVE))
    black, reflective = (shaded(way, made, 0, size=(64, 48))[0] for way in ways)
    assert black.same(reflective)


def test_only_pixels_that_are_resolved_by_rays_can_go_on():
    for name, kind in METHODS.items():
        with pytest.raises(ValueError, match=rf'{name}: other_mirrors "reflective" .*; accepted: .* resolve "ray"'):
            kind(other_mirrors="reflective")
