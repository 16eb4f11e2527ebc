"""Where the reflection point really is: float64 NumPy on the reflector's own triangles, sharing nothing with the methods.

On a triangle with corners p_k and normals n_k, the point P = Σ b_k p_k reflects V to the eye where the tangential part of
the half vector vanishes with respect to the interpolated normal N = Σ b_k n_k: two equations for two barycentric
coordinates, solved by Newton's method with numerical derivatives. A vertex may have several such points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from benchharness.scene import Camera, Scene

STEPS = 12
LONGEST = 0.25  # barycentric; Newton's own steps overshoot on triangles as large as the mirror
INSIDE = 1e-6  # barycentric tolerance: a point on an edge belongs to both triangles


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Over the last axis, which is short: several times faster than NumPy's own sums there."""
    return np.einsum("...i,...i->...", a, b)


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.maximum(np.sqrt(_dot(v, v)), 1e-300)[..., None]


def _mismatch(
    b: np.ndarray, p: np.ndarray, n: np.ndarray, eye: np.ndarray, V: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Half vector minus normal, seen along two tangents [..., 2], with point and normal; b [..., 2], p and n [..., 3, 3]."""
    weights = np.concatenate([1 - b[..., :1] - b[..., 1:], b], axis=-1)
    P, N = np.einsum("...k,...ki->...i", weights, p), _unit(np.einsum("...k,...ki->...i", weights, n))
    h = _unit(_unit(eye - P) + _unit(V - P))
    s = _unit(p[..., 1, :] - p[..., 0, :])
    t = np.cross(_unit(np.cross(p[..., 1, :] - p[..., 0, :], p[..., 2, :] - p[..., 0, :])), s)
    f = h - N
    return np.stack([_dot(f, s), _dot(f, t)], axis=-1), P, N


def reflection_points(
    vertices: np.ndarray,
    normals: np.ndarray,
    faces: np.ndarray,
    eye: np.ndarray,
    V: np.ndarray,
    near: np.ndarray,
    candidates: int = 12,
) -> tuple[np.ndarray, np.ndarray]:
    """Reflection points of V [N, 3], on the triangles around each `near` [N, 3] and around the best mesh vertex.

    vertices, normals [M, 3], faces [F, 3]: the reflector in world space.
    Returns (R [N, K, 3], valid [N, K]): points, and which of the K candidates are reflection points.
    """
    eye, V, near = np.asarray(eye, np.float64), np.asarray(V, np.float64), np.asarray(near, np.float64)
    centre, centre_n = vertices[faces].mean(axis=1), _unit(normals[faces].sum(axis=1))
    to_eye = _unit(eye - centre)
    facing = _dot(to_eye, centre_n) > 0
    candidates = min(candidates, len(faces))
    chosen = np.empty((len(V), 2 * candidates), np.int64)
    chosen[:, candidates:] = KDTree(centre).query(near, candidates)[1].reshape(len(V), candidates)
    for i in range(len(V)):
        s = to_eye + _unit(V[i] - centre)
        agreement = np.where(facing, _dot(s, centre_n) / np.maximum(np.sqrt(_dot(s, s)), 1e-12), -1)
        chosen[i, :candidates] = np.argpartition(-agreement, candidates - 1)[:candidates]
    p, n = vertices[faces[chosen]], normals[faces[chosen]]
    V_ = V[:, None, :]
    b = np.full((*chosen.shape, 2), 1 / 3)
    h = 1e-6
    for _ in range(STEPS):
        f, *_ = _mismatch(b, p, n, eye, V_)
        J = np.stack([(_mismatch(b + h * np.eye(2)[k], p, n, eye, V_)[0] - f) / h for k in (0, 1)], axis=-1)
        det = J[..., 0, 0] * J[..., 1, 1] - J[..., 0, 1] * J[..., 1, 0]
        det = np.where(np.abs(det) < 1e-12, np.inf, det)
        step = np.stack(
            [J[..., 1, 1] * f[..., 0] - J[..., 0, 1] * f[..., 1], J[..., 0, 0] * f[..., 1] - J[..., 1, 0] * f[..., 0]], axis=-1
        )
        b = np.clip(b - np.clip(step / det[..., None], -LONGEST, LONGEST), -4, 4)
    f, P, N = _mismatch(b, p, n, eye, V_)
    inside = (b >= -INSIDE).all(axis=-1) & (b.sum(axis=-1) <= 1 + INSIDE)
    valid = inside & (np.abs(f).max(axis=-1) < 1e-7) & (_dot(eye - P, N) > 0) & (_dot(V_ - P, N) > 0)
    return P, valid


def on_screen(points: np.ndarray, camera: Camera, width: int, height: int) -> np.ndarray:
    """Pixel coordinates [..., 2] of points [..., 3]; NaN behind the eye."""
    q = points @ camera.world_to_screen(width, height)[:, :3].T + camera.world_to_screen(width, height)[:, 3]
    w = np.where(q[..., 2:] > 0, q[..., 2:], np.nan)
    return q[..., :2] / w


def nearest(points: np.ndarray, valid: np.ndarray, found: np.ndarray) -> np.ndarray:
    """Of each row's valid points the one nearest to `found` [N, 3]; NaN where there is none."""
    distance = np.where(valid, ((points - found[:, None]) ** 2).sum(axis=-1), np.inf)
    best = distance.argmin(axis=1)
    chosen = points[np.arange(len(points)), best]
    return np.where(np.isfinite(distance.min(axis=1))[:, None], chosen, np.nan)


def image_of(V: np.ndarray, R: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """The virtual image of V behind R on the eye's ray, [N, 3]."""
    away = np.linalg.norm(V - R, axis=-1, keepdims=True) + np.linalg.norm(R - eye, axis=-1, keepdims=True)
    return eye + away * _unit(R - eye)


@dataclass(frozen=True, eq=False)
class Roots:
    """Reflection points of some vertices and the images behind them, pixels [N, 2]; NaN where none is known.

    found, virtual  the R and V' that a method answered
    true, image     the true R nearest to that, and the V' that belongs to it
    world           the true R, metres [N, 3]
    """

    found: np.ndarray
    true: np.ndarray
    virtual: np.ndarray
    image: np.ndarray
    world: np.ndarray


def roots(
    scene: Scene, time: float, size: tuple[int, int], number: int, vertices: np.ndarray,
    R: np.ndarray, virtual: np.ndarray, usable: np.ndarray,
) -> Roots:  # fmt: skip
    """What `vertices`, numbers [N] in the order of `scene.parts`, have in reflector `number`; R, virtual [N, 3], usable [N]."""
    camera = scene.camera(time)
    eye, V = np.asarray(camera.eye), _placed(scene, time, vertices)
    points, valid = _candidates(scene, time, number, eye, V, R)
    true = nearest(points, valid & usable[:, None], R)
    found, true_, virtual_, image = (on_screen(p, camera, *size) for p in (R, true, virtual, image_of(V, true, eye)))
    return Roots(found, true_, virtual_, image, true)


def continued(scene: Scene, time: float, number: int, vertices: np.ndarray, before: np.ndarray) -> np.ndarray:
    """The true R nearest to where one was a moment ago, `before` [N, 3]; NaN where there is none."""
    eye, V = np.asarray(scene.camera(time).eye), _placed(scene, time, vertices)
    return nearest(*_candidates(scene, time, number, eye, V, before), before)


def _placed(scene: Scene, time: float, vertices: np.ndarray) -> np.ndarray:
    return np.concatenate([p.mesh.transformed(p.pose(time)).vertices for p in scene.parts])[vertices]


def _candidates(scene: Scene, time: float, number: int, eye: np.ndarray, V: np.ndarray, near: np.ndarray):
    reflector = scene.reflectors[number]
    mesh = (reflector.closed or reflector.mesh).transformed(reflector.pose(time))
    return reflection_points(mesh.vertices, mesh.normals, mesh.faces, eye, V, near)
