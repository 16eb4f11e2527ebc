"""Coarser meshes that stand for one: fewer triangles, which carry its normals, and its light at their vertices."""

from __future__ import annotations

import numpy as np
import trimesh

from benchharness.kernels.vertices import levels
from benchharness.scene import PER_VERTEX, Mesh

INWARD = 0.02  # of the way to a triangle's middle: there its corners are looked up, so that creases keep their two sides
SAME = 1e-6  # of the largest number of its kind


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
        for name in PER_VERTEX
        if getattr(mesh, name) is not None
    }
    places = table.pop("light_at", None)
    if mesh.light is not None and places is not None:  # of vertices from here on: what lies on several grids lies on none
        own = (places < 0).any(axis=1)[:, None]
        table["radiance"] = np.where(own, table["radiance"], mesh.light.looked_up(places))
    if "visibility" in table:
        table["visibility"] = table["visibility"].clip(0, 1)  # sums of weights round
    if mesh.texture is not None and mesh.uv is not None:
        repeats = np.array([way == "repeat" for way in mesh.texture.along])
        table["uv"] = table["uv"] - repeats * _turns(table["uv"], corners, mesh, mesh.uv)
    rows = np.concatenate([_counted(values) for values in (corners.reshape(-1, 3), *table.values())], axis=1)
    _, first, which = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    normals = table["normals"]
    table["normals"] = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    carried = {name: values[first] for name, values in table.items()}
    return Mesh(corners.reshape(-1, 3)[first], which.reshape(-1, 3), **carried, texture=mesh.texture)


def _turns(uv: np.ndarray, corners: np.ndarray, mesh: Mesh, places: np.ndarray) -> np.ndarray:
    """By how many whole pictures the corners of triangles [F, 3, 3], at `uv` [3 F, 2], are from where the mesh, at `places`
    [V, 2], would have them if it went on from each triangle's middle: not 0 where a triangle lies over the seam of a picture
    that goes around something. Over other seams what a triangle shows is smeared."""
    face, _ = levels.nearest(mesh.vertices, mesh.faces, corners.mean(axis=1))
    face = mesh.faces[np.repeat(face, 3)]
    weights = np.nan_to_num(trimesh.triangles.points_to_barycentric(mesh.vertices[face], corners.reshape(-1, 3)))
    return np.round(uv - np.einsum("nk,nkc->nc", weights, places[face]))


def _counted(values: np.ndarray) -> np.ndarray:
    """In steps of SAME of the largest, so that what is the same but for rounding counts as the same."""
    return np.round(values / max(np.abs(values).max(), 1e-30) / SAME)
