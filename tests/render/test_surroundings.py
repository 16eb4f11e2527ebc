"""Panoramas: one lookup on host, on device and in Mitsuba; seen directly, in mirrors, and as light."""

from __future__ import annotations

from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from support.mirror_room import SIZE, ball, balls, mirror_ball, mirror_for, scene, shaded, still
from support.small_room import quad, sphere

from benchharness.kernels import surroundings
from benchharness.measure import metrics
from benchharness.modelling import panorama
from benchharness.render import reference
from benchharness.render.bake import bake
from benchharness.render.frame import FrameRenderer
from benchharness.render.mitsuba_scene import mitsuba_scene
from benchharness.scene import Environment, Mesh, Object, Reflector, Scene
from benchharness.study import identity, plugins
from methods.environment_map import EnvironmentMap
from methods.ray_traced import RayTraced

METHODS = {name: plugin.target for name, plugin in plugins.discover("method").items() if plugin.error is None}
AXES = np.concatenate([np.eye(3), -np.eye(3)])
COLOURS = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1], [1, 0, 1], [1, 1, 0]], float)
"""Of +x, +y, +z, -x, -y, -z."""


def six_colours(d: np.ndarray) -> np.ndarray:
    """A smooth sky that is one of COLOURS in the middle of each of the AXES."""
    weights = np.maximum(d @ AXES.T, 0) ** 2
    return weights @ COLOURS + 0.05


def random_panorama(height: int, width: int) -> Environment:
    return Environment(np.random.default_rng(1).uniform(0, 3, (height, width, 3)))


def random_directions(count: int = 3000) -> np.ndarray:
    d = np.random.default_rng(0).normal(size=(count, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def in_the_open(environment: Environment | None = None, objects=(), reflectors=None, **more) -> Scene:
    environment = Environment.painted(six_colours, 64) if environment is None else environment
    return scene(objects, (mirror_ball(),) if reflectors is None else reflectors, environment=environment, frames=1, **more)


def picture(made: Scene, max_depth: int = 2) -> reference.Reference:
    return reference.render(made, 0.0, SIZE, reference.ReferenceOptions(spp=2, max_depth=max_depth))


# The lookup


@pytest.mark.parametrize("height", [2, 5, 64])
def test_a_lookup_at_the_samples_returns_the_samples(height):
    made = random_panorama(height, 2 * height)
    directions = panorama.sample_directions(height, 2 * height)
    inner = slice(1, -1)  # at the poles all columns are one direction
    np.testing.assert_allclose(made.lookup(7 * directions)[inner], made.radiance[inner], atol=1e-10)
    np.testing.assert_array_equal(Environment.from_picture(made.as_seen()).radiance, made.radiance)


def test_the_azimuth_goes_from_x_to_y_and_the_first_row_is_up():
    six = Environment.painted(six_colours, 64)
    np.testing.assert_allclose(six.lookup(AXES), COLOURS + 0.05, atol=0.01)
    directions = panorama.sample_directions(3, 4)
    r = np.sqrt(0.5)
    np.testing.assert_allclose(directions[1], [[r, r, 0], [-r, r, 0], [-r, -r, 0], [r, -r, 0]], atol=1e-15)
    np.testing.assert_allclose(directions[[0, 2]][..., 2], [[1] * 4, [-1] * 4])


@pytest.mark.parametrize(("height", "width"), [(2, 2), (2, 5), (3, 2), (5, 8), (33, 70)])
def test_host_device_and_mitsuba_look_up_the_same(height, width):
    made = in_the_open(random_panorama(height, width))
    # Mitsuba takes its angle from acos, which is coarse near the poles, and wraps around straight down.
    d = random_directions()
    expected = made.environment.lookup(d)
    around = surroundings.of_scene(made)
    vectors = mi.Vector3f(np.float32(d).T)
    np.testing.assert_allclose(np.array(surroundings.radiance(around, 3 * vectors)).T, expected, atol=1e-4)
    si = dr.zeros(mi.SurfaceInteraction3f, len(d))
    si.wi = -vectors
    emitter = mitsuba_scene(made, 0.0, "baked").environment()
    np.testing.assert_allclose(np.array(emitter.eval(si)).T, expected, atol=3e-3)
    assert np.abs(np.array(emitter.eval(si)).T - expected).mean() < 1e-5


def test_the_device_knows_the_poles_and_the_seam():
    made = in_the_open(random_panorama(9, 6))
    tiny = 1e-7
    d = np.array([[0, 0, 1], [0, 0, -1], [1, tiny, 0], [1, -tiny, 0], [1, 0, 0], [-1, tiny, 0], [-1, -tiny, 0], [0, 0, 5]])
    got = np.array(surroundings.radiance(surroundings.of_scene(made), mi.Vector3f(np.float32(d).T))).T
    np.testing.assert_allclose(got, made.environment.lookup(d), atol=1e-5)


def test_one_colour_reads_no_panorama():
    around = surroundings.of_scene(scene((), (), background=(0.1, 0.2, 0.4)))
    assert around.texels is None
    np.testing.assert_array_equal(
        np.array(surroundings.radiance(around, mi.Vector3f(1, 2, 3))).ravel(), np.float32([0.1, 0.2, 0.4])
    )


# The scene model


@pytest.mark.parametrize(
    ("radiance", "reason"),
    [
        (np.ones((4, 8)), r"shape \(4, 8\)"),
        (np.ones((1, 8, 3)), "at least 2"),
        (np.ones((4, 1, 3)), "at least 2"),
        (np.full((4, 8, 3), np.nan), "row 0, column 0 .*finite"),
        (np.full((4, 8, 3), -0.1), "row 0, column 0 .*from 0"),
    ],
)
def test_what_is_no_panorama_is_refused(radiance, reason):
    with pytest.raises(ValueError, match=f"environment: radiance.*{reason}"):
        Environment(radiance)


def test_an_environment_that_does_not_fit_is_refused():
    with pytest.raises(ValueError, match=r"centre is .*three finite"):
        Environment(np.ones((4, 8, 3)), centre=(0, 0, np.inf))
    with pytest.raises(ValueError, match="height is 1"):
        Environment.painted(six_colours, 1)
    with pytest.raises(ValueError, match=r"paint returned shape \(128,\)"):
        Environment.painted(lambda d: d[:, 0], 8)
    plain = Environment(np.ones((4, 8, 3)))
    with pytest.raises(ValueError, match=r"background .* and there is an environment"):
        in_the_open(plain, background=(0, 0, 0.1))
    with pytest.raises(ValueError, match="ground is 'lawn'; accepted: an object, red, green, blue"):
        in_the_open(replace(plain, ground="lawn"), balls())
    assert in_the_open(replace(plain, ground="red"), balls()).environment.ground == "red"


def test_the_hash_of_a_scene_follows_its_panorama():
    made = in_the_open(random_panorama(4, 8))
    one = made.environment
    changed = one.radiance.copy()
    changed[2, 3, 1] += 1e-6
    others = [None, Environment(changed), replace(one, centre=(0, 0, 1)), Environment(one.radiance.reshape(8, 4, 3))]
    hashes = {identity.of_scene(replace(made, environment=e)) for e in others}
    assert len(hashes | {identity.of_scene(made)}) == 5
    assert identity.of_scene(replace(made, environment=Environment(one.radiance.copy()))) == identity.of_scene(made)


# Pictures


@pytest.fixture(scope="module")
def open_air():
    """A mirror ball and three balls under six colours, its frame and its reference."""
    made = in_the_open(objects=balls())
    return made, FrameRenderer(made, *SIZE), picture(made)


def test_a_frame_shows_the_panorama_wherever_nothing_else_is(open_air):
    made, renderer, truth = open_air
    image = np.array(renderer.render(0).radiance).T.reshape(truth.image.shape)
    off = np.abs(image - truth.image).max(axis=2)[~truth.mask]
    assert (off > 1e-4).mean() < 0.003  # pixels of an outline
    # Looking along each axis, and straight up and down: its colour, at the middle of the picture.
    far = Object("far", ball(0.1, (9, 9, 9), (1, 1, 1)), "something")
    for axis, colour in zip(AXES, COLOURS, strict=True):
        up = (0, 0, 1) if axis[2] == 0 else (0, 1, 0)
        looking = replace(made, objects=(far,), reflectors=(), camera=lambda t, a=axis, up=up: replace(
            still(eye=(0, 0, 0), target=tuple(a))(t), up=up, fov_deg=30.0))  # fmt: skip
        view = FrameRenderer(looking, 33, 33).render(0)
        middle = np.array(view.radiance).T.reshape(33, 33, 3)[16, 16]
        np.testing.assert_allclose(middle, colour + 0.05, atol=0.02)


def test_rays_show_the_panorama_as_mitsuba_does(open_air):
    made, renderer, truth = open_air
    answer = shaded(RayTraced(), made, 0, renderer=renderer)[0]
    both = answer.active & truth.mask
    assert both.sum() > 0.98 * truth.mask.sum()
    wrong = np.abs(answer.L - truth.image)[both].max(axis=1) > 2e-4
    assert wrong.mean() < 0.003
    far = np.isinf(truth.distance) & both
    assert np.isinf(answer.distance[far]).mean() > 0.998


@pytest.mark.parametrize("name", METHODS)
def test_every_method_shows_the_panorama_in_a_mirror(name, open_air):
    made, renderer, truth = open_air
    mirror = mirror_for(METHODS[name]())
    if len(mirror.mesh.faces) < len(made.reflectors[0].mesh.faces):
        made = replace(made, reflectors=(mirror,))
        renderer, truth = FrameRenderer(made, *SIZE), picture(made)
    assert METHODS[name]().refuses(made) is None
    answer = shaded(METHODS[name](), made, 0, renderer=renderer)[0]
    far = np.isinf(truth.distance) & answer.active & truth.mask & np.isinf(answer.distance)
    assert answer.found[answer.active].all()
    # Eight maps show each ball at up to eight places, beside it the sky by what others see of it.
    least, most = {"probe_blend": (0.6, 0.1), "reflection_morph": (0.6, 0.13)}.get(name, (0.9, 0.03))
    assert far.sum() > least * (np.isinf(truth.distance) & truth.mask).sum()
    off = np.abs(answer.L - truth.image)[far].max(axis=1)
    assert (off > 0.02).mean() < most, np.percentile(off, [50, 95, 99])
    # Another sky is another picture: it is not a colour that was there before.
    turned = replace(made, environment=Environment(np.roll(made.environment.radiance, 40, axis=1)))
    other = shaded(METHODS[name](), turned, 0)[0]
    assert np.abs(other.L - answer.L)[far].max(axis=1).mean() > 0.1


@pytest.mark.exhaustive
def test_an_environment_map_is_as_sharp_as_its_texels():
    made = in_the_open()
    truth = picture(made)
    off = []
    for resolution in (16, 64, 256):
        answer = shaded(EnvironmentMap(resolution, mip=False), made, 0)[0]
        off.append(np.abs(answer.L - truth.image)[answer.active & truth.mask].mean())
    assert off[0] > 4 * off[1] and off[2] < 1e-3


# Light


@pytest.mark.parametrize("normal", [(0, 0, 1), (1, 0, 0), (0, 0, -1)])
def test_half_a_sky_lights_a_patch_as_it_should(normal):
    """Radiance S where z > 0: irradiance π S facing up, π S / 2 on a wall, nothing facing down."""
    sky = Environment.painted(lambda d: np.where(d[:, 2:] > 0, [3.0, 2.0, 0.5], 0.0), 256)
    u = np.cross(normal, (0.3, 0.5, 0.7))
    patch = quad((0, 0, 0), u, np.cross(normal, u), albedo=(0.2, 0.5, 1.0))
    made = Scene("patch", (Object("patch", patch, "light"),), (), still(), 1, environment=sky)
    radiance = bake(made, spp=256).objects[0].mesh.radiance
    share = 0.5 * (1 + normal[2])
    expected = share * np.array([0.2, 0.5, 1.0]) * [3.0, 2.0, 0.5]
    np.testing.assert_allclose(radiance, np.tile(expected, (4, 1)), rtol=0.02, atol=0.01)


def test_light_is_baked_anew_for_another_panorama():
    floor = Object("floor", quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), "light")
    skies = [Environment(np.full((4, 8, 3), value)) for value in (0.5, 1.0, 0.0)]
    made = [Scene("floor", (floor,), (), still(), 1, environment=sky) for sky in skies]
    values = [bake(m, spp=256).objects[0].mesh.radiance.mean() for m in made]
    np.testing.assert_allclose(values, [0.25, 0.5, 0.0], rtol=0.01)


# Second reflections


@pytest.fixture(scope="module")
def two_balls():
    """Two mirror balls side by side, one of metal, under six colours."""
    metal = {"eta": (0.2, 0.92, 1.1), "k": (3.9, 2.45, 2.1)}
    mirrors = (mirror_ball("one", (-0.42, 0.0, 0.0), 0.4), mirror_ball("two", (0.42, 0.1, 0.0), 0.4, **metal))
    made = in_the_open(objects=balls()[:1], reflectors=mirrors)
    return made, FrameRenderer(made, *SIZE)


def composed(method, made: Scene, renderer: FrameRenderer) -> np.ndarray:
    answer = shaded(method, made, 0, renderer=renderer)[0]
    return np.array(renderer.compose(answer.frame, answer.reflection.L)).T.reshape(SIZE[1], SIZE[0], 3)


@pytest.mark.exhaustive
def test_more_bounces_are_a_deeper_reference(two_balls):
    made, renderer = two_balls
    flip = {}
    for bounces in (1, 2, 4):
        image = composed(RayTraced(bounces), made, renderer)
        for depth in (2, 3, 5):
            truth = picture(made, depth)
            error = metrics.flip_map(image, truth.image, truth.mask, ppd=67.0, exposure=0.0)
            flip[bounces, depth] = error[truth.mask].mean(), error[truth.second & truth.mask].mean()
    for bounces in (1, 2, 4):
        assert flip[bounces, bounces + 1][0] < 0.002, flip
        assert flip[bounces, bounces + 1][1] < 0.02, flip
    assert flip[1, 5][0] > 10 * flip[4, 5][0] and flip[1, 5][1] > 0.2, flip
    assert flip[2, 5][1] > 2 * flip[4, 5][1], flip


def test_a_second_bounce_changes_only_what_shows_a_mirror(two_balls):
    made, renderer = two_balls
    one, two = (shaded(RayTraced(b), made, 0, renderer=renderer)[0] for b in (1, 2))
    second = picture(made).second
    assert 100 < second.sum() < 0.3 * one.active.sum()
    np.testing.assert_array_equal(one.distance, two.distance)
    changed = (one.L != two.L).any(axis=2)
    # Some of what a second bounce meets is a mirror again, and black.
    assert (changed & ~second).sum() < 0.02 * second.sum() and (changed & second).sum() > 0.7 * second.sum()
    rays = [np.array(a.reflection.counters["rays"]).reshape(one.active.shape) for a in (one, two)]
    np.testing.assert_array_equal(rays[0], one.active)
    assert ((rays[1] - rays[0]) != second)[one.active].sum() < 0.02 * second.sum() and (rays[1] - rays[0]).max() == 1


def test_second_reflections_are_those_of_the_mirrors_in_a_corner():
    """Two mirror walls at a right angle: where the reflected ray goes on to the other wall is known."""
    walls = (
        Reflector("back", quad((-4, 2, -4), (8, 0, 0), (0, 0, 8))),
        Reflector("side", quad((2, 2, -4), (0, -8, 0), (0, 0, 8))),
    )
    made = in_the_open(objects=(), reflectors=walls, camera=still(eye=(0, 0, 0), target=(1, 1, 0), fov_deg=60.0))
    truth = picture(made)
    assert truth.mask.all()
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    made_camera = made.camera(0.0)
    right, down, forward = made_camera.axes()
    focal = 0.5 * SIZE[1] / np.tan(np.radians(30.0))
    d = forward + ((x - SIZE[0] / 2)[..., None] * right + (y - SIZE[1] / 2)[..., None] * down) / focal
    # From the back wall at y = 2 a ray goes on to x = 2 and is there at y = 4 - 2 d_y / d_x, which the wall has from -6 to 2.
    met = np.abs(d[..., 2]) * 2 / np.minimum(np.abs(d[..., 0]), np.abs(d[..., 1])) < 4
    first = np.maximum(d[..., 0], d[..., 1])
    slope = np.minimum(d[..., 0], d[..., 1]) / first
    reach = np.where(d[..., 1] > d[..., 0], 4 - 2 / slope > -6, 4 - 2 / slope > -4)
    expected = met & reach & (slope > 0)
    assert 0.2 < expected.mean() < 1
    assert (expected != truth.second).mean() < 0.01


def test_one_ball_alone_shows_no_second_reflection(open_air):
    truth = open_air[2]
    assert truth.second.sum() < 0.01 * truth.mask.sum()
    assert not truth.second[~truth.mask].any()


def test_moved_mirrors_turn_their_normals():
    """A mirror that is put in its place by a motion reflects on as if it had been built there."""
    pose = np.eye(4)
    pose[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    pose[:3, 3] = [0.42, 0.1, 0.0]
    own = sphere(0.4, slices=96, stacks=48)
    squashed = Mesh(own.vertices * [1, 0.6, 1], own.faces)
    one = mirror_ball("one", (-0.42, 0.0, 0.0), 0.4)
    moved = in_the_open(reflectors=(one, Reflector("two", squashed, motion=lambda t: pose)))
    built = in_the_open(reflectors=(one, Reflector("two", squashed.transformed(pose))))
    a, b = (shaded(RayTraced(3), made, 0)[0] for made in (moved, built))
    assert (np.abs(a.L - b.L).max(axis=2)[a.active & b.active] > 1e-3).mean() < 0.002
    truth = picture(moved, 4)
    assert (np.abs(a.L - truth.image).max(axis=2)[a.active & truth.mask] > 2e-3).mean() < 0.01
