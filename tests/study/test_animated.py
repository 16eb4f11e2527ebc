"""Animations and cameras of glTF files in a scene's table, against poses worked by hand in double precision.

In files y is up; what is right is said with z up: (x, y, z) is at (x, -z, y).
"""

from __future__ import annotations

import numpy as np
import pytest
from support.gltf_files import Gltf
from support.mesh_cases import CUBE, TRIANGLES

from benchharness.scene import Scene
from benchharness.study import tablescene

HALF = np.sqrt(0.5)
EYE = {"path": [[0.0, -40.0, 0.0]], "target": [0.0, 0.0, 0.0], "fov_deg": 40.0}


def built(folder, thing=None, mirror=None, camera=None, **more) -> tuple[Scene, list[str]]:
    table = {
        "objects": [{"name": "thing", "mesh": "a.glb", **(thing or {})}],
        "reflectors": [{"name": "mirror", "mesh": "a.glb", **(mirror or {"node": "still"})}],
        "camera": camera or EYE,
        "background": [1, 1, 1],
        "h_max": 1000.0,
        "frames": 1000,
        **more,
    }
    return tablescene.built("mine", tablescene.validated(table, "f.toml: mine"), folder, "f.toml: mine")


def channel(g: Gltf, node: int, path: str, times, values, how: str | None = None, name: str = "go", **more) -> None:
    """One more channel of the animation of this name, which is added if there is none."""
    animations = g.json.setdefault("animations", [])
    if not any(a["name"] == name for a in animations):
        animations.append({"name": name, "channels": [], "samplers": []})
    (animation,) = (a for a in animations if a["name"] == name)
    sampler = {"input": g.numbers(np.reshape(times, (-1, 1))), "output": g.numbers(values, **more)}
    animation["samplers"].append({**sampler, **({} if how is None else {"interpolation": how})})
    animation["channels"].append({"sampler": len(animation["samplers"]) - 1, "target": {"node": node, "path": path}})


def stage(folder, build) -> None:
    """A still cube 100 to the left, and what `build` adds."""
    g = Gltf()
    cube = g.mesh(g.primitive(CUBE, TRIANGLES))
    g.node(cube, name="still", translation=[-100, 0, 0])
    build(g, cube)
    g.write(folder)


def seen(part, time: float, wanted) -> None:
    """Asserts that a part, a cube, is where a function (x, y, z) puts the corners of the file's."""
    pose = part.pose(time)
    assert pose[3].tolist() == [0, 0, 0, 1] and pose[:3, :3] @ pose[:3, :3].T == pytest.approx(np.eye(3), abs=1e-6)
    there = np.unique(np.round(part.mesh.vertices @ pose[:3, :3].T + pose[:3, 3], 4) + 0.0, axis=0)
    upright = [(x, -z, y) for x, y, z in (wanted(*corner) for corner in CUBE)]
    assert there == pytest.approx(np.unique(np.round(upright, 4) + 0.0, axis=0), abs=2e-4)


def moved_and_turned(how=None):
    def build(g, cube):
        node = g.node(cube, name="cart", translation=[0, 0, 0], scale=[2, 2, 2])
        channel(g, node, "translation", [1, 2, 4], [[0, 0, 0], [8, 0, 0], [8, 4, 0]], how)
        channel(g, node, "rotation", [1, 3], [[0, 0, 0, 1], [0, HALF, 0, HALF]], how)  # 90 degrees about y

    return build


def test_nodes_move_and_turn_straight_between_keys_and_hold_beyond_them(tmp_path):
    stage(tmp_path, moved_and_turned())
    (thing,) = built(tmp_path, {"animation": "go", "node": "cart"})[0].objects
    c, s = np.cos(np.radians(45)), np.sin(np.radians(45))
    seen(thing, 0.0, lambda x, y, z: (2 * x, 2 * y, 2 * z))
    seen(thing, 1.0, lambda x, y, z: (2 * x, 2 * y, 2 * z))
    # A turn by a about y takes (x, z) to (x cos a + z sin a, z cos a - x sin a).
    seen(thing, 2.0, lambda x, y, z: (8 + 2 * (c * x + s * z), 2 * y, 2 * (c * z - s * x)))
    seen(thing, 3.0, lambda x, y, z: (8 + 2 * z, 2 * y + 2, -2 * x))
    seen(thing, 9.0, lambda x, y, z: (8 + 2 * z, 2 * y + 4, -2 * x))


def test_steps_wait_for_the_next_key_and_come_with_the_frame_that_is_due(tmp_path):
    def build(g, cube):
        node = g.node(cube, name="cart")
        channel(g, node, "translation", [0, 0.6, 0.8], [[0, 0, 0], [3, 0, 0], [6, 0, 0]], "STEP")
        channel(g, node, "rotation", [0, 0.6], [[0, 0, 0, 1], [0, HALF, 0, HALF]], "STEP")

    stage(tmp_path, build)
    scene, _ = built(tmp_path, {"animation": 0, "node": "cart"})
    (thing,) = scene.objects
    assert float(np.float32(0.6)) > 0.6 == scene.time(15)  # a key of the file is later than the frame that is meant
    seen(thing, scene.time(14), lambda x, y, z: (x, y, z))
    seen(thing, scene.time(15), lambda x, y, z: (3 + z, y, -x))
    seen(thing, scene.time(19), lambda x, y, z: (3 + z, y, -x))
    seen(thing, scene.time(20), lambda x, y, z: (6 + z, y, -x))


def test_splines_go_through_their_keys_with_their_tangents(tmp_path):
    # From x = 0 to 4 in two seconds, with 3 a second out of the first key and 1 into the second. Specification, appendix C:
    # at half way  v = v0 / 2 + t (out) / 8 + v1 / 2 - t (in) / 8, t = 2 s.
    def build(g, cube):
        node = g.node(cube, name="cart")
        rows = [[9, 9, 9], [0, 0, 0], [3, 0, 0], [1, 0, 0], [4, 0, 0], [9, 9, 9]]
        channel(g, node, "translation", [1, 3], rows, "CUBICSPLINE")
        turns = [[0, 0, 0, 0], [0, 0, 0, 1], [0, 0, 0, 0], [0, 0, 0, 0], [0, HALF, 0, HALF], [0, 0, 0, 0]]
        channel(g, node, "rotation", [1, 3], turns, "CUBICSPLINE")

    stage(tmp_path, build)
    (thing,) = built(tmp_path, {"animation": "go", "node": "cart"})[0].objects
    middle = 0 / 2 + 2 * 3 / 8 + 4 / 2 - 2 * 1 / 8
    c, s = HALF, HALF  # the mean of both quaternions, made as long as 1, is half of the turn
    seen(thing, 2.0, lambda x, y, z: (middle + c * x + s * z, y, c * z - s * x))
    # At a quarter, u = 1/4: v = (2u^3 - 3u^2 + 1) v0 + t (u^3 - 2u^2 + u) out + (3u^2 - 2u^3) v1 + t (u^3 - u^2) in.
    u = 0.25
    quarter = 2 * (u**3 - 2 * u**2 + u) * 3 + (3 * u**2 - 2 * u**3) * 4 + 2 * (u**3 - u**2) * 1
    share = 3 * u**2 - 2 * u**3
    y, w = share * HALF, (1 - share) + share * HALF
    y, w = y / np.hypot(y, w), w / np.hypot(y, w)
    s, c = 2 * y * w, 1 - 2 * y * y
    seen(thing, 1.5, lambda x, y, z: (quarter + c * x + s * z, y, c * z - s * x))


def test_what_is_below_moves_with_what_is_above_and_turns_go_the_shorter_way(tmp_path):
    # The arm turns by 90 degrees about y in 2 s; the hand is 5 along x on it and rises by 4 in 4 s, from 1; its tool is at half
    # the size and 1 above it. The second key is the same turn as -q: the way there is not the longer one.
    def build(g, cube):
        tool = g.node(cube, root=False, name="tool", translation=[0, 1, 0], scale=[0.5, 0.5, 0.5])
        hand = g.node(root=False, name="hand", translation=[5, 0, 0], children=[tool])
        arm = g.node(name="arm", children=[hand])
        channel(g, arm, "rotation", [0, 2], [[0, 0, 0, 1], [0, -HALF, 0, -HALF]])
        channel(g, hand, "translation", [0, 4], [[5, 1, 0], [5, 5, 0]])

    stage(tmp_path, build)
    (thing,) = built(tmp_path, {"animation": "go", "node": "tool"})[0].objects
    c = s = np.cos(np.radians(45))
    seen(thing, 0.0, lambda x, y, z: (5 + x / 2, 2 + y / 2, z / 2))
    seen(thing, 1.0, lambda x, y, z: (c * (5 + x / 2) + s * z / 2, 3 + y / 2, c * z / 2 - s * (5 + x / 2)))
    seen(thing, 3.0, lambda x, y, z: (z / 2, 5 + y / 2, -(5 + x / 2)))


def test_an_entry_places_what_its_animation_moves_and_its_keys_move_that(tmp_path):
    stage(tmp_path, moved_and_turned())
    entry = {"animation": "go", "node": "cart", "scale": 0.5, "rotate_deg": [0, 0, 90], "translate": [0, 0, 3]}
    keys = [{"time": 0.0}, {"time": 2.0, "translate": [0, 0, 7], "rotate_deg": [0, 0, 180]}]
    (thing,) = built(tmp_path, {**entry, "keys": keys})[0].objects
    # At 3 s the file has (8 + 2 z, 2 y + 2, -2 x), y up, which is (8 + 2 z, 2 x, 2 y + 2), z up. Halved, turned by 180 degrees
    # (the keys have it there by then), and raised by 7: (-4 - z, -x, y + 1 + 7), of which `seen` wants y up, (X, Z, -Y).
    seen(thing, 3.0, lambda x, y, z: (-4 - z, y + 8, x))
    (thing,) = built(tmp_path, entry)[0].objects  # turned by 90 and raised by 3: (-x, 4 + z, y + 4)
    seen(thing, 3.0, lambda x, y, z: (-x, y + 4, -(4 + z)))


def test_parts_that_move_as_one_share_a_motion_and_others_are_objects_of_their_own(tmp_path):
    def build(g, cube):
        red = {**g.primitive(CUBE, TRIANGLES), "material": g.material((1, 0, 0), name="red")}
        blue = {**g.primitive(CUBE, TRIANGLES), "material": g.material((0, 0, 1), name="blue")}
        seat = g.node(g.mesh(blue), root=False, name="seat", translation=[0, 3, 0])
        g.node(g.mesh(red), name="cart", children=[seat])
        g.node(g.mesh(red), name="post")
        channel(g, 2, "translation", [0, 1], [[0, 0, 0], [1, 0, 0]])
        channel(g, 3, "translation", [0, 1], [[0, 0, 0], [0, 0, 0]])  # says that it stands
        channel(g, 0, "scale", [0, 1], [[1, 1, 1], [1, 1, 1]])

    stage(tmp_path, build)
    scene, said = built(tmp_path, {"animation": "go"})
    names = {thing.name: thing.motion for thing in scene.objects}
    assert sorted(names) == ["thing/cart/blue", "thing/cart/red", "thing/plain", "thing/red"]
    assert names["thing/cart/red"] is names["thing/cart/blue"] is not None
    assert names["thing/plain"] is names["thing/red"] is None
    assert not any("animations, left out" in text for text in said if text.startswith("object"))
    # Without an animation it is as it was.
    plain, said = built(tmp_path)
    assert sorted(thing.name for thing in plain.objects) == ["thing/blue", "thing/plain", "thing/red"]
    assert all(thing.motion is None for thing in plain.objects) and any("animations, left out" in text for text in said)


def test_a_mirror_moves_and_one_whose_parts_move_apart_is_refused(tmp_path):
    stage(tmp_path, moved_and_turned())
    scene, _ = built(tmp_path, mirror={"node": "cart", "animation": "go"})
    seen(scene.reflectors[0], 3.0, lambda x, y, z: (8 + 2 * z, 2 * y + 2, -2 * x))
    with pytest.raises(ValueError, match=r"reflectors\[0\]\.animation of a\.glb: parts of .*what stands, 'cart'; accepted"):
        built(tmp_path, mirror={"animation": "go"})


def skinned(g, cube):
    joint = g.node(name="bone")
    skin = g.add("skins", {"joints": [joint]})
    hung = {"JOINTS_0": g.numbers(np.zeros((8, 4)), "uint8"), "WEIGHTS_0": g.numbers(np.tile([1, 0, 0, 0], (8, 1)))}
    g.node(g.mesh(g.primitive(CUBE, TRIANGLES, **hung)), name="skinny", skin=skin)
    channel(g, joint, "translation", [0, 1], [[0, 0, 0], [1, 0, 0]])


def morphed(g, cube):
    node = g.node(g.mesh({**g.primitive(CUBE, TRIANGLES), "targets": [{"POSITION": g.numbers(CUBE)}]}), name="blob")
    channel(g, node, "weights", [0, 1], [[0], [1]])


def sized(g, cube):
    node = g.node(cube, name="balloon")
    channel(g, node, "scale", [0, 1], [[1, 1, 1], [2, 2, 2]])


def stretched(g, cube):
    node = g.node(cube, root=False, name="wheel")
    g.node(name="press", scale=[1, 3, 1], children=[node])
    channel(g, node, "rotation", [0, 1], [[0, 0, 0, 1], [0, 0, HALF, HALF]])


@pytest.mark.parametrize(
    ("build", "said"),
    [
        (skinned, "'go': it moves the joints on which node 'skinny' hangs, and bends it; accepted: nodes that are moved"),
        (morphed, "'go': it changes the shape of node 'blob'; accepted"),
        (sized, "'go': it changes the size of node 'balloon'; accepted"),
        (stretched, "'go': it stretches node 'wheel', by turning it below an uneven scale; accepted"),
    ],
)
def test_what_is_not_rigid_is_refused_by_name_and_by_who_takes_it_alone(tmp_path, build, said):
    stage(tmp_path, build)
    with pytest.raises(ValueError, match=rf"^f\.toml: mine\.objects\[0\]\.animation of a\.glb: animation {said}"):
        built(tmp_path, {"animation": "go"})
    assert built(tmp_path, {"animation": "go", "node": "still"})[0].objects[0].motion is None
    assert built(tmp_path)[0].objects


def twice(g, cube):
    node = g.node(cube)
    for _ in range(2):
        channel(g, node, "translation", [0, 1], [[0, 0, 0], [1, 0, 0]])


def of(path, times, values, how=None, **node):
    return lambda g, cube: channel(g, g.node(cube, **node), path, times, values, how)


@pytest.mark.parametrize(
    ("asked", "build", "said"),
    [
        ("stop", moved_and_turned(), r"it has no animations 'stop'; accepted: 'go'"),
        (1, moved_and_turned(), r"it has no animations 1; accepted: 'go'"),
        ("go", lambda g, cube: None, r"it has no animations 'go'; accepted: none, as it has none"),
        ("go", twice, r"translation of node .* is there twice; accepted: once"),
        ("go", of("translation", [0, 1], [[0, 0, 0]]), r"has 2 times and 1 rows of 3 numbers; accepted: 2 of 3"),
        ("go", of("translation", [0, 1], [[0, 0, 0]] * 2, "CUBICSPLINE"), r"2 times and 2 rows.*accepted: 6 of 3"),
        ("go", of("rotation", [0, 1], [[0, 0, 0]] * 2), r"rows of 3 numbers; accepted: 2 of 4"),
        ("go", of("rotation", [0, 1], [[0, 0, 0, 0]] * 2), r"a turn of length 0; accepted: quaternions"),
        ("go", of("translation", [1, 1], [[0, 0, 0]] * 2), r"times that do not ascend"),
        ("go", of("translation", [0, 1], [[0, 0, np.nan]] * 2), r"or no numbers; accepted: finite ones"),
        ("go", of("translation", [0, 1], [[0, 0, 0]] * 2, "SMOOTH"), r"goes by 'SMOOTH'; accepted: LINEAR, STEP, CUBICSPLINE"),
        ("go", of("translation", [0, 1], [[0, 0, 0]] * 2, matrix=[0.0] * 16), r"placed by a matrix; accepted"),
    ],
)  # fmt: skip
def test_animations_that_are_none_are_refused(tmp_path, asked, build, said):
    stage(tmp_path, build)
    with pytest.raises(ValueError, match=said) as error:
        built(tmp_path, {"animation": asked})
    assert str(error.value).startswith("f.toml: mine.objects[0].mesh: ") and "a.glb cannot be read" in str(error.value)


def test_files_without_nodes_have_no_animations_and_no_cameras(tmp_path):
    stage(tmp_path, moved_and_turned())
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    for asked in ({"thing": {"mesh": "a.obj", "animation": "go"}}, {"camera": {"file": "a.obj"}}):
        with pytest.raises(ValueError, match=r"a\.obj has no (animations|cameras); accepted: files that end in \.glb, \.gltf"):
            built(tmp_path, **asked)


# Cameras


def filmed(g, cube):
    """One that hangs below a crane; one that is orthographic."""
    wide = g.add("cameras", {"type": "perspective", "perspective": {"yfov": np.pi / 4, "znear": 0.1}})
    flat = g.add("cameras", {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "znear": 0.1, "zfar": 9}})
    eye = g.node(root=False, name="eye", camera=wide, rotation=[0, HALF, 0, HALF])  # looks along -x
    crane = g.node(name="crane", children=[eye], translation=[10, 0, 0], scale=[2, 2, 2])
    g.node(name="plan", camera=flat)
    channel(g, crane, "translation", [0, 2], [[10, 0, 0], [10, 6, 0]])
    channel(g, crane, "rotation", [0, 2], [[0, 0, 0, 1], [HALF, 0, 0, HALF]])  # 90 degrees about x: up becomes +z


@pytest.mark.parametrize("node", ["eye", "crane"])
def test_a_camera_of_a_file_sees_what_it_sees_there(tmp_path, node):
    stage(tmp_path, filmed)
    scene, said = built(tmp_path, camera={"file": "a.glb", "node": node})
    camera = scene.camera(2.0)
    assert camera.fov_deg == pytest.approx(45)
    assert (camera.eye, camera.up) == (pytest.approx((10, 0, 0), abs=1e-6), pytest.approx((0, 0, 1), abs=1e-6))
    # Right, down and forward: it looks along -x, z up, so that +y is to its right.
    assert camera.axes() == pytest.approx(np.array([[0, 1, 0], [0, 0, -1], [-1, 0, 0]]), abs=1e-6)
    assert not any("cameras, left out" in text for text in said)
    assert any("cameras, left out" in text for text in built(tmp_path)[1])


def test_a_camera_of_a_file_is_placed_and_moved_as_the_file_is(tmp_path):
    stage(tmp_path, filmed)
    place = {"file": "a.glb", "node": "eye", "animation": "go", "unit": "cm", "rotate_deg": [0, 0, 90], "translate": [0, 0, 1]}
    scene, _ = built(tmp_path, camera={**place, "fov_deg": 30})
    for time, eye, axes in [
        # (10, y, 0), y up, is (10, 0, y), z up: a hundredth of that turned by 90 degrees about z is (0, .1, y / 100).
        (0.0, (0, 0.1, 1), [[-1, 0, 0], [0, 0, -1], [0, -1, 0]]),
        # At y = 3, by 45 degrees about x: up is (0, h, h) in the file, (0, -h, h) z up, (h, 0, h) turned. It looks along -y.
        (1.0, (0, 0.1, 1.03), [[-HALF, 0, HALF], [-HALF, 0, -HALF], [0, -1, 0]]),
        (7.0, (0, 0.1, 1.06), [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]),
    ]:
        camera = scene.camera(time)
        assert camera.fov_deg == 30 and camera.eye == pytest.approx(eye, abs=1e-6)
        assert camera.axes() == pytest.approx(np.array(axes), abs=1e-6)


def test_the_camera_of_a_fitted_file_stands_in_it_where_it_did(tmp_path):
    # The box goes from -101 to 1 along x: 102 long, made 51, its middle, -50, at 1.
    stage(tmp_path, lambda g, cube: (g.node(cube), filmed(g, cube)))
    fit = {"fit": {"centre": [1, 0, 0], "size": 51}}
    scene, _ = built(tmp_path, fit, {**fit, "node": "still"}, {"file": "a.glb", "node": "eye", **fit})
    assert scene.camera(0.0).eye == pytest.approx((1 + (10 + 50) / 2, 0, 0), abs=1e-5)


@pytest.mark.parametrize(
    ("camera", "said"),
    [
        ({"file": "a.glb"}, r"camera\.file: .*a\.glb cannot be read: it has 2 cameras; accepted: `node` .*'eye', 'plan'"),
        ({"file": "a.glb", "node": "nose"}, r"it has no cameras at or below node 'nose'; accepted: .*'eye', 'plan'"),
        ({"file": "a.glb", "node": "plan"}, r"camera 'plan' is orthographic; accepted: perspective"),
        ({"file": "b.glb"}, r"camera\.file: there is no file .*b\.glb; accepted"),
        ({"file": "a.glb", "target": [0, 0, 0]}, r"camera has file and target; accepted beside it: node, animation, fov_deg"),
        ({**EYE, "node": "eye"}, r"camera has path and node; accepted beside it: target, fov_deg, up"),
    ],
)
def test_a_camera_that_is_not_there_is_refused(tmp_path, camera, said):
    stage(tmp_path, filmed)
    with pytest.raises(ValueError, match=said):
        built(tmp_path, camera=camera)


def test_the_shape_of_a_cameras_picture_is_said(tmp_path):
    def build(g, cube):
        g.node(name="eye", camera=g.add("cameras", {"type": "perspective", "perspective": {"yfov": 1.0, "aspectRatio": 1.5}}))

    stage(tmp_path, build)
    _, said = built(tmp_path, camera={"file": "a.glb"})
    assert "camera eye, a.glb: its picture is 1.5 times as wide as high; any other keeps its height" in said
