"""Keys of a scene's table: where things are at them, between them and beyond, by poses worked by hand."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from benchharness.scene import Scene
from benchharness.study import tablescene

CAMERA = {"path": [[0.0, -4.0, 0.0]], "target": [0.0, 0.0, 0.0], "fov_deg": 40.0}


def built(folder, thing=None, mirror=None, camera=None, **more) -> tuple[Scene, list[str]]:
    """A box of 1 x 2 x 4 whose lowest corner is its origin, and a ball."""
    (folder / "box.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 1 2 0\nv 0 2 0\nv 0 0 4\nv 1 0 4\nv 1 2 4\nv 0 2 4\n"
        "f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"
    )
    trimesh.creation.icosphere(subdivisions=1).export(folder / "ball.ply")
    table = {
        "objects": [{"name": "box", "mesh": "box.obj", "emission": [1, 1, 1], **(thing or {})}],
        "reflectors": [{"name": "ball", "mesh": "ball.ply", **(mirror or {})}],
        "camera": camera or CAMERA,
        "h_max": 100.0,
        **more,
    }
    return tablescene.built("mine", tablescene.validated(table, "f.toml: mine"), folder, "f.toml: mine")


def corners(part, time: float) -> np.ndarray:
    """Corners of a part in the world, in lexicographic order, each once."""
    pose = part.pose(time)
    assert pose[3].tolist() == [0, 0, 0, 1]
    assert pose[:3, :3] @ pose[:3, :3].T == pytest.approx(np.eye(3), abs=1e-14) and np.linalg.det(pose[:3, :3]) > 0
    there = part.mesh.vertices @ pose[:3, :3].T + pose[:3, 3]
    return np.unique(np.round(there, 9) + 0.0, axis=0)


def box(move) -> np.ndarray:
    """What a function of (x, y, z) makes of the corners of the box, likewise."""
    own = np.array([(x, y, z) for x in (0, 1) for y in (0, 2) for z in (0, 4)], float)
    return np.unique(np.round(np.array([move(*p) for p in own], float), 9) + 0.0, axis=0)


def of_ends(said: list[str]) -> list[str]:
    return [text for text in said if text.startswith("what moves")]


KEYS = [
    {"time": 1.0},
    {"time": 2.0, "translate": [5, 0, 0]},
    {"time": 4.0, "translate": [5, 0, 0], "rotate_deg": [0, 0, 90]},
    {"time": 5.0, "rotate_deg": [0, 0, 90]},
]
HALF = np.sqrt(0.5)


@pytest.mark.parametrize(
    ("time", "move"),
    [
        (-3.0, lambda x, y, z: (x, y, z + 7)),  # before the first key, the entry's own place
        (1.0, lambda x, y, z: (x, y, z + 7)),
        (1.25, lambda x, y, z: (x + 1.25, y, z + 7 - 1.75)),  # a quarter of the way from (0, 0, 7) to (5, 0, 0)
        (2.0, lambda x, y, z: (x + 5, y, z)),
        (3.0, lambda x, y, z: (5 + HALF * (x - y), HALF * (x + y), z)),  # half of a quarter turn
        (4.0, lambda x, y, z: (5 - y, x, z)),
        (5.0, lambda x, y, z: (-y, x, z + 7)),
        (9.0, lambda x, y, z: (-y, x, z + 7)),  # after the last
    ],
)
def test_an_object_is_at_its_keys_and_straight_between_them(tmp_path, time, move):
    scene, _ = built(tmp_path, {"translate": [0, 0, 7], "keys": KEYS}, frames=200)
    assert corners(scene.objects[0], time) == pytest.approx(box(move), abs=1e-8)


def test_turns_about_two_axes_go_the_shorter_way_at_even_pace(tmp_path):
    # From 90 degrees about x to 90 about x and then 120 about z: 120 about z lie between. A third is 40.
    keys = [{"time": 0.0}, {"time": 3.0, "rotate_deg": [90, 0, 120]}]
    scene, _ = built(tmp_path, {"rotate_deg": [90, 0, 0], "keys": keys}, frames=200)
    c, s = np.cos(np.radians(40)), np.sin(np.radians(40))
    wanted = box(lambda x, y, z: (c * x + s * z, s * x - c * z, y))  # (x, y, z) lies at (x, -z, y), then turns
    assert corners(scene.objects[0], 1.0) == pytest.approx(wanted, abs=1e-8)
    # 100 degrees about x and then 100 about z.
    keys = [{"time": 0.0, "rotate_deg": [0, 0, 0]}, {"time": 1.0, "rotate_deg": [100, 0, 100]}]
    scene, _ = built(tmp_path, {"keys": keys}, frames=200)
    a = np.radians(100)
    x100 = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    z100 = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    whole, half = z100 @ x100, scene.objects[0].pose(0.5)[:3, :3]
    assert half @ half == pytest.approx(whole, abs=1e-12)  # half of it, twice, is all of it
    angle = np.degrees(np.arccos((np.trace(half) - 1) / 2))
    assert angle == pytest.approx(np.degrees(np.arccos((np.trace(whole) - 1) / 2)) / 2, abs=1e-9) and angle < 90


def test_what_is_fitted_is_moved_and_turned_by_the_middle_of_its_box(tmp_path):
    # The box of 1 x 2 x 4 becomes 2 long, half its size, its middle at (1, 1, 1): (x, y, z) is at (1 + (x - .5) / 2, ...).
    upright = {"rotate_deg": [0, 0, 90]}
    keys = [{"time": 0.0}, {"time": 1.0, **upright}, {"time": 2.0, "centre": [3, 1, 1], **upright}]
    scene, _ = built(tmp_path, {"fit": {"centre": [1, 1, 1], "size": 2.0}, "keys": keys}, frames=200)
    thing = scene.objects[0]
    for time, move in [
        (0.0, lambda x, y, z: (1 + (x - 0.5) / 2, 1 + (y - 1) / 2, 1 + (z - 2) / 2)),
        (1.0, lambda x, y, z: (1 - (y - 1) / 2, 1 + (x - 0.5) / 2, 1 + (z - 2) / 2)),
        (1.5, lambda x, y, z: (2 - (y - 1) / 2, 1 + (x - 0.5) / 2, 1 + (z - 2) / 2)),
    ]:
        assert corners(thing, time) == pytest.approx(box(move), abs=1e-8)


def test_a_mirror_moves_with_what_is_closed_around_it_and_what_is_still_does_not_move(tmp_path):
    moves = {"closed": "ball.ply", "translate": [0, 0, 1], "keys": [{"time": 0.0}, {"time": 1.0, "translate": [2, 0, 1]}]}
    scene, said = built(tmp_path, mirror=moves, frames=26)
    mirror = scene.reflectors[0]
    assert mirror.closed is not None and mirror.closed.vertices == pytest.approx(mirror.mesh.vertices)
    middle = corners(mirror, scene.time(25)).mean(axis=0)
    assert middle == pytest.approx([2, 0, 1], abs=1e-6) and scene.moves(0.0, 0.04)
    assert scene.objects[0].motion is None and not scene.moves(1.0, 7.0)
    assert not of_ends(said)


def test_parts_of_one_entry_share_its_motion_and_rest_to_the_last_bit(tmp_path):
    (tmp_path / "two.mtl").write_text("newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n")
    text = "mtllib two.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl red\nf 1 2 3\nusemtl blue\nf 1 4 2\n"
    (tmp_path / "two.obj").write_text(text)
    at = {"translate": [0.1, 0.2, 0.3], "rotate_deg": [10, 20, 30]}
    keys = [{"time": 0.0}, {"time": 1.0, **at}, {"time": 2.0, **at}, {"time": 3.0}]
    scene, _ = built(tmp_path, {"mesh": "two.obj", "keys": keys}, frames=100)
    red, blue = scene.objects
    assert red.motion is not None and red.motion is blue.motion
    assert scene.moves(0.5, 0.6) and not scene.moves(1.1, 1.7)


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ({"keys": [{"time": 1.0}, {"time": 1.0}]}, r"objects\[0\]\.keys\[1\]\.time is 1; accepted: more than 1, "),
        ({"keys": []}, r"objects\[0\]\.keys is \[\]; accepted"),
        ({"keys": [{"translate": [0, 0, 1]}]}, r"objects\[0\]\.keys\[0\]\.time is missing"),
        ({"keys": [{"time": 0, "translat": [0, 0, 1]}]}, r"keys\[0\]: key .*translat.*did you mean 'translate'"),
        ({"keys": [{"time": 0, "centre": [0, 0, 1]}]}, r"keys\[0\] has centre without a `fit`; accepted: translate"),
        (
            {"keys": [{"time": 0, "translate": [0, 0, 1]}], "fit": {"size": 1}},
            r"keys\[0\] has translate with a `fit`; accepted: centre",
        ),
        (
            {"keys": [{"time": 0}, {"time": 1, "rotate_deg": [0, 0, 360]}]},
            r"keys\[1\]\.rotate_deg turns by 360 degrees about an axis.*; accepted: less than 180, and keys in between",
        ),
    ],
)
def test_keys_that_say_nothing_certain_are_refused(tmp_path, entry, said):
    with pytest.raises(ValueError, match=said) as error:
        built(tmp_path, entry)
    assert str(error.value).startswith("f.toml: mine.objects[0]")


def test_an_eye_goes_from_key_to_key_with_what_it_looks_at(tmp_path):
    keys = [
        {"time": 0.0, "eye": [0, -4, 1]},
        {"time": 1.0, "eye": [2, -4, 1], "target": [0, 0, 4], "fov_deg": 60.0},
        {"time": 3.0, "eye": [2, -8, 1], "up": [1, 0, 0]},
    ]
    scene, _ = built(tmp_path, camera={"keys": keys, "target": [0, 0, 0], "fov_deg": 40.0}, frames=100)
    for time, eye, target, fov, up in [
        (-1.0, (0, -4, 1), (0, 0, 0), 40, (0, 0, 1)),
        (0.25, (0.5, -4, 1), (0, 0, 1), 45, (0, 0, 1)),
        (1.0, (2, -4, 1), (0, 0, 4), 60, (0, 0, 1)),
        (2.0, (2, -6, 1), (0, 0, 2), 50, (0.5, 0, 0.5)),
        (8.0, (2, -8, 1), (0, 0, 0), 40, (1, 0, 0)),
    ]:
        camera = scene.camera(time)
        assert (camera.eye, camera.target, camera.up) == tuple(pytest.approx(v, abs=1e-12) for v in (eye, target, up))
        assert camera.fov_deg == pytest.approx(fov)


@pytest.mark.parametrize(
    ("camera", "said"),
    [
        ({"target": [0, 0, 0], "fov_deg": 40}, r"camera has no path, keys or file; accepted: one of path, keys and file"),
        ({**CAMERA, "keys": [{"time": 0, "eye": [0, 0, 0]}]}, r"camera has path and keys; accepted: one of path, keys"),
        ({"path": [[0, -4, 0]], "fov_deg": 40}, r"camera\.target is missing; accepted"),
        ({"path": [[0, -4, 0]], "target": [0, 0, 0]}, r"camera\.fov_deg is missing; accepted"),
        ({"keys": [{"time": 0, "eye": [0, -4, 0], "target": [0, 0, 0]}]}, r"camera\.keys\[0\]\.fov_deg is missing; accepted"),
        ({"keys": [{"time": 0}]}, r"camera\.keys\[0\]\.eye is missing"),
        ({"keys": [{"time": 0, "eye": [0, -4, 0], "translate": [0, 0, 0]}]}, r"camera\.keys\[0\]: key .*accepted: .*eye"),
        (
            {"keys": [{"time": 1, "eye": [0, -4, 0]}, {"time": 0, "eye": [0, -4, 0]}], "target": [0, 0, 0], "fov_deg": 40},
            r"camera\.keys\[1\]\.time is 0; accepted: more than 1",
        ),
    ],
)  # fmt: skip
def test_a_camera_that_says_too_little_or_too_much_is_refused(tmp_path, camera, said):
    with pytest.raises(ValueError, match=said):
        built(tmp_path, camera=camera)


def test_motions_that_go_on_after_the_last_frame_are_said(tmp_path):
    keys = [{"time": 0.0}, {"time": 2.0, "translate": [1, 0, 0]}]
    _, said = built(tmp_path, {"keys": keys})
    assert of_ends(said) == ["what moves goes on to 2 s, and 1 frames at 25 a second to 0 s: see `frames`"]
    assert not of_ends(built(tmp_path, {"keys": keys}, frames=51)[1])
