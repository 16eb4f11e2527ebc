"""Rays between two rows: on planes and steps whose hits are known by geometry."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from support.depth_objects import built, device
from support.depth_scenes import egg
from support.mirror_room import shaded

from benchharness.kernels.images import depthray, rowpair
from benchharness.kernels.images.depthmap import BACKGROUND, Layout
from benchharness.render.frame import FrameRenderer
from methods.depth_impostor import DepthImpostor
from methods.ray_traced import RayTraced

W, C = 256, 127.5


def segment(a, b):
    """Images of rays, from a to b [N, 3] in (x, y, zgl)."""
    a, b = (mi.Vector3f(*np.asarray(q, np.float32).T) for q in (a, b))
    dr.make_opaque(a, b)
    one = dr.opaque(mi.Float, 1)
    return depthray.Segment(
        a, b, mi.Float(0), one, one, one, dr.zeros(mi.UInt32, dr.width(a)), dr.full(mi.Bool, True, dr.width(a))
    )


def met(depth, a, b, n, m=16):
    """Hits (found, t) of the nearest rows, in the picture as `relief` asks, and between two rows."""
    layout, rows, _ = built(depth, n, m)
    seg, texels = segment(a, b), device(depth)
    place = layout.place(mi.UInt32(0))
    one = depthray.meet_rows(seg, rows, layout)
    one.found &= rowpair.texel(texels, place, one.x, one.y, one.found) < 1.5
    two = rowpair.meet(seg, rows, layout, texels, place)
    return [(np.array(hit.found), np.array(hit.t)) for hit in (one, two)]


def images(count=400, length=120.0, dz=0.3, seed=3):
    """Rays' images of any angle about the middle of the map, which rise from 0.35 in zgl: a, b, and how far they go."""
    rng = np.random.default_rng(seed)
    psi, shift = rng.uniform(-np.pi, np.pi, count), rng.uniform(-20, 20, (count, 2))
    way = 0.5 * length * np.stack([np.cos(psi), np.sin(psi)], 1)
    middle = C + shift
    rise = np.full(count, 0.5 * dz)
    return np.column_stack([middle - way, 0.5 - rise]), np.column_stack([middle + way, 0.5 + rise])


def share_at(a, b, value):
    """Where between a and b a linear `value` of the point is 0."""
    one, two = value(a), value(b)
    return one / (one - two)


def test_on_a_leaning_plane_two_rows_meet_where_the_image_does():
    """Nearest of 9 rotations: up to 10 degrees off, 10 texels at the end of a half of 60. Between two rows, rounding is left:
    of rows and samples to whole texels, and of the polyline."""
    lean = np.array([0.0006, 0.0011])
    y, x = np.mgrid[:W, :W]
    depth = 0.5 + lean[0] * (x - C) + lean[1] * (y - C) + 0.02
    a, b = images()
    shift = np.linspace(-0.1, 0.1, len(a))
    a[:, 2], b[:, 2] = a[:, 2] + shift, b[:, 2] + shift
    t = share_at(a, b, lambda q: q[:, 2] - (0.52 + (q[:, :2] - C) @ lean))
    (near_found, near), (pair_found, pair) = met(depth, a, b, n=9)
    inside = (t > 0.05) & (t < 0.95)
    assert inside.mean() > 0.6 and near_found[inside].all() and pair_found[inside].all()
    off = [120 * np.abs(found - t)[inside] for found in (near, pair)]
    assert np.percentile(off[1], 95) < 0.4 * np.percentile(off[0], 95) and off[1].mean() < 0.5 * off[0].mean()


@pytest.mark.parametrize("n", [9, 18])
def test_at_the_straight_edge_of_a_card_fewer_rays_miss(n):
    """A card at zgl 0.5 whose edge runs at 35 degrees. A ray comes to that depth amid its image, on the card or beside it."""
    y, x = np.mgrid[:W, :W]
    across = np.array([np.cos(np.radians(35.0)), np.sin(np.radians(35.0))])
    depth = np.where((x - C) * across[0] + (y - C) * across[1] > 0, 0.5, BACKGROUND)
    rng = np.random.default_rng(5)
    a, b = images(4000, seed=7)
    shift = rng.uniform(-0.14, 0.14, 4000)
    a[:, 2], b[:, 2] = a[:, 2] + shift, b[:, 2] + shift
    t = share_at(a, b, lambda q: q[:, 2] - 0.5)
    at = a + t[:, None] * (b - a)
    away = (at[:, :2] - C) @ across
    hits, clear = away > 0, np.abs(away) > 0.8  # texels are squares
    (near, t_near), (pair, t_pair) = met(depth, a, b, n)
    wrong = [((found != hits) & clear).sum() for found in (near, pair)]
    assert wrong[0] > 8 and wrong[1] < 0.6 * wrong[0], wrong
    both = near & pair & hits
    np.testing.assert_allclose(t_pair[both], t[both], atol=1e-3)
    np.testing.assert_allclose(t_near[both], t[both], atol=1e-3)


def test_the_two_rows_lie_on_either_side_of_the_image():
    layout = Layout(1, W, 7, 8)
    psi = np.linspace(-np.pi, np.pi, 721) + 1e-3
    way = 80 * np.stack([np.cos(psi), np.sin(psi), np.zeros(721)], 1)
    middle = np.array([C, C, 0.5])
    seg = segment(middle - way, middle + way)
    off = []
    for second in (False, True):
        row, active, u_a, u_b = depthray.row_of(seg, layout, "mid", second=second)
        row, u_a, u_b = (np.array(one) for one in (row, u_a, u_b))
        assert np.array(active).all()
        theta = (row // W) * np.pi / 7
        off.append((psi - theta + np.pi / 2) % np.pi - np.pi / 2)
        assert (np.sign(u_b - u_a) == np.sign(np.cos(psi - theta))).all()
    assert np.abs(off[0]).max() < np.pi / 14 + 1e-4 and np.abs(off[1]).max() < np.pi / 7 + 1e-4
    np.testing.assert_allclose(np.abs(off[0]) + np.abs(off[1]), np.pi / 7, atol=1e-4)
    assert (np.sign(off[0]) != np.sign(off[1])).all()


def test_between_two_of_few_rotations_a_body_is_nearer_to_where_it_is():
    """Measured: distances are off by 8.0 % in the median with the nearest of 9 rotations, and by 1.8 % between two."""
    made = egg()
    renderer = FrameRenderer(made, 160, 120)
    ways = (DepthImpostor(128, 9), DepthImpostor(128, 9, intersector="srdm_interpolated"))
    near, pair = (shaded(way, made, 0, renderer=renderer)[0] for way in ways)
    exact = shaded(RayTraced(), made, 0, renderer=renderer)[0]
    seen = [one.active & np.isfinite(one.distance) for one in (near, pair, exact)]
    inner = seen[0] & seen[1] & seen[2]
    assert inner.sum() > 500 and (seen[1] & ~seen[2]).sum() < 0.15 * inner.sum()
    assert (seen[2] & ~seen[1]).sum() < 0.8 * (seen[2] & ~seen[0]).sum()
    error = [np.median(np.abs(one.distance[inner] / exact.distance[inner] - 1)) for one in (near, pair)]
    assert error[1] < 0.5 * error[0], error
    work = [int(np.array(one.reflection.counters["depth_steps"], np.int64).sum()) for one in (near, pair)]
    assert 1.5 * work[0] < work[1] < 2.5 * work[0]
