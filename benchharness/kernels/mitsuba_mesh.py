"""Triangles as Mitsuba takes them: a mesh, and a scene of nothing but one.

Numbers are handed over here and none is computed, so that references may share it with what they judge.
"""

# pyright: reportArgumentType=false
# The stubs of Mitsuba know no NumPy arguments.

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np


def mesh(
    name: str,
    vertices: np.ndarray,
    faces: np.ndarray,
    normals: np.ndarray | None = None,
    uv: np.ndarray | None = None,
    **parts: Any,
) -> mi.Mesh:
    """A mesh of vertices [V, 3] and faces [F, 3]; flat without normals [V, 3]; texture coordinates [V, 2] where they matter.
    `parts`: its BSDF, emitter and flags."""
    properties = mi.Properties()
    for key, value in parts.items():
        properties[key] = value
    has = {"has_vertex_normals": normals is not None, "has_vertex_texcoords": uv is not None}
    made = mi.Mesh(name, len(vertices), len(faces), props=properties, **has)
    buffers = mi.traverse(made)
    buffers["vertex_positions"] = mi.Float(np.asarray(vertices, np.float32).ravel())
    buffers["faces"] = mi.UInt32(np.asarray(faces, np.uint32).ravel())
    if normals is not None:
        buffers["vertex_normals"] = mi.Float(np.asarray(normals, np.float32).ravel())
    if uv is not None:
        buffers["vertex_texcoords"] = mi.Float(np.asarray(uv, np.float32).ravel())
    buffers.update()
    return made


def scene(vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray | None = None, *, robust: bool = True) -> mi.Scene:
    """A scene of one mesh by the name of "surface". `robust`: no ray slips through the edge between two triangles."""
    surface = mesh("surface", vertices, faces, normals)
    return mi.load_dict({"type": "scene", "embree_use_robust_intersections": robust, "surface": surface})
