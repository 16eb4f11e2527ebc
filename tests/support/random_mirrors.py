"""Mirrors as users have them, drawn by a seed: flat, needle-like, hard-edged, bumpy, hollow and open, of 12 to
500,000 triangles; an eye near or far; vertices near and far, grazing, close to the mirror, and behind it."""

from __future__ import annotations

import numpy as np
from support.hollow_shapes import Bowl, Ring, Sheet
from support.star_shapes import Bumpy, Ellipsoid
from support.truth_shapes import unit

from benchharness.scene import Mesh, Reflector
from scenes.props import shapes

WHITE = (1.0, 1.0, 1.0)


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _ellipsoid(rng: np.random.Generator, half: tuple[float, float, float], fine: tuple[int, ...]) -> Mesh:
    return Ellipsoid(half=half).mesh(int(rng.choice(fine)))


def round_(rng: np.random.Generator) -> Mesh:
    return _ellipsoid(rng, tuple(rng.uniform(0.5, 1, 3)), (0, 1, 2, 3, 5))


def fine(rng: np.random.Generator) -> Mesh:
    return _ellipsoid(rng, tuple(rng.uniform(0.3, 1, 3)), (6,))


def finest(rng: np.random.Generator) -> Mesh:
    """A spheroid of half a million triangles."""
    t = np.linspace(-0.5, 0.5, 502) * np.pi
    return shapes.lathe(np.stack([np.cos(t), rng.uniform(0.3, 1) * np.sin(t)], axis=1), 500, WHITE)


def flat(rng: np.random.Generator) -> Mesh:
    return _ellipsoid(rng, (1.0, rng.uniform(0.5, 1), _log(rng, 0.02, 0.3)), (3, 4, 5))


def needle(rng: np.random.Generator) -> Mesh:
    thin = _log(rng, 0.02, 0.3)
    return _ellipsoid(rng, (thin, thin * rng.uniform(0.5, 1), 1.0), (3, 4, 5))


def frustum(rng: np.random.Generator) -> Mesh:
    """Cones cut off, and cylinders; the rim has a normal for either side."""
    bottom, top, h, rings = rng.uniform(0.2, 1), rng.uniform(0.1, 1), _log(rng, 0.1, 3), int(rng.choice((2, 5)))
    side = zip(np.linspace(bottom, top, rings), np.linspace(-h / 2, h / 2, rings), strict=True)
    return shapes.lathe([(0, -h / 2), *side, (0, h / 2)], int(rng.choice((6, 12, 24, 96))), WHITE)


def box(rng: np.random.Generator) -> Mesh:
    half = np.array([_log(rng, 0.05, 1) for _ in range(3)])
    bevel = float(rng.choice((0, 0, 0.02, 0.1))) * half.min()
    return shapes.box(-half, half, WHITE, spacing=0.3 if not bevel and rng.random() < 0.5 else np.inf, bevel=bevel)


def bumpy(rng: np.random.Generator) -> Mesh:
    return Bumpy(eps=float(rng.uniform(-0.3, 0.3))).mesh(int(rng.choice((3, 5))))


def hollow(rng: np.random.Generator) -> Reflector:
    bowl = Bowl(tuple(rng.uniform(0.3, 1, 3)), float(rng.uniform(0, 0.6)))
    made = (bowl, Sheet(*map(float, rng.uniform(-1, 1, 2))), Ring(float(rng.uniform(0.1, 0.6))))
    return made[int(rng.integers(3))].mirror()


def patch(rng: np.random.Generator) -> Reflector:
    """A piece of an ellipsoid, cut along its triangles."""
    mesh = _ellipsoid(rng, (1.0, 0.7, _log(rng, 0.05, 1)), (4,))
    kept = mesh.faces[mesh.vertices[mesh.faces].mean(axis=1) @ unit(rng.normal(size=3)) > rng.uniform(-0.3, 0.3)]
    used, faces = np.unique(kept, return_inverse=True)
    return Reflector("mirror", Mesh(mesh.vertices[used], faces.reshape(kept.shape), mesh.normals[used]))


CLOSED = {f.__name__.strip("_"): f for f in (round_, fine, flat, needle, frustum, box, bumpy, finest)}
KINDS = (*CLOSED, "hollow", "patch")


def mirror(kind: str, rng: np.random.Generator) -> Reflector:
    if kind in CLOSED:
        mesh = CLOSED[kind](rng)
        return Reflector("mirror", mesh, mesh)
    return {"hollow": hollow, "patch": patch}[kind](rng)


def eye_before(made: Reflector, rng: np.random.Generator) -> tuple[np.ndarray, float]:
    """An eye .7 to 6 sizes from the middle, and a field of view, degrees, that holds most of the mirror."""
    size = float(np.linalg.norm(np.ptp(made.mesh.vertices, axis=0)))
    distance = size * _log(rng, 0.7, 6)
    return distance * unit(rng.normal(size=3)), float(np.clip(2 * np.degrees(np.arctan(0.6 * size / distance)), 5, 110))


def vertices(made: Reflector, eye: np.ndarray, rng: np.random.Generator, count: int) -> np.ndarray:
    """Vertices [count, 3]: five in six are reflected at a random point by the mesh's normal there, from .003 to 20 sizes away,
    half of the time down to the last degree of grazing; the rest are anywhere, also behind the mirror and in it."""
    mesh, most = made.mesh, count * 5 // 6
    p, n = mesh.vertices[mesh.faces], mesh.normals[mesh.faces]
    size = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    facet = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    area = np.linalg.norm(facet, axis=1)
    at, b = rng.choice(len(p), 12 * count, p=area / area.sum()), rng.dirichlet((1, 1, 1), 12 * count)
    P, N = np.einsum("nk,nkd->nd", b, p[at]), unit(np.einsum("nk,nkd->nd", b, n[at]))
    w = unit(eye - P)
    if made.closed is None:
        N = np.where(((w * facet[at]).sum(axis=1) < 0)[:, None], -N, N)
    cosine = (N * w).sum(axis=1, keepdims=True)
    V = P + size * np.exp(rng.uniform(np.log(0.003), np.log(20), cosine.shape)) * (2 * cosine * N - w)
    V = np.resize(V[cosine[:, 0] > rng.choice((0.01, 0.1))], (most, 3))
    rest = unit(rng.normal(size=(count - most, 3))) * size * np.exp(rng.uniform(np.log(0.3), np.log(10), (count - most, 1)))
    return np.concatenate([V, rest])
