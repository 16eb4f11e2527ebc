"""Depth maps, their simplified rows and rays against them in plain float64 NumPy, one row and one ray at a time.

The conventions are those written down in `benchharness.kernels.images.depthmap`; nothing of its code is used.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

BACKGROUND = 2.0


@dataclass
class Camera:
    """At the origin of the map's space unless `matrix` (3 x 4, world to camera) says otherwise."""

    w: int
    focal: float
    zn: float
    zf: float
    matrix: np.ndarray

    def packet(self) -> np.ndarray:
        return np.concatenate([self.matrix.ravel(), [self.focal, self.zn, self.zf, 0.0]]).astype(np.float32)

    def zgl(self, Z):
        return (1 / self.zn - 1 / Z) / (1 / self.zn - 1 / self.zf)

    def Z(self, zgl):
        return 1 / (1 / self.zn - zgl * (1 / self.zn - 1 / self.zf))

    def project(self, p):
        """World points [..., 3] to (x, y, zgl)."""
        q = p @ self.matrix[:, :3].T + self.matrix[:, 3]
        c = 0.5 * (self.w - 1)
        x, y = c + self.focal * q[..., 0] / q[..., 2], c + self.focal * q[..., 1] / q[..., 2]
        return np.stack([x, y, self.zgl(q[..., 2])], axis=-1)

    def to_world(self, x, y, zgl):
        Z, c = self.Z(zgl), 0.5 * (self.w - 1)
        q = np.stack([(x - c) / self.focal * Z, (y - c) / self.focal * Z, Z], axis=-1)
        return (q - self.matrix[:, 3]) @ self.matrix[:, :3]


def camera(w=256, fill=1.0, zn=2.0, zf=4.0, matrix=None) -> Camera:
    """Sees |X|, |Y| <= fill at Z = (zn + zf) / 2."""
    matrix = np.eye(3, 4) if matrix is None else matrix
    return Camera(w, 0.5 * w * 0.5 * (zn + zf) / fill, zn, zf, matrix)


def spheres(cam: Camera, balls) -> np.ndarray:
    """zgl [w, w] of balls (X, Y, Z, radius) in the camera's space."""
    row, column = np.mgrid[: cam.w, : cam.w]
    c = 0.5 * (cam.w - 1)
    d = np.stack([(column - c) / cam.focal, (row - c) / cam.focal, np.ones_like(column, float)], axis=-1)
    nearest = np.full((cam.w, cam.w), np.inf)
    for *centre, radius in balls:
        b, a = d @ np.asarray(centre), np.sum(d * d, axis=-1)
        inside = b * b - a * (np.dot(centre, centre) - radius**2)
        Z = np.where(inside >= 0, (b - np.sqrt(np.maximum(inside, 0))) / a, np.inf)
        nearest = np.minimum(nearest, Z)
    seen = np.isfinite(nearest) & (nearest >= cam.zn) & (nearest <= cam.zf)
    return np.where(seen, cam.zgl(np.where(seen, nearest, cam.zn)), BACKGROUND)


def samples(depth, n, i, j):
    """zgl of row j of rotation i, and how far the worst sample is from changing its texel, pixels."""
    w, theta = len(depth), np.pi * i / n
    c, u = 0.5 * (w - 1), np.arange(w)
    x = c + (u - c) * np.cos(theta) - (j - c) * np.sin(theta)
    y = c + (u - c) * np.sin(theta) + (j - c) * np.cos(theta)
    column, row = np.floor(x + 0.5).astype(int), np.floor(y + 0.5).astype(int)
    inside = (column >= 0) & (column < w) & (row >= 0) & (row < w)
    margin = min(np.min(np.abs(x + 0.5 - np.round(x + 0.5))), np.min(np.abs(y + 0.5 - np.round(y + 0.5))))
    return np.where(inside, depth[np.clip(row, 0, w - 1), np.clip(column, 0, w - 1)], BACKGROUND), margin


def spans_of(values, split_jump=None):
    runs, start = [], None
    for u in range(len(values) + 1):
        covered = u < len(values) and values[u] < 1.5
        cut = start is not None and (not covered or (split_jump and abs(values[u] - values[u - 1]) > split_jump))
        if cut:
            runs.append((start, u - 1))
            start = None
        if covered and start is None:
            start = u
    return runs


def worst_of(values, s, e):
    """(error, sample) of the worst sample between s and e; and by how much it is worse than the next."""
    if e - s < 2:
        return 0.0, s, np.inf
    u = np.arange(s + 1, e)
    error = np.abs(values[u] - np.interp(u, [s, e], [values[s], values[e]]))
    order = np.argsort(-error, kind="stable")
    gap = error[order[0]] - error[order[1]] if len(u) > 1 else np.inf
    return error[order[0]], u[order[0]], gap


def simplified(values, m, split_jump=None):
    """Spans as lists of samples, the number of dropped spans, and the narrowest choice that was made, in zgl."""
    runs = spans_of(values, split_jump)
    dropped = 0
    if 2 * len(runs) > m:
        longest = sorted(runs, key=lambda run: (-(run[1] - run[0]), run[0]))[: m // 2]
        dropped, runs = len(runs) - len(longest), sorted(longest)
    lines = [[s] if s == e else [s, e] for s, e in runs]
    margin = np.inf
    while sum(map(len, lines)) < m:
        found = [(*worst_of(values, s, e), line, k) for line in lines for k, (s, e) in enumerate(pairwise(line))]
        found.sort(key=lambda one: -one[0])
        if not found or found[0][0] <= 1e-6:
            break
        error, u, gap, line, k = found[0]
        margin = min(margin, gap, error - found[1][0] if len(found) > 1 else np.inf, abs(error - 1e-6))
        line.insert(k + 1, u)
    return lines, dropped, margin


def encoded(lines, values, m):
    """As it is stored: [m, 2]."""
    points = [(-(u + 1) if u == line[-1] else u, values[u]) for line in lines for u in line]
    points = points or [(-(len(values) + 1), BACKGROUND)]
    last = points[-1]
    return np.array(points + [last] * (m - len(points)), dtype=float)


def bilinear(depth, x, y):
    """zgl between four texels where all four are covered, else the nearest."""
    w = len(depth)

    def at(row, column):
        inside = (row >= 0) & (row < w) & (column >= 0) & (column < w)
        return np.where(inside, depth[np.clip(row, 0, w - 1), np.clip(column, 0, w - 1)], BACKGROUND)

    i, j = np.floor(y).astype(int), np.floor(x).astype(int)
    fy, fx = y - i, x - j
    four = np.stack([at(i, j), at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)])
    weights = np.stack([(1 - fy) * (1 - fx), (1 - fy) * fx, fy * (1 - fx), fy * fx])
    nearest = at(np.floor(y + 0.5).astype(int), np.floor(x + 0.5).astype(int))
    return np.where(np.all(four < 1.5, axis=0), np.sum(weights * four, axis=0), nearest)


def clipped(cam: Camera, o, d):
    """Parameters of the ray's ends in the frustum, or None: in homogeneous pixels, plane by plane."""
    P, D = cam.matrix[:, :3] @ o + cam.matrix[:, 3], cam.matrix[:, :3] @ d
    h = 0.5 * cam.w / cam.focal
    low, high = 0.0, np.inf
    for normal, offset in (
        ((0, 0, 1), -cam.zn), ((0, 0, -1), cam.zf), ((1, 0, h), 0), ((-1, 0, h), 0), ((0, 1, h), 0), ((0, -1, h), 0)
    ):  # fmt: skip
        value, rate = np.dot(normal, P) + offset, np.dot(normal, D)
        if rate > 0:
            low = max(low, -value / rate)
        elif rate < 0:
            high = min(high, -value / rate)
        elif value < 0:
            return None
    return (low, high) if low <= high < np.inf else None


def first_hit(depth, cam: Camera, o, d, per_texel=8, jump=None):
    """The ray's first way from in front of the depth field to behind it: (x, y, s), or None; and its image's length."""
    ends = clipped(cam, o, d)
    if ends is None:
        return None, 0.0
    a, b = cam.project(np.stack([o + ends[0] * d, o + ends[1] * d]))
    length = np.hypot(*(b - a)[:2])
    t = np.linspace(0, 1, max(int(np.ceil(length * per_texel)), 1) + 1)
    q = a + t[:, None] * (b - a)
    field = bilinear(depth, q[:, 0], q[:, 1])
    gap, covered = q[:, 2] - field, field < 1.5
    joined = covered[1:] & covered[:-1]
    if jump:
        joined &= np.abs(np.diff(field)) <= jump
    through = np.flatnonzero(joined & (gap[:-1] <= 0) & (gap[1:] > 0))
    if not len(through):
        return None, length
    k = through[0]
    share = -gap[k] / (gap[k + 1] - gap[k])
    x, y, zgl = q[k] + share * (q[k + 1] - q[k])
    p = cam.to_world(x, y, zgl)
    return (x, y, np.dot(p - o, d) / np.dot(d, d)), length
