"""Star-shaped mirrors in closed form, float64: r(u) and its gradient, points, normals, meshes, and known reflection points.

A surface is P(u) = O_r + r(u) u for every unit direction u about the origin O_r. Its gradient is that of r(x / |x|), taken on
the surface: a vector in space, orthogonal to u, with no angles and no poles. Then |x| - r(x / |x|) is constant on the surface
and grows outward, so the outward normal is unit(u - grad r); read backwards, grad r = u - N / (N . u) for any normal N.

All arrays are float64 [..., 3] in world space unless a name says `local`. A shape stands at `origin` (O_r) and is turned about
it by the rotation vector `turn`, in radians.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation
from support.truth_shapes import reverse_constructed, unit

from benchharness.scene import Mesh


def dot(a, b):
    """Scalar product along the last axis, which is kept with length 1."""
    return (a * b).sum(axis=-1, keepdims=True)


@dataclass(frozen=True, kw_only=True)
class Star(ABC):
    """Subclasses give `local_r` [..., 1] and `local_grad` [..., 3] at unit directions [..., 3] in their own axes."""

    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @abstractmethod
    def local_r(self, u): ...

    @abstractmethod
    def local_grad(self, u): ...

    @cached_property
    def axes(self):
        """Rotation [3, 3] from the shape's axes to the world's: world = axes @ local, as rows: local @ axes.T."""
        return Rotation.from_rotvec(self.turn).as_matrix()

    def r(self, u):
        return self.local_r(u @ self.axes)

    def grad_r(self, u):
        return self.local_grad(u @ self.axes) @ self.axes.T

    def P(self, u):
        return np.asarray(self.origin) + self.r(u) * u

    def n(self, u):
        return unit(u - self.grad_r(u))

    def direction(self, x):
        """u of points [..., 3] anywhere but at O_r."""
        return unit(x - np.asarray(self.origin))

    def normal(self, p):
        """Outward unit normal at points of the surface."""
        return self.n(self.direction(p))

    def height(self, x):
        """Distance to the surface along the line through O_r, [...]: positive outside, negative inside; |x| - r."""
        away = np.linalg.norm(x - np.asarray(self.origin), axis=-1, keepdims=True)
        u = np.where(away > 0, (x - np.asarray(self.origin)) / np.maximum(away, 1e-300), [0.0, 0.0, 1.0])
        return (away - self.r(u))[..., 0]

    def points(self, rng, count):
        """Random points of the surface [count, 3], uniform in direction."""
        return self.P(unit(rng.normal(size=(count, 3))))

    def mesh(self, subdivisions: int) -> Mesh:
        """Directions of an icosphere (20 . 4^subdivisions triangles), put on the surface, with the surface's own normals."""
        ball = trimesh.creation.icosphere(subdivisions=subdivisions)
        u = unit(np.asarray(ball.vertices))
        return Mesh(self.P(u), ball.faces, self.n(u))


def grad_from_normal(u, N):
    return u - N / dot(N, u)


@dataclass(frozen=True, kw_only=True)
class Sphere(Star):
    """A ball whose centre is `centre` from O_r, in the shape's axes; if not zero, r varies though the shape is a sphere."""

    radius: float = 1.0
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self):
        if not np.linalg.norm(self.centre) < self.radius:
            raise ValueError(f"sphere: centre {self.centre}, radius {self.radius}; accepted: a ball that contains O_r")

    def local_r(self, u):
        c = np.asarray(self.centre)
        along = dot(u, c)  # |r u - c| = radius
        return along + np.sqrt(along**2 + self.radius**2 - c @ c)

    def local_grad(self, u):
        return grad_from_normal(u, self.local_r(u) * u - self.centre)


@dataclass(frozen=True, kw_only=True)
class Ellipsoid(Star):
    """Half axes along x, y, z; O_r is its centre."""

    half: tuple[float, float, float] = (1.0, 0.6, 1.4)

    def local_r(self, u):
        return 1 / np.sqrt(dot(u / self.half, u / self.half))

    def local_grad(self, u):
        return grad_from_normal(u, u / np.square(self.half))


@dataclass(frozen=True, kw_only=True)
class Cylinder(Star):
    """About its z axis, from -half_length to half_length, closed by flat caps.

    Where |u_z| / |u_xy| < half_length / radius, r and all else are those of the infinite cylinder; beyond, of the caps z =
    ± half_length. On the rim the normal jumps. `points` are on the side, within two radii of the middle.
    """

    radius: float = 1.0
    half_length: float = 20.0

    def local_r(self, u):
        side, cap = self._reach(u)
        return np.minimum(side, cap)

    def local_grad(self, u):
        side, cap = self._reach(u)
        return grad_from_normal(u, np.where(side <= cap, u * [1.0, 1.0, 0.0], u * [0.0, 0.0, 1.0]))

    def _reach(self, u):
        """Distances to the side and to the caps; inf where u is parallel to one."""
        across, along = np.linalg.norm(u[..., :2], axis=-1, keepdims=True), np.abs(u[..., 2:])
        with np.errstate(divide="ignore"):
            return self.radius / across, self.half_length / along

    def points(self, rng, count):
        angle, z = rng.uniform(0, 2 * np.pi, count), rng.uniform(-2, 2, count) * self.radius
        local = np.stack([self.radius * np.cos(angle), self.radius * np.sin(angle), z], axis=1)
        return local @ self.axes.T + self.origin

    def mesh(self, subdivisions: int) -> Mesh:
        """8 . 2^subdivisions slices and square-ish quads on the side; the rim is there twice, for its two normals."""
        slices = 8 * 2**subdivisions
        rings = max(2, round(self.half_length * slices / (np.pi * self.radius))) + 1
        angle = 2 * np.pi * np.arange(slices) / slices
        circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        z = np.linspace(-self.half_length, self.half_length, rings)
        side = np.concatenate([np.tile(self.radius * circle, (rings, 1)), np.repeat(z, slices)[:, None]], axis=1)
        normals = np.concatenate([np.tile(circle, (rings, 1)), np.zeros((rings * slices, 1))], axis=1)
        i, k = np.arange(slices), np.roll(np.arange(slices), -1)
        rows = slices * np.arange(rings - 1)[:, None]
        faces = [np.stack([rows + i, rows + k, rows + slices + k], axis=2).reshape(-1, 3)]
        faces.append(np.stack([rows + i, rows + slices + k, rows + slices + i], axis=2).reshape(-1, 3))
        for up in (-1.0, 1.0):
            start = len(side)
            rim = np.concatenate([self.radius * circle, np.full((slices, 1), up * self.half_length)], axis=1)
            side = np.concatenate([side, rim, [[0.0, 0.0, up * self.half_length]]])
            normals = np.concatenate([normals, np.tile([0.0, 0.0, up], (slices + 1, 1))])
            first, second = (i, k) if up > 0 else (k, i)
            faces.append(np.stack([start + first, start + second, np.full(slices, start + slices)], axis=1))
        return Mesh(side @ self.axes.T + self.origin, np.concatenate(faces), normals @ self.axes.T)


@dataclass(frozen=True, kw_only=True)
class Bumpy(Star):
    """r = 1 + eps h, h = (3 √3 / 2) (x² - y²) z in [-1, 1]: two harmonics multiplied, smooth at the poles.

    h is itself a harmonic of degree 3, Δh = -12 h, so the mean curvature where h = -1 is about 1 - 5 eps: not convex from
    eps = 0.2 on.
    """

    eps: float = 0.3

    def __post_init__(self):
        if not -1 < self.eps < 1:
            raise ValueError(f"bumpy: eps {self.eps}; accepted: between -1 and 1, so that r stays positive")

    def local_r(self, u):
        x, y, z = np.moveaxis(u, -1, 0)
        return (1 + self.eps * 1.5 * np.sqrt(3) * (x**2 - y**2) * z)[..., None]

    def local_grad(self, u):
        x, y, z = np.moveaxis(u, -1, 0)
        in_space = self.eps * 1.5 * np.sqrt(3) * np.stack([2 * x * z, -2 * y * z, x**2 - y**2], axis=-1)
        return (in_space - dot(in_space, u) * u) / self.local_r(u)


def lowest(shape: Star, a, b, samples: int = 64):
    """Least height [N] over the surface along the segments from a to b, [N, 3] or [3]: sampled, then zoomed in five times."""
    a, b = np.broadcast_arrays(np.asarray(a, float), np.asarray(b, float))
    low, high, least = np.zeros(len(a)), np.ones(len(a)), np.full(len(a), np.inf)
    for _ in range(6):
        s = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, samples)
        h = shape.height(a[:, None] + s[..., None] * (b - a)[:, None])
        at = h.argmin(axis=1)
        least = np.minimum(least, h.min(axis=1))
        rows = np.arange(len(a))
        low, high = s[rows, np.maximum(at - 1, 0)], s[rows, np.minimum(at + 1, samples - 1)]
    return least


def hidden(shape: Star, eye, V):
    """Whether the segment from the eye to V [N, 3] enters the shape, [N]. For a convex shape: V has no reflection point."""
    return lowest(shape, eye, V) < -1e-12


def leaves(shape: Star, R, x):
    """Whether the segments from points R of the surface to x stay outside, [N]; samples crowd towards R."""
    R, x = np.broadcast_arrays(np.asarray(R, float), np.asarray(x, float))
    s = np.linspace(0, 1, 257)[1:, None] ** 2
    return (shape.height(R[:, None] + s * (x - R)[:, None]) > 0).all(axis=1)


def truths(shape: Star, eye, seed: int, count: int, low_cos=0.02, high_cos=1.0):
    """(V, R) [count, 3]: vertices made from their reflection points, both rays unobstructed; cosine of incidence in a range."""
    V, R = reverse_constructed(shape, np.asarray(eye, float), seed, 4 * count, low_cos, high_cos)
    seen = leaves(shape, R, eye) & leaves(shape, R, V)
    V, R = V[seen], R[seen]
    assert len(V) >= count, f"{len(V)} of {count} vertices could be made for {shape}"
    return V[:count], R[:count]
