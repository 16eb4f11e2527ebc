"""Smooth mirrors in closed form, float64: points, normals and first hits, and the reflection points that follow from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


@dataclass(frozen=True)
class Quadric:
    """x^T diag(a) x = 1: sphere, ellipsoid, or cylinder about z where the last entry is 0. Normals point outward."""

    a: tuple[float, float, float]

    def normal(self, p):
        return unit(p * np.asarray(self.a))

    def hit(self, o, d):
        """Distance to the first hit from o [3] along d [..., 3] (any length); NaN for a miss."""
        a = np.asarray(self.a)
        A, B, C = (d * d) @ a, (d * o) @ a, (o * o) @ a - 1
        disc = B * B - A * C
        t = (-B - np.sqrt(np.where(disc >= 0, disc, np.nan))) / A
        return np.where(t > 0, t, np.nan)

    def points(self, rng, count):
        u = unit(rng.normal(size=(count, 3)))
        scale = np.asarray(self.a) > 0
        if not scale.all():  # a cylinder: any height within the picture
            u = np.concatenate([unit(u[:, :2]), rng.uniform(-0.8, 0.8, (count, 1))], axis=1)
            return np.concatenate([u[:, :2] / np.sqrt(np.asarray(self.a)[:2]), u[:, 2:]], axis=1)
        return u / np.sqrt(np.asarray(self.a))


@dataclass(frozen=True)
class Plane:
    """The plane y = 0, seen from -y."""

    def normal(self, p):
        return np.broadcast_to([0.0, -1.0, 0.0], p.shape)

    def hit(self, o, d):
        t = -o[1] / d[..., 1]
        return np.where(t > 0, t, np.nan)

    def points(self, rng, count):
        return np.stack([rng.uniform(-1, 1, count), np.zeros(count), rng.uniform(-1, 1, count)], axis=1)


def reverse_constructed(shape, eye, seed, count, low_cos=0.1, high_cos=1.0):
    """(V, R): vertices made from their reflection points. Rays start at visible points of the shape and do not re-enter."""
    rng = np.random.default_rng(seed)
    R = shape.points(rng, 40 * count)
    n, w = shape.normal(R), unit(eye - R)
    cos_theta = (n * w).sum(1)
    keep = (cos_theta > low_cos) & (cos_theta <= high_cos)
    R, n, w, cos_theta = R[keep], n[keep], w[keep], cos_theta[keep]
    r = 2 * cos_theta[:, None] * n - w
    V = R + rng.uniform(0.1, 4, (len(R), 1)) * r
    return V[:count], R[:count]


def alhazen(eye, V):
    """Reflection points of V [..., 3] on the unit sphere about the origin: e.tangent bisected on arcs from the eye to V."""
    a, b = np.broadcast_to(unit(eye), V.shape), unit(V)
    for _ in range(80):
        m = unit(a + b)
        e = -(unit(eye - m) + unit(V - m))  # gradient of the path's length
        tangent = unit(V) - (unit(V) * m).sum(axis=-1, keepdims=True) * m
        towards_V = (e * tangent).sum(axis=-1, keepdims=True) < 0
        a, b = np.where(towards_V, m, a), np.where(towards_V, b, m)
    return unit(a + b)


def alhazen_inside(eye, V):
    """All reflection points [K, 3] on the inside of the unit sphere at the origin: the roots of Alhazen's quartic.

    In the plane of the centre, the eye A and the vertex B, as complex numbers: A* B* z⁴ - (A* + B*) z³ + (A + B) z - A B = 0.
    """
    x = unit(eye)
    y = unit(V - (V @ x) * x)
    a, b = complex(eye @ x, eye @ y), complex(V @ x, V @ y)
    c, d = a.conjugate(), b.conjugate()
    z = np.roots([c * d, -(c + d), 0, a + b, -a * b])
    z = z[abs(abs(z) - 1) < 1e-6]
    return z.real[:, None] * x + z.imag[:, None] * y
