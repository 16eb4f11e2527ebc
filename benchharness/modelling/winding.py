"""Which side of a mesh is out: pieces, their winding, and the number of times they go around a point. NumPy on arrays.

A piece is faces that are joined over edges of two faces each, vertices at one place counting as one. Its faces are wound
consistently if the two faces of every such edge run along it in opposite directions. Whether that can be had by turning some
of them is asked of the double cover: every face is there twice, as it is and turned, and is joined to that one of its
neighbour's two that it agrees with. Over a surface with two sides the cover falls into two sheets, each a consistent
winding; over a Möbius strip it is one.

The generalized winding number of a closed mesh about a point is the sum of the signed solid angles of its triangles
over 4π (Van Oosterom and Strackee 1983, eq. 8; Jacobson et al. 2013): 1 inside of a mesh that is wound outwards, -1 inside
of one that is wound inwards, 0 outside.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

SAME = 1e-6  # of a mesh's size: vertices that round to the same multiple of this are at one place


class Triangles(Protocol):
    """Anything with vertices, float64 [V, 3], and faces, int [F, 3]."""

    @property
    def vertices(self) -> np.ndarray: ...

    @property
    def faces(self) -> np.ndarray: ...


@dataclass(frozen=True, eq=False)
class Surface:
    """Nothing but triangles."""

    vertices: np.ndarray
    faces: np.ndarray


@dataclass(frozen=True, eq=False)
class Pieces:
    """A mesh's faces, sorted into pieces.

    piece     int [F], which one each face belongs to
    sign      int [F]: faces of one piece are wound consistently if those with -1 are turned; most of its area stays
    closed    bool [P]: every edge of the piece has exactly two of its faces
    two_sided bool [P]: it can be wound consistently
    """

    piece: np.ndarray
    sign: np.ndarray
    closed: np.ndarray
    two_sided: np.ndarray


@dataclass(frozen=True, eq=False)
class HalfEdges:
    """The edges of faces, three of each that has area, from one corner to the next.

    face, corner  int [E], whose edge it is, and from which of its corners
    a, b          int [E], where it begins and ends
    key           int [E], the same for all that run along one edge, in whatever direction
    """

    face: np.ndarray
    corner: np.ndarray
    a: np.ndarray
    b: np.ndarray
    key: np.ndarray

    def pairs(self) -> tuple[np.ndarray, np.ndarray]:
        """The two of every edge that has exactly two, int [P] each."""
        order = np.argsort(self.key, kind="stable")
        first = np.flatnonzero(np.diff(self.key[order], prepend=-1))
        two = first[np.diff(first, append=len(order)) == 2]
        return order[two], order[two + 1]

    @property
    def paired(self) -> np.ndarray:
        """Which of them run along an edge of exactly two faces, bool [E]."""
        _, which, uses = np.unique(self.key, return_inverse=True, return_counts=True)
        return uses[which.reshape(-1)] == 2


def half_edges(faces: np.ndarray) -> HalfEdges:
    """The edges of faces [F, 3]; none of a face that has a corner twice. Vertices are joined by number: see `welded`."""
    real = np.flatnonzero((faces != np.roll(faces, 1, axis=1)).all(axis=1))
    face, corner = np.repeat(real, 3), np.tile(np.arange(3), len(real))
    a, b = faces[face, corner].astype(np.int64), faces[face, (corner + 1) % 3].astype(np.int64)
    return HalfEdges(face, corner, a, b, np.minimum(a, b) * (int(faces.max(initial=0)) + 1) + np.maximum(a, b))


def is_closed(mesh: Triangles) -> bool:
    """Whether every edge of the mesh has exactly two faces, vertices at one place counting as one."""
    edges = half_edges(welded(mesh.vertices, mesh.faces))
    return len(edges.key) > 0 and bool(edges.paired.all())


def closed_faces(mesh: Triangles) -> np.ndarray:
    """Per face whether all that it hangs together with, over vertices, is closed as in `is_closed`, bool [F].

    Two boxes that share an edge are not, since four faces meet there. In `pieces`, which hang together over edges of two
    faces alone, each of them is closed.
    """
    faces = welded(mesh.vertices, mesh.faces)
    edges, count = half_edges(faces), int(faces.max()) + 1
    graph = coo_array((np.ones(len(edges.a)), (edges.a, edges.b)), shape=(count, count))
    _, body = connected_components(graph, directed=False)
    torn = np.zeros(count, bool)
    torn[body[edges.a[~edges.paired]]] = True
    return ~torn[body[faces[:, 0]]]


def pieces(mesh: Triangles) -> Pieces:
    """The pieces of a mesh. A face without area that has two corners at one place is a piece of its own, and not closed."""
    count = len(mesh.faces)
    edges = half_edges(welded(mesh.vertices, mesh.faces))
    owner = edges.face
    one, two = edges.pairs()
    f, g, agree = owner[one], owner[two], edges.a[one] != edges.a[two]

    # The double cover: face f as it is is node f, turned it is node count + f.
    other = np.where(agree, g, g + count)
    opposite = np.where(agree, g + count, g)
    joined = np.stack([np.concatenate([f, f + count]), np.concatenate([other, opposite])])
    cover = connected_components(coo_array((np.ones(joined.shape[1]), joined), shape=(2 * count, 2 * count)), directed=False)[1]
    kept, turned = cover[:count], cover[count:]
    label = np.minimum(kept, turned)
    _, piece = np.unique(label, return_inverse=True)
    piece = piece.reshape(-1)
    total = int(piece.max()) + 1
    two_sided = np.ones(total, bool)
    two_sided[piece[kept == turned]] = False
    sign = np.where((kept == label) | ~two_sided[piece], 1, -1)
    area = np.linalg.norm(crossed(mesh.vertices, mesh.faces), axis=1)
    sign *= np.where(np.bincount(piece, area * sign, total) < 0, -1, 1)[piece]

    closed = np.zeros(total, bool)
    closed[piece[owner]] = True
    _, which, times = np.unique(np.stack([piece[owner], edges.key]), axis=1, return_inverse=True, return_counts=True)
    closed[piece[owner[times[which.reshape(-1)] != 2]]] = False
    return Pieces(piece, sign, closed, two_sided)


def crossed(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Normals of faces, as long as twice their area, float64 [F, 3]."""
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    return np.cross(b - a, c - a)


def volumes(mesh: Triangles) -> np.ndarray:
    """Signed volumes of the tetrahedra between faces and the middle of all vertices, [F]: over a closed surface they add
    up to what it encloses, positive where it faces outwards."""
    corners = mesh.vertices[mesh.faces] - mesh.vertices.mean(axis=0)
    return np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6


def turned(faces: np.ndarray, sign: np.ndarray) -> np.ndarray:
    """The faces [F, 3], those with sign -1 wound the other way."""
    return np.where((sign < 0)[:, None], faces[:, ::-1], faces)


def winding_number(mesh: Triangles, point: np.ndarray) -> float:
    """The generalized winding number of `mesh` about `point`, float64 [3], both in the mesh's space."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces] - point, 1, 0)
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    above = np.einsum("fi,fi->f", a, np.cross(b, c))
    below = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
    return float(np.arctan2(above, below).sum() / (2.0 * np.pi))


def welded(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """The faces, int [F, 3], with one number for all vertices at one place."""
    centred = vertices - vertices.mean(axis=0)
    size = max(float(np.ptp(centred, axis=0).max()), 1e-300)
    place = np.unique(np.round(centred / (SAME * size)).astype(np.int64), axis=0, return_inverse=True)[1]
    return place.reshape(-1)[faces]
