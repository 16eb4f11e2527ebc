"""Coarser meshes that stand for one: fewer triangles, which carry the light and the normals of what they stand for."""

from __future__ import annotations

import numpy as np

from benchharness.kernels.vertices import levels
from benchharness.scene import Mesh

INWARD = 0.02  # of the way to a triangle's middle: there its corners are looked up, so that creases keep their two sides
SAME = 1e-6  # of the largest number of its kind
CARRIED = "normals albedo emission radiance visibility".split()


def coarser(mesh: Mesh, share: float) -> Mesh | None:
    """The finest level of a mesh with at most this share of its triangles; None where there is none."""
    few = [level for level in levels.chain(mesh.vertices, mesh.faces) if len(level.faces) <= share * len(mesh.faces)]
    return _carrying(few[0], mesh) if few else None


def _carrying(level: levels.Level, mesh: Mesh) -> Mesh:
    """A level as a mesh, whose corners carry what the mesh has nearest to them on their side of a crease."""
    corners = level.vertices[level.faces]
    asked = (corners + INWARD * (corners.mean(axis=1, keepdims=True) - corners)).reshape(-1, 3)
    face, weights = levels.nearest(mesh.vertices, mesh.faces, asked)
    table = {
        name: np.einsum("nk,nkc->nc", weights, getattr(mesh, name)[mesh.faces[face]])
        for name in CARRIED
        if getattr(mesh, name) is not None
    }
    if "visibility" in table:
        table["visibility"] = table["visibility"].clip(0, 1)  # sums of weights round
    rows = np.concatenate([_counted(values) for values in (corners.reshape(-1, 3), *table.values())], axis=1)
    _, first, which = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    normals = table["normals"]
    table["normals"] = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    carried = {name: values[first] for name, values in table.items()}
    return Mesh(corners.reshape(-1, 3)[first], which.reshape(-1, 3), **carried)


def _counted(values: np.ndarray) -> np.ndarray:
    """In steps of SAME of the largest, so that what is the same but for rounding counts as the same."""
    return np.round(values / max(np.abs(values).max(), 1e-30) / SAME)
