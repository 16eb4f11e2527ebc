"""The two rooms: walls without gaps, the doorway between, a mirror that goes through it and leaves its box, a free eye."""

from __future__ import annotations

import pickle
from functools import cache
from typing import Any, cast

import numpy as np
import pytest

from benchharness.kernels.images import roombox
from benchharness.scene import Scene, subdivided
from scenes.doorway import DOOR, FPS, FRAMES, HALL, HEIGHT, RADIUS, STUDY, DetailName, doorway

TIMES = np.linspace(0, (FRAMES - 1) / FPS, 12)
LAST = float(TIMES[-1])


@cache
def built(detail: DetailName = "lean") -> Scene:
    return doorway(detail)


def object_of(name: str):
    return next(o for o in built().objects if o.name == name)


def ball_at(time: float) -> np.ndarray:
    return built().reflectors[0].pose(time)[:3, 3]


def test_the_scene_says_what_was_asked_for_and_anything_else_is_refused_by_name():
    details: tuple[tuple[DetailName, int, int], ...] = (("lean", 3500, 4500), ("paper", 5000, 9000))
    for detail, fewest, most in details:
        scene = built(detail)
        assert (scene.name, scene.detail, scene.frames, scene.fps) == ("doorway", detail, 100, 25)
        assert scene.source == {"detail": detail, "base_vertices": scene.vertices}
        assert fewest < scene.vertices < most
    with pytest.raises(ValueError, match="doorway: detail is 'rich'; accepted: lean, paper"):
        doorway(detail=cast(Any, "rich"))
    again = pickle.loads(pickle.dumps(built()))
    assert again.camera(1.0) == built().camera(1.0) and (again.poses(2.0) == built().poses(2.0)).all()


def test_every_object_has_its_own_name_says_what_it_shows_and_is_wound_like_its_normals():
    objects = built().objects
    assert len({o.name for o in objects}) == len(objects)
    for o in objects:
        a, b, c = o.mesh.vertices[o.mesh.faces].swapaxes(0, 1)
        faced = np.einsum("fi,fi->f", np.cross(b - a, c - a), o.mesh.normals[o.mesh.faces].sum(axis=1))
        assert len(o.shows.split()) >= 4 and faced.min() > 0, o.name
        albedo = np.asarray(o.mesh.albedo)
        assert albedo.min() >= 0.03 and albedo.max() <= 0.87, o.name


@pytest.mark.parametrize(("name", "room"), [("hall", HALL), ("study", STUDY)])
def test_each_room_is_a_box_that_its_surfaces_face_into(name, room):
    low, high = np.array([room.x[0], room.y[0], 0.0]), np.array([room.x[1], room.y[1], room.z])
    for part in ("walls", "floor", "ceiling"):
        mesh = object_of(f"{name} {part}").mesh
        assert (mesh.vertices >= low - 1e-9).all() and (mesh.vertices <= high + 1e-9).all()
        inward = 0.5 * (low + high) - mesh.vertices[mesh.faces[:, 0]]
        assert (np.einsum("fi,fi->f", mesh.normals[mesh.faces[:, 0]], inward) > 0).all()
    walls = object_of(f"{name} walls").mesh.vertices
    np.testing.assert_allclose([walls.min(axis=0), walls.max(axis=0)], [low, high], atol=1e-9)


def test_the_frame_around_the_doorway_lies_in_the_walls_and_faces_the_room_on_each_side():
    frame = object_of("door frame").mesh
    flat = np.abs(frame.normals[:, 0]) > 0.5
    assert set(np.sign(frame.vertices[flat, 0])) == {-1.0, 1.0}
    np.testing.assert_allclose(frame.vertices[flat, 0], np.where(frame.normals[flat, 0] < 0, HALL.x[1], STUDY.x[0]), atol=1e-12)


def test_no_ray_leaves_the_rooms_wherever_the_mirror_is():
    assert built().enclosed == (True,)


def test_the_ball_goes_from_the_hall_through_the_doorway_into_the_study_and_touches_nothing_but_its_stand():
    assert ball_at(0.0)[0] < HALL.x[1] - 1.0 and ball_at(LAST)[0] > STUDY.x[0] + 1.0
    np.testing.assert_allclose(ball_at(LAST)[1:], [0, HEIGHT], atol=1e-12)
    assert DOOR[0] + RADIUS < 0 < DOOR[1] - RADIUS and DOOR[3] > HEIGHT + RADIUS
    for o in built().objects:
        points = subdivided(o.mesh, 0.1).vertices
        for time in TIMES:
            there = points @ o.pose(time)[:3, :3].T + o.pose(time)[:3, 3]
            away = np.linalg.norm(there - ball_at(time), axis=1).min() - RADIUS
            assert (-1e-4 < away < 1e-3) if o.name == "stand" else away > 0.2, o.name


def test_the_box_that_is_fitted_is_the_hall_s_and_the_ball_ends_outside_of_it():
    (box,) = roombox.around_mirrors(built())
    corners = np.array([[HALL.x[0], HALL.y[0], 0.0], [HALL.x[1], HALL.y[1], HALL.z]])
    np.testing.assert_allclose(box.centre, corners.mean(axis=0), atol=1e-9)
    np.testing.assert_allclose(np.abs(box.axes.T @ box.half), 0.5 * np.ptp(corners, axis=0), atol=1e-9)
    inside = [bool((np.abs(box.axes @ (ball_at(t) - box.centre)) < box.half).all()) for t in TIMES]
    assert inside[0] and not inside[-1]


def test_the_eye_is_free_and_sees_the_ball_whole_through_the_doorway():
    ball = built().reflectors[0].mesh.vertices[::7]
    for time in TIMES:
        camera = built().camera(time)
        eye, points = np.asarray(camera.eye), ball + ball_at(time)
        assert (eye[:2] > [HALL.x[0] + 0.3, HALL.y[0] + 0.3]).all() and eye[0] < HALL.x[1] - 0.3 and eye[2] < HALL.z - 0.3
        q = np.hstack([points, np.ones((len(points), 1))]) @ camera.world_to_screen(360, 256).T
        px = q[:, :2] / q[:, 2:]
        assert (px > 0).all() and (px < [360, 256]).all()
        # Where each line from the eye to the ball passes the planes of the two walls with the doorway in them.
        for x in (HALL.x[1], STUDY.x[0]):
            beyond = points[points[:, 0] > x]
            share = (x - eye[0]) / (beyond[:, 0] - eye[0])
            there = eye + share[:, None] * (beyond - eye)
            assert (there[:, 1] > DOOR[0]).all() and (there[:, 1] < DOOR[1]).all() and (there[:, 2] < DOOR[3]).all()
