"""The G-buffer against a float64 oracle: one ray through each pixel centre, every triangle of the scene tried."""

from __future__ import annotations

import dataclasses

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from oracles.fresnel_oracle import fresnel_by_amplitudes
from oracles.ray_oracle import first_hits
from support.mirror_room import ball, lit, scene, smooth, still
from support.small_room import box, quad, sphere

from benchharness.render.frame import FrameRenderer
from benchharness.scene import Mesh, Object, Reflector, merged

WIDTH, HEIGHT = 80, 60
BELOW = (0.0, -0.9, -1.1)
GOLD_ETA, GOLD_K = (0.2, 0.92, 1.1), (3.9, 2.45, 2.1)


def turning(time: float) -> np.ndarray:
    """A quarter turn about z per second, and a shift."""
    c, s = np.cos(0.5 * np.pi * time), np.sin(0.5 * np.pi * time)
    return np.array([[c, -s, 0, 0.3 * time], [s, c, 0, -0.2 * time], [0, 0, 1, 0.1 * time], [0, 0, 0, 1]])


def still_life(**more):
    """A room, a coloured box that turns, a mirror ball that turns off its axis, a sheet of mirror seen from behind."""
    block = box((-0.9, -0.9, -0.3), (-0.4, -0.5, 0.2))
    return scene(
        objects=(
            Object("room", lit(box((-2, -2, -2), (2, 2, 2), inside=True), 1.5), shows="something everywhere"),
            Object("block", dataclasses.replace(block, radiance=smooth(7 * block.vertices)), shows="a turn", motion=turning),
        ),
        reflectors=(
            Reflector("ball", sphere(0.4, (0.35, 0.1, 0.0), slices=16, stacks=10), eta=GOLD_ETA, k=GOLD_K, motion=turning),
            Reflector("sheet", quad((-0.5, 0.4, 0.3), (0.1, 0.2, 0.6), (0.8, 0.1, 0.0))),
        ),
        camera=still((0.1, -1.9, 0.2), (0.0, 0.0, 0.1), 50.0),
        fps=2.0,
        **more,
    )


@pytest.fixture(scope="module")
def renderer():
    return FrameRenderer(still_life(), WIDTH, HEIGHT)


@pytest.mark.parametrize("index", [0, 2])
def test_every_pixel_is_the_first_hit_of_the_ray_through_its_centre(renderer, index):
    made = renderer.scene
    frame = renderer.render(index)
    part, p, n, radiance, clear = first_hits(made, made.time(index), WIDTH, HEIGHT)
    reflector = np.where(part >= 2, part - 2, -1)
    got = np.array(frame.reflector)
    assert clear.mean() > 0.97
    assert all((reflector == number).sum() > 50 for number in (-1, 0, 1))
    np.testing.assert_array_equal(got[clear], reflector[clear])
    np.testing.assert_array_equal(np.array(frame.active), got >= 0)
    np.testing.assert_array_equal(np.array(frame.pixels), np.flatnonzero(got >= 0))

    mirror, lit_ = clear & (reflector >= 0), clear & (reflector < 0)
    # float32: positions of size 2 and normals are good to some 1e-7 times the slope at which a ray meets them.
    np.testing.assert_allclose(np.array(frame.p).T[mirror], p[mirror], atol=2e-5)
    # A normal turned to the eye may be either of the two where it is at right angles to the ray.
    eye = np.asarray(made.camera(made.time(index)).eye)
    slant = np.abs(((eye - p) * n).sum(1))
    np.testing.assert_allclose(np.array(frame.n).T[mirror & (slant > 1e-3)], n[mirror & (slant > 1e-3)], atol=2e-4)
    v = (eye - p) / np.linalg.norm(eye - p, axis=1, keepdims=True)
    np.testing.assert_allclose(np.array(frame.v).T[mirror], v[mirror], atol=2e-5)
    np.testing.assert_allclose(np.array(frame.radiance).T[lit_], radiance[lit_], atol=2e-5)
    assert (np.array(frame.radiance).T[mirror] == 0).all()


def test_radiance_and_mirror_move_with_their_parts_and_back():
    renderer = FrameRenderer(still_life(), WIDTH, HEIGHT)
    first, later, again = (renderer.render(index) for index in (0, 2, 0))
    assert (np.array(first.radiance) != np.array(later.radiance)).any()
    assert (np.array(first.reflector) != np.array(later.reflector)).any()
    for name in ("reflector", "p", "n", "radiance", "poses", "pixels"):
        np.testing.assert_array_equal(np.array(getattr(first, name)), np.array(getattr(again, name)))
    assert first.boxes == again.boxes != later.boxes
    np.testing.assert_allclose(np.array(later.poses).reshape(-1, 3, 4)[1], turning(1.0)[:3], atol=1e-6)


def hemisphere():
    """The upper half of a sphere, and all of it."""
    whole = sphere(0.4, (0.0, 0.0, 0.0), slices=24, stacks=12)
    upper = whole.faces[(whole.vertices[whole.faces][..., 2] >= -1e-9).all(axis=1)]
    used, faces = np.unique(upper, return_inverse=True)
    return Mesh(whole.vertices[used], faces.reshape(-1, 3), whole.normals[used]), whole


@pytest.mark.parametrize("target", [(0.0, 0.0, 0.0), (0.7, 0.0, 0.4), (0.0, -4.0, 0.0)])
def test_no_pixel_outside_a_box_shows_the_proxy(target):
    mesh, closed = hemisphere()
    camera = still(BELOW, target, 60.0)
    made = scene((), (Reflector("dome", mesh, closed=closed, motion=turning),), camera, fps=1.0)
    frame = FrameRenderer(made, WIDTH, HEIGHT).render(1)
    left, top, right, bottom = frame.boxes[0]
    # A picture four times as wide and high around the same axis, whose inner part is the picture.
    whole = dataclasses.replace(made, reflectors=(Reflector("dome", closed, motion=turning),))
    wide = 4.0
    fov = 2 * np.degrees(np.arctan(wide * np.tan(np.radians(30.0))))
    whole = dataclasses.replace(whole, camera=still(BELOW, target, fov), reflectors=whole.reflectors)
    size = int(wide * WIDTH), int(wide * HEIGHT)
    rows, columns = np.nonzero(np.array(FrameRenderer(whole, *size).render(1).active).reshape(size[1], size[0]))
    columns, rows = columns - (wide - 1) / 2 * WIDTH, rows - (wide - 1) / 2 * HEIGHT
    if target[1] > -1:
        assert len(columns) > 500
    assert ((columns + 0.5 >= left) & (columns + 0.5 <= right) & (rows + 0.5 >= top) & (rows + 0.5 <= bottom)).all()
    if target == (0.0, 0.0, 0.0):  # and it is no larger than it needs to be
        assert columns.min() - left < 2 and right - columns.max() < 3 and rows.min() - top < 2 and bottom - rows.max() < 3


def test_a_scene_that_is_not_baked_is_refused():
    dark = Object("dark thing", ball(0.1, (0, 0, 0), (1, 1, 1)), shows="nothing")
    dark = dataclasses.replace(dark, mesh=dataclasses.replace(dark.mesh, radiance=None))
    with pytest.raises(ValueError, match=r"scene mirror_room: object dark thing has no baked radiance; bake the scene first"):
        FrameRenderer(scene((dark,), ()), 8, 8)


def test_where_nothing_is_there_is_the_background():
    made = scene((Object("ball", ball(0.2, (0, 0, 0), (0.9, 0.1, 0.2)), shows="a spot"),), (), background=(0.1, 0.2, 0.4))
    radiance = np.array(FrameRenderer(made, WIDTH, HEIGHT).render(0).radiance).T.reshape(HEIGHT, WIDTH, 3)
    np.testing.assert_allclose(radiance[HEIGHT // 2, WIDTH // 2 - 5], (0.9, 0.1, 0.2), atol=1e-6)
    np.testing.assert_allclose(radiance[0, 0], (0.1, 0.2, 0.4), atol=1e-7)


def test_the_composite_is_what_is_seen_and_fresnel_times_what_mirrors_show(renderer):
    frame = renderer.render(0)
    count = WIDTH * HEIGHT
    L = np.random.default_rng(0).uniform(0, 2, (count, 3)).astype(np.float32)
    image = np.array(renderer.compose(frame, mi.Color3f(L.T))).T
    reflector = np.array(frame.reflector)
    cos_theta = np.abs((np.array(frame.n, float).T * np.array(frame.v, float).T).sum(1))
    F = fresnel_by_amplitudes(np.clip(cos_theta, 0, 1)[:, None], np.array(GOLD_ETA), np.array(GOLD_K))
    expected = np.where(reflector[:, None] == 0, F * L, np.where(reflector[:, None] == 1, L, np.array(frame.radiance).T))
    assert all((reflector == number).sum() > 50 for number in (-1, 0, 1))
    np.testing.assert_allclose(image, expected, atol=4e-5)


def test_what_a_method_left_as_nan_outside_mirrors_is_not_seen(renderer):
    frame = renderer.render(0)
    L = dr.select(frame.active, mi.Float(0.5), dr.nan)
    assert np.isfinite(np.array(renderer.compose(frame, mi.Color3f(L)))).all()


def test_faces_turned_away_are_left_out_only_where_a_piece_is_closed():
    # Seen from inside, a closed ball is not there, and a sheet is.
    closed, sheet = (
        ball(0.5, (0, 0, 0), (1, 0, 0), 2),
        quad((-2, 0.8, -2), (0, 0, 4), (4, 0, 0), radiance=np.array([0, 1.0, 0])),
    )
    both = scene((Object("both", merged(closed, sheet), shows="two pieces of one mesh"),), (), still((0, 0, 0), (0, 1, 0)))
    radiance = np.array(FrameRenderer(both, 16, 16).render(0).radiance).T
    np.testing.assert_allclose(radiance, np.tile([0, 1, 0], (256, 1)), atol=1e-6)


def test_many_sizes_are_drawn_without_a_word(capfd):
    # Every size of picture is recorded anew; Dr.Jit calls that a problem from the eleventh on, by default.
    made = scene((Object("ball", ball(0.2, (0, 0, 0), (1, 0, 0), 1), shows="a spot"),), ())
    for size in range(5, 17):
        FrameRenderer(made, size, 7).render(0)
    captured = capfd.readouterr()
    assert "frozen" not in captured.out + captured.err
