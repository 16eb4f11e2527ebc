"""Highlights: the kernel against an oracle, their places in mirrors against Mitsuba, and scenes that have none."""

from __future__ import annotations

from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from oracles.ray_oracle import rays
from support.mirror_room import ball, mirror_ball, mirror_room, scene, shaded, still
from support.small_room import quad, sphere
from support.truth_shapes import unit

from benchharness.cache import content_hash
from benchharness.kernels import geometry, lighting
from benchharness.kernels.vertices import textures, virtual
from benchharness.measure import metrics
from benchharness.render.bake import bake
from benchharness.render.frame import FrameRenderer
from benchharness.render.mitsuba_gloss import bsdf
from benchharness.render.mitsuba_scene import fingerprint
from benchharness.render.reference import ReferenceOptions, render
from benchharness.scene import Gloss, Mesh, Object, PointLight, Reflector, Scene, subdivided
from benchharness.study import identity
from methods.environment_map import EnvironmentMap
from methods.image_space_search import ImageSpaceSearch
from methods.ray_traced import RayTraced

SIZE = WIDTH, HEIGHT = 200, 150
MIRROR, RADIUS = np.zeros(3), 0.5
BALL, SMALL = np.array([0.62, -0.62, 0.05]), 0.3
LAMP = PointLight((-1.2, -0.5, 1.5), (6.0, 5.0, 4.0))
GLOSS = Gloss((0.3, 0.2, 0.1), 80.0)
CAMERA = still((0.2, -2.4, 0.3), (0.25, -0.1, 0.0), 30.0)
METHODS = {"image_space_search": ImageSpaceSearch(), "ray_traced": RayTraced(), "environment_map": EnvironmentMap(512)}


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("BENCHHARNESS_CACHE", str(tmp_path))


def oracle(V, n, wo, lights, visible, gloss: Gloss) -> np.ndarray:
    """Radiance of the highlights at V [N, 3] towards wo [N, 3], float64 [N, 3]."""
    total = np.zeros_like(V)
    for i, light in enumerate(lights):
        for lane in range(len(V)):
            to_light = np.subtract(light.position, V[lane])
            wi = unit(to_light)
            if n[lane] @ wi <= 0 or n[lane] @ wo[lane] <= 0:
                continue
            e, k = gloss.exponent, np.asarray(gloss.specular)
            f = k * (e + 8) / (8 * np.pi) * max(n[lane] @ unit(wi + wo[lane]), 0.0) ** e
            total[lane] += f * (n[lane] @ wi) * visible[lane, i] * np.asarray(light.intensity) / (to_light @ to_light)
    return total


def dark(mesh: Mesh, lights: int = 1) -> Mesh:
    """Sends back nothing but highlights; sees all lights."""
    return replace(mesh, radiance=np.zeros(3), visibility=np.ones((len(mesh.vertices), lights)), albedo=np.zeros(3))


def beside_a_mirror() -> Scene:
    """A black glossy ball beside a mirror ball, under one point light."""
    thing = Object("ball", dark(sphere(SMALL, BALL, slices=96, stacks=48)), shows="a highlight", gloss=GLOSS)
    return scene((thing,), (mirror_ball(fine=128),), CAMERA, lights=(LAMP,))


def centroid(L: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Column and row of what is brighter than half the brightest inside `where`, weighted by how much."""
    light = np.where(where, L.mean(axis=2), 0)
    weight = np.maximum(light - 0.5 * light.max(), 0)
    rows, columns = np.indices(light.shape)
    return np.array([(weight * columns).sum(), (weight * rows).sum()]) / weight.sum()


# The kernel


def test_the_oracle_is_right_for_a_light_straight_above():
    # n = wi = wo = h: L = k (e + 8) / (8 pi) I / d² with e = 8, d = 2: 0.5 * 16 / (8 pi) * 12 / 4 = 3 / pi.
    up = np.array([[0.0, 0.0, 1.0]])
    lamp = PointLight((0, 0, 2), (12, 0, 24))
    L = oracle(np.zeros((1, 3)), up, up, [lamp], np.ones((1, 1)), Gloss((0.5, 0.5, 0.25), 8.0))
    np.testing.assert_allclose(L, [[3 / np.pi, 0, 3 / np.pi]])


@pytest.mark.parametrize("exponent", [1.0, 40.0, 2000.0])
def test_the_kernel_is_the_oracle(exponent):
    rng = np.random.default_rng(3)
    V, n = rng.normal(size=(400, 3)), unit(rng.normal(size=(400, 3)))
    lights = [PointLight((0.5, -3, 2), (3, 2, 1)), LAMP, PointLight((1, 1, -4), (9, 9, 9))]
    # Half of the viewers near the mirror direction of the first light, so that sharp lobes are met.
    wi = unit(np.array(lights[0].position) - V)
    near = 2 * (wi * n).sum(1)[:, None] * n - wi
    wo = unit(np.where(np.arange(400)[:, None] % 2, near + 0.02 * rng.normal(size=V.shape), rng.normal(size=V.shape)))
    visible, gloss = rng.random((400, 4)), Gloss((1.0, 0.5, 0.0), exponent)
    expected = oracle(V, n, wo, lights, visible, gloss)

    def on(kind, values):
        return kind(np.float32(values).T)

    made = [lighting.Light(mi.Point3f(*lamp.position), mi.Color3f(*lamp.intensity)) for lamp in lights]
    packet = mi.Vector4f(*(float(k * (exponent + 8) / (8 * np.pi)) for k in gloss.specular), exponent)
    L = lighting.highlight(made, on(mi.Point3f, V), on(mi.Vector3f, n), on(mi.Vector3f, wo), on(mi.Vector4f, visible), packet)
    assert (expected.max(axis=1) > 0.1).sum() > 40 and (expected == 0).all(axis=1).sum() > 40
    # n.h is off by 1e-7, its power by the exponent times that; the cosine of a grazing light by 1e-7 absolutely.
    np.testing.assert_allclose(np.array(L).T, expected, rtol=5e-4, atol=1e-5)


def test_a_point_on_the_light_and_a_normal_of_no_length_give_numbers():
    lamp = [lighting.Light(mi.Point3f(0, 0, 0), mi.Color3f(1))]
    for n in (mi.Vector3f(0, 0, 1), mi.Vector3f(dr.nan)):
        L = lighting.highlight(lamp, mi.Point3f(0), n, mi.Vector3f(0, 0, 1), mi.Vector4f(1), mi.Vector4f(1, 1, 1, 9))
        assert np.isfinite(np.array(L)).all()


# Where highlights are


def test_a_highlight_in_a_mirror_is_the_one_that_the_mirror_sees(tmp_path):
    made = beside_a_mirror()
    truth = render(made, 0.0, SIZE)
    assert truth.variance.max() == 0
    renderer = FrameRenderer(made, *SIZE)
    answers = {name: shaded(method, made, 0, size=SIZE, renderer=renderer)[0] for name, method in METHODS.items()}
    metrics.save_png(tmp_path / "reference.png", metrics.tonemap(truth.image, 0.0))
    for name, answer in answers.items():
        metrics.save_png(tmp_path / f"{name}.png", metrics.tonemap(answer.L, 0.0))
    print("pictures:", tmp_path)
    both = truth.mask & answers["ray_traced"].active
    place, peak = centroid(truth.image, both), truth.image[both].max()
    for name in ("image_space_search", "ray_traced"):
        assert np.abs(centroid(answers[name].L, both) - place).max() < 0.5, name
        assert answers[name].L[both].max() == pytest.approx(peak, rel=0.05), name
    # An environment map shows the ball where, and shaded as, the mirror's centre sees it.
    assert np.linalg.norm(centroid(answers["environment_map"].L, both) - place) > 5

    # Spheres in closed form: shaded from the reflection point the highlight is there, shaded from the eye it is not.
    eye, d = np.array(CAMERA(0.0).eye), unit(rays(CAMERA(0.0), *SIZE))
    p = eye + met(eye, d, MIRROR, RADIUS)[:, None] * d
    n = unit(p)
    r = d - 2 * (d * n).sum(1)[:, None] * n
    V = p + met(p, r, BALL, SMALL)[:, None] * r
    hit = np.isfinite(V).all(axis=1) & both.ravel()
    for viewer, low, high in ((p, 0, 1), (np.broadcast_to(eye, p.shape), 6, np.inf)):
        L = np.zeros_like(V)
        N = unit(V[hit] - BALL)
        L[hit] = oracle(V[hit], N, unit(viewer[hit] - V[hit]), [LAMP], np.ones((hit.sum(), 1)), GLOSS)
        off = np.linalg.norm(centroid(L.reshape(HEIGHT, WIDTH, 3), both) - place)
        assert low <= off < high


def met(o, d, centre, radius) -> np.ndarray:
    """Distance along unit d [N, 3] from o to a sphere; NaN for a miss."""
    to = o - centre
    b, c = (to * d).sum(-1), (to**2).sum(-1) - radius**2
    with np.errstate(invalid="ignore"):
        t = -b - np.sqrt(b**2 - c)
    return np.where(t > 0, t, np.nan)


def test_a_highlight_seen_directly_is_mitsubas_pixel_by_pixel():
    made = beside_a_mirror()
    second = PointLight((1.5, -2.5, -0.2), (1, 2, 3))
    half = np.linspace(0, 1, len(made.objects[0].mesh.vertices))
    mesh = replace(made.objects[0].mesh, visibility=np.stack([half, 1 - half], axis=1), radiance=(0.1, 0.2, 0.3))
    made = replace(made, objects=(replace(made.objects[0], mesh=mesh),), lights=(LAMP, second))
    truth = render(made, 0.0, SIZE)
    frame = FrameRenderer(made, *SIZE).render(0)
    L = np.array(frame.radiance).T.reshape(HEIGHT, WIDTH, 3)
    off = ~truth.mask & ~np.array(frame.active).reshape(HEIGHT, WIDTH)
    assert truth.image[off].max() > 0.4
    difference = np.abs(L - truth.image).max(axis=2)[off]
    assert (difference > 2e-4).sum() <= 2  # a pixel at an outline may go either way


def test_traced_light_makes_the_highlights_that_baked_light_makes():
    # A black glossy ball, one light and one bounce: Mitsuba's own light sampling, its shadow rays and the BSDF here.
    made = beside_a_mirror()
    baked = render(made, 0.0, SIZE).image
    traced = render(made, 0.0, SIZE, ReferenceOptions(lighting="transport", max_depth=3, spp=2))
    assert baked.max() > 0.5 and traced.variance.max() < 1e-12  # a point light is sampled without chance
    away = np.abs(baked - traced.image).max(axis=2)
    # They part where a smooth normal faces the light and its triangle does not, and Mitsuba asks the triangle.
    assert (away > 2e-3).mean() < 2e-3
    assert np.median(away[baked.max(axis=2) > 0.05]) < 1e-4


def test_what_turns_shines_as_what_was_built_so():
    angle = 2.0
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    still_one = beside_a_mirror()
    thing = still_one.objects[0]
    turned_back = replace(thing, mesh=thing.mesh.transformed(np.linalg.inv(pose)), motion=lambda time: pose)
    turning = replace(still_one, objects=(turned_back,))
    for method in METHODS.values():
        one, other = (shaded(method, made, 0, size=(80, 60))[0] for made in (still_one, turning))
        assert one.L.max() > 0.1
        np.testing.assert_allclose(np.array(other.frame.radiance), np.array(one.frame.radiance), atol=1e-3)
        assert (np.abs(other.L - one.L).max(axis=2) > 2e-3).sum() <= 2


def test_cut_triangles_shine_like_whole_ones():
    # A floor of two triangles that goes through a plane mirror; normals and visibility that change along it.
    sheet = Reflector("sheet", quad((-1, 0, -0.8), (2, 0, 0), (0, 0, 1.6)))
    eye = np.array([0.3, -3.0, 0.6])
    floor = quad((-0.8, -2.5, -0.5), (1.6, 0, 0), (0, 3.0, 0))

    def seen(V):
        return np.stack([0.3 + 0.1 * V[:, 0], 0.6 + 0.1 * V[:, 1]], axis=1)

    def normals(V):  # not unit, so that what is interpolated is known between vertices
        return np.stack([0.1 * V[:, 0], 0.1 * V[:, 1], np.ones(len(V))], axis=1)

    lights = (PointLight((0.0, -2.1, 0.0), (30, 20, 10)), PointLight((0.6, -2.6, 0.2), (10, 20, 30)))
    mesh = replace(dark(floor), normals=normals(floor.vertices), visibility=seen(floor.vertices))
    made = scene(
        (Object("floor", mesh, shows="a mirror's foot", gloss=Gloss((0.5, 0.5, 0.5), 20.0)),), (sheet,),
        still(tuple(eye), (0, 0, 0), 40.0), lights=lights,
    )  # fmt: skip
    frame = FrameRenderer(replace(made, objects=()), *SIZE).render(0)
    triangles = geometry.of_scene(made)
    V = mesh.vertices
    image = V * [1, -1, 1]
    front = V[:, 1] < 0
    R = np.where(front[:, None], eye - eye[1] / (image - eye)[:, 1:2] * (image - eye), V)
    kind = np.where(front, virtual.REFLECTED, virtual.HIDDEN)
    rest = np.zeros((triangles.vertex_count - len(V), 4))
    packets = [np.concatenate([np.column_stack([a, b]), rest]) for a, b in ((image, kind), (R, 0 * kind))]
    images = virtual.Images(*(mi.Float(np.float32(packet).ravel()) for packet in packets))
    window = textures.window(frame.view, frame.boxes[0], 1.0)
    texture = textures.render(frame.proxies[0], frame.poses, dr.opaque(mi.UInt32, 0), window.view)
    target = virtual.Target(frame.view, frame.p, frame.reflector == 0)
    part = dr.opaque(mi.UInt32, 1)
    shown = virtual.nearest(images, triangles, part, target, virtual.Drawing("cut"), texture)
    drawn = virtual.interpolated(shown, target, "perspective")
    L, covered = np.array(drawn.L).T, np.array(drawn.covered)

    d = rays(made.camera(0.0), *SIZE)
    p = eye - (eye[1] / d[:, 1])[:, None] * d
    r = d * [1, -1, 1]
    with np.errstate(divide="ignore"):
        hit = p + ((-0.5 - p[:, 2]) / r[:, 2])[:, None] * r
    assert covered.sum() > 1500
    hit, p = hit[covered], p[covered]
    n = unit(normals(hit))
    expected = oracle(hit, n, unit(p - hit), lights, seen(hit), made.objects[0].gloss)
    assert expected.max() > 0.5
    # An edge is cut up to 3 mm behind the mirror (ten halvings of 3 m), which turns the direction from a point at distance y
    # by up to 3 mm / y; the lobe changes by e / 2 = 10 times that.
    away = np.abs(L[covered] - expected).max(axis=1)
    assert (away < 10 * 0.003 / np.maximum(-hit[:, 1], 0.003) * expected.max()).all()
    assert np.median(away) < 1e-3


# Light that is baked


def test_a_point_light_lights_a_floor_by_the_inverse_square():
    # L = albedo / pi * I cos / d² = albedo / pi * I h / d³.
    floor = subdivided(quad((-1, -1, 0), (2, 0, 0), (0, 2, 0), albedo=(0.2, 0.5, 1.0)), 0.1)
    made = scene((Object("floor", floor, shows="light"),), (), lights=(PointLight((0.1, 0.2, 0.8), (1, 2, 3)),))
    done = bake(made, spp=64).objects[0].mesh
    d = np.linalg.norm(np.array([0.1, 0.2, 0.8]) - floor.vertices, axis=1)
    expected = np.array([0.2, 0.5, 1.0]) * [1, 2, 3] / np.pi * (0.8 / d**3)[:, None]
    inner = np.abs(floor.vertices).max(axis=1) < 0.95  # a vertex at the rim stands for its inside
    assert done.visibility is None and done.radiance is not None
    np.testing.assert_allclose(done.radiance[inner], expected[inner], rtol=0.05)


def test_a_point_light_and_a_sky_are_weighted_without_loss():
    # Two emitters, one of which no direction hits by chance: the sum of what each gives alone.
    floor = quad((-1, -1, 0), (2, 0, 0), (0, 2, 0))
    both = scene((Object("floor", floor, shows="light"),), (), lights=(LAMP,), background=(0.3, 0.3, 0.3))
    L = [
        bake(m, spp=1024).objects[0].mesh.radiance
        for m in (both, replace(both, lights=()), replace(both, background=(0, 0, 0)))
    ]
    np.testing.assert_allclose(L[0], L[1] + L[2], rtol=0.03)


def test_visibility_is_the_share_of_a_light_that_is_seen():
    # A roof over the half x > 0 of a floor, high lamp: light on the other half, none below, between on the border.
    floor = subdivided(quad((-1, -1, 0), (2, 0, 0), (0, 2, 0)), 0.25)
    roof = quad((0.0, -2, 0.01), (2, 0, 0), (0, 4, 0))
    objects = (
        Object("floor", floor, shows="shadow", gloss=GLOSS), Object("roof", roof, shows="shade"),
    )  # fmt: skip
    made = scene(objects, (), lights=(PointLight((0, 0, 50), (1, 1, 1)), PointLight((0, 0, -50), (1, 1, 1))))
    done = bake(made, spp=256).objects[0].mesh
    x = floor.vertices[:, 0]
    step = np.diff(np.unique(x)).min()
    assert done.visibility is not None and done.visibility.shape == (len(x), 2)
    assert (done.visibility[x < -1.01 * step, 0] == 1).all() and (done.visibility[x > 1.01 * step, 0] == 0).all()
    border = done.visibility[np.abs(x) < 1e-9, 0]
    assert (np.abs(border - 0.5) < 0.25).all() and border.mean() == pytest.approx(0.5, abs=0.1)
    # The second lamp shines on the back: no point of the floor is turned to it, and no highlight asks.
    assert (done.visibility[:, 1] == 0).all()


def test_a_curved_mesh_does_not_shade_itself_in_facets():
    # An octahedron-like ball: every vertex sees the lamp from all of its faces that are turned to it.
    thing = Object("ball", ball(0.5, (0, 0, 0), (0, 0, 0), 1), shows="facets", gloss=GLOSS)
    seen = bake(scene((thing,), (), lights=(LAMP,)), spp=64).objects[0].mesh.visibility
    towards = thing.mesh.vertices @ unit(np.array(LAMP.position)) > 0
    assert (seen[towards] == 1).all()


def test_what_stands_in_the_way_of_the_light_takes_the_highlight():
    made = beside_a_mirror()
    middle = 0.5 * (BALL + np.array(LAMP.position))
    for place, lit in ((middle, False), (middle + np.array([0, 2, 1]), True)):
        block = Object("block", ball(0.4, place, (0, 0, 0), 1), shows="shade")
        each = bake(replace(made, objects=(*made.objects, block)), spp=16)
        bright, dull = (shaded(RayTraced(), m, 0, size=(80, 60))[0].L for m in (each, replace(each, lights=())))
        assert ((bright - dull).max() > 0.3) == lit and ((bright - dull).max() < 0.02) != lit
        traced = render(each, 0.0, (80, 60), ReferenceOptions(lighting="transport", max_depth=3, spp=2)).image
        assert (traced[..., 0].max() > 0.3) == lit


# The material in Mitsuba


def test_the_bsdf_is_sampled_as_it_is_weighed():
    # Reflectance by sampling = by quadrature; the density integrates to what of it lies above the surface.
    albedo = mi.load_dict({"type": "rgb", "value": [0.2, 0.2, 0.2]})
    made = bsdf(Gloss((0.5, 0.25, 0.0), 12.0), albedo)
    si = dr.zeros(mi.SurfaceInteraction3f, 1)
    si.wi = dr.normalize(mi.Vector3f(0.6, 0.1, 0.9))
    ctx, rng, count = mi.BSDFContext(), np.random.default_rng(1), 200_000
    u = mi.Point2f(rng.random((2, count)).astype(np.float32))
    wo = mi.warp.square_to_uniform_hemisphere(u)
    value, pdf = made.eval_pdf(ctx, si, wo)
    bs, weight = made.sample(ctx, si, mi.Float(rng.random(count).astype(np.float32)), u)
    quadrature = 2 * np.pi * np.array(value).mean(axis=1)
    np.testing.assert_allclose(np.array(weight).mean(axis=1), quadrature, rtol=0.02)
    above = (np.array(bs.pdf) > 0).mean()
    assert 2 * np.pi * np.array(pdf).mean() == pytest.approx(above, rel=0.02)
    assert quadrature[2] == pytest.approx(0.2, rel=0.01)
    upright = dr.zeros(mi.SurfaceInteraction3f, 1)
    upright.wi = mi.Vector3f(0, 0, 1)
    lobe = 2 * np.pi * np.array(made.eval(ctx, upright, wo)).mean(axis=1) - 0.2
    assert (1.06 * 0.5 < lobe[0] < 1.08 * 0.5) and lobe[1] == pytest.approx(0.5 * lobe[0], rel=0.02)  # as `Gloss` says
    # Reciprocity: f(wi, wo) cos wo / cos wo = f(wo, wi).
    there = dr.zeros(mi.SurfaceInteraction3f, count)
    there.wi = wo
    back = made.eval(ctx, there, mi.Vector3f(si.wi.x[0], si.wi.y[0], si.wi.z[0]))
    np.testing.assert_allclose(np.array(back) / np.array(si.wi.z), np.array(value) / np.array(wo.z), rtol=2e-3, atol=1e-6)


# Scenes without highlights, and what is refused


def test_without_a_light_or_without_gloss_everything_stays_as_it_was():
    plain = mirror_room()
    glossy = replace(plain, objects=tuple(replace(o, gloss=GLOSS) for o in plain.objects))
    lamps = replace(plain, lights=(LAMP,))
    assert lighting.shine_of(beside_a_mirror()) is not None
    picture = render(plain, 0.0, (40, 30)).image
    for other in (glossy, lamps):
        assert lighting.shine_of(other) is None and geometry.of_scene(other).shine is None
        assert content_hash(fingerprint(other, 0.0, "baked")) == content_hash(fingerprint(plain, 0.0, "baked"))
        assert np.array_equal(render(other, 0.0, (40, 30)).image, picture)
        for method in METHODS.values():
            one, two = (shaded(method, m, 0, size=(40, 30))[0] for m in (plain, other))
            assert one.same(two)
            assert np.array_equal(np.array(one.frame.radiance), np.array(two.frame.radiance))


@pytest.mark.exhaustive
def test_hashes_tell_scenes_with_other_highlights_apart():
    made = beside_a_mirror()
    thing = made.objects[0]
    half = replace(thing.mesh, visibility=0.5 * np.ones((len(thing.mesh.vertices), 1)))
    others = [
        replace(made, lights=()),
        replace(made, lights=(replace(LAMP, position=(0, 0, 1)),)),
        replace(made, lights=(replace(LAMP, intensity=(0, 0, 1)),)),
        replace(made, objects=(replace(thing, gloss=None),)),
        replace(made, objects=(replace(thing, gloss=replace(GLOSS, exponent=7.0)),)),
        replace(made, objects=(replace(thing, gloss=replace(GLOSS, specular=(0, 0, 0))),)),
        replace(made, objects=(replace(thing, mesh=half),)),
    ]
    assert len({identity.of_scene(s) for s in (made, *others)}) == 8
    pictures = {render(s, 0.0, (24, 18)).image.tobytes() for s in (made, *others)}
    # Without lights, without gloss and with a black one there is nothing to see: one and the same picture.
    assert len(pictures) == 6


def test_highlights_of_what_was_not_baked_are_refused():
    made = beside_a_mirror()
    thing = made.objects[0]
    for mesh in (replace(thing.mesh, visibility=None), dark(thing.mesh, 2)):
        raw = replace(made, objects=(replace(thing, mesh=mesh),))
        for use in (lambda raw=raw: FrameRenderer(raw, 8, 8), lambda raw=raw: render(raw, 0.0, (8, 8))):
            with pytest.raises(ValueError, match="object ball has gloss and no visibility of 1 lights; bake"):
                use()
