"""Explosion map: which triangle of a bulging mirror sends the eye's ray in a direction (after Ofek and Rappoport 1998).

The eye's rays through the mirror's vertices, reflected, meet a sphere about the mirror's centre; the directions D from the
centre to where they do are laid out in a square,

    (s, t) = (m / 2) (1 + (D.x, D.y) / sqrt(2 (1 + D.z))),

with z towards the eye, so that what becomes singular, D.z = -1, lies in the mirror's shadow. Triangles of the mirror that face
the eye are rasterized there. A vertex V of the scene is looked up by the direction from the centre to V; what the triangle that
is found says between its corners, in the map, is V's reflection point. It is one if V lies on the sphere.

The map is indexed by where on the sphere rays arrive, not by their own directions: those are the same only for a sphere far
away. All positions are in the mirror's own frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels import optics, packets, raster
from benchharness.kernels.frozen import frozen
from benchharness.kernels.placement import unit
from benchharness.kernels.types import View
from benchharness.kernels.vertices.mirrormesh import MirrorMesh, SurfacePoint

DEEPEST = 1e-6  # least of 1 + D.z: in the shadow; what is nearer to the singular direction has no place in the map


@dataclass
class Sphere:
    """The sphere that a map is made with: centre and radius, metres."""

    centre: mi.Point3f
    radius: mi.Float


@dataclass
class ExplosionMap:
    """A mirror's map from one eye.

    triangles  which triangle covers each texel, as `raster.rasterize` has it
    points     packets of the mirror's vertices: where in the map they are, 1, 0
    to_eye     unit vector from the sphere's centre to the eye
    sphere     what it is made with
    view       the camera whose pixels are its texels
    """

    triangles: mi.UInt32
    points: mi.Float
    to_eye: mi.Vector3f
    sphere: Sphere
    view: View


def arrival(sphere: Sphere, P: mi.Point3f, r: mi.Vector3f) -> mi.Vector3f:
    """Unit direction from the centre of the sphere to where the ray from P, inside, along the unit vector r meets it."""
    x = P - sphere.centre
    b = dr.dot(x, r)
    t = -b + dr.safe_sqrt(dr.square(b) - dr.squared_norm(x) + dr.square(sphere.radius))
    return unit(x + t * r)


def laid_out(D: mi.Vector3f, to_eye: mi.Vector3f, size: int) -> tuple[mi.Float, mi.Float]:
    """Where in the map a direction is, in texels."""
    across, down = mi.coordinate_system(to_eye)
    scale = 0.5 * size * dr.rsqrt(2 * dr.maximum(1 + dr.dot(D, to_eye), DEEPEST))
    return 0.5 * size + scale * dr.dot(D, across), 0.5 * size + scale * dr.dot(D, down)


def exploded(
    mesh: MirrorMesh, vertex_count: int, face_count: int, sphere: Sphere, eye: mi.Point3f, texels: View
) -> ExplosionMap:
    """The map of a mirror seen by an eye; `texels` of `view`. Waits for the device once."""
    points, drawn, to_eye = _placed(mesh, vertex_count, face_count, sphere, eye, texels.width)
    triangles = raster.rasterize(points, mesh.faces, face_count, texels, drawn=drawn)
    return ExplosionMap(triangles, points, to_eye, sphere, texels)


@frozen
def _placed(
    mesh: MirrorMesh, vertex_count: int, face_count: int, sphere: Sphere, eye: mi.Point3f, size: int
) -> tuple[mi.Float, mi.Bool, mi.Vector3f]:
    """Packets of where the mirror's vertices are in the map, which triangles have one that faces the eye, and where that is."""
    k = dr.arange(mi.UInt32, vertex_count)
    P, n = (dr.gather(mi.Vector4f, mesh.vertices, 2 * k + i).xyz for i in (0, 1))
    w = unit(eye - P)
    cosine, r = dr.dot(w, n), optics.reflect(w, mi.Normal3f(n))  # beyond the outline, rays go on to turn into the shadow
    to_eye = unit(eye - sphere.centre)
    x, y = laid_out(arrival(sphere, mi.Point3f(P), r), to_eye, size)
    points = packets.stored(mi.Vector4f(x, y, 1, dr.select(cosine > 0, mi.Float(1), 0)), vertex_count)
    face = dr.gather(mi.Vector4u, mesh.faces, dr.arange(mi.UInt32, face_count))
    drawn = mi.Bool(False)
    for i in (face.x, face.y, face.z):
        drawn |= dr.gather(mi.Float, points, 4 * i + 3) > 0
    return points, drawn, mi.Vector3f(to_eye)


def view(size: int) -> View:
    """The camera whose pixels are a map's texels: what is at (s, t, 1) it sees at column s, row t."""
    x, y, w = (mi.Vector4f(*(float(i == k) for i in range(4))) for k in range(3))
    right, down, axis = (mi.Vector3f(*(float(i == k) for i in range(3))) for k in range(3))
    eye, origin, depth, near = mi.Point3f(0), mi.Point3f(0), mi.Float(0), mi.Float(0.5)
    dr.make_opaque(x, y, w, right, down, axis, eye, origin, depth, near)
    return View(eye, x, y, w, right, down, axis, depth, origin, near, size, size)


def looked_up(mesh: MirrorMesh, made: ExplosionMap, V: mi.Point3f, active: mi.Bool) -> tuple[SurfacePoint, mi.Bool]:
    """The mirror's point that the map has for a vertex, and whether it has one."""
    size = made.view.width
    D = unit(V - made.sphere.centre)
    active = active & (1 + dr.dot(D, made.to_eye) > DEEPEST)
    s, t = laid_out(D, made.to_eye, size)
    column, row = (dr.clip(mi.Int32(c), 0, size - 1) for c in (s, t))
    lane = mi.UInt32(row) * size + mi.UInt32(column)
    triangle = raster.winner_at(made.triangles, made.view, lane, active)
    there = active & (triangle != raster.NONE)
    triangle = dr.select(there, triangle, 0)
    _, corner = raster.corners(made.points, mesh.faces, triangle, there)
    a, b, c = (mi.Point3f(q.x, q.y, 1) for q in corner)
    weights = raster.barycentric(a, b, c, mi.Point3f(s, t, 0), mi.Vector3f(0, 0, 1))
    return SurfacePoint(triangle, mi.Point2f(weights.y, weights.z)), there
