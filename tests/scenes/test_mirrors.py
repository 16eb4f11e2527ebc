"""The dressing room: mirrors that are flat, two that face each other, what touches the third, a camera that sees them."""

from __future__ import annotations

import pickle
from functools import cache

import numpy as np
import pytest

from benchharness.kernels import planes
from benchharness.scene import Scene
from scenes.mirrors import LEAN_DEG, OFF, DetailName, X, Y, Z, mirrors

NAMES = ("wall", "opposite", "leaning")


@cache
def built(detail: DetailName = "lean") -> Scene:
    return mirrors(detail)


def fit(number: int) -> planes.Fit:
    return planes.fitted(built().reflectors[number].mesh)


def vertices(name: str) -> np.ndarray:
    return next(o for o in built().objects if o.name == name).mesh.vertices


def height(name: str) -> np.ndarray:
    """Of an object's vertices over the mirror that leans, metres."""
    return (vertices(name) - fit(2).point) @ fit(2).normal


def test_the_scene_says_what_was_asked_for_and_anything_else_is_refused_by_name():
    details: tuple[tuple[DetailName, int, int], ...] = (("lean", 1000, 2000), ("paper", 2000, 6000))
    for detail, fewest, most in details:
        scene = built(detail)
        assert (scene.name, scene.detail, scene.frames, scene.fps) == ("mirrors", detail, 100, 25)
        assert scene.source == {"detail": detail, "base_vertices": scene.vertices}
        assert fewest < scene.vertices < most and all(o.shows for o in scene.objects)
    with pytest.raises(ValueError, match="mirrors: detail is 'rich'; accepted: lean, paper"):
        mirrors("rich")
    again = pickle.loads(pickle.dumps(built()))
    assert again.camera(1.0) == built().camera(1.0)


def test_all_mirrors_are_flat_and_two_of_them_face_each_other():
    assert [r.name for r in built().reflectors] == list(NAMES)
    assert all(fit(k).flat for k in range(3))
    one, other, third = (fit(k) for k in range(3))
    np.testing.assert_allclose(one.normal, -other.normal, atol=1e-12)
    assert (other.point - one.point) @ one.normal == pytest.approx(2 * Y - 2 * OFF)
    assert np.degrees(np.arcsin(third.normal[2])) == pytest.approx(LEAN_DEG) and third.normal[0] > 0.9


def test_the_mirror_that_leans_is_within_the_room_and_touched_by_what_should():
    v = built().reflectors[2].mesh.vertices
    assert v[:, 2].min() == pytest.approx(0, abs=1e-12) and -X < v[:, 0].min() < -X + 0.3 and v[:, 2].max() < Z
    assert height("crate").min() == pytest.approx(0, abs=1e-9) and (height("crate") > 1e-3).any()
    assert -1e-3 < height("stick").min() < 2e-3 and height("stool").min() > 0.3
    assert height("board").max() == pytest.approx(-0.004)


def test_the_wall_s_and_the_leaning_mirror_are_whole_in_the_picture_and_the_eye_is_free():
    for time in (0.0, 99 / 25):
        camera = built().camera(time)
        eye = np.asarray(camera.eye)
        assert (np.abs(eye) < [X - 0.3, Y - 0.3, Z - 0.3]).all()
        rows = camera.world_to_screen(360, 240)
        for number in (0, 2):
            assert (fit(number).point - eye) @ fit(number).normal < 0
            q = np.hstack([built().reflectors[number].mesh.vertices, np.ones((4, 1))]) @ rows.T
            px = q[:, :2] / q[:, 2:]
            assert (q[:, 2] > 0).all() and (px >= 0).all() and (px < [360, 240]).all()
