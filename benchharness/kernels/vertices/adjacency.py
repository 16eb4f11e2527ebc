"""Which triangles of a scene lie beside which, and what hangs together."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from benchharness.kernels import geometry
from benchharness.kernels.types import SceneLike

NONE = 0xFFFF_FFFF  # no triangle, no piece


def neighbours(scene: SceneLike) -> mi.UInt32:
    """Which triangles lie beside those of `geometry.of_scene`, packets of 4: across the edge that is opposite to the first
    corner, to the second, to the third, NONE where none is; and the number of the piece that all that hang together make up.

    Vertices at one place count as one, parts are apart. Of an edge of more than two triangles, each leads to one other.
    """
    rows, start = [], 0
    for part in scene.parts:
        faces = geometry.welded(np.asarray(part.mesh.vertices))[np.asarray(part.mesh.faces)]
        beside = _beside(faces)
        rows.append(np.where(beside < 0, NONE, beside + start))
        start += len(faces)
    beside = np.concatenate(rows)
    face, corner = np.nonzero(beside != NONE)
    graph = coo_array((np.ones(len(face)), (face, beside[face, corner])), shape=(start, start))
    _, piece = connected_components(graph, directed=False)
    return mi.UInt32(np.column_stack([beside, piece]).astype(np.uint32).ravel())


def _beside(faces: np.ndarray) -> np.ndarray:
    """The face across each edge, int64 [F, 3], -1 for none; edge k is opposite to corner k. Faces with two corners in one place
    have no edges."""
    sound = np.flatnonzero((faces != np.roll(faces, 1, axis=1)).all(axis=1))
    beside = np.full((len(faces), 3), -1)
    ends = np.stack([np.roll(faces[sound], -1, axis=1), np.roll(faces[sound], -2, axis=1)], axis=2)
    ends = np.sort(ends.reshape(-1, 2), axis=1)
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    along = ends[order]
    begins = np.ones(len(order), bool)
    begins[1:] = (along[1:] != along[:-1]).any(axis=1)
    first = np.maximum.accumulate(np.where(begins, np.arange(len(order)), 0))
    following = np.arange(1, len(order) + 1)
    last = np.append(begins[1:], True)
    following[last] = first[last]
    met = np.empty(len(order), np.int64)
    met[order] = order[following] // 3
    own = np.repeat(np.arange(len(sound)), 3)
    beside[sound] = np.where(met == own, -1, sound[met]).reshape(-1, 3)
    return beside
