"""Normal maps on the device: normals, rays and frames against float64 NumPy; what is refused; and scenes that have none."""

from __future__ import annotations

from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from oracles.normalmap_oracle import mapped, mirrored, seen, unit
from support.mapped_mirrors import ball, flat, ripples, room, rough, sheet, smooth
from support.mirror_room import shaded, still
from support.small_room import quad
from support.textured_rooms import SQUARE

from benchharness.kernels import geometry, lighting, normalmap
from benchharness.modelling.normalmap import without_tangent
from benchharness.render.frame import FrameRenderer
from benchharness.render.normalisation import normalised
from benchharness.scene import Mesh, Reflector, Texture
from benchharness.study import identity
from methods.ray_traced import RayTraced

SIZE = (96, 72)


# The oracle, by hand


@pytest.mark.parametrize(
    ("uv", "colour", "normal"),
    [
        # A square in the plane of x and z, seen from -y. Its picture upright: red is to the right, green up, blue to the eye.
        (SQUARE, (1.0, 0.5, 0.5), (1, 0, 0)),
        (SQUARE, (0.5, 1.0, 0.5), (0, 0, 1)),
        (SQUARE, (0.5, 0.5, 1.0), (0, -1, 0)),
        # A quarter turn of the picture: its right is up, its top to the left.
        (np.roll(SQUARE, 1, axis=0), (1.0, 0.5, 0.5), (0, 0, 1)),
        (np.roll(SQUARE, 1, axis=0), (0.5, 1.0, 0.5), (-1, 0, 0)),
        # Mirrored: its right is to the left, its top still up.
        (SQUARE * [-1, 1], (1.0, 0.5, 0.5), (-1, 0, 0)),
        (SQUARE * [-1, 1], (0.5, 1.0, 0.5), (0, 0, 1)),
        # Sheared: v grows along (1, 0, 1), of which what is across s counts.
        (SQUARE @ [[1, 0], [-1, 1]], (0.5, 1.0, 0.5), (0, 0, 1)),
        # Stretched: numbers are not slopes in uv.
        (SQUARE * [5, 0.1], (0.5 + 0.3, 0.5, 0.5 + 0.4), (0.6, -0.8, 0)),
        # Without area.
        (SQUARE * [1, 0], (1.0, 0.5, 0.5), (0, -1, 0)),
    ],
)
def test_the_oracle_is_right_on_a_square(uv, colour, normal):
    corners = quad((0, 0, 0), (1, 0, 0), (0, 0, 1)).vertices[[0, 1, 2]]
    map = Texture(np.full((1, 1, 3), colour))
    found = mapped(corners, uv[[0, 1, 2]], np.array([0.2, 0.3, 0.5]), np.array([0.0, -1.0, 0.0]), map)
    np.testing.assert_allclose(found, normal, atol=1e-6)  # pixels are float32


def test_the_oracle_turns_rays_round_that_go_below():
    g, v = np.array([0.0, 0.0, 1.0]), np.array([0.6, 0.0, 0.8])
    # About N at 60 degrees from g and 96.9 from v, the ray would leave at -0.92 along g.
    N = np.array([-np.sqrt(0.75), 0, 0.5])
    halfway, r = mirrored(N, g, v)
    below = 2 * (N @ v) * N - v
    np.testing.assert_allclose(r, below * [1, 1, -1])
    np.testing.assert_allclose(2 * (halfway @ v) * halfway - v, r)
    # From behind, about the same N, it stays on that side.
    _, back = mirrored(N, g, -v)
    assert back[2] < 0
    np.testing.assert_allclose(mirrored(g, g, v)[0], g)


# The kernel


def patch(rng: np.random.Generator, uv: np.ndarray) -> Mesh:
    """A triangle anywhere, with normals that are not its own."""
    corners = rng.uniform(-2, 2, (3, 3))
    area = unit(np.cross(corners[1] - corners[0], corners[2] - corners[0]))
    normals = area + rng.uniform(-0.4, 0.4, (3, 3))
    return Mesh(corners, np.array([[0, 1, 2]]), normals / np.linalg.norm(normals, axis=1, keepdims=True), uv=uv)


@pytest.fixture(scope="module")
def patches():
    """Triangles with pictures turned, mirrored, sheared, beyond their edges, and crushed; the last has no map."""
    rng = np.random.default_rng(7)
    uv = [rng.uniform(-2, 2, (3, 2)) for _ in range(9)]
    uv[7] = np.outer([0.1, 0.4, 0.9], [1.0, 2.0])
    ways = ["repeat", "mirror", "clamp", ("repeat", "clamp")]
    made = [Reflector(f"patch {i}", patch(rng, uv[i]), normal_map=rough(i, wrap=ways[i % 4])) for i in range(9)]
    made[8] = replace(made[8], normal_map=None)
    return room(*made)


def test_normals_and_rays_are_the_oracles(patches):
    triangles, first = geometry.of_scene_seen(patches), sum(len(o.mesh.vertices) for o in patches.objects)
    maps = triangles.normal_maps
    assert maps is not None
    rng, areas = np.random.default_rng(3), []
    for i, mirror in enumerate(patches.reflectors):
        weights = np.concatenate([rng.dirichlet(np.ones(3), 60), np.eye(3)])
        n = weights @ mirror.mesh.normals
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        v = rng.normal(size=n.shape)  # from both sides
        v /= np.linalg.norm(v, axis=1, keepdims=True)
        a, b, c = mirror.mesh.vertices
        g = unit(np.cross(b - a, c - a))
        v += (np.abs(v @ g) < 0.02)[:, None] * g  # within a degree of the triangle either side may be right
        v /= np.linalg.norm(v, axis=1, keepdims=True)
        face = mi.Vector4u(*(mi.UInt32(first + 3 * i + k) for k in range(3)), mi.UInt32(0))
        part = mi.UInt32(np.full(len(n), len(patches.objects) + i))
        spot = lighting.Spot(triangles.points, face, part, mi.Vector3f(np.float32(weights).T))
        smooth_n, to_eye = (mi.Vector3f(np.float32(a).T) for a in (n, v))
        N, there = normalmap.tilted(maps, spot, smooth_n, mi.Bool(True))
        turned = np.array(normalmap.turned(maps, spot, smooth_n, to_eye, mi.Bool(True))).T
        expected = np.array(n)
        if mirror.normal_map is not None:
            corners, uv = mirror.mesh.vertices, mirror.mesh.uv
            lanes = zip(weights, n, strict=True)
            expected = np.array([mapped(corners, uv, w, m, mirror.normal_map) for w, m in lanes])
        assert np.all(np.array(there) == (i < 7))
        # What uv lose to rounding, 5e-7, is 3e-6 of a pixel; pixels differ by up to 1, and are brought to length 1 from 0.4.
        np.testing.assert_allclose(np.array(N).T, expected, atol=2e-5)
        if i >= 7:  # as smooth mirrors have it, below the triangle too
            np.testing.assert_allclose(turned, n * np.sign((n * v).sum(1, keepdims=True)), atol=1e-6)
            continue
        pairs = [mirrored(N, g, d) for N, d in zip(expected, v, strict=True)]
        np.testing.assert_allclose(turned, [N for N, _ in pairs], atol=1e-3)  # of two grazing directions, the sum is short
        r = 2 * (turned * v).sum(1, keepdims=True) * turned - v
        np.testing.assert_allclose(r, [r for _, r in pairs], atol=2e-4)
        assert ((r @ g) * (v @ g) > -1e-4).all() and ((turned * v).sum(1) > 0).all()
        areas.append(np.mean([(2 * (N @ d) * N - d) @ g * (d @ g) < 0 for N, d in zip(expected, v, strict=True)]))
    assert 0.1 < np.mean(areas) < 0.5, "some rays have to be turned round, and some not"
    assert without_tangent(patches.reflectors[7].mesh.uv, np.array([[0, 1, 2]])).all()


# Frames


def spun(time: float) -> np.ndarray:
    """A turn about a slanted axis, and a step."""
    pose, angle = np.eye(4), 0.7 + time
    axis = unit(np.array([0.3, 0.2, 1.0]))
    cross = np.cross(np.eye(3), axis)
    pose[:3, :3] = np.eye(3) - np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    pose[:3, 3] = 0.05, 0.1, -0.02
    return pose


@pytest.mark.parametrize("shape", ["sheet", "ball"])
def test_a_frame_has_the_normals_that_float64_finds(shape):
    # Far over the edges of the map and mirrored; moved; the sheet seen at a slant and from behind as well.
    uv = SQUARE @ [[-1.5, 0.4], [0.3, 1.2]]
    mirror = sheet(ripples(1.2), uv, motion=spun) if shape == "sheet" else ball(ripples(0.8), (-3, 2), fine=24, motion=spun)
    for eye in [(0.2, -1.7, 0.25), (-0.3, 1.6, 0.4)] if shape == "sheet" else [(0.2, -1.7, 0.25)]:
        made = room(mirror, camera=still(eye))
        frame = FrameRenderer(made, *SIZE).render(1)
        own = np.array(frame.active)
        p, n, v = (np.array(a).T[own] for a in (frame.p, frame.n, frame.v))
        mesh = mirror.mesh.transformed(spun(made.time(1)))
        # Points are off by rounding: back onto the surface they go by their triangles.
        expected, directions, sure = seen(mesh, mirror.normal_map, p, np.array(eye))
        clear = sure > 1e-3
        assert clear.sum() > 700 and clear.mean() > 0.9
        # p is off by 2e-7, and a normal of the map changes by at most 1.2 * 2 pi * 3 per metre, thrice as much near the poles.
        assert np.quantile(np.abs(n - expected)[clear], 0.999) < 1e-4 and np.abs(n - expected)[clear].max() < 2e-3
        r = 2 * (n * v).sum(1, keepdims=True) * n - v
        assert np.abs(r - directions)[clear].max() < 4e-3
        plain = np.array(FrameRenderer(smooth(made), *SIZE).render(1).n).T[own]
        assert np.abs(n - plain).max(axis=1).mean() > 0.2


def test_a_flat_map_is_as_good_as_none_from_both_sides():
    for eye in ((0.2, -1.7, 0.25), (0.2, 1.7, 0.25)):
        made = room(sheet(flat()), ball(flat(), fine=16, name="other", motion=spun), camera=still(eye))
        one, other = (FrameRenderer(each, *SIZE).render(0) for each in (made, smooth(made)))
        high = np.array(dr.dot(mi.Vector3f(other.n), other.v)) > 0.35  # where no ray starts into a triangle of the coarse ball
        assert high.sum() > 2000
        np.testing.assert_allclose(np.array(one.n)[:, high], np.array(other.n)[:, high], atol=2e-6)


def test_maps_of_other_sizes_on_the_same_mirror_are_recorded_anew():
    for size in ((48, 40), (6, 9), (90, 31)):
        made = room(sheet(ripples(0.5, *size)))
        frame = FrameRenderer(made, *SIZE).render(0)
        own = np.flatnonzero(np.array(frame.active))[::97]
        p, n = (np.array(a).T[own] for a in (frame.p, frame.n))
        expected, _, sure = seen(made.reflectors[0].mesh, made.reflectors[0].normal_map, p, np.asarray(still()(0).eye))
        assert np.abs(n - expected)[sure > 1e-3].max() < 1e-3, size


# What is refused, and what tells scenes apart


def test_a_map_needs_uv_and_normals_that_point_outwards():
    bare = quad((0, 0, 0), (1, 0, 0), (0, 0, 1))
    with pytest.raises(ValueError, match=r"reflector wall: it has a normal map, and its mesh no uv; accepted: .*\[V, 2\]"):
        Reflector("wall", bare, normal_map=flat())
    inward = flat().pixels.copy()
    inward[1, 0, 2] = 0.5
    with pytest.raises(ValueError, match=r"wall: the pixel in row 1, column 0 of its normal map .*accepted: blue above 0\.5"):
        Reflector("wall", replace(bare, uv=SQUARE), normal_map=Texture(inward))


def test_a_scene_made_ready_keeps_its_maps_and_its_hash_tells_them():
    made = room(sheet(ripples(0.5)))
    assert normalised(made).reflectors[0].normal_map is made.reflectors[0].normal_map
    assert identity.of_scene(room(sheet(ripples(0.5)))) == identity.of_scene(made)
    others = [sheet(None), sheet(ripples(0.4)), sheet(ripples(0.5), 2 * SQUARE), sheet(replace(ripples(0.5), wrap="clamp"))]
    assert len({identity.of_scene(room(mirror)) for mirror in (*others, sheet(ripples(0.5)))}) == 5


# Scenes without


def test_without_a_map_nothing_is_compiled_for_it_and_uv_alone_changes_nothing():
    made = room(sheet(None), ball(None, fine=16, name="other"))
    further = RayTraced(bounces=2).prepare(made).mirrors
    assert geometry.of_scene_seen(made).normal_maps is None and further is not None and further.normal_maps is None
    bare = tuple(replace(mirror, mesh=replace(mirror.mesh, uv=None)) for mirror in made.reflectors)
    one, other = (shaded(RayTraced(bounces=2), each, 0, size=SIZE)[0] for each in (made, replace(made, reflectors=bare)))
    assert one.same(other)
    assert geometry.of_scene(room(sheet(flat()))).normal_maps is None, "what only asks for light has no use for them"
    dr.eval(one.frame)
