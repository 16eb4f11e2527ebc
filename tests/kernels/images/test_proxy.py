"""Where rays leave spheres and boxes, weights of maps at regular places, and boxes around rooms, against float64."""

from __future__ import annotations

from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from oracles.proxy_oracle import leaves_box, leaves_sphere, shares, turned
from support.mirror_room import mirror_ball, plain, scene, still, walls
from support.small_room import box, sphere

from benchharness.kernels.images import probegrid, proxy, roombox
from benchharness.render.normalisation import normalised
from benchharness.scene import Mesh, Object

RNG = np.random.default_rng(7)
FRAME = turned(np.array([1.0, 2.0, -1.5]), 50.0)


def vectors(rows):
    return mi.Vector3f(np.ascontiguousarray(np.asarray(rows, np.float32).T))


def points(rows):
    return mi.Point3f(np.ascontiguousarray(np.asarray(rows, np.float32).T))


def unit(rows):
    return rows / np.linalg.norm(rows, axis=-1, keepdims=True)


def reached(one, p, r, centre=(0.0, 0.0, 0.0)) -> np.ndarray:
    return np.array(proxy.reach(one, points(p), vectors(r), mi.Point3f(centre)))


def boxed(centre, half, axes=None) -> proxy.Box:
    return roombox.HostBox(np.eye(3) if axes is None else axes, np.asarray(centre, float), np.asarray(half, float)).uploaded()


# Where a ray leaves


def test_a_ray_leaves_a_sphere_at_the_larger_root_from_inside_and_outside_and_never_what_it_misses():
    p, r = 3 * RNG.normal(size=(400, 3)), unit(RNG.normal(size=(400, 3)))
    centre = np.array([0.4, -1.0, 2.0])
    expected = np.array([leaves_sphere(a - centre, b, 2.5) for a, b in zip(p, r, strict=True)])
    found = reached(proxy.Sphere(mi.Float(2.5)), p, r, centre)
    inside = np.linalg.norm(p - centre, axis=1) < 2.5
    assert inside.sum() > 30 and np.isinf(expected).sum() > 100 and np.isfinite(expected[~inside]).sum() > 20
    np.testing.assert_allclose(found, expected, rtol=2e-4)


def test_a_ray_leaves_a_turned_and_shifted_box_of_unlike_sides_through_its_first_side_in_world_lengths():
    centre, half = np.array([3.0, -2.0, 1.0]), np.array([4.0, 1.5, 0.8])
    p = centre + (RNG.uniform(-1.3, 1.3, size=(400, 3)) * half) @ FRAME
    r = unit(RNG.normal(size=(400, 3)))
    expected = np.array([leaves_box(a, b, FRAME, centre, half) for a, b in zip(p, r, strict=True)])
    found = reached(boxed(centre, half, FRAME), p, r, (9.0, 9.0, 9.0))  # wherever the map's centre is
    inside = (np.abs((p - centre) @ FRAME.T) < half).all(axis=1)
    assert inside.sum() > 100 and np.isinf(expected).sum() > 50 and np.isfinite(expected[~inside]).sum() > 50
    np.testing.assert_allclose(found, expected, rtol=2e-4)


def test_corners_are_the_middle_and_half_the_sides_away():
    """Sides 200, 100, 100 about (0, -50, 0): y goes from -100 to 0. With (size - position) / 2 it would end at 75."""
    (up,) = reached(boxed((0, -50, 0), (100, 50, 50)), [(10.0, -30.0, 5.0)], [(0.0, 1.0, 0.0)])
    assert up == pytest.approx(30.0)  # at y = 0


def test_the_direction_is_turned_into_the_box_as_the_point_is():
    """A corridor 20 by 2 turned by 90 degrees: along y there are 10 to its end, across it 1. Unturned directions swap them."""
    made = scene((walls(),), (mirror_ball(),))
    corridor = roombox.given((0, 0, 0, 20, 2, 2, 90), made).uploaded()
    found = reached(corridor, [(0.0, 0.0, 0.0)] * 2, [(0.0, 1.0, 0.0), (1.0, 0.0, 0.0)])
    np.testing.assert_allclose(found, [10, 1], rtol=1e-5)


def test_rays_along_sides_and_in_them_are_no_numbers_gone_wrong():
    half = (1.0, 2.0, 3.0)
    rays = [
        ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 1.0),  # two zeros
        ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), 2.0),  # in a side, where 0 * inf would be no number
        ((-1.0, 2.0, 0.0), (0.0, 0.0, -1.0), 3.0),  # in an edge
        ((1.5, 0.0, 0.0), (0.0, 1.0, 0.0), np.inf),  # beside a side
        ((1.5, 0.0, 0.0), (-0.0, 0.0, 1.0), np.inf),
        ((1.0, 0.0, 0.0), (1.0, 0.0, 0.0), np.inf),  # off a side, outwards: it has left
    ]
    p, r, expected = (np.array(column) for column in zip(*rays, strict=True))
    np.testing.assert_array_equal(reached(boxed((0, 0, 0), half), p, r), expected)


def test_what_never_leaves_a_proxy_is_looked_up_by_direction_alone():
    x, r = np.array([[5.0, 0.0, 0.0], [0.5, 0.2, 0.0]]), np.array([[0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    t = reached(proxy.Sphere(mi.Float(2.0)), x, r)
    d = np.array(proxy.towards(vectors(x), vectors(r), mi.Float(t))).T
    np.testing.assert_allclose(d[0], r[0], rtol=1e-6)
    np.testing.assert_allclose(d[1], (x[1] + t[1] * r[1]) / 2.0, rtol=1e-5)


# Weights


def device_grid(middles, extent, blend) -> probegrid.Grid:
    packed = np.column_stack([middles, np.zeros(len(middles))]).astype(np.float32).ravel()
    return probegrid.Grid(
        boxed((0, 0, 0), (1, 1, 1)),
        mi.Float(packed),
        mi.Float(packed),
        mi.Vector3f(extent),
        mi.Vector3f(blend),
        len(middles),
        0,
    )


@pytest.mark.parametrize("blend", [(0.4, 0.4, 0.4), (0.3, 5.0, 0.0)])
def test_weights_fall_off_along_each_axis_and_their_sum_is_that_of_the_maps_in_any_order(blend):
    """5 is more than the influence itself, over which it then falls off; 0 is a hard border."""
    middles, extent = RNG.uniform(-1, 1, size=(6, 3)), np.array([0.8, 1.0, 1.2])
    p = RNG.uniform(-1.5, 1.5, size=(300, 3))
    one = [np.array(probegrid.weight(vectors(p - m), mi.Vector3f(extent), mi.Vector3f(blend))) for m in middles]
    scale = np.maximum(np.sum(one, axis=0), 1)
    expected = [shares(a, middles, extent, np.maximum(blend, 1e-9)) for a in p]
    np.testing.assert_allclose(np.array(one) / scale, np.array([w for w, _ in expected]).T, atol=2e-5)
    assert 0.1 < np.mean([left > 0.01 for _, left in expected]) < 0.95
    for order in (slice(None), slice(None, None, -1)):
        found = np.array(probegrid.total_weight(device_grid(middles[order], extent, blend), points(p), mi.Bool(True)))
        np.testing.assert_allclose(found, np.sum(one, axis=0), rtol=1e-4, atol=1e-5)


def test_within_the_room_maps_have_all_the_weight_and_the_environment_none():
    made = scene((walls(),), (mirror_ball(),))
    for per_axis in (1, 2, 3):
        grid, places = probegrid.planned(made, per_axis, 0.5)
        p = RNG.uniform(-1.999, 1.999, size=(500, 3))
        total = np.array(probegrid.total_weight(grid, points(p), dr.full(mi.Bool, True, 500)))
        assert len(places) == per_axis**3 and (total > 0.999).all()
        outside = np.array(probegrid.total_weight(grid, points(p + np.array([9.0, 0, 0])), dr.full(mi.Bool, True, 500)))
        assert not outside.any()


# Boxes around rooms, and places in them


def moved(mesh: Mesh, axes: np.ndarray, at) -> Mesh:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = axes.T, at
    return mesh.transformed(pose)


@pytest.mark.parametrize("axes", [np.eye(3), turned(np.array([0.0, 0.0, 1.0]), 33.0), FRAME], ids=["straight", "yaw", "any"])
def test_the_box_of_a_room_is_turned_as_the_room_is(axes):
    at, half = np.array([5.0, -3.0, 2.0]), np.array([4.0, 2.0, 1.25])
    room = moved(box(-half, half, inside=True), axes, at)
    furniture = moved(box((-0.6, -0.6, -0.6), (0.6, 0.6, 0.2)), turned(np.array([0.0, 0.0, 1.0]), 20.0), at)
    found = roombox.around([(room.vertices, room.faces), (furniture.vertices, furniture.faces)])
    np.testing.assert_allclose(found.centre, at, atol=1e-9)
    np.testing.assert_allclose(np.sort(found.half), np.sort(half), rtol=1e-9)
    corners = found.centre + (np.array([[1, 1, 1]]) * found.half) @ found.axes
    assert np.linalg.norm(room.vertices - corners, axis=1).min() < 1e-9


def test_a_box_without_walls_and_a_flat_one_have_sides():
    ball = sphere(1.0, (3, 0, 0))
    np.testing.assert_allclose(roombox.around([(ball.vertices, ball.faces)]).half, 1.0, rtol=0.02)
    flat = roombox.around([(np.array([[0, 0, 0], [4, 0, 0], [4, 1, 0], [0, 1, 0.0]]), np.array([[0, 1, 2], [0, 2, 3]]))])
    assert (np.sort(flat.half) > 0).all() and flat.half.max() == pytest.approx(2.0)


def test_a_box_that_is_given_in_metres_is_the_same_box_of_a_scene_that_was_moved_and_scaled():
    at, half = np.array([5.0, -3.0, 2.0]), np.array([4.0, 2.0, 1.25])
    room = plain(moved(box(-half, half, inside=True), turned(np.array([0.0, 0.0, 1.0]), 33.0), at), (0.5, 0.5, 0.5))
    made = normalised(scene((Object("room", room, "walls"),), (mirror_ball(center=(4.0, -2.0, 2.0)),), still()))
    assert made.unit != 1
    (fitted,), given = roombox.around_mirrors(made), roombox.given((*at, *(2 * half), 33.0), made)
    np.testing.assert_allclose(given.centre, fitted.centre, rtol=1e-9)
    np.testing.assert_allclose(np.sort(given.half), np.sort(fitted.half), rtol=1e-9)
    overlap = given.joined(fitted)
    np.testing.assert_allclose(overlap.half, given.half, rtol=1e-9)


def test_places_within_closed_objects_are_left_out_and_those_in_rooms_and_behind_sheets_are_not():
    cube, sheet = box((0.5, 0.5, 0.5), (1.5, 1.5, 1.5)), box((-1.5, -1.5, -1.5), (-0.5, -0.5, -0.5))
    sheet = Mesh(sheet.vertices, sheet.faces[:-2])
    made = scene(
        (walls(), *(Object(n, plain(m, (1, 0, 0)), n) for n, m in (("cube", cube), ("open", sheet)))), (mirror_ball(),)
    )
    grid, places = probegrid.planned(made, 2, 0.5)
    assert len(places) == grid.count == 7 and not (places > 0).all(axis=1).any()
    everywhere = replace(made, objects=(walls(), Object("all", plain(box((-1.9,) * 3, (1.9,) * 3), (1, 0, 0)), "all")))
    grid, places = probegrid.planned(everywhere, 2, 0.5)
    np.testing.assert_allclose(places, 0, atol=1e-9)
    assert not np.array(probegrid.total_weight(grid, mi.Point3f(0.1, 0, 0), mi.Bool(True))).any()


def test_the_box_of_a_mirror_does_not_depend_on_how_it_is_numbered_and_lies_in_a_leaning_sheet():
    """A ball is as wide in all directions, a square in two: there the coordinate axes are next."""
    u = unit(np.array([1.0, 0.3, 0.2]))
    v = unit(np.cross([0.2, -0.4, 1.0], u))
    leaning = Mesh(np.array([a * u + b * v for a in (-1, 1) for b in (-1, 1)]), [[0, 2, 3], [0, 3, 1]])
    ball = sphere(0.7, (0.2, 0.1, -0.3))
    assert np.abs(roombox.settled(ball.vertices, ball.faces).axes).max(axis=1) == pytest.approx(1.0)
    found = roombox.settled(leaning.vertices, leaning.faces)
    assert found.half.min() == pytest.approx(1e-3 * found.half.max()) and np.ptp(found.half) < 1.5
    assert abs(found.axes[found.half.argmin()] @ np.cross(u, v)) == pytest.approx(1.0)
    for mesh in (ball, leaning):
        order = RNG.permutation(len(mesh.vertices))
        other = roombox.settled(mesh.vertices[order], np.argsort(order)[mesh.faces])
        own = roombox.settled(mesh.vertices, mesh.faces)
        np.testing.assert_allclose(np.abs(own.axes @ other.axes.T), np.eye(3), atol=1e-6)
