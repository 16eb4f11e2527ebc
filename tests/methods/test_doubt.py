"""Doubt: where a method knows that it may show the wrong thing, by closed forms, and against rays that are traced."""

from __future__ import annotations

from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from oracles.billboard_oracle import quads, vectors
from oracles.depth_oracle import BACKGROUND, camera
from support.depth_objects import built, device, seen
from support.mirror_room import SIZE, mirror_room, shaded, still
from support.mirror_room import scene as room_of
from support.tiers import first

from benchharness.kernels import selfmet
from benchharness.kernels.differentials import RayDifferential
from benchharness.kernels.images import billboard, depthray
from benchharness.kernels.images.candidates import Ray
from benchharness.kernels.vertices import bent
from benchharness.regime import Seen
from benchharness.render.frame import FrameRenderer
from benchharness.scene import Reflector
from methods.billboard_impostor import BillboardImpostor
from methods.depth_impostor import DepthImpostor
from methods.environment_map import EnvironmentMap
from methods.image_space_search import ImageSpaceSearch
from methods.newton import Newton
from methods.ray_traced import RayTraced
from methods.secant_triangle import SecantTriangle
from scenes.props.minimal import RED, eye, s1, sphere, stage, thing
from scenes.stress.around import around
from scenes.stress.bowl import bowl
from scenes.stress.coarse_mirror import coarse_mirror
from scenes.stress.comb import comb
from scenes.stress.concave import concave
from scenes.stress.contact import contact
from scenes.stress.far_away import far_away
from scenes.stress.hidden import hidden
from scenes.stress.long_triangles import long_triangles
from scenes.stress.two_mirrors import two_mirrors

OFF = 0.1  # of radiance: stress scenes have plain colours, which differ by more where something else is shown
VERTEXWISE = (Newton(), SecantTriangle(resolution=64), ImageSpaceSearch())
BORDER = 0.005  # share of a mirror that its silhouette may hold: there neighbours are far apart, and doubt is coarse


def judged(method, scene, bounces: int = 1) -> tuple[float, float, float]:
    """Shares of the mirrors' pixels: wrong; doubted of the wrong; doubted of those that are right within a pixel around."""
    renderer = FrameRenderer(scene, *SIZE)
    one, truth = (shaded(m, scene, 0, renderer=renderer)[0] for m in (method, RayTraced(bounces=bounces)))
    doubt = np.broadcast_to(np.array(one.reflection.doubt), one.active.size).reshape(one.active.shape) & one.active
    wrong = one.active & (np.abs(one.L - truth.L).max(axis=2) > OFF)
    near = wrong.copy()
    for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1)):
        near |= np.roll(wrong, step, axis)
    right = one.active & ~near
    return wrong.sum() / one.active.sum(), (doubt & wrong).sum() / max(wrong.sum(), 1), (doubt & right).sum() / right.sum()


@pytest.mark.parametrize(
    ("method", "scene", "bounces"),
    [
        (EnvironmentMap(), contact(0.0), 1),
        (EnvironmentMap(), comb(6), 1),
        (EnvironmentMap(), concave(0.9), 1),
        (BillboardImpostor(), contact(0.0), 1),
        (BillboardImpostor(), around(2.0), 1),
        pytest.param(BillboardImpostor(), concave(0.9), 1, marks=pytest.mark.exhaustive),
        (DepthImpostor(), around(2.0), 1),
        (DepthImpostor(intersector="march"), around(2.0), 1),
        (DepthImpostor(), comb(24), 1),
        pytest.param(RayTraced(), two_mirrors(0.0), 8, marks=pytest.mark.exhaustive),
        (Newton(), two_mirrors(0.0), 8),
        (Newton(), coarse_mirror(5), 1),
        (SecantTriangle(resolution=64), coarse_mirror(5), 1),
        (ImageSpaceSearch(), coarse_mirror(5), 1),
        (Newton(), bowl(1.0), 8),
        pytest.param(Newton(multi=4), bowl(1.0), 8, marks=pytest.mark.exhaustive),
        (ImageSpaceSearch(split_px=0), hidden(1.0), 1),
        (Newton(split_px=0), long_triangles(1.0), 1),
    ],
    ids=lambda value: "" if isinstance(value, int) else getattr(value, "name", type(value).__name__),
)
def test_what_is_wrong_is_doubted_and_little_else(method, scene, bounces):
    wrong, recall, wolf = judged(method, scene, bounces)
    assert wrong > 0.005 and recall > 0.75
    assert wolf < 0.2


@pytest.mark.parametrize(
    ("method", "scene"),
    [
        (EnvironmentMap(), far_away(300.0)),
        (BillboardImpostor(), contact(2.0)),
        (DepthImpostor(), contact(1.0)),
        (DepthImpostor(intersector="march"), contact(1.0)),
        (RayTraced(), contact(0.0)),
    ],
)
def test_what_is_right_is_not_doubted(method, scene):
    wrong, _, wolf = judged(method, scene)
    assert wrong < 0.01 and wolf < BORDER


@pytest.mark.parametrize("method", first(VERTEXWISE, VERTEXWISE[:1]), ids=lambda method: type(method).__name__)
@pytest.mark.parametrize("scene", [long_triangles(0.06), coarse_mirror(64), hidden(0.1)], ids=["bar", "floor", "wall"])
def test_small_triangles_are_hardly_doubted(method, scene):
    """Of checkered things, border pixels are wrong; searches in the picture end unsure along the outline."""
    wrong, _, wolf = judged(method, scene)
    assert wrong < 0.03 and wolf < 2 * BORDER


@pytest.mark.parametrize("method", VERTEXWISE, ids=lambda method: type(method).__name__)
@pytest.mark.parametrize("scene", [long_triangles(4.0), hidden(2.0)], ids=["long_triangles", "hidden"])
def test_where_images_of_long_edges_may_be_is_doubted(method, scene):
    """The bar's one piece is twice as wide in the mirror as its image is bent; the wall's are as large as the mirror."""
    wrong, recall, _ = judged(replace(method, split_px=0), scene)
    assert wrong > 0.1 and recall > 0.98
    better, _, _ = judged(method, scene)
    assert better < 0.5 * wrong


def test_the_sagitta_of_an_arc_is_that_of_its_chord_and_turn():
    """On a circle of 100 pixels, an arc of 0.3 radians leaves its chord by 100 (1 - cos 0.15); to second order."""
    directions = [(float(np.cos(t)), float(np.sin(t))) for t in (0.4, 0.7)]
    a, b = (bent.End(100 * mi.Point2f(*u), mi.Vector3f(*u, 0), mi.Float(0)) for u in directions)
    assert np.array(bent.sagitta(a, b))[0] == pytest.approx(100 * (1 - np.cos(0.15)), rel=0.15**2)


@pytest.mark.parametrize("method", [EnvironmentMap(), BillboardImpostor(), DepthImpostor(), RayTraced(), *VERTEXWISE])
@pytest.mark.parametrize("target", [(0.0, 0.0, 0.0), (0.2, -3.0, 0.25)], ids=["in view", "out of view"])
def test_doubt_has_a_lane_for_each_pixel_or_one_for_all(method, target):
    (answer,) = shaded(method, mirror_room(camera=still((0.2, -1.7, 0.25), target)), 0)
    doubt = answer.reflection.doubt
    if target == (0.0, 0.0, 0.0):
        assert answer.active.any() and isinstance(doubt, mi.Bool)
    else:
        assert not answer.active.any() and isinstance(doubt, mi.Bool | None)
    assert doubt is None or dr.width(doubt) in (1, SIZE[0] * SIZE[1])


ASKED = [EnvironmentMap(), BillboardImpostor(), DepthImpostor(), *VERTEXWISE, Newton(multi=2)]


@pytest.mark.parametrize("method", first(ASKED, [EnvironmentMap(), DepthImpostor(), Newton(multi=2)]))
def test_doubt_is_there_if_asked_for_and_costs_nothing_and_changes_nothing_if_not(method):
    scene, operations, answers = mirror_room(), [], []
    for doubts in (True, False):
        shaded(method, scene, 0, doubts=doubts)
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            answers += shaded(method, scene, 0, doubts=doubts)
            history = dr.kernel_history([dr.KernelType.JIT])
        operations.append(sum(kernel["operation_count"] for kernel in history))
    asked, plain = answers
    assert asked.reflection.doubt is not None and plain.reflection.doubt is None
    assert asked.same(plain)
    assert operations[1] < operations[0]


def test_what_billboards_show_does_not_depend_on_what_is_doubted():
    """Bit for bit, with bounds around every quad and without; and doubts there are."""
    made, rng, count = quads(), np.random.default_rng(3), 4000
    boards, bounded = made.boards, made.boards
    packed = np.array(boards.quads).reshape(-1, 4, 4)
    packed[:, 1, 3] = packed[:, 2, 3] = 0.4
    packed[:, 3, 3] = 1.0
    bounded.quads = device(packed)
    o, d = 2 * rng.normal(size=(count, 3)), rng.normal(size=(count, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    differential = RayDifferential([mi.Vector3f(0.01, 0, 0), mi.Vector3f(0, 0.01, 0)], [mi.Vector3f(0), mi.Vector3f(0)])
    ray = Ray(mi.UInt32(rng.integers(0, 2, count)), mi.Point3f(vectors(o)), vectors(d), differential)
    args = (made.pictures, 6, ray, billboard.none())
    plain, deep = billboard.nearest(boards, *args), billboard.nearest(bounded, *args, bounded=True)
    for name in ("t", "slot", "value", "tests"):
        assert np.array(getattr(plain, name)).tobytes() == np.array(getattr(deep, name)).tobytes()
    assert np.array(deep.doubt).any() and np.isfinite(np.array(deep.missed)).any()
    assert not np.array(plain.doubt).any() and np.isinf(np.array(plain.missed)).all()


def test_pixels_between_rays_are_least_squares():
    rng = np.random.default_rng(1)
    u, v, e = rng.normal(size=(3, 50, 3))
    differential = RayDifferential([vectors(u), vectors(v)], [mi.Vector3f(0), mi.Vector3f(0)])
    found = np.array(differential.pixels(mi.Float(1), vectors(e)))
    expected = [np.linalg.norm(np.linalg.lstsq(np.stack([a, b], 1), c, rcond=None)[0]) for a, b, c in zip(u, v, e, strict=True)]
    np.testing.assert_allclose(found, expected, rtol=2e-4)
    alone = RayDifferential([mi.Vector3f(0.5, 0, 0), mi.Vector3f(0)], [mi.Vector3f(0), mi.Vector3f(0)])
    assert np.array(alone.pixels(mi.Float(1), mi.Vector3f(2, 0, 0)))[0] == pytest.approx(4)


# A plate at Z = 3 before a camera at the origin that sees from Z = 2 to 4


def plate(cam):
    """The middle half of the map at zgl of Z = 3."""
    depth = np.full((cam.w, cam.w), BACKGROUND)
    q = cam.w // 4
    depth[q:-q, q:-q] = cam.zgl(3.0)
    return depth


@pytest.mark.parametrize("marching", [False, True])
def test_a_ray_is_lost_from_where_it_runs_behind_the_surface_and_not_where_it_hits_or_passes_in_front(marching):
    cam = camera(128)
    depth = plate(cam)
    span = 0.5 * 3.5 * cam.w / (2 * cam.focal)  # half the plate's shadow at Z = 3.5
    rays = [
        ((-3.0, 0.01, 3.5), (1.0, 0.0, 0.0)),  # behind, from where the shadow begins
        ((-3.0, 0.01, 2.5), (1.0, 0.0, 0.0)),  # in front
        ((0.02, 0.01, 2.2), (0.05, 0.0, 1.0)),  # hits
        ((-3.0, 0.01, 3.5), (0.0, 1.0, 0.0)),  # beside
    ]
    segment = seen(cam, np.array([o for o, _ in rays]), np.array([d for _, d in rays]))
    if marching:
        hit = depthray.meet_texels(segment, device(depth), cam.w)
    else:
        layout, rows, _ = built(depth, 60, 16)
        hit = depthray.meet_rows(segment, rows, layout)
    hidden = np.array(hit.hidden)
    assert np.array(hit.found).tolist() == [False, False, True, False]
    assert np.isfinite(hidden).tolist() == [True, False, False, False]
    at = np.array(segment.distance(mi.Float(np.where(np.isfinite(hidden), hidden, 0))))[0] - 3.0
    assert at == pytest.approx(-span, abs=3 * 3.5 / cam.focal)  # three texels there


def test_a_hit_between_samples_that_differ_is_a_step_and_a_row_without_all_its_spans_loses_its_rays():
    cam = camera(128)
    depth = plate(cam)
    depth[:, 64:] = np.where(depth[:, 64:] < 1.5, depth[:, 64:] + 0.3, BACKGROUND)
    layout, rows, dropped = built(depth, 60, 16)
    z = 3.15  # within the step
    rays = [((-0.3, 0.01, z), (1.0, 0.0, 0.0)), ((0.3, 0.01, 2.2), (0.0, 0.0, 1.0))]
    segment = seen(cam, np.array([o for o, _ in rays]), np.array([d for _, d in rays]))
    back = seen(cam, np.array([[0.3, 0.01, z]]), np.array([[-1.0, 0.0, 0.0]]))
    assert np.array(depthray.meet_rows(back, rows, layout).step).tolist() == [True]
    assert np.array(depthray.meet_texels(back, device(depth), cam.w).step).tolist() == [True]
    assert not np.array(depthray.meet_rows(segment, rows, layout).step)[1]
    assert np.array(dropped).sum() == 0
    all_dropped = dr.full(mi.UInt32, 1, dr.width(dropped))
    assert (np.array(depthray.meet_rows(segment, rows, layout, dropped=all_dropped).hidden) == 0).all()


def test_a_hollow_of_a_sphere_is_met_again_where_the_ray_meets_the_sphere():
    """Inside a unit sphere whose box is its upper half; |p + s r| = 1 has the root s = -2 p·r besides 0."""
    rng = np.random.default_rng(4)
    p, w = rng.normal(size=(2, 400, 3))
    p /= np.linalg.norm(p, axis=1, keepdims=True)
    p[:, 2] = np.abs(p[:, 2])
    w /= np.linalg.norm(w, axis=1, keepdims=True)
    outward = np.maximum((w * p).sum(1), 0)
    r = w - 2 * outward[:, None] * p
    s = -2 * (p * r).sum(1)
    u = np.cross(p, rng.normal(size=(400, 3)))
    u *= 1e-3 / np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(p, u)
    box = [mi.Vector4f(1, 0, 0, 0), mi.Vector4f(0, 1, 0, 0), mi.Vector4f(0, 0, 2, -1)]
    found = np.array(
        selfmet.away(
            mi.Point3f(vectors(p)),
            mi.Normal3f(vectors(-p)),
            vectors(r),
            [vectors(u), vectors(v)],
            [vectors(-u), vectors(-v)],
            box,
        )
    )
    again = (p + s[:, None] * r)[:, 2]
    clear = (np.abs(again) > 0.01) & (s > 0.05)
    assert ((again > 0) & clear).sum() > 50 and ((again < 0) & clear).sum() > 50
    np.testing.assert_array_equal(np.isfinite(found)[clear], (again > 0)[clear])
    np.testing.assert_allclose(found[clear & (again > 0)], s[clear & (again > 0)], rtol=2e-3)
    outside = np.array(
        selfmet.away(
            mi.Point3f(vectors(p)),
            mi.Normal3f(vectors(p)),
            vectors(-r),
            [vectors(u), vectors(v)],
            [vectors(u), vectors(v)],
            box,
        )
    )
    assert np.isinf(outside).all()


def facing(gap: float = 0.2):
    """Two mirror balls of radius 1 side by side, and a plain one before them."""
    mirrors = [s1(1.0, (x, 0.0, 0.0)) for x in (-1 - 0.5 * gap, 1 + 0.5 * gap)]
    named = [Reflector(f"mirror {k}", m.mesh, m.closed) for k, m in enumerate(mirrors)]
    return stage([thing("ball", sphere(0.2, (0.0, 0.2, 2.5)), RED)], named, eye((0.0, 0.5, 8.0), fov_deg=30.0))


def test_a_ray_that_goes_on_to_a_third_mirror_is_doubted():
    """Those that end at a mirror after two bounces, traced; spheres around the mirrors are the mirrors here."""
    renderer = FrameRenderer(facing(0.6), *SIZE)
    one, traced = (shaded(m, facing(0.6), 0, renderer=renderer)[0] for m in (DepthImpostor(), RayTraced(bounces=2)))
    second = one.counted("second_order").astype(bool)
    third, doubt = (np.array(answer.reflection.doubt).reshape(second.shape) & second for answer in (traced, one))
    assert second.sum() > 200 and third.sum() > 20
    assert (doubt & third).sum() > 0.9 * third.sum() and (doubt & ~third).sum() < 0.1 * (second & ~third).sum()


def test_mirrors_that_are_black_in_other_mirrors_are_doubted():
    for method in (BillboardImpostor(other_mirrors="black"), EnvironmentMap()):
        _, recall, wolf = judged(method, facing(), bounces=8)
        assert recall > 0.75 and wolf < 0.1


def test_a_trusted_picture_is_the_truth_where_it_is_doubted():
    ones = np.ones((2, 2), bool)
    doubt = np.array([[True, False], [False, False]])
    image = np.zeros((2, 2, 3))
    seen_ = Seen(
        image, image + 1, ones, 0 * ones, ones, doubt, np.ones((2, 2)), 2 * np.ones((2, 2)), np.ones((2, 2)), None, {},
        room_of((), ()), 0.0,
    )  # fmt: skip
    trusted = seen_.trusted()
    assert (trusted.image[0, 0] == 1).all() and (trusted.image[1] == 0).all()
    assert trusted.distance[0, 0] == 2 and trusted.record["flip"] == pytest.approx(0.75)
