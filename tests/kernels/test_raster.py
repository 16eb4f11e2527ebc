"""The rasterizer against a float64 oracle: one ray through each pixel centre, every triangle tried."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from support.packed import numbers, packed

from benchharness.kernels import raster
from benchharness.kernels.images import atlas
from benchharness.render.frame import view_of
from benchharness.scene import Camera

CAMERA = Camera(eye=(0.0, -3.0, 0.0), target=(0.0, 0.0, 0.0), fov_deg=50.0)
NEAR = 0.1


def drawn(vertices, faces, width, height, near=NEAR, tag=0, **options):
    """Triangle per pixel, -1 where none."""
    points, indices = packed(vertices, faces, tag)
    view = view_of(CAMERA, width, height, near)
    triangle = numbers(raster.rasterize(points, indices, len(faces), view, **options), view)
    return np.where(triangle == raster.NONE, -1, triangle).reshape(height, width)


def rays(width, height):
    right, down, forward = CAMERA.axes()
    focal = 0.5 * height / np.tan(0.5 * np.radians(CAMERA.fov_deg))
    x, y = np.meshgrid(np.arange(width) + 0.5 - 0.5 * width, np.arange(height) + 0.5 - 0.5 * height)
    return forward + x[..., None] / focal * right + y[..., None] / focal * down


def oracle(vertices, faces, width, height, near=NEAR, kept=None, least=None):
    """(triangle per pixel or -1, how near the decision was): signed volumes of the ray with each edge, in float64.

    kept    bool [F], triangles to draw; all if None
    least   (values [V], floor [H, W]): a second value and what it must reach; of triangles wholly in front of the near plane
    """
    d = rays(width, height)
    corners = np.asarray(vertices, np.float32).astype(np.float64)[faces] - np.asarray(CAMERA.eye)
    best, winner, margin = np.full(d.shape[:2], np.inf), np.full(d.shape[:2], -1), np.full(d.shape[:2], np.inf)
    for k, (a, b, c) in enumerate(corners):
        if kept is not None and not kept[k]:
            continue
        volumes = np.stack([d @ np.cross(b, c), d @ np.cross(c, a), d @ np.cross(a, b)], axis=-1)
        total = volumes.sum(axis=-1)
        weights = volumes / np.where(total == 0, np.inf, total)[..., None]
        depths = np.stack([a, b, c]) @ CAMERA.axes()[2]
        depth = np.where(total == 0, -1, weights @ depths)
        inside = (weights >= 0).all(axis=-1) & (depth > near)
        margin = np.minimum(margin, np.where(depth > 0, np.abs(weights).min(axis=-1), np.inf))
        if least is not None and (depths > near).all():
            # Perspective-correct weights times depth are those of the screen, but for their sum.
            value = weights @ (depths * least[0][faces[k]]) / np.where(depth == 0, np.inf, depth)
            margin = np.where(inside, np.minimum(margin, np.abs(value - least[1])), margin)
            inside &= value >= least[1]
        closer = inside & (depth < best)
        margin = np.where(inside & np.isfinite(best), np.minimum(margin, np.abs(depth - best)), margin)
        best, winner = np.where(closer, depth, best), np.where(closer, k, winner)
    return winner, margin


def soup(seed, count, spread, size):
    rng = np.random.default_rng(seed)
    vertices = (rng.normal(scale=spread, size=(count, 1, 3)) + rng.normal(scale=size, size=(count, 3, 3))).reshape(-1, 3)
    return vertices, np.arange(3 * count).reshape(-1, 3)


@pytest.mark.parametrize(("count", "spread", "size"), [(300, 0.8, 0.1), (30, 0.5, 1.0), (12, 1.0, 3.0)])
def test_the_nearest_triangle_wins_at_every_pixel_centre(count, spread, size):
    vertices, faces = soup(count, count, spread, size)
    expected, margin = oracle(vertices, faces, 160, 120)
    got = drawn(vertices, faces, 160, 120)
    # A centre within 1e-4 of an edge (barycentric) or of a second surface may go either way in float32.
    clear = margin > 1e-4
    assert clear.mean() > 0.97
    assert (got == expected)[clear].all()


def test_a_triangle_through_the_near_plane_is_drawn_up_to_it_and_not_behind_the_eye():
    vertices = np.array([[-2.0, 2.0, -0.7], [2.0, 2.0, -0.5], [0.1, -9.0, -0.6]])  # a floor that runs under the eye
    faces = np.array([[0, 1, 2]])
    for near in (0.01, 0.5, 2.0):
        expected, margin = oracle(vertices, faces, 160, 120, near)
        got = drawn(vertices, faces, 160, 120, near)
        assert 0 < (expected == 0).sum() < expected.size
        assert (got == expected)[margin > 1e-4].all()
    assert (drawn(vertices, faces, 160, 120, 0.01) >= 0).sum() > (drawn(vertices, faces, 160, 120, 2.0) >= 0).sum()


def test_a_triangle_with_an_edge_at_the_depth_of_the_eye_is_drawn_whichever_way_it_is_wound():
    """Both ends of the edge have depth 0 to the last bit: its edge function is a number that is the same at every pixel."""
    for below in (-0.5, 0.7):
        vertices = np.array([[-2.0, CAMERA.eye[1], below], [2.0, CAMERA.eye[1], below], [0.3, 2.0, 1.2 * below]])
        for faces in np.array([[[0, 1, 2]], [[0, 2, 1]]]):
            expected, margin = oracle(vertices, faces, 160, 120, 0.01)
            got = drawn(vertices, faces, 160, 120, 0.01)
            assert (expected == 0).sum() > 1000
            assert (got == expected)[margin > 1e-4].all()


def facing_grid(columns, rows, width, height, jitter, seed=0):
    """A grid of triangles that fills the picture and hangs over its edge; its vertices are given in pixels."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(-3, width + 3, columns), np.linspace(-3, height + 3, rows))
    pixels = np.stack([x.ravel(), y.ravel()], axis=1) + rng.uniform(-jitter, jitter, (columns * rows, 2))
    i = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    faces = np.concatenate([np.stack([i, i + 1, i + columns], 1), np.stack([i + 1, i + columns + 1, i + columns], 1)])
    return at_pixels(pixels, rng.uniform(1.5, 4, len(pixels)), width, height), rng.permutation(faces)


def at_pixels(pixels, depth, width, height):
    right, down, forward = CAMERA.axes()
    focal = 0.5 * height / np.tan(0.5 * np.radians(CAMERA.fov_deg))
    offset = (pixels - [0.5 * width, 0.5 * height]) / focal
    return np.asarray(CAMERA.eye) + depth[:, None] * (forward + offset[:, :1] * right + offset[:, 1:] * down)


@pytest.mark.parametrize("cells", [(4, 3), (9, 7)])
def test_triangles_that_share_edges_leave_no_hole_and_no_pixel_twice(cells):
    width, height = 96, 64
    vertices, faces = facing_grid(*cells, width, height, jitter=2.0)
    hits = np.zeros((height, width), int)
    for k in range(len(faces)):
        hits += drawn(vertices, faces, width, height, drawn=dr.arange(mi.UInt32, len(faces)) == k) >= 0
    assert (hits == 1).all()


def test_vertices_and_edges_on_pixel_centres_belong_to_exactly_one_triangle():
    # An orthographic-like set-up: power-of-two focal length and depth, so that vertices project exactly onto centres.
    width, height = 64, 64
    i, j = np.meshgrid(np.arange(0, 65, 8), np.arange(0, 65, 8))
    pixels = np.stack([i.ravel() + 0.5 - 4, j.ravel() + 0.5 - 4], axis=1)
    k = (np.arange(8)[:, None] * 9 + np.arange(8)).ravel()
    faces = np.concatenate([np.stack([k, k + 1, k + 9], 1), np.stack([k + 1, k + 10, k + 9], 1)])
    view = view_of(Camera((0.0, -1.0, 0.0), (0.0, 0.0, 0.0), 90.0), width, height, NEAR)  # focal length 32 px
    vertices = np.stack([(pixels[:, 0] - 32) / 32, np.zeros(len(pixels)), (32 - pixels[:, 1]) / 32], axis=1)
    points, indices = packed(vertices, faces)
    hits = np.zeros((height, width), int)
    for t in range(len(faces)):
        one = raster.rasterize(points, indices, len(faces), view, drawn=dr.arange(mi.UInt32, len(faces)) == t)
        hits += (numbers(one, view) != raster.NONE).reshape(height, width)
    assert (hits[:60, :60] == 1).all()
    assert hits.max() == 1


def test_equal_depth_goes_to_the_lower_number():
    vertices, faces = soup(2, 1, 0.0, 1.0)
    assert set(np.unique(drawn(vertices, np.repeat(faces, 3, axis=0), 64, 48))) == {-1, 0}


def test_what_has_no_area_or_lies_behind_the_eye_draws_nothing():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, -9, 0], [1, -9, 0], [0, -9, 1]], float)
    faces = np.array([[0, 1, 2], [0, 0, 1], [3, 4, 5]])
    assert (drawn(vertices, faces, 64, 48) == -1).all()


def test_culling_keeps_what_runs_counter_clockwise_seen_from_the_eye():
    vertices = np.array([[-1, 0, -1], [1, 0, -1], [0, 0, 1]], float)
    front, back = np.array([[0, 1, 2]]), np.array([[0, 2, 1]])
    assert (drawn(vertices, front, 64, 48, cull="back", tag=raster.CLOSED) == 0).any()
    assert (drawn(vertices, back, 64, 48, cull="back", tag=raster.CLOSED) == -1).all()
    assert (drawn(vertices, back, 64, 48, cull="back") == 0).any()  # an open sheet has two sides


@pytest.mark.parametrize(("count", "spread", "size"), [(300, 0.8, 0.1), (30, 0.5, 1.0), (12, 1.0, 3.0)])
def test_culling_the_front_leaves_the_nearest_back(count, spread, size):
    vertices, faces = soup(count, count, spread, size)
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    away = (np.cross(b - a, c - a) * (a - CAMERA.eye)).sum(axis=1) > 0  # clockwise seen from the eye
    assert 0.2 < away.mean() < 0.8
    expected, margin = oracle(vertices, faces, 160, 120, kept=away)
    for tag in (0, raster.CLOSED):
        got = drawn(vertices, faces, 160, 120, cull="front", tag=tag)
        clear = margin > 1e-4
        assert clear.mean() > 0.97
        assert (got == expected)[clear].all()


@pytest.mark.parametrize(("count", "spread", "size"), [(300, 0.8, 0.1), (30, 0.5, 1.0), (12, 1.0, 3.0)])
def test_a_second_value_is_linear_on_the_screen_and_drawn_where_it_reaches_the_floor(count, spread, size):
    vertices, faces = soup(count, count, spread, size)
    values = np.random.default_rng(count).uniform(-1, 1, len(vertices)).astype(np.float32).astype(np.float64)
    y, x = np.mgrid[:120, :160]
    floor = (0.5 * np.sin(0.11 * x) * np.cos(0.07 * y)).astype(np.float32).astype(np.float64)
    expected, margin = oracle(vertices, faces, 160, 120, least=(values, floor))
    least = mi.Float(values), mi.Float(floor.ravel())
    got = drawn(vertices, faces, 160, 120, least=least)
    # Planes of triangles that are seen nearly edge-on lose digits.
    clear = margin > 1e-3
    assert clear.mean() > 0.8
    assert ((got != expected) & clear).sum() <= 1
    without, _ = oracle(vertices, faces, 160, 120)
    assert ((expected != without) & clear).sum() > 500
    assert ((expected != without) & (expected >= 0) & clear).sum() > 100  # and what lies behind shows
    # Together with a stencil, both hold.
    shut = (x + y) % 2 == 0
    both = drawn(vertices, faces, 160, 120, least=least, limit=mi.Float(np.where(shut, 0, 1e9).astype(np.float32).ravel()))
    assert (both == np.where(shut, -1, got)).all()


def test_a_second_value_equal_to_the_floor_is_drawn():
    vertices, faces = np.array([[-9, 0, -9], [9, 0, -9], [0, 0, 18]], float), np.array([[0, 1, 2]])
    floor = dr.full(mi.Float, 2.0, 48 * 64)
    for value, drawn_there in ((2.0, 0), (1.999, -1), (2.001, 0)):
        picture = drawn(vertices, faces, 64, 48, least=(dr.full(mi.Float, value, 3), floor))
        assert (picture == drawn_there).all()


def test_a_triangle_through_the_near_plane_passes_any_floor():
    vertices = np.array([[-2.0, 2.0, -0.7], [2.0, 2.0, -0.5], [0.1, -9.0, -0.6]])
    faces = np.array([[0, 1, 2]])
    least = dr.full(mi.Float, -5.0, 3), dr.full(mi.Float, 7.0, 160 * 120)
    assert (drawn(vertices, faces, 160, 120, least=least) == drawn(vertices, faces, 160, 120)).all()


def test_a_limit_is_a_stencil_and_a_surface_behind_which_everything_lies():
    vertices = np.array([[-9, 0, -9], [9, 0, -9], [0, 0, 18]], float)
    faces = np.array([[0, 1, 2]])
    rows = (np.arange(48 * 64) // 64 % 3).astype(np.float32)
    picture = drawn(vertices, faces, 64, 48, limit=mi.Float(rows))  # 1/w of the triangle is 1/3: shut, open, open
    assert (picture == np.where(rows.reshape(48, 64) >= 1, 0, -1)).all()
    assert (drawn(vertices, faces, 64, 48, limit=dr.full(mi.Float, 0.33, 48 * 64)) == -1).all()
    assert (drawn(vertices, faces, 64, 48, limit=dr.full(mi.Float, 0.34, 48 * 64)) == 0).all()


def test_points_and_weights_are_perspective_correct():
    vertices = np.array([[-2.0, -1.0, -1.0], [2.0, 6.0, -1.0], [0.0, 2.0, 3.0]])  # strongly tilted
    points, indices = packed(vertices, np.array([[0, 1, 2]]))
    view = view_of(CAMERA, 80, 60, NEAR)
    lane = dr.arange(mi.UInt32, 80 * 60)
    hit, _, weights, p = raster.seen(points, indices, raster.rasterize(points, indices, 1, view), view, lane)
    hit, weights, p = np.array(hit), np.array(weights).T, np.array(p).T
    # By hand: the ray through a centre meets the plane of the triangle at t = ((a - e).n) / (d.n).
    n = np.cross(vertices[1] - vertices[0], vertices[2] - vertices[0])
    d = rays(80, 60).reshape(-1, 3)
    t = ((vertices[0] - CAMERA.eye) @ n) / (d @ n)
    expected = np.asarray(CAMERA.eye) + t[:, None] * d
    assert hit.sum() > 500
    np.testing.assert_allclose(p[hit], expected[hit], atol=2e-5)
    np.testing.assert_allclose(weights[hit] @ vertices, expected[hit], atol=2e-5)


def test_a_triangle_is_drawn_in_its_own_layer_alone():
    width, height = 40, 24
    corners = np.array([(-5.0, -5.0), (100.0, -5.0), (-5.0, 100.0)])
    points = np.concatenate([at_pixels(corners, np.full(3, depth), width, height) for depth in (2.0, 2.5)])
    triangles = np.arange(6).reshape(2, 3)
    there = np.where(np.tile(np.arange(width), height) < 20, 7, 1_000_000).astype(np.uint32)
    shown = drawn(points, triangles, width, height, layers=(mi.UInt32([7, 1_000_000]), mi.UInt32(there)))
    assert (shown[:, :20] == 0).all() and (shown[:, 20:] == 1).all()
    assert (drawn(points, triangles, width, height) == 0).all()


def test_pictures_of_any_size_are_drawn_whatever_sizes_were_drawn_before():
    """Dr.Jit 1.5.0 takes a recording for 64 x 8 pixels for one for 64 x 64 (`kernels.frozen`)."""
    points = mi.Float(np.array([[-10, -10, 1, 0], [2e4, 0, 1, 0], [0, 2e4, 1, 0]], np.float32).ravel())
    for width in (8, 16, 64):
        for height in (8, 16, 24, 64, 96, 512):
            view = atlas.view_of(width, height)
            nearest = raster.rasterize(points, mi.UInt32([0, 1, 2, 0]), 1, view)
            seen = raster.winner_at(nearest, view, dr.arange(mi.UInt32, width * height), True)
            assert (np.array(seen) == 0).all(), (width, height)
