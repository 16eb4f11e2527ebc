"""Organic shapes: ellipsoids blended into one smooth body, and its surface as triangles.

A body is the set f < 0. Each `Blob` has the first-order distance to its ellipsoid (radii r, in its own axes)

    d(x) = a (a - 1) / b,    a = |x / r|,    b = |x / r²|,

zero on the ellipsoid and of unit slope there. Blobs join one after the other, softly over a width of about k:

    f ← -k log(exp(-f/k) + exp(-d/k)),    and a cut takes away:  f ← k log(exp(f/k) + exp(-d/k)).

All of it is smooth, so that normals taken from f are, and what a mirror of that shape shows is. (Where two blobs are equally
near the joint swells by k log 2.)

Marching cubes give the triangles, many of them slivers. So the vertices are spread evenly within the surface, each towards the
middle of its neighbours, and go onto it by Newton's method: what were slivers have room then.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import trimesh
from scipy.sparse import coo_array
from skimage.measure import marching_cubes

from benchharness.scene import Mesh

Triple = tuple[float, float, float]
ROUNDS = 10
"""Of spreading the vertices."""


@dataclass(frozen=True)
class Blob:
    """An ellipsoid.

    at      its centre, metres
    radii   along its own axes, metres
    up      where its own z points; its x stays level, or along x if z points along y
    k       width of the blend with the blobs before it, metres
    cut     takes away instead
    part    what it belongs to, for colours
    """

    at: Triple
    radii: Triple
    up: Triple = (0.0, 0.0, 1.0)
    k: float = 0.01
    cut: bool = False
    part: str = ""

    def axes(self) -> np.ndarray:
        """Rows: unit x, y and z of the ellipsoid, float64 [3, 3]."""
        z = np.asarray(self.up, np.float64)
        z = z / np.linalg.norm(z)
        x = np.cross([0.0, 1.0, 0.0], z)
        x = np.array([1.0, 0.0, 0.0]) if np.linalg.norm(x) < 1e-9 else x / np.linalg.norm(x)
        return np.stack([x, np.cross(z, x), z])

    def distance(self, p: np.ndarray) -> np.ndarray:
        """Distance of points [..., 3] from the surface, metres, to first order near the surface; negative inside."""
        q = ((p - self.at) @ self.axes().T) / self.radii
        a = np.sqrt(np.einsum("...i,...i->...", q, q))
        q /= self.radii
        b = np.sqrt(np.einsum("...i,...i->...", q, q))
        return np.where(a > 1e-6, a * (a - 1) / np.maximum(b, 1e-300), -min(self.radii))

    def gradient(self, p: np.ndarray) -> np.ndarray:
        """Gradient of `distance` at points [N, 3], float64 [N, 3]."""
        r = np.asarray(self.radii)
        y = (p - self.at) @ self.axes().T
        a, b = np.linalg.norm(y / r, axis=1)[:, None], np.linalg.norm(y / r**2, axis=1)[:, None]
        a, b = np.maximum(a, 1e-9), np.maximum(b, 1e-300)
        return (((2 - 1 / a) * y / r**2 - a * (a - 1) / b**2 * y / r**4) / b) @ self.axes()


def limb(
    start: Triple, end: Triple, radius: float, other: float | None = None, *, k: float = 0.01, cut: bool = False, part: str = ""
) -> Blob:
    """A long blob whose tips are `start` and `end`; `radius` is half its width along its level x, `other` across (the same)."""
    a, b = np.asarray(start, np.float64), np.asarray(end, np.float64)
    x, y, z = (0.5 * (a + b)).tolist()
    half = float(0.5 * np.linalg.norm(b - a))
    return Blob((x, y, z), (radius, radius if other is None else other, half), tuple((b - a).tolist()), k, cut, part)


def mirrored(blobs: Sequence[Blob]) -> list[Blob]:
    """The blobs, and each again at the other side of x = 0."""
    out = []
    for b in blobs:
        (x, y, z), (u, v, w) = b.at, b.up
        out += [b, replace(b, at=(-x, y, z), up=(-u, v, w))]
    return out


def field(blobs: Sequence[Blob], p: np.ndarray) -> np.ndarray:
    """f at points [..., 3], metres: negative inside the body, about the distance to its surface near it."""
    f = np.full(p.shape[:-1], 1e3)
    for b in blobs:
        d = b.distance(p)
        f = b.k * np.logaddexp(f / b.k, -d / b.k) if b.cut else -b.k * np.logaddexp(-f / b.k, -d / b.k)
    return f


def gradient(blobs: Sequence[Blob], p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """f [N] and ∇f [N, 3] at points [N, 3]."""
    f, g = np.full(len(p), 1e3), np.zeros((len(p), 3))
    for b in blobs:
        d, side = b.distance(p), -1.0 if b.cut else 1.0
        # A cut is the union of the outside and the blob, seen from the other side; the share of d in the gradient is a sigmoid.
        joined = -b.k * np.logaddexp(-side * f / b.k, -d / b.k)
        share = np.exp((joined - d) / b.k)[:, None]
        f, g = side * joined, (1 - share) * g + side * share * b.gradient(p)
    return f, g


def normals(blobs: Sequence[Blob], p: np.ndarray) -> np.ndarray:
    """Outward unit normals of the level of f through points [N, 3]."""
    g = gradient(blobs, p)[1]
    return g / np.linalg.norm(g, axis=1, keepdims=True)


def blended(blobs: Sequence[Blob], p: np.ndarray, colours: dict[str, tuple], width: float) -> np.ndarray:
    """Colours [N, 3] of points [N, 3]: of the blobs' parts, by how near each blob's surface is, over about `width` metres."""
    away = np.stack([abs(b.distance(p)) for b in blobs], axis=1)
    weight = np.exp((away.min(axis=1, keepdims=True) - away) / width)
    return weight @ np.array([colours[b.part] for b in blobs]) / weight.sum(axis=1, keepdims=True)


def polygonised(blobs: Sequence[Blob], cell: float) -> Mesh:
    """The surface of the body as a closed mesh wound outward, from a grid of cells `cell` metres wide; normals are those of f.

    Raises ValueError for a cell that is not positive, and where the triangles do not close, as when the cell is wider than
    what the body has of thin parts.
    """
    if not 0 < cell < np.inf:
        raise ValueError(f"polygonised: cell is {cell}; accepted: a positive length in metres")
    values, origin = _sampled(blobs, cell)
    vertices, faces, _, _ = marching_cubes(values, 0.0, allow_degenerate=False)
    v = _spread(blobs, origin + cell * vertices.astype(np.float64), faces)
    corners = v[faces]
    volume = np.einsum("fi,fi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    mesh = Mesh(v, faces if volume > 0 else faces[:, ::-1], normals(blobs, v))
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    if (np.unique(edges, axis=0, return_counts=True)[1] != 2).any():
        raise ValueError(f"polygonised: the surface does not close with cells of {cell:g} m; accepted: smaller cells")
    return mesh


def _sampled(blobs: Sequence[Blob], cell: float) -> tuple[np.ndarray, np.ndarray]:
    """f on a grid that has the body inside, float64 [X, Y, Z], and where its first point is, [3]."""
    reach = [np.linalg.norm(b.axes() * np.asarray(b.radii)[:, None], axis=0) + 2 * b.k for b in blobs if not b.cut]
    at = [np.asarray(b.at) for b in blobs if not b.cut]
    lo = np.min(np.subtract(at, reach), axis=0) - 2 * cell
    hi = np.max(np.add(at, reach), axis=0) + 2 * cell
    x, y, z = (np.arange(a, b + cell, cell) for a, b in zip(lo, hi, strict=True))
    yz = np.stack(np.broadcast_arrays(y[:, None], z[None, :]), axis=-1)
    values = [field(blobs, np.concatenate([np.full((*yz.shape[:2], 1), s), yz], axis=-1)) for s in x]
    return np.stack(values), lo


def _spread(blobs: Sequence[Blob], v: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Vertices [V, 3] moved within the surface towards the middle of their neighbours, and onto it."""
    edges = trimesh.Trimesh(v, faces, process=False).edges_unique
    i, j = np.concatenate([edges, edges[:, ::-1]]).T
    sums = coo_array((np.ones(len(i)), (i, j)), (len(v), len(v))).tocsr()
    count = np.bincount(i, minlength=len(v))[:, None]
    for _ in range(ROUNDS):
        f, g = gradient(blobs, v)
        steep = (g * g).sum(axis=1, keepdims=True)
        way = sums @ v / count - v
        v = v + 0.5 * way - g * ((0.5 * way * g).sum(axis=1, keepdims=True) + f[:, None]) / steep
    return _on_surface(blobs, v, 3)


def _on_surface(blobs: Sequence[Blob], v: np.ndarray, count: int) -> np.ndarray:
    """`count` of Newton's steps along the gradient towards f = 0."""
    for _ in range(count):
        f, g = gradient(blobs, v)
        v = v - (f / (g * g).sum(axis=1))[:, None] * g
    return v
