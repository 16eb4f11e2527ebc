"""Drawing virtual triangles, with virtual vertices from closed forms: only the drawing is judged."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from oracles.ray_oracle import first_hits, rays
from scipy.ndimage import maximum_filter, minimum_filter
from support.mirror_room import ball, plain, scene, still
from support.small_room import box, quad, sphere
from support.truth_shapes import unit
from support.virtual_drawing import CAMERA, EYE, HEIGHT, SHEET, WIDTH, coloured, draw, in_the_plane, on_the_sphere

from benchharness.kernels.vertices import virtual
from benchharness.scene import Object, Reflector, subdivided

ASIDE = np.array([1.7, -1.6, 0.9])
TURNED_OVER = np.diag([1.0, -1.0, 1.0, 1.0])


def vertices_of(made):
    return np.concatenate([o.mesh.vertices for o in made.objects])


def mirrored(made):
    """The scene behind the mirror: everything turned over at y = 0 (faces turned round so that they stay outside)."""
    objects = []
    for o in made.objects:
        turned = o.mesh.transformed(TURNED_OVER)
        objects.append(dataclasses.replace(o, mesh=dataclasses.replace(turned, faces=turned.faces[:, ::-1])))
    return dataclasses.replace(made, objects=tuple(objects), reflectors=())


def depth_of_sheet(made):
    """Of every pixel's ray where it meets the plane y = 0, and the rays."""
    d = rays(made.camera(0.0), WIDTH, HEIGHT)
    with np.errstate(divide="ignore"):
        return -made.camera(0.0).eye[1] / d[:, 1], d


@pytest.mark.parametrize("behind", [False, True])
@pytest.mark.parametrize("hidden", ["cut", "keep", "drop"])
def test_a_plane_mirror_shows_the_mirrored_scene(hidden, behind):
    objects = (
        Object("block", coloured(box((-0.7, -1.0, -0.5), (-0.1, -0.4, 0.3))), shows="corners"),
        Object("slab", coloured(quad((0.0, -1.6, -0.6), (0.8, 0.3, 0), (0, 0.2, 0.9))), shows="an open sheet"),
    )
    made = scene(objects, (SHEET,), CAMERA)
    L, distance, covered, frame = draw(made, *in_the_plane(vertices_of(made)), hidden, behind=behind)
    active = np.array(frame.active)
    depth, d = depth_of_sheet(made)
    part, p, _, radiance, clear = first_hits(mirrored(made), 0.0, WIDTH, HEIGHT, beyond=depth)
    expected = active & (part >= 0)
    assert expected.sum() > 500 and (active & ~expected).sum() > 500
    np.testing.assert_array_equal(covered[clear], expected[clear])
    shown = expected & clear
    np.testing.assert_allclose(L[shown], radiance[shown], atol=2e-5)
    at_mirror = EYE + depth[:, None] * d
    length = np.linalg.norm(p - EYE, axis=1) - np.linalg.norm(at_mirror - EYE, axis=1)
    np.testing.assert_allclose(distance[shown], length[shown], atol=2e-5)
    assert (L[~covered] == 0).all() and (distance[~covered] == 0).all()


@pytest.mark.parametrize("behind", [False, True])
@pytest.mark.parametrize("touching", ["enters", "stands on"])
def test_what_touches_a_mirror_meets_its_image_without_a_gap(touching, behind):
    back = 0.35 if touching == "enters" else 0.0
    block = coloured(box((-0.45, -0.7, -0.35), (0.3, back, 0.25)))
    made = scene((Object("block", block, shows="contact"),), (SHEET,), still(tuple(ASIDE), (0.0, -0.2, 0.0), 35.0))
    V = vertices_of(made)
    moved, kind, at = in_the_plane(V, ASIDE)
    if touching == "stands on":  # at the plane itself a search may call a vertex either
        kind = np.where(V[:, 1] == 0, virtual.HIDDEN, kind)
    moved[kind == virtual.HIDDEN] = [50.0, -1.0, 30.0]  # wherever: a cut triangle does not go there
    L, _, covered, frame = draw(made, moved, kind, at, whole=True, behind=behind)
    depth, _ = depth_of_sheet(made)
    part, _, _, radiance, clear = first_hits(mirrored(made), 0.0, WIDTH, HEIGHT, beyond=depth)
    expected = np.array(frame.active) & (part >= 0)
    assert expected.sum() > 300
    # An edge is cut where texels change, which is up to one texel from where the block enters.
    wrong = ((covered != expected) & clear).reshape(HEIGHT, WIDTH)
    assert not (wrong & ~border_of(expected)).any()
    assert wrong.sum() < 0.02 * expected.sum()
    same = covered & expected & clear
    assert np.median(np.abs(L - radiance)[same]) < 1e-4


def border_of(mask):
    """Pixels that have one of the mask and one without it among themselves and their eight neighbours, [H, W]."""
    mask = mask.reshape(HEIGHT, WIDTH)
    return maximum_filter(mask, 3) & ~minimum_filter(mask, 3)


@pytest.mark.parametrize("hidden", ["cut", "keep", "drop"])
def test_hidden_triangles_and_those_with_a_lost_vertex_draw_nothing(hidden):
    made = scene((Object("block", coloured(box((-0.7, -1.0, -0.5), (0.5, -0.4, 0.3))), shows="much"),), (SHEET,), CAMERA)
    moved, kind, at = in_the_plane(vertices_of(made))
    assert draw(made, moved, kind, at, hidden)[2].sum() > 300
    assert not draw(made, moved, np.full_like(kind, virtual.HIDDEN), at, hidden)[2].any()
    assert not draw(made, moved, np.full_like(kind, virtual.NONE), at, hidden)[2].any()
    # One vertex of each face's pair of triangles lost: at most the other triangle is left.
    lost = np.where(np.arange(len(kind)) % 4 == 0, virtual.NONE, kind)
    assert not draw(made, moved, lost, at, hidden)[2].any()


def test_dropped_triangles_are_those_with_a_hidden_vertex_and_no_others():
    sheet = coloured(subdivided(quad((-0.7, -1.2, -0.6), (1.3, 1.7, 0.1), (0.1, 0.2, 1.0)), 0.3))
    made = scene((Object("sheet", sheet, shows="a border"),), (SHEET,), CAMERA)
    moved, kind, at = in_the_plane(sheet.vertices)
    moved[kind == virtual.HIDDEN] = [0.3, 2.0, 0.1]  # would be seen
    whole = (kind[sheet.faces] == virtual.REFLECTED).all(axis=1)
    assert 0.2 < whole.mean() < 0.8
    left = dataclasses.replace(sheet, faces=sheet.faces[whole])
    L, _, covered, frame = draw(made, moved, kind, at, "drop")
    depth, _ = depth_of_sheet(made)
    rest = dataclasses.replace(made, objects=(Object("rest", left, shows="a border"),))
    part, _, _, radiance, clear = first_hits(mirrored(rest), 0.0, WIDTH, HEIGHT, beyond=depth)
    expected = np.array(frame.active) & (part >= 0)
    assert expected.sum() > 300
    np.testing.assert_array_equal(covered[clear], expected[clear])
    np.testing.assert_allclose(L[expected & clear], radiance[expected & clear], atol=2e-5)
    assert covered.sum() < 0.95 * draw(made, moved, kind, at, "cut")[2].sum()


def test_an_image_behind_the_eye_draws_nothing():
    made = scene((Object("sheet", coloured(quad((-1, -1, -1), (2, 0, 0), (0, 0, 2))), shows="much"),), (SHEET,), CAMERA)
    moved, kind, at = in_the_plane(vertices_of(made))
    # Faces (0, 1, 2) and (0, 2, 3): one of them has vertex 1, both have vertex 0.
    for vertex, left in ((1, True), (0, False)):
        behind = moved.copy()
        behind[vertex] = EYE - np.array([0.0, 1.0, 0.0])
        assert draw(made, behind, kind, at)[2].any() == left


def test_a_closed_thing_around_the_mirror_shows_no_backs_and_an_open_one_does():
    around = ball(2.0, (0, 0, 0), (0.2, 0.4, 0.6), 2)
    opened = dataclasses.replace(around, faces=around.faces[1:])
    for mesh, some in ((around, False), (opened, True)):
        made = scene((Object("shell", mesh, shows="backs"),), (SHEET,), CAMERA)
        moved, kind, at = in_the_plane(vertices_of(made))
        at = np.zeros_like(at)
        assert draw(made, moved, np.full_like(kind, virtual.REFLECTED), at)[2].any() == some


def test_a_sheet_across_the_edge_of_a_mirrors_shadow_is_shown_up_to_the_outline():
    # A sheet behind the unit sphere, half in its shadow as seen from the eye: the mirror shows the other half, squeezed
    # against its outline. What it should show: exact rays from the sphere to the plane y = 0.6.
    globe = Reflector("globe", sphere(1.0, slices=256, stacks=128))
    middle = np.array([-0.06, 0.6, -0.08]) + 1.25 * np.array([-0.8, 0, 0.6])
    sheet = quad(middle - [0.5, 0, 0.5], (0, 0, 1.0), (1.0, 0, 0))
    sheet = coloured(subdivided(sheet, 0.1))
    made = scene((Object("sheet", sheet, shows="a border"),), (globe,), still(tuple(EYE), (-0.72, -0.3, 0.5), 14.0))
    moved, kind, at = on_the_sphere(sheet.vertices)
    assert 0.2 < (kind == virtual.HIDDEN).mean() < 0.8
    _, _, covered, frame = draw(made, moved, kind, at)
    active = np.array(frame.active)

    d = unit(rays(made.camera(0.0), WIDTH, HEIGHT))
    b = d @ EYE
    root = b**2 - (EYE @ EYE - 1)
    p = EYE + (-b - np.sqrt(np.maximum(root, 0)))[:, None] * d
    r = d - 2 * (d * p).sum(1)[:, None] * p
    t = np.where(r[:, 1] > 0, (0.6 - p[:, 1]) / np.where(r[:, 1] > 0, r[:, 1], 1), -1)
    q = p + t[:, None] * r
    expected = active & (root > 0) & (t > 0) & (np.abs(q - middle)[:, [0, 2]] < 0.5).all(axis=1)
    assert expected.sum() > 60
    wrong = (covered != expected).reshape(HEIGHT, WIDTH)
    # No gap of more than a pixel: what is missing or too much lies on the border of what is expected, or on the outline.
    assert not (wrong & ~border_of(expected)).any()
    assert wrong.sum() <= 3


def test_only_the_mirrors_own_pixels_are_drawn_on():
    other = Reflector("other", quad((-1, -0.2, -0.8), (0.6, 0, 0), (0, 0, 1.6)))
    whole = quad((-3, -1, -3), (6, 0, 0), (0, 0, 6))
    made = scene((Object("wall", plain(whole, (1, 1, 1)), shows="everywhere"),), (SHEET, other), CAMERA)
    moved, kind, at = in_the_plane(vertices_of(made))
    *_, covered, frame = draw(made, moved, kind, at)
    np.testing.assert_array_equal(covered, np.array(frame.reflector) == 0)
    assert (np.array(frame.reflector) == 1).any()
