"""Pictures with mip levels, and the nearest opaque billboard along a ray, against plain float64 NumPy."""

from __future__ import annotations

from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest
from oracles.billboard_oracle import SIZE, Quads, bilinear, device, quads, vectors

from benchharness.kernels.differentials import RayDifferential
from benchharness.kernels.images import atlas, billboard
from benchharness.kernels.images.candidates import NONE, Ray


def noise(*shape, seed=0):
    return np.random.default_rng(seed).uniform(0, 1, shape)


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


# Pictures


def halved(texels: np.ndarray) -> np.ndarray:
    return 0.25 * (texels[::2, ::2] + texels[1::2, ::2] + texels[::2, 1::2] + texels[1::2, 1::2])


def pyramid(texels: np.ndarray) -> list[np.ndarray]:
    """All levels down to 4 texels."""
    levels = [texels]
    while len(levels[-1]) > 4:
        levels.append(halved(levels[-1]))
    return levels


@pytest.mark.parametrize("size", [4, 8, 64])
def test_each_level_is_the_mean_of_the_one_before(size):
    texels = noise(size, size, 4)
    made = np.array(atlas.with_levels(device(texels), size, size, atlas.levels_of(size, True))).reshape(-1, 4)
    expected = np.concatenate([level.reshape(-1, 4) for level in pyramid(texels)])
    pictures = billboard.Pictures(device(made), size, True)
    assert pictures.levels == len(pyramid(texels))
    assert pictures.texels_per_slot == len(expected) == len(made)
    np.testing.assert_allclose(made, expected, atol=1e-6)


@pytest.mark.parametrize("mip", [True, False])
def test_lookup_is_bilinear_in_the_nearest_level(mip):
    slots = noise(3, 32, 32, 4)
    own = [atlas.with_levels(device(t), 32, 32, 4) if mip else device(t) for t in slots]
    pictures = billboard.Pictures(device(np.concatenate([np.array(t) for t in own])), 32, mip)
    rng = np.random.default_rng(1)
    count = 400
    slot, (x, y) = rng.integers(0, 3, count), rng.uniform(-1, 1, (2, count))
    level = rng.uniform(-1, 5, count)
    level += np.where(np.abs(level % 1 - 0.5) < 1e-3, 0.01, 0)  # no ties
    found = np.array(billboard.sample(pictures, mi.UInt32(slot), device(x), device(y), device(level), mi.Bool(True))).T
    nearest = np.rint(np.clip(level, 0, 3)).astype(int) if mip else np.zeros(count, int)
    expected = [bilinear(pyramid(slots[slot[k]])[nearest[k]], x[k], y[k]) for k in range(count)]
    np.testing.assert_allclose(found, expected, atol=1e-5)


# Rays


def still() -> RayDifferential:
    return RayDifferential([mi.Vector3f(0), mi.Vector3f(0)], [mi.Vector3f(0), mi.Vector3f(0)])


def met(made: Quads, mirror, o, d, columns=None, pictures=None, differential=None, before=None) -> billboard.Hit:
    columns = made.lists.shape[1] if columns is None else columns
    ray = Ray(mi.UInt32(mirror), mi.Point3f(vectors(o)), vectors(d), differential or still())
    return billboard.nearest(made.boards, pictures or made.pictures, columns, ray, before or billboard.none())


@pytest.mark.parametrize("columns", [6, 4])
def test_the_nearest_opaque_point_is_found_through_the_holes_of_others(columns):
    made, rng, count = quads(), np.random.default_rng(5), 2000
    o = 2 * rng.normal(size=(count, 3))
    d = rng.uniform(-1, 1, (count, 3)) - o
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    mirror = rng.integers(0, 2, count)
    hit = met(made, mirror, o, d, columns)
    t, slot, value, tests = np.array(hit.t), np.array(hit.slot), np.array(hit.value).T, np.array(hit.tests)
    answers = [made.nearest(*ray, columns) for ray in zip(mirror, o, d, strict=True)]
    clear = np.array([a[4] > 1e-4 for a in answers])
    assert clear.mean() > 0.97
    true_t, true_slot = np.array([a[0] for a in answers]), np.array([a[1] for a in answers])
    np.testing.assert_array_equal(np.where(slot == NONE, -1, slot.astype(int))[clear], true_slot[clear])
    found = clear & (true_slot >= 0)
    assert 200 < found.sum() < count - 200
    np.testing.assert_allclose(t[found], true_t[found], rtol=2e-4)
    assert np.isinf(t[clear & ~found]).all()
    np.testing.assert_allclose(value[found], np.array([a[2] for a in answers])[found], atol=3e-3)
    np.testing.assert_array_equal(tests, [a[3] for a in answers])  # what is listed, hit or not; NONE does not count


def wall(texels, k=(0.0, 0.0, 1.0), a=(1.0, 0.0, 0.0)) -> Quads:
    k, a = np.array([k]), np.array([a])
    return Quads(np.zeros((1, 3)), a, np.cross(a, k), k, np.ones((1, 2)), texels[None], np.array([[0]]), 1)


def test_a_quad_is_met_from_both_sides_and_shows_the_same():
    made = wall(np.concatenate([noise(SIZE, SIZE, 3), np.ones((SIZE, SIZE, 1))], axis=2))
    o, d = np.array([(0.3, 0.4, 2.0), (0.3, 0.4, -3.0)]), np.array([(0, 0, -1.0), (0, 0, 1.0)])
    hit = met(made, [0, 0], o, d)
    np.testing.assert_allclose(np.array(hit.t), [2.0, 3.0])
    value = np.array(hit.value).T
    np.testing.assert_array_equal(value[0], value[1])
    np.testing.assert_allclose(value[0], bilinear(made.texels[0], 0.3, 0.4 * made.b[0, 1]), atol=1e-6)


def test_i03_a_quad_that_is_seen_edge_on_is_missed_and_nothing_is_infinite():
    """I-03: rays in its plane, beside it, and at slants down to none."""
    made = wall(np.ones((SIZE, SIZE, 4)))
    slant = np.array([0.0, 1e-12, -1e-12, 1e-9, 1e-7, -9e-7, 2e-6, 1e-4, 0.05])
    d = np.column_stack([np.sqrt(1 - slant**2), np.zeros_like(slant), slant])
    for height in (0.0, 1e-12, 1e-3, -1e-3, 1.0):
        o = np.tile((-3.0, 0.2, height), (len(slant), 1))
        hit = met(made, [0] * len(slant), o, d)
        t, value = np.array(hit.t), np.array(hit.value)
        assert np.isfinite(value).all() and not np.isnan(t).any()
        assert np.isinf(t[np.abs(slant) < billboard.PARALLEL]).all()
    # From just below it: a quotient of two numbers of no precision is no hit.
    tiny = np.array([1e-9, 1e-7, -9e-7])
    o = np.column_stack([np.full(3, -3.0), np.full(3, 0.2), -3.0 * tiny])
    assert np.isinf(np.array(met(made, [0] * 3, o, np.column_stack([np.ones(3), np.zeros(3), tiny])).t)).all()
    # At a slant that is no longer parallel it is there.
    o = np.array([(-3.0, 0.2, -3.0 * 1e-4 / np.sqrt(1 - 1e-8))])
    assert np.array(met(made, [0], o, d[7:8]).t)[0] == pytest.approx(3.0, rel=1e-3)


def test_a_point_counts_from_half_coverage_and_its_colour_is_what_is_covered():
    """Premultiplied: between a white texel and a transparent one it stays white."""
    texels = np.zeros((SIZE, SIZE, 4))
    texels[:, : SIZE // 2] = (0.8, 0.6, 0.2, 1.0)
    made = wall(texels)
    x = np.linspace(-0.3, 0.3, 121)
    o = np.column_stack([x, np.full_like(x, 0.1), np.ones_like(x)])
    hit = met(made, [0] * len(x), o, np.tile((0.0, 0.0, -1.0), (len(x), 1)))
    seen = np.isfinite(np.array(hit.t))
    np.testing.assert_array_equal(seen[np.abs(x) > 1e-6], (x < 0)[np.abs(x) > 1e-6])
    np.testing.assert_allclose(np.array(hit.value).T[seen], np.tile((0.8, 0.6, 0.2, 1.0), (seen.sum(), 1)), atol=1e-5)


# Mip levels


def test_the_level_is_that_at_which_texels_are_as_long_as_rays_are_apart_whichever_side_is_the_longer():
    made = quads()
    pictures = billboard.Pictures(made.pictures.texels, SIZE, True)
    axes = (made.a / made.half[:, :1], made.b / made.half[:, 1:])
    one, other = (mi.Vector4f(*(device(column) for column in axis.T), 0) for axis in axes)
    assert (made.half[:, 0] != made.half[:, 1]).any()
    for factor in (1.0, 2.0, 8.0, 0.5):
        apart = device(factor * 2 * made.half.max(axis=1) / SIZE)
        for a, b in ((one, other), (other, one)):
            level = billboard.level_of(pictures, mi.UInt32(0), a, b, apart)
            np.testing.assert_allclose(np.array(level), np.log2(factor), atol=1e-4)
    assert np.isfinite(np.array(billboard.level_of(pictures, mi.UInt32(0), one, other, mi.Float(0)))).all()


def test_rays_that_part_are_as_far_apart_as_the_nearer_of_both_neighbours():
    starts = [mi.Vector3f(0.1, 0, 0), mi.Vector3f(0, 0.05, 0)]
    turns = [mi.Vector3f(0.0, 0.2, 0), mi.Vector3f(0, -0.05, 0.0)]
    t = np.array([0.0, 1.0, 3.0])
    apart = np.array(RayDifferential(starts, turns).footprint(device(t)))
    np.testing.assert_allclose(apart, np.minimum(np.hypot(0.1, 0.2 * t), np.abs(0.05 - 0.05 * t)), atol=1e-6)


def test_a_ray_whose_neighbours_are_far_sees_a_coarser_level():
    texels = np.concatenate([noise(SIZE, SIZE, 3), np.ones((SIZE, SIZE, 1))], axis=2)
    made = wall(texels)
    pictures = billboard.Pictures(atlas.with_levels(device(texels), SIZE, SIZE, 3), SIZE, True)
    for level in (0, 1, 2):
        apart = 2.0**level * 2 / SIZE
        differential = RayDifferential(
            [mi.Vector3f(apart, 0, 0), mi.Vector3f(0, 3 * apart, 0)], [mi.Vector3f(0), mi.Vector3f(0)]
        )
        hit = met(made, [0], [(0.31, -0.42, 1.0)], [(0, 0, -1.0)], pictures=pictures, differential=differential)
        expected = bilinear(pyramid(texels)[level], 0.31, -0.42 * made.b[0, 1])
        np.testing.assert_allclose(np.array(hit.value).ravel(), expected, atol=1e-5)


def test_slots_are_counted_from_the_first_of_their_pictures_and_what_was_met_before_stays_if_it_is_nearer():
    made = quads()
    rest = replace(made, lists=np.array([[4, 5, -1, -1, -1, -1]]))
    pictures = billboard.Pictures(device(made.texels[4:]), SIZE, False, 4)
    rng, count = np.random.default_rng(8), 500
    o = 2 * rng.normal(size=(count, 3))
    d = unit(rng.uniform(-1, 1, (count, 3)) - o)
    zero = np.zeros(count, int)
    whole, part = met(rest, zero, o, d), met(rest, zero, o, d, pictures=pictures)
    for name in ("t", "slot", "value"):
        np.testing.assert_array_equal(np.array(getattr(whole, name)), np.array(getattr(part, name)))
    hit = np.isfinite(np.array(part.t))
    assert 50 < hit.sum() < count - 50
    before = billboard.Hit(mi.Float(2.0), mi.UInt32(77), mi.Vector4f(9.0), mi.UInt32(3))
    both = met(rest, zero, o, d, pictures=pictures, before=before)
    nearer = hit & (np.array(part.t) < 2.0)
    assert nearer.any() and (hit & ~nearer).any()
    np.testing.assert_array_equal(np.array(both.slot), np.where(nearer, np.array(part.slot), 77))
    np.testing.assert_array_equal(np.array(both.t), np.where(nearer, np.array(part.t), np.float32(2.0)))
    np.testing.assert_array_equal(np.array(both.value).T[~nearer], 9.0)
    np.testing.assert_array_equal(np.array(both.tests), 5)
