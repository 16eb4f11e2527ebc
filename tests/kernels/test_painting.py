"""Textures on the device: the lookup, frames, rays and references against float64 NumPy; and scenes that have none."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from oracles.ray_oracle import first_hits, rays, reflected_hits
from oracles.texture_oracle import looked_up
from support.mirror_room import mirror_ball, mirror_room, scene, shaded, still
from support.small_room import quad
from support.textured_rooms import SHEET, SQUARE, globe, noise, room, untextured, wavy
from support.tiers import first

from benchharness.kernels import geometry, painting
from benchharness.kernels.vertices import textures, virtual
from benchharness.measure import metrics
from benchharness.render.frame import FrameRenderer
from benchharness.render.reference import render
from benchharness.scene import Gloss, Object, PointLight, Reflector, Scene, Texture
from methods.depth_impostor import DepthImpostor
from methods.environment_map import EnvironmentMap
from methods.newton import Newton
from methods.ray_traced import RayTraced

SIZE = WIDTH, HEIGHT = 96, 72
WAYS = ("repeat", "mirror", "clamp")
TURNED = np.array([[1.3, -0.4], [1.2, 0.9], [-0.6, 1.1], [-0.5, -0.2]])  # over the edges of the picture, askew
PAIRS = [("repeat", "repeat"), ("mirror", "clamp"), ("clamp", "mirror")]


def papered(wrap, width: int = 12, height: int = 9) -> Scene:
    """A globe, and walls whose picture goes on beyond its edges, before a mirror of two triangles."""
    return room(noise(width, height, wrap), noise(9, 7, ("repeat", "clamp"), 1), SHEET, TURNED)


def triangle_of(uv: np.ndarray, texture: Texture | None) -> Object:
    mesh = quad((0, 0, 0), (1, 0, 0), (0, 1, 0), uv=uv, texture=texture, radiance=(1, 1, 1))
    return Object("quad", mesh, "a picture")


# The lookup


@pytest.mark.parametrize(("along_u", "along_v"), list(product(WAYS, WAYS)))
def test_the_kernel_is_the_oracle_beyond_all_edges(along_u, along_v):
    # Several pictures of unlike sizes in one buffer, and a part without between them.
    sizes = [(1, 1), (1, 5), (7, 1), None, (3, 2), (16, 9)]
    textures = [None if size is None else noise(*size, (along_u, along_v), k) for k, size in enumerate(sizes)]
    rng = np.random.default_rng(4)
    places = [np.concatenate([rng.uniform(-3, 4, (2, 2)), rng.integers(-2, 3, (2, 2)) * 0.5]) for _ in sizes]
    made = scene([triangle_of(uv, texture) for uv, texture in zip(places, textures, strict=True)], (SHEET,))
    paint, count = painting.paint_of(made), 40
    assert paint is not None
    for part, (uv, texture) in enumerate(zip(places, textures, strict=True)):
        weights = np.concatenate([rng.dirichlet(np.ones(3), count), np.eye(3)])
        face = mi.Vector4u(4 * part, 4 * part + 1, 4 * part + 2, 0)
        lanes = mi.UInt32(np.full(len(weights), part))
        colour = painting.colour(paint, lanes, face, mi.Vector3f(np.float32(weights).T), mi.Bool(True))
        expected = np.ones((len(weights), 3))
        if texture is not None:
            expected = looked_up(texture.pixels, texture.along, weights @ uv[:3])
        # u is off by 3e-7 in float32, and a picture 16 wide changes by at most 1 in a sixteenth.
        np.testing.assert_allclose(np.array(colour).T, expected, atol=2e-5)


def test_a_mirror_is_not_looked_up_in_a_picture():
    made = scene((triangle_of(SQUARE, noise()),), (replace(SHEET, mesh=globe(noise())),))
    paint = painting.paint_of(made)
    assert paint is not None
    assert np.array(paint.windows).reshape(-1, 4)[:, 1].tolist() == [12, 0]


def test_one_picture_on_many_meshes_is_there_once():
    one, other = noise(), noise(seed=1)
    made = scene([triangle_of(SQUARE, texture) for texture in (one, other, one)], (SHEET,))
    paint = painting.paint_of(made)
    assert paint is not None
    assert paint.count == 2 * 12 * 9 and np.array(paint.windows).reshape(-1, 4)[:, 0].tolist() == [0, 108, 0, 0]


# Pictures of them


@pytest.mark.parametrize("wrap", first(PAIRS, [("mirror", "clamp")]))
def test_frames_rays_and_references_show_the_picture_where_float64_finds_it(wrap):
    made = papered(wrap)
    frame = FrameRenderer(made, *SIZE).render(0)
    truth = render(made, 0.0, SIZE)
    part, p, n, L, clear = first_hits(made, 0.0, *SIZE)
    seen = (part < len(made.objects)) & clear
    mirror = (part == len(made.objects)) & clear
    assert seen.sum() > 2000 and mirror.sum() > 800
    # u is off by 1e-6 in float32, and in a picture 12 wide whose pixels are unlike that changes 2e-5.
    assert np.abs(np.array(frame.radiance).T[seen] - L[seen]).max() < 5e-4
    flat = truth.image.reshape(-1, 3)
    assert np.abs(flat[seen] - L[seen]).max() < 1e-3

    eye = np.asarray(made.camera(0.0).eye)
    d = (p[mirror] - eye) / np.linalg.norm(p[mirror] - eye, axis=1, keepdims=True)
    r = d - 2 * (d * n[mirror]).sum(axis=1, keepdims=True) * n[mirror]
    _, _, expected, sure = reflected_hits(made, 0.0, p[mirror], r, 0)
    [answer] = shaded(RayTraced(), made, 0, size=SIZE)
    assert sure.mean() > 0.95
    assert np.abs(answer.L.reshape(-1, 3)[mirror][sure] - expected[sure]).max() < 1e-3
    assert np.abs(flat[mirror][sure] - expected[sure]).max() < 1e-3
    # And the picture is what is seen: without it, everything would be another.
    [plain] = shaded(RayTraced(), untextured(made), 0, size=SIZE)
    assert np.abs(plain.L.reshape(-1, 3)[mirror][sure] - expected[sure]).mean() > 0.1


def test_rays_of_a_mirror_ball_agree_with_the_reference_to_the_eye():
    made = room(noise(16, 16, "mirror"), noise(32, 16, seed=1), uv=2 * SQUARE)
    truth = render(made, 0.0, SIZE)
    [answer] = shaded(RayTraced(), made, 0, size=SIZE)
    mask = answer.active & truth.mask
    image = np.where(mask[..., None], answer.L, truth.image)
    found = metrics.evaluate(image, truth.image, mask, ppd=made.ppd, exposure=made.exposure)
    assert mask.sum() > 1500 and found["flip"] is not None
    assert found["flip"] < 0.005


def test_pictures_of_other_sizes_on_the_same_meshes_are_recorded_anew():
    # Same vertices, same triangles, same pixels: what differs is the buffer's length.
    for size in ((12, 9), (64, 50), (5, 3)):
        [answer] = shaded(RayTraced(), papered("repeat", *size), 0, size=SIZE)
        part, _, _, L, clear = first_hits(papered("repeat", *size), 0.0, *SIZE)
        seen = (part < 2) & clear
        assert np.abs(np.array(answer.frame.radiance).T[seen] - L[seen]).max() < 3e-3, size


def test_a_highlight_lies_above_the_picture():
    gloss, lamp = Gloss((0.3, 0.3, 0.3), 30.0), PointLight((-0.9, 0.6, 1.5), (6.0, 6.0, 6.0))
    dark = Texture(np.zeros((2, 2, 3)))

    def lit(texture: Texture) -> Scene:
        mesh = globe(texture, slices=48)
        mesh = replace(mesh, visibility=np.ones((len(mesh.vertices), 1)))
        return scene((Object("globe", mesh, "a highlight", gloss=gloss),), (mirror_ball(fine=64),), lights=(lamp,))

    made = lit(noise(8, 8))
    truth = render(made, 0.0, SIZE)
    for method in (RayTraced(), DepthImpostor(), EnvironmentMap(), Newton()):
        bright, black = (shaded(method, lit(texture), 0, size=SIZE)[0] for texture in (noise(8, 8), dark))
        assert black.L.max() > 0.2 and (bright.L >= black.L - 1e-5).all(), method
        assert (bright.L - black.L).max() > 0.3, method
        if isinstance(method, RayTraced):
            off = np.abs(bright.L - truth.image)[bright.active & truth.mask]
            assert np.quantile(off, 0.98) < 1e-3  # but for pixels on the globe's outline


def test_where_a_triangle_is_cut_its_picture_ends_with_it():
    # A floor of two triangles that goes through a plane mirror.
    sheet = Reflector("sheet", quad((-1, 0, -0.8), (2, 0, 0), (0, 0, 1.6)))
    texture, eye = wavy(), np.array([0.3, -3.0, 0.6])
    floor = quad((-0.8, -2.5, -0.5), (1.6, 0, 0), (0, 3.0, 0), uv=SQUARE, texture=texture, radiance=(0.9, 0.9, 0.9))
    made = scene((Object("floor", floor, "a mirror's foot"),), (sheet,), still(tuple(eye), (0, 0, 0), 40.0))
    frame = FrameRenderer(replace(made, objects=()), *SIZE).render(0)
    triangles, V = geometry.of_scene(made), floor.vertices
    image, front = V * [1, -1, 1], V[:, 1] < 0
    R = np.where(front[:, None], eye - eye[1] / (image - eye)[:, 1:2] * (image - eye), V)
    kind = np.where(front, virtual.REFLECTED, virtual.HIDDEN)
    rest = np.zeros((triangles.vertex_count - len(V), 4))
    packets = [np.concatenate([np.column_stack([a, b]), rest]) for a, b in ((image, kind), (R, 0 * kind))]
    images = virtual.Images(*(mi.Float(np.float32(packet).ravel()) for packet in packets))
    window = textures.window(frame.view, frame.boxes[0], 1.0)
    hider = textures.render(frame.proxies[0], frame.poses, dr.opaque(mi.UInt32, 0), window.view)
    target = virtual.Target(frame.view, frame.p, frame.reflector == 0)
    shown = virtual.nearest(images, triangles, dr.opaque(mi.UInt32, 1), target, virtual.Drawing("cut"), hider)
    drawn = virtual.interpolated(shown, target, "perspective")
    L, covered = np.array(drawn.L).T, np.array(drawn.covered)
    d = rays(made.camera(0.0), *SIZE)[covered]
    p = eye - (eye[1] / d[:, 1])[:, None] * d
    hit = p + ((-0.5 - p[:, 2]) / d[:, 2])[:, None] * d * [1, -1, 1]
    expected = 0.9 * looked_up(texture.pixels, texture.along, (hit[:, :2] - V[0, :2]) / [1.6, 3.0])
    assert covered.sum() > 350 and expected.std() > 0.15
    # An edge is cut up to 3 mm behind the mirror (ten halvings of 3 m): a thousandth of the picture, whose slope is at most 6.
    assert np.abs(L[covered] - expected).max() < 0.01


# Scenes without


def test_without_a_texture_nothing_is_compiled_for_it_and_uv_alone_changes_nothing():
    made = mirror_room()
    assert painting.paint_of(made) is None and geometry.of_scene(made).paint is None
    placed = replace(made, objects=tuple(replace(o, mesh=replace(o.mesh, uv=o.mesh.vertices[:, :2])) for o in made.objects))
    assert painting.paint_of(placed) is None
    one, other = (shaded(RayTraced(), each, 0, size=SIZE)[0] for each in (made, placed))
    assert one.same(other)


def test_a_white_picture_is_as_good_as_none():
    white = Texture(np.ones((3, 4, 3)), ("repeat", "mirror"))
    made = room(white, white, uv=TURNED)
    for method in (RayTraced(), Newton(), EnvironmentMap()):
        one, other = (shaded(method, each, 0, size=SIZE)[0] for each in (made, untextured(made)))
        np.testing.assert_allclose(one.L, other.L, atol=1e-6)
    np.testing.assert_allclose(render(made, 0.0, SIZE).image, render(untextured(made), 0.0, SIZE).image, atol=1e-6)
