"""The kettle: a mirror that searches can rely on, a touch that is one, a chair that only the mirror shows."""

from __future__ import annotations

import pickle
from functools import cache

import numpy as np
import pytest
import trimesh
from PIL import Image, ImageDraw
from scipy.optimize import minimize

from benchharness.scene import Mesh, Scene, refined, subdivided
from scenes.kettle import CENTRE, FIGURE, FIGURE_DEG, GLOSSY, kettle, touch
from scenes.props import kettle_body, kettle_figure, kettle_room, kitchen_room

WIDTH, HEIGHT = 720, 512
ATTACHED = ("handle", "spout", "knob")


@cache
def built(detail="lean", moving=True) -> Scene:
    return kettle(detail, moving=moving)


def named(scene: Scene, name: str):
    return next(o for o in scene.objects if o.name == name)


def placed(scene: Scene, name: str, frame: int) -> Mesh:
    part = named(scene, name)
    return part.mesh.transformed(part.pose(scene.time(frame)))


def unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def face_normals(mesh: Mesh) -> np.ndarray:
    c = mesh.vertices[mesh.faces]
    return unit(np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]))


def depth(mesh: Mesh) -> np.ndarray:
    """Distance of a mesh's vertices to the mirror's true surface, negative inside."""
    return kettle_body.distance(mesh.vertices - CENTRE)[0]


def projected(scene: Scene, frame: int, points: np.ndarray) -> np.ndarray:
    q = np.column_stack([points, np.ones(len(points))]) @ scene.camera(scene.time(frame)).world_to_screen(WIDTH, HEIGHT).T
    assert (q[:, 2] > 0).all()
    return q[:, :2] / q[:, 2:]


def eye(scene: Scene, frame: int) -> np.ndarray:
    return np.array(scene.camera(scene.time(frame)).eye)


@cache
def world(frame: int) -> tuple[np.ndarray, np.ndarray]:
    """All triangles of the lean scene, [F, 3, 3], and the part that each belongs to."""
    scene = built()
    meshes = [part.mesh.transformed(part.pose(scene.time(frame))) for part in scene.parts]
    return (
        np.concatenate([m.vertices[m.faces] for m in meshes]),
        np.concatenate([np.full(len(m.faces), k) for k, m in enumerate(meshes)]),
    )


def first(frame: int, o: np.ndarray, d: np.ndarray) -> tuple[str, float, bool]:
    """The part that a ray meets first, after how many lengths of `d`, and whether from its front.

    After Möller and Trumbore 1997.
    """
    triangles, part = world(frame)
    a, b, c = triangles.swapaxes(0, 1)
    p = np.cross(d, c - a)
    det = ((b - a) * p).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = ((o - a) * p).sum(axis=1) / det
        q = np.cross(o - a, b - a)
        v, t = (q @ d) / det, ((c - a) * q).sum(axis=1) / det
        t = np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), t, np.inf)
    k = int(np.argmin(t))
    return (built().parts[part[k]].name if np.isfinite(t[k]) else ""), float(t[k]), bool(det[k] > 0)


# What is asked for


def test_paper_detail_is_of_the_size_that_the_paper_claims_to_serve():
    scene = built("paper")
    assert scene.vertices == pytest.approx(20_000, rel=0.01)
    assert refined(scene).vertices == pytest.approx(30_000, rel=0.01)


def test_lean_detail_stays_lean():
    assert 6_000 <= built().vertices < 10_500
    assert refined(built()).vertices == built().vertices


def test_the_scene_says_what_was_asked_for():
    scene = built("paper", False)
    assert (scene.name, scene.detail) == ("kettle", "paper")
    assert scene.source == {"detail": "paper", "moving": False, "base_vertices": scene.vertices, "h_max": scene.h_max}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"detail": "rich"}, "detail is 'rich'; accepted: lean, paper"),
        ({"detail": ["lean"]}, "detail is .*; accepted: lean, paper"),
        ({"moving": 1}, "moving is 1; accepted: true or false"),
    ],
)
def test_anything_else_is_refused_by_name(arguments, message):
    with pytest.raises(ValueError, match=message):
        kettle(**arguments)


def test_a_scene_can_be_sent_to_another_process():
    scene = built()
    copy = pickle.loads(pickle.dumps(scene))
    assert (copy.poses(1.3) == scene.poses(1.3)).all()
    assert copy.camera(1.3) == scene.camera(1.3)


# Objects


@pytest.mark.parametrize("detail", ["lean", "paper"])
def test_every_object_has_its_own_name_says_what_it_shows_and_is_wound_like_its_normals(detail):
    objects = built(detail).objects
    assert len({o.name for o in objects}) == len(objects)
    assert GLOSSY in {o.name for o in objects}
    for o in objects:
        assert len(o.shows.split()) >= 4, o.name
        agreement = (face_normals(o.mesh) * o.mesh.normals[o.mesh.faces].sum(axis=1)).sum(axis=1)
        assert agreement.min() > 0, o.name
        assert o.mesh.albedo.min() >= 0.03, o.name
        assert o.mesh.albedo.max() <= 0.87, o.name


@pytest.mark.parametrize("name", ["floor", "panels", "walls", "ceiling", "table-top", "cloth"])
def test_large_surfaces_face_the_middle_of_the_room(name):
    mesh = named(built(), name).mesh
    inward = np.array([0.0, 0.0, 1.3]) - mesh.vertices[mesh.faces].mean(axis=1)
    assert ((face_normals(mesh) * inward).sum(axis=1) > 0).all()


# The mirror


def test_the_mirror_is_closed_and_its_own_proxy():
    reflector = built().reflectors[0]
    assert reflector.closed is reflector.mesh
    solid = trimesh.Trimesh(reflector.mesh.vertices, reflector.mesh.faces, process=False)
    assert solid.is_watertight
    assert solid.is_winding_consistent
    assert solid.volume > 0


def test_every_ray_from_the_middle_of_its_bounding_box_meets_the_mirror_once():
    # Solid angles of the faces (van Oosterom and Strackee 1983): all positive, so that none is seen from behind, and
    # together one sphere, so that none lies over another.
    mesh = built().reflectors[0].mesh
    middle = 0.5 * (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))
    a, b, c = (mesh.vertices[mesh.faces] - middle).swapaxes(0, 1)
    la, lb, lc = (np.linalg.norm(e, axis=1) for e in (a, b, c))
    top = (a * np.cross(b, c)).sum(axis=1)
    angle = 2 * np.arctan2(top, la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb)
    assert angle.min() > 0
    assert angle.sum() == pytest.approx(4 * np.pi, abs=1e-9)


def test_the_mirror_is_convex():
    mesh = built().reflectors[0].mesh
    n = face_normals(mesh)[::3]
    heights = n @ mesh.vertices.T - (n * mesh.vertices[mesh.faces[::3, 0]]).sum(axis=1)[:, None]
    assert heights.max() < 1e-12


def test_the_mirrors_normals_are_across_its_surface():
    # Steps of 1e-4 along the surface, central: what is left across them is of the order of the step squared.
    mesh = built().reflectors[0].mesh
    n = mesh.normals
    assert np.allclose(kettle_body.surface(n) + CENTRE, mesh.vertices, atol=1e-15)
    for axis in np.eye(3):
        side = np.cross(n, axis)
        step = 1e-4 * side
        across = kettle_body.surface(unit(n + step)) - kettle_body.surface(unit(n - step))
        assert abs((across * n).sum(axis=1)).max() < 1e-7 * np.linalg.norm(across, axis=1).max()


def test_distance_is_how_far_along_the_normal_a_point_lies():
    rng = np.random.default_rng(3)
    n = unit(rng.normal(size=(500, 3)))
    for away in (-0.01, -1e-4, 0.0, 1e-4, 0.05, 1.0):
        found, normal = kettle_body.distance(kettle_body.surface(n) + away * n)
        assert np.allclose(found, away, atol=1e-12)
        assert np.allclose(normal, n, atol=1e-7)


def test_normals_interpolated_on_the_mirror_are_good_to_a_tenth_of_a_degree():
    mesh = built().reflectors[0].mesh
    for weights in ([1 / 3, 1 / 3, 1 / 3], [0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5]):
        n = unit((mesh.normals[mesh.faces] * np.array(weights)[:, None]).sum(axis=1))
        p = (mesh.vertices[mesh.faces] * np.array(weights)[:, None]).sum(axis=1)
        sine = np.linalg.norm(np.cross(n, kettle_body.distance(p - CENTRE)[1]), axis=1)
        assert np.degrees(np.arcsin(sine.max())) < 0.1


@pytest.mark.parametrize("detail", ["lean", "paper"])
def test_handle_spout_and_knob_touch_the_mirror_and_do_not_enter_it(detail):
    for name in ATTACHED:
        near = depth(named(built(detail), name).mesh)
        assert near.min() > -1e-9, name
        assert (near < 1e-9).sum() >= (10 if name == "handle" else 5), name
    # The bow has two feet, on opposite sides.
    handle = named(built(detail), "handle").mesh
    feet = handle.vertices[depth(handle) < 1e-9] - CENTRE
    along = feet[:, :2] @ [np.cos(np.radians(kettle_body.SPOUT_DEG)), np.sin(np.radians(kettle_body.SPOUT_DEG))]
    assert (along > 0.05).sum() >= 5
    assert (along < -0.05).sum() >= 5


def test_nothing_enters_the_mirror_at_any_time():
    scene = built()
    lo, hi = scene.reflectors[0].mesh.vertices.min(axis=0), scene.reflectors[0].mesh.vertices.max(axis=0)
    for frame in range(0, 100, 11):
        for o in scene.objects:
            if frame > 0 and o.motion is None:
                continue
            mesh = placed(scene, o.name, frame)
            corners = mesh.vertices[mesh.faces]
            near = ((corners.max(axis=1) > lo) & (corners.min(axis=1) < hi)).all(axis=1)
            if not near.any():
                continue
            # Chords between points of the surface, 2 cm apart at most, lie below it by 2 cm ** 2 / (8 * 9 cm) < 0.6 mm.
            allowed = 6e-4 if o.name in ATTACHED else 1e-9
            assert depth(subdivided(Mesh(mesh.vertices, mesh.faces[near]), 0.02)).min() > -allowed, (o.name, frame)


# The touch


def test_the_point_of_the_touch_is_a_vertex_of_the_mirror():
    point, frame = touch()
    assert np.linalg.norm(built().reflectors[0].mesh.vertices - point, axis=1).min() < 1e-12
    assert 0 < frame < built().frames - 10


@pytest.mark.parametrize("detail", ["lean", "paper"])
def test_the_red_nails_tip_lies_on_the_mirror_from_the_touch_on_and_nothing_else_of_the_hand_does(detail):
    point, since = touch()
    scene = built(detail)
    for made, frames in ((scene, range(since, scene.frames)), (built(detail, False), (0, 50, 99))):
        for frame in frames:
            hand = placed(made, "hand", frame)
            away = np.linalg.norm(hand.vertices - point, axis=1)
            tip = int(np.argmin(away))
            assert away[tip] < 1e-6
            assert tuple(hand.albedo[tip]) == kettle_figure.NAIL
            near = depth(hand)
            assert abs(near[tip]) < 1e-6
            assert np.delete(near, tip).min() > 0.001


def test_the_hand_comes_nearer_in_every_frame_and_rests_where_it_touches():
    scene, (_, since) = built(), touch()
    near = np.array([depth(placed(scene, "hand", f)).min() for f in range(scene.frames)])
    assert near[0] > 0.1
    assert (np.diff(near[:since]) <= 0).all()
    assert (near[5:since] > 0).all()
    moves = np.array([scene.moves(scene.time(f), scene.time(f + 1)) for f in range(scene.frames - 1)])
    assert not moves[since:].any()
    assert moves[10:50].all()


def test_the_gap_between_nail_and_image_closes_to_nothing_in_the_picture():
    # The image of a point V is seen at the point R of the mirror where |ER| + |RV| is least (Fermat).
    scene, (_, since) = built(), touch()

    def gap(frame: int) -> float:
        hand, e = placed(scene, "hand", frame), eye(scene, frame)
        v = hand.vertices[kettle_figure.tip(named(scene, "hand").mesh)]

        def length(angles: np.ndarray) -> float:
            chi, phi = angles
            n = np.array([[np.sin(chi) * np.cos(phi), np.sin(chi) * np.sin(phi), np.cos(chi)]])
            r = kettle_body.surface(n)[0] + CENTRE
            return float(np.linalg.norm(e - r) + np.linalg.norm(v - r))

        n = unit(unit(e - CENTRE) + unit(v - CENTRE))
        best = minimize(length, [np.arccos(n[2]), np.arctan2(n[1], n[0])], method="Nelder-Mead",
                        options={"xatol": 1e-9, "fatol": 1e-15})  # fmt: skip
        chi, phi = best.x
        n = np.array([[np.sin(chi) * np.cos(phi), np.sin(chi) * np.sin(phi), np.cos(chi)]])
        one, other = projected(scene, frame, np.stack([v, kettle_body.surface(n)[0] + CENTRE]))
        return float(np.linalg.norm(one - other))

    gaps = [gap(frame) for frame in (0, 20, 30, 40, 50, 55, since)]
    assert gaps == sorted(gaps, reverse=True)
    assert gaps[0] > 50
    # 1e-9 of an angle and the square root of the path's rounding error leave some 1e-7 m, below a hundredth of a pixel.
    assert gaps[-1] < 0.01


@pytest.mark.parametrize("frame", [60, 75, 99])
def test_the_touch_is_seen_directly_and_mirrored(frame):
    scene, (point, _) = built(), touch()
    e = eye(scene, frame)
    x, y = projected(scene, frame, point[None])[0]
    assert 0.1 * WIDTH < x < 0.9 * WIDTH
    assert 0.1 * HEIGHT < y < 0.9 * HEIGHT
    # Nothing lies before the nail's tip: 0.1 mm before it, the ray to it has met nothing.
    assert first(frame, e, point - e)[1] > 1 - 1e-4 / np.linalg.norm(point - e)
    # Points of the mirror within 8 mm of the touch: some of them are seen and mirror the red nail.
    n0 = kettle_body.distance(point[None] - CENTRE)[1][0]
    u = unit(np.cross(n0, [0, 0, 1.0]))
    images = 0
    for a in np.linspace(0, 2 * np.pi, 24, endpoint=False):
        for radius in (0.002, 0.005, 0.008):
            near = point + radius * (np.cos(a) * u + np.sin(a) * np.cross(n0, u)) - CENTRE
            away, n = kettle_body.distance(near[None])
            r = near - away[0] * n[0] + CENTRE
            d = unit(r - e)
            if first(frame, e, r - e)[1] < 1 - 1e-3:
                continue
            to, length, _ = first(frame, r + 1e-4 * n[0], d - 2 * (d @ n[0]) * n[0])
            images += to == "hand" and length < 0.03
    assert images >= 5


# The figure


def test_hand_and_arm_move_rigidly_and_steadily_and_stay_joined():
    scene = built()
    names = ("upper-arm", "forearm", "hand")
    assert {o.name for o in scene.objects if o.motion} == set(names)
    shoulder = kettle_figure.shoulder(FIGURE, FIGURE_DEG)
    last = None
    for frame in range(scene.frames):
        upper, fore, hand = poses = [named(scene, name).pose(scene.time(frame)) for name in names]
        for pose in poses:
            assert np.allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)
            assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)
        assert np.allclose(upper[:3, 3], shoulder, atol=1e-12)
        assert np.allclose(upper @ [kettle_figure.UPPER, 0, 0, 1], fore[:, 3], atol=1e-12)
        assert np.allclose(fore @ [kettle_figure.FORE, 0, 0, 1], hand[:, 3], atol=1e-12)
        if last is not None:
            # 0.2 m in 56 frames, at most 1.875 times the mean speed: 6.7 mm a frame.
            assert np.abs(np.array(poses) - last)[:, :3, 3].max() < 0.007
            assert np.abs(np.array(poses) - last)[:, :3, :3].max() < 0.05
        last = np.array(poses)


def test_without_motion_the_arm_is_where_motion_ends():
    still, moving = built(moving=False), built()
    assert not still.moves(0.0, 3.9)
    for a, b in zip(still.objects, moving.objects, strict=True):
        assert np.allclose(a.mesh.vertices, b.mesh.transformed(b.pose(3.9)).vertices, atol=1e-12), a.name


# The chair


def test_the_rear_of_the_chairs_back_faces_away_from_the_kettles_axis():
    rear = named(built(), "chair-rear").mesh
    lo, hi = built().reflectors[0].mesh.vertices[:, 2].min(), built().reflectors[0].mesh.vertices[:, 2].max()
    for z in np.linspace(lo, hi, 5):
        towards = np.array([0.0, 0.0, z]) - rear.vertices[rear.faces].mean(axis=1)
        assert (face_normals(rear) * towards).sum(axis=1).max() < -0.005


def test_the_rear_of_the_chairs_back_is_never_in_the_picture():
    rear = named(built(), "chair-rear").mesh.vertices
    for frame in range(100):
        assert projected(built(), frame, rear)[:, 0].min() > WIDTH + 5, frame


def mirrored(scene: Scene, frame: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays from the eye to the vertices of the mirror that it sees, after the mirror: start and direction, [N, 3] each."""
    e, mesh = eye(scene, frame), scene.reflectors[0].mesh
    p, n, d = mesh.vertices, mesh.normals, unit(mesh.vertices - e)
    cosine = -(d * n).sum(axis=1)[:, None]
    seen = cosine[:, 0] > 0.1
    return (p + 1e-4 * n)[seen], (d + 2 * cosine * n)[seen]


@pytest.mark.parametrize("frame", [0, 50, 99])
def test_the_mirror_shows_the_rear_of_the_chairs_back(frame):
    o, d = mirrored(built(), frame)
    # Only rays that may hit it: the others pass its plane elsewhere.
    rear = named(built(), "chair-rear").mesh
    normal, corner = face_normals(rear)[0], rear.vertices[0]
    hit = o + (((corner - o) @ normal) / (d @ normal))[:, None] * d
    inside = ((hit > rear.vertices.min(axis=0) - 1e-3) & (hit < rear.vertices.max(axis=0) + 1e-3)).all(axis=1)
    shown = [first(frame, *ray)[0] for ray in zip(o[inside], d[inside], strict=True)]
    assert shown.count("chair-rear") >= 10


def test_the_mirror_shows_the_front_of_whatever_it_shows():
    # The back of an open sheet is black. Every third vertex of the mirror that nothing hides: about 450 rays.
    scene, backs, rays = built(), [], 0
    e = eye(scene, 50)
    for o, d in zip(*(v[::3] for v in mirrored(scene, 50)), strict=True):
        if first(50, e, o - e)[1] > 1.0:
            name, _, front = first(50, o, d)
            rays += 1
            backs += [] if front else [name]
    assert rays > 300
    assert backs == []


# The camera


def test_the_kettle_covers_a_sixth_to_a_quarter_of_the_picture():
    mesh = built().reflectors[0].mesh
    shares = []
    for frame in (0, 25, 50, 75, 99):
        picture = Image.new("1", (WIDTH, HEIGHT))
        draw = ImageDraw.Draw(picture)
        for corners in projected(built(), frame, mesh.vertices)[mesh.faces]:
            draw.polygon([tuple(c) for c in corners.tolist()], fill=1)
        shares.append(float(np.asarray(picture).mean()))
    assert shares == sorted(shares)
    assert shares[0] > 0.15
    assert shares[-1] < 0.30


def test_the_eye_moves_smoothly():
    scene = built()
    assert (scene.frames, scene.fps) == (100, 25)
    way = np.array([eye(scene, frame) for frame in range(100)]) - CENTRE
    turn = np.degrees(np.arccos((unit(way[1:]) * unit(way[:-1])).sum(axis=1)))
    assert turn.max() < 0.4
    assert turn.sum() > 15
    assert np.linalg.norm(np.diff(way, n=2, axis=0), axis=1).max() < 0.0015


def test_the_camera_path_is_free():
    scene = built()
    path = np.array([eye(scene, frame) for frame in range(0, 100, 9)])
    assert (abs(path) < [kitchen_room.X - 0.2, kitchen_room.Y - 0.2, kitchen_room.Z - 0.2]).all()
    assert (path[:, 2] > kettle_room.HEIGHT + 0.1).all()
    for o in scene.objects:
        for frame in (0, 50, 99) if o.motion else (0,):
            points = subdivided(placed(scene, o.name, frame), 0.15).vertices
            assert np.linalg.norm(points[None] - path[:, None], axis=2).min() > 0.2, o.name
