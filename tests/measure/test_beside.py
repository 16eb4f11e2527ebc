"""Frames beside one: always another, as near as a pixel, and none whose mirrors reach out of its boxes."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest
from support.mirror_room import ball, mirror_ball, orbit, scene, still, walls

from benchharness.measure.beside import Beside
from benchharness.render.frame import FrameRenderer
from benchharness.scene import Object

SIZE = (64, 48)


def rise(time):
    pose = np.eye(4)
    pose[2, 3] = 0.5 * time
    return pose


@pytest.fixture(scope="module")
def renderer():
    moving = Object("ball", ball(0.15, (0.5, -0.7, 0.1), (0.9, 0.1, 0.1)), "something that moves", rise)
    return FrameRenderer(scene((walls(h=1.0), moving), (mirror_ball(fine=32),), orbit(2.0)), *SIZE)


def bits(frame) -> dict:
    return {name: np.array(getattr(frame, name)).tobytes() for name in ("p", "n", "v", "poses")}


def test_every_next_camera_is_another_one_and_a_pixel_aside(renderer):
    beside = Beside(renderer, [renderer.render(i) for i in (0, 1)])
    frame, near = beside.frame, beside.several(5)
    eyes = np.array([np.ravel(one.view.eye) for one in (frame, *near)])
    assert len(np.unique(eyes, axis=0)) == 6
    # Aside by the width of a pixel at the distance of what it looks at, the ball's middle.
    pixel = np.linalg.norm(eyes[0]) * np.linalg.norm(np.ravel(frame.view.right))
    np.testing.assert_allclose(np.linalg.norm(eyes[1:] - eyes[0], axis=1), pixel, rtol=1e-3)
    for one in near:
        assert (one.index, one.time) == (frame.index, frame.time)
        assert bits(one)["poses"] == bits(frame)["poses"]
        assert all(bits(one)[name] != bits(frame)[name] for name in ("p", "n", "v"))
        assert abs(len(one.pixels) - len(frame.pixels)) < 0.03 * len(frame.pixels)
    assert len({bits(one)["p"] for one in near}) == 5


def test_boxes_are_the_same_for_all_and_hold_the_mirror_as_each_sees_it(renderer):
    beside = Beside(renderer, [renderer.render(0)])
    (left, top, right, bottom), *_ = beside.boxes
    for one in beside.several(8):
        assert one.boxes == beside.boxes
        rows, columns = np.nonzero(np.array(one.active).reshape(SIZE[1], SIZE[0]))
        assert left <= columns.min() and columns.max() < right
        assert top <= rows.min() and rows.max() < bottom


def test_updates_are_asked_for_other_poses_within_the_step_from_the_frame_before(renderer):
    beside = Beside(renderer, [renderer.render(i) for i in (0, 1)])
    frames = list(islice(beside.moved(), 5))
    heights = [np.array(frame.poses).reshape(-1, 3, 4)[1, 2, 3] for frame in frames]
    assert len(set(heights)) == 5 and len({frame.time for frame in frames}) == 5
    assert all(rise(renderer.scene.time(0))[2, 3] < height <= rise(renderer.scene.time(1))[2, 3] for height in heights)
    assert all(0 <= frame.index < renderer.scene.frames for frame in frames)


def test_where_nothing_moves_updates_are_asked_for_the_frame_itself():
    fixed = FrameRenderer(scene((walls(h=1.0),), (mirror_ball(fine=32),), still()), *SIZE)
    beside = Beside(fixed, [fixed.render(i) for i in (0, 1)])
    assert next(beside.moved()) is beside.frame
    alone = Beside(fixed, [fixed.render(0)])
    assert next(alone.moved()) is alone.frame
