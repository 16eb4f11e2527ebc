"""Reflection points on star-shaped mirrors by secant triangles (Roger and Holzschuch 2006), and by Newton's method. Float64.

Of the path eye - P - V the length is l, and a reflection point is where l does not change to first order along the surface.
With e = unit(P - eye) + unit(P - V), moving P by dP changes l by e . dP; on P(u) = O_r + r(u) u this makes the gradient
(u . e) grad r + e - (u . e) u. Equation (1) of the paper, (grad r . e) u + e - (u . e) u, is that matrix transposed: right only
where grad r = 0.

The secant method keeps three samples of the surface with their gradients, interpolates the gradient linearly over their
triangle, and replaces the worst sample by the surface point under the interpolation's smallest value, until the triangle is
small on the screen. A small triangle proves nothing (a sliver has no area), so the answer is checked afterwards.

Where the paper is silent: when a discarded sample comes back, the step is taken in the same iteration; of the last three
samples, the one with the smallest gradient is the answer.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from support.star_shapes import Star, dot, hidden

FLAT = 1e-8  # determinant over a.a b.b, below which a triangle's gradients count as collinear
TAU = {"area": 0.5, "edge": 1.0}  # px², px


@dataclass
class Found:
    """One row per vertex.

    R, n, u       best sample, its unit normal and direction about O_r, [N, 3]; always finite
    stopped       the triangle became small enough (secant), or the step did (newton); all that the paper asks
    valid         R is in front of the eye and of V, the gradient is below 1 % of |e|, and |e| > 1e-3
    converged     stopped and valid
    hidden        the segment from eye to V enters the mirror: on a convex mirror there is no reflection point
    iterations    samples added to the triangle; steps (newton)
    backtracks    times that a discarded sample came back; newton: times that a step was halved
    degenerate    gave up: collinear gradients that no discarded sample mends, or a new sample in O_r; newton: no step helps
    residual      |half vector - n|; 2 where there is no half vector
    slope         gradient of l at R over |e|
    """

    R: np.ndarray
    n: np.ndarray
    u: np.ndarray
    stopped: np.ndarray
    valid: np.ndarray
    converged: np.ndarray
    hidden: np.ndarray
    iterations: np.ndarray
    backtracks: np.ndarray
    degenerate: np.ndarray
    residual: np.ndarray
    slope: np.ndarray


def unit(v):
    """v / |v|, or 0 where v is 0."""
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-300)


def any_tangent(u):
    """A unit vector orthogonal to each u [..., 3]."""
    return unit(np.cross(u, np.eye(3)[np.abs(u).argmin(axis=-1)]))


def gradient(shape: Star, eye, V, u, residual="param"):
    """(gradient of l, e) at directions u [..., 3]: by the parameterization, or e's part along the surface. Same zeros."""
    P = shape.P(u)
    e = unit(P - eye) + unit(P - V)
    if residual == "param":
        return dot(u, e) * shape.grad_r(u) + e - dot(u, e) * u, e
    if residual == "surface":
        n = shape.n(u)
        return e - dot(e, n) * n, e
    raise ValueError(f"gradient: residual is {residual!r}; accepted: 'param', 'surface'")


def _ends(shape: Star, eye, V):
    """Directions (u_E, u_V) [N, 3] about O_r; +z for an eye in O_r, u_E for a vertex in O_r."""
    O = np.asarray(shape.origin)
    u_E = unit(np.broadcast_to(eye - O, V.shape))
    u_E = np.where((u_E == 0).all(axis=1, keepdims=True), [0.0, 0.0, 1.0], u_E)
    u_V = unit(V - O)
    return u_E, np.where((u_V == 0).all(axis=1, keepdims=True), u_E, u_V)


def bisector(shape: Star, eye, V):
    """Directions halfway from eye to V, seen from O_r, [N, 3]; across both where they are opposite."""
    u_E, u_V = _ends(shape, eye, V)
    middle = u_E + u_V
    return np.where(np.linalg.norm(middle, axis=1, keepdims=True) < 1e-9, any_tangent(u_E), unit(middle))


def first_triangle(shape: Star, eye, V, start="paper"):
    """Directions [N, 3, 3] (vertex, sample, xyz) of the first three samples.

    paper     V and eye projected towards O_r, and the apex of the equilateral triangle on both
    bisector  an equilateral triangle around the bisector, one corner towards V, its circumradius an eighth of the paper's
              side AB (in radians about O_r, at least 0.01)
    """
    O = np.asarray(shape.origin)
    u_E, u_V = _ends(shape, eye, V)
    if start == "bisector":
        middle = bisector(shape, eye, V)
        towards = u_V - dot(u_V, middle) * middle
        towards = np.where(np.linalg.norm(towards, axis=1, keepdims=True) < 1e-6, any_tangent(middle), unit(towards))
        across = np.cross(middle, towards)
        size = np.maximum(0.125 * np.linalg.norm(u_E - u_V, axis=1, keepdims=True), 0.01)
        angles = 2 * np.pi / 3 * np.arange(3)
        return unit(np.stack([middle + size * (np.cos(f) * towards + np.sin(f) * across) for f in angles], axis=1))
    if start != "paper":
        raise ValueError(f"first_triangle: start is {start!r}; accepted: 'paper', 'bisector'")

    B = shape.P(u_E)
    same = np.linalg.norm(shape.P(u_V) - B, axis=1, keepdims=True) < 1e-3 * shape.r(u_E)
    u_A = np.where(same, unit(u_E + 0.05 * any_tangent(u_E)), u_V)
    A = shape.P(u_A)
    across = np.cross(A - O, B - O)
    scale = np.linalg.norm(A - O, axis=1, keepdims=True) * np.linalg.norm(B - O, axis=1, keepdims=True)
    opposite = np.linalg.norm(across, axis=1, keepdims=True) < 1e-9 * scale
    across = np.where(opposite, any_tangent(u_E), unit(across))
    C = (A + B) / 2 + np.sqrt(3) / 2 * np.linalg.norm(A - B, axis=1, keepdims=True) * across
    return np.stack([u_A, u_E, unit(C - O)], axis=1)


def on_screen(points, eye, forward, fpx):
    """Pixel coordinates [..., 2] of points, from the centre of the picture; inf beside and behind the eye."""
    right = any_tangent(forward)
    down = np.cross(forward, right)
    depth = dot(points - eye, forward)
    flat = np.concatenate([dot(points - eye, right), dot(points - eye, down)], axis=-1)
    return np.where(depth > 0, fpx * flat / np.where(depth > 0, depth, 1.0), np.inf)


def size_px(P, eye, forward, fpx, stop):
    """Area (px²) or longest edge (px) of triangles P [N, 3, 3] on the screen; inf if a corner is not in front of the eye."""
    q = on_screen(P, eye, forward, fpx)
    behind = ~np.isfinite(q).all(axis=(1, 2))
    q = np.where(behind[:, None, None], 0.0, q)
    if stop == "area":
        one, two = q[:, 1] - q[:, 0], q[:, 2] - q[:, 0]
        size = 0.5 * np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])
    elif stop == "edge":
        size = np.linalg.norm(q - np.roll(q, 1, axis=1), axis=2).max(axis=1)
    else:
        raise ValueError(f"size_px: stop is {stop!r}; accepted: 'area', 'edge'")
    return np.where(behind, np.inf, size)


def combination(g):
    """(alpha, beta, relative determinant) [N] for gradients g [N, 3, 3] of samples A, B, C.

    alpha and beta minimise |gC + alpha (gA - gC) + beta (gB - gC)|; 0 where the gradients are collinear.
    """
    a, b, c = g[:, 0] - g[:, 2], g[:, 1] - g[:, 2], g[:, 2]
    aa, bb, ab, ac, bc = ((x * y).sum(axis=1) for x, y in [(a, a), (b, b), (a, b), (a, c), (b, c)])
    delta = aa * bb - ab * ab
    relative = np.where(aa * bb > 0, delta / np.where(aa * bb > 0, aa * bb, 1.0), 0.0)
    good = relative > FLAT
    safe = np.where(good, delta, 1.0)
    return np.where(good, (-ac * bb + bc * ab) / safe, 0.0), np.where(good, (-bc * aa + ac * ab) / safe, 0.0), relative


def place_for_lost(g, lost_g, has_lost, newest):
    """(k [N], relative determinant [N]): the sample whose place a discarded one takes best; never the newest (-1: none is).

    Without a discarded sample the determinant is -1.
    """
    mended = np.full((len(g), 3), -1.0)
    for k in range(3):
        trial = g.copy()
        trial[:, k] = lost_g
        mended[:, k] = np.where(has_lost & (newest != k), combination(trial)[2], -1.0)
    return mended.argmax(axis=1), mended.max(axis=1)


def secant(
    shape: Star,
    eye,
    V,
    *,
    residual: Literal["param", "surface"] = "param",
    stop: Literal["area", "edge"] = "area",
    start: Literal["paper", "bisector"] = "paper",
    tau: float | None = None,
    fpx: float = 800.0,
    forward=None,
    max_iter: int = 60,
) -> Found:
    """Reflection points of V [N, 3] by secant triangles.

    tau      the triangle's area (px²) or longest edge (px) on the screen at which it stops; None: 0.5 or 1
    fpx      focal length of the screen, in pixels
    forward  the camera's unit view direction [3]; None: towards O_r
    """
    eye, V = np.asarray(eye, float), np.asarray(V, float)
    O, rows = np.asarray(shape.origin), np.arange(len(V))
    forward = unit(O - eye) if forward is None else np.asarray(forward, float)
    tau = TAU.get(stop) if tau is None else tau

    u = first_triangle(shape, eye, V, start)
    g, _ = gradient(shape, eye, V[:, None], u, residual)
    newest = np.full(len(V), -1)
    lost_u, lost_g, has_lost = np.zeros_like(V), np.zeros_like(V), np.zeros(len(V), bool)
    stopped, degenerate = np.zeros(len(V), bool), np.zeros(len(V), bool)
    iterations, backtracks = np.zeros(len(V), int), np.zeros(len(V), int)

    for step in range(max_iter + 1):
        # Stop lanes whose triangle is small.
        stopped |= ~degenerate & (size_px(shape.P(u), eye, forward, fpx, stop) < tau)
        active = ~stopped & ~degenerate
        if step == max_iter or not active.any():
            break

        # Collinear gradients: bring the last discarded sample back.
        flat = active & ~(combination(g)[2] > FLAT)
        if flat.any():
            k, mended = place_for_lost(g, lost_g, has_lost, newest)
            back = flat & (mended > FLAT)
            degenerate |= flat & ~back
            i, k = rows[back], k[back]
            out_u, out_g = u[i, k].copy(), g[i, k].copy()
            u[i, k], g[i, k] = lost_u[i], lost_g[i]
            lost_u[i], lost_g[i] = out_u, out_g
            backtracks[i] += 1
            active &= ~degenerate

        # The sample under the least interpolated gradient.
        alpha, beta, _ = combination(g)
        P = shape.P(u)
        D = alpha[:, None] * P[:, 0] + beta[:, None] * P[:, 1] + (1 - alpha - beta)[:, None] * P[:, 2] - O
        in_origin = np.linalg.norm(D, axis=1) < 1e-9 * shape.r(u[:, 0])[:, 0]
        degenerate |= active & in_origin
        active &= ~in_origin
        new_u = np.where(active[:, None], unit(D), u[:, 0])
        new_g, _ = gradient(shape, eye, V, new_u, residual)

        # It takes the place of the sample with the largest gradient.
        i = rows[active]
        k = np.linalg.norm(g, axis=2).argmax(axis=1)[active]
        lost_u[i], lost_g[i], has_lost[i] = u[i, k], g[i, k], True
        u[i, k], g[i, k], newest[i] = new_u[i], new_g[i], k
        iterations[i] += 1

    best = np.linalg.norm(g, axis=2).argmin(axis=1)
    return _judged(shape, eye, V, u[rows, best], stopped, degenerate, iterations, backtracks)


def _judged(shape, eye, V, u, stopped, degenerate, iterations, backtracks) -> Found:
    """What is known of the answer P(u) by itself."""
    R, n = shape.P(u), shape.n(u)
    g, e = gradient(shape, eye, V, u)
    length = np.linalg.norm(e, axis=1)
    half = np.where(length[:, None] < 1e-6, -n, unit(-e))
    slope = np.linalg.norm(g, axis=1) / np.maximum(length, 1e-300)
    in_front = ((eye - R) * n).sum(axis=1) > 0
    valid = in_front & (((V - R) * n).sum(axis=1) > 0) & (slope < 1e-2) & (length > 1e-3)
    return Found(
        R=R,
        n=n,
        u=u,
        stopped=stopped,
        valid=valid,
        converged=stopped & valid,
        hidden=hidden(shape, eye, V),
        iterations=iterations,
        backtracks=backtracks,
        degenerate=degenerate,
        residual=np.linalg.norm(half - n, axis=1),
        slope=slope,
    )


def newton(shape: Star, eye, V, u=None, *, max_iter: int = 40, tol: float = 1e-12) -> Found:
    """Reflection points of V [N, 3] by Newton's method on l, from directions u [N, 3] (None: the bisector).

    A step solves the signed Hessian, so that minima, saddles and maxima of l are all found; it is halved until
    |half vector - n| falls. Radial projection brings it back to the surface. Stops where the gradient is below `tol` |e|.
    """
    eye, V = np.asarray(eye, float), np.asarray(V, float)
    u = bisector(shape, eye, V) if u is None else np.array(u, float)
    stopped, stuck = np.zeros(len(V), bool), np.zeros(len(V), bool)
    iterations, halvings = np.zeros(len(V), int), np.zeros(len(V), int)
    for _ in range(max_iter):
        g, H, T, h = _local(shape, eye, V, u)
        nearest = np.minimum(np.linalg.norm(V - shape.P(u), axis=1), np.linalg.norm(eye - shape.P(u), axis=1))
        rounding = 1e-3 * shape.r(u)[:, 0] / np.maximum(nearest, 1e-300)  # directions over a short distance have fewer digits
        small = np.linalg.norm(g, axis=1) <= tol * (1 + rounding) * np.maximum(np.linalg.norm(h, axis=1), 1e-3)
        stopped |= small & (nearest > 0)
        active = ~stopped & ~stuck
        if not active.any():
            break
        s = _solved(H, g)
        r = shape.r(u)
        s *= np.minimum(1.0, 0.5 * r / np.maximum(np.linalg.norm(s, axis=1, keepdims=True), 1e-300))
        step = (T * s[:, :, None]).sum(axis=1)

        # Halve until the law is better kept than before.
        before, beta, accepted = _mismatch(shape, eye, V, u), np.ones(len(V)), ~active
        for _ in range(30):
            trial = shape.direction(shape.P(u) + beta[:, None] * step)
            better = ~accepted & (_mismatch(shape, eye, V, trial) < before)
            u = np.where(better[:, None], trial, u)
            accepted |= better
            if accepted.all():
                break
            beta = np.where(accepted, beta, beta / 2)
            halvings += ~accepted
        iterations += active & accepted
        stuck |= ~accepted
    return _judged(shape, eye, V, u, stopped, stuck, iterations, halvings)


def _mismatch(shape, eye, V, u):
    P = shape.P(u)
    h = unit(eye - P) + unit(V - P)
    h = np.where(np.linalg.norm(h, axis=1, keepdims=True) < 1e-6, -shape.n(u), unit(h))
    return np.linalg.norm(h - shape.n(u), axis=1)


def _local(shape, eye, V, u):
    """At P(u): (minus the gradient of l [N, 2], its Hessian [N, 2, 2], unit tangents [N, 2, 3], w_E + w_V)."""
    P, n = shape.P(u), shape.n(u)
    w_E, w_V = unit(eye - P), unit(V - P)
    h = w_E + w_V
    t = any_tangent(n)
    T = np.stack([t, np.cross(n, t)], axis=1)
    bend = np.zeros((len(V), 3, 3))
    for w, d in [(w_E, np.linalg.norm(eye - P, axis=1)), (w_V, np.linalg.norm(V - P, axis=1))]:
        bend += (np.eye(3) - w[:, :, None] * w[:, None, :]) / np.maximum(d, 1e-9)[:, None, None]
    # Second fundamental form: how the normal turns along each tangent, by central differences.
    step = 1e-5 * shape.r(u)
    turned = []
    for k in range(2):
        ahead, behind = (shape.n(shape.direction(P + side * step * T[:, k])) for side in (1, -1))
        turned.append((T * ((ahead - behind) / (2 * step))[:, None, :]).sum(axis=2))
    II = np.stack(turned, axis=2)
    II = (II + II.transpose(0, 2, 1)) / 2
    H = T @ bend @ T.transpose(0, 2, 1) + dot(h, n)[:, :, None] * II
    return (T * h[:, None, :]).sum(axis=2), H, T, h


def _solved(H, g):
    """H^-1 g [N, 2]; along g where H is singular."""
    det = H[:, 0, 0] * H[:, 1, 1] - H[:, 0, 1] * H[:, 1, 0]
    scale = np.abs(H).max(axis=(1, 2)) ** 2
    good = np.abs(det) > 1e-12 * scale
    x = np.stack([H[:, 1, 1] * g[:, 0] - H[:, 0, 1] * g[:, 1], H[:, 0, 0] * g[:, 1] - H[:, 1, 0] * g[:, 0]], axis=1)
    return np.where(good[:, None], x / np.where(good, det, 1.0)[:, None], g)


def solve(shape: Star, eye, V, **options) -> Found:
    """Secant triangles, then Newton's method from their answer where it converged, else from the bisector; counts of both."""
    eye, V = np.asarray(eye, float), np.asarray(V, float)
    rough = secant(shape, eye, V, **options)
    u = np.where(rough.converged[:, None], rough.u, bisector(shape, eye, V))
    fine = newton(shape, eye, V, u)
    fine.iterations = fine.iterations + rough.iterations
    fine.backtracks = rough.backtracks
    return fine
