"""Which triangles of a mirror may reflect a vertex: cones of half vectors and of normals, from groups to clusters of triangles.

The half vectors of the points of a ball lie in a cone about that of its centre, and the normals between those of corners lie in
any cone that holds these. Where the two cones do not meet, no point of the piece is a reflection point, whatever it looks like.

Positions are in the mirror's own frame (`kernels.placement`).
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels import geometry
from benchharness.kernels.placement import MirrorFrame

CLUSTER, GROUP = 4, 64  # triangles of each, at most
ROUNDING = 1e-5  # of cosines and of unit vectors
ONE_SIDED, TWO_SIDED, ANY = 0, 1, 2  # which way the normals of a piece may point


@dataclass
class Cones:
    """Pieces of a mirror, each with a ball that holds its points and a cone that holds its normals.

    bounds  12 floats per piece: the ball's centre and radius; the cone's axis and cosine; its sine, which way normals may point
            (ONE_SIDED, TWO_SIDED, ANY), and the first and the number of what it is made of
    count   how many
    """

    bounds: mi.Float
    count: int


@dataclass
class Clusters:
    """A mirror's triangles in clusters that lie together, and those in groups.

    order     numbers of triangles, cluster by cluster
    clusters  made of them
    groups    made of clusters
    """

    order: mi.UInt32
    clusters: Cones
    groups: Cones


def clusters(vertices: np.ndarray, normals: np.ndarray, faces: np.ndarray, backs: bool = True) -> Clusters:
    """The clusters of a mesh, given as `mirrormesh.build` takes it. Triangles without area have no points of their own."""
    p = np.asarray(vertices, np.float64)[faces]
    area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
    sided = np.full(len(faces), backs) & ~geometry.oriented_closed_faces(vertices, faces)
    n = np.asarray(normals, np.float64)
    n = n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-30)
    order, rows, group_rows = [], [], []
    for group in _halved(np.flatnonzero(area > 0), p.mean(axis=1), GROUP):
        own = _halved(group, p.mean(axis=1), CLUSTER)
        group_rows.append([*_cone(p[group], n[faces[group]], sided[group]), len(rows), len(own)])
        for few in own:
            rows.append([*_cone(p[few], n[faces[few]], sided[few]), len(order), len(few)])
            order += few.tolist()
    kinds = (Cones(mi.Float(np.array(r or [[0.0] * 12], np.float32).ravel()), len(r)) for r in (rows, group_rows))
    return Clusters(mi.UInt32(np.array(order or [0], np.uint32)), *kinds)


def _cone(p: np.ndarray, n: np.ndarray, sided: np.ndarray) -> list[float]:
    """The first ten of `Cones.bounds` of triangles p, n [K, 3, 3]; `sided`: which are mirrors on both sides."""
    points, n = p.reshape(-1, 3), n.reshape(-1, 3)
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    axis = n.sum(axis=0)
    axis = axis / max(float(np.linalg.norm(axis)), 1e-30)
    cosine = float((n @ axis).min())
    way = ANY if cosine <= 0 else TWO_SIDED if sided.any() else ONE_SIDED
    radius = float(np.linalg.norm(points - centre, axis=1).max())
    return [*centre, radius, *axis, cosine, max(1 - cosine * cosine, 0.0) ** 0.5, way]


def _halved(some: np.ndarray, middles: np.ndarray, most: int) -> list[np.ndarray]:
    """Triangles in pieces of `most` but for the last: cut across the longest side until they are."""
    if len(some) <= most:
        return [some] if len(some) else []
    own = middles[some]
    some = some[np.argsort(own[:, np.ptp(own, axis=0).argmax()], kind="stable")]
    half = most * (-(-len(some) // most) // 2)
    return [*_halved(some[:half], middles, most), *_halved(some[half:], middles, most)]


def reaches(cones: Cones, c: mi.UInt32, local: MirrorFrame) -> tuple[mi.UInt32, mi.UInt32]:
    """Where what piece c is made of begins and ends; it ends where it begins if half vectors and normals cannot agree there."""
    ball, cone, more = (dr.gather(mi.Vector4f, cones.bounds, 3 * c + k) for k in range(3))
    to_E, to_V = local.eye - ball.xyz, local.V - ball.xyz
    d_E, d_V = dr.norm(to_E), dr.norm(to_V)
    within = (d_E <= ball.w) | (d_V <= ball.w)
    per_E, per_V = dr.rcp(dr.maximum(d_E, 1e-20)), dr.rcp(dr.maximum(d_V, 1e-20))
    s = to_E * per_E + to_V * per_V
    # Directions from a ball that is seen within the angle x differ from that from its centre by chords of x.
    away = _chord(ball.w * per_E) + _chord(ball.w * per_V) + ROUNDING
    length = dr.norm(s)
    wide = away >= length
    sine = dr.select(wide, 1, away * dr.rcp(dr.maximum(length, 1e-20)))
    least = cone.w * dr.sqrt(dr.maximum(1 - dr.square(sine), 0)) - more.x * sine
    cosine = dr.dot(s, cone.xyz) * dr.rcp(dr.maximum(length, 1e-20))
    cosine = dr.select(more.y == TWO_SIDED, dr.abs(cosine), cosine)
    first = mi.UInt32(more.z)
    may = within | wide | (more.y == ANY) | (cosine >= least - ROUNDING)
    return first, dr.select(may, first + mi.UInt32(more.w), first)


def _chord(sine: mi.Float) -> mi.Float:
    """2 sin(x / 2) of an angle x of at most 90 degrees."""
    sine = dr.minimum(sine, 1)
    return sine * dr.rsqrt(0.5 + 0.5 * dr.sqrt(1 - dr.square(sine)))
