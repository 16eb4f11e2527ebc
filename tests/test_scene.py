"""Meshes, subdivision, cameras: numbers worked by hand, and laws that hold for any mesh."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from benchharness.scene import (
    Camera,
    Gloss,
    Mesh,
    Object,
    PointLight,
    Reflector,
    Scene,
    merged,
    refined,
    subdivided,
    vertex_normals,
)

TRIANGLE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def from_trimesh(mesh: trimesh.Trimesh) -> Mesh:
    return Mesh(mesh.vertices, mesh.faces)


def edges(faces: np.ndarray) -> np.ndarray:
    """Undirected edges [3 F, 2] of all faces."""
    return np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)


def area(mesh: Mesh) -> float:
    c = mesh.vertices[mesh.faces]
    return 0.5 * float(np.linalg.norm(np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]), axis=1).sum())


def irregular(seed: int) -> Mesh:
    """A closed convex mesh with edges of very different lengths: faces with 0, 1, 2 and 3 split edges occur."""
    points = np.random.default_rng(seed).normal(size=(40, 3)) * [3.0, 1.0, 0.3]
    return from_trimesh(trimesh.convex.convex_hull(points))


# Mesh


def test_one_colour_is_spread_over_all_vertices():
    mesh = Mesh(TRIANGLE, [[0, 1, 2]], albedo=(0.1, 0.2, 0.3))
    assert mesh.albedo.shape == (3, 3)
    assert (mesh.albedo == [0.1, 0.2, 0.3]).all()
    assert (mesh.emission == 0).all()


def test_a_triangle_in_the_ground_plane_faces_up():
    assert Mesh(TRIANGLE, [[0, 1, 2]]).normals.tolist() == [[0, 0, 1]] * 3


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"vertices": TRIANGLE[:, :2]}, r"shape \(3, 2\); accepted: \[V, 3\]"),
        ({"faces": np.zeros((0, 3))}, "at least one face"),
        ({"faces": [[0, 1, 2, 2]]}, r"shape \(1, 4\)"),
        ({"faces": [[0, 1, 3]]}, "names vertex 3; accepted: 0 to 2"),
        ({"faces": [[0, 1, -1]]}, "names vertex -1; accepted: 0 to 2"),
        ({"vertices": np.where(TRIANGLE == 1, np.nan, TRIANGLE)}, "vertex 1 is .* accepted: finite"),
        ({"albedo": (0.1, 0.2)}, r"albedo has shape \(2,\); accepted: \[3\] or \[3, 3\]"),
        ({"radiance": (0.1, np.inf, 0.2)}, "radiance is not finite"),
    ],
)
def test_a_bad_mesh_is_refused_with_what_is_wrong(arguments, message):
    with pytest.raises(ValueError, match=message):
        Mesh(**{"vertices": TRIANGLE, "faces": [[0, 1, 2]], **arguments})


def test_vertex_normals_are_weighted_by_area():
    # Two triangles share the edge (0,0,0)-(0,1,0): one of area 1/2 faces +z, one of area 3/2 faces +x. The sum of the
    # doubled areas at the shared vertices is (3, 0, 1), of length sqrt(10).
    vertices = np.array([[0, 0, 0], [0, 1, 0], [-1, 0, 0], [0, 0, -3.0]])
    normals = vertex_normals(vertices, np.array([[0, 1, 2], [0, 3, 1]]))
    shared = np.array([3, 0, 1]) / np.sqrt(10)
    assert np.allclose(normals, [shared, shared, [0, 0, 1], [1, 0, 0]], atol=1e-15)


def test_a_vertex_without_area_gets_the_upward_normal():
    vertices = np.concatenate([TRIANGLE, [[5.0, 5.0, 5.0]]])
    assert vertex_normals(vertices, np.array([[0, 2, 1]])).tolist() == [[0, 0, -1]] * 3 + [[0, 0, 1]]


def test_moving_a_mesh_turns_its_normals_and_scaling_keeps_them_unit():
    pose = np.array([[0, 0, 2.0, 5], [2, 0, 0, 6], [0, 2, 0, 7], [0, 0, 0, 1]])  # x -> y -> z -> x, twice as large
    moved = Mesh(TRIANGLE, [[0, 1, 2]]).transformed(pose)
    assert moved.vertices.tolist() == [[5, 6, 7], [5, 8, 7], [5, 6, 9]]
    assert moved.normals.tolist() == [[1, 0, 0]] * 3


def test_merging_keeps_order_and_shifts_faces():
    one = Mesh(TRIANGLE, [[0, 1, 2]], albedo=(0.1,) * 3, radiance=(1.0,) * 3)
    two = Mesh(TRIANGLE + 1, [[2, 1, 0]], albedo=(0.2,) * 3, radiance=(2.0,) * 3)
    both = merged(one, two)
    assert both.faces.tolist() == [[0, 1, 2], [5, 4, 3]]
    assert (both.vertices == np.concatenate([TRIANGLE, TRIANGLE + 1])).all()
    assert both.albedo[:, 0].tolist() == [0.1] * 3 + [0.2] * 3
    assert both.normals[:, 2].tolist() == [1] * 3 + [-1] * 3
    assert both.radiance is not None
    assert both.radiance[:, 0].tolist() == [1] * 3 + [2] * 3


def test_merging_drops_radiance_unless_all_have_it():
    bare = Mesh(TRIANGLE, [[0, 1, 2]])
    assert merged(bare, replace(bare, radiance=(1.0,) * 3)).radiance is None


# subdivided


def test_a_unit_right_triangle_splits_as_drawn_by_hand():
    # Edges 1, sqrt(2), 1 at h_max 1.2: only the hypotenuse is split, at (1/2, 1/2).
    mesh = subdivided(Mesh(TRIANGLE, [[0, 1, 2]]), 1.2)
    assert mesh.vertices.tolist() == [*TRIANGLE.tolist(), [0.5, 0.5, 0]]
    assert sorted(sorted(face) for face in mesh.faces.tolist()) == [[0, 1, 3], [0, 2, 3]]


def test_three_split_edges_make_four_faces():
    # At h_max 0.9 all three are split once: the halves measure 1/2, sqrt(2)/2, 1/2.
    mesh = subdivided(Mesh(TRIANGLE, [[0, 1, 2]]), 0.9)
    assert len(mesh.vertices) == 6
    assert len(mesh.faces) == 4


@pytest.mark.parametrize("h_max", [1.5, 0.7, 0.3])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_subdividing_leaves_no_long_edge_and_keeps_shape_and_watertightness(seed, h_max):
    before = irregular(seed)
    after = subdivided(before, h_max)
    length = np.linalg.norm(np.diff(after.vertices[edges(after.faces)], axis=1)[:, 0], axis=1)
    assert length.max() <= h_max
    # Sums of at most 1e5 areas near 1, each good to 1e-16 relative.
    assert area(after) == pytest.approx(area(before), rel=1e-10)
    # Conforming and watertight: every edge belongs to exactly two faces, once in each direction.
    directed = after.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    assert len(np.unique(directed, axis=0)) == len(directed)
    assert {tuple(e) for e in directed.tolist()} == {(b, a) for a, b in directed.tolist()}
    solid = trimesh.Trimesh(after.vertices, after.faces, process=False)
    assert solid.is_watertight
    assert solid.volume == pytest.approx(trimesh.Trimesh(before.vertices, before.faces).volume, rel=1e-10)


def test_no_vertex_lies_within_an_edge():
    mesh = subdivided(irregular(3), 1.0)
    ends = mesh.vertices[np.unique(edges(mesh.faces), axis=0)]
    way = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(way, axis=1)
    rel = mesh.vertices[None] - ends[:, :1]
    along = (rel * way[:, None]).sum(axis=2) / length[:, None] ** 2
    off = np.linalg.norm(rel - along[..., None] * way[:, None], axis=2)
    # Rounding leaves a vertex on an edge within 1e-14 of it; vertices of the mesh are at least millimetres apart.
    assert not ((off < 1e-9) & (along > 1e-6) & (along < 1 - 1e-6)).any()


def test_meshes_that_share_an_edge_split_it_at_the_same_points():
    one = Mesh([[0, 0, 0], [3, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    two = Mesh([[3, 0, 0], [0, 0, 0], [1, -7, 2]], [[0, 1, 2]])

    def on_edge(mesh: Mesh) -> list:
        v = mesh.vertices
        return sorted(v[(v[:, 1] == 0) & (v[:, 2] == 0), 0].tolist())

    # 3 m at 0.5 m: halved to 1.5, 0.75, 0.375.
    assert on_edge(subdivided(one, 0.5)) == on_edge(subdivided(two, 0.5)) == [0.375 * k for k in range(9)]


def test_linear_attributes_are_reproduced_exactly_and_normals_stay_unit():
    base = irregular(4)
    ramp = lambda v: np.stack([v[:, 0], 2 * v[:, 1] - 1, v.sum(axis=1)], axis=1)  # noqa: E731
    mesh = replace(base, albedo=ramp(base.vertices), emission=-ramp(base.vertices), radiance=3 * ramp(base.vertices))
    after = subdivided(mesh, 0.4)
    assert after.radiance is not None
    assert len(after.vertices) > 2 * len(base.vertices)
    for value, factor in ((after.albedo, 1), (after.emission, -1), (after.radiance, 3)):
        assert np.allclose(value, factor * ramp(after.vertices), atol=1e-12)
    assert np.allclose(np.linalg.norm(after.normals, axis=1), 1, atol=1e-12)


def test_the_normal_at_a_midpoint_is_the_mean_direction():
    normals = np.array([[0, 0, 1.0], [1.0, 0, 0], [0, 0, 1.0]])
    mesh = subdivided(Mesh(TRIANGLE, [[0, 1, 2]], normals), 1.2)
    assert np.allclose(mesh.normals[3], np.array([1, 0, 1]) / np.sqrt(2), atol=1e-15)


def test_what_is_short_enough_is_left_as_it_is():
    mesh = irregular(5)
    after = subdivided(mesh, 100.0)
    assert (after.vertices == mesh.vertices).all()
    assert (after.faces == mesh.faces).all()
    assert after.radiance is None


@pytest.mark.parametrize("h_max", [0.0, -1.0, float("nan")])
def test_a_length_that_is_not_positive_is_refused(h_max):
    with pytest.raises(ValueError, match="accepted: a positive length"):
        subdivided(irregular(0), h_max)


# Camera


def test_a_camera_that_looks_along_y_has_x_to_the_right_and_z_up():
    camera = Camera(eye=(1, 2, 3), target=(1, 7, 3), fov_deg=90)
    assert np.allclose(camera.axes(), [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=1e-15)


@pytest.mark.parametrize(
    ("point", "pixel"),
    [
        # At 90 degrees the focal length is half the height, 50 pixels. From (1, 2, 3) along +y:
        ((1, 12, 3), (100, 50, 10)),  # straight ahead: the middle of a 200 x 100 picture, depth 10
        ((3, 12, 3), (110, 50, 10)),  # 2 to the right at depth 10: 50 * 2 / 10
        ((1, 12, 8), (100, 25, 10)),  # 5 up: 50 * 5 / 10 above the middle
        ((1, 6, 7), (100, 0, 4)),  # at half the field of view: the upper border
        ((1, 1, 3), (100, 50, -1)),  # behind the eye: depth -1
    ],
)
def test_points_project_where_the_ruler_says(point, pixel):
    camera = Camera(eye=(1, 2, 3), target=(1, 7, 3), fov_deg=90)
    x, y, w = camera.world_to_screen(200, 100) @ [*point, 1]
    assert np.allclose([x / w, y / w, w], pixel, atol=1e-12)


def test_the_vertical_field_of_view_does_not_depend_on_the_width():
    camera = Camera(eye=(0, 0, 0), target=(2, 1, -1), fov_deg=45)
    edge = camera.axes()[2] - np.tan(np.radians(22.5)) * camera.axes()[1]
    for width in (64, 720):
        x, y, w = camera.world_to_screen(width, 512) @ [*edge, 1]
        assert np.allclose([x / w, y / w], [width / 2, 0], atol=1e-9)


def test_axes_are_right_handed_for_a_slanted_camera():
    axes = Camera(eye=(3, -2, 5), target=(0, 1, 0.5), fov_deg=30).axes()
    assert np.allclose(axes @ axes.T, np.eye(3), atol=1e-14)
    assert np.allclose(np.cross(axes[0], axes[1]), axes[2], atol=1e-14)
    assert axes[0, 2] == pytest.approx(0)  # the horizon is level
    assert axes[1, 2] < 0  # down is down


# Scene


def scene(**changes) -> Scene:
    mesh = Mesh(TRIANGLE, [[0, 1, 2]], radiance=np.eye(3))
    slide = lambda time: np.array([[1, 0, 0, time], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])  # noqa: E731
    arguments = {
        "name": "test",
        "objects": (Object("still", mesh, "stands still"), Object("sliding", mesh, "slides", slide)),
        "reflectors": (Reflector("mirror", mesh),),
        "camera": lambda time: Camera((0, -1, 0), (0, 0, 0), 45),
        "frames": 2,
    }
    return Scene(**{**arguments, **changes})


def test_refining_splits_objects_not_reflectors_and_interpolates_baked_light():
    before = scene(h_max=1.2)
    after = refined(before)
    assert before.vertices == 9
    assert after.vertices == 4 + 4 + 3
    assert after.triangles == 2 + 2 + 1
    assert after.h_max is None
    assert after.reflectors == before.reflectors
    # The fourth vertex halves the edge from the second to the third.
    assert after.objects[0].mesh.radiance[3].tolist() == [0, 0.5, 0.5]
    assert after.objects[1].motion is before.objects[1].motion


def test_a_scene_without_h_max_is_drawn_as_it_is():
    plain = scene()
    assert refined(plain) is plain


def test_poses_follow_the_motions_in_the_order_of_the_parts():
    moving = scene()
    assert moving.poses(2.0).shape == (3, 3, 4)
    assert moving.poses(2.0)[:, 0, 3].tolist() == [0, 2, 0]
    assert moving.moves(0.0, 1.0)
    assert not moving.moves(1.0, 1.0)
    assert not scene(objects=moving.objects[:1]).moves(0.0, 1.0)


def test_frames_are_a_25th_of_a_second_apart():
    assert scene().time(50) == 2.0


def test_visibility_goes_where_radiance_goes():
    mesh = Mesh(TRIANGLE, [[0, 1, 2]], visibility=np.array([[0, 1], [1, 1], [0, 0.5]]))
    moved = mesh.transformed(np.diag([2.0, 2.0, 2.0, 1.0]))
    assert moved.visibility is not None and np.array_equal(moved.visibility, mesh.visibility)
    fine = subdivided(mesh, 0.8)
    assert fine.visibility is not None
    x = fine.vertices[:, 0]  # the first light's share is x at the corners, and so in between
    np.testing.assert_allclose(fine.visibility[:, 0], x, atol=1e-12)
    assert fine.visibility.shape == (len(x), 2)
    both = merged(mesh, mesh).visibility
    assert both is not None and both.shape == (6, 2)
    assert merged(mesh, replace(mesh, visibility=None)).visibility is None
    assert merged(mesh, replace(mesh, visibility=np.ones((3, 1)))).visibility is None


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: PointLight((0, 0), (1, 1, 1)), r"point light: position is \(0, 0\); accepted: three finite numbers"),
        (lambda: PointLight((0, 0, np.inf), (1, 1, 1)), "position is .*inf"),
        (lambda: PointLight((0, 0, 0), (1, -1, 1)), "intensity is .* from 0"),
        (lambda: Gloss((0, 0, 1.5), 10.0), "specular is .* from 0 to 1"),
        (lambda: Gloss((0, 0, 1), 0.0), "gloss: exponent is 0.0; accepted: positive"),
        (lambda: Gloss((0, 0, 1), np.nan), "exponent is nan"),
        (lambda: scene(lights=(PointLight((0, 0, 0), (1, 1, 1)),) * 5), "5 lights; accepted: at most 4"),
        (
            lambda: Mesh(TRIANGLE, [[0, 1, 2]], visibility=np.ones((2, 1))),
            r"visibility has shape \(2, 1\); accepted: \[3, 1 to 4",
        ),
        (lambda: Mesh(TRIANGLE, [[0, 1, 2]], visibility=np.ones((3, 5))), "visibility has shape"),
        (lambda: Mesh(TRIANGLE, [[0, 1, 2]], visibility=np.full((3, 1), 1.1)), "within 0 and 1"),
        (lambda: Mesh(TRIANGLE, [[0, 1, 2]], visibility=np.full((3, 1), np.nan)), "within 0 and 1"),
    ],
)
def test_lights_that_make_no_sense_are_refused(build, message):
    with pytest.raises(ValueError, match=message):
        build()
