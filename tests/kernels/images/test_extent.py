"""How large parts are seen in mirrors: against what ray tracing shows, and by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.distance import pdist
from support.board_scenes import SKY, one, sheet
from support.mirror_room import ball, mirror_ball, scene, still
from support.small_room import box, sphere

from benchharness.kernels.eye import Eye, eye_of
from benchharness.kernels.images import extent, impostor, roles
from benchharness.scene import Mesh, Object, Reflector
from methods.ray_traced import RayTraced

SIZE = (320, 240)
FOCAL = 0.5 * SIZE[1] / np.tan(np.radians(22.5))


def red(at, radius=0.1) -> Object:
    return Object("red", ball(radius, at, (0.9, 0.1, 0.1), 4), "has a size")


def estimated(made, eye=None, again=False) -> np.ndarray:
    """Of all slots, in the first frame; `eye`: instead of that frame's."""
    plan = roles.plan(made)
    looks = eye_of(one(RayTraced(), made, SIZE).frame) if eye is None else eye
    curvatures = np.array([extent.least_curvature(r.mesh) for r in made.reflectors])
    spheres = extent.Spheres(plan.centroids, plan.radii)
    return extent.pixels(plan, curvatures, spheres, looks, again=again)


def shown(made) -> float:
    """The widest extent of what the mirror shows of the object, pixels."""
    answer = one(RayTraced(), made, SIZE)
    seen = np.argwhere(answer.active & (answer.L[..., 0] > 0.5))
    assert len(seen) > 20
    return float(pdist(seen).max()) + 1


@pytest.mark.parametrize("away", [0.5, 1.5])
def test_in_a_flat_mirror_a_ball_is_as_wide_as_from_behind_it(away):
    """The mirror's sphere reaches to the eye and to the ball: the nearest of it is no farther than 0, so the estimate is high.
    With a mirror of no extent, it is that of a ball at the length of the way."""
    eye, middle = np.array([0.0, -2.0, 0.0]), np.array([0.3, 1.0 - away, 0.2])
    made = scene((red(middle),), (sheet(),), still(tuple(eye), (0.1, 1.0, 0.0)), background=SKY)
    assert estimated(made).max() >= shown(made)

    small = scene((red(middle),), (sheet(1e-6),), still(tuple(eye), (0.0, 1.0, 0.0)), background=SKY)
    plan = roles.plan(small)
    tiny = replace(plan, shapes=[plan.shapes[0], replace(plan.shapes[1], radius=1e-9)])
    looks = Eye(eye, np.array([0.0, 1.0, 0.0]), FOCAL, np.array([True]))
    wide = extent.pixels(tiny, np.zeros(1), extent.Spheres(tiny.centroids, tiny.radii), looks, again=False)
    way = 3.0 + np.linalg.norm(middle - (0.0, 1.0, 0.0)) - 0.1
    assert wide[plan.owners >= 0] == pytest.approx(FOCAL * 0.2 / np.cos(0.5 * impostor.FIELD) / way, rel=1e-3)


@pytest.mark.parametrize("at", [(0.55, -0.75, 0.1), (-0.3, -1.4, 0.2), (1.2, -0.1, 0.0), (-0.9, -0.9, 0.4)])
def test_in_a_ball_the_estimate_is_above_what_is_seen_and_less_than_two_and_a_half_times_as_large(at):
    """What is left: the nearest of the way counts for all of it, and the size asked for is rounded up besides."""
    made = scene((red(at),), (mirror_ball(),), still((0.2, -1.9, 0.6)), background=SKY)
    (wide,) = estimated(made)
    assert shown(made) <= wide <= 2.5 * shown(made)


def test_what_is_out_of_the_picture_is_seen_by_nobody_but_another_mirror():
    eye = Eye(np.array([0.0, -3.0, 0.0]), np.array([0.0, 1.0, 0.0]), FOCAL, np.array([True, False]))
    mirrors = (mirror_ball("one", (-0.6, 0, 0), 0.3), mirror_ball("two", (0.6, 0, 0), 0.3))
    made = scene((red((0.0, -1.0, 0.3)),), mirrors, background=SKY)
    plan = roles.plan(made)
    of_two = plan.owners == 2
    objects = of_two & (plan.parts == 0)
    alone, again = (estimated(made, eye, again=twice) for twice in (False, True))
    assert (alone[of_two] == 0).all() and (alone[~of_two] > 1).all()
    assert (again[objects] > 0).all() and (again[of_two & ~objects] == 0).all()
    both = estimated(made, replace(eye, visible=np.array([True, True])), again=True)
    assert (again[objects] < 0.5 * both[objects]).all()  # the way by the other ball is longer, and that spreads light
    np.testing.assert_array_equal(again[~of_two], alone[~of_two])


def test_the_least_curvature_of_a_ball_is_its_own_and_what_is_flat_or_hollow_has_none():
    made = sphere(0.25, (1.0, 2.0, 3.0))
    assert extent.least_curvature(made) == pytest.approx(4.0, rel=0.01)
    long = Mesh(made.vertices * (1, 1, 3), made.faces)
    assert 0 < extent.least_curvature(long) < 1.0
    hollow = Mesh(made.vertices, made.faces[:, ::-1], -made.normals)
    assert extent.least_curvature(hollow) == 0
    assert extent.least_curvature(box((0, 0, 0), (1, 1, 1))) == 0


def test_sizes_are_powers_of_two_and_nothing_is_taken_below_a_pixel():
    wide = np.array([0.0, 0.99, 1.0, 8.0, 8.1, 63.0, 200.0, 1e9])
    none = np.zeros(len(wide), int)
    np.testing.assert_array_equal(extent.sizes(wide, none, 256, 1.0), [0, 0, 8, 8, 16, 64, 256, 256])
    np.testing.assert_array_equal(extent.sizes(wide, none, 64, 2.0), [0, 0, 8, 16, 32, 64, 64, 64])


def test_sizes_grow_at_once_and_shrink_late():
    """128 stays down to more than 32 pixels, of which twice as many ask for 128; nothing is let go below half a pixel."""
    sizes, size = [], np.array([0])
    for wide in (60.0, 65.0, 60.0, 33.0, 32.1, 32.0, 31.9, 60.0, 65.0, 8.2, 4.1, 0.9, 0.9, 1.0, 0.9, 0.4):
        size = extent.sizes(np.array([wide]), size, 256, 1.0)
        sizes.append(int(size[0]))
    assert sizes == [64, 128, 128, 128, 128, 32, 32, 64, 128, 16, 16, 0, 0, 8, 8, 0]


def test_every_mirror_of_a_frame_is_looked_for_in_the_picture():
    beside = Reflector("beside", sphere(0.2, (6.0, 0.0, 0.0)))
    made = scene((red((0.4, -0.7, 0.0)),), (mirror_ball(), beside), still((0.2, -1.9, 0.6)), background=SKY)
    looks = eye_of(one(RayTraced(), made, SIZE).frame)
    np.testing.assert_array_equal(looks.visible, [True, False])
    np.testing.assert_allclose(looks.place, (0.2, -1.9, 0.6), atol=1e-6)
    assert looks.focal == pytest.approx(FOCAL, rel=1e-5)
