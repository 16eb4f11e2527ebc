"""What is claimed of every scene in the courtyard: of its mirrors, its floor, what moves, and what is in the picture."""

from __future__ import annotations

import pickle

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from benchharness.kernels.geometry import oriented_closed_faces
from benchharness.render.inside import check_cameras
from benchharness.scene import Mesh, Scene
from scenes.props import courtyard

WIDTH, HEIGHT = 720, 512
HALF_WAY = 50
"""The frame at which something sets out."""


def face_normals(mesh: Mesh) -> np.ndarray:
    """Times twice the area, float64 [F, 3]."""
    c = mesh.vertices[mesh.faces]
    return np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0])


def volumes(mesh: Mesh) -> list[float]:
    """Of each piece that hangs together, vertices at the same place counting as one: negative where it is inside out."""
    weld = np.unique(mesh.vertices.round(9), axis=0, return_inverse=True)[1].reshape(-1)
    corners = weld[mesh.faces]
    edges = (np.ones(2 * len(corners)), np.concatenate([corners[:, :2], corners[:, 1:]]).T)
    count, piece = connected_components(coo_array(edges, shape=(weld.max() + 1, weld.max() + 1)), directed=False)
    a, b, c = mesh.vertices[mesh.faces].swapaxes(0, 1)
    return np.bincount(piece[corners[:, 0]], (a * np.cross(b, c)).sum(axis=1) / 6, count).tolist()


def moved(part, scene: Scene, frame: int) -> np.ndarray:
    pose = part.pose(scene.time(frame))
    return part.mesh.vertices @ pose[:3, :3].T + pose[:3, 3]


def mirrors_are_closed_and_their_normals_unit_and_outward(scene: Scene, pieces: int = 1) -> None:
    for r in scene.reflectors:
        assert oriented_closed_faces(r.mesh.vertices, r.mesh.faces).all(), r.name
        assert r.closed is r.mesh
        assert len(volumes(r.mesh)) == pieces
        assert min(volumes(r.mesh)) > 0
        assert np.allclose(np.linalg.norm(r.mesh.normals, axis=1), 1, atol=1e-12)
        n = face_normals(r.mesh)
        area = np.linalg.norm(n, axis=1)
        assert area.min() > 1e-7, r.name  # no sliver: 2e-7 m² is a triangle with sides of half a millimetre
        cosine = np.einsum("fi,fki->fk", n / area[:, None], r.mesh.normals[r.mesh.faces])
        assert cosine.min() > 0.8, r.name


def mirrors_touch_the_floor_or_stay_above_it(scene: Scene, flies: str = "") -> None:
    for r in scene.reflectors:
        for frame in range(scene.frames):
            lowest = moved(r, scene, frame)[:, 2].min()
            assert lowest > -0.001, (r.name, frame)
            assert lowest < 0.001 or r.name == flies, (r.name, frame)


def only_this_moves_and_only_in_the_second_half(scene: Scene, name: str, still: Scene) -> None:
    assert [part.name for part in scene.parts if part.motion is not None] == [name]
    assert all(part.motion is None for part in still.parts)
    assert not scene.moves(0.0, scene.time(HALF_WAY))
    assert all(scene.moves(scene.time(f), scene.time(f + 1)) for f in range(HALF_WAY + 1, scene.frames - 1))
    part = next(part for part in scene.parts if part.name == name)
    for frame in range(scene.frames):
        turn = part.pose(scene.time(frame))[:3, :3]
        assert np.allclose(turn @ turn.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(turn) > 0


def camera_goes_around_then_rests_and_all_mirrors_are_in_the_picture(scene: Scene) -> None:
    check_cameras(scene, range(scene.frames), "test")
    eyes = np.array([scene.camera(scene.time(f)).eye for f in range(scene.frames)])
    step = np.linalg.norm(np.diff(eyes, axis=0), axis=1)
    assert step.max() < 0.04
    assert step[:HALF_WAY].sum() > 4 * step[HALF_WAY:].sum() > 0
    assert np.linalg.norm(np.diff(eyes, n=2, axis=0), axis=1).max() < 0.004
    for frame in range(0, scene.frames, 3):
        matrix = scene.camera(scene.time(frame)).world_to_screen(WIDTH, HEIGHT)
        for r in scene.reflectors:
            q = np.column_stack([moved(r, scene, frame), np.ones(len(r.mesh.vertices))]) @ matrix.T
            assert q[:, 2].min() > 0.5  # nothing nearer than half a metre
            x, y = (q[:, :2] / q[:, 2:]).T
            assert (x.min() > 4) & (x.max() < WIDTH - 4) & (y.min() > 4) & (y.max() < HEIGHT - 4), (r.name, frame)


def more_mirrors_leave_the_others_where_they_are(fewer: Scene, more: Scene) -> None:
    assert len(fewer.reflectors) < len(more.reflectors)
    for one, other in zip(fewer.reflectors, more.reflectors, strict=False):
        assert (one.name, one.eta, one.k) == (other.name, other.eta, other.k)
        assert (one.mesh.vertices == other.mesh.vertices).all()
        assert (one.pose(3.0) == other.pose(3.0)).all()


def stands_in_the_courtyard(scene: Scene) -> None:
    assert [o.name for o in scene.objects] == ["floor"]
    assert scene.environment is courtyard.environment()
    assert scene.environment.ground == "floor"
    names = [part.name for part in scene.parts]
    assert len(set(names)) == len(names)
    for r in scene.reflectors:
        assert (r.eta, r.k) == courtyard.METALS[r.name.split("-")[-1]]


def can_be_sent_to_another_process(scene: Scene) -> None:
    copy = pickle.loads(pickle.dumps(scene))
    assert (copy.poses(3.3) == scene.poses(3.3)).all()
    assert copy.camera(1.3) == scene.camera(1.3)
    assert (copy.environment.radiance == scene.environment.radiance).all()
