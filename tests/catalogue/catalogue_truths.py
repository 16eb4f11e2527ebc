"""Closed forms, T2 to T9 of the catalogue, and how many reflections a bowl shows."""

from __future__ import annotations

from functools import cache

import drjit as dr
import mitsuba as mi
import numpy as np
from catalogue.catalogue_row import Elsewhere, Row, drawn_again
from oracles import secant_oracle
from support.newton_meshes import turned_over, walked
from support.placed import host, place, points
from support.star_shapes import Ellipsoid, Sphere
from support.truth_shapes import Quadric, alhazen, unit

from benchharness.kernels import optics
from benchharness.kernels.vertices import mirrormesh, sight

LOWER, UPPER = np.array([0.0, 0.0, -0.6]), np.array([0.0, 0.0, 1.0])


def quartic(eye, V):
    """Points of the unit circle in the plane of the eye, V and the centre at which the law holds up to signs, [K, 3]."""
    x = unit(eye)
    y = unit(np.cross(np.cross(eye, V), x))
    A, B = np.linalg.norm(eye), complex(V @ x, V @ y)
    z = np.roots([A * np.conj(B), -(A + np.conj(B)), 0, A + B, -A * B])
    z = z[np.abs(np.abs(z) - 1) < 1e-6]
    return z.real[:, None] * x + z.imag[:, None] * y


def half_vectors(R, eye, V):
    return unit(unit(eye - R) + unit(V - R))


@cache
def outside() -> dict[str, float]:
    """2000 pairs of points outside of a sphere, 1.05 to 6 from its centre."""
    rng, odd, unlike, law, apart = np.random.default_rng(0), 0, 0, 0.0, 0.0
    for i in range(2000):
        eye, V = unit(rng.normal(size=(2, 3))) * rng.uniform(1.05, 6, (2, 1))
        R = quartic(eye, V)
        odd += len(R) != 4
        off = np.linalg.norm(half_vectors(R, eye, V) - R, axis=1)
        R, off = R[off < 1e-6], off[off < 1e-6]  # with E and V in front, by the sign of the half vector
        misses = not Quadric((1.0, 1.0, 1.0)).hit(eye, V - eye) < 1
        front = ((eye - R) * R).sum(1) > 0
        unlike += front.sum() != misses
        law = max(law, off[front].max(initial=0))
        if i < 100 and misses:
            apart = max(apart, float(np.linalg.norm(alhazen(eye, V) - R[front][0])))
    return {"odd": odd, "unlike": unlike, "law": law, "apart": apart}


def four_inside() -> int:
    """Of 3000 pairs inside, uniform in their distances from the centre: those with four reflections."""
    rng = np.random.default_rng(0)
    pairs = (unit(rng.normal(size=(2, 3))) * rng.uniform(size=(2, 1)) for _ in range(3000))
    return sum(len(quartic(*pair)) == 4 for pair in pairs)


def cylinder() -> float:
    """T3: the largest |half vector - normal| of the closed form."""
    rng, worst = np.random.default_rng(0), 0.0
    for _ in range(100):
        angle, z = rng.uniform(0, 2 * np.pi), rng.uniform(-1, 1)
        n = np.array([np.cos(angle), np.sin(angle), 0])
        w = unit(np.array([*rng.normal(size=2), rng.normal()]))
        w = w if w @ n > 0 else w - 2 * (w @ n) * n
        made = n + np.array([0, 0, z])
        eye, V = made + rng.uniform(0.2, 4) * w, made + rng.uniform(0.2, 4) * (2 * (w @ n) * n - w)
        R = alhazen(eye * [1, 1, 0], V * [1, 1, 0])
        a, b = np.linalg.norm(eye[:2] - R[:2]), np.linalg.norm(V[:2] - R[:2])
        R[2] = (eye[2] * b + V[2] * a) / (a + b)
        worst = max(worst, float(np.linalg.norm(half_vectors(R, eye, V) - R * [1, 1, 0])))
    return worst


@cache
def focal() -> dict[str, float]:
    """T5, T6: an ellipsoid seen from a focus, from inside."""
    half, focus = np.array([1.0, 1.0, 1.4]), np.array([0.0, 0.0, np.sqrt(1.4**2 - 1)])
    shape, rng = Ellipsoid(half=tuple(half)), np.random.default_rng(0)
    V = unit(rng.normal(size=(200, 3))) * rng.uniform(0.1, 0.6, (200, 1))
    d = unit(V + focus)
    s = 1 / half**2
    A, B, C = (d * d) @ s, -(d * focus) @ s, (focus * focus) @ s - 1
    exits = [-focus + ((-B + side * np.sqrt(B * B - A * C)) / A)[:, None] * d for side in (-1, 1)]
    law = max(np.linalg.norm(half_vectors(R, focus, V) + shape.normal(R), axis=1).max() for R in exits)
    # A walk that starts a hundredth beside the first comes to it; the second is behind the eye, where nothing has a pixel.
    inner = turned_over(shape.mesh(5))
    mesh, R = mirrormesh.build(inner.vertices, inner.normals, inner.faces), exits[0]
    aside = unit(R + 0.01 * np.cross(R, unit(rng.normal(size=R.shape))))
    everywhere = dr.full(mi.Bool, True, len(R))
    first, _ = sight.located(mesh, mi.Point3f(0), mi.Vector3f(points(aside)), everywhere)
    walk, _ = walked(mesh, place(V, focus, -focus), first)
    off = np.where(np.array(walk.converged), np.linalg.norm(host(walk.R) - R, axis=1), np.inf)
    P = shape.points(rng, 1000)
    length = np.linalg.norm(P - focus, axis=1) + np.linalg.norm(P + focus, axis=1)
    return {"law": law, "walk": off.max(), "spread": np.ptp(length)}


def paraboloid() -> float:
    """T7: how far from the focus the reflected rays of z = (x^2 + y^2) / 4f pass, f = 0.7, seen along its axis."""
    x, y = np.random.default_rng(0).uniform(-1, 1, (2, 500))
    P, n = np.stack([x, y, (x * x + y * y) / 2.8], 1), unit(np.stack([-x / 1.4, -y / 1.4, np.ones(500)], 1))
    r = host(optics.reflect(mi.Vector3f(0, 0, 1), mi.Normal3f(points(n))))
    to = np.array([0, 0, 0.7]) - P
    return float(np.linalg.norm(to - (to * r).sum(1, keepdims=True) * r, axis=1).max())


def focal_hessians() -> float:
    """T9: the least eigenvalue of the path length's Hessian at the focal distances of a hollow unit sphere."""
    R, t, worst = np.array([[0.0, 0.0, 1.0]]), np.array([1.0, 0.0, 0.0]), 0.0
    for cosine in (1.0, 0.8, 0.5, 0.3):
        w = -cosine * R[0] + np.sqrt(1 - cosine**2) * t
        for power in (2 / cosine, 2 * cosine):
            if power > 1 / 1.5:
                V = R + (2 * (w @ -R[0]) * -R[0] - w) / (power - 1 / 1.5)
                H = secant_oracle._local(Sphere(), R[0] + 1.5 * w, V, R)[1]
                worst = max(worst, float(np.abs(np.linalg.eigvalsh(H)).min()))
    return worst


@cache
def walks_in_a_ball(z: float) -> int:
    """F-20: different points that Newton's walks from 1000 places of a whole hollow ball come to, for V = (0.1, 0, z)."""
    inner = turned_over(Sphere().mesh(5))
    mesh = mirrormesh.build(inner.vertices, inner.normals, inner.faces)
    u = unit(np.random.default_rng(0).normal(size=(1000, 3)))
    everywhere = dr.full(mi.Bool, True, len(u))
    first, _ = sight.located(mesh, mi.Point3f(0), mi.Vector3f(points(u)), everywhere)
    walk, _ = walked(mesh, place(np.tile([0.1, 0, z], (len(u), 1)), LOWER, UPPER), first)
    found: list[np.ndarray] = []
    for R in host(walk.R)[np.array(walk.converged)]:
        if all(np.linalg.norm(R - other) > 0.03 for other in found):
            found.append(R)
    return len(found)


def in_a_ball(z: float) -> int:
    return len(quartic(LOWER, np.array([0.1, 0.0, z])))


ROWS: list[Row | Elsewhere] = [
    Row("T2", "pairs outside with other than 4 unit roots, of 2000", "0", lambda: outside()["odd"], 0, 0, "a theorem"),
    Row("T2", "pairs whose valid roots are not 1 if the segment misses, 0 if it hits", "0", lambda: outside()["unlike"], 0, 0,
        "a theorem: a shadow ray decides region C"),
    Row("T2", "largest |B - n| of a valid root", "2e-13", lambda: outside()["law"], 0, 2e-12,
        "double roots lose half the digits"),
    Row("T2", "largest distance of quartic and bisection (100 pairs)", "1.6e-13", lambda: outside()["apart"], 0, 2e-12,
        "the same"),
    Row("T2", "pairs inside with 4 reflections, of 3000", "217", four_inside, *drawn_again(217, 3000),
        "distances drawn uniformly from 0 to 1; uniform in the ball: 800, in the disc: 666"),
    Row("T3", "largest |B - n| on a cylinder", "2e-11", cylinder, 0, 2e-11, "by bisection: rounding of short ways"),
    Elsewhere("T3", "points on a cylinder", "-", "1e-9",
        "test_newton_oracle.py::test_on_a_cylinder_the_points_are_the_circles_at_heights_by_the_ways_ratio"),
    Row("T5", "largest |B - n| at both exits of the line through V and the other focus", "6e-15", lambda: focal()["law"], 0,
        1e-14,
        "float64"),
    Row("T5", "how far Newton's walks end from the exit in view", "not measured", lambda: focal()["walk"], 0, 2e-3,
        "facets of 0.03 sag 1e-4, and turn the normal by as much"),
    Row("T6", "spread of the path's length between the foci", "2e-15", lambda: focal()["spread"], 0, 4e-15,
        "a few roundings of 2.8"),
    Elsewhere("T6", "searches between the foci", "finite", "finite",
        "test_secant.py::test_between_the_foci_where_all_paths_are_equally_long_it_is_finite_and_ends"),
    Elsewhere("T6", "walks between the foci", "finite", "finite",
        "test_newton.py::test_between_the_foci_of_an_ellipsoid_every_point_will_do"),
    Row("T7", "largest distance of a paraboloid's rays from its focus", "2e-15", paraboloid, 0, 1e-6,
        "kernels are float32: 6e-8 times a few"),
    Elsewhere("I-20, 6.4", "rays that end more than 5 % off, a ball in a room, iterated", "0.064", "0.01 to 0.03",
        "test_distance_impostor.py::test_of_a_ball_in_the_room_a_march_misses_only_what_the_middle_does_not_see",
        "of those that the map shows; how many depends on where the ball is"),
    Row("T9", "least eigenvalue of the Hessian at focal distances", "1e-15", focal_hessians, 0, 1e-9,
        "the oracle differentiates normals numerically: 1e-5 squared, and 1e-16 / 1e-5"),
    Elsewhere("T9", "walks to minima, saddles, maxima", "-", "over 99 %",
        "test_newton.py::test_saddles_and_maxima_of_the_paths_length_are_found_too"),
    *(Row("F-20", f"reflections in a whole ball, z = {z}: {kind}", str(n), lambda z=z, count=count: count(z), n, n,
        "T2: their number")
      for kind, count in (("quartic", in_a_ball), ("found by walks", walks_in_a_ball)) for z, n in ((0.0, 2), (0.3, 2), (0.6,
      4), (0.9, 4))),
]  # fmt: skip
