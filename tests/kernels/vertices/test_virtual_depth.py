"""Which of several images is in front: sorted by the way to what is reflected, and behind the mirror's own back."""

from __future__ import annotations

import dataclasses

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from oracles.ray_oracle import rays
from support.mirror_room import scene, still
from support.small_room import quad, sphere
from support.truth_shapes import unit
from support.virtual_drawing import CAMERA, EYE, HEIGHT, SHEET, WIDTH, coloured, draw, in_the_plane, on_the_sphere

from benchharness.kernels.vertices import virtual
from benchharness.render.frame import FrameRenderer, view_of
from benchharness.scene import Mesh, Object, Reflector, merged, subdivided

D_MAX = 12.0


def sorted_by_length(R, d_V, made=None):
    """`virtual.sorted_by_length` of points [N, 3] of the world, on the host."""
    camera = CAMERA(0.0) if made is None else made.camera(0.0)
    at = mi.Point3f(np.ascontiguousarray(R.T, np.float32))
    image = virtual.sorted_by_length(at, mi.Float(d_V), mi.Float(D_MAX), view_of(camera, WIDTH, HEIGHT, 0.01))
    return np.array(image, np.float64).T


# "screen_linear".


def test_a_sorted_vertex_keeps_its_pixel_and_one_over_its_depth_falls_with_the_ways_length():
    rng = np.random.default_rng(0)
    R, d_V = rng.uniform(-1, 1, (300, 3)), rng.uniform(0, 0.99 * D_MAX, 300)
    moved = sorted_by_length(R, d_V)
    matrix = CAMERA(0.0).world_to_screen(WIDTH, HEIGHT)
    q, p = (x @ matrix[:, :3].T + matrix[:, 3] for x in (moved, R))
    np.testing.assert_allclose(q[:, :2] / q[:, 2:], p[:, :2] / p[:, 2:], atol=2e-3)
    np.testing.assert_allclose(1 / q[:, 2], 1 - d_V / D_MAX, atol=1e-5)
    # And what is as far as d_max or farther comes last, in front of nothing and finite.
    far = sorted_by_length(R[:2], np.array([D_MAX, 5 * D_MAX]))
    assert (far @ matrix[2, :3] + matrix[2, 3] > 9e3).all() and np.isfinite(far).all()


def linear_soup(count, size, seed=1):
    """(R [V, 3] on the plane y = 0, d_V [V], V [V, 3], faces): triangles that cross each other in all directions."""
    rng = np.random.default_rng(seed)
    middle = rng.uniform(-0.7, 0.7, (count, 1, 3)) * [1, 0, 0.8]
    R = (middle + rng.normal(scale=size, size=(count, 3, 3)) * [1, 0, 1]).reshape(-1, 3)
    d_V = rng.uniform(0.2, 8, len(R))
    w = unit(R - EYE) * [1, -1, 1]
    return R, d_V, R + d_V[:, None] * w, np.arange(3 * count).reshape(-1, 3)


def nearest_by_length(R, d_V, faces, made):
    """(triangle or -1, weights on the mirror, margin) per pixel: ways interpolated linearly on the screen, the least wins."""
    matrix = made.camera(0.0).world_to_screen(WIDTH, HEIGHT)
    q = R @ matrix[:, :3].T + matrix[:, 3]
    s, w = q[:, :2] / q[:, 2:], q[:, 2]
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    pixel = np.stack([x.ravel() + 0.5, y.ravel() + 0.5], axis=1)
    best, winner, margin = np.full(len(pixel), np.inf), np.full(len(pixel), -1), np.full(len(pixel), np.inf)
    weights = np.zeros((len(pixel), 3))
    for k, face in enumerate(faces):
        a, b, c = s[face]
        inverse = np.linalg.inv(np.stack([b - a, c - a], axis=1))
        bc = (pixel - a) @ inverse.T
        linear = np.column_stack([1 - bc.sum(axis=1), bc])
        inside = (linear >= 0).all(axis=1)
        margin = np.minimum(margin, np.abs(linear).min(axis=1))
        way = linear @ d_V[face]
        closer = inside & (way < best)
        margin = np.where(inside & np.isfinite(best), np.minimum(margin, np.abs(way - best)), margin)
        best, winner = np.where(closer, way, best), np.where(closer, k, winner)
        correct = linear / w[face]
        weights[closer] = (correct / correct.sum(axis=1, keepdims=True))[closer]
    return winner, weights, margin


@pytest.mark.parametrize(("count", "size"), [(40, 0.15), (6, 0.6)])
@pytest.mark.parametrize("order", ["as it is", "reversed"])
def test_of_images_at_a_pixel_the_one_with_the_shortest_way_is_shown(count, size, order):
    R, d_V, V, faces = linear_soup(count, size)
    faces = faces[::-1] if order == "reversed" else faces
    made = scene((Object("soup", coloured(Mesh(V, faces)), shows="order"),), (SHEET,), CAMERA)
    kind = np.full(len(V), virtual.REFLECTED)
    L, distance, covered, frame = draw(made, sorted_by_length(R, d_V), kind, R, "drop", "screen_linear")
    winner, weights, margin = nearest_by_length(R, d_V, faces, made)
    active = np.array(frame.active)
    clear = active & (margin > 1e-3)
    assert (winner[active] >= 0).sum() > 500 and clear.sum() > 0.9 * active.sum()
    np.testing.assert_array_equal(covered[clear], (winner >= 0)[clear])
    assert not covered[~active].any()
    # What triangles carry is interpolated between the reflection points, in space.
    shown = clear & (winner >= 0)
    mine = faces[winner[shown]]
    radiance = np.asarray(made.objects[0].mesh.radiance)
    np.testing.assert_allclose(L[shown], (weights[shown][..., None] * radiance[mine]).sum(axis=1), atol=1e-4)
    reached = (weights[shown][..., None] * V[mine]).sum(axis=1)
    d = rays(made.camera(0.0), WIDTH, HEIGHT)[shown]
    p = EYE - EYE[1] / d[:, 1:2] * d
    np.testing.assert_allclose(distance[shown], np.linalg.norm(reached - p, axis=1), atol=1e-4)


def test_in_a_plane_mirror_either_depth_shows_the_same_of_fine_triangles():
    """0.3 of the algorithms: at one pixel, the order by d_V is that by depth; only interpolation differs."""
    one, two = (
        subdivided(quad((-0.9, y, -0.7), (1.6, up, 0.1), (0.1, 0.1, 1.3)), 0.1) for y, up in ((-1.5, 0.7), (-0.9, -0.5))
    )
    made = scene((Object("two", coloured(merged(one, two)), shows="crossing"),), (SHEET,), CAMERA)
    V = made.objects[0].mesh.vertices
    moved, kind, at = in_the_plane(V)
    pictures = [draw(made, moved, kind, at, "drop"), None]
    d_V = np.linalg.norm(V - at, axis=1)
    pictures[1] = draw(made, sorted_by_length(at, d_V), kind, at, "drop", "screen_linear")
    (L, distance, covered, _), (other, way, there, _) = pictures
    assert covered.sum() > 1000
    assert (covered != there).sum() < 0.01 * covered.sum()
    both = covered & there
    assert np.median(np.abs(L - other)[both]) < 2e-3
    assert np.percentile(np.abs(distance - way)[both], 95) < 0.01


# The mirror's own back.

FRONT, REAR = np.array([0.0, 0.0, 0.0]), np.array([0.5, 1.4, 0.2])
RADII = (0.5, 0.8)
LOBES = Reflector("lobes", merged(sphere(RADII[0], FRONT, slices=96, stacks=48), sphere(RADII[1], REAR, slices=96, stacks=48)))


def meets(d, centre, radius):
    """Lengths along unit d [P, 3] from the eye to a ball's front and back; inf for a miss."""
    b = (d * (centre - EYE)).sum(axis=1)
    root = b**2 - (centre - EYE) @ (centre - EYE) + radius**2
    reach = np.sqrt(np.maximum(root, 0))
    return np.where(root > 0, b - reach, np.inf), np.where(root > 0, b + reach, np.inf)


def lengths():
    """(unit rays [P, 3], their cosines to the view axis, front and back of either ball)."""
    d = unit(rays(CAMERA(0.0), WIDTH, HEIGHT))
    return d, d @ CAMERA(0.0).axes()[2], meets(d, FRONT, RADII[0]), meets(d, REAR, RADII[1])


def backs_of(reflector: Reflector, pose=None):
    made = scene((), (dataclasses.replace(reflector, motion=None if pose is None else lambda t: pose),), CAMERA)
    frame = FrameRenderer(made, WIDTH, HEIGHT).render(0)
    return np.array(virtual.nearest_back(frame.proxies[0], frame.poses, dr.opaque(mi.UInt32, 0), frame.view), np.float64)


@pytest.mark.parametrize("moved", [False, True])
def test_the_nearest_back_is_where_a_ray_leaves_the_first_lobe(moved):
    pose = np.eye(4)
    pose[:3, 3] = [0.3, 0.2, -0.1] if moved else 0
    shifted = dataclasses.replace(LOBES, mesh=LOBES.mesh.transformed(np.linalg.inv(pose)))
    back = backs_of(shifted, pose)
    _, cosine, (front, leaves), (_, leaves_rear) = lengths()
    expected = np.where(np.isfinite(front), leaves, leaves_rear)
    seen = np.isfinite(expected)
    # At outlines, the mesh is a chord short of the ball: 0.2 px; elsewhere by its sagitta, 1 - cos(π / 96) = 5e-4.
    rim = np.zeros((HEIGHT, WIDTH), bool)
    for hit in (np.isfinite(front), np.isfinite(leaves_rear)):
        hit = hit.reshape(HEIGHT, WIDTH)
        for axis in (0, 1):
            for step in (1, -1):
                rim |= hit != np.roll(hit, step, axis)
    clear = ~rim.ravel()
    np.testing.assert_array_equal((back > 0)[clear], seen[clear])
    assert (clear & seen).sum() > 500
    np.testing.assert_allclose(1 / back[clear & seen], (expected * cosine)[clear & seen], atol=0.01)


def test_an_open_sheet_seen_from_its_front_has_no_back():
    assert (backs_of(SHEET) == 0).all()
    turned = dataclasses.replace(SHEET, mesh=dataclasses.replace(SHEET.mesh, faces=SHEET.mesh.faces[:, ::-1]))
    assert (backs_of(turned) > 0).sum() > 1000


def test_an_image_on_a_rear_lobe_does_not_show_through_the_front_one():
    """F-26: a fan of reflection points on the rear ball, whose images lie far behind everything."""
    (front, _), (rear, _) = lengths()[2:]
    # All over the part of the rear ball that the eye would see, had it no front one.
    towards = unit(EYE - REAR)
    fan = sphere(1.0, slices=64, stacks=32)
    at = REAR + RADII[1] * fan.vertices
    facing = (unit(EYE - at) * fan.vertices).sum(axis=1) > 0.05
    keep = facing[fan.faces].all(axis=1)
    V = at + 3.0 * towards
    mesh = coloured(Mesh(V, fan.faces[keep][:, [0, 2, 1]]))
    made = scene((Object("wide", mesh, shows="much"),), (LOBES,), CAMERA)
    moved = EYE + (np.linalg.norm(at - EYE, axis=1) + 3.0)[:, None] * unit(at - EYE)
    kind = np.full(len(V), virtual.REFLECTED)
    without, within = (draw(made, moved, kind, at, "drop", behind=b)[2] for b in (False, True))
    on_front = np.isfinite(front) & np.isfinite(rear)
    assert (without & on_front).sum() > 100
    assert (within & on_front).sum() <= 0.03 * (without & on_front).sum()  # the outline's pixels
    elsewhere = without & ~on_front
    assert elsewhere.sum() > 300
    assert (within & elsewhere).sum() > 0.95 * elsewhere.sum()
    assert not (within & ~without).any()


def test_by_the_ways_length_it_would_be_the_other_lobe_that_hides():
    """F-28: it is the reflection point that must lie before the back, however short the way from it."""
    at = np.array([[-0.15, 1.0, -0.15], [0.15, 1.0, -0.15], [0.0, 1.0, 0.2]])  # behind the front ball
    made = scene((Object("one", coloured(Mesh(at - [0, 0.1, 0], [[0, 1, 2]])), shows="it"),), (LOBES,), CAMERA)
    kind = np.full(3, virtual.REFLECTED)
    for d_V in (0.01, 5.0):
        moved = sorted_by_length(at, np.full(3, d_V))
        assert draw(made, moved, kind, at, "drop", "screen_linear")[2].sum() > 20
        assert not draw(made, moved, kind, at, "drop", "screen_linear", behind=True)[2].any()


@pytest.mark.parametrize("hidden", ["cut", "drop"])
def test_a_convex_mirror_loses_nothing_to_its_own_back(hidden):
    globe = Reflector("globe", sphere(1.0, slices=128, stacks=64))
    middle = np.array([-0.06, 0.6, -0.08]) + 1.25 * np.array([-0.8, 0, 0.6])
    sheets = [quad(middle - [0.5, 0, 0.5], (0, 0, 1.0), (1.0, 0, 0)), quad((-2, -1.5, -2), (4, 0, 0), (0, 0, 4))]
    mesh = coloured(subdivided(merged(*sheets), 0.35))
    made = scene((Object("sheets", mesh, shows="a border"),), (globe,), still(tuple(EYE), (0, 0, 0), 45.0))
    moved, kind, at = on_the_sphere(mesh.vertices)
    assert (kind == virtual.HIDDEN).any()
    without, within = (draw(made, moved, kind, at, hidden, behind=b) for b in (False, True))
    assert without[2].sum() > 500
    np.testing.assert_array_equal(within[2], without[2])
    np.testing.assert_array_equal(within[0], without[0])
