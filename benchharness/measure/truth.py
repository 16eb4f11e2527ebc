"""Where the reflection point really is: float64 NumPy on the reflector's own triangles, sharing nothing with the methods.

On a triangle with corners p_k and normals n_k, the point P = Σ b_k p_k reflects V to the eye where the tangential part of
the half vector vanishes with respect to the interpolated normal N = Σ b_k n_k: two equations for two barycentric
coordinates, solved by Newton's method with numerical derivatives. A vertex may have several such points:
`reflection_points` finds those near a guess, quickly, `every_reflection_point` all of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from benchharness.scene import Camera, Scene

STEPS = 12
SETTLED = 1e-13  # barycentric: when no step is longer, none will be
LONGEST = 0.25  # barycentric; Newton's own steps overshoot on triangles as large as the mirror
INSIDE = 1e-6  # barycentric tolerance: a point on an edge belongs to both triangles
NEIGHBOURLY = 1.0  # barycentric; a start this far outside of a triangle may lead into it, as the mismatch is not linear
SAME = 1e-5  # of the reflector's size; nearer than this, an edge's or a corner's triangles have found the same point
LIFT = 1e-4  # of the reflector's size; rays start this far in front of the surface


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Over the last axis, which is short: several times faster than NumPy's own sums there."""
    return np.einsum("...i,...i->...", a, b)


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.maximum(np.sqrt(_dot(v, v)), 1e-300)[..., None]


def _tangents(p: np.ndarray) -> np.ndarray:
    """Two unit vectors along each triangle p [..., 3, 3], at right angles: [..., 2, 3]."""
    one, other = p[..., 1, :] - p[..., 0, :], p[..., 2, :] - p[..., 0, :]
    s = _unit(one)
    return np.stack([s, np.cross(_unit(np.cross(one, other)), s)], axis=-2)


def _mismatch(
    b: np.ndarray, p: np.ndarray, n: np.ndarray, tangents: np.ndarray, eye: np.ndarray, V: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`_bent` at b [..., 2] on triangles p, n [..., 3, 3]; with the point and the normal there."""
    weights = np.concatenate([1 - b[..., :1] - b[..., 1:], b], axis=-1)
    P, N = np.einsum("...k,...ki->...i", weights, p), _unit(np.einsum("...k,...ki->...i", weights, n))
    return _bent(P, N, tangents, eye, V), P, N


def _bent(P: np.ndarray, N: np.ndarray, tangents: np.ndarray, eye: np.ndarray, V: np.ndarray) -> np.ndarray:
    """Half vector minus normal at P, seen along both tangents, [..., 2]."""
    h = _unit(_unit(eye - P) + _unit(V - P))
    return np.einsum("...ki,...i->...k", tangents, h - N)


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
    return _solved(vertices[faces[chosen]], normals[faces[chosen]], eye, V[:, None, :], np.full((*chosen.shape, 2), 1 / 3))[:2]


def _solved(p, n, eye, V, b) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Newton's method from b [..., 2] on triangles p, n [..., 3, 3]: points, which are reflection points, and normals."""
    h, tangents = 1e-6, _tangents(p)
    beside = h * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]).reshape(3, *[1] * (b.ndim - 1), 2)
    for _ in range(STEPS):
        f, right, up = _mismatch(b + beside, p, n, tangents, eye, V)[0]
        J = np.stack([right - f, up - f], axis=-1) / h
        det = J[..., 0, 0] * J[..., 1, 1] - J[..., 0, 1] * J[..., 1, 0]
        det = np.where(np.abs(det) < 1e-12, np.inf, det)
        step = np.stack(
            [J[..., 1, 1] * f[..., 0] - J[..., 0, 1] * f[..., 1], J[..., 0, 0] * f[..., 1] - J[..., 1, 0] * f[..., 0]], axis=-1
        )
        step = np.clip(step / det[..., None], -LONGEST, LONGEST)
        b = np.clip(b - step, -4, 4)
        if not np.abs(step).max(initial=0) > SETTLED:
            break
    f, P, N = _mismatch(b, p, n, tangents, eye, V)
    inside = (b >= -INSIDE).all(axis=-1) & (b.sum(axis=-1) <= 1 + INSIDE)
    valid = inside & (np.abs(f).max(axis=-1) < 1e-7) & (_dot(eye - P, N) > 0) & (_dot(V - P, N) > 0)
    return P, valid, N


def every_reflection_point(
    vertices: np.ndarray, normals: np.ndarray, faces: np.ndarray, eye: np.ndarray, V: np.ndarray, *, both_sides: bool = False
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """All reflection points of each V [N, 3], and which of them show it: lists of N arrays [K, 3] and [K].

    Every triangle is asked: where the mismatch would vanish if it were linear on it, Newton's method starts if that is not far
    outside. A point shows its V if no other part of the mesh is between it and the eye or between it and V. One vertex
    costs two passes over all triangles, so this is for some fifty at a time.

    vertices, normals [M, 3], faces [F, 3]: the reflector in world space; `both_sides`: an open sheet, a mirror on its back too
    """
    eye = np.asarray(eye, np.float64)
    p, n = vertices[faces], normals[faces]
    if both_sides:
        away = (np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]) * (eye - p[:, 0])).sum(axis=1) < 0
        n = np.where(away[:, None, None], -n, n)
    size = np.linalg.norm(np.ptp(vertices, axis=0))
    tangents, corners, normals_there = _tangents(p), p.swapaxes(0, 1), _unit(n).swapaxes(0, 1)
    points, shown = [], []
    for v in np.asarray(V, np.float64):
        f = _bent(corners, normals_there, tangents, eye, v)
        J = np.stack([f[1] - f[0], f[2] - f[0]], axis=-1)
        det = J[:, 0, 0] * J[:, 1, 1] - J[:, 0, 1] * J[:, 1, 0]
        det = np.where(np.abs(det) < 1e-14, np.inf, det)
        b = np.stack(
            [J[:, 0, 1] * f[0, :, 1] - J[:, 1, 1] * f[0, :, 0], J[:, 1, 0] * f[0, :, 0] - J[:, 0, 0] * f[0, :, 1]], axis=1
        )
        b = b / det[:, None]
        near = (b > -NEIGHBOURLY).all(axis=1) & (b.sum(axis=1) < 1 + NEIGHBOURLY)
        P, valid, N = _solved(p[near], n[near], eye, v, np.clip(b[near], 0, 1))
        P, N = P[valid], N[valid]
        first = [i for i in range(len(P)) if (np.linalg.norm(P[:i] - P[i], axis=1) > SAME * size).all()]
        P, lifted = P[first], P[first] + LIFT * size * N[first]
        points.append(P)
        shown.append(np.array([not (_blocked(o, eye, p) or _blocked(o, v, p)) for o in lifted], bool))
    return points, shown


def _blocked(o: np.ndarray, end: np.ndarray, p: np.ndarray) -> bool:
    """Whether a triangle of p [F, 3, 3] crosses the segment from o to just before `end` (Möller and Trumbore 1997)."""
    d = end - o
    e1, e2, s = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0], o - p[:, 0]
    q, r = np.cross(d, e2), np.cross(s, e1)
    det = (e1 * q).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        u, w, t = (s * q).sum(axis=1) / det, (r @ d) / det, (e2 * r).sum(axis=1) / det
    return bool(((u >= 0) & (w >= 0) & (u + w <= 1) & (t > 0) & (t < 1 - 1e-4)).any())


def on_screen(points: np.ndarray, camera: Camera, width: int, height: int) -> np.ndarray:
    """Pixel coordinates [..., 2] of points [..., 3]; NaN behind the eye."""
    q = points @ camera.world_to_screen(width, height)[:, :3].T + camera.world_to_screen(width, height)[:, 3]
    w = np.where(q[..., 2:] > 0, q[..., 2:], np.nan)
    return q[..., :2] / w


def nearest(points: np.ndarray, valid: np.ndarray, found: np.ndarray) -> np.ndarray:
    """The valid point of each row that is nearest to `found` [N, 3]; NaN where there is none."""
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


@dataclass(frozen=True, eq=False)
class Mirror:
    """Reflector number `number` of a scene at a moment, for its true reflection points; `size`: of the picture, pixels."""

    scene: Scene
    time: float
    size: tuple[int, int]
    number: int

    def roots(self, vertices: np.ndarray, R: np.ndarray, virtual: np.ndarray, usable: np.ndarray) -> Roots:
        """What `vertices`, numbers [N] in the order of `Scene.parts`, have here; R, virtual [N, 3] of a method, and which of
        them are usable [N]."""
        camera = self.scene.camera(self.time)
        eye, V = np.asarray(camera.eye), placed(self.scene, self.time, vertices)
        points, valid = self._candidates(eye, V, R)
        true = nearest(points, valid & usable[:, None], R)
        found, true_, virtual_, image = (on_screen(p, camera, *self.size) for p in (R, true, virtual, image_of(V, true, eye)))
        return Roots(found, true_, virtual_, image, true)

    def continued(self, vertices: np.ndarray, before: np.ndarray) -> np.ndarray:
        """The true R nearest to where one was a moment ago, `before` [N, 3]; NaN where there is none."""
        eye, V = np.asarray(self.scene.camera(self.time).eye), placed(self.scene, self.time, vertices)
        return nearest(*self._candidates(eye, V, before), before)

    def _candidates(self, eye: np.ndarray, V: np.ndarray, near: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        reflector = self.scene.reflectors[self.number]
        mesh = (reflector.closed or reflector.mesh).transformed(reflector.pose(self.time))
        return reflection_points(mesh.vertices, mesh.normals, mesh.faces, eye, V, near)


def placed(scene: Scene, time: float, vertices: np.ndarray) -> np.ndarray:
    """Where `vertices`, numbers [N] in the order of `scene.parts`, are in the world, metres [N, 3]."""
    return np.concatenate([p.mesh.transformed(p.pose(time)).vertices for p in scene.parts])[vertices]
