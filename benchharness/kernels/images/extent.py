"""How large a part is seen in a mirror, and how large a picture of it therefore has to be. NumPy, on the host.

Light that leaves the eye within a small angle is spread over

    S = D + d + 2 K d D,    K = curvature cos(angle of incidence)

metres per radian when it has gone D to a mirror and then d to a part; a flat mirror spreads nothing by itself, a convex one
the more the more it is curved. So a metre of the part is focal / S pixels wide, with focal in pixels per radian. Across the
plane of incidence the mirror spreads the least, as its curvature times the cosine says. What goes by a second mirror has come
as far as S is at that mirror, and its light spreads faster yet.

An upper estimate wants the least S: the least D and d between spheres around the parts, the least curvature that a mirror has
anywhere, 0 where it is flat or hollow. But what touches a curved mirror is not near it as a whole: for the curved part of S,
d is at least the part's radius, and its image no wider than that of a ball at that distance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchharness.kernels.eye import Eye
from benchharness.kernels.images import impostor
from benchharness.kernels.images.roles import Plan
from benchharness.kernels.types import MeshLike

LEAST = 8  # texels across a picture
NEARNESS = 1.0  # of a part's radius: most of it is farther than that from a mirror that it touches
QUANTILE = 0.02  # of a mesh's edges: fewer may be flatter than the least curvature says


def least_curvature(mesh: MeshLike) -> float:
    """The least that a mesh is curved outwards along all edges but few, 1 / metre; 0 if it is flat or hollow somewhere."""
    edges = np.concatenate([mesh.faces[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
    ends = np.unique(np.sort(edges, axis=1), axis=0)
    dp, dn = (np.diff(values[ends], axis=1)[:, 0] for values in (np.asarray(mesh.vertices), np.asarray(mesh.normals)))
    length2 = (dp**2).sum(axis=1)
    long = length2 > 1e-12 * length2.max()
    curvature = (dp * dn).sum(axis=1)[long] / length2[long]
    return max(float(np.quantile(curvature, QUANTILE)), 0.0)


@dataclass(frozen=True)
class Spheres:
    """Spheres around all parts where they are, float64: middles [parts, 3], radii [parts]."""

    middles: np.ndarray
    radii: np.ndarray


def pixels(plan: Plan, curvatures: np.ndarray, spheres: Spheres, eye: Eye, *, again: bool) -> np.ndarray:
    """How wide the part of each slot can be in its mirror, pixels [slots]; 0 where nobody looks. Slots of planes count as 0.

    curvatures  the least of each mirror, 1 / metre [mirrors]
    again       mirrors reflect in mirrors
    """
    count = plan.objects
    middles, radii = spheres.middles[count:], spheres.radii[count:]
    away = middles - eye.place
    length = np.linalg.norm(away, axis=1)
    direct = np.where(eye.visible, np.maximum(length - radii, 0.0), np.inf)
    apart = np.linalg.norm(spheres.middles[None] - middles[:, None], axis=2) - spheres.radii[None] - radii[:, None]
    apart = np.maximum(apart, 0.0)
    deep = np.maximum(apart, NEARNESS * spheres.radii[None])
    bent = curvatures[:, None] * _cosines(middles, spheres.middles, eye.place)

    def spread(D: np.ndarray) -> np.ndarray:
        """S from each mirror [mirrors] to each part: [mirrors, parts]."""
        with np.errstate(invalid="ignore"):
            return np.where(np.isfinite(D)[:, None], D[:, None] + apart + 2 * bent * deep * D[:, None], np.inf)

    S = spread(direct)
    if again and len(middles) > 1:
        by_way = S[:, count:].copy()
        np.fill_diagonal(by_way, np.inf)
        S[:, :count] = np.minimum(S, spread(by_way.min(axis=0)))[:, :count]
    own = np.maximum(plan.owners - count, 0)
    width = 2 * spheres.radii[plan.parts] / np.cos(0.5 * impostor.FIELD)
    aside = np.clip((away @ eye.forward) / np.maximum(length, 1e-300), 0.5, 1.0)
    focal = eye.focal / aside[own] ** 2
    return np.where(plan.owners < 0, 0.0, width * focal / np.maximum(S[own, plan.parts], 1e-300))


def _cosines(mirrors: np.ndarray, parts: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """Of the angles of incidence at the middle of each mirror [M, 3], between the eye and each part [N, 3]: [M, N]."""
    to_eye, to_part = eye - mirrors, parts[None] - mirrors[:, None]
    to_eye = to_eye / np.maximum(np.linalg.norm(to_eye, axis=1, keepdims=True), 1e-300)
    to_part = to_part / np.maximum(np.linalg.norm(to_part, axis=2, keepdims=True), 1e-300)
    return np.sqrt(np.clip(0.5 * (1 + np.einsum("mi,mni->mn", to_eye, to_part)), 0, 1))


def sizes(wide: np.ndarray, before: np.ndarray, most: int, density: float) -> np.ndarray:
    """Texels across pictures of parts that are so many pixels wide, int [N]: powers of two, from LEAST to `most`; 0 for less
    than a pixel.

    before   their sizes so far, 0 for none: they grow at once, and shrink only when twice as many pixels would ask for less
    density  texels per pixel
    """

    def asked(wide: np.ndarray) -> np.ndarray:
        """The size for this estimate alone."""
        power = np.exp2(np.ceil(np.log2(np.maximum(density * wide, LEAST)))).astype(int)
        return np.where(wide < 1, 0, np.minimum(power, most))

    now = asked(wide)
    return np.where((now < before) & (asked(2 * wide) >= before), before, now)
