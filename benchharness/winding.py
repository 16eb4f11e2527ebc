"""Which side of a mesh is out: pieces, their winding, and the number of times they go around a point. NumPy on arrays.

The generalized winding number of a closed mesh about a point is the sum of the signed solid angles of its triangles
over 4π (Van Oosterom and Strackee 1983, eq. 8; Jacobson et al. 2013): 1 inside of a mesh that is wound outwards, -1 inside
of one that is wound inwards, 0 outside.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np


class Triangles(Protocol):
    """Anything with vertices, float64 [V, 3], and faces, int [F, 3]."""

    @property
    def vertices(self) -> np.ndarray: ...

    @property
    def faces(self) -> np.ndarray: ...


def winding_number(mesh: Triangles, point: np.ndarray) -> float:
    """Of `mesh` about `point`, float64 [3], both in the mesh's space."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces] - point, 1, 0)
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    above = np.einsum("fi,fi->f", a, np.cross(b, c))
    below = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
    return float(np.arctan2(above, below).sum() / (2.0 * np.pi))
