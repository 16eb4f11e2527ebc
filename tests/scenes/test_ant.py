"""The ants: as many vertices as the paper's, eyes that searches can rely on, heads and eyes that move as one."""

from __future__ import annotations

import pickle
from functools import cache

import numpy as np
import pytest
import trimesh
from PIL import Image, ImageDraw

from benchharness.modelling.winding import winding_number
from benchharness.render.inside import check_cameras
from benchharness.scene import Mesh, Scene, refined
from scenes.ant import EYES, NODS, PLACES, ant
from scenes.props import insects, picnic

MOMENTS = (0.0, 0.5, 1.3, 2.7, 3.96)
"""Seconds; the heads nod with a period of 2, so that 0.5 is an extreme."""


@cache
def built(detail="lean", eyes=EYES, moving=True) -> Scene:
    return ant(detail, eyes, moving=moving)


@cache
def drawn(detail="lean", eyes=EYES) -> Scene:
    return refined(built(detail, eyes))


def face_normals(mesh: Mesh) -> np.ndarray:
    c = mesh.vertices[mesh.faces]
    n = np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0])
    return n / np.linalg.norm(n, axis=1, keepdims=True)


def ellipsoid(mesh: Mesh) -> np.ndarray:
    """The quadric x^T A x = 1 about the middle of the mesh that fits its vertices best, A float64 [3, 3]."""
    p = mesh.vertices - middle(mesh)
    i, j = np.triu_indices(3)
    terms = p[:, i] * p[:, j] * np.where(i == j, 1, 2)
    a = np.linalg.lstsq(terms, np.ones(len(p)), rcond=None)[0]
    quadric = np.zeros((3, 3))
    quadric[i, j] = quadric[j, i] = a
    return quadric


def middle(mesh: Mesh) -> np.ndarray:
    """Of the bounding box."""
    return 0.5 * (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))


# What is asked for


def test_paper_detail_has_the_papers_vertex_counts():
    # Estalella et al. 2006: 14,859 vertices, 30,153 after splitting large triangles.
    scene = built("paper")
    assert scene.vertices == pytest.approx(14859, rel=0.01)
    assert drawn("paper").vertices == pytest.approx(30153, rel=0.01)


def test_lean_detail_stays_lean():
    assert 6000 <= drawn("lean").vertices <= 13000


@pytest.mark.parametrize("detail", ["lean", "paper"])
def test_an_eye_that_is_no_mirror_is_the_same_mesh_among_the_objects(detail):
    whole, some = drawn(detail), drawn(detail, 3)
    assert [len(scene.reflectors) for scene in (whole, some)] == [8, 3]
    assert some.vertices == whole.vertices
    assert built(detail, 3).vertices == built(detail).vertices
    twins = {part.name: part for part in whole.parts}
    for part in some.parts:
        twin = twins.pop(part.name)
        assert (part.mesh.vertices == twin.mesh.vertices).all()
        assert (part.mesh.faces == twin.mesh.faces).all()
        assert (part.pose(1.3) == twin.pose(1.3)).all()
    assert not twins


def test_the_scene_says_what_was_asked_for():
    scene = built("paper", 3, False)
    assert (scene.name, scene.detail, scene.frames, scene.fps) == ("ant", "paper", 100, 25)
    assert scene.source == {
        "detail": "paper", "eyes": 3, "moving": False, "base_vertices": scene.vertices, "h_max": scene.h_max,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"detail": "rich"}, "detail is 'rich'; accepted: lean, paper"),
        ({"eyes": 0}, "eyes is 0; accepted: whole numbers from 1 to 8"),
        ({"eyes": 9}, "eyes is 9; accepted"),
        ({"eyes": True}, "eyes is True; accepted"),
        ({"eyes": 2.0}, "eyes is 2.0; accepted"),
        ({"moving": "yes"}, "moving is 'yes'; accepted: true or false"),
    ],
)
def test_anything_else_is_refused_by_name(arguments, message):
    with pytest.raises(ValueError, match=message):
        ant(**arguments)


def test_a_scene_can_be_sent_to_another_process():
    scene = built()
    copy = pickle.loads(pickle.dumps(scene))
    assert (copy.poses(1.3) == scene.poses(1.3)).all()
    assert copy.camera(1.3) == scene.camera(1.3)


# Objects


@pytest.mark.parametrize("detail", ["lean", "paper"])
def test_every_object_has_its_own_name_says_what_it_shows_and_is_wound_like_its_normals(detail):
    scene = built(detail, 3)
    assert len({part.name for part in scene.parts}) == len(scene.parts)
    for o in scene.objects:
        assert len(o.shows.split()) >= 4, o.name
        agreement = (face_normals(o.mesh) * o.mesh.normals[o.mesh.faces].sum(axis=1)).sum(axis=1)
        assert agreement.min() > 0, o.name
        assert o.mesh.albedo.min() >= 0.03, o.name
        assert o.mesh.albedo.max() <= 0.87, o.name


def test_the_labels_of_cans_are_strips_as_high_as_they_are_wound_outward():
    n = 12
    red, blue, gold = (0.6, 0.1, 0.1), (0.1, 0.1, 0.6), (0.5, 0.5, 0.1)
    mesh = picnic.wrap(0.1, 0.02, 0.22, picnic.sectors(n, [(0.5, red), (0.25, blue), (0.25, gold)]))
    assert len(mesh.faces) == 2 * n
    assert len(mesh.vertices) == 2 * (n + 3)  # both ends, doubled where the colour changes
    assert np.allclose(np.ptp(mesh.vertices[mesh.faces][:, :, 2], axis=1), 0.2)
    assert (face_normals(mesh) * mesh.normals[mesh.faces].mean(axis=1)).sum(axis=1).min() > 0.9
    for colour, share in ((red, 0.5), (blue, 0.25), (gold, 0.25)):
        assert (mesh.albedo[mesh.faces] == colour).all(axis=(1, 2)).sum() == share * 2 * n


@pytest.mark.parametrize("name", ["can-cola", "can-soup", "can-rolling", "can-tuna"])
def test_cans_are_closed(name):
    mesh = next(o.mesh for o in built("paper").objects if o.name == name)
    at = 0.5 * (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))
    assert winding_number(mesh, at) == pytest.approx(1, abs=1e-6)


def test_nothing_but_cans_reaches_below_the_cloth_and_feet_stand_on_it():
    scene = built()
    for time in MOMENTS:
        for part in scene.parts:
            if part.name not in ("cloth", "meadow", "hills"):
                low = part.mesh.transformed(part.pose(time)).vertices[:, 2].min()
                assert low > (-0.0025 if part.name.startswith("can-") else 0.0), part.name
    for place in PLACES:
        body = next(o.mesh for o in scene.objects if o.name == f"{place.name}-body")
        assert body.vertices[:, 2].min() == pytest.approx(place.height, abs=0.006)


# Eyes


@pytest.mark.parametrize("detail", ["lean", "paper"])
def test_eyes_are_closed_ellipsoids_with_exact_normals(detail):
    for eye in built(detail).reflectors:
        mesh = eye.mesh
        solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        assert solid.is_watertight
        assert solid.is_winding_consistent
        assert solid.volume > 0
        quadric, p = ellipsoid(mesh), mesh.vertices - middle(mesh)
        assert np.allclose(np.einsum("vi,ij,vj->v", p, quadric, p), 1, atol=1e-9)
        axes = np.sort(1 / np.sqrt(np.linalg.eigvalsh(quadric)))
        assert np.allclose(axes, np.sort(insects.EYE), rtol=1e-9)
        gradient = p @ quadric
        gradient /= np.linalg.norm(gradient, axis=1, keepdims=True)
        assert np.allclose(mesh.normals, gradient, atol=1e-9)


@pytest.mark.parametrize("detail", ["lean", "paper"])
def test_interpolated_normals_are_the_ellipsoids_within_a_tenth_of_a_degree(detail):
    for eye in built(detail).reflectors:
        mesh, quadric = eye.mesh, ellipsoid(eye.mesh)
        corners_p, corners_n = mesh.vertices[mesh.faces] - middle(mesh), mesh.normals[mesh.faces]
        for weights in ([1 / 3, 1 / 3, 1 / 3], [0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5]):
            n = np.einsum("k,fkc->fc", weights, corners_n)
            # The gradient does not depend on how far out the point is.
            gradient = np.einsum("k,fkc->fc", weights, corners_p) @ quadric
            sine = np.linalg.norm(np.cross(n, gradient), axis=1)
            sine /= np.linalg.norm(n, axis=1) * np.linalg.norm(gradient, axis=1)
            assert np.degrees(sine.max()) < 0.1


def test_eyes_are_star_shaped_about_the_middle_of_their_bounding_box_at_all_times():
    # A closed surface is star-shaped about a point that lies behind all of its faces.
    for eye in built().reflectors:
        for time in MOMENTS:
            mesh = eye.mesh.transformed(eye.pose(time))
            depth = ((mesh.vertices[mesh.faces[:, 0]] - middle(mesh)) * face_normals(mesh)).sum(axis=1)
            assert depth.min() > 0.8 * min(insects.EYE)


@pytest.mark.parametrize("detail", ["lean", "paper"])
def test_nothing_but_its_own_head_enters_an_eye_and_that_with_few_vertices(detail):
    scene = drawn(detail)
    for time in MOMENTS[:3]:
        world = [part.mesh.vertices @ part.pose(time)[:3, :3].T + part.pose(time)[:3, 3] for part in scene.parts]
        for eye in scene.reflectors:
            moved = eye.mesh.transformed(eye.pose(time))
            centre, quadric = middle(moved), ellipsoid(moved)
            for part, points in zip(scene.parts, world, strict=True):
                p = points[np.linalg.norm(points - centre, axis=1) < max(insects.EYE) + 1e-9] - centre
                inside = (np.einsum("vi,ij,vj->v", p, quadric, p) < 1 - 1e-9).sum()
                if part.name == eye.name.split("-")[0] + "-head":
                    assert 0 < inside <= 0.12 * len(points), (part.name, time, inside)
                else:
                    assert inside == 0, (part.name, eye.name, time)


@pytest.mark.parametrize("detail", ["lean", "paper"])
def test_the_head_has_no_rim_that_shows_outside_the_eyes(detail):
    scene = built(detail)
    eyes = {eye.name: (middle(eye.mesh), ellipsoid(eye.mesh)) for eye in scene.reflectors}
    for place in PLACES:
        mesh = next(o.mesh for o in scene.objects if o.name == f"{place.name}-head")
        edges = np.sort(np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
        unique, uses = np.unique(edges, axis=0, return_counts=True)
        rim = mesh.vertices[np.unique(unique[uses == 1])]
        assert len(rim) > 0
        within = np.zeros(len(rim), bool)
        for side in ("left", "right"):
            centre, quadric = eyes[f"{place.name}-eye-{side}"]
            within |= np.einsum("vi,ij,vj->v", rim - centre, quadric, rim - centre) < 0.95
        assert within.all()


# The camera


def outlines(scene: Scene, frame: int) -> list[np.ndarray]:
    """Pixels of 360 x 256 within the outline of each eye, seen alone, bool [256, 360]."""
    width, height, time = 360, 256, scene.time(frame)
    screen = scene.camera(time).world_to_screen(width, height)
    out = []
    for eye in scene.reflectors:
        mesh = eye.mesh.transformed(eye.pose(time))
        x = np.column_stack([mesh.vertices, np.ones(len(mesh.vertices))]) @ screen.T
        assert (x[:, 2] > scene.near_plane).all()
        picture = Image.new("1", (width, height))
        draw = ImageDraw.Draw(picture)
        for corners in (x[:, :2] / x[:, 2:])[mesh.faces]:
            draw.polygon([tuple(c) for c in corners.tolist()], fill=1)
        out.append(np.asarray(picture))
    return out


def test_all_eyes_are_whole_in_the_picture_and_large_at_the_end():
    scene = built()
    for frame in (0, 40, 70, 99):
        eyes = outlines(scene, frame)
        border = [(e[[0, -1]].any() or e[:, [0, -1]].any()) for e in eyes]
        assert sum(border) == 0, frame
        assert np.any(eyes, axis=0).mean() > (0.06 if frame == 0 else 0.08)
    # Radius of a disc of as many pixels, at 720 x 512.
    radii = np.sort([2 * np.sqrt(e.sum() / np.pi) for e in outlines(scene, 99)])
    assert radii[0] > 25


def test_the_camera_path_is_smooth_and_free():
    scene = built()
    check_cameras(scene, range(scene.frames), "ant")
    path = np.array([scene.camera(scene.time(i)).eye for i in range(scene.frames)])
    assert np.linalg.norm(np.diff(path, n=2, axis=0), axis=1).max() < 0.0015
    assert np.hypot(*path[:, :2].T).max() < picnic.HORIZON - 0.3
    for part in drawn().parts:
        for i in (0, 25, 50, 75, 99):
            moved = part.mesh.transformed(part.pose(scene.time(i)))
            assert np.linalg.norm(moved.vertices - path[i], axis=1).min() > 0.12, part.name


# Motion


def test_two_heads_an_ants_antennae_and_a_can_move_and_only_if_asked():
    assert not built(moving=False).moves(0.0, 0.5)
    scene = built()
    heads = {f"{name}-{part}" for name in NODS for part in ("head", "antennae", "eye-left", "eye-right")}
    assert {part.name for part in scene.parts if part.motion} == heads | {"amber-antennae", "can-rolling"}
    assert {part.name for part in scene.parts if (part.pose(0.5) != np.eye(4)).any()} == heads | {
        "amber-antennae",
        "can-rolling",
    }
    for part in scene.parts:
        assert np.allclose(part.pose(0.0), np.eye(4), atol=1e-12), part.name


def test_eyes_move_with_their_heads():
    scene = built()
    for name in NODS:
        head = next(o for o in scene.objects if o.name == f"{name}-head")
        for eye in (r for r in scene.reflectors if r.name.startswith(name)):
            for time in MOMENTS:
                assert (eye.pose(time) == head.pose(time)).all()
            way = eye.pose(0.5)[:3, :3] @ middle(eye.mesh) + eye.pose(0.5)[:3, 3] - middle(eye.mesh)
            assert np.linalg.norm(way) > 0.005


def test_motions_are_rigid_and_continuous():
    scene = built()
    times = np.arange(0, 4.0, 0.04)
    for part in scene.parts:
        if part.motion is None:
            continue
        poses = np.array([part.pose(t) for t in times])
        linear = poses[:, :3, :3]
        assert np.allclose(linear @ linear.swapaxes(1, 2), np.eye(3), atol=1e-12)
        assert np.allclose(np.linalg.det(linear), 1)
        p = part.mesh.vertices[::10]
        where = np.einsum("tij,vj->tvi", linear, p) + poses[:, None, :3, 3]
        assert np.linalg.norm(np.diff(where, axis=0), axis=2).max() < 0.012, part.name


def test_the_can_rolls_without_slipping():
    can = next(o for o in built().objects if o.name == "can-rolling")
    # The material point that touches the cloth is at rest: central difference over 2 ms, error of the order dt^2.
    now, dt = can.pose(1.5), 1e-3
    centre = now @ [*can.motion.start, 1]
    touch = np.linalg.inv(now) @ [*centre[:2], 0, 1]
    velocity = (can.pose(1.5 + dt) @ touch - can.pose(1.5 - dt) @ touch) / (2 * dt)
    along = (can.pose(1.5 + dt) @ [*can.motion.start, 1] - centre)[:3] / dt
    assert np.linalg.norm(along) > 0.03
    assert np.linalg.norm(velocity) < 1e-4 * np.linalg.norm(along)
    # Its axis is level and at right angles to its way: it stays as high as it is.
    for time in MOMENTS:
        heights = can.mesh.transformed(can.pose(time)).vertices[:, 2]
        assert np.ptp(heights) == pytest.approx(0.17, rel=0.04)  # a prism: its side is nearer than its edge
