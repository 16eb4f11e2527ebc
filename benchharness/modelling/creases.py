"""Vertex normals for faces that came without: smooth where neighbours turn little, with a crease where they turn much.

At every corner of a face stands a vertex of its own. Two corners are one vertex if their faces meet in an edge with an angle
below the crease's; its normal is the mean of its faces', weighted by their angles there (Thürmer and Wüthrich 1998), which
does not depend on how a surface is cut. Vertices count as joined by place, so that a seam in a file is none here. Smoothing
groups, where a file has them, decide in place of the angle: faces of one group are smooth, others have an edge.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from benchharness.modelling import winding

CREASE_DEG = 60.0  # an icosahedron (42 degrees) is a coarse ball, a hexagonal prism and a box have edges
TIE_DEG = 0.1  # what turns by this much less is a crease, too: rounding may not decide about a hexagonal prism
BY_ANGLE = -1  # in place of a smoothing group
FLAT = 0  # the smoothing group of faces that are smooth with none


def creased(
    vertices: np.ndarray, faces: np.ndarray, crease_deg: float = CREASE_DEG
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices [N, 3], faces [F, 3] and unit normals [N, 3] of the surface [V, 3], [F, 3], its pieces wound consistently."""
    faces = winding.turned(faces, winding.pieces(winding.Surface(vertices, faces)).sign)
    vertex, normals = smoothed(vertices, faces, crease_deg)
    out = np.empty_like(normals)
    out[vertex.reshape(-1)] = vertices[faces.reshape(-1)]
    return out, vertex, normals


def smoothed(
    vertices: np.ndarray, faces: np.ndarray, crease_deg: float = CREASE_DEG, groups: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Which normal every corner has, int [F, 3], and these, unit, float64 [N, 3], of faces that are wound consistently.

    groups  int [F], smoothing groups of the faces, with BY_ANGLE and FLAT; None: by the angle everywhere
    """
    count = len(faces)
    crossed = winding.crossed(vertices, faces)
    unit = crossed / np.maximum(np.linalg.norm(crossed, axis=1, keepdims=True), 1e-300)

    # Edges from one corner of a face to the next; the two faces of one run along it in opposite directions.
    edges = winding.half_edges(winding.welded(vertices, faces))
    f, k, a, b = edges.face, edges.corner, edges.a, edges.b
    one, other = edges.pairs()
    smooth = np.einsum("ei,ei->e", unit[f[one]], unit[f[other]]) > np.cos(np.radians(crease_deg - TIE_DEG))
    if groups is not None:
        group = groups[f[one]]
        smooth = (group == groups[f[other]]) & (group != FLAT) & (smooth | (group != BY_ANGLE))
    smooth &= (a[one] == b[other]) & (b[one] == a[other])
    one, other = one[smooth], other[smooth]
    corner, following = 3 * f + k, 3 * f + (k + 1) % 3
    pairs = np.concatenate([[corner[one], following[other]], [following[one], corner[other]]], axis=1)
    joined = coo_array((np.ones(pairs.shape[1]), pairs), shape=(3 * count, 3 * count))
    total, vertex = connected_components(joined, directed=False)

    normals = np.zeros((total, 3))
    corners = vertices[faces]
    ahead, back = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    angle = np.arctan2(np.linalg.norm(np.cross(ahead, back), axis=2), np.einsum("fki,fki->fk", ahead, back))
    np.add.at(normals, vertex, angle.reshape(-1, 1) * np.repeat(unit, 3, axis=0))
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return vertex.reshape(-1, 3), np.where(length > 0, normals / np.maximum(length, 1e-300), [0.0, 0.0, 1.0])
