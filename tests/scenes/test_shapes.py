"""Modelling helpers: volumes and areas in closed form, edges where they belong."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from benchharness.scene import Mesh
from scenes.props import kitchenware
from scenes.props.shapes import (
    arc,
    ball,
    bar,
    box,
    contact_sheet,
    lathe,
    pose,
    rounded_tube,
    sheet,
    steps,
    tiles,
    tube,
    unit_sphere,
    with_breaks,
)

GREY = (0.5, 0.5, 0.5)


def solid(mesh: Mesh) -> trimesh.Trimesh:
    """With vertices in the same place as one, as trimesh sees it."""
    return trimesh.Trimesh(mesh.vertices, mesh.faces)


@pytest.mark.parametrize("spacing", [np.inf, 0.4])
def test_a_bevelled_box_loses_a_prism_at_every_edge_and_is_closed(spacing):
    a, b, c, w = 1.0, 1.5, 2.0, 0.1
    mesh = solid(box((0, 0, 0), (a, b, c), GREY, spacing=spacing, bevel=w))
    # Four edges along each axis lose w^2/2 times the length between the corners; each of eight corners loses its cube
    # of side w except for the simplex w^3/6 of three right angles.
    prisms = 4 * (w * w / 2) * (a + b + c - 6 * w)
    corners = 8 * (w**3 - w**3 / 6)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(a * b * c - prisms - corners, rel=1e-12)


def test_a_box_without_bevel_has_flat_faces_of_its_own():
    mesh = box((0, 0, 0), (1, 2, 3), GREY)
    assert len(mesh.vertices) == 24
    assert solid(mesh).volume == pytest.approx(6)
    assert (abs(mesh.normals).max(axis=1) == 1).all()


def test_omitted_faces_are_left_open_to_the_full_size():
    mesh = box((0, 0, 0), (1, 1, 1), GREY, omit="-z", bevel=0.1)
    assert mesh.vertices[:, 2].min() == 0
    assert not (mesh.normals[:, 2] < 0).any()
    assert not solid(mesh).is_watertight


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"hi": (1, -1, 1)}, "accepted: sides longer"),
        ({"bevel": 0.5}, "accepted: sides longer than their bevels"),
        ({"omit": "top"}, "accepted: -x"),
    ],
)
def test_an_impossible_box_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        box(**{"lo": (0, 0, 0), "hi": (1, 1, 1), "albedo": GREY, **arguments})


def test_a_bar_is_a_closed_box_of_eight_vertices():
    mesh = bar((1, 1, 1), (2, 3, 4), GREY)
    assert len(mesh.vertices) == 8
    assert solid(mesh).volume == pytest.approx(6)


def test_a_turned_cylinder_has_a_polygons_volume_and_doubled_edges():
    n = 16
    mesh = lathe([(0, 0), (1, 0), (1, 2), (0, 2)], n, [GREY, (0.1, 0.2, 0.3), GREY])
    # Area of the regular n-gon in the unit circle: n/2 sin(2 pi/n).
    assert solid(mesh).volume == pytest.approx(2 * n / 2 * np.sin(2 * np.pi / n))
    assert len(mesh.vertices) == (n + 1) + 2 * n + (n + 1)
    side = np.isclose(mesh.albedo[:, 0], 0.1)
    assert side.sum() == 2 * n
    assert abs(mesh.normals[side, 2]).max() < 1e-12
    assert (abs(mesh.normals[~side, 2]) > 1 - 1e-12).all()


def test_a_profile_needs_a_colour_per_stretch():
    with pytest.raises(ValueError, match="2 colours; accepted: 1, or 3"):
        lathe([(0, 0), (1, 0), (1, 1), (0, 1)], 8, [GREY, GREY])


def test_a_ball_has_exact_normals():
    mesh = ball(2.0, 24, 13, GREY)
    assert solid(mesh).is_watertight
    assert np.allclose(mesh.vertices, 2 * mesh.normals, atol=1e-12)
    assert len(mesh.vertices) == 24 * 11 + 2


def test_a_straight_tube_is_a_closed_prism_that_faces_outward():
    mesh = solid(tube([(0, 0, 0), (0, 0, 1), (0, 0, 3)], 0.5, 8, GREY))
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(3 * 0.25 * 4 * np.sin(np.pi / 4))


def test_a_bent_tube_keeps_its_width():
    path = arc((0, 0, 0), (1, 0, 0), (0, 0, 1), 0, 180, 25)
    mesh = tube(path, 0.1, 12, GREY)
    away = np.linalg.norm(mesh.vertices[:-2].reshape(25, 12, 3) - path[:, None], axis=2)
    assert np.allclose(away, 0.1, atol=1e-12)
    assert solid(mesh).volume > 0


def test_tiles_do_not_share_vertices_and_fill_the_area():
    colours = np.random.default_rng(0).uniform(size=(2, 3, 3))
    mesh = tiles((0, 0, 0), (3, 0, 0), (0, 2, 0), (3, 2), colours)
    assert len(mesh.vertices) == 24
    assert solid(mesh).area == pytest.approx(6)
    second_row_first = mesh.vertices[12:16]
    assert second_row_first[:, 1].min() == 1
    assert (mesh.albedo[12:16] == colours[1, 0]).all()


def test_a_sheet_with_a_hole_faces_as_told_and_lacks_the_hole():
    us, vs = with_breaks(0, 4, 0.9, [1, 3]), with_breaks(0, 2, 0.9, [0.5, 1.5])
    mesh = sheet((0, 0, 0), (1, 0, 0), (0, 0, 1), us, vs, GREY, hole=(1, 3, 0.5, 1.5))
    assert solid(mesh).area == pytest.approx(8 - 2)
    assert (mesh.normals == [0, -1, 0]).all()
    centre = mesh.vertices[mesh.faces].mean(axis=1)
    assert not ((centre[:, 0] > 1) & (centre[:, 0] < 3) & (centre[:, 2] > 0.5) & (centre[:, 2] < 1.5)).any()


def test_steps_are_even_and_no_longer_than_asked():
    assert steps(0, 1, 0.5).tolist() == [0, 0.5, 1]
    assert np.diff(steps(0, 1, 0.3)).max() == pytest.approx(0.25)
    assert steps(0, 1, np.inf).tolist() == [0, 1]
    assert with_breaks(0, 1, np.inf, [0.4, 2.0]).tolist() == [0, 0.4, 1]


def test_a_contact_sheet_covers_its_rectangle_and_has_no_vertex_under_a_foot():
    feet = [(0.0, 0.0, 0.2), (0.5, 0.1, 0.03), (-0.75, -0.35, 0.1)]
    mesh = contact_sheet((-0.8, -0.4), (0.8, 0.4), 0.7, 0.1, feet, GREY)
    assert solid(mesh).area == pytest.approx(1.6 * 0.8)
    assert (mesh.normals[:, 2] == 1).all()
    for x, y, radius in feet[:2]:
        away = np.linalg.norm(mesh.vertices[:, :2] - [x, y], axis=1)
        assert away.min() == pytest.approx(radius + 0.002)


def test_a_pose_scales_tilts_turns_and_moves_in_this_order():
    # (0, 1, 0) doubled, tilted by 90 degrees about x to +z, turned about z (no effect), moved by (1, 2, 3).
    assert np.allclose(pose((1, 2, 3), 90, 90, 2.0) @ [0, 1, 0, 1], [1, 2, 5, 1])
    # (1, 0, 0) is not tilted, but turned to +y.
    assert np.allclose(pose((0, 0, 0), 90, 90) @ [1, 0, 0, 1], [0, 1, 0, 1])


@pytest.mark.parametrize("n", [6, 12, 24])
def test_kitchenware_stands_on_its_ground_and_faces_outward(n):
    things = {
        "can": kitchenware.can(n, GREY, GREY), "apple": kitchenware.apple(n), "banana": kitchenware.banana(n),
        "mug": kitchenware.mug(n, GREY), "kettle": kitchenware.kettle(n, GREY), "plate": kitchenware.plate(n, GREY),
        "bottle": kitchenware.bottle(n), "jar": kitchenware.jar(n, GREY, GREY), "pot": kitchenware.pot(n, GREY),
    }  # fmt: skip
    for name, mesh in things.items():
        # The banana's polygonal cross-section need not have a corner at the bottom.
        assert mesh.vertices[:, 2].min() == pytest.approx(0, abs=0.004 if name == "banana" else 1e-9), name
        assert solid(mesh).volume > 0, name
    assert np.allclose(kitchenware.orange(n).vertices.mean(axis=0), 0, atol=1e-3)


def test_a_rounded_tube_is_a_cylinder_with_two_half_spheres():
    r, length = 0.1, 0.5
    mesh = rounded_tube([(0, 0, 0), (0.2, 0, 0), (length, 0, 0)], [r, r, r], 64, GREY, cap=24)
    whole = solid(mesh)
    assert whole.is_watertight
    assert (mesh.vertices[:, 0].min(), mesh.vertices[:, 0].max()) == pytest.approx((0, length), abs=0.03 * r)
    # 64 sides lose 1 - sin(2 pi / 64) / (2 pi / 64) = 0.16 % of every cross-section, the caps' ends beyond 78 degrees
    # less than 0.1 %.
    expected = np.pi * r**2 * (length - 2 * r) + 4 / 3 * np.pi * r**3
    assert whole.volume == pytest.approx(expected, rel=0.004)
    agreement = (whole.face_normals * mesh.normals[mesh.faces].sum(axis=1)).sum(axis=1)
    assert agreement.min() > 0


def test_a_rounded_tube_shorter_than_its_ends_is_refused():
    with pytest.raises(ValueError, match=r"0.15 m long; accepted: more than its end radii 0.1 \+ 0.06 m"):
        rounded_tube([(0, 0, 0), (0.15, 0, 0)], [0.1, 0.06], 8, GREY)


def test_the_unit_sphere_is_closed_and_has_single_poles_and_an_equator():
    sphere = unit_sphere(12, 7)
    assert sphere.is_watertight
    assert len(sphere.vertices) == 12 * 5 + 2
    assert np.allclose(np.linalg.norm(sphere.vertices, axis=1), 1, atol=1e-15)
    assert (sphere.vertices[:, 2] == 0).sum() == 12
