"""How far a point of a mesh is from a true reflection point, in pixels: float64, on triangles with interpolated normals.

The nearest triangles are asked first, each from its own point nearest to R: that finds the root that R is meant to be,
also where triangles are large and the half vector changes within a hundredth of one, as it does close to the mirror.
What is far from these is asked of all triangles.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from benchharness.measure import truth
from benchharness.scene import Camera, Reflector

NEAR = 16  # triangles
STEPS = 15
BEYOND_PX = 0.01  # a root this far outside of its triangle is there: methods stop within 0.004 px of one, also at a rim
AGREED = 1e-7  # half vector less normal, along the triangle
ASKED = 40  # of the points that are far from every near root; each costs a pass over all triangles


class Surface:
    """A mirror as an eye sees it: corners and normals [F, 3, 3], of an open sheet those of the side that the eye sees; and
    spots of each triangle, to find it by."""

    def __init__(self, mirror: Reflector, eye: np.ndarray) -> None:
        self.mesh, self.both_sides = mirror.mesh, mirror.closed is None
        p, n = self.mesh.vertices[self.mesh.faces], self.mesh.normals[self.mesh.faces]
        if self.both_sides:
            away = (np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]) * (eye - p[:, 0])).sum(axis=1) < 0
            n = np.where(away[:, None, None], -n, n)
        self.p, self.n = p, n
        corners, middles = (p[:, i] for i in range(3)), (0.5 * (p[:, i] + p[:, i - 1]) for i in range(3))
        self.spots = KDTree(np.concatenate([p.mean(axis=1), *corners, *middles]))


def _nearest(surface: Surface, R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of each R [N, 3], the nearest triangles and weights of a point close to R in each: [N, K], [N, K, 2]."""
    p = surface.p
    chosen = surface.spots.query(R, min(6 * NEAR, surface.spots.n))[1].reshape(len(R), -1) % len(p)
    e1, e2, d = p[chosen, 1] - p[chosen, 0], p[chosen, 2] - p[chosen, 0], R[:, None] - p[chosen, 0]
    a, b, c, y1, y2 = ((x * y).sum(axis=-1) for x, y in ((e1, e1), (e1, e2), (e2, e2), (d, e1), (d, e2)))
    det = np.maximum(a * c - b * b, 1e-300)
    w = np.clip(np.stack([(c * y1 - b * y2) / det, (a * y2 - b * y1) / det], axis=-1), 0, 1)
    w = np.clip(w - 0.5 * np.maximum(w.sum(axis=-1, keepdims=True) - 1, 0), 0, 1)
    away = np.linalg.norm(d - w[..., :1] * e1 - w[..., 1:] * e2, axis=-1)
    order = away.argsort(axis=1)[:, :NEAR]
    return np.take_along_axis(chosen, order, axis=1), np.take_along_axis(w, order[..., None], axis=1)


def _off(p, n, eye, V, b, R, screen) -> np.ndarray:
    """Newton's method from b on triangles p, n [N, K, 3, 3]: pixels from R to the nearest of its roots [N], inf for none."""
    h, tangents = 1e-6, truth._tangents(p)
    f = np.zeros(b.shape)
    for _ in range(STEPS):
        f, right, up = (truth._mismatch(b + h * np.array(d), p, n, tangents, eye, V)[0] for d in ((0, 0), (1, 0), (0, 1)))
        J = np.stack([right - f, up - f], axis=-1) / h
        det = J[..., 0, 0] * J[..., 1, 1] - J[..., 0, 1] * J[..., 1, 0]
        step = np.stack([J[..., 1, 1] * f[..., 0] - J[..., 0, 1] * f[..., 1],
                         J[..., 0, 0] * f[..., 1] - J[..., 1, 0] * f[..., 0]], axis=-1)  # fmt: skip
        step /= np.where(np.abs(det) < 1e-12, np.inf, det)[..., None]
        b = np.clip(b - np.clip(step, -0.25, 0.25), -4, 4)
    f, P, N = truth._mismatch(b, p, n, tangents, eye, V)
    inside = np.clip(b, 0, 1)
    inside = np.clip(inside - 0.5 * np.maximum(inside.sum(axis=-1, keepdims=True) - 1, 0), 0, 1)
    held = p[..., 0, :] + inside[..., :1] * (p[..., 1, :] - p[..., 0, :]) + inside[..., 1:] * (p[..., 2, :] - p[..., 0, :])
    front = (((eye - P) * N).sum(axis=-1) > 0) & (((V - P) * N).sum(axis=-1) > 0)
    beyond = np.linalg.norm(screen(P) - screen(held), axis=-1)
    valid = front & (np.abs(f).max(axis=-1) < AGREED) & (beyond <= BEYOND_PX)
    apart = np.linalg.norm(screen(P) - screen(R)[:, None], axis=-1)
    return np.where(valid & np.isfinite(apart), apart, np.inf).min(axis=1)


def pixels_off(
    surface: Surface, camera: Camera, size: tuple[int, int], V: np.ndarray, R: np.ndarray, enough: float
) -> np.ndarray:
    """Pixels from each R [N, 3] to the nearest true reflection point of V [N, 3], inf where there is none; [N].

    Where no root that is near is within `enough` pixels, all are asked, of ASKED points at most: others are left at inf.
    """
    eye, p, n = np.asarray(camera.eye, float), surface.p, surface.n

    def screen(x):
        return truth.on_screen(x, camera, *size)

    chosen, b = _nearest(surface, R)
    off = _off(p[chosen], n[chosen], eye, V[:, None], b, R, screen)
    far = np.flatnonzero(off > enough)[:ASKED]
    mesh = surface.mesh
    points, _ = truth.every_reflection_point(
        mesh.vertices, mesh.normals, mesh.faces, eye, V[far], both_sides=surface.both_sides
    )
    for i, P in zip(far, points, strict=True):
        if len(P):
            off[i] = np.nanmin(np.append(np.linalg.norm(screen(P) - screen(R[i]), axis=1), off[i]))
    return off
