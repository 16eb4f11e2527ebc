"""Vertex normals for faces that came without: smooth where neighbours turn little, with a crease where they turn much.

At every corner of a face stands a vertex of its own. Two corners are one vertex if their faces meet in an edge with an angle
below the crease's; its normal is the mean of its faces', weighted by their angles there (Thürmer and Wüthrich 1998), which
does not depend on how a surface is cut. Vertices count as joined by place, so that a seam in a file is none here.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from benchharness.modelling import winding

CREASE_DEG = 60.0  # an icosahedron (42 degrees) is a coarse ball, a hexagonal prism and a box have edges


def creased(
    vertices: np.ndarray, faces: np.ndarray, crease_deg: float = CREASE_DEG
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices [N, 3], faces [F, 3] and unit normals [N, 3] of the surface [V, 3], [F, 3], its pieces wound consistently."""
    faces = winding.turned(faces, winding.pieces(winding.Surface(vertices, faces)).sign)
    count = len(faces)
    crossed = winding.crossed(vertices, faces)
    unit = crossed / np.maximum(np.linalg.norm(crossed, axis=1, keepdims=True), 1e-300)

    # Edges from one corner of a face to the next; the two faces of one run along it in opposite directions.
    edges = winding.half_edges(winding.welded(vertices, faces))
    f, k, a, b = edges.face, edges.corner, edges.a, edges.b
    one, other = edges.pairs()
    smooth = np.einsum("ei,ei->e", unit[f[one]], unit[f[other]]) > np.cos(np.radians(crease_deg))
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
    normals = np.where(length > 0, normals / np.maximum(length, 1e-300), [0.0, 0.0, 1.0])
    out = np.empty((total, 3))
    out[vertex] = vertices[faces.reshape(-1)]
    return out, vertex.reshape(-1, 3), normals
