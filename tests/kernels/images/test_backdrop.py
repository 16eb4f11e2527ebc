"""What lies behind impostors: where rays leave the box over the ground, and the blend on its walls, against float64."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest

from benchharness.kernels import surroundings
from benchharness.kernels.images import backdrop

HALF, HEIGHT = np.array([2.0, 1.5]), 0.6
ORIGIN = np.array([0.3, -0.2, 0.1])
A, B = np.array([np.cos(0.4), np.sin(0.4), 0.0]), np.array([-np.sin(0.4), np.cos(0.4), 0.0])
UP = np.array([0.0, 0.0, 1.0])
CENTRE = np.array([0.1, 0.2, 0.9])  # the map's


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def behind(o, d, walls: bool = True, centre=CENTRE):
    """`backdrop.behind` of rays [N, 3] over the ground above, on the host."""
    o, d = np.broadcast_arrays(np.atleast_2d(o), np.atleast_2d(d))
    box = None
    if walls:
        numbers = (ORIGIN, A / HALF[0], B / HALF[1], UP / HEIGHT, centre)
        middle, a, b, up, centre = ([float(x) for x in v] for v in numbers)
        box = backdrop.Walls(mi.Point3f(*middle), mi.Vector3f(*a), mi.Vector3f(*b), mi.Vector3f(*up), mi.Point3f(*centre))
    sky = surroundings.Surroundings(mi.Color3f(0))
    d32 = [mi.Float(np.ascontiguousarray(x, np.float32)) for x in d.T]
    o32 = [mi.Float(np.ascontiguousarray(x, np.float32)) for x in o.T]
    direction, t = backdrop.behind(backdrop.Backdrop(sky, None, 16, box), mi.Point3f(*o32), mi.Vector3f(*d32))
    return np.array(direction).T, np.broadcast_to(np.array(t), len(o))


def expected(o, d):
    """(direction, distance to the ground) of one ray, by looking at each side of the box in turn."""
    local = np.array([(o - ORIGIN) @ A, (o - ORIGIN) @ B, (o - ORIGIN) @ UP])
    step = np.array([d @ A, d @ B, d @ UP])
    low, high = np.array([-HALF[0], -HALF[1], 0.0]), np.array([HALF[0], HALF[1], HEIGHT])
    crossings = []  # (t, axis, upper side) of all points on the surface of the box ahead of the ray
    for axis in range(3):
        for upper, plane in enumerate((low, high)):
            if step[axis] == 0:
                continue
            t = (plane[axis] - local[axis]) / step[axis]
            at = np.delete(local + t * step, axis)
            if t > 0 and (at >= np.delete(low, axis)).all() and (at <= np.delete(high, axis)).all():
                crossings.append((t, axis, upper))
    if not crossings:
        return d, np.inf
    t, axis, upper = max(crossings)  # the way out is the last one
    to_exit = unit(o + t * d - CENTRE)
    if axis == 2:
        return (d, np.inf) if upper else (to_exit, t)
    share = (local[2] + t * step[2]) / HEIGHT
    blend = (1 - share) * to_exit + share * d
    return (unit(blend) if np.linalg.norm(blend) > 1e-6 else d), np.inf


def local(x, y, z):
    """A point over the ground by its place along the ground's sides."""
    return ORIGIN + x * A + y * B + z * UP


def test_rays_from_inside_and_outside_leave_through_floor_walls_and_top():
    rng = np.random.default_rng(3)
    o = np.array([local(*p) for p in rng.uniform((-3, -2.5, 0.0), (3, 2.5, 1.2), (3000, 3))])
    d = unit(rng.normal(size=(3000, 3)))
    direction, t = behind(o, d)
    true = [expected(*ray) for ray in zip(o, d, strict=True)]
    true_direction, true_t = np.array([x for x, _ in true]), np.array([x for _, x in true])
    off = np.abs(direction - true_direction).max(axis=1)
    assert (off > 2e-5).mean() < 0.002  # at an edge of the box, float32 may leave by the other side
    same = np.isfinite(t) == np.isfinite(true_t)
    assert same.mean() > 0.998
    both = np.isfinite(t) & np.isfinite(true_t)
    np.testing.assert_allclose(t[both], true_t[both], rtol=1e-4)
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1, atol=1e-5)
    for kind in (both, ~both & (np.abs(true_direction - d).max(axis=1) > 1e-9), np.abs(true_direction - d).max(axis=1) < 1e-9):
        assert kind.sum() > 100  # the floor, the walls, the rest


def test_without_walls_rays_are_looked_up_by_their_direction():
    d = unit(np.random.default_rng(1).normal(size=(50, 3)))
    direction, t = behind(local(0.5, 0.2, 0.5), d, walls=False)
    np.testing.assert_allclose(direction, d, atol=1e-6)
    assert np.isinf(t).all()


@pytest.mark.parametrize("along", [-1.4, 0.0, 0.9])
@pytest.mark.parametrize("side", [0, 1, 2, 3])
def test_i08_nothing_jumps_between_ground_and_wall_and_the_walls_end_in_the_environment(side, along):
    """I-08: continuous at h = 0, the environment alone at h = H and above."""
    sign, edge = 1 - 2 * (side % 2), HALF[side // 2]
    o = local(0.3, -0.1, 0.4)

    def through(away: float, height: float):
        place = (sign * (edge + away), along) if side < 2 else (along, sign * (edge + away))
        d = unit(local(*place, height) - o)
        return *(x[0] for x in behind(o, d)), d

    ground, t, _ = through(-1e-4, 0.0)
    wall, t_wall, d = through(0.0, 1e-4)
    assert np.isfinite(t) and np.isinf(t_wall)
    assert np.abs(ground - wall).max() < 1e-3
    assert np.abs(wall - d).max() > 0.05  # by direction it would be elsewhere
    below, _, d_below = through(0.0, HEIGHT - 1e-4)
    above, _, d_above = through(0.0, HEIGHT + 1e-4)
    np.testing.assert_allclose(below, d_below, atol=1e-3)
    np.testing.assert_array_equal(above, d_above.astype(np.float32))
    # In between it goes steadily from one to the other.
    steps = [through(0.0, h)[0] for h in np.linspace(1e-4, HEIGHT, 50)]
    assert np.abs(np.diff(steps, axis=0)).max() < 0.1


@pytest.mark.parametrize("share", [0.4999, 0.49999, 0.5, 0.50001, 0.5001])
def test_i09_a_ray_against_the_direction_from_the_map_is_looked_up_by_itself(share):
    """I-09: on a wall, direction = -unit(a - centre): at half height the blend has no length. The map is outside."""
    wall = local(HALF[0], 0.3, share * HEIGHT)
    d = unit(A + 0.3 * B + 0.1 * UP)
    direction = behind(wall - 0.7 * d, d, centre=wall + 2.0 * d)[0][0]
    assert np.isfinite(direction).all()
    assert np.linalg.norm(direction) == pytest.approx(1, abs=1e-4)
    if share == 0.5:
        np.testing.assert_allclose(direction, d, atol=1e-5)
    elif abs(share - 0.5) > 5e-5:
        np.testing.assert_allclose(direction, d if share > 0.5 else -d, atol=2e-3)


def test_rays_along_an_axis_of_the_box_are_no_division_by_zero():
    d = np.array([A, -A, B, UP, -UP])
    direction, t = behind(local(0.5, 0.2, 0.3), d)
    true = [expected(local(0.5, 0.2, 0.3), x) for x in d]
    np.testing.assert_allclose(direction, [x for x, _ in true], atol=1e-5)
    np.testing.assert_allclose(t, [x for _, x in true], rtol=1e-5)
    direction, t = behind(local(0.0, 0.0, 2.0), d)  # above the box: only straight down meets it
    np.testing.assert_allclose(t, [np.inf] * 4 + [2.0], rtol=1e-5)
    np.testing.assert_allclose(direction[:4], d[:4], atol=1e-6)


def test_each_mirror_has_its_own_map_and_with_walls_all_have_one():
    n = 8
    texels = 6 * (n + 2) ** 2
    maps = np.zeros((2, texels, 4), np.float32)
    maps[0], maps[1] = (0.2, 0.3, 0.4, 0.5), (0.7, 0.6, 0.5, 0.0)
    sky = surroundings.Surroundings(mi.Color3f(0.9, 0.8, 0.7))
    d, mirror = mi.Vector3f(mi.Float([0.6, 0.6]), 0, 0.8), mi.UInt32([0, 1])
    plain = backdrop.Backdrop(sky, mi.Float(maps.ravel()), n, None)
    L, distance = backdrop.look_up(plain, mirror, d, mi.Bool(True))
    np.testing.assert_allclose(np.array(L).T, [(0.2, 0.3, 0.4), (0.7, 0.6, 0.5)], atol=1e-6)
    np.testing.assert_allclose(np.array(distance), [2.0, np.inf])  # 1 / 0.5; 0 stands for infinity
    walls = backdrop.Walls(*(mi.Point3f(0, 0, 0),), *(mi.Vector3f(1, 0, 0),) * 3, mi.Point3f(0, 0, 0))
    L, _ = backdrop.look_up(backdrop.Backdrop(sky, mi.Float(maps.ravel()), n, walls), mirror, d, mi.Bool(True))
    np.testing.assert_allclose(np.array(L).T, [(0.2, 0.3, 0.4)] * 2, atol=1e-6)
    L, distance = backdrop.look_up(backdrop.Backdrop(sky, None, n, None), mirror, d, mi.Bool(True))
    np.testing.assert_allclose(np.broadcast_to(np.array(L).T, (2, 3)), [(0.9, 0.8, 0.7)] * 2, atol=1e-6)
    assert np.isinf(np.array(distance)).all()
