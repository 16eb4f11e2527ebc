"""Small triangles at their pixels, against a loop in float64; and what they are for: what is narrower than a pixel."""

from __future__ import annotations

from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest
from oracles import ray_oracle
from support.mirror_room import mirror_ball, plain, scene, shaded, smooth
from support.packed import packed
from support.small_room import box

from benchharness.kernels import depths, raster
from benchharness.kernels.vertices import slivers
from benchharness.render.frame import view_of
from benchharness.scene import Camera, Mesh, Object
from methods.newton import Newton

CAMERA, WIDTH, HEIGHT = Camera((0.0, -3.0, 0.0), (0.0, 0.0, 0.0), 50.0), 48, 32


def kept(vertices, faces, limit=None, layers=None, skipped=()):
    points, packets = packed(vertices, faces, 0)
    view = view_of(CAMERA, WIDTH, HEIGHT, 0.1)
    limit = np.full(WIDTH * HEIGHT, np.inf) if limit is None else limit
    drawn = np.ones(len(faces), bool)
    drawn[list(skipped)] = False
    found = slivers.slivers(points, packets, len(faces), view, mi.Float(limit), layers, mi.Bool(drawn))
    return np.array(found).astype(np.int64).reshape(HEIGHT, WIDTH)


def soup(count: int, size: float, seed: int = 1):
    rng = np.random.default_rng(seed)
    middles = np.column_stack([rng.uniform(-1.6, 1.6, count), rng.uniform(-0.5, 0.5, count), rng.uniform(-1, 1, count)])
    return (middles[:, None] + size * rng.uniform(-1, 1, (count, 3, 3))).reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


def on_screen(vertices):
    q = np.column_stack([vertices, np.ones(len(vertices))]) @ CAMERA.world_to_screen(WIDTH, HEIGHT).T
    return q[:, :2] / q[:, 2:]


@pytest.mark.parametrize("size", [0.01, 0.5])
def test_each_pixel_keeps_the_nearest_small_triangle_whose_middle_it_sees(size):
    vertices, faces = soup(3000, size)
    vertices = np.asarray(vertices, np.float32).astype(np.float64)
    found, expected, depth = kept(vertices, faces), np.full((HEIGHT, WIDTH), raster.NONE), np.full((HEIGHT, WIDTH), np.inf)
    pixels, unsure = on_screen(vertices).reshape(-1, 3, 2), np.zeros((HEIGHT, WIDTH), bool)
    large = 0
    for k, corner in enumerate(pixels):
        (x1, y1), (x2, y2) = corner[1] - corner[0], corner[2] - corner[0]
        area = 0.5 * abs(x1 * y2 - x2 * y1)
        middle = corner.mean(axis=0)
        column, row = np.floor(middle).astype(int)
        large += area >= slivers.LARGEST
        if not (0 <= column < WIDTH and 0 <= row < HEIGHT):
            continue
        near_edge = np.abs(middle - np.round(middle)).min() < 1e-3 or abs(area / slivers.LARGEST - 1) < 1e-3
        for dx in (-1, 0, 1):
            for dy in (-1, 0, 1):
                at = np.clip(row + dy, 0, HEIGHT - 1), np.clip(column + dx, 0, WIDTH - 1)
                unsure[at] |= near_edge
        away = vertices[faces[k], 1].mean() + 3
        if area < slivers.LARGEST and away < depth[row, column]:
            expected[row, column], depth[row, column] = k, away
    assert (large > 100) == (size > 0.1)
    assert unsure.mean() < 0.5 and (expected != raster.NONE).mean() > 0.5
    np.testing.assert_array_equal(found[~unsure], expected[~unsure])


def test_what_is_shut_in_another_layer_or_not_drawn_is_not_kept():
    vertices, faces = soup(4, 0.005)
    column, row = (np.floor(on_screen(vertices[faces].mean(axis=1))).astype(int).T[i] for i in range(2))
    shut = np.full((HEIGHT, WIDTH), np.inf)
    shut[row[0], column[0]] = -np.inf
    layer = np.full((HEIGHT, WIDTH), 5)
    layer[row[1], column[1]] = 6
    layers = mi.UInt32([5] * 4), mi.UInt32(layer.ravel().astype(np.uint32))
    found = kept(vertices, faces, shut.ravel(), layers, skipped=[2])
    assert found[row[3], column[3]] == 3 and (np.delete(found.ravel(), row[3] * WIDTH + column[3]) == raster.NONE).all()


def test_nearness_from_far_away_is_in_order_too():
    """From there it is told from the mirrors' depth, and negative behind it."""
    eye = np.array([0.0, -3000.0, 0.0])
    camera = Camera(tuple(eye), (0.0, 0.0, 0.0), 0.05)
    view = view_of(camera, WIDTH, HEIGHT, 0.1)
    corner = np.array([[0, 0, 0], [0.001, 0, 0], [0, 0, 0.001]])
    vertices = np.concatenate([corner + np.array([0.3, y, 0.2]) for y in (0.5, -0.5, 0.9, 0.1)])
    points, packets = packed(vertices, np.arange(12).reshape(-1, 3), 0)
    near = np.array(depths.nearness(view, depths.offset(view, mi.Point3f(vertices[::3].T))))
    assert near.min() < 0 < near.max()
    found = slivers.slivers(points, packets, 4, view, mi.Float(np.full(WIDTH * HEIGHT, np.inf)), None, mi.Bool([True] * 4))
    found = np.array(found)
    assert (found != raster.NONE).sum() == 1 and found.min() == 1


def test_small_things_before_a_wall_of_two_triangles_are_shown():
    """The wall's image is straight and lies before the true ones of what hangs on it."""
    rng = np.random.default_rng(5)
    at = np.column_stack([np.full(2000, 1.95), rng.uniform(-1.9, 1.9, 2000), rng.uniform(-1.9, 1.9, 2000)])
    shape = 0.03 * np.array([[0, -1, -1], [0, 1, -1], [0, 0, 1]])
    small = plain(Mesh((at[:, None] + shape).reshape(-1, 3), np.arange(3 * len(at)).reshape(-1, 3)), (9.0, 0.0, 0.0))
    mesh = box((-2, -2, -2), (2, 2, 2), inside=True)
    room = Object("walls", replace(mesh, radiance=smooth(mesh.vertices)), "large triangles")
    made = scene((room, Object("small", small, "many small ones")), (mirror_ball(),))
    answer = shaded(Newton(resolve="ray"), made, 0)[0]
    active = answer.active.ravel()
    p, n, v = (np.array(a, np.float64).T[active] for a in (answer.frame.p, answer.frame.n, answer.frame.v))
    _, _, L, clear = ray_oracle.reflected_hits(made, 0.0, p, 2 * (v * n).sum(1, keepdims=True) * n - v, 0)
    true, shown = (a[:, 0] > 5 for a in (L, answer.L[answer.active]))
    assert (true & clear).sum() > 60
    assert shown[true & clear].mean() > 0.99 and true[shown & clear].all()
