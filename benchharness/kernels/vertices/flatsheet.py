"""Flat sheets as mirrors: images in their planes, of what no point of the sheet reflects, too.

A search for a reflection point ends where the mirror does. Before a flat sheet, that of a vertex may lie beyond its edge: then
the sheet does not show the vertex, but triangles reach from there across it, and what they show depends on where their corners
are drawn. Drawn by the end of its search, at the edge, such a corner would bend them. It is mirrored in the plane, as if the
sheet went on. Edges end where they meet the plane, whether or not the sheet is there: in their own images. So nothing has to be
found near the outline, and triangles of any size are right in all pixels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels import depths, optics, planes
from benchharness.kernels.types import MeshLike, View


def planes_of(meshes: Sequence[MeshLike]) -> tuple[planes.Plane | None, ...]:
    """The planes of meshes, object space; None of what is not flat."""
    return tuple(planes.uploaded([fit])[0] if (fit := planes.fitted(mesh)).flat else None for mesh in meshes)


@dataclass
class Mirrored:
    """Vertices in a plane, one lane each.

    before  V is before it, on the eye's side
    image   V mirrored in it
    R, n    where the eye sees that, in the plane, and the plane's unit normal on the eye's side; of what is before it
    """

    before: mi.Bool
    image: mi.Point3f
    R: mi.Point3f
    n: mi.Normal3f


def mirrored(plane: planes.Plane, V: mi.Point3f, eye: mi.Point3f) -> Mirrored:
    n, of_eye = _towards(plane, eye)
    height = dr.dot(n, V - plane.point)
    image = optics.mirrored(V, plane.point, mi.Normal3f(n))
    share = of_eye * dr.rcp(dr.maximum(of_eye + height, 1e-20))
    return Mirrored(height > 0, image, eye + share * (image - eye), mi.Normal3f(n))


def _towards(plane: planes.Plane, eye: mi.Point3f) -> tuple[mi.Vector3f, mi.Float]:
    """The normal on the eye's side, and how far the eye is from the plane."""
    of_eye = dr.dot(plane.normal, eye - plane.point)
    return dr.select(of_eye < 0, -plane.normal, plane.normal), dr.abs(of_eye)


@dataclass
class Behind:
    """A plane in world space, asked whether a point is behind it, where no mirror in it shows anything."""

    plane: planes.Plane

    def hides(self, x: mi.Point3f, view: View, active: mi.Bool) -> tuple[mi.Bool, mi.Float]:
        """Whether x is, and its own depth, from `view.depth`: what enters there goes into the mirror."""
        n, _ = _towards(self.plane, view.eye)
        return active & (dr.dot(n, x - self.plane.point) <= 0), depths.offset(view, x)

    def share(self, a: mi.Vector4f, b: mi.Vector4f) -> mi.Float:
        """At which share of the edge from a to b it meets the plane."""
        of_a, of_b = (dr.dot(self.plane.normal, mi.Point3f(q.xyz) - self.plane.point) for q in (a, b))
        return dr.clip(of_a * dr.rcp(dr.select(of_a == of_b, 1, of_a - of_b)), 0, 1)
