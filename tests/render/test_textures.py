"""Textures where light is traced: what is baked, what bleeds, full transport, and hashes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from oracles.ray_oracle import first_hits
from support.mirror_room import mirror_ball, scene, shaded, still
from support.small_room import quad, sphere
from support.textured_rooms import SHEET, SQUARE, globe, noise, room

from benchharness.cache import content_hash
from benchharness.kernels.vertices import levels
from benchharness.needs.coarser import coarser
from benchharness.render.bake import bake
from benchharness.render.mitsuba_scene import fingerprint
from benchharness.render.reference import ReferenceOptions, render
from benchharness.scene import Gloss, Object, Scene, Texture, subdivided
from benchharness.stability import altered, markers
from benchharness.study import identity
from methods.ray_traced import RayTraced

PINK = np.array([0.75, 0.25, 0.5])
TRANSPORT = ReferenceOptions(lighting="transport", max_depth=4, spp=64)


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("BENCHHARNESS_CACHE", str(tmp_path))


def corner(texture: Texture | None, albedo, gloss: Gloss | None = None) -> Scene:
    """A white floor under the sky, and a wall beside it that has a colour, or a picture."""
    floor = subdivided(quad((-1, -1, 0), (2, 0, 0), (0, 2, 0), albedo=(0.8, 0.8, 0.8)), 0.5)
    wall = quad((-1, 1, 0), (2, 0, 0), (0, 0, 2), uv=SQUARE, texture=texture, albedo=albedo)
    objects = Object("floor", floor, "light from the wall"), Object("wall", subdivided(wall, 0.5), "a colour", gloss=gloss)
    mirror = replace(mirror_ball(fine=24), mesh=sphere(0.3, (0, -0.4, 0.4), slices=24, stacks=12))
    return scene(objects, (mirror,), still((0.3, -3.0, 1.5), (0, 0.5, 0.5)), background=(1.0, 1.0, 1.0))


@pytest.mark.parametrize("gloss", [None, Gloss((0.1, 0.1, 0.1), 20.0)], ids=["matt", "glossy"])
def test_a_picture_of_one_colour_is_an_albedo(gloss):
    plain = Texture(np.broadcast_to(PINK, (3, 4, 3)), "clamp")
    painted, coloured = corner(plain, (0.9, 0.8, 0.6), gloss), corner(None, PINK * (0.9, 0.8, 0.6), gloss)
    one, other = (bake(made, spp=64) for made in (painted, coloured))
    floors, walls = zip(*([o.mesh.radiance for o in made.objects] for made in (one, other)), strict=True)
    # What the wall sends to the floor is coloured; what is kept of the wall itself is not.
    np.testing.assert_allclose(floors[0], floors[1], atol=1e-5)
    np.testing.assert_allclose(walls[0] * PINK, walls[1], atol=1e-5)
    assert (floors[0][:, 0] - floors[0][:, 1]).max() > 0.03  # and it does bleed
    pictures = [render(made, 0.0, (48, 36), TRANSPORT).image for made in (painted, coloured)]
    np.testing.assert_allclose(*pictures, atol=2e-4)
    np.testing.assert_allclose(*(render(made, 0.0, (48, 36)).image for made in (one, other)), atol=1e-4)


def test_light_that_is_traced_sees_the_picture_where_it_is_seen():
    # A sheet alone under a white sky sends back its albedo, point by point.
    picture = noise(4, 3, ("mirror", "repeat"))
    sheet = quad((-1, 0, -1), (2, 0, 0), (0, 0, 2), uv=1.3 * SQUARE - 0.2, texture=picture, albedo=(1, 0.5, 1))
    made = scene((Object("sheet", sheet, "a picture"),), (), still((0.1, -4.0, 0.2), fov_deg=40), background=(1.0, 1.0, 1.0))
    part, *_, L, clear = first_hits(bake(made, spp=256), 0.0, 48, 36)
    image = render(made, 0.0, (48, 36), replace(TRANSPORT, spp=256)).image.reshape(-1, 3)
    seen = (part == 0) & clear
    assert seen.sum() > 500 and L[seen].std() > 0.15
    baked = np.asarray(bake(made, spp=256).objects[0].mesh.radiance)
    np.testing.assert_allclose(baked, np.tile([1, 0.5, 1], (4, 1)), atol=0.02)
    assert np.abs(image[seen] - L[seen]).mean() < 0.02


def test_hashes_tell_pictures_apart_and_references_are_made_anew():
    made = room(noise(), noise(seed=1), SHEET)
    paper, ball = made.objects

    def other(**changes) -> Scene:
        return replace(made, objects=(replace(paper, mesh=replace(paper.mesh, **changes)), ball))

    same = other(texture=Texture(noise().pixels.copy()))
    others = [
        other(texture=None),
        other(texture=noise(seed=2)),
        other(texture=noise(wrap=("repeat", "clamp"))),
        other(texture=noise(wrap=("clamp", "repeat"))),
        other(uv=1 - np.asarray(paper.mesh.uv)),
    ]
    scenes = (made, *others)
    assert identity.of_scene(same) == identity.of_scene(made) and len({identity.of_scene(each) for each in scenes}) == 6
    for lighting in ("baked", "transport"):
        hashes = {content_hash(fingerprint(each, 0.0, lighting)) for each in scenes}
        assert len(hashes) == 6 and content_hash(fingerprint(same, 0.0, lighting)) in hashes
    assert len({render(each, 0.0, (24, 18)).image.tobytes() for each in (made, others[0], others[1], others[4])}) == 4


def test_a_scene_in_another_order_shows_the_same_pictures_and_markers_none():
    made = room(noise(), noise(seed=1))
    mixed = altered.renumbered(made, seed=3)[0]
    [one], [two] = (shaded(RayTraced(), each, 0, size=(64, 48)) for each in (made, mixed))
    assert np.quantile(np.abs(one.L - two.L).max(axis=2)[one.active], 0.99) < 1e-4
    dark = markers.dark(made, [np.ones(3), np.zeros(3)])
    assert all(o.mesh.texture is None for o in dark.objects)


def test_a_coarser_globe_has_its_picture_around_it_without_a_smear():
    fine = globe(noise(), slices=64)
    coarse = coarser(fine, 0.2)
    assert coarse is not None and coarse.texture is fine.texture and coarse.uv is not None
    # Across the seam and elsewhere, the middle of a triangle shows about what the globe shows there; but at the poles.
    middles = coarse.vertices[coarse.faces].mean(axis=1)
    face, weights = levels.nearest(fine.vertices, fine.faces, middles)
    expected = np.einsum("nk,nkc->nc", weights, np.asarray(fine.uv)[fine.faces[face]])
    off = coarse.uv[coarse.faces].mean(axis=1) - expected
    off -= np.round(off) * [1, 0]
    between = np.abs(expected[:, 1] - 0.5) < 0.35
    assert between.sum() > 50 and np.abs(off[between]).max() < 0.05
