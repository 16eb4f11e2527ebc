"""The search on mirrors whose reflection points are known: textures are made in closed form, so only the search is judged."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from support.search_textures import EYE, SHAPES, SIZE, camera, on_screen, texture
from support.truth_shapes import alhazen, reverse_constructed, unit

from benchharness.kernels.vertices import search
from benchharness.kernels.vertices.textures import Texture
from benchharness.render.frame import view_of


def find(shape, V, *, cam=None, size=SIZE, kind="sq", neighbourhood="cross_then_diag", subtexel=True, stride=32, start=None):
    cam = cam or camera()
    view = view_of(cam, size, size, 0.01)
    column, row = start or (size // 2, size // 2)
    vertices = mi.Point3f(np.asarray(V, np.float32).T)
    lanes = len(V)
    found = search.find(
        search.Options(kind, neighbourhood, subtexel),
        Texture(texture(shape, cam, size), view),
        vertices,
        search.Start(*(dr.full(mi.Int32, value, lanes) for value in (column, row, stride))),
        dr.full(mi.Bool, True, lanes),
        dr.opaque(mi.UInt32, 4096),
    )
    dr.eval(found)
    return found


def off_px(found, R, cam=None, size=SIZE):
    return np.linalg.norm(on_screen(np.array(found.R, float).T, cam, size) - on_screen(R, cam, size), axis=1)


def test_the_oracle_obeys_the_law_of_reflection_and_one_case_by_hand():
    V = np.array([3.0, -1.0, 0.5])
    R = alhazen(EYE, V)
    np.testing.assert_allclose(unit(unit(EYE - R) + unit(V - R)), R, atol=1e-12)
    # Eye and vertex mirror images of each other in x = -y plane through the axis: R is halfway, at 45 degrees.
    np.testing.assert_allclose(alhazen(EYE, np.array([4.0, 0.0, 0.0])), [np.sqrt(0.5), -np.sqrt(0.5), 0], atol=1e-12)


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("neighbourhood", ["cross_then_diag", "full8"])
@pytest.mark.parametrize("stride", [1, 32])
def test_the_best_texel_holds_the_reflection_point(name, neighbourhood, stride):
    shape = SHAPES[name]
    V, R = reverse_constructed(shape, EYE, 0, 300, low_cos=0.5)
    on = np.abs(on_screen(R) - SIZE / 2).max(axis=1) < SIZE / 2 - 2
    V, R = V[on], R[on]
    found = find(shape, V, neighbourhood=neighbourhood, stride=stride, subtexel=False)
    # Half a texel in each axis is as near as a texel's centre gets. The score measures angles, which turn unequally fast
    # along the two axes where the mirror is slanted or curved unequally: its maximum may be the next texel (0.94 measured).
    off = np.abs(on_screen(np.array(found.R, float).T) - on_screen(R)).max(axis=1)
    assert np.median(off) < 0.5
    assert off.max() < 1.0
    assert np.array(found.reflected).all()


@pytest.mark.parametrize("name", SHAPES)
def test_refined_between_texels_it_is_within_a_tenth_of_a_texel(name):
    V, R = reverse_constructed(SHAPES[name], EYE, 1, 400, low_cos=0.3)
    on = np.abs(on_screen(R) - SIZE / 2).max(axis=1) < SIZE / 2 - 2
    found = find(SHAPES[name], V[on])
    off = off_px(found, R[on])
    converged = np.array(found.converged)
    assert converged.mean() > 0.95
    assert off[converged].max() < 0.1


def test_alhazen_points_on_the_sphere_are_found_and_none_that_says_converged_is_wrong():
    rng = np.random.default_rng(2)
    V = unit(rng.normal(size=(500, 3))) * rng.uniform(1.05, 6, (500, 1))
    d = unit(V - EYE)
    hidden = np.isfinite(SHAPES["sphere"].hit(EYE, V - EYE)) & (np.nan_to_num(SHAPES["sphere"].hit(EYE, V - EYE), nan=9) < 1)
    assert 0.02 < hidden.mean() < 0.5 and len(d) == 500
    R = np.array([alhazen(EYE, v) for v in V])
    found = find(SHAPES["sphere"], V)
    converged, off = np.array(found.converged), off_px(found, R)
    assert not converged[hidden].any()
    assert off[converged].max() < 0.5
    assert converged[~hidden].mean() > 0.85  # the rest reflects at the silhouette, where a texel has no neighbour


def test_every_hidden_vertex_is_flagged():
    rng = np.random.default_rng(3)
    target = unit(rng.normal(size=(2000, 3)))
    target = target[(target * unit(EYE - target)).sum(1) > 0.05][:300]
    assert len(target) == 300
    t_out = 1 + rng.uniform(0.05, 2.0, 300)  # behind the first hit, inside the sphere or in its shadow
    V = EYE + t_out[:, None] * (target - EYE)
    found = find(SHAPES["sphere"], V)
    assert np.array(found.hidden).sum() == 300
    assert not np.array(found.valid).any()


def test_a_vertex_straight_behind_the_mirror_gives_numbers_and_no_answer():
    found = find(SHAPES["sphere"], np.array([[0.0, 3.0, 0.0], [0.0, 0.0, 0.0]]))
    for value in (found.R, found.n, found.residual):
        assert np.isfinite(np.array(value)).all()
    assert not np.array(found.converged).any()


def test_the_cross_alone_gets_stuck_and_the_diagonals_free_it():
    V, R = reverse_constructed(SHAPES["ellipsoid"], EYE, 4, 600, low_cos=0.5)
    off = {
        kind: off_px(find(SHAPES["ellipsoid"], V, neighbourhood=kind, stride=1, subtexel=False), R).max()
        for kind in ("cross_only", "cross_then_diag")
    }
    assert off["cross_then_diag"] < 1.4
    assert off["cross_only"] > off["cross_then_diag"]


def test_wide_strides_find_the_same_texels_in_a_fraction_of_the_steps():
    V, _ = reverse_constructed(SHAPES["sphere"], EYE, 5, 300, low_cos=0.15)
    slow, quick = (find(SHAPES["sphere"], V, stride=stride, subtexel=False) for stride in (1, 32))
    same = (np.array(slow.column) == np.array(quick.column)) & (np.array(slow.row) == np.array(quick.row))
    assert same.mean() > 0.98
    assert np.array(quick.iterations).mean() < 0.35 * np.array(slow.iterations).mean()


def test_a_start_on_the_answer_takes_one_iteration():
    V, _R = reverse_constructed(SHAPES["sphere"], EYE, 6, 1, low_cos=0.5)
    first = find(SHAPES["sphere"], V, subtexel=False)
    again = find(SHAPES["sphere"], V, subtexel=False, stride=1, start=(int(first.column[0]), int(first.row[0])))
    assert int(again.iterations[0]) == 1
    assert int(again.reads[0]) == 9


def test_the_dot_product_in_float32_is_flat_where_the_difference_is_not():
    # A close-up of one degree: bisectors of neighbouring texels differ by less than float32's cosine resolves.
    cam = camera(fov_deg=1.0)
    V, R = reverse_constructed(SHAPES["sphere"], EYE, 7, 60000, low_cos=0.9995)
    on = np.abs(on_screen(R, cam, 512) - 256).max(axis=1) < 240
    V, R = V[on][:200], R[on][:200]
    assert len(V) > 50
    off = {
        kind: np.median(off_px(find(SHAPES["sphere"], V, cam=cam, size=512, kind=kind, subtexel=False), R, cam, 512))
        for kind in ("dot", "sq")
    }
    assert off["sq"] < 0.6
    assert off["dot"] > 1.0  # 1.2 measured


def test_inverse_search_ends_where_the_vertex_itself_is_seen():
    rng = np.random.default_rng(8)
    target = unit(rng.normal(size=(1000, 3)))
    target = target[(target * unit(EYE - target)).sum(1) > 0.3][:100]
    V = EYE + 1.2 * (target - EYE)
    view = view_of(camera(), SIZE, SIZE, 0.01)
    lanes = len(V)
    vertices = mi.Point3f(V.astype(np.float32).T)
    top = search.climb(
        search.Options("inverse", "cross_then_diag"),
        Texture(texture(SHAPES["sphere"], camera()), view),
        vertices,
        search.Start(*(dr.full(mi.Int32, value, lanes) for value in (SIZE // 2, SIZE // 2, 1))),
        dr.full(mi.Bool, True, lanes),
        dr.opaque(mi.UInt32, 4096),
    )
    texel = np.stack([np.array(top.column), np.array(top.row)], axis=1) + 0.5
    assert np.linalg.norm(texel - on_screen(V), axis=1).max() < 1.5


def test_a_search_that_the_edge_of_the_texture_stops_says_so():
    # The sphere fills more than the picture; these vertices reflect beyond its edge.
    cam = camera(fov_deg=12.0)
    V, R = reverse_constructed(SHAPES["sphere"], EYE, 9, 300, low_cos=0.2, high_cos=0.8)
    beyond = np.abs(on_screen(R, cam) - SIZE / 2).max(axis=1) > SIZE / 2 + 3
    assert beyond.sum() > 50
    found = find(SHAPES["sphere"], V[beyond], cam=cam)
    assert np.array(found.border).all()
    assert not np.array(found.converged).any()
