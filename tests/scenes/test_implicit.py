"""Blended ellipsoids: closed forms where one ellipsoid is alone, gradients that agree, and meshes that are good everywhere."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from scenes.props.implicit import Blob, blended, field, gradient, limb, mirrored, polygonised

RNG = np.random.default_rng(1)
PAIR = [Blob((0, 0, 0), (0.05, 0.03, 0.04), k=0.004), Blob((0.06, 0.01, 0), (0.02, 0.03, 0.02), (1, 0, 2), k=0.006)]
CUT = [*PAIR, Blob((0, 0, 0.04), (0.02, 0.02, 0.02), k=0.003, cut=True)]


def test_a_ball_has_its_distance():
    ball = Blob((0.1, 0.2, 0.3), (0.05, 0.05, 0.05))
    p = RNG.normal(size=(50, 3))
    assert np.allclose(ball.distance(p), np.linalg.norm(p - ball.at, axis=1) - 0.05, atol=1e-12)
    assert ball.distance(np.array(ball.at)) == pytest.approx(-0.05)


def test_an_ellipsoid_is_zero_on_its_surface_with_unit_slope_outward():
    blob = Blob((0.1, 0, 0), (0.02, 0.03, 0.06), (1, 2, 3))
    n = RNG.normal(size=(50, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    p = blob.at + (n * blob.radii) @ blob.axes()
    assert abs(blob.distance(p)).max() < 1e-15
    outward = (n / blob.radii) @ blob.axes()
    assert np.allclose(blob.gradient(p), outward / np.linalg.norm(outward, axis=1, keepdims=True), atol=1e-12)


def test_a_limb_ends_where_it_should():
    tips = np.array([(0.1, 0.2, 0.3), (0.2, 0.1, 0.5)])
    blob = limb(tuple(tips[0]), tuple(tips[1]), 0.01, 0.02)
    assert abs(blob.distance(tips)).max() < 1e-15
    across, level = tips.mean(axis=0) + 0.02 * blob.axes()[1], tips.mean(axis=0) + 0.01 * blob.axes()[0]
    assert abs(blob.distance(np.stack([across, level]))).max() < 1e-15
    assert blob.axes()[0, 1] == 0  # its x has no part along y
    assert np.allclose(blob.axes() @ blob.axes().T, np.eye(3))


def test_two_blobs_that_are_equally_near_swell_by_k_log_2():
    pair = [Blob((x, 0, 0), (0.05, 0.05, 0.05), k=0.004) for x in (-0.02, 0.02)]
    p = np.array([[0.0, 0.0, 0.06]])
    assert field(pair, p)[0] == pytest.approx(pair[0].distance(p)[0] - 0.004 * np.log(2))


def test_a_cut_leaves_nothing_of_itself_inside():
    assert field(PAIR, np.array([[0, 0, 0.035]]))[0] < 0
    assert field(CUT, np.array([[0, 0, 0.035]]))[0] > 0
    # At the point deepest in the cut and outside the body, f is the cut's depth within k log 2.
    assert field(CUT, np.array([[0, 0, 0.041]]))[0] == pytest.approx(0.019, abs=0.0021)


def test_mirrored_blobs_make_a_body_that_is_the_same_on_both_sides():
    body = mirrored(CUT[1:])
    p = RNG.uniform(-0.1, 0.1, (100, 3))
    # Blended in turn, not at once, so the order shows, but only as far as three blobs overlap.
    assert np.allclose(field(body[:2], p), field(body[:2], p * [-1, 1, 1]), atol=1e-14)


def test_the_gradient_is_that_of_the_field():
    p, h = RNG.uniform(-0.08, 0.08, (200, 3)), 1e-6
    f, g = gradient(CUT, p)
    differences = np.stack([field(CUT, p + s) - field(CUT, p - s) for s in h * np.eye(3)], axis=1) / (2 * h)
    assert (f == field(CUT, p)).all()
    # Second-order differences: their error is h² times the third derivative, about 1 / k².
    assert np.allclose(g, differences, atol=1e-6)


@pytest.mark.parametrize("blobs", [PAIR[:1], PAIR, CUT])
def test_the_mesh_is_closed_wound_outward_on_the_surface_and_without_slivers(blobs):
    cell = 0.004
    mesh = polygonised(blobs, cell)
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert solid.is_watertight
    assert solid.is_winding_consistent
    assert solid.volume > 0
    f, g = gradient(blobs, mesh.vertices)
    assert abs(f).max() < 1e-9
    assert np.allclose(mesh.normals, g / np.linalg.norm(g, axis=1, keepdims=True), atol=1e-12)
    assert (np.einsum("fi,fki->fk", solid.face_normals, mesh.normals[mesh.faces]) > 0.5).all()
    assert np.degrees(solid.face_angles.min()) > 15
    assert solid.edges_unique_length.max() < 2.5 * cell


def test_an_ellipsoids_mesh_has_its_volume():
    a, b, c = PAIR[0].radii
    mesh = polygonised(PAIR[:1], 0.003)
    # Inscribed: too small by about h² κ / 4 of its thickness all around, with edges h of a cell and curvature κ.
    volume = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).volume
    assert volume == pytest.approx(4 / 3 * np.pi * a * b * c, rel=0.01)
    assert volume < 4 / 3 * np.pi * a * b * c


def test_colours_are_those_of_the_nearest_blob_and_mix_between():
    one, other = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
    pair = [Blob((-0.05, 0, 0), (0.05, 0.05, 0.05), part="a"), Blob((0.05, 0, 0), (0.05, 0.05, 0.05), part="b")]
    colours = blended(pair, np.array([[-0.1, 0, 0], [0, 0.02, 0], [0.1, 0, 0]]), {"a": one, "b": other}, 0.005)
    assert np.allclose(colours, [one, (0.5, 0, 0.5), other], atol=1e-6)


@pytest.mark.parametrize("cell", [0.0, -1.0, np.inf])
def test_a_cell_that_is_no_length_is_refused(cell):
    with pytest.raises(ValueError, match=r"polygonised: cell is .*; accepted: a positive length"):
        polygonised(PAIR, cell)
