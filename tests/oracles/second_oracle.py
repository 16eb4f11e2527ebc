"""Reflections of second and higher order in float64: of two spheres by dense search, of meshes by brute force."""

from __future__ import annotations

import numpy as np
from oracles.fresnel_oracle import fresnel_by_amplitudes

from benchharness.scene import Reflector, Scene


def shot(eye, d, A, B):
    """Of rays from `eye` along unit d [N, 3] by way of the spheres A, then B, (centre, radius) each: where they meet A and B,
    and the direction after; NaN where they miss either."""
    a = entered(np.broadcast_to(eye, d.shape), d, *A)
    d = thrown_back(d, (a - A[0]) / A[1])
    b = entered(a, d, *B)
    return a, b, thrown_back(d, (b - B[0]) / B[1])


def entered(o, d, centre, radius):
    """Where rays enter a sphere."""
    along, apart = ((centre - o) * d).sum(1), ((centre - o) ** 2).sum(1)
    inside = radius**2 - (apart - along**2)
    with np.errstate(invalid="ignore"):
        t = along - np.sqrt(inside)
    return o + np.where(t > 0, t, np.nan)[:, None] * d


def thrown_back(d, n):
    """d mirrored at surfaces with unit normals n that it comes to from outside; NaN where it does not."""
    along = (d * n).sum(1, keepdims=True)
    return np.where(along < 0, d - 2 * along * n, np.nan)


def second_point(eye, V, A, B):
    """Where on sphere A the eye sees V by way of A and then B: of all directions from the eye to A, that whose ray passes
    nearest to V in the end, searched on ever finer grids. Returns the point, and how near."""
    eye, V = np.asarray(eye, float), np.asarray(V, float)
    forward = A[0] - eye
    distance = np.linalg.norm(forward)
    forward = forward / distance
    u = np.cross(forward, [0.3, 0.5, 0.8])
    u /= np.linalg.norm(u)
    v = np.cross(forward, u)
    middle, half = np.zeros(2), A[1] / np.sqrt(distance**2 - A[1] ** 2)
    a, off, best = np.zeros((1, 3)), np.full(1, np.inf), 0
    for _ in range(6):
        x, y = (m + half * np.linspace(-1, 1, 161) for m in middle)
        x, y = (one.ravel() for one in np.meshgrid(x, y))
        d = forward + x[:, None] * u + y[:, None] * v
        a, b, after = shot(eye, d / np.linalg.norm(d, axis=1, keepdims=True), A, B)
        reach = ((V - b) * after).sum(1)
        off = np.where(reach > 0, np.linalg.norm(V - b - reach[:, None] * after, axis=1), np.nan)
        best = np.nanargmin(off)
        middle, half = np.array([x[best], y[best]]), half / 20
    return a[best], off[best]


def chained(made: Scene, time: float, o, d, mirror: int, orders: int):
    """What rays show that have left mirror number `mirror` at o along unit d, [N, 3] each, and are followed over `orders`
    mirrors, the first among them; one more is black. Returns radiance [N, 3], mirrors met after the first [N], and whether
    rounding cannot change it."""
    count, first = len(o), len(made.objects)
    L, through, met = np.zeros((count, 3)), np.ones((count, 3)), np.zeros(count, int)
    margin, on, going = np.full(count, np.inf), np.full(count, first + mirror), np.ones(count, bool)
    parts = [part.mesh.transformed(part.pose(time)) for part in made.parts]
    for order in range(orders):
        t, part, n = np.full(count, np.inf), np.full(count, -1), np.zeros((count, 3))
        light = np.tile(np.asarray(made.background, float), (count, 1))
        for number, mesh in enumerate(parts):
            mirrors = isinstance(made.parts[number], Reflector)
            for face in mesh.faces:
                some = np.flatnonzero(going & (on != number))
                corners = mesh.vertices[face]
                edges = corners[1] - corners[0], corners[2] - corners[0]
                across = np.cross(d[some], edges[1])
                volume = across @ edges[0]
                from_corner = o[some] - corners[0]
                with np.errstate(divide="ignore", invalid="ignore"):
                    w1 = (from_corner * across).sum(1) / volume
                    q = np.cross(from_corner, edges[0])
                    w2 = (d[some] * q).sum(1) / volume
                    reach = (q @ edges[1]) / volume
                w = np.stack([1 - w1 - w2, w1, w2], axis=1)
                near = (w > -1e-3).all(axis=1) & (reach > 0) & (reach < t[some] + 1e-3)
                margin[some[near]] = np.minimum(margin[some[near]], np.abs(w[near]).min(axis=1))
                hit = (w >= 0).all(axis=1) & (reach > 0) & (reach < t[some])
                lanes = some[hit]
                t[lanes], part[lanes] = reach[hit], number
                carried = np.asarray(mesh.normals if mirrors else mesh.radiance)
                (n if mirrors else light)[lanes] = w[hit] @ carried[face]
        again = going & (part >= first)
        ends = going & ~again
        L[ends] = through[ends] * light[ends]
        met += again
        if order == orders - 1:
            break
        o = o + np.where(again, t, 0)[:, None] * d
        n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-30)
        n *= -np.sign((n * d).sum(1, keepdims=True))
        cosine = np.clip(-(n * d).sum(1), 0, 1)
        for k, reflector in enumerate(made.reflectors):
            here = again & (part == first + k)
            if reflector.eta is not None and reflector.k is not None:
                for c in range(3):
                    through[here, c] *= fresnel_by_amplitudes(cosine[here], reflector.eta[c], reflector.k[c])
        d = np.where(again[:, None], d - 2 * (n * d).sum(1, keepdims=True) * n, d)
        on, going = np.where(again, part, on), again
    return L, met, margin > 1e-4
