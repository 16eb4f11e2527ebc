"""Triangles that are cut where light asks for it, and the sheets of samples that come of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from oracles.light_oracle import on_pieces, on_sheet
from support.lit_rooms import cut_at_random, disc, found, mapped, walls, waves
from support.small_room import quad, sphere

from benchharness.modelling import lightmap, lightmesh
from benchharness.modelling.lightmap import LightMap
from benchharness.modelling.lightmesh import DEEPEST
from benchharness.render import finer
from benchharness.scene import Mesh, merged, subdivided

SQUARE = quad((0, 0, 0), (4, 0, 0), (0, 4, 0))


def uncut(mesh: Mesh) -> lightmesh.LightMesh:
    return cut_at_random(mesh, 0)


def area(places: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = np.moveaxis(places[faces], 1, 0)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def test_a_triangle_becomes_four_alike_that_lie_in_it_and_are_wound_as_it_is():
    # (0, 0), (4, 0), (4, 4) has its middles at (2, 0), (4, 2), (2, 2); the square's other triangle stays.
    one = lightmesh.cut(uncut(SQUARE), np.array([True, False]))
    corners = one.places[one.faces][1:, :, :2]
    assert corners.tolist() == [
        [[0, 0], [2, 0], [2, 2]],
        [[4, 0], [4, 2], [2, 0]],
        [[4, 4], [2, 2], [4, 2]],
        [[2, 0], [4, 2], [2, 2]],
    ]
    assert one.whole.tolist() == [1, 0, 0, 0, 0] and one.depth.tolist() == [0, 1, 1, 1, 1]
    assert (one.normals == [0, 0, 1]).all() and one.fresh.sum(axis=1).tolist() == [0, 2, 2, 2, 3]


@pytest.mark.parametrize("seed", range(3))
def test_pieces_lie_where_they_say_and_make_up_their_whole(seed):
    ball = sphere(1.0, (0, 0, 0), 8, 4)
    whole, made = uncut(ball), cut_at_random(ball, 4, seed)
    total = np.bincount(made.whole, area(made.places, made.faces), len(whole.faces))
    # Middles of sides are on the sides, however smooth the normals are.
    np.testing.assert_allclose(total, area(whole.places, whole.faces), rtol=1e-12)
    b, c = np.moveaxis(made.at / 2.0**DEEPEST, 2, 0)
    corners = whole.places[whole.faces][made.whole]
    there = np.einsum("tkw,twc->tkc", np.stack([1 - b - c, b, c], axis=2), corners)
    np.testing.assert_allclose(made.places[made.faces], there, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(made.normals, axis=1), 1, atol=1e-12)


def test_what_hangs_has_the_mean_of_its_side_and_what_hangs_on_that_a_quarter():
    # One triangle of the square is cut twice along the diagonal from (0, 0) to (4, 4), the other is whole.
    made = lightmesh.cut(uncut(SQUARE), np.array([True, False]))
    made = lightmesh.cut(made, np.array([False, True, False, False, False]))
    values = lightmesh.settled(made, np.column_stack([10.0 + np.arange(len(made.columns))] * 3))
    at = {tuple(p): v for p, v in zip(made.places[:, :2].tolist(), values[:, 0], strict=True)}
    raw = {tuple(p): 10.0 + k for k, p in enumerate(made.places[:, :2].tolist())}
    assert at[2, 2] == 0.5 * (at[0, 0] + at[4, 4]) != raw[2, 2]
    assert at[1, 1] == 0.75 * at[0, 0] + 0.25 * at[4, 4] != raw[1, 1]
    # (2, 1) is the middle of a side inside, of (2, 0) and (2, 2), which is whole on its other side.
    assert at[2, 1] == 0.5 * (at[2, 0] + at[2, 2]) and at[2, 0] == raw[2, 0] and at[1, 0] == raw[1, 0]


@pytest.mark.parametrize("seed", range(3))
def test_light_does_not_jump_from_a_triangle_to_the_next(seed):
    mesh = subdivided(SQUARE, 4.0)
    made = cut_at_random(mesh, 4, seed)
    raw = np.random.default_rng(seed).random((len(made.columns), 3))
    values, whole = lightmesh.settled(made, raw), uncut(mesh)
    sides, jumps = whole.sides, []
    for side in np.unique(sides):
        faces, corners = np.nonzero(sides == side)
        if len(faces) < 2:
            continue
        share, seen = np.linspace(0, 1, 33), []
        for face, k in zip(faces, corners, strict=True):
            weights = np.zeros((33, 3))
            first = whole.faces[face, k] < whole.faces[face, (k + 1) % 3]
            weights[:, k], weights[:, (k + 1) % 3] = (1 - share, share) if first else (share, 1 - share)
            seen.append([on_pieces(made, v, int(face), weights) for v in (values, raw)])
        jumps.append([np.abs(one - other).max() for one, other in zip(*seen, strict=True)])
    settled, unsettled = np.max(jumps, axis=0)
    assert settled < 1e-12 and unsettled > 0.1  # it would, if nothing were done about it


# Sheets


@pytest.mark.parametrize("seed", range(2))
def test_a_sheet_shows_what_the_pieces_show(seed):
    # Grids of all sizes, an odd number of some, on one sheet; triangles that are not cut have none.
    mesh = subdivided(SQUARE, 2.9)
    made = cut_at_random(mesh, 4, seed, 0.25)
    values = lightmesh.settled(made, np.random.default_rng(seed).random((len(made.columns), 3)))
    sheet, at = lightmap.sheet(made, values, 0, len(mesh.faces))
    deepest = np.zeros(len(mesh.faces), int)
    np.maximum.at(deepest, made.whole, made.depth)
    assert sheet is not None and deepest.min() == 0 and deepest.max() >= 3
    assert ((at >= 0).all(axis=(1, 2)) == (deepest > 0)).all() and (at[deepest == 0] == lightmap.NOWHERE).all()
    weights = np.concatenate([np.random.default_rng(7).dirichlet(np.ones(3), 40), np.eye(3), (1 - np.eye(3)) / 2])
    for face in np.flatnonzero(deepest):
        there, expected = weights @ at[face], on_pieces(made, values, int(face), weights)
        np.testing.assert_allclose(sheet.looked_up(there), expected, atol=1e-6)
        np.testing.assert_allclose(on_sheet(sheet.samples, there), expected, atol=1e-6)


def test_beside_a_grid_there_is_what_is_on_its_edge_and_no_light_of_another():
    things = [quad((3 * k, 0, 0), (1, 0, 0), (0, 1, 0)) for k in range(6)]
    made = cut_at_random(merged(*things), 3, 1, 0.7)
    values = np.repeat(1 + made.places[:, :1] // 3, 3, axis=1)
    weights = np.concatenate([np.eye(3), (1 - np.eye(3)) / 2])
    for first, count in ((0, 12), (2, 2), (6, 4)):  # of all, or of one mesh of several
        sheet, at = lightmap.sheet(made, values, first, count)
        grids = np.flatnonzero(at[:, 0, 0] >= 0)
        assert sheet is not None and len(grids) >= 1
        for k in grids:
            parts = np.abs(at[k, 1] - at[k, 0]).max()
            beside = weights + 1.3 / parts * (weights - 1 / 3)  # half a sample
            np.testing.assert_allclose(sheet.looked_up(beside @ at[k]), 1 + (first + k) // 2, rtol=1e-6)


@pytest.mark.parametrize("samples", [np.zeros((1, 4, 3)), np.zeros((4, 4)), np.full((2, 2, 3), np.nan)])
def test_a_sheet_that_is_none_is_refused(samples):
    with pytest.raises(ValueError, match="light map: "):
        LightMap(samples)
    with pytest.raises(ValueError, match="light and no light_at"):
        replace(SQUARE, light=LightMap(np.zeros((2, 2, 3))))


# Where light is asked for


def test_light_is_cut_where_it_bends_and_nowhere_else():
    made, radiance = found(walls(), disc)
    steps = np.abs(np.linalg.norm(made.places - [0.3, -0.9, -2.0], axis=1) - 0.58)
    # Sides may be as short as a 250th of the diagonal of 4 sqrt(3) m, 2.8 cm. So the diagonal of a wall is halved seven times
    # at most, and five times wherever it is.
    longest = made.lengths.max(axis=1)
    near = steps[made.faces].min(axis=1)
    assert longest.min() == pytest.approx(4 * np.sqrt(2) / 128)
    assert longest[near < 0.01].max() < 0.1 and longest[near > 1.0].min() > 0.15 and len(made.columns) < 12_000
    far = steps > 0.3
    np.testing.assert_allclose(radiance[far], disc(made.places[far]), atol=1e-12)


def test_smooth_light_is_off_by_no_more_than_is_asked_for():
    mesh = mapped(walls(), waves)
    assert mesh.light is not None and mesh.light_at is not None and len(mesh.faces) == 12 and len(mesh.vertices) == 36
    weights = np.random.default_rng(0).dirichlet(np.ones(3), 200)
    for face in mesh.faces:
        seen = mesh.light.looked_up(weights @ mesh.light_at[face])
        # Sides are halved that were off by 3 % of at most 0.65. That leaves a quarter, and a third more inside of triangles.
        assert np.abs(seen - waves(weights @ mesh.vertices[face])).max() < 0.013


def test_small_triangles_in_even_light_keep_their_vertices():
    ball = sphere(1.0, (0, 0, 0), 96, 48)
    mesh = mapped(ball, lambda p: np.full_like(p, 0.5))
    assert mesh.light is None and np.array_equal(mesh.vertices, ball.vertices) and np.array_equal(mesh.faces, ball.faces)
    np.testing.assert_allclose(mesh.radiance, 0.5)
    # A triangle across which light jumps is cut all the same.
    assert mapped(ball, lambda p: np.where(p[:, :1] > 0, 0.9, 0.1) * np.ones(3)).light is not None


def test_a_mesh_that_is_split_afterwards_has_the_same_light_and_one_baked_anew_the_same_vertices():
    mesh = mapped(walls(), waves)
    split = subdivided(mesh, 0.5)
    assert split.light is mesh.light and split.light_at is not None and len(split.faces) > 500
    middles = split.light_at[split.faces].mean(axis=1)
    np.testing.assert_allclose(split.light.looked_up(middles), waves(split.vertices[split.faces].mean(axis=1)), atol=0.013)
    again = mapped(mesh, waves)
    assert len(again.vertices) == 36 and np.array_equal(again.light.samples, mesh.light.samples)


def test_there_are_limits_to_how_much_is_cut(monkeypatch):
    monkeypatch.setattr(finer, "MOST", 4000)
    monkeypatch.setattr(finer, "MOST_SAMPLES", 20_000)
    made, _ = found(walls(), lambda p: np.random.default_rng(0).random((len(p), 3)))
    deepest = np.zeros(12, int)
    np.maximum.at(deepest, made.whole, made.depth)
    assert len(made.columns) <= 24 + 4000 + 4000 // 2 and lightmap.cost(deepest).sum() <= 20_000
