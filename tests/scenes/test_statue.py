"""The statue and the two teapots: closed, standing on the table, apart from one another however the statue is pushed."""

from __future__ import annotations

import pickle
from functools import cache

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from benchharness.modelling.winding import is_closed, winding_number
from benchharness.render.inside import check_cameras
from benchharness.scene import Environment, Mesh, Scene
from scenes.panoramas.parlour import CEILING, DAY, FLOOR, LEFT, painter
from scenes.props import angel
from scenes.props.implicit import field, gradient, polygonised
from scenes.props.shapes import pose
from scenes.statue import DETAILS, POTS, RADIUS, SCALE, SUNK, TABLE, statue

MOMENTS = (0, 30, 49, 56, 62, 68, 74, 80, 86, 92, 99)
"""Frames; the statue moves from the fourth on."""
MIRRORS = ("silver teapot", "gold teapot")


@cache
def built(detail="lean", moving=True) -> Scene:
    return statue(detail, moving=moving)


@cache
def figure() -> Mesh:
    """Without its plinth, in its own size."""
    return polygonised(angel.blobs(), DETAILS["lean"].cell / SCALE)


def part(name: str):
    return next(p for p in built().parts if p.name == name)


def world(name: str, frame: int) -> Mesh:
    return part(name).mesh.transformed(part(name).pose(built().time(frame)))


# What is asked for


@pytest.mark.exhaustive
def test_there_are_enough_vertices_and_not_too_many():
    assert 5000 <= len(figure().vertices) <= 8000
    for name in MIRRORS:
        assert 3000 <= len(part(name).mesh.vertices) <= 6000
    assert built().vertices < 18000


def test_the_scene_says_what_was_asked_for():
    scene = built(moving=False)
    assert (scene.name, scene.detail, scene.frames, scene.fps) == ("statue", "lean", 100, 25)
    assert scene.source == {"detail": "lean", "moving": False, "base_vertices": scene.vertices}
    assert [o.name for o in scene.objects] == ["statue", "table", "table edge"]
    assert tuple(r.name for r in scene.reflectors) == MIRRORS
    assert len({r.eta for r in scene.reflectors}) == 2
    assert scene.environment is not None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"detail": "rich"}, "statue: detail is 'rich'; accepted: lean, paper"),
        ({"moving": "yes"}, "statue: moving is 'yes'; accepted: true or false"),
        ({"moving": 0}, "statue: moving is 0; accepted: true or false"),
    ],
)
def test_anything_else_is_refused_by_name(arguments, message):
    with pytest.raises(ValueError, match=message):
        statue(**arguments)


def test_a_scene_can_be_sent_to_another_process():
    copy = pickle.loads(pickle.dumps(built()))
    assert (copy.poses(3.1) == built().poses(3.1)).all()
    assert copy.camera(1.3) == built().camera(1.3)


# Their surfaces


def test_the_figure_is_closed_wound_outward_and_without_slivers():
    solid = trimesh.Trimesh(figure().vertices, figure().faces, process=False)
    assert solid.is_watertight
    assert solid.is_winding_consistent
    assert solid.volume > 0
    assert solid.body_count == 1
    angles = np.degrees(solid.face_angles)
    assert angles.min() > 6
    assert (angles.min(axis=1) < 20).mean() < 0.002


def test_vertices_are_on_the_surface_and_so_are_faces_to_a_part_of_a_cell():
    cell, blobs = DETAILS["lean"].cell / SCALE, angel.blobs()
    assert abs(field(blobs, figure().vertices)).max() < 1e-9 * cell
    f, g = gradient(blobs, figure().vertices[figure().faces].mean(axis=1))
    away = abs(f) / np.linalg.norm(g, axis=1)
    # Folds and feathers meet in creases that are narrower than a cell; elsewhere a face is h² κ / 6 away.
    assert np.percentile(away, 99) < 0.3 * cell
    assert np.percentile(away, 90) < 0.1 * cell


def test_normals_are_unit_and_outward():
    g = gradient(angel.blobs(), figure().vertices)[1]
    assert np.allclose(figure().normals, g / np.linalg.norm(g, axis=1, keepdims=True), atol=1e-12)
    for p in built().parts:
        assert np.allclose(np.linalg.norm(p.mesh.normals, axis=1), 1, atol=1e-12)
        corners = p.mesh.vertices[p.mesh.faces]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        agree = np.einsum("fi,fi->f", across, p.mesh.normals[p.mesh.faces].sum(axis=1)) > 0
        # In the creases between folds a vertex may look across the face.
        assert agree.mean() > (0.998 if p.name == "statue" else 0.9999), p.name


def test_all_but_the_table_top_is_closed_if_both_its_parts_are_taken():
    for name in ("statue", *MIRRORS):
        assert is_closed(part(name).mesh), name
    top, edge = part("table").mesh, part("table edge").mesh
    for p in ((0.1, 0.1, -0.01), (-0.3, 0.0, -0.02)):
        assert winding_number(top, np.array(p)) + winding_number(edge, np.array(p)) == pytest.approx(1, abs=1e-6)


def test_the_statue_is_of_many_tones_and_of_its_size():
    mesh = part("statue").mesh
    assert mesh.albedo.min() >= 0.03
    assert mesh.albedo.max() <= 0.87
    assert len(np.unique(mesh.albedo.round(3), axis=0)) > 100
    assert np.hypot(*mesh.vertices[:, :2].T).max() < angel.REACH * SCALE
    assert np.ptp(mesh.vertices[:, 2]) == pytest.approx(0.36 * SCALE, rel=0.02)


# Where they are


def test_statue_and_pots_stand_on_the_table():
    x0, x1, y0, y1 = TABLE
    assert (part("table").mesh.vertices[:, 2] == 0).all()
    for frame in MOMENTS:
        for name in ("statue", *MIRRORS):
            v = world(name, frame).vertices
            assert v[:, 2].min() == pytest.approx(-SUNK, abs=1e-9), (name, frame)
            foot = v[v[:, 2] < 0.005]
            assert (foot[:, :2] > [x0 + 0.02, y0 + 0.02]).all(), (name, frame)
            assert (foot[:, :2] < [x1 - 0.02, y1 - 0.02]).all(), (name, frame)


@pytest.mark.parametrize("frame", MOMENTS)
def test_the_statue_and_the_pots_never_meet(frame):
    moved = world("statue", frame)
    inverse = np.linalg.inv(part("statue").pose(built().time(frame)) @ pose(scale=SCALE))
    for name in MIRRORS:
        pot = world(name, frame)
        # No point of a pot is in the figure or near, nor one of the statue near a pot's: edges of both are shorter than this,
        # but for those around the pots' bottoms.
        local = pot.vertices @ inverse[:3, :3].T + inverse[:3, 3]
        assert field(angel.blobs(), local).min() * SCALE > 0.01
        assert cKDTree(pot.vertices).query(moved.vertices)[0].min() > 0.018


def test_the_pots_stand_apart_and_see_each_other():
    one, other = (part(name).mesh for name in MIRRORS)
    assert cKDTree(one.vertices).query(other.vertices)[0].min() > 0.08
    (x0, y0, _), (x1, y1, _) = POTS.values()
    assert np.hypot(x1 - x0, y1 - y0) < 5 * RADIUS


# What moves


def test_first_the_eye_moves_then_the_statue():
    scene = built()
    eyes = np.array([scene.camera(scene.time(i)).eye for i in range(100)])
    assert (np.linalg.norm(np.diff(eyes[:51], axis=0), axis=1) > 0.002).all()
    assert (eyes[50:] == eyes[50]).all()
    for i in range(50):
        assert not scene.moves(scene.time(i), scene.time(i + 1))
    for i in range(50, 99):
        assert scene.moves(scene.time(i), scene.time(i + 1))
    assert [p.name for p in scene.parts if p.motion is not None] == ["statue"]


def test_the_statue_is_pushed_from_behind_the_pots_to_before_them_and_turned():
    scene = built()
    start, end = (part("statue").pose(scene.time(frame)) for frame in (0, 99))
    forward = scene.camera(scene.time(99)).axes()[2]
    pots = [forward @ [x, y, 0] for x, y, _ in POTS.values()]
    assert forward @ start[:3, 3] > max(pots) + 0.05
    assert forward @ end[:3, 3] < min(pots) - 0.05
    turned = np.degrees(np.arccos(0.5 * (np.trace(end[:3, :3] @ start[:3, :3].T) - 1)))
    assert turned == pytest.approx(60)
    poses = np.array([part("statue").pose(scene.time(i)) for i in range(100)])
    assert np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).max() < 0.012
    assert np.allclose(poses[:, :3, :3] @ poses[:, :3, :3].swapaxes(1, 2), np.eye(3), atol=1e-12)


def test_nothing_moves_if_not_asked():
    still = built(moving=False)
    assert not still.moves(0.0, still.time(99))
    assert np.allclose(still.objects[0].mesh.vertices, world("statue", 0).vertices)


# The picture


def test_statue_and_pots_are_whole_in_the_picture():
    scene = built()
    for frame in MOMENTS:
        screen = scene.camera(scene.time(frame)).world_to_screen(720, 512)
        for name in ("statue", *MIRRORS):
            v = world(name, frame).vertices
            x = np.column_stack([v, np.ones(len(v))]) @ screen.T
            at = x[:, :2] / x[:, 2:]
            assert (at > 4).all(), (name, frame)
            assert (at < [716, 508]).all(), (name, frame)


def test_the_camera_is_free():
    check_cameras(built(), range(100), "statue")


def test_the_room_has_light_windows_a_floor_and_a_ceiling():
    directions = np.array([[LEFT, 0.1 + 0.2, 0.5], [0.01, 0.01, CEILING], [0.1, 0.1, FLOOR], [0.0, 3.0, 0.3]])
    window, lamp, rug, books = painter(512)(directions / np.linalg.norm(directions, axis=1, keepdims=True))
    assert window.min() > 0.8 * DAY.min()
    assert lamp.min() > 3
    assert rug[0] > 2 * rug[2]
    assert books.max() < 1
    radiance = built().environment.radiance
    assert np.isfinite(radiance).all()
    assert radiance.min() > 0
    # A panorama of few rows shows the same room, softened: all in all it is as bright.
    means = [np.sin(np.pi * np.arange(n) / (n - 1)) @ Environment.painted(painter(n), n).radiance.mean(axis=1) / n
             for n in (64, 256)]  # fmt: skip
    assert np.allclose(*means, rtol=0.02)
