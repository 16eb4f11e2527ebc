"""Star-shaped mirrors against finite differences and textbook equations; the truths that are made from them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.star_shapes import Bumpy, Cylinder, Ellipsoid, Sphere, hidden, leaves, lowest, truths
from support.truth_shapes import reverse_constructed, unit

MOVED = {"origin": (0.3, -0.2, 0.5), "turn": (0.4, -0.7, 0.2)}
SHAPES = {
    "sphere": Sphere(radius=0.7, **MOVED),
    "sphere seen off its centre": Sphere(centre=(0.3, -0.2, 0.4), **MOVED),
    "ellipsoid": Ellipsoid(half=(1.0, 0.6, 1.7), **MOVED),
    "cylinder": Cylinder(half_length=2.0, **MOVED),
    "bumpy": Bumpy(eps=0.3, **MOVED),
}
EYE = np.array([0.0, 0.0, 4.0])
every_shape = pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES.keys())


def directions(seed=0, count=200):
    return unit(np.random.default_rng(seed).normal(size=(count, 3)))


@every_shape
def test_the_gradient_is_that_of_r_in_space(shape):
    u, h = directions(), 1e-5
    if isinstance(shape, Cylinder):  # differences across the rim mean nothing
        local = np.abs(u @ shape.axes)
        u = u[np.abs(local[:, 2] / np.hypot(local[:, 0], local[:, 1]) - shape.half_length / shape.radius) > 1e-2]
    x = shape.r(u) * u
    differences = [(shape.r(unit(x + h * d)) - shape.r(unit(x - h * d))) / (2 * h) for d in np.eye(3)]
    # Central differences: h² r''' ~ 1e-9, rounding 1e-16 / h ~ 1e-11; the cylinder's third derivatives are large at its rim.
    np.testing.assert_allclose(shape.grad_r(u), np.concatenate(differences, axis=1), atol=1e-7)
    np.testing.assert_allclose((shape.grad_r(u) * u).sum(axis=1), 0, atol=1e-14)


@every_shape
def test_the_normal_stands_on_the_surface_and_looks_outward(shape):
    u, h = directions(1), 1e-6
    away, n = np.cross(u, unit(u[::-1])), shape.n(u)
    along = (shape.P(unit(u + h * away)) - shape.P(unit(u - h * away))) / (2 * h)
    assert np.abs((along * n).sum(axis=1)).max() < 1e-6
    assert ((shape.P(u) - shape.origin) * n).sum(axis=1).min() > 0
    assert lowest(shape, shape.P(u) + 1e-4 * n, shape.P(u) + 1e-3 * n).min() > 0


def test_the_points_satisfy_the_textbook_equations():
    u = directions(2)

    def local(shape):
        return (shape.P(u) - shape.origin) @ shape.axes

    np.testing.assert_allclose(np.linalg.norm(local(SHAPES["sphere"]), axis=1), 0.7, rtol=1e-14)
    off = local(SHAPES["sphere seen off its centre"]) - [0.3, -0.2, 0.4]
    np.testing.assert_allclose(np.linalg.norm(off, axis=1), 1, rtol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(local(SHAPES["ellipsoid"]) / [1.0, 0.6, 1.7], axis=1), 1, rtol=1e-14)
    x, y, z = local(SHAPES["cylinder"]).T
    np.testing.assert_allclose(np.maximum(np.hypot(x, y), np.abs(z) / 2), 1, rtol=1e-14)
    # By hand, at (√2, 0, 1) / √3: h = (3 √3 / 2) (2 / 3) (1 / √3) = 1, its largest value.
    top = unit(np.array([np.sqrt(2), 0.0, 1.0]))
    np.testing.assert_allclose(Bumpy(eps=0.3).r(top), 1.3, rtol=1e-14)


def test_a_turned_shape_is_the_shape_turned():
    turn = Rotation.from_rotvec(MOVED["turn"]).as_matrix()
    u = directions(3)
    for here, there in [(Ellipsoid(), Ellipsoid(**MOVED)), (Bumpy(), Bumpy(**MOVED)), (Cylinder(), Cylinder(**MOVED))]:
        np.testing.assert_allclose(there.P(u @ turn.T), here.P(u) @ turn.T + MOVED["origin"], atol=1e-12)
        np.testing.assert_allclose(there.n(u @ turn.T), here.n(u) @ turn.T, atol=1e-12)


VOLUMES = {
    "sphere": 4 / 3 * np.pi * 0.7**3,
    "sphere seen off its centre": 4 / 3 * np.pi,
    "ellipsoid": 4 / 3 * np.pi * 1.0 * 0.6 * 1.7,
    "cylinder": np.pi * 4.0,
    # ∫ (1 + eps h)³ / 3 over the sphere; ∫ h = ∫ h³ = 0, and ∫ h² = (27 / 4) ∫ (x² - y²)² z² = (27 / 4) 4 · 4π / 105.
    "bumpy": 4 / 3 * np.pi + 0.3**2 * 27 / 4 * 16 * np.pi / 105,
}


@pytest.mark.parametrize("name", SHAPES)
def test_meshes_are_closed_on_the_surface_and_enclose_its_volume(name):
    shape, off = SHAPES[name], []
    for subdivisions in (2, 3):
        mesh = shape.mesh(subdivisions)
        np.testing.assert_allclose(shape.height(mesh.vertices), 0, atol=1e-12)
        corners = mesh.vertices[mesh.faces]
        faces_n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert (np.einsum("fi,fki->fk", unit(faces_n), mesh.normals[mesh.faces]) > 0.5).all()  # outward, like the exact normals
        np.testing.assert_allclose(faces_n.sum(axis=0), 0, atol=1e-12)  # closed
        volume = (np.linalg.det(corners - np.asarray(shape.origin))).sum() / 6
        off.append(abs(volume - VOLUMES[name]))
    # Chords' sagitta is of second order: half the edge, a quarter of the error.
    assert 3.3 < off[0] / off[1] < 4.7


def test_normals_of_a_mesh_are_the_surfaces_own():
    mesh = SHAPES["ellipsoid"].mesh(2)
    local = (mesh.vertices - MOVED["origin"]) @ SHAPES["ellipsoid"].axes
    np.testing.assert_allclose(mesh.normals, unit(local / np.square([1.0, 0.6, 1.7])) @ SHAPES["ellipsoid"].axes.T, atol=1e-12)


def test_the_bumpy_star_is_not_convex_and_a_gentle_one_is():
    u = directions(4, 20000)
    near = unit(u + 0.2 * directions(5, 20000))

    def sag(eps):  # height over the surface of the middle of a short chord
        shape = Bumpy(eps=eps)
        return shape.height((shape.P(u) + shape.P(near)) / 2).max()

    assert sag(0.3) > 1e-3
    assert sag(0.05) < 0


@every_shape
def test_truths_obey_the_law_and_their_rays_are_free(shape):
    V, R = truths(shape, EYE, 0, 100, 0.1, 0.9)
    n = shape.normal(R)
    np.testing.assert_allclose(shape.height(R), 0, atol=1e-12)
    np.testing.assert_allclose(unit(unit(EYE - R) + unit(V - R)), n, atol=1e-11)
    cos = (unit(EYE - R) * n).sum(axis=1)
    assert (cos > 0.1).all()
    assert (cos <= 0.9).all()
    # Looked at from both ends, leaving out the last ten-thousandth, with other samples than those that chose them.
    for x in (V, EYE):
        assert lowest(shape, x, R + 1e-4 * (x - R), samples=300).min() > 0


def test_on_a_bumpy_star_some_rays_are_blocked_and_left_out():
    shape = Bumpy(eps=0.3)
    V, R = reverse_constructed(shape, EYE, 0, 400, 0.02)
    free = leaves(shape, R, EYE) & leaves(shape, R, V)
    assert 10 < (~free).sum() < 200
    assert not np.isin(truths(shape, EYE, 0, 100)[0][:, 0], V[~free][:, 0]).any()


def test_hidden_is_behind_or_inside_a_sphere():
    rng = np.random.default_rng(6)
    V = unit(rng.normal(size=(1000, 3))) * rng.uniform(0.5, 5, (1000, 1))
    V[:4] = [[0, 0, -1e6], [0, 1e5, -1e6], [1e6, 0, 1e5], [0, 0, 0.99]]
    # The segment comes nearest to the centre at t: it hits where it is nearer than the radius.
    along = V - EYE
    t = np.clip(-(along @ EYE) / (along**2).sum(axis=1), 0, 1)
    distance = np.linalg.norm(EYE + t[:, None] * along, axis=1)
    clear = np.abs(distance - 1) > 1e-3
    assert clear.mean() > 0.99
    np.testing.assert_array_equal(hidden(Sphere(), EYE, V)[clear], (distance < 1)[clear])


def test_shapes_that_are_not_stars_are_refused():
    with pytest.raises(ValueError, match="contains O_r"):
        Sphere(centre=(1.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="accepted: between"):
        Bumpy(eps=1.0)
