"""The oracle of reflection points against closed forms: Alhazen's problem on a sphere, a plane's mirror image."""

from __future__ import annotations

import numpy as np
import pytest
from support.small_room import quad, sphere
from support.truth_shapes import alhazen, alhazen_inside, unit

from benchharness.measure import truth
from benchharness.scene import Camera, Mesh, Object, Reflector, Scene, merged, subdivided

EYE = np.array([0.0, -4.0, 0.0])


def outside(seed: int, count: int) -> np.ndarray:
    """Points around the unit sphere that it shows: the segment to the eye misses it, by a tenth of the radius."""
    rng = np.random.default_rng(seed)
    V = unit(rng.normal(size=(6 * count, 3))) * rng.uniform(1.05, 5, (6 * count, 1))
    along = V - EYE
    t = np.clip(-(along @ EYE) / (along**2).sum(1), 0, 1)
    return V[np.linalg.norm(EYE + t[:, None] * along, axis=1) > 1.1][:count]


@pytest.fixture(scope="module")
def ball():
    return sphere(1.0, slices=256, stacks=128)


def test_on_a_fine_sphere_the_points_are_alhazens(ball):
    V = outside(0, 60)
    R = np.array([alhazen(EYE, v) for v in V])
    found, valid = truth.reflection_points(ball.vertices, ball.normals, ball.faces, EYE, V, R)
    assert len(V) == 60
    assert valid.any(axis=1).mean() > 0.95  # Newton may fail on a sliver at the poles
    # A chord of 2π/256 sags by 1 - cos(π/256) = 7.5e-5; at the grazing incidence of these points it tells at most tenfold.
    off = np.linalg.norm(truth.nearest(found, valid, R) - R, axis=1)
    assert np.nanmax(off) < 1e-3
    assert np.nanmedian(off) < 1e-4
    # All that is called valid is that one point: a convex mirror has no other.
    assert (np.linalg.norm(found - R[:, None], axis=2)[valid] < 1e-3).all()


def test_the_points_obey_the_law_with_the_interpolated_normal(ball):
    V = outside(1, 20)
    R = np.array([alhazen(EYE, v) for v in V])
    found, valid = truth.reflection_points(ball.vertices, ball.normals, ball.faces, EYE, V, R)
    # On the sphere, interpolated and radial normals differ by less than the square of half an edge, 1.5e-4.
    h = unit(unit(EYE - found) + unit(V[:, None] - found))
    assert np.abs(h - unit(found))[valid].max() < 2e-4


def test_a_poor_guess_of_where_to_look_does_not_change_the_answer(ball):
    V = outside(2, 20)
    R = np.array([alhazen(EYE, v) for v in V])
    far = np.tile([0.0, -1.0, 0.0], (20, 1))
    points, valid = truth.reflection_points(ball.vertices, ball.normals, ball.faces, EYE, V, far)
    assert valid.any(axis=1).mean() > 0.9
    assert np.nanmax(np.linalg.norm(truth.nearest(points, valid, R) - R, axis=1)) < 1e-3


def test_hidden_vertices_have_no_point(ball):
    V = np.array([[0.0, 3.0, 0.1], [0.2, 0.0, 0.0], [0.3, 5.0, -0.4]])
    near = np.tile([0.0, -1.0, 0.0], (3, 1))
    points, valid = truth.reflection_points(ball.vertices, ball.normals, ball.faces, EYE, V, near)
    assert not valid.any()
    assert np.isnan(truth.nearest(points, valid, near)).all()


def plane(h: float | None):
    """The plane y = 0, seen from -y; whole, or in triangles with edges up to `h`."""
    sheet = quad((-2, 0, -2), (4, 0, 0), (0, 0, 4))
    return sheet if h is None else subdivided(sheet, h)


@pytest.mark.parametrize("h", [None, 0.7])
def test_on_a_plane_of_any_tessellation_it_is_where_the_eye_sees_the_mirror_image(h):
    mesh = plane(h)
    V = np.column_stack([*np.random.default_rng(3).uniform(-1.5, 1.5, (2, 40)), np.zeros(40)])[:, [0, 2, 1]]
    V[:, 1] = -np.random.default_rng(4).uniform(0.1, 3.0, 40)
    image = V * [1, -1, 1]
    t = -EYE[1] / (image - EYE)[:, 1]
    R = EYE + t[:, None] * (image - EYE)
    found, valid = truth.reflection_points(mesh.vertices, mesh.normals, mesh.faces, EYE, V, R)
    np.testing.assert_allclose(truth.nearest(found, valid, R), R, atol=1e-9)
    np.testing.assert_allclose(truth.image_of(V, R, EYE), image, atol=1e-12)


def test_beyond_the_edge_of_a_plane_there_is_no_point():
    mesh = plane(0.7)
    V = np.array([[5.0, -0.5, 0.0]])  # mirrored at x = 5 · 4 / 4.5 = 4.4
    found, valid = truth.reflection_points(mesh.vertices, mesh.normals, mesh.faces, EYE, V, np.array([[2.0, 0.0, 0.0]]))
    assert not valid.any()
    assert np.isfinite(found).all()


def test_inside_a_sphere_a_vertex_has_several_points():
    # Eye and vertex on one diameter, on different sides of the centre: both ends of the diameter reflect one to the other.
    hollow = sphere(1.0, slices=256, stacks=128)
    eye, V = np.array([0.0, -0.5, 0.0]), np.array([[0.0, 0.4, 0.0]])
    ends = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
    for end in ends:
        found, valid = truth.reflection_points(hollow.vertices, -hollow.normals, hollow.faces, eye, V, end[None])
        assert np.linalg.norm(truth.nearest(found, valid, end[None]) - end) < 1e-3


def test_the_image_lies_on_the_eyes_ray_as_far_behind_as_the_vertex_is_away():
    # By hand: eye 3 in front of R on -y, V 2 beside it: the image is 2 behind R.
    eye, R, V = np.array([0.0, -3.0, 0.0]), np.array([[0.0, 0.0, 0.0]]), np.array([[2.0, 0.0, 0.0]])
    np.testing.assert_allclose(truth.image_of(V, R, eye), [[0, 2, 0]], atol=1e-12)


def test_pixels_by_hand_and_nothing_behind_the_eye():
    # 90 degrees over 100 rows: focal length 50 px. One unit to the right and up at depth 2 is 25 px from the middle.
    camera = Camera((0.0, -2.0, 0.0), (0.0, 0.0, 0.0), 90.0)
    points = np.array([[0, 0, 0], [1, 0, 1], [-1, 3, 0], [0, -2.1, 0]], float)
    pixels = truth.on_screen(points, camera, 200, 100)
    np.testing.assert_allclose(pixels[:3], [[100, 50], [125, 25], [90, 50]], atol=1e-12)
    assert np.isnan(pixels[3]).all()


def test_of_several_points_the_nearest_valid_one_is_taken():
    points = np.array([[[0, 0, 0], [1, 0, 0], [2, 0, 0]]] * 2, float)
    valid = np.array([[False, True, True], [False, False, False]])
    chosen = truth.nearest(points, valid, np.array([[0.1, 0, 0], [0.1, 0, 0]]))
    np.testing.assert_array_equal(chosen[0], [1, 0, 0])
    assert np.isnan(chosen[1]).all()


def test_each_of_several_points_goes_on_as_itself():
    """In the plane of a vertex and an eye inside a sphere, both off the centre: two points, on opposite sides of it."""
    bowl = sphere(1.0, slices=96, stacks=48)
    inside = Reflector("bowl", Mesh(bowl.vertices, bowl.faces[:, ::-1], -np.asarray(bowl.normals)))
    dot = Mesh(np.array([[0.1, 0.0, 0.0], [0.11, 0.0, 0.0], [0.1, 0.01, 0.0]]), [[0, 1, 2]])

    def camera(time: float) -> Camera:
        return Camera((0.02 * time, -0.6, 0.0), (0.0, 1.0, 0.0), 60.0)

    made = Scene("bowl", (Object("dot", dot, "a vertex"),), (inside,), camera, frames=2, fps=1.0)
    eye, V = np.array([0.0, -0.6, 0.0]), np.array([[0.1, 0.0, 0.0]])
    mesh = inside.mesh
    far, close = (
        truth.nearest(*truth.reflection_points(mesh.vertices, mesh.normals, mesh.faces, eye, V, near), near)
        for near in (np.array([[0.0, 1.0, 0.0]]), np.array([[0.0, -1.0, 0.0]]))
    )
    assert far[0, 1] > 0.9 and close[0, 1] < -0.9
    for before in (far, close):
        after = truth.Mirror(made, 1.0, (8, 8), 0).continued(np.array([0]), before)
        # The eye moved by 0.02 and takes the point along by one or two times that; the other point is 1.9 away.
        assert 0 < np.linalg.norm(after - before) < 0.1


# All of several.


def inside_out(mesh):
    return Mesh(mesh.vertices, mesh.faces[:, ::-1], -mesh.normals)


def same_points(one, other, tolerance):
    apart = np.linalg.norm(one[:, None] - other, axis=2)
    return one.shape == other.shape and (apart.min(axis=0) < tolerance).all() and (apart.min(axis=1) < tolerance).all()


def test_inside_a_sphere_they_are_the_two_or_four_roots_of_the_quartic(ball):
    eye, V = np.array([0.1, 0.05, -0.6]), np.random.default_rng(0).uniform(-0.55, 0.55, (16, 3))
    mesh = inside_out(ball)
    points, shown = truth.every_reflection_point(mesh.vertices, mesh.normals, mesh.faces, eye, V)
    roots = [alhazen_inside(eye, v) for v in V]
    assert {len(r) for r in roots} == {2, 4}
    # A chord of 2π/256 sags by 7.5e-5; near a caustic, points move by some times that.
    assert all(same_points(p, r, 2e-3) for p, r in zip(points, roots, strict=True))
    assert all(s.all() for s in shown)


def test_from_one_focus_of_an_ellipsoid_to_anywhere_they_are_where_the_line_to_the_other_focus_leaves_it():
    """T5. Half axes 1, 0.8, 0.8: foci at x = ±0.6."""
    axes, other = np.array([1.0, 0.8, 0.8]), np.array([0.6, 0.0, 0.0])
    ball = sphere(1.0, slices=256, stacks=128)
    n = unit(ball.vertices / axes)
    mesh = inside_out(Mesh(ball.vertices * axes, ball.faces, n))
    V = np.array([[0.1, 0.2, 0.3], [-0.3, -0.1, 0.4], [0.2, -0.5, 0.1]])
    points, _ = truth.every_reflection_point(mesh.vertices, mesh.normals, mesh.faces, -other, V)
    for v, found in zip(V, points, strict=True):
        d = unit(v - other)
        a, b, c = (d / axes) @ (d / axes), (other / axes) @ (d / axes), (other / axes) @ (other / axes) - 1
        t = (-b + np.array([1, -1]) * np.sqrt(b * b - a * c)) / a
        assert same_points(found, other + t[:, None] * d, 2e-3)


def test_a_point_that_the_mirror_hides_from_eye_or_vertex_is_not_shown():
    """The plane y = 0, and before it a shutter of the same mesh that turns its back to the eye: on the way there, on the way to
    the vertex, or beside."""
    V = np.array([[1.0, -2.0, 0.0]])
    R = np.array([2 / 3, 0.0, 0.0])  # the eye is twice as far from the plane
    for at, shows in ((None, True), ((R + EYE) / 2, False), ((R + V[0]) / 2, False), (np.array([-1.0, -1.0, 0.0]), True)):
        mesh = plane(0.7)
        if at is not None:
            mesh = merged(mesh, quad(at - [0.1, 0, 0.1], (0, 0, 0.2), (0.2, 0, 0)))
        points, shown = truth.every_reflection_point(mesh.vertices, mesh.normals, mesh.faces, EYE, V)
        np.testing.assert_allclose(points[0], [R], atol=1e-9)
        assert shown[0].tolist() == [shows]


def test_a_sheet_may_be_a_mirror_on_its_back_too(ball):
    """Alhazen's points of the inside, of a ball whose normals point outward."""
    eye, V = np.array([0.1, 0.05, -0.6]), np.array([[0.2, -0.1, 0.3]])
    outward = [
        truth.every_reflection_point(ball.vertices, ball.normals, ball.faces, eye, V, both_sides=both)[0][0]
        for both in (False, True)
    ]
    assert len(outward[0]) == 0
    assert same_points(outward[1], alhazen_inside(eye, V[0]), 2e-3)
