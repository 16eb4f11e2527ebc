"""Star-shaped mirrors, ready to be searched by direction from their centres: a map of each (`starmap`), and its mesh to ask."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from benchharness.kernels.types import MeshLike, ReflectorLike
from benchharness.kernels.vertices import mirrormesh, starmap
from benchharness.kernels.vertices.mirrormesh import MirrorMesh


@dataclass
class StarMirror:
    """One reflector.

    star   it as a function of direction
    mesh   it as a mesh
    sheet  what is seen of it, as a mesh; None if it is convex
    """

    star: starmap.StarMap
    mesh: MirrorMesh
    sheet: MirrorMesh | None

    @property
    def seen(self) -> MirrorMesh:
        """What is seen of it, as a mesh."""
        return self.mesh if self.sheet is None else self.sheet


@dataclass
class Ends:
    """Where the searches of a frame ended, per vertex: direction (3 floats), and whether it is worth starting from."""

    u: mi.Float
    warm: mi.Bool

    @staticmethod
    def cold(count: int) -> Ends:
        return Ends(dr.zeros(mi.Float, 3 * count), dr.zeros(mi.Bool, count))


def of_reflector(reflector: ReflectorLike, resolution: int) -> tuple[StarMirror, MeshLike]:
    """A reflector with `resolution` texels per edge of a face of its map, and the mesh that is searched: its closed stand-in if
    that is star-shaped, else the sheet. Raises `starmap.NotStarShapedError`."""
    star, mesh = _star(reflector, resolution, starmap.build)
    walked = mirrormesh.build(mesh.vertices, mesh.normals, mesh.faces, backs=reflector.closed is None)
    sheet = None
    if not walked.convex:
        seen = reflector.mesh
        sheet = walked
        if mesh is not seen:
            sheet = mirrormesh.build(seen.vertices, seen.normals, seen.faces, backs=reflector.closed is None)
    return StarMirror(star, walked, sheet), mesh


def refusal(reflectors: Sequence[Any], resolution: int, *, outside: bool = False) -> str | None:
    """A sentence about the first of named reflectors that is not star-shaped, or not seen from `outside` if that is asked; None
    if all are."""
    for reflector in reflectors:
        try:
            side, _ = _star(reflector, resolution, starmap.check)
        except starmap.NotStarShapedError as error:
            return f"reflector {reflector.name}: {error}"
        if outside and side < 0:
            return (
                f"reflector {reflector.name}: it is a mirror on the side of its centre; accepted: one that is seen from outside"
            )
    return None


def _star(reflector: ReflectorLike, resolution: int, make: Callable) -> tuple[Any, MeshLike]:
    """What `make` makes of the mesh of a reflector that is star-shaped, and that mesh."""
    meshes = [mesh for mesh in (reflector.closed, reflector.mesh) if mesh is not None]
    for mesh in meshes[:-1]:
        try:
            return make(mesh.vertices, mesh.normals, mesh.faces, resolution), mesh
        except starmap.NotStarShapedError:
            pass
    mesh = meshes[-1]
    return make(mesh.vertices, mesh.normals, mesh.faces, resolution), mesh
