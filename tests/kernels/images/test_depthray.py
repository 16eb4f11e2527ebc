"""Rays against depth maps, by geometry that is known."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from oracles.depth_oracle import BACKGROUND, camera, clipped, first_hit, spheres
from support.depth_objects import built, by_rows, by_texels, comb, device, figure, mirror_ball_rays, seen

from benchharness.kernels.frozen import frozen
from benchharness.kernels.images import depthmap, depthray

BALL = (0.0, 0.0, 3.0, 0.6)


def turned(angles, at):
    """A rigid world-to-camera matrix [3, 4] of a camera at `at`."""
    (a, b), identity = angles, np.eye(3)
    about_y = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
    about_x = np.array([[1, 0, 0], [0, np.cos(b), -np.sin(b)], [0, np.sin(b), np.cos(b)]])
    rotation = about_x @ about_y @ identity
    return np.column_stack([rotation, -rotation @ np.asarray(at)])


def both(cam, depth, o, d, **rows):
    """(name, segment, hit) of either intersector."""
    return [("rows", *by_rows(cam, depth, o, d, **rows)), ("texels", *by_texels(cam, depth, o, d))]


def values(*arrays):
    return [np.array(one) for one in arrays]


def plate(w=128, zgl=0.5, rows=slice(None), columns=slice(None)):
    depth = np.full((w, w), BACKGROUND)
    depth[rows, columns] = zgl
    return depth


def test_oracle_by_hand():
    """A plate at Z = 3: zgl = (1/2 - 1/3) / (1/2 - 1/4) = 2/3; a ray at 45 degrees from (-1, 0, 2) meets it at X = 0."""
    cam = camera(64)
    depth = np.full((64, 64), 2 / 3)
    hit, length = first_hit(depth, cam, np.array([-1.0, 0.01, 2.0]), np.array([1.0, 0.0, 1.0]))
    np.testing.assert_allclose(hit, (31.5, 31.5 + cam.focal * 0.01 / 3, 1.0), atol=1e-9)
    assert clipped(cam, np.array([0, 0, -1.0]), np.array([0, 0, 1.0])) == (3.0, 5.0)
    assert clipped(cam, np.array([0, 0, 1.0]), np.array([1.0, 0, 0])) is None
    # It enters the frustum where X = -0.5 w / focal Z: s - 1 = -(2 + s) / 3, s = 1/4; leaves where Z = 4 but X = 1: s = 2.
    assert length == pytest.approx(
        np.hypot(*(cam.project(np.array([1, 0.01, 4.0])) - cam.project(np.array([-0.75, 0.01, 2.25])))[:2])
    )


def test_clipping_agrees_with_the_oracle_for_any_pose():
    rng = np.random.default_rng(2)
    cams = [camera(128, matrix=turned(rng.uniform(-3, 3, 2), rng.uniform(-1, 1, 3))) for _ in range(4)]
    map = rng.integers(0, 4, 500)
    o = rng.uniform(-4, 4, (500, 3))
    to = np.stack([cams[k].to_world(*rng.uniform(-20, 150, 2), rng.uniform(0, 1)) for k in map])
    d = (to - o) * rng.uniform(0.2, 3, (500, 1))
    segment = seen(cams, o, d, map)
    active, s_a, s_b, t = values(segment.active, segment.s_a, segment.s_b, segment.distance(mi.Float(0.3)))
    a, b, q = (np.array(one).T for one in (segment.a, segment.b, segment.point(mi.Float(0.3))))
    compared = 0
    for k in range(500):
        ends = clipped(cams[map[k]], o[k], d[k])
        if (ends is None) != (not active[k]):
            assert ends is None or ends[1] - ends[0] < 1e-4
            continue
        if ends is None:
            continue
        compared += 1
        np.testing.assert_allclose((s_a[k], s_b[k]), ends, atol=1e-4)
        points = cams[map[k]].project(np.stack([o[k] + s * d[k] for s in (*ends, t[k])]))
        np.testing.assert_allclose(np.stack([a[k], b[k], q[k]]), points, atol=0.02)
    assert compared > 200


def test_distance_is_along_the_ray():
    cam = camera(256)
    depth = spheres(cam, [BALL])
    rng = np.random.default_rng(1)
    o = np.array([0.2, 0.1, 0.0]) + rng.uniform(-0.2, 0.2, (200, 3))
    d = np.array([0, 0, 3.0]) + rng.uniform(-0.4, 0.4, (200, 3)) - o
    b, c = np.sum((o - BALL[:3]) * d, axis=1), np.sum((o - BALL[:3]) ** 2, axis=1) - BALL[3] ** 2
    a = np.sum(d * d, axis=1)
    s = (-b - np.sqrt(b * b - a * c)) / a
    for name, segment, hit in both(cam, depth, o, d, m=32):
        found, distance = values(hit.found, segment.distance(hit.t))
        assert np.mean(found) > 0.97, name
        assert np.median(np.abs(distance - s)[found] / s[found]) < 3e-3, name


def test_s_min_skips_what_is_nearer():
    cam = camera(64)
    segment = seen(cam, [[0.0, 0.0, 0.0]] * 2, [[0.0, 0.1, 1.0]] * 2, s_min=mi.Float([0.0, 3.5]))
    hit = depthray.meet_texels(segment, device(plate(64, 2 / 3)), 64)
    np.testing.assert_array_equal(hit.found, [True, False])
    np.testing.assert_allclose(segment.s_a, [2.0, 3.5], rtol=1e-6)


def test_i10_rays_through_the_camera_or_along_its_axis_meet_their_texel():
    """Images are points; the axis itself falls between texels, (0.1, 0.1, z) does not."""
    cam = camera(256)
    depth = spheres(cam, [BALL])
    o = [[0, 0, 0], [0, 0, 0], [0.1, 0.1, 1.0], [0, 0, 2.5], [0.3, 0.2, 3.0]]
    d = [[0, 0, 1], [0.1, -0.05, 1], [0.1, 0.1, 1.0], [0, 0, -1], [-0.3, -0.2, -3.0]]
    expected = [(127.5, 127.5), (127.5 + cam.focal * 0.1, 127.5 - cam.focal * 0.05), (127.5 + cam.focal * 0.1,) * 2]
    for name, segment, hit in both(cam, depth, o, d):
        found, x, y = values(hit.found, hit.x, hit.y)
        np.testing.assert_array_equal(found, [True, True, True, False, False], err_msg=name)
        np.testing.assert_allclose(np.column_stack([x, y])[:3], expected, atol=0.02)
        column, row = np.round(expected[1]).astype(int)
        np.testing.assert_allclose(np.array(segment.point(hit.t).z)[1], depth[row, column], atol=5e-3)


def test_i11_a_ray_from_behind_the_camera_hits_like_its_clipped_part():
    cam = camera(256)
    depth = spheres(cam, [BALL])
    rng = np.random.default_rng(3)
    o = np.column_stack([rng.uniform(-1, 1, (100, 2)), rng.uniform(-4, -0.5, 100)])
    d = np.array([0, 0, 2.7]) + rng.uniform(-0.4, 0.4, (100, 3)) - o
    s = np.array([clipped(cam, *one)[0] for one in zip(o, d, strict=True)])
    later = o + (0.999 * s)[:, None] * d
    for (name, segment, hit), (_, segment_2, hit_2) in zip(both(cam, depth, o, d), both(cam, depth, later, d), strict=True):
        np.testing.assert_array_equal(hit.found, hit_2.found, err_msg=name)
        found = np.array(hit.found)
        assert found.mean() > 0.9
        np.testing.assert_allclose(*(np.array(one)[found] for one in (hit.x, hit_2.x)), atol=0.02)
        np.testing.assert_allclose(
            np.array(segment.distance(hit.t))[found], (0.999 * s + np.array(segment_2.distance(hit_2.t)))[found], rtol=1e-4
        )


def test_i11_a_ray_that_starts_behind_and_leads_away_sees_nothing():
    segment = seen(camera(64), [[0.0, 0, -1], [0.5, 0, -1]], [[0.0, 0, -1], [1.0, 0, 0]])
    assert not np.any(np.array(segment.active))


def test_i12_dropped_teeth_are_missed_and_kept_ones_hit():
    """At m = 8 a row along all teeth keeps 4 of 20: rays down at the others miss, by texels they hit."""
    cam = camera(128)
    columns = np.array([5.0 + 6 * k for k in range(20)])
    o = cam.to_world(columns - 0.3, np.full(20, 60.0), np.zeros(20))
    to = cam.to_world(columns + 0.3, np.full(20, 60.0), np.ones(20))
    found = {}
    for m in (8, 64):
        _, hit = by_rows(cam, comb(), o, to - o, n=1, m=m)
        found[m] = np.array(hit.found)
    assert found[64].sum() == 20 and found[8].sum() == 4 and found[8][:4].all()
    assert np.all(np.array(by_texels(cam, comb(), o, to - o)[1].found))


def test_i13_nothing_is_hit_between_two_balls():
    cam = camera(256)
    depth = spheres(cam, [(-0.45, 0, 3.0, 0.35), (0.45, 0, 3.0, 0.35)])
    x = np.linspace(-0.06, 0.06, 41)
    to = np.column_stack([x, np.zeros(41), np.full(41, 3.0)])
    o = np.column_stack([x * 0.9, np.full(41, 0.2), np.full(41, 0.5)])
    for name, _, hit in both(cam, depth, o, to - o):
        assert not np.any(np.array(hit.found)), name
    assert by_rows(cam, depth, o[0], [-0.45, 0, 3.0] - o[0])[1].found[0]


def ball_in_front():
    """A ball in front of another: inside one span the depth jumps. Rays pass behind the front one and in front of the other."""
    cam = camera(256)
    depth = spheres(cam, [(0, 0, 2.35, 0.15), (0, 0, 3.4, 0.5)])
    rng = np.random.default_rng(4)
    start = np.column_stack([np.full(300, 0.9), rng.uniform(-0.12, 0.12, 300), rng.uniform(2.55, 2.8, 300)])
    end = np.column_stack([np.full(300, -0.9), rng.uniform(-0.12, 0.12, 300), rng.uniform(2.55, 2.8, 300)])
    return cam, depth, start, end - start


def test_i14_a_skin_joins_what_is_in_front_to_what_is_behind_unless_spans_are_split():
    """No ray touches a ball, so every hit is false: on the skin between the balls' outlines."""
    cam, depth, o, d = ball_in_front()
    skin, split = (by_rows(cam, depth, o, d, split_jump=jump)[1] for jump in (None, 0.1))
    assert np.mean(skin.found) > 0.9 and np.mean(split.found) == 0
    skin, split = (by_texels(cam, depth, o, d, split_jump=jump)[1] for jump in (None, 0.1))
    assert np.mean(skin.found) > 0.9 and np.mean(split.found) == 0


def test_i17_a_ray_turned_by_almost_pi_hits_like_one_turned_by_almost_nothing():
    """Images at psi = pi - 1e-6 and 1e-6 use the same row, whose u runs against the first."""
    cam = camera(256)
    depth = spheres(cam, [BALL])
    end = np.array([0.0, -0.2, 3.0])
    starts = np.array([[-1.0, -0.2, 2.6], [1.0, -0.2, 2.6]])
    for tilt in (1e-6, 0.0, -1e-6):
        o = starts - np.array([0, tilt, 0])
        _, hit = by_rows(cam, depth, o, end - o)
        assert np.all(np.array(hit.found))
        x, y, t = values(hit.x, hit.y, hit.t)
        assert x[0] + x[1] == pytest.approx(255, abs=0.02) and y[0] == pytest.approx(y[1], abs=0.02)
        assert x[0] < 127 and t[0] == pytest.approx(t[1], abs=1e-4)


def test_every_angle_finds_its_row():
    """A ray lies in the row it is given: within half a row of its midpoint, and within pi / 2n of its angle."""
    cam, layout = camera(256), depthmap.Layout(1, 256, 7, 8)
    psi = np.linspace(-np.pi, np.pi, 721)
    ends = np.stack([127.5 + 80 * np.cos(psi), 127.5 + 80 * np.sin(psi)], axis=1)
    a = np.stack([cam.to_world(255 - x, 255 - y, 0.2) for x, y in ends])
    b = np.stack([cam.to_world(x, y, 0.9) for x, y in ends])
    row, active, u_a, u_b = depthray.row_of(seen(cam, a, b - a), layout, "mid")
    row, u_a, u_b = values(row, u_a, u_b)
    assert np.all(np.array(active)) and row.max() < layout.row_count
    theta = (row // 256) * np.pi / 7
    off = np.abs((psi - theta + np.pi / 2) % np.pi - np.pi / 2)
    assert off.max() < np.pi / 14 + 1e-4
    assert np.all(np.sign(u_b - u_a) == np.sign(np.cos(psi - theta)))


def test_i18_a_full_plate_is_hit_within_the_inscribed_circle_at_any_angle():
    cam, rng = camera(128), np.random.default_rng(6)
    angle, r = rng.uniform(0, 2 * np.pi, 400), 62 * np.sqrt(rng.uniform(0, 1, 400))
    to = cam.to_world(63.5 + r * np.cos(angle), 63.5 + r * np.sin(angle), np.full(400, 0.5))
    o = to + np.column_stack([rng.uniform(-0.04, 0.04, (400, 2)), np.full(400, -0.3)])
    _, hit = by_rows(cam, plate(), o, to - o, n=16, m=2)
    assert np.all(np.array(hit.found))
    _, hit = by_texels(cam, plate(), o, to - o)
    assert np.all(np.array(hit.found))


def test_i19_a_ray_from_behind_the_surface_goes_through_unless_told_otherwise():
    cam = camera(128)
    to = cam.to_world(*(np.linspace(20, 100, 9),) * 2, np.full(9, 0.5))
    o = to + np.array([0.1, 0.05, 0.4])
    segment = seen(cam, o, to - o)
    layout, rows, _ = built(plate(), 16, 4)
    for both_sides in (False, True):
        assert np.all(np.array(depthray.meet_rows(segment, rows, layout, both_sides=both_sides).found) == both_sides)
        hit = depthray.meet_texels(segment, device(plate()), 128, both_sides=both_sides)
        assert np.all(np.array(hit.found) == both_sides)


def test_a_single_texel_is_a_texel_wide():
    """A ray across it a third of a texel off its centre hits, one a whole texel off does not."""
    cam = camera(64)
    depth = plate(64, 0.5, 20, 30)
    to = np.stack([cam.to_world(30 + off, 20.0, 0.5) for off in (0.0, 0.33, -0.33, 1.0, -1.0)])
    start = np.stack([cam.to_world(30 + off - 1e-3, 20.0, 0.0) for off in (0.0, 0.33, -0.33, 1.0, -1.0)])
    for name, _, hit in both(cam, depth, start, to - start):
        np.testing.assert_array_equal(hit.found, [True, True, True, False, False], err_msg=name)


def test_an_empty_map_is_never_hit():
    (cam, _), (o, d) = figure(), mirror_ball_rays(700)
    for name, _, hit in both(cam, plate(256, BACKGROUND), o, d):
        assert not np.any(np.array(hit.found)), name


def test_the_nearest_of_several_is_hit_in_either_direction():
    """Fins across the way, seen from both ends: the first is hit, where u grows and where it falls."""
    cam = camera(128)
    depth = plate(128, 0.7)
    for k in range(20, 110, 12):
        depth[:, k : k + 4] = 0.3
    a, b = cam.to_world(np.array([26.0, 101.0]), np.array([60.0, 60.0]), np.array([0.4, 0.4])), None
    b = cam.to_world(np.array([101.0, 26.0]), np.array([60.0, 60.0]), np.array([0.41, 0.41]))
    segment = seen(cam, a, b - a)
    layout, rows, _ = built(depth, 4, 64)
    hit = depthray.meet_rows(segment, rows, layout)
    x = np.array(hit.x)
    assert np.all(np.array(hit.found)) and 30 < x[0] < 33 and 94 < x[1] < 97
    np.testing.assert_allclose(depthray.meet_texels(segment, device(depth), 128).x, x, atol=0.7)


def test_lanes_ask_different_maps_and_idle_ones_nothing():
    (cam, depth), (o, d) = figure(), mirror_ball_rays(700)
    moved = camera(256, matrix=turned((0.1, -0.05), (0.1, 0.0, 0.2)))
    maps = np.stack([depth, spheres(moved, [BALL])])
    layout, rows, _ = built(maps, 12, 8)
    map = np.arange(len(o)) % 2
    segment = seen([cam, moved], o, d, map)
    together = depthray.meet_rows(segment, rows, layout), depthray.meet_texels(segment, device(maps), 256)
    for k, one in enumerate((cam, moved)):
        alone = by_rows(one, maps[k], o, d, n=12, m=8)[1], by_texels(one, maps[k], o, d)[1]
        for mixed, single in zip(together, alone, strict=True):
            chosen = map == k
            np.testing.assert_array_equal(np.array(mixed.found)[chosen], np.array(single.found)[chosen])
            np.testing.assert_allclose(np.array(mixed.x)[chosen], np.array(single.x)[chosen], atol=1e-4)
    packets = device(np.stack([cam.packet()]))
    idle = depthray.project(packets, 256, mi.UInt32(7), mi.Point3f(*o.T), mi.Vector3f(*d.T), active=mi.Bool(False))
    single, alone, _ = built(depth, 12, 8)
    for hit in (depthray.meet_rows(idle, alone, single), depthray.meet_texels(idle, device(depth), 256)):
        assert not np.any(np.array(hit.found)) and np.all(np.array(hit.work) == 0)


def test_recorded_rays_follow_their_map():
    (cam, depth), (o, d) = figure(), mirror_ball_rays(700)
    layout, rows, _ = built(np.stack([depth]), 12, 8)
    other = built(spheres(cam, [BALL]), 12, 8)[1]
    packets = device(cam.packet())

    @frozen
    def meet(packets, rows, o, d):
        segment = depthray.project(packets, 256, dr.zeros(mi.UInt32, 700), o, d)
        hit = depthray.meet_rows(segment, rows, layout)
        return hit.found, hit.x, hit.work

    for one in (rows, other, rows):
        found = meet(packets, one, mi.Point3f(*o.T), mi.Vector3f(*d.T))
        plain = depthray.meet_rows(seen(cam, o, d), one, layout)
        for got, wanted in zip(found, (plain.found, plain.x, plain.work), strict=True):
            np.testing.assert_array_equal(got, wanted)


def test_nothing_is_ever_not_a_number():
    """Random rays of any size, rays along the axes, through the camera, from its planes, and of no direction."""
    rng = np.random.default_rng(8)
    cam, depth = figure(64)
    o = rng.normal(size=(4000, 3)) * 10.0 ** rng.integers(-6, 6, (4000, 1))
    d = rng.normal(size=(4000, 3)) * 10.0 ** rng.integers(-6, 6, (4000, 1))
    d[:1500] *= rng.integers(0, 2, (1500, 3))
    o[1000:2000] *= rng.integers(0, 2, (1000, 3))
    d[2000:2500] = o[2000:2500]
    d[2500:2800] = np.array([0, 0, 3.0]) - o[2500:2800]
    o[2800:3000, 2] = [2.0, 4.0] * 100
    layout, rows, _ = built(depth, 12, 8)
    segment = seen(cam, o, d)
    results = [segment.a, segment.b, segment.s_a, segment.s_b, segment.Z_a, segment.Z_b]
    for both_sides in (False, True):
        for anchor in ("mid", "start"):
            hit = depthray.meet_rows(segment, rows, layout, anchor, both_sides=both_sides)
            results += [hit.t, hit.x, hit.y, segment.distance(hit.t)]
        hit = depthray.meet_texels(segment, device(depth), 64, both_sides=both_sides)
        results += [hit.t, hit.x, hit.y, segment.distance(hit.t)]
    assert np.sum(np.array(segment.active)) > 300
    for one in results:
        assert np.all(np.isfinite(np.array(one)))
