"""Meshes for Newton's method, and walks over them."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from benchharness.kernels.vertices import newton
from benchharness.kernels.vertices.mirrormesh import MirrorMesh
from benchharness.kernels.vertices.sight import look_at
from benchharness.scene import Mesh


def turned_over(mesh: Mesh) -> Mesh:
    return Mesh(mesh.vertices, mesh.faces[:, ::-1], -mesh.normals)


def walked(mirror: MirrorMesh, where, first=None, max_iter=60, touches=False):
    """(solution, sight), evaluated; from the best candidate unless told, as the methods do it."""
    active = dr.full(mi.Bool, True, dr.width(where.V))
    sight = look_at(mirror, where, active)
    if first is None:
        first = dr.select(sight.near, sight.on, newton.best_candidate(mirror, where, active)[0])
        touches = sight.touches
    s = newton.walk(mirror, where, first, active, mi.UInt32(max_iter), touches=touches)
    dr.eval(s, sight)
    return s, sight
