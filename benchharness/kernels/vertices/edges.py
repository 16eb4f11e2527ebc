"""The edges of triangles, on the host: which two edges lie at one place, and are split alike or not at all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mitsuba as mi
import numpy as np

from benchharness.kernels import geometry


@dataclass(frozen=True, eq=False)
class Edges:
    """Edges of a mesh.

    ends     [E, 2] vertices of each, in an order that is the same for all edges at one place
    decides  [E] the edge that decides for all at its place, its own number where it is alone
    sides    [F, 3] of each triangle, the edges from its first corner to its second, on to the third, and back
    """

    ends: np.ndarray
    decides: np.ndarray
    sides: np.ndarray


def edges_of(vertices: np.ndarray, faces: np.ndarray) -> Edges:
    """The edges of a mesh, [V, 3] and [F, 3]. Vertices at one place count as one in what decides, and are two in what is split:
    light and normals may differ between them."""
    place = geometry.welded(vertices)
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2).astype(np.int64)
    turned = place[ends[:, 0]] > place[ends[:, 1]]
    ends[turned] = ends[turned][:, ::-1]
    ends, sides = np.unique(ends, axis=0, return_inverse=True)
    _, first, same = np.unique(place[ends], axis=0, return_index=True, return_inverse=True)
    return Edges(ends, first[same.reshape(-1)], sides.reshape(-1, 3))


@dataclass
class EdgeList:
    """Edges on the device, for `splitting.Front`: packets of two ends, the edge that decides, and a free number; packets of the
    three sides of each triangle and a free number; how many edges there are."""

    edges: mi.UInt32
    sides: mi.UInt32
    count: int


def uploaded(meshes: Sequence[tuple[Edges, int]], faces: int) -> EdgeList:
    """The edges of several meshes, each with the number of its first vertex, for a list of `faces` triangles: those that
    fill it up have no sides."""
    packed, sides, start = [], [np.zeros((0, 4))], 0
    for edges, vertex in meshes:
        packed.append(np.column_stack([edges.ends + vertex, edges.decides + start, 0 * edges.decides]))
        sides.append(np.column_stack([edges.sides + start, 0 * edges.sides[:, 0]]))
        start += len(edges.ends)
    told = np.concatenate(sides)
    spare = np.full((faces - len(told), 4), 0xFFFF_FFFF)
    all_edges = np.concatenate([*packed, np.zeros((1, 4))])  # one that is no edge: its ends are one vertex
    return EdgeList(
        mi.UInt32(all_edges.astype(np.uint32).ravel()),
        mi.UInt32(np.concatenate([told, spare]).astype(np.uint32).ravel()),
        len(all_edges),
    )
