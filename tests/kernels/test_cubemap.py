"""Cube maps: where directions land, what a capture holds, and that faces meet."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels import cubemap, geometry
from benchharness.kernels.surroundings import Surroundings


def smooth(d):
    """A function of direction without kinks, three channels."""
    d = d / np.linalg.norm(d, axis=-1, keepdims=True)
    x, y, z = np.moveaxis(d, -1, 0)
    return np.stack([0.5 + 0.4 * x * y, 0.5 + 0.3 * z + 0.1 * x, 0.6 + 0.3 * y * z], axis=-1)


def texel_directions(n):
    """Directions of all texels, border included, [6, n + 2, n + 2, 3], worked out from the layout in words."""
    u = (2 * (np.arange(n + 2) - 1) + 1) / n - 1
    out = np.empty((6, n + 2, n + 2, 3))
    for face in range(6):
        axis, sign = face // 2, 1 - 2 * (face % 2)
        out[face, ..., axis] = sign
        out[face, ..., (axis + 1) % 3] = u[None, :]
        out[face, ..., (axis + 2) % 3] = u[:, None]
    return out


def filled(n):
    values = smooth(texel_directions(n))
    return mi.Float(np.concatenate([values, np.ones((*values.shape[:-1], 1))], axis=-1).astype(np.float32).ravel())


def random_directions(n=4000, seed=0):
    return np.random.default_rng(seed).normal(size=(n, 3))


def looked_up(texels, n, d):
    return np.array(cubemap.lookup(texels, n, mi.Vector3f(d.astype(np.float32).T))).T


def test_lookup_converges_to_the_function_at_second_order():
    d = random_directions()
    errors = [np.abs(looked_up(filled(n), n, d)[:, :3] - smooth(d)).max() for n in (16, 32, 64)]
    order = -np.polyfit(np.log([16, 32, 64]), np.log(errors), 1)[0]
    assert 1.8 < order < 2.2
    assert errors[-1] < 2e-3


def test_faces_meet_without_a_seam():
    # Pairs of directions a hair on both sides of an edge, and of a corner.
    rng = np.random.default_rng(1)
    t = rng.uniform(-1, 1, 500)
    edge = np.stack([np.ones(500), np.ones(500), t], axis=1)
    for d in (edge, np.roll(edge, 1, axis=1), np.array([[1.0, 1.0, 1.0], [-1.0, 1.0, -1.0]])):
        nudge = 1e-5 * np.array([1, -1, 0])
        jump = looked_up(filled(64), 64, d + nudge) - looked_up(filled(64), 64, d - nudge)
        assert np.abs(jump).max() < 5e-4  # a texel spans 0.03 of the function's range: a sixtieth of a texel's step


def test_the_corner_directions_of_the_cube_are_finite():
    d = np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z], float)
    values = looked_up(filled(32), 32, d)
    np.testing.assert_allclose(values[:, :3], smooth(d), atol=5e-3)


def test_direction_and_face_are_inverse():
    d = mi.Vector3f(random_directions(1000).astype(np.float32).T)
    face, u, v = cubemap.face_of(d)
    back = dr.normalize(cubemap.direction(face, u, v))
    assert dr.all(dr.norm(back - dr.normalize(d)) < 1e-6)


def sphere_around(radius):
    import trimesh

    mesh = trimesh.creation.icosphere(subdivisions=5, radius=radius)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


def test_a_capture_holds_what_lies_in_each_direction_and_how_far():
    vertices, faces = sphere_around(2.0)
    triangles = geometry.upload([(vertices, smooth(vertices), faces)])
    n = 64
    everything = dr.full(mi.Bool, True, triangles.face_count)
    around = Surroundings(mi.Color3f(0))
    texels = cubemap.capture(triangles, everything, mi.Point3f(0, 0, 0), n, mi.Float(0.01), around)
    d = random_directions()
    values = looked_up(texels, n, d)
    np.testing.assert_allclose(values[:, :3], smooth(d), atol=4e-3)
    np.testing.assert_allclose(1 / values[:, 3], 2.0, rtol=3e-3)


def test_what_is_not_drawn_is_the_surroundings():
    vertices, faces = sphere_around(2.0)
    triangles = geometry.upload([(vertices, smooth(vertices), faces)])
    nothing = dr.full(mi.Bool, False, triangles.face_count)
    around = Surroundings(mi.Color3f(0.1, 0.2, 0.3))
    texels = cubemap.capture(triangles, nothing, mi.Point3f(0, 0, 0), 8, mi.Float(0.01), around)
    np.testing.assert_allclose(looked_up(texels, 8, random_directions(50)), np.tile([0.1, 0.2, 0.3, 0], (50, 1)), atol=1e-6)


def test_mip_levels_keep_the_mean_and_blend_between_levels():
    texels, sizes = [filled(64)], cubemap.levels_of(64)
    assert sizes == [64, 32, 16, 8, 4]
    for n in sizes[:-1]:
        texels.append(cubemap.coarser(texels[-1], n))
    levels = cubemap.pyramid(texels, 64)
    d = random_directions(2000)
    vectors = mi.Vector3f(d.astype(np.float32).T)

    def at(level):
        return np.array(cubemap.lookup_mip(levels, vectors, mi.Float(level))).T

    np.testing.assert_allclose(at(0.0), looked_up(texels[0], 64, d), atol=1e-6)
    np.testing.assert_allclose(at(9.0), looked_up(texels[-1], 4, d), atol=1e-6)
    expected = 0.5 * (looked_up(texels[1], 32, d) + looked_up(texels[2], 16, d))
    np.testing.assert_allclose(at(1.5), expected, atol=1e-6)
    # The function varies slowly: a 16-texel level still follows it to the size of its texels squared.
    np.testing.assert_allclose(looked_up(texels[2], 16, d)[:, :3], smooth(d), atol=2e-2)
