"""Panoramas: brushes that keep areas, pictures without a jag, a ground that goes on where the floor ends."""

from __future__ import annotations

import numpy as np
import pytest

from benchharness.modelling.panorama import sample_directions
from benchharness.render.bake import bake
from benchharness.scene import Scene
from scenes.panoramas import brushes, surroundings
from scenes.props import courtyard
from scenes.props.courtyard import BLACK, CENTRE, LIGHT, SIDE, SQUARE, WHITE


def upward(azimuth_deg: np.ndarray, elevation_deg: float) -> np.ndarray:
    a, e = np.radians(azimuth_deg), np.radians(elevation_deg)
    return np.column_stack([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.full(len(a), np.sin(e))])


# Brushes


def test_between_is_the_overlap_of_two_intervals():
    x, width = np.array([0.0, 0.5, 1.0, 1.5, 0.5]), np.array([1.0, 1.0, 1.0, 0.5, 4.0])
    # [-0.5, 0.5], [0, 1], [0.5, 1.5], [1.25, 1.75], [-1.5, 2.5] over [0, 1].
    assert np.allclose(brushes.between(x, 0.0, 1.0, width), [0.5, 1.0, 0.5, 0.0, 0.25])


def test_an_arch_covers_its_area():
    half, foot, spring, step = 1.5, 0.0, 3.0, 0.05
    u, v = (a.ravel() for a in np.meshgrid(np.arange(-2, 2, step), np.arange(-1, 6, step)))
    w = np.full(len(u), step)
    share = brushes.arch(u, v, half, foot, spring, w, w)
    area = 2 * half * spring + 0.5 * np.pi * half**2
    assert share.max() < 1 + 1e-9
    assert share.sum() * step**2 == pytest.approx(area, rel=2e-3)  # the round edge is straight within each footprint


def test_a_checker_is_exact_where_footprints_are_small_and_grey_where_they_are_large():
    x, y = np.array([0.5, 1.5, 1.5, -0.5, -0.5]), np.array([0.5, 0.5, 1.5, 0.5, -0.5])
    fine = np.full(5, 0.1)
    assert np.allclose(brushes.checker(x, y, 1.0, fine, fine), [1, -1, 1, -1, 1])
    # Three quarters of a footprint in its square, on one axis: 3/4 - 1/4.
    at = np.array([0.5 + 0.25])
    assert np.allclose(brushes.checker(at, np.array([0.5]), 1.0, np.array([1.0]), np.array([0.1])), 0.5)
    coarse = np.full(5, 40.3)
    assert abs(brushes.checker(x, y, 1.0, coarse, coarse)).max() < 1e-3


def test_ripples_vary_by_about_one_and_are_the_same_again():
    p = np.random.default_rng(0).uniform(0, 50, (20000, 2))
    value = brushes.ripples(p, 30, 4.0, 0.3, seed=7)
    assert value.std() == pytest.approx(1, abs=0.1)
    assert abs(value.mean()) < 0.1
    assert (value == brushes.ripples(p, 30, 4.0, 0.3, seed=7)).all()


# Pictures


def test_the_panorama_is_finite_and_positive_and_of_one_colour_at_each_pole():
    radiance = courtyard.environment().radiance
    assert np.isfinite(radiance).all()
    assert radiance.min() > 0.004
    assert radiance.max() < 120
    assert np.ptp(radiance[0], axis=0).max() < 1e-3


def test_a_coarse_panorama_is_the_mean_of_a_fine_one():
    # What is painted has the width of a sample: the mean of 3 x 3 directions about a sample agrees with it, but for corners
    # and vertical edges of walls. Without footprints, points of a fine panorama, the mean difference is almost three times.
    coarse, times = 128, 3

    def painter(height: int):
        return surroundings.gallery(surroundings.Ground(SQUARE, (WHITE, BLACK), LIGHT), CENTRE[2], height)

    directions = sample_directions(coarse, 2 * coarse).reshape(-1, 3)
    theta = np.pi * np.arange(coarse) / (coarse - 1)
    one = painter(coarse)(directions).reshape(coarse, 2 * coarse, 3)
    sharp, mean = painter(8192), np.zeros_like(one)
    for i in range(times):
        for j in range(times):
            t = np.clip(theta + (i - 1) / times * np.pi / (coarse - 1), 0, np.pi)[:, None]
            p = np.pi * (np.arange(2 * coarse) + 0.5 + (j - 1) / times) / coarse
            d = np.stack(np.broadcast_arrays(np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)), axis=-1)
            mean += sharp(d.reshape(-1, 3)).reshape(one.shape) / times**2
    rows = slice(coarse // 8, -coarse // 8)
    error = abs(np.minimum(one, 3) - np.minimum(mean, 3))[rows].mean()
    jagged = abs(np.minimum(sharp(directions).reshape(one.shape), 3) - np.minimum(mean, 3))[rows].mean()
    assert error < 0.41 * jagged


def test_the_sky_is_brighter_than_the_stone_and_one_side_is_in_the_sun():
    d = upward(np.arange(0.0, 360.0, 2.0), 70.0)
    sky = surroundings.sky(d).mean()
    look = courtyard.environment().lookup
    lit, dim = look(upward(np.arange(150.0, 210.0), 12.0)).mean(), look(upward(np.arange(-30.0, 30.0), 12.0)).mean()
    assert sky > 1.5 * lit > 3 * dim
    assert look(surroundings.SUN).min() > 8 * sky


# The floor and its continuation


def light_from_above(n: int = 700) -> np.ndarray:
    """∫ L cos θ dω / π over the upper half of the panorama, by the midpoint rule; [3]."""
    theta, phi = 0.5 * np.pi * (np.arange(n) + 0.5) / n, np.pi * (np.arange(2 * n) + 0.5) / n
    total = np.zeros(3)
    for t in theta:
        d = np.column_stack([np.sin(t) * np.cos(phi), np.sin(t) * np.sin(phi), np.full(2 * n, np.cos(t))])
        total += courtyard.environment().lookup(d).mean(axis=0) * np.sin(t) * np.cos(t)
    return total * 2 * np.pi * 0.5 * np.pi / n / np.pi


def test_the_grounds_light_is_what_the_upper_half_sends():
    assert np.allclose(light_from_above(), LIGHT, rtol=2e-3)


@pytest.fixture(scope="module")
def open_floor() -> Scene:
    """The floor alone in the courtyard, baked."""
    scene = Scene("open", (courtyard.floor(),), (), None, 1, environment=courtyard.environment())  # type: ignore[arg-type]  # baked, never seen: no camera
    return bake(scene, spp=256, max_depth=3)


def test_the_open_floor_has_the_light_of_the_panoramas_ground(open_floor):
    mesh = open_floor.objects[0].mesh
    ratio = mesh.radiance / (mesh.albedo * LIGHT)
    assert ratio.min() > 0.95
    assert ratio.max() < 1.05


def squares() -> tuple[np.ndarray, np.ndarray]:
    """Middles of the floor's squares, float64 [N, 3], and whether they are white, bool [N]."""
    mesh = courtyard.floor().mesh
    middle = np.add(np.floor(mesh.vertices[mesh.faces].mean(axis=1) / SQUARE), [0.5, 0.5, 0]) * SQUARE * [1, 1, 0]
    return middle, (mesh.albedo[mesh.faces[:, 0]] == WHITE).all(axis=1)


def test_the_floor_is_a_checker_of_exact_colours_with_one_white_square_from_the_origin():
    floor = courtyard.floor().mesh
    colours = floor.albedo[floor.faces]
    assert (colours == colours[:, :1]).all()
    assert {tuple(c) for c in colours[:, 0].tolist()} == {WHITE, BLACK}
    middle, white = squares()
    assert (white == (np.floor(middle / SQUARE)[:, :2].sum(axis=1) % 2 == 0)).all()
    area = 0.5 * np.linalg.norm(np.cross(*(np.diff(floor.vertices[floor.faces], axis=1).swapaxes(0, 1))), axis=1)
    assert area.sum() == pytest.approx(SIDE**2)
    assert (floor.vertices[:, 2] == 0).all()
    assert (floor.normals == [0, 0, 1]).all()
    assert len(np.unique(np.sort(middle[:, :2] @ [1.0, 1e3]).round(6))) == round(SIDE / SQUARE) ** 2


def test_the_panorama_shows_the_floors_squares_where_they_are(open_floor):
    middle, white = squares()
    near = np.hypot(middle[:, 0], middle[:, 1]) < 0.8
    seen = courtyard.environment().lookup(middle[near] - CENTRE)
    expected = np.where(white[near, None], WHITE, BLACK) * np.array(LIGHT)
    assert np.allclose(seen, expected, rtol=0.05)


def test_the_checker_goes_on_beyond_the_border_in_step_and_in_light(open_floor):
    # The squares of the row just beyond the border: same phase, and the same light as the row just within.
    k = np.arange(-12, 12)
    along, beyond = (k + 0.5) * SQUARE, 0.5 * SIDE + 0.5 * SQUARE
    mesh = open_floor.objects[0].mesh
    last = round(0.5 * SIDE / SQUARE)
    for axis in (0, 1):
        for sign in (-1, 1):
            points = np.zeros((len(k), 3))
            points[:, axis], points[:, 1 - axis] = sign * beyond, along
            seen = courtyard.environment().lookup(points - CENTRE)
            other = last if sign > 0 else -last - 1
            white = (k + other) % 2 == 0
            assert seen[white].mean() > 1.2 * seen[~white].mean()
            border = (abs(mesh.vertices[:, axis] - sign * 0.5 * SIDE) < 1e-9) & (abs(mesh.vertices[:, 1 - axis]) < 12 * SQUARE)
            assert np.allclose(seen.mean(axis=0), mesh.radiance[border].mean(axis=0), rtol=0.05), (axis, sign)


@pytest.mark.parametrize("name", ["teapots", "spheres"])
def test_mirrors_do_not_change_the_light_at_the_border(name):
    from scenes.spheres import spheres
    from scenes.teapots import teapots

    scene = bake({"teapots": teapots, "spheres": spheres}[name](), spp=64, max_depth=4)
    mesh = scene.objects[0].mesh
    border = abs(mesh.vertices[:, :2]).max(axis=1) > 0.5 * SIDE - 1e-9
    ratio = mesh.radiance[border] / (mesh.albedo[border] * LIGHT)
    assert abs(ratio.mean(axis=0) - 1).max() < 0.05
    # Nor do they darken it much between them.
    assert np.quantile(mesh.radiance / (mesh.albedo * LIGHT), 0.02) > 0.3
