"""References against closed forms: where rays go, what mirrors show, and which way is up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.small_room import quad, small_room, sphere

from benchharness.measure import metrics
from benchharness.render import reference as reference_module
from benchharness.render.bake import bake
from benchharness.render.mitsuba_scene import mitsuba_scene
from benchharness.render.reference import ReferenceOptions, render
from benchharness.scene import Camera, Mesh, Object, Reflector, Scene

ETA, K = (0.2, 0.92, 1.1), (3.9, 2.45, 2.1)
IRON = {"eta": ETA, "k": K}


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("BENCHHARNESS_CACHE", str(tmp_path))


def scene(objects: list[Mesh], reflectors: list[Reflector], camera: Camera, background=(0.0, 0.0, 0.0)) -> Scene:
    return Scene(
        name="closed form",
        objects=tuple(Object(f"object {i}", mesh, shows="light") for i, mesh in enumerate(objects)),
        reflectors=tuple(reflectors),
        camera=lambda time: camera,
        frames=1,
        background=background,
    )


def glowing(mesh: Mesh, radiance) -> Mesh:
    return replace(mesh, radiance=radiance)


def facing_y(y: float, x0: float, x1: float, z0: float, z1: float) -> Mesh:
    """Upright rectangle at y whose normal is -y: it faces an eye that looks along +y."""
    return quad((x0, y, z0), (x1 - x0, 0, 0), (0, 0, z1 - z0))


AHEAD = Camera(eye=(0, 0, 0), target=(0, 1, 0), fov_deg=90.0)
"""At distance 1 a picture of h pixels is 2 m high: a pixel is 2 / h metres."""


def fresnel(cosine: np.ndarray, eta: float, k: float) -> np.ndarray:
    """Unpolarised reflectance of a conductor in air, from the complex amplitudes r_s and r_p."""
    m = eta + 1j * k  # absorption positive; |r| is the same for either sign
    transmitted = np.sqrt(1 - (1 - cosine**2) / m**2)
    r_s = (cosine - m * transmitted) / (cosine + m * transmitted)
    r_p = (m * cosine - transmitted) / (m * cosine + transmitted)
    return 0.5 * (np.abs(r_s) ** 2 + np.abs(r_p) ** 2)


def test_the_independent_fresnel_is_right_at_normal_incidence_and_for_glass() -> None:
    # ((n - 1)² + k²) / ((n + 1)² + k²), and 4 % for n = 1.5; 1 at grazing incidence.
    assert fresnel(np.array(1.0), 0.2, 3.9) == pytest.approx((0.64 + 15.21) / (1.44 + 15.21))
    assert fresnel(np.array(1.0), 1.5, 0.0) == pytest.approx(0.04)
    assert fresnel(np.array(1e-9), 0.9, 2.4) == pytest.approx(1.0)


def test_up_is_up_and_right_is_right() -> None:
    wall = facing_y(1, -1, 1, -1, 1)
    x, z = wall.vertices[:, 0], wall.vertices[:, 2]
    radiance = np.stack([1.5 + x, 1.5 + z, np.ones(4)], axis=1)  # red grows to the right, green upwards
    image = render(scene([glowing(wall, radiance)], [], AHEAD), 0.0, (2, 2)).image
    # Centres of a 2 x 2 picture lie at x, z = -0.5, 0.5.
    np.testing.assert_allclose(image[:, :, 0], [[1, 2], [1, 2]], atol=1e-5)
    np.testing.assert_allclose(image[:, :, 1], [[2, 2], [1, 1]], atol=1e-5)


def test_rays_go_through_pixel_centres_and_agree_with_the_camera_matrix() -> None:
    # A wall whose radiance is its position: the picture holds what each ray hit, and world_to_screen takes it back.
    camera = Camera(eye=(0.3, -0.2, 0.1), target=(0.5, 1.0, 0.3), fov_deg=50.0, up=(0.1, 0, 1))
    wall = facing_y(2, 0, 8, 0, 8)
    wall = replace(wall, vertices=wall.vertices - [4, 0, 4], radiance=wall.vertices[:, [0, 2, 2]])
    width, height = 9, 6
    image = render(scene([wall], [], camera), 0.0, (width, height)).image.astype(float)
    one = np.ones((height, width))
    p = np.stack([image[..., 0] - 4, 2 * one, image[..., 1] - 4, one], axis=-1)
    x, y, w = np.moveaxis(p @ camera.world_to_screen(width, height).T, -1, 0)
    # Single precision positions of metres on a pixel of 0.2 m.
    np.testing.assert_allclose(x / w, np.tile(np.arange(width) + 0.5, (height, 1)), atol=1e-4)
    np.testing.assert_allclose(y / w, np.tile(np.arange(height)[:, None] + 0.5, (1, width)), atol=1e-4)


@pytest.mark.parametrize(("edge", "lit"), [(3.99, 4), (4.01, 4), (4.49, 4), (4.51, 5)])
def test_an_edge_switches_a_pixel_exactly_at_its_centre(edge: float, lit: int) -> None:
    # 8 pixels, 0.25 m each at distance 1; the wall covers what is left of column `edge`. Half a pixel off shows.
    wall = glowing(facing_y(1, -1, -1 + 0.25 * edge, -1, 1), np.ones(3))
    image = render(scene([wall], [], AHEAD), 0.0, (8, 8)).image
    assert (image[..., 0] > 0.99).sum(axis=1).tolist() == [lit] * 8


def test_the_box_filter_gives_the_share_of_a_pixel_that_is_covered() -> None:
    wall = glowing(facing_y(1, -1, 0.25 * 0.3, -1, 1), np.ones(3))  # column 4 is covered by 30 %
    result = render(scene([wall], [], AHEAD), 0.0, (8, 8), ReferenceOptions(filter="box", spp=256))
    column = result.image[:, 4, 0].astype(float)
    # Eight pixels of 256 rays: sqrt(0.3 * 0.7 / 2048) = 0.010; four of them.
    assert column.mean() == pytest.approx(0.3, abs=0.04)
    np.testing.assert_allclose(result.variance[:, 4, 0], column * (1 - column) / 255, rtol=1e-4)
    assert result.variance[:, :4].max() < 1e-12  # rounding of an interpolated 1
    assert result.spp == 256


def through_a_mirror(camera: Camera, **metal) -> Scene:
    """A mirror at y = 1 that faces the eye, and behind the eye a wall at y = -1 whose radiance is its position."""
    wall = quad((-20, -1, -20), (0, 0, 40), (40, 0, 0))
    wall = glowing(wall, np.stack([wall.vertices[:, 0] + 20, wall.vertices[:, 2] + 20, np.ones(4)], axis=1))
    return scene([wall], [Reflector("mirror", facing_y(1, -2, 2, -2, 2), **metal)], camera)


def test_an_ideal_plane_mirror_shows_the_mirrored_wall_exactly() -> None:
    # The wall's mirror image is at y = 3: a ray (a, 1, c) meets it at x = 3 a, z = 3 c; the ray's tail is 2 of 3 parts.
    result = render(through_a_mirror(AHEAD), 0.0, (16, 12))
    a = ((np.arange(16) + 0.5) - 8) / 6 + np.zeros((12, 1))
    c = -((np.arange(12)[:, None] + 0.5) - 6) / 6 + np.zeros(16)
    # Mitsuba starts a reflected ray 1e-4 m off the surface.
    np.testing.assert_allclose(result.image[..., 0], 3 * a + 20, atol=5e-4)
    np.testing.assert_allclose(result.image[..., 1], 3 * c + 20, atol=5e-4)
    np.testing.assert_allclose(result.image[..., 2], 1, rtol=1e-5)
    assert result.mask.all()
    assert (result.reflector == 0).all()
    np.testing.assert_allclose(result.distance, 2 * np.sqrt(1 + a**2 + c**2), rtol=1e-4)


def test_image_and_distance_follow_the_vertex_normals() -> None:
    # A flat mirror whose normals are turned by 10 degrees: the ray leaves along d - 2 (d.n) n and meets y = -1.
    turned = np.array([np.sin(np.radians(10)), -np.cos(np.radians(10)), 0.0])
    tilted = through_a_mirror(AHEAD)
    mirror = replace(tilted.reflectors[0].mesh, normals=np.tile(turned, (4, 1)))
    result = render(replace(tilted, reflectors=(replace(tilted.reflectors[0], mesh=mirror),)), 0.0, (8, 8))
    x, z = (np.arange(8) + 0.5 - 4) / 4, -(np.arange(8)[:, None] + 0.5 - 4) / 4
    p = np.stack(np.broadcast_arrays(x, 1.0, z), axis=-1)
    d = p / np.linalg.norm(p, axis=-1, keepdims=True)
    r = d - 2 * (d @ turned)[..., None] * turned
    length = -2 / r[..., 1]
    np.testing.assert_allclose(result.distance, length, rtol=2e-4)
    np.testing.assert_allclose(result.image[..., 0], p[..., 0] + length * r[..., 0] + 20, atol=2e-3)


def test_a_conductor_reflects_as_an_independent_fresnel_says() -> None:
    image = render(through_a_mirror(AHEAD, **IRON), 0.0, (16, 12)).image
    ideal = render(through_a_mirror(AHEAD), 0.0, (16, 12)).image
    a, c = ((np.arange(16) + 0.5) - 8) / 6, ((np.arange(12)[:, None] + 0.5) - 6) / 6
    cosine = 1 / np.sqrt(1 + a**2 + c**2)
    for channel in range(3):
        expected = ideal[..., channel] * fresnel(cosine, ETA[channel], K[channel])
        np.testing.assert_allclose(image[..., channel], expected, rtol=2e-4)


def test_mask_and_distance_of_a_sphere_are_the_closed_forms() -> None:
    # Sphere of radius 1 at the origin, eye at distance 4, around both a shell of radius 10. Angle of the outline
    # asin(1/4); from the hit p along r the shell is at -p.r + sqrt((p.r)² - 1 + 100).
    camera = Camera(eye=(0, -4, 0), target=(0, 0, 0), fov_deg=40.0)
    shell = sphere(10, slices=96, stacks=48)
    shell = glowing(replace(shell, faces=shell.faces[:, ::-1]), np.ones(3))
    ball = Reflector("ball", sphere(1, slices=256, stacks=128))
    result = render(scene([shell], [ball], camera), 0.0, (64, 48))

    focal = 24 / np.tan(np.radians(20))
    x, z = (np.arange(64) + 0.5 - 32) / focal, -(np.arange(48)[:, None] + 0.5 - 24) / focal
    d = np.stack(np.broadcast_arrays(x, 1.0, z), axis=-1)
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    along = 4 * d[..., 1]
    inside = along**2 - 15
    # The polyhedron is 1e-4 smaller; leave out pixels that close to the outline.
    sure = np.abs(inside) > 0.02
    assert np.array_equal(result.mask[sure], inside[sure] > 0)
    assert result.mask.sum() > 500

    p = np.array([0, -4, 0]) + (along - np.sqrt(np.maximum(inside, 0)))[..., None] * d
    r = d - 2 * (d * p).sum(-1, keepdims=True) * p
    pr = (p * r).sum(-1)
    expected = -pr + np.sqrt(pr**2 + 99)
    inner = inside > 0.02
    np.testing.assert_allclose(result.distance[inner], expected[inner], rtol=5e-3)  # the shell's facets: 1 - cos(1.9°)
    assert np.isnan(result.distance[~result.mask]).all()
    assert (result.reflector == np.where(result.mask, 0, -1)).all()


def test_the_surroundings_are_seen_in_the_mirror_at_infinity() -> None:
    result = render(replace(through_a_mirror(AHEAD), objects=(), background=(0.5, 2.0, 4.0)), 0.0, (4, 4))
    np.testing.assert_allclose(result.image, np.tile([0.5, 2.0, 4.0], (4, 4, 1)), rtol=1e-5)
    assert np.isinf(result.distance).all()


def test_an_open_mirror_reflects_on_both_sides() -> None:
    behind = Camera(eye=(0, 3, 0), target=(0, 1, 0), fov_deg=30.0)
    result = render(replace(through_a_mirror(behind), background=(1.0, 1.0, 1.0)), 0.0, (4, 4))
    assert result.mask.all()
    np.testing.assert_allclose(result.image, 1, rtol=1e-5)


def facing_mirrors() -> Scene:
    """A mirror ahead at y = 1, one behind the eye at y = -1 that covers z > 0, and sky."""
    front = Reflector("front", facing_y(1, -9, 9, -9, 9))
    back = Reflector("back", quad((-9, -1, 0), (0, 0, 9), (18, 0, 0)))
    return scene([], [front, back], replace(AHEAD, fov_deg=60.0), background=(1, 1, 1))


def test_max_depth_2_is_one_mirror_bounce() -> None:
    # Above the horizon the front mirror shows the other one. Each bounce more takes the ray further up; the back mirror
    # ends at z = 9.
    image = render(facing_mirrors(), 0.0, (4, 4)).image[..., 0]
    np.testing.assert_allclose(image, [[0] * 4] * 2 + [[1] * 4] * 2, rtol=1e-5)
    assert (render(facing_mirrors(), 0.0, (4, 4), ReferenceOptions(max_depth=64)).image > 0.99).all()


def test_the_number_of_the_reflector_is_its_place_in_the_scene() -> None:
    left = Reflector("left", facing_y(1, -1, 0, -1, 1))
    right = Reflector("right", facing_y(1, 0, 1, -1, 1))
    result = render(scene([], [right, left], AHEAD, background=(1, 1, 1)), 0.0, (2, 1))
    assert result.reflector.tolist() == [[1, 0]]


def test_baked_and_centred_is_free_of_noise_measured_on_two_rays() -> None:
    result = render(bake(small_room(1.0), spp=4), 0.0, (36, 24))
    assert result.spp == 2
    assert (result.variance == 0).all()


def test_a_cached_reference_is_identical_and_every_option_counts(monkeypatch) -> None:
    lit = bake(small_room(1.0), spp=4)
    options = ReferenceOptions(filter="box", spp=4)
    first = render(lit, 0.0, (12, 8), options)
    others = [
        render(lit, 0.0, (12, 8), replace(options, spp=5)),
        render(lit, 0.0, (12, 8), replace(options, max_depth=1)),
        render(lit, 0.0, (12, 8), replace(options, lighting="transport", max_depth=3)),
        render(lit, 0.0, (12, 8), options, seed=1),
        render(lit, 0.0, (8, 12), options),
    ]
    assert len({other.image.tobytes() for other in [first, *others]}) == len(others) + 1
    monkeypatch.setattr(reference_module, "_render", lambda *_: pytest.fail("not cached"))
    again = render(lit, 0.0, (12, 8), options)
    for name in ("image", "variance", "mask", "reflector", "distance"):
        assert np.array_equal(getattr(again, name), getattr(first, name), equal_nan=name == "distance")


def test_the_same_seed_gives_the_same_bits(tmp_path, monkeypatch) -> None:
    lit = bake(small_room(1.0), spp=4)
    options = ReferenceOptions(lighting="transport", spp=4)
    first = render(lit, 0.0, (12, 8), options)
    monkeypatch.setenv("BENCHHARNESS_CACHE", str(tmp_path / "other"))
    assert np.array_equal(render(lit, 0.0, (12, 8), options).image, first.image)


def test_what_moves_is_rendered_where_it_is() -> None:
    def motion(time: float) -> np.ndarray:
        pose = np.eye(4)
        pose[0, 3] = time
        return pose

    wall = Object("wall", glowing(facing_y(1, -1, 0, -1, 1), np.ones(3)), shows="light", motion=motion)
    moving = replace(scene([], [], AHEAD), objects=(wall,))
    assert render(moving, 0.0, (2, 2)).image[0, :, 0].tolist() == [1, 0]
    assert render(moving, 1.0, (2, 2)).image[0, :, 0].tolist() == [0, 1]


@pytest.mark.exhaustive
def test_both_lightings_show_the_same_room(tmp_path) -> None:
    # The same number of segments: one from the eye and six from a vertex. What differs is interpolation over 0.3 m,
    # caustics, and the noise of 64 paths: 1 % in the mean, 10 % in a typical pixel.
    room = bake(small_room(0.3), spp=128)
    baked = render(room, 0.0, (90, 64))
    full = render(room, 0.0, (90, 64), ReferenceOptions(lighting="transport", spp=64, max_depth=7))
    for name, result in (("baked", baked), ("transport", full)):
        metrics.save_png(tmp_path / f"{name}.png", metrics.tonemap(result.image, room.exposure))
    assert np.array_equal(baked.mask, full.mask)
    off = ~baked.mask
    assert baked.image[off].mean() == pytest.approx(full.image[off].mean(), rel=0.01)
    relative = np.abs(baked.image - full.image).mean(axis=2) / full.image.mean(axis=2).clip(0.02)
    assert np.median(relative[off]) < 0.1
    assert np.median(relative[baked.mask]) < 0.1


def test_unbaked_objects_and_odd_options_are_refused() -> None:
    room = small_room(1.0)
    with pytest.raises(ValueError, match="walls has no radiance"):
        mitsuba_scene(room, 0.0, "baked")
    with pytest.raises(ValueError, match="'raytraced'; accepted: baked, transport"):
        ReferenceOptions(lighting="raytraced")
    with pytest.raises(ValueError, match="filter is 'gauss'"):
        ReferenceOptions(filter="gauss")
    with pytest.raises(ValueError, match="max_depth is 2"):
        ReferenceOptions(lighting="transport", max_depth=2)
    with pytest.raises(ValueError, match="spp is 0"):
        ReferenceOptions(spp=0)
    with pytest.raises(ValueError, match="size is 0 x 4"):
        render(room, 0.0, (0, 4))
    half = replace(room, reflectors=(replace(room.reflectors[0], k=None),))
    with pytest.raises(ValueError, match="reflector ball: eta"):
        mitsuba_scene(half, 0.0, "transport")


def test_no_ray_slips_through_a_mirror_where_it_runs_along_an_edge() -> None:
    """Seen along its axis, a ball has edges on the diagonals of the picture, where the middles of pixels are."""
    size, away, fov_deg = (120, 120), 4.0, 32.0
    camera = Camera((0.0, 0.0, away), (0.0, 0.0, 0.0), fov_deg, (0.0, 1.0, 0.0))
    ball = sphere(1.0, (0.0, 0.0, 0.0), slices=96, stacks=48)
    made = render(scene([], [Reflector("mirror", ball)], camera, (0.3, 0.36, 0.45)), 0.0, size)
    # The outline is at asin(1 / away); rays parting from the rim of facets may meet facets: leave out its last 5 %.
    y, x = np.indices(size) + 0.5 - 60.0
    edge = np.tan(np.arcsin(1 / away)) * 60.0 / np.tan(np.radians(0.5 * fov_deg))
    inside = np.hypot(x, y) < 0.95 * edge
    assert made.mask[inside].all() and not made.second[inside].any()
    np.testing.assert_allclose(made.image[inside], np.broadcast_to((0.3, 0.36, 0.45), (inside.sum(), 3)), rtol=1e-5)
