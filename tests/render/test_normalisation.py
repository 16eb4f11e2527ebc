"""Nothing that a picture shows depends on how large a scene is, or where it stands."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest
from oracles.room_oracle import EYE, picture, room
from support.tiers import complete, exhaustive

from benchharness.measure import metrics
from benchharness.measure.bench import Bench
from benchharness.render import reference
from benchharness.render.bake import bake
from benchharness.render.normalisation import HALF, normalised
from benchharness.render.reference import ReferenceOptions
from benchharness.scene import PointLight
from benchharness.study import plugins

SIZE = (160, 120)
PLACES = [
    (1e-3, (0, 0, 0)),
    (1e-3, (100.0, 0, 0)),
    (1e-2, (-3e4, 1e5, 7.0)),
    (1.0, (1e5, -1e5, 1e4)),
    (30.0, (0, 500.0, 0)),
    (1e3, (0, 0, 0)),
]
METHODS = [name for name, plugin in plugins.discover("method").items() if plugin.error is None]


@functools.cache
def bench(scale: float, at) -> Bench:
    return Bench(room(scale, at), SIZE, ReferenceOptions(spp=2), None, 0, (1, 1))


@functools.cache
def shown(name: str, scale: float = 1.0, at=(0, 0, 0)) -> dict | None:
    """A method's record; None if it refuses the scene, as those of flat mirrors do."""
    method = plugins.discover("method")[name].target()
    return None if method.refuses(room(scale, at)) is not None else bench(scale, at).show(0, name, method)[0]


@pytest.mark.parametrize(("scale", "at"), [(1.0, (0, 0, 0)), *PLACES])
def test_the_reference_is_the_truth_at_every_scale_and_place(scale, at):
    # Facets lie up to 1.4e-4 radii below the ball; a few pixels of the outline belong to it or not. Rays leave the ball some
    # 2e-4 radii above it. Both move what is seen by as much, and radiance by 3e-5, of which FLIP's exponent of 0.7 makes .003.
    truth, mask = picture(SIZE)
    made = reference.render(room(scale, at), 0.0, SIZE, ReferenceOptions(spp=2))
    assert (made.mask ^ mask).sum() <= 12
    both = mask & made.mask
    error = metrics.flip_map(made.image, truth.astype(np.float32), both, ppd=67.0, exposure=0.0)
    assert error[both].mean() < 0.004
    assert np.nanmax(made.distance) < 8 * scale  # in the author's metres, no longer than the room's diagonal


@pytest.mark.parametrize(
    ("scale", "at", "names"),
    [
        (*PLACES[1], METHODS),
        *(pytest.param(*place, METHODS[k % 3 :: 3], marks=exhaustive) for k, place in enumerate(PLACES) if k != 1),
        *(pytest.param(*place, METHODS, marks=(exhaustive, complete)) for k, place in enumerate(PLACES) if k != 1),
    ],
)
def test_every_method_errs_as_it_does_at_the_origin(scale, at, names):
    """At one place every method. At others, which are brought to the same scene, they take turns but in all of the tests."""
    # float64 leaves 1e-11 of the mirror's size at 1e5 m, float32 rounds otherwise then: some hundredths of errors near .001.
    for name in names:
        record, base = shown(name, scale, at), shown(name)
        if record is None or base is None:
            assert record is base
            continue
        assert record["status"] == "ok"
        assert record["flip"] == pytest.approx(base["flip"], rel=0.1, abs=2e-4), name
        assert record["reflector_px"] == base["reflector_px"]
        assert record["mask_diff_px"] <= 2


def test_the_smallest_mirror_is_some_units_in_size_and_the_origin_amid_the_mirrors():
    given = room(0.01, (30.0, 40.0, 50.0))
    made = normalised(given)
    assert made.size == pytest.approx(HALF)
    middle = 0.5 * (made.reflectors[0].mesh.vertices.min(axis=0) + made.reflectors[0].mesh.vertices.max(axis=0))
    assert np.abs(middle).max() < 1e-9 * HALF
    assert made.origin == pytest.approx((30.0, 40.0, 50.0))
    assert np.asarray(made.camera(0.0).eye) * made.unit + made.origin == pytest.approx(0.01 * EYE + [30.0, 40.0, 50.0])
    assert normalised(made) is made


def test_the_camera_and_what_moves_go_along():
    def motion(time):
        pose = np.eye(4)
        pose[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
        pose[:3, 3] = [5.0 + time, 2.0, 0.0]
        return pose

    given = room(3.0, (100.0, 0.0, 0.0))
    moving = replace(given, objects=tuple(replace(o, motion=motion) for o in given.objects), frames=5)
    made = normalised(moving)
    for time in (0.0, 0.1):
        before = moving.objects[0].mesh.transformed(moving.objects[0].pose(time)).vertices
        after = made.objects[0].mesh.transformed(made.objects[0].pose(time)).vertices
        assert after * made.unit + made.origin == pytest.approx(before, abs=1e-9)


def test_a_point_light_lights_as_it_did():
    # E = I / d²: lengths by 1 / s and intensities by 1 / s² leave it.
    light = PointLight((0.0, -1.0, 1.0), (4.0, 4.0, 4.0))
    given = replace(room(), lights=(light,))
    made = normalised(given)
    p = np.array([0.3, 0.2, -2.0])
    before = np.asarray(light.intensity) / np.sum((np.asarray(light.position) - p) ** 2)
    q = (p - made.origin) / made.unit
    moved = made.lights[0]
    assert np.asarray(moved.intensity) / np.sum((np.asarray(moved.position) - q) ** 2) == pytest.approx(before)


def test_what_is_baked_does_not_depend_on_size_or_place():
    def lit(scale, at):
        scene = room(scale, at, h=1.0)
        walls = scene.objects[0].mesh
        up = (walls.vertices[:, 2] - at[2]) > 1.9 * scale
        plain = replace(walls, radiance=None, emission=np.where(up[:, None], 2.0, 0.0) * np.ones(3))
        return bake(replace(scene, objects=(replace(scene.objects[0], mesh=plain),)), spp=16).objects[0].mesh.radiance

    base = lit(1.0, (0.0, 0.0, 0.0))
    assert lit(1e-3, (50.0, 0.0, 0.0)) == pytest.approx(base, abs=2e-3)
    assert lit(1e3, (0.0, -1e5, 0.0)) == pytest.approx(base, abs=2e-3)


def test_without_mirrors_the_objects_are_what_is_brought_near():
    made = normalised(replace(room(1e-3, (1e3, 0, 0)), reflectors=()))
    assert np.abs(made.objects[0].mesh.vertices).max() < 2 * HALF


def test_parts_that_move_as_one_go_on_moving_as_one():
    def motion(time):
        pose = np.eye(4)
        pose[0, 3] = time
        return pose

    given = room()
    made = normalised(
        replace(
            given,
            objects=tuple(replace(o, motion=motion) for o in given.objects),
            reflectors=tuple(replace(r, motion=motion) for r in given.reflectors),
        )
    )
    assert made.objects[0].motion is made.reflectors[0].motion is not None
