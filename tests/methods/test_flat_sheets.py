"""Flat sheets before methods that move vertices: right in rooms of few triangles whose walls reach behind the sheet's plane."""

from __future__ import annotations

from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest
from oracles import planar_oracle
from support.flat_rooms import SIZE, asked, doubted, pose, sheet, tilted
from support.placed import host, points

from benchharness.kernels import planes
from benchharness.kernels.vertices import flatsheet
from methods.image_space_search import ImageSpaceSearch
from methods.newton import Newton
from methods.specular_polynomial import SpecularPolynomial

METHODS = {
    "newton": Newton(),
    "newton, several": Newton(multi=2),
    "image_space_search": ImageSpaceSearch(),
    "specular_polynomial": SpecularPolynomial(),
}


@pytest.fixture(scope="module")
def leaning():
    """degrees -> scene and truth. A cube touches the mirror, and a box is behind it."""
    scenes = {degrees: tilted(degrees, behind=degrees == 30) for degrees in (0, 30, 60)}
    return {degrees: (made, planar_oracle.followed(made, SIZE)) for degrees, made in scenes.items()}


def judged(answer, truth) -> tuple[float, float]:
    """Share of pixels, those aside that rounding decides, that show another radiance, or none; and of distances, half of which
    are off by less, relative."""
    clear = answer.active & truth.clear
    wrong = ~answer.found | (np.abs(answer.L - truth.L).max(axis=2) > 0.01)
    off = np.abs(answer.distance / np.maximum(truth.distance, 1e-9) - 1)
    return float(wrong[clear].mean()), float(np.median(off[clear]))


@pytest.mark.parametrize("name", METHODS)
def test_pixels_of_a_leaning_sheet_show_what_their_rays_meet(name, leaning):
    for made, truth in leaning.values():
        (answer,) = asked(made, METHODS[name])
        wrong, off = judged(answer, truth)
        assert truth.clear[answer.active].mean() > 0.95
        assert wrong < 0.01 and off < 1e-4
        assert doubted(answer).sum() < 0.02 * answer.active.sum()


def test_the_plane_goes_with_a_sheet_that_moves(leaning):
    made, _ = leaning[60]
    turn = pose("x", -60)
    moved = replace(made, reflectors=(sheet(motion=lambda time: turn),))
    (one,), (other,) = asked(made, Newton()), asked(moved, Newton())
    assert (one.active == other.active).all()
    assert (np.abs(one.L - other.L).max(axis=2) > 0.01)[one.active].mean() < 0.01


def test_images_in_a_plane_are_those_that_the_eye_sees_in_it_on_either_side():
    rng = np.random.default_rng(3)
    V, point, normal = rng.normal(size=(500, 3)), rng.normal(size=3), rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    plane = planes.Plane(mi.Point3f(point.tolist()), mi.Vector3f(normal.tolist()))
    for side in (1.5, -0.4):
        eye = point + side * normal + np.cross(normal, [0.3, 0.1, 0.9])
        found = flatsheet.mirrored(plane, points(V), mi.Point3f(eye.tolist()))
        image, R, n = (host(x) for x in (found.image, found.R, found.n))
        np.testing.assert_allclose(image, planar_oracle.image(V, point, normal), atol=2e-6)
        shown = np.array(found.before).astype(bool)
        assert (((V - point) @ normal * side > 0) == shown).all() and 20 < shown.sum() < 480
        np.testing.assert_allclose((R - point)[shown] @ normal, 0, atol=2e-6)
        along, way = (R - eye)[shown], (image - eye)[shown]
        np.testing.assert_allclose(np.linalg.norm(np.cross(along, way), axis=1), 0, atol=1e-5)
        assert ((along * way).sum(axis=1) > 0).all() and (np.broadcast_to(n, R.shape)[shown] @ normal * side > 0).all()


def test_an_edge_becomes_hidden_where_it_meets_the_plane():
    plane = planes.Plane(mi.Point3f(0, 0, 1), mi.Vector3f(0, 0, -1))
    share = flatsheet.Behind(plane).share(mi.Vector4f(5, 0, 4, 0), mi.Vector4f(0, 7, -5, 0))
    assert float(np.array(share)[0]) == pytest.approx(1 / 3)
    along = flatsheet.Behind(plane).share(mi.Vector4f(0, 0, 3, 0), mi.Vector4f(1, 0, 3, 0))
    assert 0 <= float(np.array(along)[0]) <= 1
