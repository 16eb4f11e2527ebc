"""The kitchen: as many vertices as the paper's, bowls that searches can rely on, a camera path that is free."""

from __future__ import annotations

import pickle
from functools import cache

import numpy as np
import pytest
import trimesh
from PIL import Image, ImageDraw

from benchharness.scene import Mesh, Scene, refined, subdivided
from scenes.kitchen import BOWL, HEIGHT, kitchen
from scenes.props import bowls, kitchen_room

BOWLS = ("convex", "concave", "torus")


@cache
def built(detail="lean", bowl="convex", moving=False) -> Scene:
    return kitchen(detail, bowl, moving=moving)


def face_normals(mesh: Mesh) -> np.ndarray:
    c = mesh.vertices[mesh.faces]
    n = np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0])
    return n / np.linalg.norm(n, axis=1, keepdims=True)


def crossed(start: np.ndarray, end: np.ndarray, mesh: Mesh) -> np.ndarray:
    """Whether each segment [S, 3] crosses the mesh (Möller and Trumbore 1997), bool [S]."""
    a, b, c = mesh.vertices[mesh.faces].swapaxes(0, 1)
    out = []
    for o, d in zip(start, end - start, strict=True):
        p = np.cross(d, c - a)
        det = ((b - a) * p).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = ((o - a) * p).sum(axis=1) / det
            q = np.cross(o - a, b - a)
            v, t = (q @ d) / det, ((c - a) * q).sum(axis=1) / det
            out.append(((u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0) & (t <= 1)).any())
    return np.array(out)


def winding(points: np.ndarray, mesh: Mesh) -> np.ndarray:
    """How often the closed mesh winds around each point: 1 inside, 0 outside (van Oosterom and Strackee 1983)."""
    out = []
    for p in points:
        a, b, c = (mesh.vertices[mesh.faces] - p).swapaxes(0, 1)
        la, lb, lc = (np.linalg.norm(e, axis=1) for e in (a, b, c))
        top = (a * np.cross(b, c)).sum(axis=1)
        bottom = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
        out.append(np.arctan2(top, bottom).sum() / (2 * np.pi))
    return np.array(out)


def eyes(scene: Scene) -> np.ndarray:
    return np.array([scene.camera(scene.time(i)).eye for i in range(scene.frames)])


# What is asked for


@pytest.mark.parametrize("bowl", BOWLS)
def test_paper_detail_has_the_papers_vertex_counts(bowl):
    # Estalella et al. 2006: 11,379 vertices, 14,979 after splitting large triangles.
    scene = built("paper", bowl)
    assert scene.vertices == pytest.approx(11379, rel=0.01)
    assert refined(scene).vertices == pytest.approx(14979, rel=0.01)


@pytest.mark.parametrize("bowl", BOWLS)
def test_lean_detail_stays_lean(bowl):
    assert 4000 <= built("lean", bowl).vertices <= 5000


def test_the_scene_says_what_was_asked_for():
    scene = built("paper", "torus", True)
    assert (scene.name, scene.detail) == ("kitchen", "paper")
    assert scene.source == {
        "detail": "paper", "bowl": "torus", "moving": True, "base_vertices": scene.vertices, "h_max": scene.h_max,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"detail": "rich"}, "detail is 'rich'; accepted: lean, paper"),
        ({"bowl": "flat"}, "bowl is 'flat'; accepted: convex, concave, torus"),
        ({"bowl": ["convex"]}, "bowl is .*; accepted: convex"),
        ({"moving": "yes"}, "moving is 'yes'; accepted: true or false"),
    ],
)
def test_anything_else_is_refused_by_name(arguments, message):
    with pytest.raises(ValueError, match=message):
        kitchen(**arguments)


def test_a_scene_can_be_sent_to_another_process():
    scene = built(moving=True)
    copy = pickle.loads(pickle.dumps(scene))
    assert (copy.poses(1.3) == scene.poses(1.3)).all()
    assert copy.camera(1.3) == scene.camera(1.3)


# Objects


@pytest.mark.parametrize("detail", ["lean", "paper"])
def test_every_object_has_its_own_name_says_what_it_shows_and_is_wound_like_its_normals(detail):
    objects = built(detail).objects
    assert len({o.name for o in objects}) == len(objects)
    for o in objects:
        assert len(o.shows.split()) >= 4, o.name
        # A face may stand at an angle to a shared normal, never opposite to the three of them.
        agreement = (face_normals(o.mesh) * o.mesh.normals[o.mesh.faces].sum(axis=1)).sum(axis=1)
        assert agreement.min() > 0, o.name
        assert o.mesh.albedo.min() >= 0.03, o.name
        assert o.mesh.albedo.max() <= 0.87, o.name


def test_each_light_emits_one_radiance_so_that_it_can_be_sampled():
    lights = [o for o in built().objects if o.mesh.emission.any()]
    assert {o.name for o in lights} == {"window-garden", "window-haze", "window-sky", "lamp"}
    for o in lights:
        assert np.ptp(o.mesh.emission, axis=0).max() == 0


@pytest.mark.parametrize("name", ["floor", "walls", "ceiling", "splashback", "window-sky", "table-top"])
def test_large_surfaces_face_the_middle_of_the_room(name):
    mesh = next(o.mesh for o in built().objects if o.name == name)
    inward = np.array([0.0, 0.0, 1.3]) - mesh.vertices[mesh.faces].mean(axis=1)
    assert ((face_normals(mesh) * inward).sum(axis=1) > 0).all()


@pytest.mark.parametrize("detail", ["lean", "paper"])
def test_the_table_top_is_whole_and_sampled_finely_where_the_bowl_stands_but_not_underneath(detail):
    mesh = next(o.mesh for o in built(detail).objects if o.name == "table-top")
    corners = mesh.vertices[mesh.faces]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    assert area == pytest.approx(1.70 * 1.04, rel=1e-9)
    away = np.sort(np.linalg.norm(mesh.vertices[:, :2] - BOWL[:2], axis=1))
    assert away[0] > bowls.RADIUS
    rim = (away < bowls.RADIUS + 0.01).sum()
    assert 2 * np.pi * bowls.RADIUS / rim < 0.08


@pytest.mark.parametrize("bowl", BOWLS)
def test_nothing_enters_the_bowl_while_things_move(bowl):
    scene = built("lean", bowl, True)
    closed = scene.reflectors[0].closed
    assert closed is not None
    lo, hi = closed.vertices.min(axis=0), closed.vertices.max(axis=0)
    for time in (0.0, 2.0, 4.0):
        for o in scene.objects:
            mesh = o.mesh.transformed(o.pose(time))
            apart = (mesh.vertices.max(axis=0) < lo).any() or (mesh.vertices.min(axis=0) > hi).any()
            if apart or (time > 0 and o.motion is None):
                continue
            points = subdivided(mesh, 0.06).vertices
            # The proxy goes through the table top; what is seen of it does not.
            near = points[((points >= lo) & (points <= hi)).all(axis=1) & (points[:, 2] > HEIGHT + 1e-6)]
            assert not (winding(near, closed) > 0.5).any(), (o.name, time)


# The bowls


@pytest.mark.parametrize("bowl", BOWLS)
def test_the_open_bowl_is_a_part_of_its_watertight_proxy_bit_for_bit(bowl):
    reflector = built(bowl=bowl).reflectors[0]
    mesh, closed = reflector.mesh, reflector.closed
    assert closed is not None
    solid = trimesh.Trimesh(closed.vertices, closed.faces, process=False)
    assert solid.is_watertight
    assert solid.is_winding_consistent
    assert solid.volume > 0

    def corners(m: Mesh) -> set[bytes]:
        return {face.tobytes() for face in np.concatenate([m.vertices[m.faces], m.normals[m.faces]], axis=2)}

    assert corners(mesh) < corners(closed)


def test_the_convex_proxy_is_convex_and_its_normals_are_the_ellipsoids():
    closed = built(bowl="convex").reflectors[0].closed
    assert closed is not None
    axes = [bowls.RADIUS, bowls.RADIUS, bowls.CONVEX_HEIGHT]
    q = (closed.vertices - BOWL) / axes
    assert np.allclose(np.linalg.norm(q, axis=1), 1, atol=1e-12)
    gradient = q / axes
    assert np.allclose(closed.normals, gradient / np.linalg.norm(gradient, axis=1, keepdims=True), atol=1e-12)
    # Every vertex lies behind every face (every fifth, for speed).
    centres = closed.vertices[closed.faces[::5, 0]]
    n = face_normals(closed)[::5]
    assert (n @ closed.vertices.T - (n * centres).sum(axis=1)[:, None]).max() < 1e-12


def test_the_concave_bowls_normals_point_to_its_centre():
    mesh = built(bowl="concave").reflectors[0].mesh
    centre = np.add(BOWL, [0, 0, bowls.RADIUS + bowls.CONCAVE_WALL + 0.001])
    assert np.allclose(mesh.vertices + bowls.RADIUS * mesh.normals, centre, atol=1e-12)
    assert (face_normals(mesh) * mesh.normals[mesh.faces[:, 0]]).sum(axis=1).min() > 0.99


def test_the_torus_bowl_is_the_outer_band_of_a_torus():
    mesh = built(bowl="torus").reflectors[0].mesh
    middle = mesh.vertices - bowls.TORUS_TUBE * mesh.normals - BOWL
    ring = bowls.RADIUS - bowls.TORUS_TUBE
    assert np.allclose(np.linalg.norm(middle[:, :2], axis=1), ring, atol=1e-12)
    assert np.ptp(middle[:, 2]) < 1e-12
    # Outside the top circle all curvature is of one sign: no normal points to the axis.
    assert (mesh.normals[:, :2] * (mesh.vertices - BOWL)[:, :2]).sum(axis=1).min() > -1e-9
    assert mesh.vertices[:, 2].min() == pytest.approx(HEIGHT)


def test_normals_interpolated_on_the_ellipsoid_are_good_to_three_hundredths_of_a_degree():
    mesh = built(bowl="convex").reflectors[0].mesh
    axes = np.array([bowls.RADIUS, bowls.RADIUS, bowls.CONVEX_HEIGHT])
    for weights in ([1 / 3, 1 / 3, 1 / 3], [0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5]):
        n = (mesh.normals[mesh.faces] * np.array(weights)[:, None]).sum(axis=1)
        p = (mesh.vertices[mesh.faces] * np.array(weights)[:, None]).sum(axis=1) - BOWL
        gradient = p / axes**2
        sine = np.linalg.norm(np.cross(n, gradient), axis=1) / np.linalg.norm(n, axis=1) / np.linalg.norm(gradient, axis=1)
        assert np.degrees(sine.max()) < 0.03


# The camera


def covered(scene: Scene, frame: int) -> float:
    """Share of the picture inside the outline of the bowl."""
    mesh = scene.reflectors[0].mesh
    width, height = 360, 256
    screen = scene.camera(scene.time(frame)).world_to_screen(width, height)
    x = np.column_stack([mesh.vertices, np.ones(len(mesh.vertices))]) @ screen.T
    assert (x[:, 2] > scene.near_plane).all()
    picture = Image.new("1", (width, height))
    draw = ImageDraw.Draw(picture)
    for corners in (x[:, :2] / x[:, 2:])[mesh.faces]:
        draw.polygon([tuple(c) for c in corners.tolist()], fill=1)
    return float(np.asarray(picture).mean())


@pytest.mark.parametrize("bowl", BOWLS)
def test_the_bowl_grows_from_a_twentieth_to_half_of_the_picture(bowl):
    scene = built(bowl=bowl)
    shares = [covered(scene, frame) for frame in (0, 33, 66, 99)]
    assert shares == sorted(shares)
    assert 0.035 < shares[0] < 0.065
    assert 0.45 < shares[-1] < 0.55


@pytest.mark.parametrize("bowl", BOWLS)
def test_the_eye_moves_smoothly_and_turns_slowly_about_the_bowl(bowl):
    scene = built(bowl=bowl)
    assert (scene.frames, scene.fps) == (100, 25)
    way = eyes(scene) - np.array([*BOWL[:2], HEIGHT + 0.1])
    direction = way / np.linalg.norm(way, axis=1, keepdims=True)
    turn = np.degrees(np.arccos((direction[1:] * direction[:-1]).sum(axis=1)))
    assert turn.max() < 0.4
    assert turn.sum() > 15
    # Acceleration: the step changes by less than 1.5 mm from frame to frame.
    assert np.linalg.norm(np.diff(way, n=2, axis=0), axis=1).max() < 0.0015


@pytest.mark.parametrize("bowl", BOWLS)
def test_the_camera_path_and_the_view_of_the_bowl_are_free(bowl):
    scene = built(bowl=bowl, moving=True)
    path = eyes(scene)
    assert (abs(path) < [kitchen_room.X - 0.2, kitchen_room.Y - 0.2, kitchen_room.Z - 0.2]).all()
    top = scene.reflectors[0].mesh.vertices
    top = top[np.argmax(top[:, 2])] + [0, 0, 0.001]
    for o in scene.objects:
        for time in (0.0, 4.0) if o.motion else (0.0,):
            mesh = o.mesh.transformed(o.pose(time))
            gap = np.linalg.norm(subdivided(mesh, 0.15).vertices[None] - path[::9, None], axis=2).min()
            assert gap > 0.2, o.name
            assert not crossed(path[:-9:9], path[9::9], mesh).any(), o.name
            if o.name != "lid":
                assert not crossed(path[::9], np.broadcast_to(top, path[::9].shape), mesh).any(), o.name


def test_the_outside_of_the_concave_bowl_is_never_seen():
    # The outside of a hemisphere is hidden from an eye within the cylinder over its opening.
    scene = built(bowl="concave")
    centre = np.add(BOWL, [0, 0, bowls.RADIUS + bowls.CONCAVE_WALL + 0.001])
    mesh = scene.reflectors[0].mesh
    axis = mesh.normals.mean(axis=0)
    axis /= np.linalg.norm(axis)
    rel = eyes(scene) - centre
    assert (rel @ axis > 0).all()
    assert np.linalg.norm(rel - (rel @ axis)[:, None] * axis, axis=1).max() < bowls.RADIUS


# Motion


@pytest.mark.parametrize(("detail", "movable"), [("lean", {"orange"}), ("paper", {"orange", "mug-white"})])
def test_only_an_orange_and_a_mug_move_and_only_if_asked(detail, movable):
    assert not built(detail).moves(0.0, 4.0)
    scene = built(detail, moving=True)
    assert {o.name for o in scene.objects if o.motion} == movable
    for still, moving in zip(built(detail).objects, scene.objects, strict=True):
        assert np.allclose(still.mesh.vertices, moving.mesh.transformed(moving.pose(0.0)).vertices, atol=1e-12), still.name


def test_motions_are_rigid_and_the_orange_rolls_without_slipping():
    scene = built(moving=True)
    for o in scene.objects:
        linear = o.pose(1.7)[:3, :3]
        assert np.allclose(linear @ linear.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(linear) == pytest.approx(1)
    orange = next(o for o in scene.objects if o.name == "orange")
    # The material point that touches the table is at rest: central difference over 2 ms, error of the order dt^2.
    now, dt = orange.pose(1.5), 1e-3
    touch = np.linalg.inv(now) @ [*(now[:2, 3]), HEIGHT, 1]
    velocity = (orange.pose(1.5 + dt) @ touch - orange.pose(1.5 - dt) @ touch) / (2 * dt)
    speed = np.linalg.norm(orange.pose(1.5 + dt)[:3, 3] - orange.pose(1.5 - dt)[:3, 3]) / (2 * dt)
    assert speed > 0.05
    assert np.linalg.norm(velocity) < 1e-4 * speed
