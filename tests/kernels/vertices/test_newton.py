"""Newton's method on meshes, float32, against `benchharness.measure.truth`, which solves every triangle in float64."""

from __future__ import annotations

from functools import cache

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
import trimesh
from oracles import secant_oracle
from support.newton_meshes import turned_over, walked
from support.placed import EYE, host, off_px, place, points
from support.small_room import box, quad, sphere
from support.star_shapes import Bumpy, Cylinder, Ellipsoid, Sphere, lowest, truths
from support.truth_shapes import alhazen, unit

from benchharness.kernels.vertices import mirrormesh, newton, starmap
from benchharness.kernels.vertices.sight import located, look_at
from benchharness.measure import truth
from benchharness.scene import Mesh
from scenes.props import bowls

LOWER = np.array([0.1, 0.2, -0.9])  # an eye below the hemisphere, looking up into it


def part(mesh: Mesh, keep) -> Mesh:
    used, faces = np.unique(mesh.faces[keep], return_inverse=True)
    return Mesh(mesh.vertices[used], faces.reshape(-1, 3), mesh.normals[used])


def hemisphere() -> Mesh:
    """The upper half of the unit sphere, looked at from inside."""
    ball = sphere(1.0, slices=96, stacks=48)
    return turned_over(part(ball, ball.vertices[ball.faces][:, :, 2].min(axis=1) > -1e-9))


def torus() -> Mesh:
    made = trimesh.creation.torus(1.0, 0.35, 96, 48)
    return Mesh(made.vertices, made.faces)


def scaled(half) -> Mesh:
    """An ellipsoid of an icosphere's facets, which a linear map leaves convex."""
    ball = Sphere().mesh(4)
    return Mesh(ball.vertices * half, ball.faces, unit(ball.vertices / half))


MESHES = {
    "icosphere": Sphere().mesh(4),
    "meridians": sphere(1.0, slices=96, stacks=48),
    "ellipsoid": scaled((1.0, 0.6, 1.4)),
    "hemisphere": hemisphere(),
    "torus": torus(),
    "bumpy": Bumpy(eps=0.3).mesh(5),
}
CONVEX = ("icosphere", "meridians", "ellipsoid")


@cache
def ready(name: str) -> mirrormesh.MirrorMesh:
    mesh = MESHES[name]
    return mirrormesh.build(mesh.vertices, mesh.normals, mesh.faces)


def around(seed, count, least=1.8):
    rng = np.random.default_rng(seed)
    return unit(rng.normal(size=(count, 3))) * rng.uniform(least, 5, (count, 1))


@cache
def case(name: str):
    """(V [N, 3], eye, target, solution, sight) of a mesh and vertices all around it, or within it."""
    V, eye, target = around(4, 300), EYE, (0.0, 0.0, 0.0)
    if name == "hemisphere":
        V = np.random.default_rng(3).uniform(-0.6, 0.6, (300, 3)) * [1, 1, 0.7] - [0, 0, 0.3]
        eye, target = LOWER, (0.0, 0.0, 1.0)
    return V, eye, target, *walked(ready(name), place(V, eye, target))


def true_points(name: str, V, eye, near):
    """The true reflection point of each vertex that is nearest to `near`; NaN for none."""
    mesh = MESHES[name]
    return truth.nearest(*truth.reflection_points(mesh.vertices, mesh.normals, mesh.faces, eye, V, near), near)


def all_finite(s) -> bool:
    return all(np.isfinite(np.array(value)).all() for value in (s.on.b, s.R, s.n, s.residual))


# Answers.


@pytest.mark.parametrize("name", MESHES)
def test_what_converged_is_within_a_hundredth_of_a_pixel_of_a_true_point(name):
    V, eye, target, s, _ = case(name)
    converged = np.array(s.converged)
    R = host(s.R)
    assert all_finite(s) and np.array(s.iterations).max() <= 60
    assert converged.mean() > 0.7
    off = off_px(R, true_points(name, V, eye, R), eye, target)
    # The oracle itself may fail on the slivers at the poles of meridians.
    assert np.isfinite(off[converged]).mean() > 0.99
    assert np.nanmax(off[converged]) < 0.01
    # The three conditions, with the normal that belongs to the point.
    n, R, V = host(s.n)[converged], R[converged], V[converged]
    h = unit(unit(eye - R) + unit(V - R))
    assert np.linalg.norm(h - n, axis=1).max() < 2e-3
    np.testing.assert_allclose(np.array(s.residual)[converged], np.linalg.norm(h - n, axis=1), atol=1e-5)
    assert (((eye - R) * n).sum(1) > 0).all() and (((V - R) * n).sum(1) > 0).all()


@pytest.mark.parametrize("name", MESHES)
def test_a_point_and_its_normal_are_those_of_its_place_on_the_mesh(name):
    s = case(name)[3]
    mesh, (b1, b2) = MESHES[name], np.array(s.on.b, np.float64)
    weights = np.stack([1 - b1 - b2, b1, b2], axis=1)
    assert weights.min() > -1e-6
    faces = mesh.faces[np.array(s.on.triangle)]
    np.testing.assert_allclose(host(s.R), (weights[..., None] * mesh.vertices[faces]).sum(1), atol=2e-6)
    np.testing.assert_allclose(host(s.n), unit((weights[..., None] * mesh.normals[faces]).sum(1)), atol=2e-6)


@pytest.mark.parametrize("name", CONVEX)
def test_on_a_convex_mirror_all_that_is_not_hidden_converges_and_nothing_else(name):
    _, _, _, s, sight = case(name)
    hidden = np.array(sight.shadow)
    assert 20 < hidden.sum() < 100
    np.testing.assert_array_equal(np.array(s.converged), ~hidden)


@pytest.mark.parametrize("low", [0.5, 0.2, 0.02])
def test_grazing_or_not_it_takes_a_few_points(low):
    """F-01: where secants need 13 to 15 samples on average."""
    V, R = truths(Sphere(), EYE, 0, 300, low, {0.5: 1.0, 0.2: 0.5, 0.02: 0.2}[low])
    s, _ = walked(ready("icosphere"), place(V))
    assert np.array(s.converged).all()
    assert np.array(s.iterations).mean() < 4.5
    # The mesh is not the sphere: its chords lie 1e-3 beneath it, 0.3 px, and more where it is seen at a slant.
    assert np.median(off_px(host(s.R), R)) < 0.5
    assert off_px(host(s.R), true_points("icosphere", V, EYE, R)).max() < 0.01


def test_a_cold_search_on_a_mirror_with_several_points_finds_one_for_nearly_every_vertex():
    for name, least in (("torus", 0.98), ("bumpy", 0.75), ("hemisphere", 0.99)):
        assert np.array(case(name)[3].converged).mean() > least, name


def test_saddles_and_maxima_of_the_paths_length_are_found_too():
    """T9: on the inside of a sphere, l is least for vertices near the mirror, a saddle beyond a focus, and then largest."""
    rng, eye = np.random.default_rng(11), np.array([0.9, 0.1, -0.6])
    R = unit(rng.normal(size=(900, 3)) * [1, 1, 0.5] + [0, 0, 0.8])
    R = R[R[:, 2] > 0.2][:600]
    w = unit(eye - R)
    V = R + rng.uniform(0.1, 1.4, (len(R), 1)) * (2 * (w * -R).sum(1)[:, None] * -R - w)
    l = np.linalg.eigvalsh(secant_oracle._local(Sphere(), eye, V, R)[1])
    kinds = [l[:, 0] > 0, (l[:, 0] < 0) & (l[:, 1] > 0), l[:, 1] < 0]

    where, everywhere = place(V, eye, (-0.2, 0.0, 0.6)), dr.full(mi.Bool, True, len(V))
    aside = unit(R + 0.01 * np.cross(R, unit(rng.normal(size=R.shape))))
    first, met = located(ready("hemisphere"), mi.Point3f(0), mi.Vector3f(points(aside)), everywhere)
    s, _ = walked(ready("hemisphere"), where, first)
    back = np.array(s.converged) & (np.linalg.norm(host(s.R) - R, axis=1) < 0.01)
    steep = np.abs(l).min(axis=1) > 0.2  # elsewhere a hundredth may be over a fold of the image
    assert np.array(met).all()
    for kind in kinds:
        assert (kind & steep).sum() > 30
        assert back[kind & steep].mean() > 0.99
    # From a cold start it finds some point for most of them, which themselves may be beyond the wall.
    s, _ = walked(ready("hemisphere"), where)
    assert np.array(s.converged).mean() > 0.9


def test_at_a_focus_where_the_hessian_is_singular_it_stays_finite_and_ends():
    """F-21: one over the distances is 2 kappa / c at the tangential focus (T9), 2 kappa c at the sagittal."""
    R = unit(np.array([0.2, 0.1, 1.0]))
    n, t = -R, unit(np.cross(R, [0.0, 1.0, 0.0]))
    V = []
    for cosine in (1.0, 0.8, 0.5):
        w = cosine * n + np.sqrt(1 - cosine**2) * t
        eye = R + 1.5 * w
        for focus in (2 / cosine, 2 * cosine):
            d = 1 / (focus - 1 / 1.5)
            if d > 0:
                V += [(eye, R + (d + off) * (2 * (w @ n) * n - w)) for off in (-1e-3, 0.0, 1e-3)]
    for eye, v in V:
        s, _ = walked(ready("hemisphere"), place(v[None], eye, R))
        assert all_finite(s) and np.array(s.iterations)[0] <= 60
        if np.array(s.converged)[0]:
            # The image is blown up without bounds: of R only the half vector is certain.
            h = unit(unit(eye - host(s.R)[0]) + unit(v - host(s.R)[0]))
            np.testing.assert_allclose(h, host(s.n)[0], atol=2e-3)


def test_between_the_foci_of_an_ellipsoid_every_point_will_do():
    shape = Ellipsoid(half=(1.0, 1.0, 1.4))
    inner, focus = turned_over(shape.mesh(4)), np.array([0.0, 0.0, np.sqrt(1.4**2 - 1)])
    s, _ = walked(mirrormesh.build(inner.vertices, inner.normals, inner.faces), place(-focus[None], focus, -focus))
    assert all_finite(s) and np.array(s.iterations)[0] <= 60
    R = host(s.R)[0]
    np.testing.assert_allclose(np.linalg.norm(R / [1, 1, 1.4]), 1, atol=3e-3)
    assert np.array(s.residual)[0] < 0.02  # the mesh is not the ellipsoid


# Degenerate places.


def test_places_far_away_on_the_axis_and_inside():
    V = np.array([[3e5, -9e5, 1e4], [0, 1e5, -1e6], [0, 0, 3], [0, 0, 4], [0, 0, 9], [0, 0, -3], [0, 0, 0], [0.3, 0.1, 0.4]])
    s, sight = walked(ready("icosphere"), place(V))
    reflected = [True, False, True, True, True, False, False, False]
    assert all_finite(s)
    np.testing.assert_array_equal(np.array(s.converged), reflected)
    np.testing.assert_array_equal(np.array(sight.shadow), ~np.array(reflected))
    np.testing.assert_allclose(host(s.R)[[2, 3, 4]], [[0, 0, 1]] * 3, atol=1e-5)
    assert off_px(host(s.R)[:1], alhazen(EYE, V[0])[None])[0] < 1


def on_the_mesh(count: int, low: float, high: float):
    """(P, N) [count, 3]: random points of the icosphere's facets whose normals have a cosine in (low, high] to the eye."""
    mesh, rng = MESHES["icosphere"], np.random.default_rng(0)
    faces, b = mesh.faces[rng.integers(0, len(mesh.faces), 40 * count)], rng.dirichlet([1, 1, 1], 40 * count)[..., None]
    P, N = (b * mesh.vertices[faces]).sum(1), unit((b * mesh.normals[faces]).sum(1))
    cosine = (unit(EYE - P) * N).sum(1)
    chosen = np.flatnonzero((cosine > low) & (cosine <= high))[:count]
    assert len(chosen) == count
    return P[chosen], N[chosen]


@pytest.mark.parametrize("height", [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 0.0])
def test_what_touches_the_mirror_is_reflected_where_it_touches(height):
    """F-29. At a height h, on a plane, R is h / cos away from V; cos > 0.5."""
    P, N = on_the_mesh(200, 0.5, 1.0)
    V = P + height * N
    s, sight = walked(ready("icosphere"), place(V))
    assert all_finite(s)
    assert np.array(s.converged).all() and not np.array(sight.shadow).any()
    assert np.linalg.norm(host(s.R) - V, axis=1).max() < 2.1 * height + 2e-5  # 0.004 px
    assert np.array(s.iterations).max() <= 12
    # Grazing, a few in a hundred are lost between a thousandth and a hundred-thousandth; they say so.
    P, N = on_the_mesh(200, 0.1, 0.5)
    s, _ = walked(ready("icosphere"), place(P + height * N))
    assert all_finite(s)
    converged = np.array(s.converged)
    assert converged.mean() > 0.9
    assert np.linalg.norm(host(s.R) - P, axis=1)[converged].max() < 15 * height + 1e-5


@pytest.mark.parametrize("depth", [1e-3, 1e-2, 0.3])
def test_what_is_inside_the_mirror_is_hidden(depth):
    """F-30."""
    P, N = on_the_mesh(200, 0.3, 1.0)
    s, sight = walked(ready("icosphere"), place(P - depth * N))
    assert np.array(sight.shadow).all()
    assert not np.array(s.converged).any() and not np.array(sight.touches).any()


# Where it starts, and how it goes.


def test_from_the_answer_it_takes_one_point():
    V, eye, target, s, _ = case("bumpy")
    again, _ = walked(ready("bumpy"), place(V, eye, target), s.on)
    converged = np.array(s.converged)
    assert (np.array(again.iterations)[converged] == 1).all()
    assert np.array(again.R)[:, converged].tobytes() == np.array(s.R)[:, converged].tobytes()


def test_max_iter_is_obeyed_and_what_gave_up_far_away_did_not_converge():
    V, eye, target, s, _ = case("icosphere")
    few, _ = walked(ready("icosphere"), place(V, eye, target), max_iter=2)
    assert np.array(few.iterations).max() == 2
    off = off_px(host(few.R), host(s.R))
    converged = np.array(few.converged)
    # "Converged" promises that the next step would be a quarter of a pixel, and steps shrink quickly.
    assert off[converged].max() < 0.5
    assert 0.05 < converged.mean() < np.array(s.converged).mean() - 0.05


def test_inactive_lanes_are_not_walked():
    V, eye, target, s, _ = case("icosphere")
    where, some = place(V, eye, target), np.arange(len(V)) % 3 == 0
    first, promising = newton.best_candidate(ready("icosphere"), where, mi.Bool(some))
    assert not np.array(promising)[~some].any()
    few = newton.walk(ready("icosphere"), where, first, mi.Bool(some), mi.UInt32(60))
    assert not np.array(few.converged)[~some].any() and (np.array(few.iterations)[~some] == 0).all()
    np.testing.assert_array_equal(np.array(few.converged)[some], np.array(s.converged)[some])


def test_candidates_are_spread_over_the_whole_mirror():
    for name in ("torus", "hemisphere"):
        mesh = MESHES[name]
        middles = mesh.vertices[mesh.faces].mean(axis=1)
        chosen = np.array(ready(name).candidates)
        assert len(np.unique(chosen)) == mirrormesh.CANDIDATES
        gap = np.linalg.norm(middles[:, None] - middles[chosen], axis=2).min(axis=1).max()
        apart = np.linalg.norm(middles[chosen][:, None] - middles[chosen], axis=2)
        # Each is the farthest from those before it: no two are closer than the widest gap that is left.
        assert apart[~np.eye(len(chosen), dtype=bool)].min() >= gap - 1e-12
    small = quad((-1, 0, -1), (2, 0, 0), (0, 0, 2))
    assert sorted(np.array(mirrormesh.build(small.vertices, small.normals, small.faces).candidates)) == [0, 1]


def test_a_cold_search_starts_at_the_candidate_that_agrees_best():
    """The oracle tries them all: cosine of half vector and normal, those with the eye and V in front first."""
    V, eye, target, _, _ = case("torus")
    mirror, mesh = ready("torus"), MESHES["torus"]
    got, promising = newton.best_candidate(mirror, place(V, eye, target), dr.full(mi.Bool, True, len(V)))
    chosen = np.array(mirror.candidates)
    P, N = mesh.vertices[mesh.faces[chosen]].mean(axis=1), unit(mesh.normals[mesh.faces[chosen]].sum(axis=1))
    w_E, w_V = unit(eye - P), unit(V[:, None] - P)
    front = ((w_E * N).sum(-1) > 0) & ((w_V * N).sum(-1) > 0)
    cosine = (unit(w_E + w_V) * N).sum(-1)
    score = cosine - np.where(front, 0, 2)
    at = np.array([np.flatnonzero(chosen == t)[0] for t in np.array(got.triangle)])
    np.testing.assert_allclose(score[np.arange(len(V)), at], score.max(axis=1), atol=1e-6)
    np.testing.assert_allclose(np.array(got.b), 1 / 3, atol=1e-7)
    assert np.array(promising).all()
    _, promising = newton.best_candidate(mirror, place(V, eye, target), dr.full(mi.Bool, True, len(V)), briefly=mi.Bool(True))
    near = cosine[:, : newton.BRIEFLY].max(axis=1)
    clear = np.abs(near - newton.PROMISING) > 1e-5
    np.testing.assert_array_equal(np.array(promising)[clear], near[clear] > newton.PROMISING)


@pytest.mark.parametrize("name", ["icosphere", "torus"])
def test_a_ray_from_a_centre_says_where_on_the_mesh(name):
    u, mesh = unit(np.random.default_rng(5).normal(size=(200, 3))), MESHES[name]
    centre = (0.0, 0.0, 0.0) if name == "icosphere" else (1.0, 0.0, 0.0)  # within the tube
    on, met = located(ready(name), mi.Point3f(*centre), mi.Vector3f(points(u)), dr.full(mi.Bool, True, len(u)))
    assert np.array(met).all()
    b1, b2 = np.array(on.b, np.float64)
    corners = mesh.vertices[mesh.faces[np.array(on.triangle)]]
    P = (1 - b1 - b2)[:, None] * corners[:, 0] + b1[:, None] * corners[:, 1] + b2[:, None] * corners[:, 2]
    np.testing.assert_allclose(unit(P - centre), u, atol=2e-6)
    none, met = located(ready(name), mi.Point3f(9, 0, 0), mi.Vector3f(1, 0, 0), dr.full(mi.Bool, True, 1))
    assert not np.array(met).any() and np.array(none.triangle)[0] == 0


def test_rays_do_not_slip_through_edges_that_they_run_along():
    """As the texels of a star map and the meridians of a mesh do."""
    u = starmap.directions(64)
    _, met = located(ready("meridians"), mi.Point3f(0), mi.Vector3f(points(u)), dr.full(mi.Bool, True, len(u)))
    assert np.array(met).all()


def test_a_step_is_newtons_for_half_vector_and_interpolated_normal():
    """On one triangle, as large as its normals' turn: the float64 oracle's equations, with numerical derivatives."""
    rng = np.random.default_rng(12)
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.1, 0.2], [0.2, 0.9, -0.1]])
    normals = unit(np.cross(corners[1], corners[2]) + 0.4 * rng.normal(size=(3, 3)))
    mirror = mirrormesh.build(corners, normals, np.array([[0, 1, 2]]))
    # Vertices made from their reflection points, looked at from beside them: a little, or as far as the triangle reaches.
    b = rng.uniform(0.1, 0.45, (200, 2))
    weights = np.column_stack([1 - b.sum(axis=1), b])
    R, N = weights @ corners, unit(weights @ normals)
    w = unit(EYE - R)
    V = R + rng.uniform(0.3, 2, (200, 1)) * (2 * (w * N).sum(axis=1, keepdims=True) * N - w)
    b = b + rng.uniform(-1, 1, (200, 2)) * np.where(np.arange(200) < 150, 0.05, 0.3)[:, None]
    on = mirrormesh.SurfacePoint(dr.zeros(mi.UInt32, 200), mi.Point2f(b.T.astype(np.float32)))
    at = newton.newton_step(mirror, place(V), on, True)
    p, n = np.broadcast_to(corners, (200, 3, 3)), np.broadcast_to(normals, (200, 3, 3))

    def f(b):
        return truth._mismatch(b, p, n, truth._tangents(p), EYE, V)[0]

    h = 1e-6
    J = np.stack([(f(b + h * d) - f(b - h * d)) / (2 * h) for d in np.eye(2)], axis=-1)
    expected = np.linalg.solve(J, -f(b)[..., None])[..., 0]
    got = np.array(at.step_b, np.float64).T
    edges, longest = corners[1:] - corners[0], newton.LONGEST * np.array(mirror.size)[0]
    far = np.linalg.norm(expected @ edges, axis=1) > longest
    assert 5 < far.sum() < 100
    np.testing.assert_allclose(got[~far], expected[~far], atol=1e-4)
    # A step that would be longer has the same direction, and is as long as allowed.
    length = np.linalg.norm(got @ edges, axis=1)
    np.testing.assert_allclose(length[far], longest, rtol=1e-4)
    np.testing.assert_allclose(unit(got)[far], unit(expected)[far], atol=2e-3)
    np.testing.assert_allclose(host(at.step), got @ edges, atol=1e-5)


def test_what_touches_a_sheet_on_the_side_that_is_no_mirror_is_not_reflected():
    mesh = turned_over(hemisphere())  # looks outward
    V = unit(np.array([[0.1, 0.2, 1.0], [-0.3, 0.1, 0.8]]))
    onto = mesh.vertices[np.linalg.norm(mesh.vertices - V[:, None], axis=2).argmin(axis=1)] * (1 - 1e-7)
    for backs in (True, False):
        s, sight = walked(mirrormesh.build(mesh.vertices, mesh.normals, mesh.faces, backs), place(onto, LOWER, (0.0, 0.0, 1.0)))
        assert np.array(sight.touches).all()
        assert (np.array(s.converged) == backs).all()


# What stands between.


@pytest.mark.parametrize("shape", [Sphere(), Ellipsoid(half=(1.0, 0.6, 1.4))], ids=["sphere", "ellipsoid"])
def test_a_shadow_is_where_the_way_from_the_eye_runs_through(shape):
    V = around(6, 800, least=0.2)
    V = V[np.abs(shape.height(V)) > 0.02]
    deep = lowest(shape, EYE, V)
    mesh = shape.mesh(4)
    sight = look_at(mirrormesh.build(mesh.vertices, mesh.normals, mesh.faces), place(V), dr.full(mi.Bool, True, len(V)))
    clear = (deep < -0.02) | (deep > 0)  # the mesh lies up to 0.01 beneath the shape
    assert 100 < (deep < -0.02).sum() < len(V) - 100
    np.testing.assert_array_equal(np.array(sight.shadow)[clear], (deep < 0)[clear])
    assert not (np.array(sight.touches) | np.array(sight.near) & np.array(sight.shadow)).any()


def test_nothing_is_in_the_shadow_of_what_lies_behind_it_or_of_where_it_stands():
    P, N = on_the_mesh(100, 0.3, 1.0)
    for V, near, touches in ((P, True, True), (P + 0.005 * N, True, False), (P + 0.5 * N, False, False)):
        sight = look_at(ready("icosphere"), place(V), dr.full(mi.Bool, True, len(V)))
        assert not np.array(sight.shadow).any()
        assert np.array(sight.near).all() == near and np.array(sight.near).any() == near
        assert np.array(sight.touches).all() == touches and np.array(sight.touches).any() == touches
    inactive = look_at(ready("icosphere"), place(0 * P), dr.zeros(mi.Bool, len(P)))
    assert not np.array(inactive.shadow).any()


# Shapes.


@pytest.mark.parametrize(
    ("mesh", "convex"),
    [
        (Sphere().mesh(3), True),
        (sphere(1.0, (30.0, -20.0, 5.0)), True),
        (box((0, 0, 0), (1, 2, 0.1)), True),
        (scaled((1.0, 0.05, 1.4)), True),
        (Cylinder(half_length=2.0).mesh(3), True),
        (bowls.convex_bowl((0, 0, 0)).closed, True),
        (bowls.convex_bowl((0, 0, 0)).mesh, False),  # open below
        (quad((-1, 0, -1), (2, 0, 0), (0, 0, 2)), False),  # open
        (turned_over(Sphere().mesh(3)), False),  # a cave
        (box((0, 0, 0), (1, 1, 1), inside=True), False),
        (bowls.concave_bowl((0, 0, 0), (0, 0, 5)).closed, False),
        (torus(), False),
        (Bumpy(eps=0.3).mesh(4), False),
        (hemisphere(), False),
    ],
)
def test_convexity_is_known(mesh, convex):
    assert mirrormesh.is_convex(mesh.vertices, mesh.faces) is convex


@pytest.mark.exhaustive
def test_a_dent_makes_it_concave_and_rounding_does_not():
    mesh = Sphere().mesh(2)
    dent = mesh.vertices.copy()
    dent[7] *= 0.94  # its neighbours, 0.3 away, lie in a plane that is 0.045 lower than the sphere
    assert not mirrormesh.is_convex(dent, mesh.faces)
    # A hollow as wide as a fine mesh's cap is deeper at no single edge than 1e-5: rings 0.01 apart, a radius of 12.
    r = np.linspace(np.sqrt(1 - 0.9**2), 0, 44)
    angle = np.linspace(-np.pi / 2, np.arcsin(0.9), 200)
    round_ = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    round_[0, 0] = 0
    for bend, convex in ((0.0, True), (0.04, False)):
        cap = np.stack([r, 0.9 - bend * (1 - 0.9**2) + bend * r**2], axis=1)
        made = trimesh.creation.revolve(np.concatenate([round_[:-1], cap]), sections=256)
        assert mirrormesh.is_convex(made.vertices, made.faces) is convex
    rough = (mesh.vertices + 100).astype(np.float32).astype(np.float64)
    assert mirrormesh.is_convex(rough, mesh.faces)


# Invariance.


def test_the_order_of_vertices_and_their_company_changes_no_bit():
    V, eye, target, s, _ = case("torus")
    for seed in (0, 1):
        order = np.random.default_rng(seed).permutation(len(V))[: len(V) - 7 * seed]
        shuffled, _ = walked(ready("torus"), place(V[order], eye, target))
        for name in ("R", "n", "converged", "residual", "iterations"):
            there = np.ascontiguousarray(np.array(getattr(shuffled, name)))
            assert np.ascontiguousarray(np.array(getattr(s, name))[..., order]).tobytes() == there.tobytes(), name
