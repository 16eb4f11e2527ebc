"""An eye far from the mirror, with a field of view that the mirror fills: what float32 keeps of it.

A mirror of one unit around the origin takes up the same pixels from 3 units away as from 10,000. So it should be drawn as well.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.ray_oracle import first_hits, rays
from support.answers import off_px
from support.mirror_room import mirror_ball, scene, shaded, smooth, still, walls
from support.packed import numbers, packed
from support.tiers import first
from support.truth_shapes import unit

from benchharness.kernels import raster
from benchharness.render.frame import FrameRenderer, view_of
from benchharness.scene import Mesh, Reflector
from methods.image_space_search import ImageSpaceSearch
from methods.newton import Newton
from methods.secant_triangle import SecantTriangle

DISTANCES = (3.0, 60.0, 200.0, 1000.0, 10_000.0)
TOWARDS = unit(np.array([0.2, -1.7, 0.25]))
RADIUS = 0.5
WIDTH, HEIGHT = 96, 72
HALF = 2.0  # of the room


def camera(distance: float, reach: float = 1.15 * RADIUS):
    """From `distance` units away; what is `reach` above the middle is at the upper edge of the picture."""
    fov = 2 * np.degrees(np.arctan(reach / distance))
    return still(distance * TOWARDS, (0.013, 0.0, -0.021), fov)


def patch() -> Mesh:
    """A saddle, z = x y, 24 x 24 quads of it, with its own normals; open, and turned to the eye."""
    s, t = np.meshgrid(np.linspace(-0.4, 0.4, 25), np.linspace(-0.4, 0.4, 25))
    s, t = s.ravel(), t.ravel()
    across, up = unit(np.cross(TOWARDS, [0, 0, 1])), np.array([0, 0, 1.0])
    points = s[:, None] * across + t[:, None] * up + (2 * s * t)[:, None] * TOWARDS
    normals = unit(TOWARDS - 2 * t[:, None] * across - 2 * s[:, None] * up)
    i = (np.arange(24)[:, None] * 25 + np.arange(24)).ravel()
    faces = np.concatenate([np.stack([i, i + 1, i + 25], 1), np.stack([i + 1, i + 26, i + 25], 1)])
    return Mesh(points, faces[:, ::-1], normals)


MIRRORS = {"ball": mirror_ball(fine=24), "saddle": Reflector("saddle", patch())}


@pytest.mark.parametrize("distance", first(DISTANCES, [3.0, 10_000.0]))
@pytest.mark.parametrize("name", MIRRORS)
def test_the_first_hits_are_those_of_the_rays_through_the_pixels_centres(name, distance):
    made = scene((), (MIRRORS[name],), camera(distance))
    frame = FrameRenderer(made, WIDTH, HEIGHT).render(0)
    part, p, n, _, _ = first_hits(made, 0.0, WIDTH, HEIGHT)
    expected, active = part >= 0, np.array(frame.active)
    assert expected.sum() > 2000
    # Centres that an outline of 200 pixels comes within 1e-3 pixels of.
    assert (expected != active).sum() <= 3
    both = expected & active
    got, normal = np.array(frame.p, np.float64).T[both], np.array(frame.n, np.float64).T[both]
    pixel = 2 * 1.15 * RADIUS / HEIGHT  # units
    d = unit(rays(made.camera(0.0), WIDTH, HEIGHT)[both])
    off = got - p[both]
    across = np.linalg.norm(off - (off * d).sum(axis=1, keepdims=True) * d, axis=1) / pixel
    assert np.quantile(across, 0.99) < 0.002 and across.max() < 0.05
    # Along the ray, what is seen at a slant is off by as much more.
    slant = np.abs((n[both] * d).sum(axis=1))
    assert (np.linalg.norm(off, axis=1) * slant).max() / pixel < 0.05
    turn = np.degrees(np.linalg.norm(normal - n[both], axis=1))
    assert np.quantile(turn, 0.99) < 0.005 and turn.max() < 0.05


def room(distance: float):
    """A mirror ball in a room of smooth colours that is seen into from outside."""
    return scene((walls(HALF, 0.15),), (mirror_ball(),), camera(distance))


def in_the_room(o, d):
    """Radiance [N, 3] where rays from inside meet the walls."""
    with np.errstate(divide="ignore"):
        t = ((np.sign(d) * HALF - o) / d).min(axis=1)
    return smooth(o + t[:, None] * d)


def expected_in_ball(made, size):
    """Radiance that the ball shows, NaN beside it: [H, W, 3]."""
    d, eye = unit(rays(made.camera(0.0), *size)), np.asarray(made.camera(0.0).eye)
    b = d @ eye
    disc = b * b - (eye @ eye - RADIUS**2)
    inside = disc > 0
    p = eye + (-b - np.sqrt(np.maximum(disc, 0)))[:, None] * d
    n = unit(p)
    out = d - 2 * (d * n).sum(axis=1, keepdims=True) * n
    return np.where(inside[:, None], in_the_room(p, out), np.nan).reshape(size[1], size[0], 3)


SIZE = (160, 120)  # as `answers` has it
METHODS = {
    "image_space_search": ImageSpaceSearch(),
    "secant_triangle": SecantTriangle(),
    "secant_triangle, triangles of the screen": SecantTriangle(depth="screen_linear", hidden="drop", newton="off"),
    "newton": Newton(),
}
AT_HAND = {}


def told(name: str, distance: float) -> dict[str, float]:
    """What a method says and shows of the room."""
    if (name, distance) in AT_HAND:
        return AT_HAND[name, distance]
    made = room(distance)
    answer = shaded(METHODS[name], made, 0, size=SIZE)[0]
    vertices = answer.reflection.vertices
    off = off_px(answer, made, step=40)
    wrong = (answer.L - expected_in_ball(made, SIZE))[answer.active & answer.found]
    wrong = wrong[np.isfinite(wrong).all(axis=1)]
    AT_HAND[name, distance] = {
        "converged": float(np.array(vertices.converged)[: len(made.objects[0].mesh.vertices)].mean()),
        "off px": float(np.nanquantile(off, 0.95)),
        "unknown": float(np.isnan(off).mean()),
        "found": float(answer.found[answer.active].mean()),
        "rms": float(np.sqrt((wrong**2).mean())),
        "doubt": float(np.array(answer.reflection.doubt).reshape(answer.active.shape)[answer.active].mean()),
    }
    return AT_HAND[name, distance]


@pytest.mark.parametrize("distance", first([60.0, 1000.0, 10_000.0], [10_000.0]))
@pytest.mark.parametrize("name", first(METHODS, ["newton"]))
def test_vertices_find_their_reflections_from_far_as_well_as_from_near(name, distance):
    # Near: outside of the room, where half of the ball is seen almost as from far.
    near, far = told(name, 7.0), told(name, distance)
    assert near["converged"] > 0.9
    assert far["converged"] > 0.95 * near["converged"]
    # A secant's triangle closes in to within this of a root at a slant.
    assert far["off px"] < 0.05
    assert far["unknown"] <= 0.01
    assert far["found"] > near["found"] - 0.002
    # What is left is from straight edges, of which a few pixels' worth differ.
    assert far["rms"] < 1.2 * near["rms"] + 0.002
    assert abs(far["doubt"] - near["doubt"]) < 0.02


# The rasterizer.


def grid(n: int, away: float) -> tuple[np.ndarray, np.ndarray]:
    """A slanted square of (n - 1)² cells, `away` units towards the eye from the middle."""
    s, t = (x.ravel() for x in np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n)))
    across = unit(np.cross(TOWARDS, [0, 0, 1]))
    points = s[:, None] * across + t[:, None] * np.cross(across, TOWARDS) + (away + 0.7 * s)[:, None] * TOWARDS
    i = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    return points, np.concatenate([np.stack([i, i + 1, i + n], 1), np.stack([i + 1, i + n + 1, i + n], 1)])


@pytest.mark.parametrize("distance", first(DISTANCES, [3.0, 10_000.0]))
@pytest.mark.parametrize("away", [-1.0, 0.0, 1.0])
def test_of_two_surfaces_a_ten_thousandth_apart_the_nearer_is_seen(distance, away):
    # Cells of one and a half pixels: their planes of nearness are told from depths that hardly differ.
    (behind, back), (front, faces) = grid(100, away - 1e-4), grid(90, away)
    points, indices = packed(np.concatenate([behind, front]), np.concatenate([back, faces + len(behind)]))
    view = view_of(camera(distance)(0.0), WIDTH, HEIGHT, 0.01)
    winner = numbers(raster.rasterize(points, indices, len(back) + len(faces), view), view)
    covered = winner != raster.NONE  # from 3 units, the picture is wider than the sheet
    assert covered.mean() > 0.9
    assert (winner >= len(back))[covered].all()


def crossed(rng, distance: float, size: float, thin: float, count: int):
    """Rays of `camera` and triangles near them: pixels [N], corners [N, 3, 3], float32 numbers, points and directions."""
    lens = camera(distance)(0.0)
    pixel = rng.integers(0, WIDTH * HEIGHT, count)
    d = rays(lens, WIDTH, HEIGHT)[pixel]
    o = np.asarray(lens.eye) + distance * d
    one, other = (unit(rng.normal(size=(count, 3))) for _ in range(2))
    one, other = size * one, size * thin * other
    at = o + rng.uniform(-1, 1, (count, 1)) * d
    share = rng.uniform(-0.5, 1.5, (count, 2))
    a = at - share[:, :1] * one - share[:, 1:] * other
    return pixel, np.stack([a, a + one, a + other], axis=1).astype(np.float32).astype(np.float64), o, d


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 1 << 32), distance=st.sampled_from(DISTANCES), size=st.floats(-3, 5), thin=st.floats(-4, 0),
)  # fmt: skip
def test_a_ray_meets_a_triangle_of_any_shape_where_it_does_in_double_precision(seed, distance, size, thin):
    count = 256
    pixel, corners, o, d = crossed(np.random.default_rng(seed), distance, 10.0**size, 10.0**thin, count)
    points, indices = packed(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))
    view = view_of(camera(distance)(0.0), WIDTH, HEIGHT, 0.01)
    _, weights, p = raster.met(points, indices, dr.arange(mi.UInt32, count), view, mi.UInt32(pixel.astype(np.uint32)))
    weights, p = np.array(weights, np.float64).T, np.array(p, np.float64).T
    assert (weights >= 0).all()
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-6)
    np.testing.assert_allclose(p, np.einsum("nk,nki->ni", weights, corners), atol=4e-7 * np.abs(corners).max())

    a, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(ab, ac)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = ((a - o) * normal).sum(axis=1) / (d * normal).sum(axis=1)
        met = o + t[:, None] * d
        of_c = (np.cross(ab, met - a) * normal).sum(axis=1) / (normal**2).sum(axis=1)
        of_b = (np.cross(met - a, ac) * normal).sum(axis=1) / (normal**2).sum(axis=1)
        # Rounding of lengths up to the triangle and of it, times the slants of the ray and of the edges to each other.
        slant = np.abs((d * normal).sum(axis=1)) / np.prod([np.linalg.norm(x, axis=1) for x in (d, ab, ac)], axis=0)
        near = np.linalg.norm(o - a, axis=1) + np.linalg.norm(ab, axis=1) + np.linalg.norm(ac, axis=1) + 1
        rounding = 2e-6 * near / slant
        height = np.linalg.norm(normal, axis=1) / np.max([np.linalg.norm(x, axis=1) for x in (ab, ac, ac - ab)], axis=0)
        least = 3 * rounding / height
    exact = np.stack([1 - of_b - of_c, of_b, of_c], axis=1).min(axis=1)
    # In between, rounding may take the point to an edge.
    inside, misses = exact > least, exact < -least
    assert (np.linalg.norm(p - met, axis=1) <= rounding)[inside].all()
    assert (weights.min(axis=1) == 0)[misses].all()
    if size > -2 and thin > -1:
        assert inside.mean() > 0.03 and misses.mean() > 0.3


@pytest.mark.parametrize("distance", first(DISTANCES, [3.0, 10_000.0]))
def test_a_triangle_without_area_or_seen_edge_on_is_met_in_numbers(distance):
    pixel, corners, _, d = crossed(np.random.default_rng(3), distance, 0.3, 1.0, 90)
    corners[:30] = corners[:30, :1]  # a point
    corners[30:60, 2] = 0.5 * (corners[30:60, 0] + corners[30:60, 1])  # a line
    corners[60:, 2] = corners[60:, 0] + 0.3 * d[60:]  # edge-on
    points, indices = packed(corners.reshape(-1, 3), np.arange(270).reshape(-1, 3))
    view = view_of(camera(distance)(0.0), WIDTH, HEIGHT, 0.01)
    _, weights, p = raster.met(points, indices, dr.arange(mi.UInt32, 90), view, mi.UInt32(pixel.astype(np.uint32)))
    weights, p = np.array(weights, np.float64).T, np.array(p, np.float64).T
    assert (weights >= 0).all() and np.isfinite(p).all()
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-6)
    np.testing.assert_allclose(weights[:30], 1 / 3, atol=1e-6)
