"""Baked light against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.small_room import box, quad, sphere

from benchharness.modelling.winding import closed_faces
from benchharness.render import bake as bake_module
from benchharness.render.bake import bake
from benchharness.scene import Camera, Mesh, Object, Reflector, Scene, merged, subdivided


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("BENCHHARNESS_CACHE", str(tmp_path))


def scene(*meshes: Mesh, reflectors: tuple[Reflector, ...] = (), background=(0.0, 0.0, 0.0)) -> Scene:
    return Scene(
        name="closed form",
        objects=tuple(Object(f"object {i}", mesh, shows="light") for i, mesh in enumerate(meshes)),
        reflectors=reflectors,
        camera=lambda time: Camera((0, -5, 0), (0, 0, 0), 30.0),
        frames=1,
        background=background,
    )


def baked(what: Scene, number: int = 0, **options) -> np.ndarray:
    return bake(what, **options).objects[number].mesh.radiance


def test_a_plane_under_a_uniform_sky_sends_back_albedo_times_the_sky() -> None:
    # E = pi L, so albedo E / pi = albedo L, at every vertex, the corners included.
    floor = subdivided(quad((0, 0, 0), (1, 0, 0), (0, 1, 0), albedo=(0.2, 0.5, 1.0)), 0.5)
    radiance = baked(scene(floor, background=(3.0, 2.0, 0.5)), spp=256)
    # Two weighted estimates of a constant, 256 paths each: within 2 %.
    np.testing.assert_allclose(radiance, np.tile([0.6, 1.0, 0.5], (len(radiance), 1)), rtol=0.02)


def test_a_convex_mesh_with_smooth_normals_keeps_the_energy_of_a_uniform_sky() -> None:
    # Coarse enough that about 2 % of the cosine lobe about a vertex normal lies below the faces.
    ball = sphere(slices=8, stacks=4, albedo=0.5 * np.ones(3))
    radiance = baked(scene(ball, background=(1, 1, 1)), spp=1024)
    np.testing.assert_allclose(radiance[np.unique(ball.faces)], 0.5, rtol=0.01)


def test_a_furnace_ends_at_the_geometric_series() -> None:
    # Closed box, emission e, albedo a: L = e + a L = e / (1 - a) everywhere. 0.5^24 is what a depth of 24 leaves out.
    room = subdivided(box((0, 0, 0), (1, 1, 1), inside=True, albedo=(0.5, 0.25, 0.0), emission=(1.0, 2.0, 3.0)), 0.75)
    radiance = baked(scene(room), spp=256, max_depth=24)
    np.testing.assert_allclose(radiance.mean(axis=0), [2.0, 8 / 3, 3.0], rtol=0.01)
    np.testing.assert_allclose(radiance, np.tile([2.0, 8 / 3, 3.0], (len(radiance), 1)), rtol=0.05)


def test_depth_counts_segments_from_the_vertex() -> None:
    # One segment sees the emission of the walls alone: e + a e.
    room = box((0, 0, 0), (1, 1, 1), inside=True, albedo=0.5 * np.ones(3), emission=(1.0, 1.0, 1.0))
    np.testing.assert_allclose(baked(scene(room), spp=256, max_depth=1), 1.5, rtol=0.03)


def test_without_light_all_is_black() -> None:
    assert (baked(scene(quad((0, 0, 0), (1, 0, 0), (0, 1, 0))), spp=4) == 0).all()


@pytest.mark.parametrize("varies", [False, True], ids=["constant", "varying"])
def test_a_sphere_light_has_its_form_factor(varies: bool) -> None:
    # A sphere of radius r and radiance L at height h over a vertex: E = pi L (r / h)², times the area that a polygon
    # of 32 corners has of its circle, 0.9936. The tiny patch makes the mean over the hat that of its centre. Emission
    # that varies by a millionth has to be found by chance.
    r, h = 0.5, 2.0
    light = sphere(r, (0, 0, h), slices=32, stacks=16, albedo=np.zeros(3))
    emission = np.full((len(light.vertices), 3), 8.0)
    emission[:, 0] += 1e-6 * np.arange(len(emission)) if varies else 0
    patch = quad((-0.01, -0.01, 0), (0.02, 0, 0), (0, 0.02, 0), albedo=(0.5, 0.5, 0.5))
    radiance = baked(scene(patch, replace(light, emission=emission)), spp=2048)
    # Found by chance, 6 % of 2048 paths count: 1 / sqrt(128) = 9 %, less for Sobol' points.
    np.testing.assert_allclose(radiance[:, 1], 0.9936 * 0.5 * 8 * (r / h) ** 2, rtol=0.05 if varies else 0.005)


def test_an_ideal_mirror_shows_as_much_sky_as_it_hides() -> None:
    # A wall-sized mirror beside the patch takes half of the sky away and shows it the other half: E stays pi L.
    wall = Reflector("wall", quad((0, -500, -1e-3), (0, 1000, 0), (0, 0, 500)))
    patch = quad((0.01, 0, 0), (0.01, 0, 0), (0, 0.01, 0), albedo=(1, 1, 1))
    ideal = scene(patch, reflectors=(wall,), background=(1, 1, 1))
    np.testing.assert_allclose(baked(ideal, spp=1024), 1.0, rtol=0.03)


def test_floor_under_a_box_does_not_darken_what_is_seen_beside_it() -> None:
    # A foot as thin as a sheet covers some vertices and cuts through others' faces; uniform sky. Points below the
    # foot are not counted, and a vertex wholly below it takes its neighbours' light.
    floor = subdivided(quad((-2, -2, 0), (4, 0, 0), (0, 4, 0), albedo=(0.5, 0.5, 0.5)), 0.6)
    foot = box((-0.8, -0.8, 0), (0.8, 0.8, 1e-3), albedo=np.zeros(3))
    radiance = baked(scene(floor, foot, background=(1, 1, 1)), spp=1024)
    assert (np.abs(floor.vertices[:, :2]).max(axis=1) < 0.3).any()
    # Few points count for a vertex that is almost covered.
    np.testing.assert_allclose(radiance, 0.5, rtol=0.1)
    assert radiance.mean() == pytest.approx(0.5, rel=0.005)


def test_watertight_pieces_are_told_from_sheets() -> None:
    both = merged(box((0, 0, 0), (1, 1, 1)), quad((5, 0, 0), (1, 0, 0), (0, 1, 0)))
    assert closed_faces(both).tolist() == [True] * 12 + [False] * 2
    assert closed_faces(sphere(slices=8, stacks=4)).all()


def test_the_object_is_lit_where_it_stands_at_time_0() -> None:
    # The only light is above x = 10, where the patch's pose takes it.
    light = quad((9, -1, 1), (0, 2, 0), (2, 0, 0), emission=(5, 5, 5))
    patch = quad((-0.1, -0.1, 0), (0.2, 0, 0), (0, 0.2, 0))
    there = np.eye(4)
    there[0, 3] = 10
    still, moved = scene(patch, light), scene(patch, light)
    moved = replace(moved, objects=(replace(moved.objects[0], motion=lambda time: there), moved.objects[1]))
    assert baked(moved, spp=64).mean() > 20 * baked(still, spp=64).mean()


def test_a_cached_result_is_identical_and_the_seed_counts(monkeypatch) -> None:
    room = scene(box((0, 0, 0), (1, 1, 1), inside=True, emission=(1, 1, 1)))
    first = baked(room, spp=16)
    other = baked(room, spp=16, seed=1)
    monkeypatch.setattr(bake_module, "_light", lambda *_: pytest.fail("not cached"))
    assert np.array_equal(baked(room, spp=16), first)
    assert not np.array_equal(other, first)


def test_the_same_seed_gives_the_same_bits(tmp_path, monkeypatch) -> None:
    room = scene(box((0, 0, 0), (1, 1, 1), inside=True, emission=(1, 1, 1)))
    first = baked(room, spp=16)
    monkeypatch.setenv("BENCHHARNESS_CACHE", str(tmp_path / "other"))
    assert np.array_equal(baked(room, spp=16), first)


def test_reflectors_get_radiance_0() -> None:
    mirror = Reflector("mirror", quad((0, 0, 1), (1, 0, 0), (0, 1, 0)))
    done = bake(scene(quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), reflectors=(mirror,), background=(1, 1, 1)), spp=4)
    assert (done.reflectors[0].mesh.radiance == 0).all()


@pytest.mark.parametrize(("name", "value"), [("spp", 0), ("max_depth", 0), ("seed", -1), ("spp", 1.5)])
def test_options_that_mean_nothing_are_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{name} is {value}"):
        bake(scene(quad((0, 0, 0), (1, 0, 0), (0, 1, 0))), **{name: value})
