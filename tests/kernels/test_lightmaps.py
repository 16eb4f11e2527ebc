"""Light maps on the device: the lookup, frames, rays and references against float64 NumPy; and scenes that have none."""

from __future__ import annotations

from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest
from oracles.light_oracle import on_pieces
from oracles.ray_oracle import first_hits, reflected_hits
from support.lit_rooms import Field, cut_at_random, disc, globe, mapped, room, walls, waves
from support.mirror_room import mirror_ball, scene, shaded, still
from support.small_room import quad
from support.textured_rooms import SHEET, SQUARE, noise

from benchharness.kernels import geometry, painting
from benchharness.measure import metrics
from benchharness.modelling import lightmap, lightmesh
from benchharness.render.frame import FrameRenderer
from benchharness.render.lightmaps import _parted
from benchharness.render.reference import render
from benchharness.scene import Mesh, Object, subdivided
from methods.ray_traced import RayTraced

SIZE = WIDTH, HEIGHT = 96, 72


def at_random(mesh: Mesh, seed: int) -> tuple[Mesh, lightmesh.LightMesh, np.ndarray]:
    """A mesh with a map of grids of any size, and what they are made of."""
    made = cut_at_random(mesh, 4, seed)
    values = lightmesh.settled(made, np.random.default_rng(seed).random((len(made.columns), 3)))
    sheet, at = lightmap.sheet(made, values, 0, len(mesh.faces))
    source, faces, places = _parted(mesh, at)
    columns = {"normals": mesh.normals[source], "uv": None if mesh.uv is None else mesh.uv[source], "texture": mesh.texture}
    light = np.full(3, 0.5)
    return Mesh(mesh.vertices[source], faces, **columns, radiance=light, light=sheet, light_at=places), made, values


def test_the_kernel_shows_what_the_pieces_show():
    # Maps of several sizes in one buffer; parts without one, and with a picture above it.
    papered = subdivided(quad((0, 0, 0), (1, 0, 0), (0, 1, 0), uv=SQUARE, texture=noise()), 0.8)
    meshes = [at_random(mesh, k) for k, mesh in enumerate((quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), walls(), papered))]
    objects = [Object("plain", globe(), "no map"), *(Object(f"{k}", m[0], "a map") for k, m in enumerate(meshes))]
    made = scene(objects, (SHEET,))
    paint = painting.paint_of(made)
    assert paint is not None and paint.maps is not None
    assert np.array(paint.maps).reshape(-1, 4)[:, 1].astype(bool).tolist() == [False, True, True, True, False]
    rng, gridded = np.random.default_rng(5), 0
    for part, thing in enumerate(objects):
        for face, corners in enumerate(thing.mesh.faces[:6]):
            weights = np.concatenate([rng.dirichlet(np.ones(3), 12), np.eye(3), (1 - np.eye(3)) / 2])
            lanes, below = mi.UInt32(np.full(len(weights), part)), mi.Color3f(0.25, 0.5, 0.75)
            first = sum(len(o.mesh.vertices) for o in objects[:part])
            packet = mi.Vector4u(*(int(i) + first for i in corners), 0)
            asked = (lanes, packet, mi.Vector3f(np.float32(weights).T), mi.Bool(True))
            seen, colour = painting.lit(paint, below, *asked), painting.colour(paint, *asked)
            expected = np.tile([0.25, 0.5, 0.75], (len(weights), 1))
            if thing.mesh.light is not None and thing.mesh.light_at[corners[0], 0] >= 0:
                _, pieces, values = meshes[part - 1]
                expected, gridded = on_pieces(pieces, values, face, weights), gridded + 1
            # x is off by 8e-6 in a sheet 200 wide, and samples differ by at most 1.
            np.testing.assert_allclose(np.broadcast_to(np.array(seen).T, expected.shape), expected, atol=5e-5)
            both = np.array(painting.seen(paint, below, *asked)).T
            np.testing.assert_allclose(both, np.broadcast_to(np.array(seen * colour).T, both.shape), atol=1e-6)
    assert gridded > 6


# Pictures of them


@pytest.mark.parametrize("field", [waves, disc], ids=["waves", "disc"])
def test_frames_rays_and_references_show_the_light_where_float64_finds_it(field: Field):
    camera = still((0.4, -1.8, 1.2), (0.1, -0.4, -0.6), 60.0)
    made = room(SHEET, field, camera=camera)
    frame = FrameRenderer(made, *SIZE).render(0)
    truth = render(made, 0.0, SIZE)
    part, p, n, L, clear = first_hits(made, 0.0, *SIZE)
    seen = (part < len(made.objects)) & clear
    mirror = (part == len(made.objects)) & clear
    assert seen.sum() > 2000 and mirror.sum() > 300
    # Rounding moves a point by 2e-6 m; light changes by 1 or 20 per metre.
    assert np.abs(np.array(frame.radiance).T[seen] - L[seen]).max() < 3e-4
    flat = truth.image.reshape(-1, 3)
    assert np.abs(flat[seen] - L[seen]).max() < 1e-3
    # And that is the field: but for bends between samples, and a step of 4 cm in samples of as much.
    off = np.abs(L - field(p))[seen & (part == 0)]
    assert off.max() < 0.013 if field is waves else np.quantile(off, 0.97) < 0.05

    eye = np.asarray(made.camera(0.0).eye)
    d = (p[mirror] - eye) / np.linalg.norm(p[mirror] - eye, axis=1, keepdims=True)
    r = d - 2 * (d * n[mirror]).sum(axis=1, keepdims=True) * n[mirror]
    _, _, expected, sure = reflected_hits(made, 0.0, p[mirror], r, 0)
    [answer] = shaded(RayTraced(), made, 0, size=SIZE)
    assert sure.mean() > 0.9
    assert np.abs(answer.L.reshape(-1, 3)[mirror][sure] - expected[sure]).max() < 1e-3
    assert np.abs(flat[mirror][sure] - expected[sure]).max() < 1e-3


def test_rays_of_a_mirror_ball_agree_with_the_reference_to_the_eye():
    made = room(field=disc)
    truth = render(made, 0.0, SIZE)
    [answer] = shaded(RayTraced(), made, 0, size=SIZE)
    mask = answer.active & truth.mask
    image = np.where(mask[..., None], answer.L, truth.image)
    flip = metrics.evaluate(image, truth.image, mask, ppd=made.ppd, exposure=made.exposure)["flip"]
    assert mask.sum() > 1500 and flip is not None and flip < 0.005


def test_a_picture_lies_above_the_light_and_what_is_split_afterwards_shows_the_same():
    plain = mapped(walls(uv=SQUARE, texture=noise()), waves)
    made = scene((Object("walls", plain, "light and a picture"),), (mirror_ball(fine=24),))
    split = replace(made, objects=(replace(made.objects[0], mesh=subdivided(plain, 0.3)),))
    without = replace(made, objects=(replace(made.objects[0], mesh=replace(plain, light=None)),))
    pictures = [np.array(FrameRenderer(each, *SIZE).render(0).radiance).T for each in (made, split, without)]
    part, _, _, L, clear = first_hits(made, 0.0, *SIZE)
    seen = (part == 0) & clear
    assert np.abs(pictures[0][seen] - L[seen]).max() < 1e-3
    assert np.quantile(np.abs(pictures[1] - pictures[0])[seen], 0.99) < 1e-4
    assert np.abs(pictures[2] - pictures[0])[seen].mean() > 0.02
    for each in (made, split):
        truth = render(each, 0.0, SIZE).image.reshape(-1, 3)
        assert np.abs(truth[seen] - L[seen]).max() < 1e-3


def test_maps_of_other_sizes_on_the_same_meshes_are_recorded_anew():
    for seed in range(3):
        mesh, *_ = at_random(walls(), seed)
        made = scene((Object("walls", mesh, "light"),), (mirror_ball(fine=24),))
        part, _, _, L, clear = first_hits(made, 0.0, *SIZE)
        frame = FrameRenderer(made, *SIZE).render(0)
        seen = (part == 0) & clear
        assert np.quantile(np.abs(np.array(frame.radiance).T[seen] - L[seen]), 0.99) < 1e-3, seed


def test_without_a_map_nothing_is_compiled_for_it_and_a_place_alone_changes_nothing():
    made = room(in_maps=False, h=0.5)
    assert painting.paint_of(made) is None and geometry.of_scene(made).paint is None
    place = [replace(o, mesh=replace(o.mesh, light_at=np.zeros((len(o.mesh.vertices), 2)))) for o in made.objects]
    placed = replace(made, objects=tuple(place))
    assert painting.paint_of(placed) is None
    one, other = (shaded(RayTraced(), each, 0, size=SIZE)[0] for each in (made, placed))
    assert one.same(other)


def test_a_room_of_twelve_triangles_looks_as_one_of_thirty_thousand_with_the_same_light():
    made, many = room(), room(in_maps=False, h=0.1)
    bare = replace(made, objects=tuple(replace(o, mesh=replace(o.mesh, light=None)) for o in made.objects))
    assert len(made.objects[0].mesh.faces) == 12 and len(many.objects[0].mesh.faces) > 30_000
    pictures = [
        np.array(FrameRenderer(each, *SIZE).render(0).radiance).T.reshape(HEIGHT, WIDTH, 3) for each in (made, many, bare)
    ]
    whole = np.ones((HEIGHT, WIDTH), bool)
    flips = [metrics.evaluate(one, pictures[1], whole, ppd=made.ppd, exposure=0.0)["flip"] or 0.0 for one in pictures]
    assert flips[0] < 0.01 and flips[2] > 0.1
