"""What a mirror can show of a thing, and how large: bounds from patches of its surface, on the host.

A patch is some triangles with the ball that holds them, a cone that holds their normals, and the curvatures along their
edges. One step of length s on a mirror of curvature kappa, at distance D from the eye, turns the reflected ray by
s (2 kappa + 1 / D). What lies d behind moves by s + d s (2 kappa + 1 / D), and s is seen focal s / D pixels long. So one unit
of length there is seen at most

    focal / (D + d + 2 kappa d D)

pixels long: as in a flat mirror for kappa = 0, and without a bound where the mirror may focus. (It is the paraxial bound.
Towards the outline images are smaller across it, and along it larger, up to a flat mirror's.) An edge seen c pixels long spans
c D / focal of the mirror, whose normal turns by kappa times that; it is off a straight line by its sagitta, a quarter of c
times that turn at most (`bent`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from benchharness.kernels.types import MeshLike
from benchharness.kernels.vertices import mirrormesh

PATCHES = 8  # of a mirror
BALLS = 4  # that hold a part
EXTREME = 0.1  # share of a patch's edges that may be less curved than is told, or more: rounding and creases
UNBOUNDED = 0.25  # of a flat mirror's distance: a mirror that brings things nearer than this may focus them


@dataclass(frozen=True, eq=False)
class Patches:
    """Of one mirror, in its own space: balls [N, 3] and [N], how far out of the plane through a ball's centre its patch reaches
    along any of its normals [N], axes of the cones [N, 3], their half angles [N] in radians, least and greatest curvatures [N]
    in 1 / length; and the mirror's size."""

    centre: np.ndarray
    radius: np.ndarray
    height: np.ndarray
    axis: np.ndarray
    cone: np.ndarray
    flattest: np.ndarray
    sharpest: np.ndarray
    size: float


def of_mesh(mesh: MeshLike) -> Patches:
    """The patches of a mirror's mesh."""
    vertices, normals, faces = mesh.vertices, mesh.normals, np.asarray(mesh.faces)
    owner = _clusters(vertices, faces, PATCHES)
    rows = [_patch(vertices, normals, faces[owner == k]) for k in np.unique(owner)]
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    return Patches(*(np.array(column) for column in zip(*rows, strict=True)), size)


def balls_of(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Balls that hold a mesh together: [N, 4], centre and radius."""
    owner = _clusters(vertices, faces, BALLS)
    return np.array([[*centre, radius] for k in np.unique(owner) for centre, radius in [_ball(vertices[faces[owner == k]])]])


def _clusters(vertices: np.ndarray, faces: np.ndarray, count: int) -> np.ndarray:
    """Which of `count` clusters each triangle is in, at most."""
    middles = vertices[faces].mean(axis=1)
    return KDTree(middles[mirrormesh.spread(vertices, faces, count)]).query(middles)[1]


def _ball(points: np.ndarray) -> tuple[np.ndarray, float]:
    points = points.reshape(-1, 3)
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return centre, float(np.linalg.norm(points - centre, axis=1).max())


def _patch(vertices: np.ndarray, normals: np.ndarray, faces: np.ndarray) -> tuple:
    n = normals[faces].reshape(-1, 3)
    axis = n.sum(axis=0)
    axis = axis / max(float(np.linalg.norm(axis)), 1e-30)
    cone = float(np.arccos(np.clip(n @ axis, -1, 1)).max())
    ends = np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)])
    along, turn = (a[ends[:, 1]] - a[ends[:, 0]] for a in (vertices, normals))
    bent = (along * turn).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-30)
    centre, radius = _ball(vertices[faces])
    height = np.abs((vertices[faces] - centre) @ axis).max() + radius * np.sin(min(cone, 0.5 * np.pi))
    return centre, radius, min(float(height), radius), axis, cone, *np.quantile(bent, (EXTREME, 1 - EXTREME))


@dataclass(frozen=True, eq=False)
class Sight:
    """How a mirror shows balls, per patch and ball.

    scale    pixels that a unit of length is seen long at most, 1e30 where there is no bound; 0 where it cannot be seen
    sagitta  per patch, what the square of a length in pixels is multiplied by for the sagitta of its image
    longest  pixels that the mirror is seen long at most
    """

    scale: np.ndarray
    sagitta: np.ndarray
    longest: float

    def error(self, ball: np.ndarray, off: np.ndarray, edge: np.ndarray) -> np.ndarray:
        """How many pixels large it is seen, float [N], what is `off` by a length and has edges so long, in a ball; [N] each."""
        scale = self.scale[:, ball]
        seen = np.minimum(edge * scale, self.longest)
        seen *= seen
        seen *= self.sagitta[:, None]
        scale *= off
        return (seen + scale).max(axis=0)


def looked_at(patches: Patches, pose: np.ndarray, eye: np.ndarray, focal: float, balls: np.ndarray) -> Sight:
    """How a mirror with rigid pose [3, 4] shows balls [M, 4] of the world. `focal`: of the camera, pixels."""
    turn, centres, radii = pose[:, :3], balls[:, :3], balls[:, 3]
    P, axis = patches.centre @ turn.T + pose[:, 3], patches.axis @ turn.T
    to_eye = eye - P
    away = np.linalg.norm(to_eye, axis=1)
    D = np.maximum(away - patches.radius, 1e-12)
    seen = _may_face(axis, to_eye, patches.cone, patches.height)
    to_ball = centres[None] - P[:, None]
    between, reach = np.linalg.norm(to_ball, axis=2), radii[None] + patches.radius[:, None]
    d = np.maximum(between - reach, 0)
    shown = seen[:, None] & _may_face(axis[:, None], to_ball, patches.cone[:, None], radii[None] + patches.height[:, None])
    flat, flattest = D[:, None] + d, patches.flattest[:, None]
    farthest = (between + reach) * (away + patches.radius)[:, None]
    near = flat + 2 * np.where(flattest < 0, flattest * farthest, flattest * d * D[:, None])
    scale = np.where(near > UNBOUNDED * flat, focal / np.where(near > 0, near, 1), 1e30)
    sagitta = 0.25 * np.maximum(np.abs(patches.flattest), np.abs(patches.sharpest)) * D / focal
    return Sight(np.where(shown, scale, 0), sagitta, focal * patches.size / float(D.min()))


def _may_face(axis: np.ndarray, towards: np.ndarray, cone: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Whether a point within `radius` of `towards` may be in front of a surface with a normal in the cone."""
    length = np.linalg.norm(towards, axis=-1)
    cosine = (axis * towards).sum(axis=-1) / np.maximum(length, 1e-30)
    angle = np.arccos(np.clip(cosine, -1, 1)) - cone
    return (length <= radius) | (length * np.cos(np.maximum(angle, 0)) > -radius)
