"""What every method owes the harness, and what ray tracing and environment maps are right and wrong about."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import binary_erosion
from support.answers import hollow, picture, reflector_of
from support.mirror_room import EYE, SIZE, Answer, balls, error, mirror_ball, mirror_for, scene, shaded, still, walls

from benchharness.kernels.vertices import starmap
from benchharness.render.frame import FrameRenderer
from benchharness.scene import Camera, Reflector
from benchharness.study import plugins
from methods.environment_map import EnvironmentMap
from methods.ray_traced import RayTraced
from methods.secant_triangle import SecantTriangle
from scenes.stress.curved_highlight import bulging

METHODS = {name: plugin.target for name, plugin in plugins.discover("method").items() if plugin.error is None}
OWN = (
    "angle_iteration",
    "environment_map",
    "image_space_search",
    "newton",
    "ray_traced",
    "secant_triangle",
    "specular_polynomial",
)
BY_VERTEX = ("angle_iteration", "image_space_search", "newton", "secant_triangle", "specular_polynomial")
NEAR_BALL = (-0.45, 0.0, 0.0)


# The contract


def test_all_methods_of_the_package_are_found_and_load():
    found = plugins.discover("method")
    assert set(OWN) <= set(found)
    assert [p.error for p in found.values() if p.error] == []


@pytest.mark.parametrize("name", METHODS)
def test_answers_are_sound_and_the_same_whoever_asks_and_whatever_ran_before(name, room, renderer):
    method = METHODS[name]()
    before = dict(vars(method))
    mirror = mirror_for(method)
    if len(mirror.mesh.faces) < len(room.reflectors[0].mesh.faces):
        room = replace(room, reflectors=(mirror,))
        renderer = FrameRenderer(room, *SIZE)
    first, later = shaded(method, room, 0, 1, renderer=renderer)
    for answer in (first, later):
        mirror = answer.active
        assert np.isfinite(answer.L[mirror]).all() and (answer.L[mirror] >= 0).all()
        assert answer.found[mirror].mean() > 0.999  # the outline's last pixel may be left open, and then says so
        assert (answer.distance[mirror & answer.found] > 0).all()
        if answer.reflection.vertices is not None:
            assert not answer.reflection.vertices.further
            for field, value in vars(answer.reflection.vertices).items():
                if field == "further":
                    continue
                assert np.isfinite(np.array(value)).all(), field
                assert np.array(value).shape[-1] == len(room.reflectors) * room.vertices, field
    assert not first.same(later)

    other = METHODS["ray_traced" if name != "ray_traced" else "environment_map"]()
    shaded(other, room, 1, 0, renderer=renderer)
    again = shaded(METHODS[name](), room, 0, 1, renderer=renderer)
    assert first.same(again[0]) and later.same(again[1])
    assert vars(method) == before and method == METHODS[name]()


ASIDE = ((3.0, 0.0, 0.0), (-3.0, 0.0, 0.0), (0.0, -9.0, 0.0))


def looking_aside(time: float) -> Camera:
    """Past the mirror on either side, and away from it."""
    return Camera(EYE, ASIDE[round(time)], 45.0)


@pytest.mark.parametrize("name", METHODS)
def test_a_mirror_out_of_view_is_no_error(name):
    method = METHODS[name]()
    made = scene((walls(), *balls()), (mirror_for(method),), looking_aside, fps=1.0)
    renderer, prepared = FrameRenderer(made, 48, 32), method.prepare(made)
    for index in range(len(ASIDE)):
        frame = renderer.render(index)
        answer = Answer(frame, *method.shade(method.update(prepared, frame), frame))
        assert not answer.active.any()
        assert np.isfinite(answer.L).all()


@pytest.mark.parametrize("name", METHODS)
def test_what_moves_changes_the_picture_as_if_it_had_been_there_from_the_start(name):
    def shift(time):
        pose = np.eye(4)
        pose[:3, 3] = [0.3 * time, 0.1 * time, 0.4 * time]
        return pose

    red, *rest = balls()
    method = METHODS[name]()
    mirror = replace(mirror_for(method), motion=lambda t: shift(-0.2 * t))
    made = scene((walls(), replace(red, motion=shift), *rest), (mirror,), fps=1.0)
    if "warm" in vars(method):  # what it carries from frame to frame is not the subject
        method = replace(method, warm=False if isinstance(method.warm, bool) else "off")
    still_there, moved = shaded(method, made, 0, 1)
    fresh = shaded(method, made, 1)[0]
    assert moved.same(fresh)
    both = still_there.active & moved.active
    # The same places, built in instead of moved to: but for rounding, and what it does at edges.
    built = replace(
        made,
        objects=tuple(replace(o, mesh=o.mesh.transformed(o.pose(1.0)), motion=None) for o in made.objects),
        reflectors=tuple(replace(r, mesh=r.mesh.transformed(r.pose(1.0)), motion=None) for r in made.reflectors),
    )
    there = shaded(method, built, 1)[0]
    assert (there.active != moved.active).sum() <= 2
    off = np.abs(there.L - moved.L)[there.active & moved.active].max(axis=1)
    assert (off > 0.01).mean() < 0.02
    assert (np.abs(still_there.L - moved.L)[both].max(axis=1) > 0.1).mean() > 0.02


@pytest.mark.parametrize("name", METHODS)
def test_where_the_scene_ends_its_surroundings_are_shown_at_infinity(name):
    method = METHODS[name]()
    sky = scene(balls(), (mirror_for(method),), background=(0.1, 0.2, 0.4))
    answer, expected = shaded(method, sky, 0)[0], picture(sky)
    far = expected.mask & answer.active & np.isinf(expected.distance)
    assert answer.found[answer.active].all()
    assert not np.isnan(answer.distance[answer.active]).any()
    # The environment map shows the balls elsewhere, eight blended ones at up to eight places each; the sky is the most of the
    # picture in any case.
    sky_seen = np.isinf(answer.distance) & far
    assert sky_seen.sum() > (0.6 if name in ("probe_blend", "reflection_morph") else 0.9) * far.sum()
    np.testing.assert_allclose(answer.L[sky_seen], np.tile((0.1, 0.2, 0.4), (sky_seen.sum(), 1)), atol=0.05)
    # And the balls are there; half of eight maps that are half a metre apart see them.
    assert (answer.L[answer.active].max(axis=1) > (0.5 if name == "reflection_morph" else 0.7)).sum() > 50


# Ray tracing


def test_ray_traced_is_what_mitsuba_shows(room, renderer, truth_of_room):
    answer = shaded(RayTraced(), room, 0, renderer=renderer)[0]
    both = answer.active & truth_of_room.mask
    assert both.sum() > 0.98 * answer.active.sum()
    # Float32, in two orders of computing; at a few pixels of an outline or an edge the ray falls on the other side.
    wrong = np.abs(answer.L - truth_of_room.image)[both].max(axis=1) > 1e-4
    assert wrong.mean() < 0.002
    off = np.abs(answer.distance - truth_of_room.distance)[both]
    assert (off > 1e-3).mean() < 0.002


# Environment maps


def test_an_environment_map_is_right_where_everything_is_far_and_wrong_near(room, renderer, truth_of_room):
    near = error(shaded(EnvironmentMap(), room, 0, renderer=renderer)[0], truth_of_room)
    assert near > 0.05
    # What is left with walls at 4 km, a ball of 0.5 m: bilinear texels. Their number tells, at second order.
    errors = []
    far = scene((walls(4000.0),), (mirror_ball(),))
    expected = picture(far)
    inner = binary_erosion(expected.mask, iterations=3)
    for resolution in (16, 32, 64):
        answer = shaded(EnvironmentMap(resolution=resolution, mip=False), far, 0)[0]
        errors.append(np.sqrt(((answer.L - expected.image)[inner] ** 2).mean()))
    assert errors[-1] < 2e-3
    assert errors[0] > 2.5 * errors[1] > 2.5**2 * errors[2]
    # And the distance is that from the middle of the ball instead of its surface: half a metre of thousands.
    np.testing.assert_allclose(answer.distance[inner], expected.distance[inner], rtol=0.01)


def test_mip_levels_are_chosen_alike_all_over_the_picture():
    # The ball fills the picture and turns little from pixel to pixel: mip and bilinear lookup are the same, to the border.
    made = scene((walls(),), (mirror_ball(),), still(fov_deg=12.0))
    with_mip, without = (shaded(EnvironmentMap(mip=mip), made, 0)[0] for mip in (True, False))
    assert with_mip.active.all()
    assert np.abs(with_mip.L - without.L).max() < 2e-3


def test_mip_levels_smooth_what_a_strongly_curved_mirror_shows():
    # A small ball turns the direction by a radian within a few pixels: texels of a fine map would be skipped.
    stripes = replace(walls(), mesh=replace(walls(h=0.1).mesh))
    checks = np.where(np.floor(stripes.mesh.vertices / 0.2).sum(axis=1) % 2 == 0, 1.0, 0.0)[:, None] * np.ones(3)
    stripes = replace(stripes, mesh=replace(stripes.mesh, radiance=checks))
    made = scene((stripes,), (mirror_ball(radius=0.08),))
    spread = [shaded(EnvironmentMap(mip=mip), made, 0)[0] for mip in (True, False)]
    inner = binary_erosion(spread[0].active, iterations=1)
    assert spread[0].L[inner].std() < 0.8 * spread[1].L[inner].std()


def test_a_resolution_that_is_no_power_of_two_is_refused():
    with pytest.raises(ValueError, match="environment_map: resolution is 100; accepted: a power of two"):
        EnvironmentMap(resolution=100)


# Several mirrors


@pytest.fixture(scope="module")
def two_mirrors():
    mirrors = (mirror_ball("one", NEAR_BALL, 0.35), mirror_ball("two", (0.45, 0.1, 0.0), 0.35))
    return scene((walls(), *balls()), mirrors)


@pytest.mark.parametrize("name", OWN)
def test_of_two_mirrors_each_shows_the_other_black_and_the_rest_as_it_is(name, two_mirrors):
    answer, expected = shaded(METHODS[name](), two_mirrors, 0)[0], picture(two_mirrors)
    seen = reflector_of(answer)
    for number in (0, 1):
        black = (answer.L.max(axis=2) == 0) & (seen == number)
        assert 0.005 < black.sum() / (seen == number).sum() < 0.2
        if name != "environment_map":
            truly = (expected.image.max(axis=2) == 0) & (expected.reflector == number)
            assert (black & truly).sum() > 0.7 * (black | truly).sum()
    if name in BY_VERTEX:
        assert error(answer, expected) < 0.05
        vertices = answer.reflection.vertices
        assert np.array(vertices.R).shape == (3, 2 * two_mirrors.vertices)
        region = np.array(vertices.region).reshape(2, -1)
        objects = sum(len(o.mesh.vertices) for o in two_mirrors.objects)
        one = len(two_mirrors.reflectors[0].mesh.vertices)
        assert (region[0, objects : objects + one] == 0).all() and (region[1, objects : objects + one] != 0).all()
        assert (region[1, objects + one :] == 0).all() and (region[0, objects + one :] != 0).all()


@pytest.mark.exhaustive
def test_a_mirror_is_the_same_beside_another_one_that_shows_nothing_new(two_mirrors):
    """The second mirror's own pixels do not depend on being the second."""
    swapped = replace(two_mirrors, reflectors=two_mirrors.reflectors[::-1])
    for name in OWN:
        one, two = (shaded(METHODS[name](), made, 0)[0] for made in (two_mirrors, swapped))
        np.testing.assert_array_equal(one.active, two.active)
        assert np.abs(one.L - two.L)[one.active].max(axis=1).mean() < 2e-4, name


# Mirrors that have more than one reflection point


@pytest.mark.parametrize("name", ["concave", "torus"])
@pytest.mark.parametrize("method", ["environment_map", "ray_traced"])
def test_other_methods_take_any_mirror(method, name):
    made = scene((walls(), *balls()), (hollow(name),), still((0.2, -1.0, 0.5)))
    answer = shaded(METHODS[method](), made, 0)[0]
    assert np.isfinite(answer.L).all() and answer.found[answer.active].all()
    if method == "ray_traced":
        expected = picture(made)
        both = binary_erosion(expected.mask & answer.active, iterations=1)
        assert (np.abs(answer.L - expected.image)[both].max(axis=1) > 1e-3).mean() < 0.01


def test_a_sheet_that_few_texels_take_for_star_shaped_is_refused_as_the_map_itself_does():
    """A rectangle of a sphere of 100 m: some directions from its middle graze it, and 32 texels miss that."""
    sheet = bulging(0.01)
    starmap.build(sheet.vertices, sheet.normals, sheet.faces, 32)
    said = SecantTriangle().refuses(scene((walls(),), (Reflector("sheet", sheet),)))
    with pytest.raises(starmap.NotStarShapedError) as error:
        starmap.build(sheet.vertices, sheet.normals, sheet.faces, SecantTriangle().resolution)
    assert said == f"reflector sheet: {error.value}"
