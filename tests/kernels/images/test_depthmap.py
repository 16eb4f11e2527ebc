"""Simplified rows of depth maps against the greedy rule worked by hand and by an oracle."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from oracles.depth_oracle import BACKGROUND, camera, encoded, samples, simplified
from support.depth_objects import as_array, built, bump, comb, device, figure

from benchharness.kernels.frozen import frozen
from benchharness.kernels.images import deptherror, depthmap, depthrows

NEAR_A_TIE = 1e-4  # pixels: float32 may take the neighbouring texel
CLOSE_CHOICE = 1e-6  # zgl: float32 may split elsewhere


def test_oracle_by_hand():
    """A roof of two slopes with a gap and a single sample: errors of the line from 0 to 4 are 0.1, 0.2, 0.1."""
    values = np.array([0.1, 0.2, 0.3, 0.2, 0.1, BACKGROUND, 0.5, BACKGROUND])
    lines, dropped, margin = simplified(values, 4)
    assert lines == [[0, 2, 4], [6]] and dropped == 0 and margin == pytest.approx(0.1)
    np.testing.assert_allclose(encoded(lines, values, 4), [[0, 0.1], [2, 0.3], [-5, 0.1], [-7, 0.5]])
    assert simplified(values, 2)[:2] == ([[0, 4]], 1)
    assert simplified(values, 6, split_jump=0.05)[1] == 3  # six spans of a sample each; three fit


def lone_texels(w=48):
    depth = np.full((w, w), BACKGROUND)
    depth[5::7, 3::5] = 0.3
    return depth


def ball_before_wall(w=64):
    depth = np.full((w, w), 0.8)
    y, x = np.mgrid[:w, :w] - 30.0
    return np.where(x * x + y * y < 200, 0.2 + 0.001 * x, depth)


@pytest.mark.parametrize(
    ("depth", "m", "split_jump"),
    [(bump(), 8, None), (bump(), 64, None), (comb(), 8, None), (comb(), 4, None), (figure(64)[1], 8, None),
     (figure(64)[1], 8, 0.02), (lone_texels(), 8, None), (ball_before_wall(), 8, None), (ball_before_wall(), 8, 0.3)],
)  # fmt: skip
def test_rows_are_the_greedy_ones(depth, m, split_jump):
    n = 6
    layout, rows, dropped = built(depth, n, m, split_jump)
    rows, dropped = as_array(layout, rows)[0], np.array(dropped).reshape(n, layout.w)
    compared = 0
    for i in range(n):
        for j in range(layout.w):
            values, margin = samples(depth, n, i, j)
            lines, count, choice = simplified(values, m, split_jump)
            if margin > NEAR_A_TIE:
                assert dropped[i, j] == count
            if margin > NEAR_A_TIE and choice > CLOSE_CHOICE:
                np.testing.assert_allclose(rows[i, j], encoded(lines, values, m), atol=1e-6)
                compared += 1
    assert compared > 0.7 * n * layout.w


def test_memory_is_the_papers():
    layout, rows, dropped = built(figure()[1], 60, 8)
    assert layout.byte_count == 983_040 == np.array(rows).nbytes
    assert dr.width(dropped) == 60 * 256


def test_a_comb_of_twenty_teeth_keeps_four_in_eight_points():
    """The longest tooth is the first; of the equal others the first three stay."""
    layout, rows, dropped = built(comb(), 2, 8)
    row = as_array(layout, rows)[0, 0, 60]
    assert np.array(dropped)[60] == 16
    np.testing.assert_array_equal(row[:, 0], [4, -8, 10, -13, 16, -19, 22, -25])


def test_longest_spans_are_kept_wherever_they_are():
    depth = np.full((64, 64), BACKGROUND)
    for start, length in ((2, 2), (8, 7), (20, 3), (30, 9), (45, 4), (55, 7)):
        depth[:, start : start + length] = 0.5
    layout, rows, dropped = built(depth, 1, 6)
    np.testing.assert_array_equal(as_array(layout, rows)[0, 0, 10, :, 0], [8, -15, 30, -39, 55, -62])
    assert np.all(np.array(dropped) == 3)


def test_the_first_of_equal_spans_stays():
    depth = np.full((64, 64), BACKGROUND)
    for start, length in ((2, 3), (10, 3), (20, 8)):
        depth[:, start : start + length] = 0.5
    layout, rows, _ = built(depth, 1, 4)
    np.testing.assert_array_equal(as_array(layout, rows)[0, 0, 10, :, 0], [2, -5, 20, -28])


def test_an_empty_map_is_all_pen_up():
    layout, rows, dropped = built(np.full((32, 32), BACKGROUND), 4, 6)
    rows = as_array(layout, rows)
    assert np.all(rows[..., 0] == -33) and np.all(rows[..., 1] == BACKGROUND) and np.all(np.array(dropped) == 0)


def test_a_plate_filling_the_map_loses_its_corners_at_45_degrees():
    """A unit square and itself turned by 45 degrees overlap in a regular octagon of area 2 (sqrt 2 - 1) = 0.828."""
    w = 256
    layout, rows, _ = built(np.full((w, w), 0.5), 4, 4)
    rows = as_array(layout, rows)[0]
    ends = np.sort(np.where(rows[..., 0] < 0, -rows[..., 0] - 1, rows[..., 0]), axis=-1)
    covered = (ends[..., -1] - ends[..., 0] + 1).sum(axis=-1) / w**2
    assert covered[0] == covered[2] == 1
    assert covered[1] == pytest.approx(2 * (np.sqrt(2) - 1), abs=0.005)


def test_maps_in_one_buffer_do_not_mix():
    maps = np.stack([bump(), ball_before_wall(), figure(64)[1]])
    layout, rows, dropped = built(maps, 5, 8)
    for k, depth in enumerate(maps):
        single, alone, dropped_alone = built(depth, 5, 8)
        np.testing.assert_array_equal(as_array(layout, rows)[k], as_array(single, alone)[0])
        np.testing.assert_array_equal(np.array(dropped).reshape(3, -1)[k], np.array(dropped_alone))


def test_recorded_build_follows_the_map():
    layout = depthmap.Layout(1, 64, 5, 8)
    record = frozen(lambda depth: depthrows.build(depth, layout))
    for depth in (bump(), ball_before_wall(), bump()):
        rows, _ = record(device(depth))
        np.testing.assert_array_equal(as_array(layout, rows), as_array(*built(depth, 5, 8)[:2]))


def test_loss_is_that_of_polylines_drawn_in_numpy():
    depth, cam, n, m = figure(64)[1], camera(64), 4, 8
    layout, rows, _ = built(depth, n, m)
    loss = deptherror.simplification(device(depth), device(cam.packet()), rows, layout)
    differences, depths, count = [], [], 0
    for i in range(n):
        for j in range(layout.w):
            values, _ = samples(depth, n, i, j)
            count += np.sum(values < 1.5)
            for line in simplified(values, m)[0]:
                u = np.arange(line[0], line[-1] + 1)
                drawn = np.interp(u, line, values[line])
                differences.append(np.abs(drawn - values[u]))
                depths.append(np.abs(cam.Z(drawn) - cam.Z(values[u])) / cam.Z(values[u]))
    differences, depths = np.concatenate(differences), np.concatenate(depths)
    assert abs(loss.samples - len(differences)) <= 4 and loss.samples + loss.unspanned == pytest.approx(count, abs=4)
    assert loss.zgl == pytest.approx(differences.mean(), rel=0.02) and loss.depth == pytest.approx(depths.mean(), rel=0.02)
    assert loss.zgl_most == pytest.approx(differences.max(), rel=0.02)


def test_loss_decays_with_m_as_in_the_paper():
    """The paper: 1.43, 0.9, 0.7, 0.5, 0.4 % of z for m = 8 to 16, that is to 0.63, 0.49, 0.35, 0.28 of the first."""
    cam, depth = figure()
    losses = []
    for m in (8, 10, 12, 14, 16, 32):
        layout, rows, _ = built(depth, 18, m)
        losses.append(deptherror.simplification(device(depth), device(cam.packet()), rows, layout))
    share = np.array([loss.depth for loss in losses]) / losses[0].depth
    assert np.all(np.diff(share) < 0) and 0.15 < share[4] < 0.45 and share[5] < 0.12
    assert losses[0].depth < 0.0143 and losses[0].range > losses[0].depth  # zf - zn = 2 is less than z


@pytest.mark.parametrize(
    ("sizes", "text"),
    [((1, 256, 60, 7), "m = 7"), ((1, 256, 60, 66), "m = 66"), ((1, 256, 181, 8), "n = 181"), ((0, 256, 60, 8), "count = 0"),
     ((1, 1, 60, 8), "w = 1")],
)  # fmt: skip
def test_impossible_sizes_are_named(sizes, text):
    with pytest.raises(ValueError, match=text):
        depthmap.Layout(*sizes)


def test_a_texel_reaches_half_way_to_its_neighbours():
    depth = device(np.arange(16).reshape(4, 4) / 16)
    x, y = mi.Float([1.49, 1.51, -0.49, -0.51, 3.49, 3.51]), mi.Float([2.0] * 6)
    found = np.array(depthmap.texel(depth, depthmap.Layout(1, 4, 1, 2).place(mi.UInt32(0)), x, y))
    np.testing.assert_allclose(found, [9 / 16, 10 / 16, 8 / 16, BACKGROUND, 11 / 16, BACKGROUND])
