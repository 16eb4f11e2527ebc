"""Levels of detail: a mesh, and ever coarser ones that stand for it, each with how far it is off.

Only shapes are simplified (quadric error, the library `fast-simplification`), not what they carry: a triangle of a level names
the triangle of the mesh that it stands for.
"""

from __future__ import annotations

from dataclasses import dataclass

import fast_simplification
import numpy as np
import trimesh
from scipy.spatial import KDTree

from benchharness import cache
from benchharness.kernels import geometry

FEWEST = 12  # triangles: fewer are not simplified
SHRINKS = 0.75  # a level that has more than this share of the triangles of the one before is left out
HALVINGS = 10
HASTES = (3.0, 7.0)  # of the library: the slow one is nearer to the shape, the quick one goes farther
MANY = 20_000  # triangles: of so many the slow way takes too long
FLAT = 1e-9  # of a mesh's size; shorter edges are none
NEAREST = 16  # triangles, by their middles, of which one is taken to be nearest to a point


@dataclass(frozen=True, eq=False)
class Level:
    """
    vertices  float64 [V, 3]
    faces     int64 [F, 3]
    names     int64 [F], the mesh's triangle that lies nearest to the middle of each
    error     no vertex of the mesh is farther from these triangles
    """

    vertices: np.ndarray
    faces: np.ndarray
    names: np.ndarray
    error: float


def chain(vertices: np.ndarray, faces: np.ndarray) -> list[Level]:
    """The levels of a mesh, float64 [V, 3] and int [F, 3], finest first: the mesh itself, its vertices at one place joined and
    triangles without area left out, then about half the triangles of the level before each. Cached by content."""
    key = cache.content_hash(cache.source_hash(__file__), np.asarray(vertices, np.float64), np.asarray(faces, np.int64))
    arrays = cache.cached("levels", key, lambda: _arrays(_chain(np.asarray(vertices, np.float64), np.asarray(faces))))
    of_vertices, of_faces = (np.cumsum(arrays["counts"][:, k])[:-1] for k in range(2))
    cut = {
        name: np.split(arrays[name], of_vertices if name == "vertices" else of_faces) for name in ("vertices", "faces", "names")
    }
    columns = (cut["vertices"], cut["faces"], cut["names"], arrays["errors"])
    return [Level(v, f, n, float(e)) for v, f, n, e in zip(*columns, strict=True)]


def _arrays(levels: list[Level]) -> cache.Arrays:
    return {
        "counts": np.array([(len(level.vertices), len(level.faces)) for level in levels]),
        "errors": np.array([level.error for level in levels]),
        **{name: np.concatenate([getattr(level, name) for level in levels]) for name in ("vertices", "faces", "names")},
    }


def _chain(vertices: np.ndarray, faces: np.ndarray) -> list[Level]:
    place = geometry.welded(vertices)
    _, first = np.unique(place, return_index=True)
    points, joined = vertices[first], place[faces]
    sound = np.flatnonzero((joined != np.roll(joined, 1, axis=1)).all(axis=1))
    if not len(sound):
        return [Level(points, joined, np.arange(len(faces)), 0.0)]
    whole = Level(points, joined[sound], sound, 0.0)
    made = [
        level
        for haste in (HASTES if len(sound) < MANY else HASTES[1:])
        for border in ((False, True) if _is_open(whole.faces) else (False,))
        for k in range(1, HALVINGS)
        if (level := _simplified(whole, FEWEST + len(sound) // 2**k, haste, border=border)) is not None
    ]
    levels = [whole]
    for level in sorted(made, key=lambda level: (level.error, len(level.faces))):
        if len(level.faces) <= SHRINKS * len(levels[-1].faces):
            levels.append(level)
    return levels


def _is_open(faces: np.ndarray) -> bool:
    """Whether an edge has one triangle."""
    ends = np.sort(np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
    return bool((np.unique(ends, axis=0, return_counts=True)[1] == 1).any())


def _simplified(mesh: Level, count: int, haste: float, *, border: bool) -> Level | None:
    """About `count` triangles in the place of a mesh, None where none are left. `haste`: one of HASTES; `border`: open edges
    stay as they are."""
    scale = float(np.abs(mesh.vertices).max()) or 1.0
    if count >= len(mesh.faces):
        return None
    points, faces, *_ = fast_simplification.simplify(
        mesh.vertices / scale, mesh.faces.astype(np.int32), target_count=count, agg=haste, preserve_border=border
    )
    if not len(faces):
        return None
    used, faces = np.unique(np.asarray(faces, np.int64), return_inverse=True)
    points, faces = scale * np.asarray(points, np.float64)[used], faces.reshape(-1, 3)
    error = float(_nearest(points, faces, mesh.vertices)[2].max())
    at = _nearest(mesh.vertices, mesh.faces, points[faces].mean(axis=1))[0]
    return Level(points, faces, mesh.names[at], error)


def nearest(vertices: np.ndarray, faces: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The triangle of a mesh nearest to each point [N, 3], and the weights [N, 3] of its corners at the place nearest to it."""
    face, place, _ = _nearest(vertices, faces, points)
    weights = np.clip(np.nan_to_num(trimesh.triangles.points_to_barycentric(vertices[faces[face]], place)), 0, None)
    weights[weights.sum(axis=1) == 0] = 1.0  # a triangle without area
    return face, weights / weights.sum(axis=1, keepdims=True)


def _nearest(vertices: np.ndarray, faces: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The triangle nearest to each point [N, 3], of the NEAREST whose middles are; where on it, and how far away that is."""
    size = _shortest_edge(vertices, faces)  # trimesh takes what is tiny in metres for nothing
    corners, points, count = vertices[faces] / size, points / size, min(NEAREST, len(faces))
    near = KDTree(corners.mean(axis=1)).query(points, count, workers=-1)[1].reshape(len(points), count)
    best, place, distance = np.zeros(len(points), np.int64), np.zeros((len(points), 3)), np.full(len(points), np.inf)
    for k in range(count):
        there = trimesh.triangles.closest_point(corners[near[:, k]], points)
        apart = np.linalg.norm(there - points, axis=1)
        nearer = apart < distance
        best, distance = np.where(nearer, near[:, k], best), np.where(nearer, apart, distance)
        place = np.where(nearer[:, None], there, place)
    return best, size * place, size * distance


def _shortest_edge(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Of a mesh, and at least FLAT of its size."""
    lengths = np.concatenate([np.linalg.norm(vertices[faces[:, k]] - vertices[faces[:, k - 1]], axis=1) for k in range(3)])
    return max(float(lengths.min()), FLAT * float(np.ptp(vertices, axis=0).max()), np.finfo(float).tiny)
