"""Polygons into triangles: as many as there have to be, none outside, whatever the polygon's shape and place."""

from __future__ import annotations

import numpy as np
import pytest

from benchharness.assets import polygons


def turned(flat: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A polygon in the plane, [n, 2], somewhere in space."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    q[:, 2] *= np.linalg.det(q)
    return np.c_[flat, np.zeros(len(flat))] @ q.T + rng.normal(size=3)


def shoelace(flat: np.ndarray) -> float:
    x, y = flat.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def star(n: int, rng: np.random.Generator) -> np.ndarray:
    """A polygon that all of is seen from the origin: counter-clockwise, and mostly concave."""
    angle = (np.arange(n) + rng.uniform(0.1, 0.9, n)) * 2 * np.pi / n
    return np.stack([np.cos(angle), np.sin(angle)], axis=1) * rng.uniform(0.05, 1.0, (n, 1))


@pytest.mark.parametrize("seed", range(8))
def test_triangles_of_any_polygons_together_have_their_areas_and_face_their_way(seed):
    rng = np.random.default_rng(seed)
    flats = [star(n, rng) for n in rng.integers(3, 30, 12)]
    sizes = np.array([len(flat) for flat in flats])
    points = np.concatenate([turned(flat, rng) for flat in flats])
    triangles, crossing = polygons.triangulated(points, sizes)
    assert crossing == 0 and len(triangles) == (sizes - 2).sum()
    owner, starts = polygons.owners(sizes), np.cumsum(sizes) - sizes
    assert ((triangles >= starts[owner, None]) & (triangles < (starts + sizes)[owner, None])).all()
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    areas = 0.5 * np.cross(b - a, c - a)
    for k, flat in enumerate(flats):
        own = areas[owner == k]
        # The sum of areas equals the length of the sum of their normals only if no triangle is turned.
        assert np.linalg.norm(own, axis=1).sum() == pytest.approx(shoelace(flat), rel=1e-9)
        assert np.linalg.norm(own.sum(axis=0)) == pytest.approx(shoelace(flat), rel=1e-9)


def test_a_polygon_that_turns_left_everywhere_but_twice_around_is_no_fan():
    pentagram = np.array([[np.cos(a), np.sin(a), 0.0] for a in np.arange(5) * 4 * np.pi / 5])
    assert polygons.triangulated(pentagram, np.array([5]))[1] == 1


def test_a_comb_of_two_hundred_corners_is_cut_within_itself():
    x = np.arange(100.0)
    comb = np.concatenate([np.stack([x, np.where(x % 2, 5.0, 1.0)], axis=1)[::-1], [[0, 0], [99, 0]]])
    triangles, crossing = polygons.triangulated(np.c_[comb, np.zeros(len(comb))], np.array([len(comb)]))
    a, b, c = np.moveaxis(comb[triangles], 1, 0)
    areas = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    assert crossing == 0 and areas.min() >= 0
    assert areas.sum() == pytest.approx(99 * 3.0)  # the mean height is 3


def test_strips_turn_every_second_triangle_and_fans_none():
    assert polygons.of_strip(np.array([7, 8, 9, 5])).tolist() == [[7, 8, 9], [9, 8, 5]]
    assert polygons.of_fan(np.array([7, 8, 9, 5])).tolist() == [[8, 9, 7], [9, 5, 7]]
