"""Star maps against closed forms: what they say about a mirror in a direction, and which mirrors they refuse."""

from __future__ import annotations

import re
from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest
import trimesh
from support.placed import host, mapped
from support.small_room import quad, sphere
from support.star_shapes import Bumpy, Cylinder, Ellipsoid, Sphere
from support.truth_shapes import unit

from benchharness.kernels.vertices import starmap
from benchharness.scene import Mesh
from scenes.props import bowls

MOVED = {"origin": (0.3, -0.2, 0.5), "turn": (0.4, -0.7, 0.2)}
SHAPES = {
    "offset sphere": Sphere(centre=(0.3, -0.2, 0.4)),
    "ellipsoid": Ellipsoid(half=(1.0, 0.6, 1.7), **MOVED),
    "bumpy": Bumpy(eps=0.3, **MOVED),
    "cylinder": Cylinder(half_length=2.0, **MOVED),
}
every_shape = pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES.keys())
X, Y, Z = np.eye(3)


def directions(seed=0, count=4000):
    """Uniform, and exactly as the device has them."""
    return unit(np.random.default_rng(seed).normal(size=(count, 3))).astype(np.float32).astype(np.float64)


def sampled(star, u):
    """(r [N], grad r [N, 3]) in directions u [N, 3]."""
    r, gradient = starmap.sample(star, mi.Vector3f(np.ascontiguousarray(u.T, np.float32)))
    return np.array(r, np.float64), host(gradient)


def off(star, shape, u):
    """Largest error of r, of grad r, and of the normal in degrees, in directions u."""
    r, gradient = sampled(star, u)
    turned = np.linalg.norm(star.side[0] * unit(u - gradient) - shape.n(u), axis=1)
    return np.abs(r - shape.r(u)[:, 0]).max(), np.abs(gradient - shape.grad_r(u)).max(), np.degrees(turned.max())


def smooth_part(shape, u, reach):
    """The directions more than `reach` radians from a rim, across which nothing can be interpolated."""
    if not isinstance(shape, Cylinder):
        return u
    local = np.abs(u @ shape.axes)
    angle = np.arctan2(local[:, 2], np.hypot(local[:, 0], local[:, 1]))
    return u[np.abs(angle - np.arctan2(shape.half_length, shape.radius)) > reach]


# Sampling.


@every_shape
def test_between_texels_the_error_falls_with_their_square(shape):
    u = smooth_part(shape, directions(), 4 / 16)
    errors = np.array([off(mapped(shape, n), shape, u) for n in (16, 32, 64)])
    orders = np.log2(errors[:-1] / errors[1:])
    # Bilinear: h² / 8 of the second derivative, which the finer map resolves better: orders around 2.
    assert (orders > 1.6).all() and (orders < 2.4).all()
    # An angle of 2 / 64 = 0.03, an eighth of its square, and second derivatives up to about 16 (the ellipsoid's tip).
    assert errors[-1, 0] < 2e-3 and errors[-1, 1] < 5e-3 and errors[-1, 2] < 0.2


def test_a_sphere_about_its_centre_is_exact_at_any_resolution():
    r, gradient = sampled(mapped(Sphere(radius=0.5), 8), directions())
    np.testing.assert_allclose(r, 0.5, atol=1e-7)
    np.testing.assert_allclose(gradient, 0, atol=1e-7)


@every_shape
def test_the_gradient_is_orthogonal_to_its_direction_between_texels_too(shape):
    u = directions(1)
    _, gradient = sampled(mapped(shape, 16), u)
    size = np.linalg.norm(gradient, axis=1)
    assert size.max() > 0.3
    assert np.abs((gradient * u).sum(axis=1)).max() < 2e-7 * max(size.max(), 1)


@pytest.mark.parametrize("shape", [Ellipsoid(half=(1.0, 0.5, 1.2)), Bumpy(eps=0.3)], ids=["ellipsoid", "bumpy"])
def test_there_are_no_poles(shape):
    """Partial derivatives in spherical coordinates, interpolated there, turn the normal by up to 83 degrees."""
    angle = np.linspace(0, 2 * np.pi, 100)
    close = [unit(side * Z + t * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1))
             for side in (1, -1) for t in (1e-6, 1e-3, 0.03)]  # fmt: skip
    star = mapped(shape, 64)
    assert off(star, shape, np.concatenate(close))[2] < 0.2
    # The poles are nothing special: elsewhere it is about as good.
    assert off(star, shape, directions(2))[2] < 0.2


@every_shape
def test_faces_of_the_cube_agree_at_their_edges_and_corners(shape):
    t = np.linspace(-1, 1, 201)
    edges = [np.insert(np.stack([np.full_like(t, s), np.full_like(t, q)], axis=1), axis, t, axis=1)
             for axis in range(3) for s in (1, -1) for q in (1, -1)]  # fmt: skip
    on = np.concatenate(edges)
    u = smooth_part(shape, unit(on), 0.1)
    here = sampled(mapped(shape, 64), u)
    # A hair to either side of an edge lies on another face: two interpolations of the same, each off by h² / 8 of r''.
    for axis in range(3):
        for side in (1e-5, -1e-5):
            there = sampled(mapped(shape, 64), unit(u + side * np.eye(3)[axis]))
            assert np.abs(there[0] - here[0]).max() < 4e-3
            assert np.abs(there[1] - here[1]).max() < 1e-2
    assert off(mapped(shape, 64), shape, u)[2] < 0.2


# Made from meshes.


@pytest.mark.parametrize(
    "shape", [Sphere(), replace(SHAPES["ellipsoid"], origin=(0, 0, 0)), Bumpy(), replace(SHAPES["cylinder"], origin=(0, 0, 0))]
)
def test_from_a_mesh_it_is_the_meshs_chords_and_the_interpolated_normals(shape):
    u = smooth_part(shape, directions(3), 4 / 32)
    errors = []
    for subdivisions in (3, 4):
        mesh = shape.mesh(subdivisions)
        star = starmap.build(mesh.vertices, mesh.normals, mesh.faces, 128)
        assert star.side[0] == 1 and np.array(star.covered).all()
        np.testing.assert_allclose(host(star.centre), 0.5 * (mesh.vertices.min(0) + mesh.vertices.max(0))[None], atol=1e-7)
        errors.append(off(star, shape, u))
    # Halving the triangles' edges quarters how far they lie beneath the surface, and what linear normals are off by. Those
    # of a sphere and of a cylinder are exact: what is left of the latter is the map's own part, 0.005 degrees above.
    (r, gradient, deg), finer = errors
    assert r > 2.5 * finer[0] and finer[0] < 0.02
    if isinstance(shape, Sphere | Cylinder):
        assert deg < 0.02
    else:
        assert gradient > 2.5 * finer[1] and deg > 2.5 * finer[2]
        assert finer[2] < 1.5


def test_where_the_mesh_stands_does_not_matter():
    mesh = Ellipsoid(half=(1.0, 0.6, 1.7)).mesh(3)
    far = np.array([300.0, -700.0, 40.0])
    here = starmap.build(mesh.vertices, mesh.normals, mesh.faces, 32)
    there = starmap.build(mesh.vertices + far, mesh.normals, mesh.faces, 32)
    # Coordinates of 700 have a rounding of 1e-13 in float64, and would have 6e-5 in float32.
    np.testing.assert_allclose(np.array(there.texels), np.array(here.texels), atol=1e-6)
    np.testing.assert_allclose(host(there.centre)[0], far, atol=1e-4)


CLOSED = {
    "meridians along texels": sphere(0.5, slices=96, stacks=48),
    "a bowl's proxy": bowls.convex_bowl((0.1, 0.2, 0.3)).closed,
    "caps": Cylinder(half_length=2.0).mesh(4),
}


@pytest.mark.parametrize("n", [32, 64])
@pytest.mark.parametrize("name", CLOSED)
def test_rays_do_not_slip_through_edges_that_they_run_along(name, n):
    mesh = CLOSED[name]
    middle = 0.5 * (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))
    *_, hit, again = starmap._met(mesh.vertices, mesh.normals, mesh.faces, middle, starmap.directions(n))
    assert hit.all() and not again.any()
    assert np.array(starmap.build(mesh.vertices, mesh.normals, mesh.faces, n).covered).all()


def test_a_hole_that_no_ray_in_a_thousand_meets_is_no_rim():
    """A triangle lost in export: around it, the mirror goes on as beside it."""
    whole = Sphere().mesh(5)
    u = unit(whole.vertices[whole.faces[7]].mean(axis=0, keepdims=True))
    faces = np.delete(whole.faces, [7, 8, 9], axis=0)
    star = starmap.build(whole.vertices, whole.normals, faces, 64)
    assert np.array(star.covered).all()
    r, gradient = sampled(star, np.concatenate([u, directions(5)]))
    np.testing.assert_allclose(r, 1, atol=1e-3)
    np.testing.assert_allclose(gradient, 0, atol=0.05)  # of the nearest texel's normal, 0.03 away
    # Ten times as large, it is one.
    hole = np.linalg.norm(whole.vertices[whole.faces].mean(axis=1) - u, axis=1) < 0.2
    star = starmap.build(whole.vertices, whole.normals, whole.faces[~hole], 64)
    assert 0.001 < 1 - np.array(star.covered).mean() < 0.02


# Refused.


def refused(mesh, n=32) -> str:
    with pytest.raises(starmap.NotStarShapedError, match="it is not star-shaped") as error:
        starmap.build(np.asarray(mesh.vertices), np.asarray(mesh.normals), np.asarray(mesh.faces), n)
    return str(error.value)


def share(message: str) -> float:
    found = re.search(r"([0-9.]+) % of the rays", message)
    assert found, message
    return float(found[1])


def as_mesh(made: trimesh.Trimesh, at=(0.0, 0.0, 0.0)) -> Mesh:
    return Mesh(made.vertices + np.asarray(at), made.faces)


def test_a_torus_is_refused_with_the_share_of_rays_that_meet_it_twice():
    message = refused(as_mesh(trimesh.creation.torus(1.0, 0.3, 128, 64), (5.0, 0.25, -2.0)))
    assert "meet it more than once" in message and "(5, 0.25, -2)" in message
    # From the middle, the tube is seen up to asin(0.3 / 1) from its plane, and always twice. The rim's own few rays graze.
    assert share(message) == pytest.approx(100 * (np.abs(starmap.directions(32)[:, 2]) < 0.3).mean(), abs=0.7)


def test_a_letter_c_is_refused():
    turn, round_ = np.meshgrid(np.radians(np.linspace(45, 315, 60)), np.radians(np.arange(0, 360, 15)), indexing="ij")
    outward = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=-1)
    tube = outward + 0.25 * (np.cos(round_)[..., None] * outward + np.sin(round_)[..., None] * Z)
    a = (np.arange(59)[:, None] * 24 + np.arange(24)).ravel()
    b = (np.arange(59)[:, None] * 24 + np.roll(np.arange(24), -1)).ravel()
    message = refused(
        Mesh(tube.reshape(-1, 3), np.concatenate([np.stack([a, a + 24, b + 24], 1), np.stack([a, b + 24, b], 1)]))
    )
    assert "meet it more than once" in message
    assert 5 < share(message) < 50


def test_a_surface_with_two_sides_turned_to_its_centre_is_refused():
    mesh = Sphere().mesh(3)
    half = mesh.vertices[:, 0] < 0
    message = refused(replace(mesh, normals=np.where(half[:, None], -mesh.normals, mesh.normals)))
    assert "graze it or meet it from the other side" in message
    assert share(message) == pytest.approx(50, abs=5)


def test_a_sheet_that_its_own_middle_lies_in_is_refused():
    flat = quad((-1, 0.25, -1), (2, 0, 0), (0, 0, 2))
    assert "it runs through its own centre (0, 0.25, 0)" in refused(flat)
    tilted = quad((-1, 0.3, -1), (2, 0.1, 0), (0.2, 0.3, 2))  # which rounding moves off its centre
    assert "it runs through its own centre" in refused(tilted)


@pytest.mark.parametrize(("name", "accepted"), [("sheet", True), ("wall", False)])
def test_a_thin_wall_is_refused_where_its_inner_sheet_is_not(name, accepted):
    bowl = bowls.concave_bowl((0, 0, 0), (0.0, 0.0, 5.0))
    mesh = bowl.mesh if name == "sheet" else bowl.closed
    if accepted:
        assert starmap.build(mesh.vertices, mesh.normals, mesh.faces, 32).side[0] == -1
    else:
        assert "meet it more than once" in refused(mesh)


# Open sheets.


def hemisphere(inward: bool = True) -> Mesh:
    """The upper half of the unit sphere; from its middle, (0, 0, 1/2), it looks inward or outward."""
    ball = sphere(1.0, slices=192, stacks=96)
    faces = ball.faces[ball.vertices[ball.faces][:, :, 2].min(axis=1) > -1e-9]
    used, faces = np.unique(faces, return_inverse=True)
    faces, n = faces.reshape(-1, 3), ball.vertices[used]
    return Mesh(n, faces[:, ::-1] if inward else faces, -n if inward else n)


@pytest.mark.parametrize("inward", [True, False])
def test_an_open_sheet_is_covered_where_it_is_and_goes_on_beyond_its_rim(inward):
    mesh, n = hemisphere(inward), 64
    star = starmap.build(mesh.vertices, mesh.normals, mesh.faces, n)
    assert star.side[0] == (-1 if inward else 1)
    np.testing.assert_allclose(host(star.centre), [[0, 0, 0.5]], atol=1e-6)

    # By hand: from (0, 0, 1/2), the sphere is reached after r with r² + r u_z = 3/4; the rim z = 0 is seen at u_z = -1/√5.
    u = directions(4)
    reach = -u[:, 2] / 2 + np.sqrt(u[:, 2] ** 2 / 4 + 0.75)
    above = 0.5 + reach * u[:, 2]
    covered = np.array(starmap.is_covered(star, mi.Vector3f(u.T.astype(np.float32))))
    texel = 2 / n * np.sqrt(2) * reach  # at most, as an angle, times the way
    clear = np.abs(above) > texel
    assert clear.mean() > 0.9
    np.testing.assert_array_equal(covered[clear], (above > 0)[clear])

    r, gradient = sampled(star, u)
    inside = above > 2 * texel
    n_here = star.side[0] * unit(u - gradient)
    P = np.array([0, 0, 0.5]) + reach[:, None] * u
    np.testing.assert_allclose(r[inside], reach[inside], atol=1e-3)
    np.testing.assert_allclose(n_here[inside], (-P if inward else P)[inside], atol=2e-3)

    # Beyond, r is that of the rim, √(1 + 1/4), or of texels near it; the gradient is finite and still orthogonal to u.
    beyond = above < -2 * texel
    assert beyond.sum() > 500
    np.testing.assert_allclose(r[beyond], np.sqrt(1.25), atol=0.05)
    assert np.isfinite(gradient).all()
    assert np.abs((gradient * u).sum(axis=1)).max() < 1e-6
    assert np.linalg.norm(gradient[beyond], axis=1).max() < 1.5 * np.linalg.norm(gradient[inside], axis=1).max()


def test_texels_are_where_their_directions_say():
    """`covered` and `texels` are asked at the centres of texels, all of a map with a pattern that has no symmetry."""
    n = 8
    d = starmap.directions(n)
    pattern = np.arange(len(d)) % 3 != 0
    values = 1 + 0.001 * np.arange(len(d))
    star = starmap.packed(np.where(pattern, values, 1), np.zeros_like(d), pattern, (0, 0, 0), 1.0, n)
    within = np.zeros((6, n + 2, n + 2), bool)
    within[:, 1:-1, 1:-1] = True
    within = within.ravel()
    u = mi.Vector3f(d[within].T.astype(np.float32))
    np.testing.assert_array_equal(np.array(starmap.is_covered(star, u)), pattern[within])
    shown = pattern[within]
    np.testing.assert_allclose(sampled(star, d[within])[0][shown], values[within][shown], rtol=1e-5)
