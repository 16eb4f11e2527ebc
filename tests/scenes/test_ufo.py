"""The city square: as many vertices as the paper's, a hull that searches can rely on, a landing that is free."""

from __future__ import annotations

import pickle
from functools import cache

import numpy as np
import pytest
import trimesh
from PIL import Image, ImageDraw
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from support.tiers import first

from benchharness.modelling.winding import is_closed, winding_number
from benchharness.scene import Mesh, Scene, refined, subdivided
from scenes.props import city, saucer
from scenes.ufo import ufo

TIMES = np.linspace(0.0, 3.96, 10)


@cache
def built(detail="lean", moving=True) -> Scene:
    return ufo(detail, moving=moving)


def depth_inside(points: np.ndarray) -> np.ndarray:
    """How far points [N, 3] of the hull's space are inside it, along the ray from its middle; negative outside."""
    # The profile's elevations are about the lens's centre.
    q = np.add(points, [0, 0, saucer._middle()])
    on, _ = saucer.profile(np.arctan2(q[:, 2], np.hypot(q[:, 0], q[:, 1])))
    return np.hypot(on[:, 0], on[:, 1] + saucer._middle()) - np.linalg.norm(q, axis=1)


DETAILS = first(["lean", "paper"], ["lean"])  # what lean leaves out, paper has


@cache
def dense(index: int, detail: str) -> np.ndarray:
    """Points no more than a metre apart along the edges of an object, in its own space."""
    return subdivided(built(detail).objects[index].mesh, 1.0).vertices


def local(pose: np.ndarray, points: np.ndarray) -> np.ndarray:
    return (points - pose[:3, 3]) @ pose[:3, :3]


# What is asked for


@pytest.mark.exhaustive
def test_paper_detail_has_the_papers_vertex_counts():
    # Estalella et al. 2006: 63,884 vertices, 81,977 after splitting large triangles.
    scene = built("paper")
    assert scene.vertices == pytest.approx(63884, rel=0.01)
    assert refined(scene).vertices == pytest.approx(81977, rel=0.01)


def test_lean_detail_stays_lean():
    scene = built()
    assert scene.vertices < 15_500
    assert refined(scene).vertices == scene.vertices


@pytest.mark.parametrize("moving", [False, True])
def test_the_scene_says_what_was_asked_for(moving):
    scene = built("lean", moving)
    assert (scene.name, scene.detail) == ("ufo", "lean")
    assert scene.source == {"detail": "lean", "moving": moving, "base_vertices": scene.vertices, "h_max": scene.h_max}
    assert scene.moves(0.0, 3.0) == moving
    copy = pickle.loads(pickle.dumps(scene))
    assert (copy.poses(1.3) == scene.poses(1.3)).all()
    assert copy.camera(1.3) == scene.camera(1.3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"detail": "rich"}, "detail is 'rich'; accepted: lean, paper"),
        ({"detail": ["lean"]}, "detail is .*; accepted: lean, paper"),
        ({"moving": "yes"}, "moving is 'yes'; accepted: true or false"),
    ],
)
def test_anything_else_is_refused_by_name(arguments, message):
    with pytest.raises(ValueError, match=message):
        ufo(**arguments)


# Objects


@pytest.mark.parametrize("detail", ["lean", "paper"])
def test_every_object_has_its_own_name_says_what_it_shows_and_is_wound_like_its_normals(detail):
    objects = built(detail).objects
    assert len({o.name for o in objects}) == len(objects)
    for o in objects:
        assert len(o.shows.split()) >= 4, o.name
        c = o.mesh.vertices[o.mesh.faces]
        turned = np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0])
        assert np.linalg.norm(turned, axis=1).min() > 1e-9, o.name
        assert (turned * o.mesh.normals[o.mesh.faces].sum(axis=1)).sum(axis=1).min() > 0, o.name
        assert o.mesh.albedo.min() >= 0.03, o.name
        assert o.mesh.albedo.max() <= 0.87, o.name


def test_the_sun_is_the_only_lamp_and_looks_at_the_square():
    lights = [o for o in built().objects if o.mesh.emission.any()]
    assert [o.name for o in lights] == ["sun"]
    mesh = lights[0].mesh
    assert np.ptp(mesh.emission, axis=0).max() == 0
    at = mesh.vertices.mean(axis=0)
    assert mesh.normals[0] @ (-at / np.linalg.norm(at)) > 0.999
    assert np.min(built().background) > 0


def test_fronts_face_the_square_or_a_street():
    # A ray from a front's middle along its normal leaves the house: the opposite one would be 10 m of wall.
    for row in (city.NORTH, city.WEST, city.EAST, city.SOUTH):
        for h in row:
            a = np.radians(h.turn_deg)
            along, out = np.array([np.cos(a), np.sin(a)]), np.array([np.sin(a), -np.cos(a)])
            before = np.asarray(h.at) + 0.5 * h.width * along + 3.0 * out
            x0, x1, y0, y1 = city.SQUARE
            on_square = x0 < before[0] < x1 and y0 < before[1] < y1
            on_street = any(s[0] - 4 < before[0] < s[1] + 4 and s[2] - 4 < before[1] < s[3] + 4 for s in city.STREETS)
            assert on_square or on_street, h


def rims(mesh: Mesh) -> list[np.ndarray]:
    """Points [N, 3] on the open edges of every connected piece that has some; vertices at one place count as one."""
    points, weld = np.unique(mesh.vertices.round(6), axis=0, return_inverse=True)
    faces = weld.reshape(-1)[mesh.faces]
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges, uses = np.unique(edges, axis=0, return_counts=True)
    graph = coo_array((np.ones(len(edges)), edges.T), shape=(len(points),) * 2)
    _, piece = connected_components(graph, directed=False)
    open_edges = edges[uses == 1]
    return [points[open_edges[piece[open_edges[:, 0]] == k].ravel()] for k in np.unique(piece[open_edges[:, 0]])]


@pytest.mark.parametrize(
    "name",
    ["truck-red", "truck-tanker", "truck-flatbed", "cars", "trees", "lamps", "people", "garlands", "legs", "saucer-lamps"],
)
def test_what_can_be_seen_from_all_sides_is_closed_but_for_the_face_that_it_stands_on(name):
    mesh = next(o.mesh for o in built("paper").objects if o.name == name)
    for rim in rims(mesh):
        assert min(np.linalg.svd(rim - rim.mean(axis=0), compute_uv=False)) < 1e-4, rim.mean(axis=0)


# The hull


def test_the_hull_is_watertight_and_its_origin_is_the_middle_of_its_box():
    for detail in ("lean", "paper"):
        reflector = built(detail).reflectors[0]
        mesh = reflector.mesh
        solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        assert solid.is_watertight
        assert solid.is_winding_consistent
        assert solid.volume > 0
        assert reflector.closed is mesh
        assert is_closed(mesh)
        assert np.allclose(mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0), 0, atol=1e-12)


@pytest.mark.parametrize("detail", ["lean", "paper"])
def test_every_ray_from_the_middle_meets_the_hull_once(detail):
    # A closed surface of which every face looks away from a point is met once by every ray from there.
    mesh = built(detail).reflectors[0].mesh
    c = mesh.vertices[mesh.faces]
    n = np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0])
    cosine = (n * c.mean(axis=1)).sum(axis=1) / np.linalg.norm(n, axis=1) / np.linalg.norm(c.mean(axis=1), axis=1)
    assert cosine.min() > 0.6
    assert winding_number(mesh, np.zeros(3)) == pytest.approx(1.0, abs=1e-9)


def test_normals_are_the_profiles_own():
    # Against the tangent by central differences of step e = 1e-5: error e² κ'' ~ 1e-9.
    phi = np.linspace(-1.5, 1.5, 301)
    ahead, behind = saucer.profile(phi + 1e-5)[0], saucer.profile(phi - 1e-5)[0]
    tangent = (ahead - behind) / np.linalg.norm(ahead - behind, axis=1, keepdims=True)
    _, n = saucer.profile(phi)
    assert abs((tangent * n).sum(axis=1)).max() < 1e-8
    assert np.allclose(np.linalg.norm(n, axis=1), 1, atol=1e-12)
    # And every vertex has the normal of its elevation.
    mesh = built().reflectors[0].mesh
    q = np.add(mesh.vertices, [0, 0, saucer._middle()])
    at, n = saucer.profile(np.arctan2(q[:, 2], np.hypot(q[:, 0], q[:, 1])))
    flat = lambda v: np.stack([np.hypot(v[:, 0], v[:, 1]), v[:, 2]], axis=1)  # noqa: E731
    assert np.allclose(flat(mesh.vertices), at, atol=1e-12)
    assert np.allclose(flat(mesh.normals), n, atol=1e-12)
    (x, y, _), (u, v, _) = mesh.vertices.T, mesh.normals.T
    assert abs(x * v - y * u).max() < 1e-12
    assert (x * u + y * v).min() > -1e-12


@pytest.mark.parametrize(("detail", "bound_deg"), [("lean", 0.12), ("paper", 0.07)])
def test_interpolated_normals_are_good_to_a_tenth_of_a_degree(detail, bound_deg):
    mesh = built(detail).reflectors[0].mesh
    for weights in ([1 / 3, 1 / 3, 1 / 3], [0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5]):
        w = np.array(weights)[:, None]
        n, p = (mesh.normals[mesh.faces] * w).sum(axis=1), (mesh.vertices[mesh.faces] * w).sum(axis=1)
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        q = np.add(p, [0, 0, saucer._middle()])
        _, m = saucer.profile(np.arctan2(q[:, 2], np.hypot(q[:, 0], q[:, 1])))
        a = np.arctan2(p[:, 1], p[:, 0])
        true = np.stack([m[:, 0] * np.cos(a), m[:, 0] * np.sin(a), m[:, 1]], axis=1)
        assert np.degrees(np.linalg.norm(np.cross(n, true), axis=1).max()) < bound_deg


def test_the_lower_side_and_the_rim_are_convex_and_only_the_domes_foot_is_hollow():
    phi = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 4001)
    p, n = saucer.profile(phi)
    bend = np.diff(np.unwrap(np.arctan2(n[:, 1], n[:, 0]))) / np.linalg.norm(np.diff(p, axis=0), axis=1)
    hollow = 0.5 * (p[1:] + p[:-1])[bend < 0]
    assert bend[phi[1:] < np.radians(20)].min() > 0.05
    assert len(hollow) > 0
    # A ring between 1 and 3 m from the axis, above the rim; a radius of curvature of more than 4 m.
    assert hollow[:, 0].min() > 1.0
    assert hollow[:, 0].max() < 3.0
    assert bend.min() > -0.25


# The landing


@pytest.mark.parametrize("detail", DETAILS)
@pytest.mark.parametrize("moving", [False, True])
def test_nothing_but_the_legs_enters_the_saucer(detail, moving):
    scene = built(detail, moving)
    flight = scene.reflectors[0]
    if moving:
        points_of = {o.name: dense(i, detail) for i, o in enumerate(scene.objects)}
    else:
        points_of = {o.name: o.mesh.vertices for o in scene.objects}
    for time in TIMES if moving else TIMES[:1]:
        pose = flight.pose(time)
        for o in scene.objects:
            if o.name in ("legs", "sun"):
                continue
            own = o.pose(time)
            points = local(pose, points_of[o.name] @ own[:3, :3].T + own[:3, 3])
            gap = -depth_inside(points).max()
            assert gap > (0.0 if o.name == "saucer-lamps" else 0.5), (o.name, time)
    legs = next(o for o in scene.objects if o.name == "legs").mesh.vertices
    assert depth_inside(legs).max() > 0.2


def test_the_saucer_comes_down_turns_tilts_and_stands_on_its_legs_in_the_end():
    scene = built()
    saucer_at = np.stack([scene.reflectors[0].pose(scene.time(i)) for i in range(scene.frames)])
    z = saucer_at[:, 2, 3]
    assert z[0] > 8
    assert (np.diff(z) <= 1e-12).all()
    tilt = np.degrees(np.arccos(np.clip(saucer_at[:, 2, 2], -1, 1)))
    assert 5 < tilt.max() < 10
    assert tilt[-1] < 1e-3
    legs = next(o for o in scene.objects if o.name == "legs")
    feet = legs.mesh.transformed(legs.pose(scene.time(99))).vertices[:, 2].min()
    assert feet == pytest.approx(0.0, abs=1e-9)
    for name in ("legs", "saucer-lamps"):
        part = next(o for o in scene.objects if o.name == name)
        assert (part.pose(1.7) == scene.reflectors[0].pose(1.7)).all()
    # What stands still stands where it lands.
    assert np.allclose(built("lean", False).reflectors[0].pose(0.0), saucer_at[-1], atol=1e-12)


def test_motions_are_rigid_and_continuous():
    assert {part.name for part in built().parts if part.motion} == {"saucer", "legs", "saucer-lamps"}
    scene = built("paper")
    moving = [part for part in scene.parts if part.motion]
    assert {part.name for part in moving} == {
        "saucer", "legs", "saucer-lamps", "truck-red", "truck-tanker", "truck-flatbed",
    }  # fmt: skip
    for part in moving:
        poses = np.stack([part.pose(t) for t in np.arange(0.0, 3.97, 0.02)])
        linear = poses[:, :3, :3]
        assert np.allclose(linear @ linear.transpose(0, 2, 1), np.eye(3), atol=1e-12), part.name
        assert np.allclose(np.linalg.det(linear), 1), part.name
        # No corner 5 m from the middle goes faster than 15 m/s.
        points = linear @ [3.0, 4.0, 0.0] + poses[:, :3, 3]
        assert np.linalg.norm(np.diff(points, axis=0), axis=1).max() < 15 * 0.02, part.name
    for name in ("truck-red", "truck-tanker", "truck-flatbed"):
        truck = next(p for p in moving if p.name == name)
        # Trucks head where they go: forward is object x.
        way = truck.pose(3.91)[:3, 3] - truck.pose(3.90)[:3, 3]
        assert way @ truck.pose(3.905)[:3, 0] > 0.999 * np.linalg.norm(way), name
        assert truck.pose(2.0)[2, 3] == -city.KERB


# The camera


def covered(scene: Scene, frame: int) -> float:
    """Share of the picture inside the outline of the saucer."""
    time = scene.time(frame)
    mesh = scene.reflectors[0].mesh.transformed(scene.reflectors[0].pose(time))
    x = np.column_stack([mesh.vertices, np.ones(len(mesh.vertices))]) @ scene.camera(time).world_to_screen(180, 128).T
    assert (x[:, 2] > scene.near_plane).all()
    picture = Image.new("1", (180, 128))
    draw = ImageDraw.Draw(picture)
    for corners in (x[:, :2] / x[:, 2:])[mesh.faces]:
        draw.polygon([tuple(c) for c in corners.tolist()], fill=1)
    return float(np.asarray(picture).mean())


def test_the_saucer_is_small_at_first_and_a_third_of_the_picture_in_the_end():
    scene = built()
    shares = np.array([covered(scene, frame) for frame in range(0, 100, 9)])
    assert 0.04 < shares[0] < 0.08
    assert (shares < 0.36).all()
    assert ((shares > 0.2) & (shares < 0.36)).mean() > 0.55


@pytest.mark.parametrize("detail", DETAILS)
def test_the_eye_moves_smoothly_and_touches_nothing(detail):
    scene = built(detail)
    assert (scene.frames, scene.fps) == (100, 25)
    eyes = np.array([scene.camera(scene.time(i)).eye for i in range(scene.frames)])
    # At most 8 m/s, and no more than 12 m/s² (0.02 m change of step per frame).
    assert np.linalg.norm(np.diff(eyes, axis=0), axis=1).max() < 8 / 25
    assert np.linalg.norm(np.diff(eyes, n=2, axis=0), axis=1).max() < 0.02
    for index, o in enumerate(scene.objects):
        points = dense(index, detail)
        for i in range(0, scene.frames, 9):
            pose = o.pose(scene.time(i))
            assert np.linalg.norm(local(pose, eyes[i : i + 1]) - points, axis=1).min() > 0.7, (o.name, i)
    for i in range(0, scene.frames, 9):
        assert depth_inside(local(scene.reflectors[0].pose(scene.time(i)), eyes[i : i + 1])).max() < -3
