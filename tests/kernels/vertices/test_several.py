"""Several reflections per vertex: all are found, each once, and triangles join those of one branch."""

from __future__ import annotations

from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from support.answers import lanes
from support.mirror_room import mirror_room, scene, shaded, still
from support.tiers import first
from support.truth_shapes import alhazen_inside, unit

from benchharness.kernels import geometry, placement
from benchharness.kernels.vertices import branches, mirrormesh, newton, problems, several, virtual
from benchharness.measure import completeness, truth
from benchharness.measure.bench import Bench
from benchharness.render.reference import ReferenceOptions
from benchharness.scene import Mesh, Object, Reflector
from methods.image_space_search import ImageSpaceSearch
from methods.newton import Newton, _solve_several
from methods.secant_triangle import SecantTriangle
from scenes.props.minimal import sphere
from scenes.stress.torus import torus
from scenes.stress.zones import zones

ALL = {"newton": Newton(), "secant_triangle": SecantTriangle(resolution=64), "image_space_search": ImageSpaceSearch()}
every_method = pytest.mark.parametrize("name", ALL)
EYE = np.array([0.1, 0.05, -0.6])


def hollow_ball() -> Reflector:
    ball = sphere(fine=64)
    return Reflector("inside", Mesh(ball.vertices, ball.faces[:, ::-1], -ball.normals))


def slots(answer) -> list:
    vertices = answer.reflection.vertices
    return [vertices, *vertices.further]


def places(answer) -> tuple[np.ndarray, np.ndarray]:
    """Reflection points [N, K, 3] of the vertices of a scene with one mirror, and whether there is one [N, K]."""
    all_ = slots(answer)
    return np.stack([lanes(v.R) for v in all_], 1), np.stack([np.array(v.region) == problems.REFLECTED for v in all_], 1)


def measured(made, method, size=(96, 72)):
    record, seen = Bench(made, size, ReferenceOptions(max_depth=2, spp=2), None, 0, (1, 1)).show(0, "method", method)
    assert seen is not None, record
    return record, seen


@pytest.fixture(scope="module")
def inside_a_ball():
    """A scene of points within a ball of which the eye sees the inside, and all reflection points of each."""
    V = np.random.default_rng(0).uniform(-0.5, 0.5, (300, 3))
    one = np.arange(300)[:, None].repeat(3, axis=1)  # triangles without area: nothing of them is drawn
    points = Object("points", Mesh(V, one, np.tile([0.0, 0, 1], (300, 1)), radiance=np.ones((300, 3))), "reflections")
    made = scene([points], [hollow_ball()], still(tuple(EYE), (0.6, 0.4, 1.0), 100.0), frames=1)
    return made, [alhazen_inside(EYE, v) for v in V]


@pytest.mark.parametrize("name", first(ALL, ["newton"]))
def test_inside_a_sphere_all_of_alhazens_points_are_found_and_nothing_else(name, inside_a_ball):
    made, roots = inside_a_ball
    answer = shaded(replace(ALL[name], multi=4), made, 0)[0]
    R, filled = places(answer)
    filled &= np.stack([np.array(v.converged) for v in slots(answer)], 1)
    assert {len(r) for r in roots} == {2, 4}
    size, strange, missed, total = answer.active.shape[::-1], 0, 0, 0
    for own, there, true in zip(R, filled, roots, strict=False):
        # A chord of 2π/128 sags by 3e-4; where two points are about to meet, they move by the root of that.
        near = np.linalg.norm(own[there][:, None] - true, axis=2)
        strange += int((near.min(axis=1, initial=np.inf) > 0.05).sum())
        at = truth.on_screen(true, made.camera(0.0), *size)
        near = near[:, ((at > 2) & (at < np.array(size) - 2)).all(axis=1)]
        total += near.shape[1]
        missed += int((near.min(axis=0, initial=np.inf) > 0.05).sum())
    assert total > 250
    # Right at a caustic, half vector and normal nearly agree where there is no point any more.
    assert strange <= 1 and missed <= 0.01 * total


@pytest.mark.parametrize("name", first(ALL, ["image_space_search"]))
def test_each_is_found_once(name, inside_a_ball):
    R, filled = places(shaded(replace(ALL[name], multi=8), inside_a_ball[0], 0)[0])
    apart = np.linalg.norm(R[:, :, None] - R[:, None], axis=3)
    both = filled[:, :, None] & filled[:, None] & ~np.eye(8, dtype=bool)
    # The ball's box has a diagonal of 2 √3.
    assert both.any() and apart[both].min() >= several.APART_SHARE * 2 * np.sqrt(3) * (1 - 1e-5)
    assert filled.sum(axis=1).max() <= 4


@every_method
def test_of_a_convex_mirror_nothing_changes(name, room, renderer):
    one, several_ = (shaded(replace(ALL[name], multi=m, split_px=0), room, 0, renderer=renderer)[0] for m in (1, 4))
    assert several_.same(one)
    assert len(slots(several_)) == 1


def test_a_path_by_way_of_a_concave_mirror_is_shortest_before_the_foci_longest_behind_and_between_neither():
    """T9. Incidence 60 degrees, eye at 1 from a sphere of radius 1: foci at 1 / (2 / cos - 1) = 1/3 and 2 cos = 1: none."""
    mesh_ = hollow_ball().mesh
    mesh = mirrormesh.build(mesh_.vertices, mesh_.normals, mesh_.faces)
    P = unit(np.array([0.3, 0.2, 0.9]))
    across = unit(np.cross(P, [1.0, 0, 0]))
    view = shaded(Newton(), mirror_room(), 0, size=(8, 8))[0].frame.view

    def kind(angle, d_E, d_V):
        ways = [-np.cos(angle) * P + sign * np.sin(angle) * across for sign in (1, -1)]
        ray = mi.Ray3f(mi.Point3f(0), mi.Vector3f(P.tolist()))
        hit = mesh.scene.ray_intersect_preliminary(ray)
        eye, V = (mi.Point3f((P + d * w).tolist()) for d, w in zip((d_E, d_V), ways, strict=True))
        where = placement.MirrorFrame(eye, V, view.x, view.y, view.w)
        return newton.kind(mesh, where, mirrormesh.SurfacePoint(hit.prim_index, mi.Point2f(hit.prim_uv)), mi.Bool(True))[0]

    assert kind(np.pi / 3, 1.0, 0.25) == newton.MINIMUM
    assert kind(np.pi / 3, 1.0, 0.5) == newton.SADDLE
    # Head-on, both foci are at 1 / (2 - 1 / 1.5) = 0.75.
    assert kind(1e-3, 1.5, 0.6) == newton.MINIMUM
    assert kind(1e-3, 1.5, 0.9) == newton.MAXIMUM


@pytest.mark.parametrize("name", first(ALL, ["secant_triangle"]))
@pytest.mark.parametrize(
    ("made", "share"),
    [(zones(0.35), 0.02), pytest.param(torus(0.3), 0.75, marks=pytest.mark.exhaustive)],
    ids=["bowl", "ring"],
)
def test_the_picture_in_bowl_and_ring_is_far_nearer_to_the_truth(name, made, share):
    if ALL[name].refuses(made) is not None:
        pytest.skip("refuses it")
    (one, _), (four, _) = (measured(made, replace(ALL[name], multi=m), (160, 120)) for m in (1, 4))
    assert four["flip"] < share * one["flip"]
    assert four["coverage"] == 1.0


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", first(ALL, ["newton"]))
def test_what_a_method_has_no_room_for_it_says(name):
    """At 0.35 radii, each vertex has three reflections that the eye sees."""
    missing, said = {}, {}
    for multi in (1, 2, 4):
        record, seen = measured(zones(0.35), replace(ALL[name], multi=multi))
        missing[multi], said[multi] = completeness.missing(seen), record["converged_ratio"]
    assert missing[1] > 0.6 and 0.25 < missing[2] < 0.4 and missing[4] < 0.06
    assert said[2] < 0.3 and said[4] > 0.9


def test_triangles_join_reflections_of_one_branch():
    """Three images of a ball, at least half a radius apart; each is smaller than that."""
    made, method = zones(0.35), Newton(multi=4)
    frame = shaded(method, made, 0, size=(96, 72))[0].frame
    state = method.update(method.prepare(made), frame)
    seen = state.scenery
    problem = problems.Problem(
        world=seen.world,
        part=mi.UInt32(1),
        shown_parts=seen.parts_shown("black"),
        mirrors=None,
        poses=frame.poses,
        view=frame.view,
        last_view=frame.view,
        max_iter=mi.UInt32(60),
    )
    arranged = _solve_several(problem, state.mirrors[0], state.seeds[0], 4)
    faces = np.array(arranged.triangles.faces).reshape(-1, 4)[:, :3]
    faces = faces[faces[:, 0] != faces[:, 1]]
    R = np.array(arranged.images.at).reshape(-1, 4)
    corners = R[faces][:, :, :3]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    # Half of the ball's triangles show their front, three times.
    assert 0.8 * 1.5 < len(faces) / len(made.objects[0].mesh.faces) < 1.2 * 1.5
    assert edges.max() < 0.5
    kinds = R[faces][:, :, 3].astype(int) % branches.SEEN
    assert (kinds == kinds[:, :1]).all() and set(np.unique(kinds)) >= {newton.MINIMUM, newton.SADDLE}


def test_of_a_vertex_s_images_the_nearest_to_it_is_known():
    """Places 0 to 2 lie 3, 0.5 and 0.1 away from it; the last of them was not found."""
    V = np.array([[0, 0, 5], [1, 0, 5], [0, 1, 5]], np.float32)
    away, code = (3.0, 0.5, 0.1), (1.0, 2.0, 0.0)
    moved = np.concatenate([np.c_[V + np.array([0, 0, d]), np.ones(3)] for d in away] + [np.c_[V, np.zeros(3)]])
    at = np.concatenate([np.c_[V, np.full(3, c)] for c in (*code, 0.0)])
    images = virtual.Images(*(mi.Float(a.astype(np.float32).ravel()) for a in (moved, at)))
    world = geometry.upload([(V, np.zeros((3, 3)), np.array([[0, 1, 2]]))])
    corners = branches._Corners.of(mi.Vector4u(0, 1, 2, 0), images, world, 4)
    for place, distance in corners.beside:
        assert place[0] == 1 and distance[0] == 0.5


def test_where_a_mirror_meets_itself_it_is_black():
    """At the rim of a bowl, rays are reflected more than once: a third of the picture in truth."""
    _, seen = measured(zones(0.9), Newton(multi=2))
    black, truly = seen.like((0.0, 0.0, 0.0), 1e-6)
    assert truly.sum() > 0.3 * seen.mask.sum()
    assert (black != truly).sum() < 0.01 * truly.sum()
    assert np.isfinite(seen.distance[black]).all() and (seen.distance[black] < 2.01).all()


@pytest.mark.parametrize(
    ("method", "options"),
    [
        (ImageSpaceSearch, {"hidden": "simple"}),
        (SecantTriangle, {"hidden": "clamp"}),
        (SecantTriangle, {"hidden": "drop", "depth": "screen_linear"}),
    ],
)
def test_hidden_vertices_are_cut_or_dropped(method, options):
    with pytest.raises(ValueError, match=r"multi 2 with hidden .* accepted: "):
        method(multi=2, **options)


def test_counters_tell_what_several_reflections_cost():
    made = zones(0.35)
    one, four = (shaded(Newton(multi=m), made, 0, size=(96, 72))[0] for m in (1, 4))
    assert set(four.reflection.counters) == {"iterations", "reflections"}
    vertices = len(made.objects[0].mesh.vertices)
    assert np.array(four.reflection.counters["reflections"])[:vertices].mean() == pytest.approx(3, abs=0.1)
    assert four.reflection.counters["iterations"].numpy().sum() > one.reflection.counters["iterations"].numpy().sum()
    assert dr.width(four.reflection.counters["iterations"]) == made.vertices
