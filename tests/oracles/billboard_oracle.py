"""Quads with pictures: the nearest that is opaque along a ray, in float64, and the same quads on the device."""

from __future__ import annotations

from dataclasses import dataclass

import mitsuba as mi
import numpy as np

from benchharness.kernels.images import billboard
from benchharness.kernels.images.candidates import NONE, Candidates

SIZE = 16


def device(array) -> mi.Float:
    return mi.Float(np.ascontiguousarray(array, np.float32).ravel())


def vectors(array):
    return mi.Vector3f(*(device(column) for column in np.atleast_2d(array).T))


def bilinear(texels: np.ndarray, x: float, y: float) -> np.ndarray:
    """At (x, y) in [-1, 1], texel by texel: weights of a hat around each centre, the border's texels going on outside."""
    n = len(texels)
    centres = (np.arange(n) + 0.5) * (2 / n) - 1
    x, y = (np.clip(v, centres[0], centres[-1]) for v in (x, y))
    across, down = (np.maximum(1 - np.abs(v - centres) * (n / 2), 0) for v in (x, y))
    return np.einsum("i,j,ijc->c", down, across, texels)


@dataclass
class Quads:
    """Random quads in float64, and the same on the device. lists [mirrors, columns]: slots, -1 for none."""

    middle: np.ndarray
    a: np.ndarray
    b: np.ndarray
    k: np.ndarray
    half: np.ndarray
    texels: np.ndarray
    lists: np.ndarray
    objects: int

    @property
    def boards(self) -> billboard.Billboards:
        packed = np.zeros((len(self.middle), 4, 4))
        packed[:, 0, :3], packed[:, 3, :3] = self.middle, self.k
        packed[:, 0, 3] = -1
        packed[:, 1, :3], packed[:, 2, :3] = self.a / self.half[:, :1], self.b / self.half[:, 1:]
        table = np.where(self.lists < 0, NONE, self.lists).astype(np.uint32)
        listed = Candidates(mi.UInt32(table.ravel()), self.lists.shape[1], self.objects)
        return billboard.Billboards(device(packed), listed)

    @property
    def pictures(self) -> billboard.Pictures:
        return billboard.Pictures(device(self.texels), self.texels.shape[1], False)

    def nearest(self, mirror, o, d, columns):
        """(t, slot, value, tests, margin) of one ray; margin: by how little another answer was missed."""
        best, tests, margin = (np.inf, -1, np.zeros(4)), 0, np.inf
        for slot in self.lists[mirror][:columns]:
            if slot < 0:
                continue
            tests += 1
            t = ((self.middle[slot] - o) @ self.k[slot]) / (d @ self.k[slot])
            at = o + t * d - self.middle[slot]
            x, y = at @ self.a[slot] / self.half[slot, 0], at @ self.b[slot] / self.half[slot, 1]
            margin = min(margin, abs(t), abs(abs(x) - 1), abs(abs(y) - 1))
            if t <= 0 or abs(x) > 1 or abs(y) > 1:
                continue
            value = bilinear(self.texels[slot], x, y)
            margin = min(margin, abs(value[3] - 0.5), abs(t - best[0]))
            if value[3] > 0.5 and t < best[0]:
                best = (t, slot, value / value[3])
        return *best, tests, margin


def quads(count=6, seed=2) -> Quads:
    rng = np.random.default_rng(seed)
    k, side = rng.normal(size=(2, count, 3))
    k /= np.linalg.norm(k, axis=1, keepdims=True)
    a = np.cross(side, k)
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    coverage = np.kron(rng.integers(0, 2, (count, 4, 4)), np.ones((4, 4)))[..., None]  # holes of 4 x 4 texels
    texels = np.concatenate([coverage * rng.uniform(0, 1, (count, SIZE, SIZE, 3)), coverage], axis=-1)
    lists = np.array([[0, 1, 2, -1, 3, 5], [5, -1, 1, 4, 2, -1]])
    return Quads(rng.uniform(-1, 1, (count, 3)), a, np.cross(a, k), k, rng.uniform(0.4, 1.2, (count, 2)), texels, lists, 4)
