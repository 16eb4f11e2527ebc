"""Light maps where light is traced: what is baked, beside finely cut meshes and full transport; and hashes of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.lit_rooms import mapped, room, walls, waves
from support.mirror_room import mirror_ball, scene, shaded
from support.small_room import box, quad
from support.textured_rooms import SHEET

from benchharness.cache import content_hash
from benchharness.measure import metrics
from benchharness.needs.coarser import coarser
from benchharness.render.bake import bake
from benchharness.render.frame import FrameRenderer
from benchharness.render.mitsuba_scene import fingerprint
from benchharness.render.ready import ready
from benchharness.render.reference import ReferenceOptions, render
from benchharness.scene import Camera, Gloss, Mesh, Object, PointLight, Scene, refined, subdivided
from benchharness.stability import altered, markers
from benchharness.study import identity
from methods.ray_traced import RayTraced


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("BENCHHARNESS_CACHE", str(tmp_path))


def lamplit(h: float | None = None, *, mirror: bool = True) -> Scene:
    """A room of twelve triangles, a lamp of two under its ceiling, a box on its floor; or with edges no longer than h."""

    def thing(name: str, mesh: Mesh) -> Object:
        return Object(name, mesh if h is None else subdivided(mesh, h), "light")

    return Scene(
        "lamplit",
        (
            thing("room", box((-3, -3, 0), (3, 3, 3), inside=True, albedo=(0.7, 0.6, 0.5))),
            thing("lamp", quad((-1.5, -1.5, 2.4), (0, 3, 0), (3, 0, 0), emission=(2.0, 2.0, 2.0))),
            thing("cube", box((0.9, -0.9, 0), (1.5, -0.3, 0.6), albedo=(0.8, 0.2, 0.1))),
        ),
        (mirror_ball(center=(0, 0, 1), fine=32),) if mirror else (),
        lambda time: Camera((0.4, -2.7, 1.6), (0.1, 0.0, 0.6), 60.0),
        1,
        lightmaps=h is None,
    )


def test_a_floor_of_two_triangles_is_lit_as_the_sky_says():
    # E = pi L, so albedo E / pi = albedo L, as in `test_bake`; there is nothing to cut but the length.
    floor = quad((0, 0, 0), (1, 0, 0), (0, 1, 0), albedo=(0.2, 0.5, 1.0))
    made = bake(scene((Object("floor", floor, "light"),), (), background=(3.0, 2.0, 0.5), lightmaps=True), spp=256)
    mesh = made.objects[0].mesh
    assert mesh.light is not None and len(mesh.faces) == 2 and len(mesh.vertices) == 6
    seen = mesh.light.looked_up(np.random.default_rng(0).dirichlet(np.ones(3), 100) @ mesh.light_at[mesh.faces[1]])
    np.testing.assert_allclose(seen, np.tile([0.6, 1.0, 0.5], (100, 1)), rtol=0.02)
    np.testing.assert_allclose(mesh.radiance, np.tile([0.6, 1.0, 0.5], (6, 1)), rtol=0.02)


def test_a_room_of_twelve_triangles_is_lit_as_a_finely_cut_one():
    # Light straight from the lamp, and no mirror, whose caustics are noise. What is left of it is 1 %, another one in each.
    coarse, fine = (bake(lamplit(h, mirror=False), spp=64, max_depth=1) for h in (None, 0.2))
    assert sum(len(o.mesh.faces) for o in coarse.objects) == 26 < 20_000 < sum(len(o.mesh.faces) for o in fine.objects)
    size = (120, 90)
    one, other = (np.array(FrameRenderer(each, *size).render(0).radiance).T.reshape(90, 120, 3) for each in (coarse, fine))
    whole = np.ones(one.shape[:2], bool)
    found = metrics.evaluate(one, other, whole, ppd=coarse.ppd, exposure=coarse.exposure)
    assert found["flip"] is not None and found["flip"] < 0.04
    # Light at its twelve triangles' vertices is none of it.
    bare = replace(coarse, objects=tuple(replace(o, mesh=replace(o.mesh, light=None)) for o in coarse.objects))
    plain = np.array(FrameRenderer(bare, *size).render(0).radiance).T.reshape(90, 120, 3)
    without = metrics.evaluate(plain, other, whole, ppd=coarse.ppd, exposure=coarse.exposure)["flip"]
    assert without is not None and without > 0.1


def test_a_mirror_shows_of_it_what_the_reference_does_which_finds_the_samples_by_itself():
    made, size = bake(lamplit(), spp=16), (120, 90)
    truth = render(made, 0.0, size)
    [answer] = shaded(RayTraced(), made, 0, size=size)
    mask = answer.active & truth.mask
    image = np.where(mask[..., None], answer.L, truth.image)
    flip = metrics.evaluate(image, truth.image, mask, ppd=made.ppd, exposure=made.exposure)["flip"]
    assert mask.sum() > 500 and flip is not None and flip < 0.005


def test_the_shadow_beside_a_box_ends_where_full_transport_has_it_end():
    # A box that stands on a floor of two triangles, under a lamp that is aside: the shadow's edge is seen from above.
    floor = quad((-2, -2, 0), (4, 0, 0), (0, 4, 0), albedo=(0.6, 0.6, 0.6))
    lamp = quad((-1.6, -0.1, 1.5), (0, 0.2, 0), (0.2, 0, 0), emission=(40.0, 40.0, 40.0))
    stone = box((-0.2, -0.6, 0), (0.2, 0.6, 0.4), albedo=(0.0, 0.0, 0.0))
    things = [Object(name, mesh, "light") for name, mesh in (("floor", floor), ("lamp", lamp), ("stone", stone))]
    above = Camera((0.5, 0.0, 3.0), (0.5, 0.0, 0.0), 30.0, (0.0, 1.0, 0.0))
    made = scene(things, (), lambda time: above, lightmaps=True)
    size = (128, 32)
    baked = bake(made, spp=128)
    light, truth = (
        render(each, 0.0, size, options).image[14:18].mean(axis=(0, 2))
        for each, options in (
            (baked, ReferenceOptions("baked", "box", 64)),
            (made, ReferenceOptions("transport", "box", 256, 6)),
        )
    )
    # A pixel is 2 * 3 tan(15 deg) / 32 = 5 cm of the floor.
    per_pixel = 6 * np.tan(np.radians(15)) / size[1]
    x = 0.5 + per_pixel * (np.arange(size[0]) + 0.5 - size[0] / 2)
    beside = (x > 0.25) & (x < 1.8)
    assert truth[beside].min() < 0.1 * truth[beside].max()

    def edge(values: np.ndarray) -> float:
        values, there = values[beside], x[beside]
        level = 0.5 * (values.min() + values.max())
        k = int(np.argmax(values > level))
        return float(np.interp(level, values[k - 1 : k + 1], there[k - 1 : k + 1]))

    places = baked.objects[0].mesh.light_at[baked.objects[0].mesh.faces[0]]
    parts = np.abs(places[1] - places[0]).max()
    assert parts >= 128 and abs(edge(light) - edge(truth)) < 2 * 4 * np.sqrt(2) / parts
    assert np.abs(light - truth)[beside].mean() < 0.03 * truth[beside].max()
    dark = (x > 0.21) & (x < 0.3)  # at the stone's foot
    assert light[dark].max() < 0.1 * truth[beside].max()


def test_highlights_keep_their_light_s_visibility():
    stone = box((-0.5, -0.5, 0), (0.5, 0.5, 0.6))
    floor = Object("floor", quad((-2, -2, 0), (4, 0, 0), (0, 4, 0)), "gloss", gloss=Gloss((0.2, 0.2, 0.2), 20.0))
    made = scene((Object("stone", stone, "shadow"), floor), (), lights=(PointLight((0, 0, 3), (9, 9, 9)),), lightmaps=True)
    one, other = (bake(replace(made, lightmaps=maps), spp=64).objects[1].mesh for maps in (True, False))
    assert len(one.vertices) == 6 and len(other.vertices) == 4
    for place, share in zip(one.vertices, one.visibility, strict=True):
        assert share == other.visibility[(other.vertices == place).all(axis=1)]


def test_what_is_ready_stays_as_it_is_and_moves_with_the_scene():
    far = lamplit()
    moved = ready(replace(far, h_max=0.7), 16)
    assert moved.objects[0].mesh.light is not None and moved.h_max is None and len(moved.objects[0].mesh.faces) > 500
    again = ready(moved, 16)
    assert all(one.mesh is other.mesh for one, other in zip(moved.objects, again.objects, strict=True))
    # Shifted by its pose or by its vertices, light is the same: it is found in the normalised scene.
    shift = [Object(o.name, replace(o.mesh, vertices=o.mesh.vertices + 5.0), "light") for o in far.objects]
    mirror = replace(far.reflectors[0], mesh=replace(far.reflectors[0].mesh, vertices=far.reflectors[0].mesh.vertices + 5.0))
    other = bake(replace(far, objects=tuple(shift), reflectors=(mirror,)), spp=16)
    here = bake(far, spp=16)
    np.testing.assert_allclose(other.objects[0].mesh.radiance, here.objects[0].mesh.radiance, atol=0.02)


def test_hashes_tell_maps_apart_and_references_are_made_anew():
    made = room(SHEET)
    paper, ball = made.objects

    def other(**changes) -> Scene:
        return replace(made, objects=(replace(paper, mesh=replace(paper.mesh, **changes)), ball))

    darker = replace(paper.mesh.light, samples=0.5 * paper.mesh.light.samples)
    same = other(light=replace(paper.mesh.light, samples=paper.mesh.light.samples.copy()))
    others = [other(light=None), other(light=darker), other(light_at=paper.mesh.light_at[::-1])]
    scenes = (made, *others)
    assert identity.of_scene(same) == identity.of_scene(made) and len({identity.of_scene(each) for each in scenes}) == 4
    assert identity.of_scene(replace(made, lightmaps=True)) != identity.of_scene(made)
    hashes = {content_hash(fingerprint(each, 0.0, "baked")) for each in scenes}
    assert len(hashes) == 4 and content_hash(fingerprint(same, 0.0, "baked")) in hashes
    assert len({content_hash(fingerprint(each, 0.0, "transport")) for each in scenes}) == 1
    assert len({render(each, 0.0, (24, 18)).image.tobytes() for each in scenes}) == 4


def test_a_scene_in_another_order_shows_the_same_light_and_markers_none():
    made = room()
    mixed = altered.renumbered(made, seed=3)[0]
    [one], [two] = (shaded(RayTraced(), each, 0, size=(64, 48)) for each in (made, mixed))
    assert np.quantile(np.abs(one.L - two.L).max(axis=2)[one.active], 0.99) < 1e-4
    assert all(o.mesh.light is None for o in markers.dark(made, [np.ones(3), np.zeros(3)]).objects)


def test_a_coarser_mesh_has_the_light_of_the_map_at_its_vertices():
    fine = mapped(subdivided(walls(), 1.0), waves)
    coarse = coarser(fine, 0.3)
    assert coarse is not None and coarse.light is None and coarse.light_at is None
    assert len(coarse.faces) <= 0.3 * len(fine.faces)
    # Corners are looked up 2 % of the way to their triangles' middles: 6 cm at most, over which waves change by 1 a metre.
    assert np.abs(coarse.radiance - waves(coarse.vertices)).max() < 0.1
    assert refined(replace(room(), h_max=1.0)).objects[0].mesh.light is not None
