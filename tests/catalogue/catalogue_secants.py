"""Secant triangles and Newton's method: section 2, F-01 to F-06, F-24, and the walk of F-31 that no method here takes."""

from __future__ import annotations

from functools import cache

import drjit as dr
import mitsuba as mi
import numpy as np
from catalogue.catalogue_row import Elsewhere, Row, drawn_again, within
from oracles import secant_oracle as oracle
from support.placed import EYE, host, mapped, off_px, place, points
from support.secant_cases import around, classed, flags, printed, solved, star_of
from support.star_shapes import Ellipsoid, Sphere, hidden, truths
from support.truth_shapes import unit

from benchharness.kernels.vertices import secant, starmap

# 2.7: surface, cosines of incidence -> stop: mean iterations, 95th percentile of px off, wrong (stopped over 2 px off), and
# not stopped.
TABLE = {
    ("sphere", 0.5, 1.0): {"area": (5.4, 4.1, 26, 0), "edge": (7.0, 0.12, 6, 2)},
    ("sphere", 0.2, 0.5): {"area": (7.0, 18.7, 54, 0), "edge": (9.0, 0.16, 8, 4)},
    ("sphere", 0.02, 0.2): {"area": (13.3, 60, 64, 18), "edge": (14.7, 55, 18, 18)},
    ("ellipsoid", 0.5, 1.0): {"area": (5.3, 0.32, 10, 0), "edge": (6.4, 0.01, 2, 1)},
    ("ellipsoid", 0.02, 0.2): {"area": (14.7, 140, 63, 33), "edge": (16.8, 140, 12, 35)},
}
LONG = Ellipsoid(half=(1.0, 0.6, 1.7))


@cache
def closed_in(name, low, high, stop, start="paper") -> dict[str, float]:
    """300 vertices; without the tests of `judged`, by which wrong ones are caught."""
    V, R = classed(name, low, high)
    star, where, no = star_of(name), place(V), dr.full(mi.Bool, False, len(V))
    first = secant.start("param", start, star, where, mi.Vector3f(dr.zeros(mi.Float, len(V))), no, ~no)
    best, closed, iterations, _ = secant.close_in(
        "param", stop, star, where, first, ~no, mi.Float(oracle.TAU[stop]), mi.UInt32(60)
    )
    off, closed, iterations = off_px(host(best.p), R), np.array(closed), np.array(iterations)
    converged = flags(solved(star, where, stop, start))[0]
    wrong = closed & (off > 2)
    return {"iterations": iterations.mean(), "p95": float(np.percentile(off, 95)), "wrong": int(wrong.sum()),
            "open": int((~closed).sum()), "uncaught": int((wrong & converged).sum()),
            "most": float(off[wrong].max(initial=0))}  # fmt: skip


def _table():
    for case, stops in TABLE.items():
        for stop, (iterations, p95, wrong, never) in stops.items():
            title = f"{case[0]}, cos {case[1]} to {case[2]}, {stop}"
            grazing, entry = case[1] < 0.2, "2.7, F-01" if case[1] < 0.2 else "2.7, F-02" if case[0] == "sphere" else "2.7"
            # Of those that never stop (one to three in 20, grazing), the 95th percentile is anywhere; 0.1 is rounding's domain.
            spread = (p95 / 2.5, p95 * 2.5) if p95 > 1 else (0, 0.5)

            def figure(name, case=case, stop=stop):
                return lambda: closed_in(*case, stop)[name]

            yield Row(entry, f"iterations, {title}", str(iterations), figure("iterations"),
                      *within(iterations, 0.15),
                      "the oracle's own tolerance; edge: float32 closes in a sample sooner")  # fmt: skip
            yield Row(entry, f"px off, 95th percentile, {title}", str(p95), figure("p95"), *spread, "of 300, the tail of 15")
            yield Row(
                entry, f"stopped over 2 px off, of 300, {title}", str(wrong), figure("wrong"), *drawn_again(wrong, 300), "count"
            )
            yield Row(entry, f"not stopped, of 300, {title}", str(never), figure("open"), *drawn_again(never, 300),
                      "count; head-on, float64 may come back with a sample to the 60th, float32 finds no plane")  # fmt: skip
            yield Row(entry, f"wrong and called converged, {title}", "3 of 20" if grazing and stop == "edge" else "0",
                      figure("uncaught"), 0, 0,
                      "G3; grazing, our test is |gradient| / |e|, which shrinks with |e|")  # fmt: skip


@cache
def unseen(stop) -> dict[str, float]:
    """2.8: 200 vertices that a sphere hides."""
    V = around(5, 3000)
    V = V[hidden(Sphere(), EYE, V)][:200]
    s = solved(star_of("sphere"), place(V), stop, "paper")
    d = unit(V - EYE)
    b = (d @ EYE)[:, None]
    pierced = EYE + (-b + np.sqrt(b**2 - 15) * [-1, 1])[..., None] * d[:, None]
    near = np.linalg.norm(pierced - host(s.R)[:, None], axis=2).min(axis=1) < 1e-2
    converged, _, iterations = flags(s)
    return {"pierced": int(near.sum()), "open": int((iterations >= 60).sum()), "valid": int(converged.sum())}


@cache
def transposed(eye=(0.0, 4.0, 0.0)) -> dict[str, float]:
    """F-04: both gradients at reflection points of the ellipsoid (1, 0.6, 1.7)."""
    eye = np.array(eye)
    V, R = truths(LONG, eye, 2, 300)
    u = LONG.direction(R)
    ours = secant.evaluate("param", mapped(LONG, 128), place(V, eye, (0, 0, 0), (1.0, 0.0, 0.0)), mi.Vector3f(points(u)), True)
    return {"printed": float(np.linalg.norm(printed(LONG, eye, V, u), axis=1).mean()),
            "ours": float(np.linalg.norm(host(ours.g), axis=1).max())}  # fmt: skip


@cache
def misread(of: str) -> float:
    """F-05: |gradient| after a step with a = gA and b = gB, in units of the least, median of 2000; gradients of a first
    triangle, or at three places of the ellipsoid, or any three vectors."""
    rng, V = np.random.default_rng(3), around(3, 2000)
    if of == "vectors":
        g = rng.normal(size=(2000, 3, 3))
    else:
        u = oracle.first_triangle(LONG, EYE, V) if of == "first triangle" else unit(rng.normal(size=(2000, 3, 3)))
        g, _ = oracle.gradient(LONG, EYE, V[:, None], u)

    def left(a, b, _):
        return np.linalg.norm(a[:, None] * g[:, 0] + b[:, None] * g[:, 1] + (1 - a - b)[:, None] * g[:, 2], axis=1)

    wrong = oracle.combination(np.stack([g[:, 0] + g[:, 2], g[:, 1] + g[:, 2], g[:, 2]], axis=1))
    return float(np.median(left(*wrong) / left(*oracle.combination(g))))


@cache
def first_planes(shown: bool) -> np.ndarray:
    """2.5: the relative determinants that searches on a sphere begin with."""
    V = around(4, 300)
    V = V[hidden(Sphere(), EYE, V) != shown]
    g, _ = oracle.gradient(Sphere(), EYE, V[:, None], oracle.first_triangle(Sphere(), EYE, V))
    return oracle.combination(g)[2]


def on_the_axis() -> tuple[int, int]:
    """F-03: iterations and convergence of the search for (0, 0, -3)."""
    s = solved(star_of("sphere"), place(np.array([[0.0, 0.0, -3.0]])), "edge", "paper")
    converged, _, iterations = flags(s)
    return int(iterations[0]), int(converged[0])


def polished(name, low, high) -> np.ndarray:
    """Points that Newton's method alone compares from halfway between V and the eye."""
    return oracle.newton(*((Sphere() if name == "sphere" else Ellipsoid()), EYE, classed(name, low, high)[0])).iterations


# F-24: normals near the pole of an ellipsoid (1, 0.5, 1.2), within 0.03 radians.

POLAR = Ellipsoid(half=(1.0, 0.5, 1.2))


def by_angles(t, f):
    """u, u_theta, u_phi of section 2.1."""
    s, c = np.sin(t), np.cos(t)
    return (np.stack([s * np.cos(f), s * np.sin(f), c], -1), np.stack([c * np.cos(f), c * np.sin(f), -s], -1),
            np.stack([-np.sin(f), np.cos(f), 0 * f], -1))  # fmt: skip


def polar_directions():
    rng = np.random.default_rng(0)
    return rng.uniform(1e-4, 0.03, 4000), rng.uniform(0, 2 * np.pi, 4000)


def turned(u, gradient) -> float:
    return float(np.degrees(np.arccos(np.clip((unit(u - gradient) * POLAR.n(u)).sum(1), -1, 1))).max())


@cache
def by_partials() -> dict[str, float]:
    """A map of 256 by 128 directions in angles: interpolated partial derivatives; the gradient in space; that, wrapped."""
    h, w = 128, 256
    T, F = np.meshgrid((np.arange(h) + 0.5) * np.pi / h, (np.arange(w) + 0.5) * 2 * np.pi / w, indexing="ij")
    u, along, across = by_angles(T, F)
    r, gradient = POLAR.r(u), POLAR.grad_r(u)
    r_t, r_f = (r * (gradient * v).sum(-1, keepdims=True) for v in (along, np.sin(T)[..., None] * across))
    t, f = polar_directions()

    def between(values, wrapped=False):
        values = np.concatenate([np.roll(values[:1], w // 2, axis=1) if wrapped else values[:1], values])
        y, x = t * h / np.pi + 0.5, f * w / (2 * np.pi) - 0.5
        i, j = np.floor(y).astype(int), np.floor(x).astype(int)
        a, b = (y - i)[:, None], (x - j)[:, None]
        rows = [(1 - b) * values[k, j % w] + b * values[k, (j + 1) % w] for k in (i, i + 1)]
        return (1 - a) * rows[0] + a * rows[1]

    u, along, across = by_angles(t, f)
    partial = (between(r_t) * along + between(r_f) / np.sin(t)[:, None] * across) / between(r)
    return {
        "partials": turned(u, partial),
        "clamped": turned(u, between(gradient)),
        "wrapped": turned(u, between(gradient, True)),
    }


def by_star_map(n: int) -> float:
    u = by_angles(*polar_directions())[0]
    _, gradient = starmap.sample(mapped(POLAR, n), mi.Vector3f(points(u)))
    return turned(u, host(gradient))


# F-31: u <- unit(u + step (B(u) - n(u))) on the unit sphere, eye and vertex d_E and d_V from the reflection point.


@cache
def stepped(d_E: float, d_V: float, step: str) -> dict[str, int]:
    """Of 400: how many converge in 500 steps, and for how many that is not as half the sum of 1 / d over the cosine, below 3,
    says."""
    rng = np.random.default_rng(0)
    R = unit(rng.normal(size=(400, 3)))
    t, c = unit(np.cross(R, rng.normal(size=(400, 3)))), rng.uniform(0.02, 1, (400, 1))
    s, power = np.sqrt(1 - c * c), 1 / d_E + 1 / d_V
    eye, V = R + d_E * (s * t + c * R), R + d_V * (c * R - s * t)
    size = {"1": 1.0, "1/2": 0.5, "1/(1+rho)": 1 / (1 + power * c / 2), "1/(1+rho')": 1 / (1 + power / (2 * c))}[step]
    u = unit(unit(eye) + unit(V))
    for _ in range(500):
        u = unit(u + size * (unit(unit(eye - u) + unit(V - u)) - u))
    good = np.linalg.norm(u - R, axis=1) < 1e-4
    return {"converged": int(good.sum()), "unlike": int((good != (power / (2 * c) < 3)[:, 0]).sum())}


ACROSS = "across the plane of incidence the factor is rho' = (1 / cos) (1/d_E + 1/d_V) / 2, which is larger than rho within it"
ROWS: list[Row | Elsewhere] = [
    *_table(),
    Row("F-02", "px off, largest of the area stop, sphere, cos 0.5 to 1", "12", lambda: closed_in("sphere", 0.5, 1.0,
        "area")["most"], 6, 40,
        "the largest of 26: another draw, another largest"),
    Elsewhere("2.7", "all rows, in float64", "table", "table",
        "test_secant_oracle.py::test_iterations_and_failures_are_those_measured_before"),
    Elsewhere("2.7", "started near", "-", "over 1.5 iterations fewer",
        "test_secant.py::test_started_near_it_takes_far_fewer_and_fails_less"),
    Elsewhere("2.7, 6.6", "restarted and polished: px off", "0.0013", "1e-6",
        "test_secant_oracle.py::test_restarted_and_polished_all_are_exact",
              "float64 to 1e-12, where the prototype stopped sooner"),
    Row("2.7", "iterations of Newton alone, head-on, sphere", "2.3 to 4.2", lambda: polished("sphere", 0.5, 1.0).mean(), 2.3,
        4.8,
        "to a gradient of 1e-12; to one of 1e-9, 2.7 to 4.1 and 6 at most on the sphere"),
    Row("2.7, F-01", "iterations of Newton alone, grazing, ellipsoid", "2.3 to 4.2", lambda: polished("ellipsoid", 0.02,
        0.2).mean(), 2.3, 5.5, "the same"),
    Row("F-01", "most iterations of Newton alone, grazing, sphere", "6", lambda: polished("sphere", 0.02, 0.2).max(), 4, 8,
        "the same"),
    Elsewhere("F-01", "Newton's walks on a mesh, grazing", "0.003 px, 6", "0.01 px, 4.5",
        "test_newton.py::test_grazing_or_not_it_takes_a_few_points",
              "float32, against the mesh's own points"),
    Elsewhere("6.6", "Newton on an ellipsoid", "4.7 mean, 10 most", "5 mean, 10 most",
        "test_newton_oracle.py::test_newton_alone_needs_few_steps_and_squares_its_error"),
    Row("F-03", "iterations for (0, 0, -3)", "60, all degenerate", lambda: on_the_axis()[0], 0, 0,
        "ours gives up at once: without a plane and without a discarded sample nothing can change"),
    Row("F-03", "(0, 0, -3) called converged", "0", lambda: on_the_axis()[1], 0, 0, "it is hidden"),
    Elsewhere("F-03", "without a plane", "-", "-",
        "test_secant.py::test_gradients_that_span_no_plane_bring_the_discarded_sample_back"),
    Row("F-04", "|printed equation (1)| at reflection points, mean", "0.95", lambda: transposed()["printed"], 0.8, 1.1,
        "eye on the y axis; eye4 looks along the longest axis: 0.36"),
    Row("F-04", "the same, eye4", "not given", lambda: transposed((0.0, 0.0, 4.0))["printed"], 0.3, 0.45, "see above"),
    Row("F-04", "|our gradient| there, largest", "9e-16", lambda: transposed()["ours"], 0, 4e-3,
        "a map of float32 gradients, 128 texels"),
    Elsewhere("F-04", "the printed form is refuted", "-", "-",
        "test_secant_oracle.py::test_at_reflection_points_our_gradient_vanishes_and_the_printed_one_does_not"),
    Row("F-05", "residual with a = gA, in units of the optimum, any three vectors", "3", lambda: misread("vectors"), 2.7, 3.3,
        "median of 2000"),
    Row("F-05", "the same, first triangles on the ellipsoid", "3", lambda: misread("first triangle"), 6, 10,
        "3 is what random vectors give; gradients are not random, and these nearly cancel"),
    Row("F-05", "the same, any three places of the ellipsoid", "3", lambda: misread("places"), 1.4, 1.8, "the same"),
    Elsewhere("F-05", "the step is least squares'", "3e-11", "1e-9",
        "test_secant_oracle.py::test_the_combination_is_the_least_squares_solution"),
    Row("2.5", "least relative determinant at the start, reflected vertices", "0.75", lambda: first_planes(True).min(), 0.74,
        0.9,
        "hidden ones are not so lucky"),
    Row("2.5", "median of it", "0.96", lambda: np.median(first_planes(True)), 0.94, 0.99, "of 230"),
    Row("2.5", "least of it, hidden vertices", "not given", lambda: first_planes(False).min(), 0.001, 0.1,
        "near the antipode V, E and O are in line"),
    Row("2.8, F-06", "hidden, ended where EV pierces the sphere, of 200, edge", "134", lambda: unseen("edge")["pierced"],
        *drawn_again(134, 200), "count"),
    Row("2.8, F-06", "hidden, ended there, of 200, area", "134", lambda: unseen("area")["pierced"], 90, 160,
        "slivers end before"),
    Row("2.8, F-06", "hidden, not stopped, of 200, edge", "59", lambda: unseen("edge")["open"], *drawn_again(59, 200),
        "60 samples, or no plane: float32 ends the latter sooner"),
    Row("2.8, F-06", "hidden, called converged", "0", lambda: unseen("edge")["valid"] + unseen("area")["valid"], 0, 0, "G3"),
    Row("F-24", "degrees off, partial derivatives in angles, 256 x 128", "83", lambda: by_partials()["partials"], 60, 90,
        "unbounded as 1 / sin: the nearest of 4000 directions is 1e-4 from the pole"),
    Row("2.2, F-24", "degrees off, gradients in space, rows clamped", "3.3", lambda: by_partials()["clamped"], 3.2, 3.4,
        "the pole's row"),
    Row("2.2, F-24", "degrees off, gradients in space, wrapped", "0.02", lambda: by_partials()["wrapped"], 0.008, 0.03,
        "texels of 0.025 rad"),
    Row("F-24", "degrees off, our map of a cube, 74 texels per edge", "0.02", lambda: by_star_map(74), 0.015, 0.035,
        "as many texels as 256 x 128"),
    Elsewhere("F-24", "poles are nothing special", "-", "0.2 degrees", "test_starmap.py::test_there_are_no_poles"),
    Row("F-31", "step 1, converged of 400, d = 1.2, 0.6", "15 of 189", lambda: stepped(1.2, 0.6, "1")["converged"], 0, 0,
        f"{ACROSS}: 1.25 / cos > 1 always; fewer steps leave some that rounding has not yet led astray"),
    Row("F-31", "step 1, converged of 400, d = 4, 0.1", "0 of 191", lambda: stepped(4, 0.1, "1")["converged"], 0, 0,
        "the same"),
    Row("6.5", "step 1/2, of 400 not as (1 / cos) (1/d_E + 1/d_V) / 2 < 3 says, d = 1.2, 0.6", "cos in place of 1 / cos",
        lambda: stepped(1.2, 0.6, "1/2")["unlike"], 0, 12, "at the border 500 steps are few"),
    Row("6.5", "step 1/(1+rho), converged of 400, d = 1.2, 0.6", "all", lambda: stepped(1.2, 0.6, "1/(1+rho)")["converged"],
        150, 260, ACROSS),
    Row("6.5", "step 1/(1+rho'), converged of 400, d = 1.2, 0.6", "all", lambda: stepped(1.2, 0.6, "1/(1+rho')")["converged"],
        400, 400, ACROSS),
]  # fmt: skip
