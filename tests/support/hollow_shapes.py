"""Mirrors with several reflections, in closed form, float64: bowls seen from inside, curved sheets, rings.

Each has random `points` [N, 3] of itself, unit `normal`s there on the side that reflects, the `height` of points over it,
[N], and a `mirror` made of triangles with its own normals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from support.truth_shapes import unit

from benchharness.scene import Mesh, Reflector


def _cells(rows: int, columns: int, around: tuple[bool, bool]) -> np.ndarray:
    """Triangles of a grid of vertices, row by row; closed in either direction where `around`. Front: row x column."""
    i, j = (
        x.ravel() for x in np.meshgrid(np.arange(rows - (not around[0])), np.arange(columns - (not around[1])), indexing="ij")
    )
    a, b, c, d = (columns * (p % rows) + q % columns for p, q in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)))
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


@dataclass(frozen=True)
class Bowl:
    """The part of an ellipsoid below z = -above of its half axis, seen from inside; it is open to +z."""

    half: tuple[float, float, float]
    above: float

    def points(self, rng: np.random.Generator, count: int) -> np.ndarray:
        z, angle = rng.uniform(-1, -self.above, count), rng.uniform(0, 2 * np.pi, count)
        across = np.sqrt(1 - z * z)
        return np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1) * self.half

    def normal(self, p: np.ndarray) -> np.ndarray:
        return -unit(p / np.square(self.half))

    def height(self, p: np.ndarray) -> np.ndarray:
        q = p / self.half
        return (1 - np.linalg.norm(q, axis=-1)) / np.linalg.norm(q / self.half, axis=-1)

    def mirror(self) -> Reflector:
        theta, angle = np.linspace(np.pi - 0.01, np.arccos(-self.above), 49), np.linspace(0, 2 * np.pi, 97)[:-1]
        t, a = np.meshgrid(theta, angle, indexing="ij")
        p = np.stack([np.sin(t) * np.cos(a), np.sin(t) * np.sin(a), np.cos(t)], axis=-1).reshape(-1, 3) * self.half
        return Reflector("mirror", Mesh(p, _cells(49, 96, (False, True)), self.normal(p)))


@dataclass(frozen=True)
class Sheet:
    """z = (a x² + b y²) / 2 over |x|, |y| <= 1, seen from +z: a trough, a dish, a dome or a saddle."""

    a: float
    b: float

    def points(self, rng: np.random.Generator, count: int) -> np.ndarray:
        x, y = rng.uniform(-1, 1, (2, count))
        return np.stack([x, y, 0.5 * (self.a * x * x + self.b * y * y)], axis=1)

    def normal(self, p: np.ndarray) -> np.ndarray:
        return unit(np.stack([-self.a * p[..., 0], -self.b * p[..., 1], np.ones(p.shape[:-1])], axis=-1))

    def height(self, p: np.ndarray) -> np.ndarray:
        x, y, z = np.moveaxis(p, -1, 0)
        return (z - 0.5 * (self.a * x * x + self.b * y * y)) / np.hypot(1, np.hypot(self.a * x, self.b * y))

    def mirror(self) -> Reflector:
        x, y = (v.ravel() for v in np.meshgrid(np.linspace(-1, 1, 65), np.linspace(-1, 1, 65), indexing="ij"))
        p = np.stack([x, y, 0.5 * (self.a * x * x + self.b * y * y)], axis=1)
        return Reflector("mirror", Mesh(p, _cells(65, 65, (False, False)), self.normal(p)))


@dataclass(frozen=True)
class Ring:
    """A torus of radius 1 about the z axis, seen from outside."""

    tube: float

    def points(self, rng: np.random.Generator, count: int) -> np.ndarray:
        a, b = rng.uniform(0, 2 * np.pi, (2, count))
        return self._at(a, b)

    def _at(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        out = 1 + self.tube * np.cos(b)
        return np.stack([out * np.cos(a), out * np.sin(a), self.tube * np.sin(b)], axis=-1)

    def normal(self, p: np.ndarray) -> np.ndarray:
        middle = unit(p * [1.0, 1.0, 0.0])
        return unit(p - middle)

    def height(self, p: np.ndarray) -> np.ndarray:
        return np.linalg.norm(p - unit(p * [1.0, 1.0, 0.0]), axis=-1) - self.tube

    def mirror(self) -> Reflector:
        a, b = np.meshgrid(np.linspace(0, 2 * np.pi, 97)[:-1], np.linspace(0, 2 * np.pi, 49)[:-1], indexing="ij")
        p = self._at(a, b).reshape(-1, 3)
        mesh = Mesh(p, _cells(96, 48, (True, True)), self.normal(p))
        return Reflector("mirror", mesh, mesh)
