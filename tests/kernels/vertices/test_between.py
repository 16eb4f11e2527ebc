"""Vertices between others: which are searched, what the rest lie between, and what their reflection points are off by."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from oracles import angle_oracle
from oracles import between_oracle as oracle
from support.placed import host, off_px
from support.small_room import box, quad

from benchharness.kernels.vertices import between
from benchharness.scene import subdivided

RNG = np.random.default_rng(5)


def sheet(h: float, away: float = 2.5) -> np.ndarray:
    """A square grid of places beside a unit ball, float64."""
    return np.asarray(subdivided(quad((-1.0, -1.0, away), (2.0, 0.0, 0.0), (0.0, 2.0, 0.3)), h).vertices)


def put(vertices, planned):
    """Where the corners of vertices are, by their weights, [N, 3]."""
    searched, corners, weights = planned
    return np.einsum("nk,nkd->nd", weights, vertices[searched][corners])


def device(planned) -> between.Between:
    searched, corners, weights = planned
    zero = np.zeros((len(corners), 1))
    return between.Between(
        mi.UInt32(searched.astype(np.uint32)),
        mi.UInt32(np.hstack([corners, zero]).astype(np.uint32).ravel()),
        mi.Float(np.hstack([weights, zero]).astype(np.float32).ravel()),
        len(searched),
    )


def test_the_oracles_weights_by_hand():
    corners = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 4.0, 0.0]])
    w = oracle.weights(corners, np.array([1.0, 1.0, 7.0]))
    np.testing.assert_allclose(w, [0.25, 0.5, 0.25], atol=1e-12)
    assert oracle.bound(corners, w, np.array([1.0, 1.0, 0.0])) == pytest.approx(0.25 * 2 + 0.5 * 2 + 0.25 * 10)


@pytest.mark.parametrize("every", [4, 16])
def test_on_a_sheet_weights_give_the_place_and_what_is_searched_keeps_its_distance(every):
    v = sheet(0.1)
    planned = between.planned(v, every)
    searched, corners, weights = planned
    assert 0.5 / every < len(searched) / len(v) < 2.0 / every
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-12)
    np.testing.assert_allclose(put(v, planned), v, atol=1e-9)
    assert weights.min() >= -between.OUTSIDE
    apart = np.linalg.norm(v[searched][:, None] - v[searched], axis=2)
    near = np.linalg.norm(v[:, None] - v[searched], axis=2).min(axis=1)
    spacing = np.sort(apart + 1e9 * np.eye(len(searched)), axis=1)[:, 0]
    assert near.max() < 1.6 * np.median(spacing)
    own = np.flatnonzero((weights == [1, 0, 0]).all(axis=1) & (corners == corners[:, :1]).all(axis=1))
    assert set(searched) <= set(own)
    for corner in ((-1, -1, 2.5), (1, 1, 2.8), (-1, 1, 2.8), (1, -1, 2.5)):
        assert np.linalg.norm(v[searched] - corner, axis=1).min() < 1e-9


def test_the_three_are_the_best_that_there_are():
    """Of eight that are searched, in all; the oracle tries every triple."""
    known, others = RNG.normal(size=(8, 3)) * [1, 1, 0.05], 1.2 * RNG.normal(size=(60, 3)) * [1, 1, 0.05]
    points = np.concatenate([known, others])
    chosen = np.arange(len(points)) < 8
    least = [oracle.best(known, p, between.OUTSIDE, between.ABOVE) for p in others]
    found = np.full(len(others), np.inf)
    for rest, corners, weights, inside in between.lying_between(points, chosen):
        for i, c, w in zip(rest[inside], corners[inside], weights[inside], strict=True):
            found[i - 8] = oracle.bound(points[c], w, points[i])
    assert 30 < np.isfinite(found).sum() < 60
    np.testing.assert_allclose(found, least, rtol=1e-9)


def test_corners_of_a_box_lie_between_nothing_and_are_searched():
    mesh = box((-1, -1, -1), (1, 1, 1))
    searched, _, weights = between.planned(np.asarray(mesh.vertices), 8)
    assert len(searched) == 8 and (weights == [1, 0, 0]).all()
    single = between.planned(np.zeros((3, 3)), 4)
    assert len(single[0]) == 1 and (single[1] == 0).all()


def test_every_vertex_at_one_place_is_the_one_that_is_searched_there():
    v = np.concatenate([sheet(0.3), sheet(0.3)])
    searched, corners, weights = between.planned(v, 6)
    half = len(v) // 2
    np.testing.assert_array_equal(corners[:half], corners[half:])
    np.testing.assert_array_equal(weights[:half], weights[half:])
    assert len(np.unique(np.round(v[searched], 9), axis=0)) == len(searched)


def test_directions_between_are_the_oracles_and_their_error_falls_with_the_square_of_the_distance():
    """On a unit ball, whose reflection points bisection finds."""
    v = sheet(0.05)
    eye = np.array([3.0, 1.0, 2.0])
    true, errors, spacings = angle_oracle.reflection(eye, v, 1.0), [], []
    for every in (9, 36, 144):
        planned = between.planned(v, every)
        searched, corners, weights = planned
        expected = angle_oracle.unit(np.einsum("nk,nkd->nd", weights, true[searched][corners]))
        u = mi.Float(true[searched].astype(np.float32).ravel())
        lane, known = dr.arange(mi.UInt32, len(v)), dr.full(mi.Bool, True, len(searched))
        here = between.interpolated(device(planned), u, known, lane)
        found = host(dr.normalize(here.value))
        np.testing.assert_allclose(found, expected, atol=3e-7)
        assert np.array(here.searched).sum() >= len(searched) and np.array(here.whole).all()
        errors.append(np.sqrt(np.square(off_px(found, true, eye)).mean()))
        spacings.append(1 / np.sqrt(len(searched)))
    order = np.polyfit(np.log(spacings), np.log(errors), 1)[0]
    assert 1.6 < order < 2.5, errors


def test_what_has_a_corner_that_is_not_known_says_so():
    planned = between.planned(sheet(0.2), 5)
    corners, weights = planned[1], planned[2]
    known = RNG.random(len(planned[0])) < 0.7
    u = mi.Float(np.tile([0.0, 0.0, 1.0], len(planned[0])).astype(np.float32))
    here = between.interpolated(device(planned), u, mi.Bool(known), dr.arange(mi.UInt32, len(corners)))
    expected = (known[corners] | (weights == 0)).all(axis=1)
    assert (np.array(here.whole).astype(bool) == expected).all() and 0.1 < expected.mean() < 0.9
