"""Normal maps in plain float64 NumPy, one point at a time, as `benchharness.modelling.normalmap` has them."""

from __future__ import annotations

import numpy as np
from oracles.texture_oracle import looked_up

from benchharness.scene import Mesh, Texture


def unit(a: np.ndarray) -> np.ndarray:
    return a / np.linalg.norm(a)


def mapped(corners: np.ndarray, uv: np.ndarray, weights: np.ndarray, n: np.ndarray, map: Texture) -> np.ndarray:
    """The normal at the point `weights` [3] of a triangle, corners [3, 3], uv [3, 2], whose smooth unit normal is n, [3]."""
    sides = np.stack([uv[1] - uv[0], uv[2] - uv[0]], axis=1)
    if abs(np.linalg.det(sides)) <= 1e-6 * np.linalg.norm(sides[:, 0]) * np.linalg.norm(sides[:, 1]):
        return n
    # Where p goes as u grows, and as v does: the linear map that takes both sides in uv to those in space.
    jacobian = np.stack([corners[1] - corners[0], corners[2] - corners[0]], axis=1) @ np.linalg.inv(sides)
    s = unit(jacobian[:, 0] - (n @ jacobian[:, 0]) * n)
    across = np.cross(s, n)
    t = across if across @ jacobian[:, 1] > 0 else -across
    x, y, z = unit(2 * looked_up(map.pixels, map.along, (weights @ uv)[None])[0] - 1)
    return x * s + y * t + z * n


def mirrored(N: np.ndarray, g: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The normal that the ray to v [3] is reflected about, on v's side, and the reflected direction; g is the
    triangle's own unit normal."""
    r = 2 * (N @ v) * N - v
    front = g if g @ v > 0 else -g
    if r @ front < 0:
        r = r - 2 * (r @ front) * front
    return unit(v + r), r


def points(mesh: Mesh, p: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The triangles that points [N, 3] of a mesh lie on, int [N], their weights [N, 3], and the least of these, as a margin."""
    face, best, margin = np.zeros(len(p), int), np.zeros((len(p), 3)), np.full(len(p), -np.inf)
    size = float(np.ptp(mesh.vertices, axis=0).max())
    for number, corners in enumerate(mesh.vertices[mesh.faces]):
        area = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        if not area @ area > 0:
            continue
        weights = np.stack(
            [np.cross(corners[(k + 1) % 3] - p, corners[(k + 2) % 3] - p) @ area / (area @ area) for k in range(3)], axis=1
        )
        near = np.abs((p - corners[0]) @ unit(area)) < 1e-6 * size
        better = near & (weights.min(axis=1) > margin)
        face, margin = np.where(better, number, face), np.where(better, weights.min(axis=1), margin)
        best = np.where(better[:, None], weights, best)
    return face, best, margin


def seen(mesh: Mesh, map: Texture | None, p: np.ndarray, eye: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """At points [N, 3] of a mirror: normals and reflected directions of rays from the eye, [N, 3] each, and how sure their
    triangles are, as `points` says."""
    assert mesh.uv is not None and map is not None
    face, weights, sure = points(mesh, p)
    normals, directions = np.zeros((len(p), 3)), np.zeros((len(p), 3))
    for lane in range(len(p)):
        corners = mesh.faces[face[lane]]
        n, v = unit(weights[lane] @ mesh.normals[corners]), unit(eye - p[lane])
        N = mapped(mesh.vertices[corners], mesh.uv[corners], weights[lane], n, map)
        a, b, c = mesh.vertices[corners]
        normals[lane], directions[lane] = mirrored(N, unit(np.cross(b - a, c - a)), v)
    return normals, directions, sure
