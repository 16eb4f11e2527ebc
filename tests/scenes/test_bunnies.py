"""The two bunnies: smooth closed hares that cut each other all the time, and change sides."""

from __future__ import annotations

import pickle
from functools import cache

import numpy as np
import pytest
import trimesh

from benchharness.modelling.winding import winding_number
from benchharness.render.inside import check_cameras
from benchharness.scene import Mesh, Scene
from scenes.bunnies import CELLS, MIRROR_DEG, SCALE, bunnies
from scenes.panoramas.meadow import SUN_DEG, painted
from scenes.props import creature
from scenes.props.implicit import field, gradient
from scenes.props.shapes import pose
from scenes.props.ways import way_to

MOMENTS = (0, 20, 49, 58, 66, 74, 82, 90, 99)
"""Frames; the furry bunny moves from the fifth on."""


@cache
def built(detail="lean", moving=True) -> Scene:
    return bunnies(detail, moving=moving)


def part(name: str):
    return next(p for p in built().parts if p.name == name)


def world(name: str, frame: int) -> Mesh:
    return part(name).mesh.transformed(part(name).pose(built().time(frame)))


def in_hare(points: np.ndarray, of_pose: np.ndarray) -> np.ndarray:
    """f of the hare that stands at a pose, at points [N, 3] of the world; in metres of the hare as built."""
    inverse = np.linalg.inv(of_pose)
    return field(creature.blobs(), points @ inverse[:3, :3].T + inverse[:3, 3])


def furry_pose(frame: int) -> np.ndarray:
    return part("bunny").pose(built().time(frame)) @ pose(scale=SCALE)


# What is asked for


def test_there_are_enough_vertices_and_not_too_many():
    for name in ("bunny", "mirror bunny"):
        assert 5000 <= len(part(name).mesh.vertices) <= 8000
    assert built().vertices < 16000


@pytest.mark.exhaustive
def test_paper_detail_has_the_stanford_bunnys_vertices():
    # The full scan of the Stanford 3D Scanning Repository has 35,947.
    assert len(creature.body(CELLS["paper"]).vertices) == pytest.approx(35947, rel=0.01)


def test_the_scene_says_what_was_asked_for():
    scene = built(moving=False)
    assert (scene.name, scene.detail, scene.frames, scene.fps) == ("bunnies", "lean", 100, 25)
    assert scene.source == {"detail": "lean", "moving": False, "base_vertices": scene.vertices}
    assert [o.name for o in scene.objects] == ["bunny", "floor"]
    assert [r.name for r in scene.reflectors] == ["mirror bunny"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"detail": "rich"}, "bunnies: detail is 'rich'; accepted: lean, paper"),
        ({"moving": "yes"}, "bunnies: moving is 'yes'; accepted: true or false"),
        ({"moving": 1}, "bunnies: moving is 1; accepted: true or false"),
    ],
)
def test_anything_else_is_refused_by_name(arguments, message):
    with pytest.raises(ValueError, match=message):
        bunnies(**arguments)


def test_a_scene_can_be_sent_to_another_process():
    copy = pickle.loads(pickle.dumps(built()))
    assert (copy.poses(3.1) == built().poses(3.1)).all()
    assert copy.camera(1.3) == built().camera(1.3)


# Their surface


def test_the_hares_are_closed_wound_outward_and_without_slivers():
    for name, pieces in (("mirror bunny", 1), ("bunny", 3)):
        mesh = part(name).mesh
        solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        assert solid.is_watertight
        assert solid.is_winding_consistent
        assert solid.body_count == pieces  # the eyes are pieces of their own
        assert np.degrees(solid.face_angles.min()) > 15
    inside = np.array([0.0, 0.0, 0.1])
    assert winding_number(part("mirror bunny").mesh, inside) == pytest.approx(1, abs=1e-9)


def test_the_mirror_has_no_handle():
    mesh = part("mirror bunny").mesh
    assert trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).euler_number == 2


def test_vertices_are_on_the_surface_and_so_are_faces_to_a_part_of_a_cell():
    mesh, blobs = creature.body(CELLS["lean"]), creature.blobs()
    cell = CELLS["lean"]
    assert abs(field(blobs, mesh.vertices)).max() < 1e-9 * cell
    f, g = gradient(blobs, mesh.vertices[mesh.faces].mean(axis=1))
    away = abs(f) / np.linalg.norm(g, axis=1)
    # A face of edge h is h² κ / 6 from a surface of curvature κ: at the ears' tips, where 1 / κ is half a cell, a third of it;
    # and distances by the gradient are only good for as much.
    assert away.max() < 0.5 * cell
    assert np.percentile(away, 95) < 0.08 * cell


def test_normals_are_unit_outward_and_those_of_the_smooth_surface():
    body = creature.body(CELLS["lean"])
    g = gradient(creature.blobs(), body.vertices)[1]
    assert np.allclose(body.normals, g / np.linalg.norm(g, axis=1, keepdims=True), atol=1e-12)
    for p in built().parts:
        assert np.allclose(np.linalg.norm(p.mesh.normals, axis=1), 1, atol=1e-12)
        corners = p.mesh.vertices[p.mesh.faces]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert (np.einsum("fi,fki->fk", across, p.mesh.normals[p.mesh.faces]) > 0).all(), p.name


def test_the_mirror_is_the_hare_itself_turned():
    assert abs(in_hare(part("mirror bunny").mesh.vertices, pose(turn_deg=MIRROR_DEG))).max() < 1e-9


def test_fur_has_many_colours_and_dark_eyes():
    albedo = part("bunny").mesh.albedo
    assert albedo.min() >= 0.03
    assert albedo.max() <= 0.87
    assert albedo.mean(axis=1).std() > 0.08
    eyes = albedo.max(axis=1) < 0.05
    centres = part("bunny").mesh.vertices[eyes] / SCALE * [np.nan, 1, 1]
    assert np.allclose(np.nanmean(centres[:, 1:], axis=0), creature.EYE[1:], atol=1e-3)


def test_they_sit_on_the_floor():
    assert (part("floor").mesh.vertices[:, 2] == 0).all()
    for frame in MOMENTS:
        for name in ("bunny", "mirror bunny"):
            low = world(name, frame).vertices[:, 2].min()
            assert -0.001 < low < 0.001, (name, frame)


# They intersect


@pytest.mark.parametrize("frame", MOMENTS)
def test_the_bunnies_cut_each_other(frame):
    furry, mirror = world("bunny", frame), world("mirror bunny", frame)
    inside = in_hare(furry.vertices, pose(turn_deg=MIRROR_DEG)) < 0
    assert 0.05 < inside.mean() < 0.6
    # Faces across the border: the line is there, and long.
    across = inside[furry.faces].any(axis=1) & ~inside[furry.faces].all(axis=1)
    assert across.sum() > 60
    assert (in_hare(mirror.vertices, furry_pose(frame)) < 0).mean() > 0.03


def test_the_line_travels_and_the_bunny_ends_at_the_other_side():
    def middle(frame: int) -> np.ndarray:
        furry = world("bunny", frame)
        inside = in_hare(furry.vertices, pose(turn_deg=MIRROR_DEG)) < 0
        across = inside[furry.faces].any(axis=1) & ~inside[furry.faces].all(axis=1)
        return furry.vertices[furry.faces[across]].mean(axis=(0, 1))

    assert np.linalg.norm(middle(99) - middle(0)) > 0.06
    steps = [np.linalg.norm(middle(b) - middle(a)) for a, b in ((49, 66), (66, 82), (82, 99))]
    assert min(steps) > 0.01
    right = built().camera(built().time(99)).axes()[0]
    sides = [right @ part("bunny").pose(built().time(frame))[:3, 3] for frame in (0, 49, 99)]
    assert sides[0] == sides[1] < -0.05
    assert sides[2] > 0.05
    # On the way it passes the front.
    assert part("bunny").pose(built().time(74))[1, 3] < -0.07


# What moves


def test_first_the_eye_moves_then_the_furry_bunny():
    scene = built()
    eyes = np.array([scene.camera(scene.time(i)).eye for i in range(100)])
    assert (np.linalg.norm(np.diff(eyes[:51], axis=0), axis=1) > 0.002).all()
    assert (eyes[50:] == eyes[50]).all()
    for i in range(50):
        assert not scene.moves(scene.time(i), scene.time(i + 1))
    for i in range(50, 99):
        assert scene.moves(scene.time(i), scene.time(i + 1))
    assert [p.name for p in scene.parts if p.motion is not None] == ["bunny"]


def test_nothing_moves_if_not_asked():
    still = built(moving=False)
    assert not still.moves(0.0, still.time(99))
    assert np.allclose(still.objects[0].mesh.vertices, world("bunny", 0).vertices)


def test_the_walk_is_rigid_and_smooth():
    scene = built()
    poses = np.array([part("bunny").pose(scene.time(i)) for i in range(100)])
    linear = poses[:, :3, :3]
    assert np.allclose(linear @ linear.swapaxes(1, 2), np.eye(3), atol=1e-12)
    assert np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).max() < 0.012


# The picture


def test_both_bunnies_are_whole_and_large_in_the_picture():
    scene = built()
    for frame in MOMENTS:
        screen = scene.camera(scene.time(frame)).world_to_screen(720, 512)
        for name in ("bunny", "mirror bunny"):
            v = world(name, frame).vertices
            x = np.column_stack([v, np.ones(len(v))]) @ screen.T
            at = x[:, :2] / x[:, 2:]
            assert (at > 4).all(), (name, frame)
            assert (at < [716, 508]).all(), (name, frame)
            assert np.ptp(at[:, 1]) > 230, (name, frame)


def test_the_camera_is_free():
    scene = built()
    check_cameras(scene, range(100), "bunnies")
    for frame in (0, 25, 50, 99):
        eye = np.array(scene.camera(scene.time(frame)).eye)
        for p in scene.parts:
            moved = p.mesh.vertices @ p.pose(scene.time(frame))[:3, :3].T + p.pose(scene.time(frame))[:3, 3]
            assert np.linalg.norm(moved - eye, axis=1).min() > 0.1


def test_the_meadow_is_light_above_green_below_and_has_a_sun():
    up, down, sun = painted(np.array([[0, 0, 1.0], [0, 0, -1.0], way_to(*SUN_DEG)]))
    assert up[2] > up[1] > up[0] > 0
    assert down[1] > max(down[0], down[2])
    assert sun.min() > 8
    radiance = built().environment.radiance
    assert np.isfinite(radiance).all()
    assert radiance.min() > 0
    # No seam where the azimuth comes around: the step there is like its neighbours.
    step = abs(np.diff(radiance, axis=1, append=radiance[:, :1])).mean(axis=(0, 2))
    assert step[-1] < 3 * np.median(step)
