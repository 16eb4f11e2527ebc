"""Flat mirrors: the plane through a mirror's triangles, the camera that it shows, and ways to cut away what lies behind it.

A flat mirror shows what the camera sees that is mirrored in its plane, pixel by pixel: the row of a point X is that of its
image M X, with M X = X - 2 (n·X - d) n. M turns left to right, so that triangles are wound the other way in such a camera. Its
eye is behind the mirror, and whatever lies between must not be drawn. Ways to cut:

    "discard"       every fragment that is nearer than the plane on its pixel's ray
    "oblique"       a near plane that lies in the mirror (Lengyel 2005, "Oblique view frustum depth projection and clipping").
                    Depth is the distance to the mirror by that to the eye, and not that to the eye alone
    "near_plane"    a near plane across the axis, at the farthest or the nearest point of the mirror. What lies between it and
                    the mirror is lost, or is drawn though it lies behind the mirror
    "vertex_scale"  every vertex is moved on its ray from the eye, so that the mirror's plane comes to lie in the near plane:
                    by near / z(x, y), where z is the plane's depth at the vertex's x and y. That is no projective map: what
                    is interpolated between vertices is wrong, and where z changes its sign triangles are torn
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels import depths, geometry, packets, raster
from benchharness.kernels.frozen import frozen
from benchharness.kernels.types import MeshLike, View

Clip = Literal["discard", "oblique", "near_plane", "vertex_scale"]
FLAT = 1e-4
"""Of a mirror's extent: how far its vertices may be off the plane; and radians, by which its normals may turn from it. In a
mirror that fills a picture of a thousand pixels, either moves an image by a fifth of a pixel."""
STEEP = 1e-6  # cosine: a plane as near to the axis as this has no depth at x and y
CLOSE = 1e-6  # of the near plane's depth: less is no depth to divide by


@dataclass
class Plane:
    """A point of it, and its unit normal, to either side."""

    point: mi.Point3f
    normal: mi.Vector3f


@dataclass(frozen=True)
class Fit:
    """The plane of least squares through a mesh's triangles, object space, and how far they are from it.

    point, normal  float64 [3]
    extent         diagonal of the box around the triangles
    height         the farthest vertex's distance from the plane
    turn           radians: the most that a vertex normal turns from the plane's, or from its opposite if all of a triangle do
    """

    point: np.ndarray
    normal: np.ndarray
    extent: float
    height: float
    turn: float

    @property
    def flat(self) -> bool:
        return self.height <= FLAT * self.extent and self.turn <= FLAT


def fitted(mesh: MeshLike) -> Fit:
    """The plane through a mesh, weighted by area; vertices of no triangle do not count."""
    corners = mesh.vertices[mesh.faces]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    weights = np.linalg.norm(areas, axis=1)
    weights = weights / weights.sum() if weights.sum() > 0 else np.full(len(weights), 1 / len(weights))
    point = weights @ corners.mean(axis=1)
    # The integral of x xᵀ over a triangle is its area by twelve, times that of its corners and of their sum.
    x = np.concatenate([corners, corners.sum(axis=1, keepdims=True) - 2 * point], axis=1) - point
    normal = np.linalg.eigh(np.einsum("f,fki,fkj->ij", weights, x, x))[1][:, 0]
    normal = normal if normal @ areas.sum(axis=0) >= 0 else -normal
    # From the sine, which a cosine near 1 has lost.
    cosines = mesh.normals @ normal
    across = np.linalg.norm(mesh.normals - cosines[:, None] * normal, axis=1)
    turns = np.stack([np.arctan2(across, sign * cosines)[mesh.faces].max(axis=1) for sign in (1, -1)])
    used = corners.reshape(-1, 3)
    return Fit(
        point=point,
        normal=normal,
        extent=float(np.linalg.norm(np.ptp(used, axis=0))),
        height=float(np.abs((used - point) @ normal).max()),
        turn=float(turns.min(axis=0).max()),
    )


def uploaded(fits: Sequence[Fit]) -> list[Plane]:
    """Planes on the device, object space."""
    planes = [Plane(mi.Point3f(*map(float, fit.point)), mi.Vector3f(*map(float, fit.normal))) for fit in fits]
    dr.make_opaque(planes)
    return planes


@frozen
def placed(planes: list[Plane], poses: mi.Float, parts: list[mi.UInt32]) -> list[Plane]:
    """Planes in world space, each with the pose of its part. `poses`: 12 floats per part, rigid."""
    world = []
    for plane, part in zip(planes, parts, strict=True):
        rows = [dr.gather(mi.Vector4f, poses, part * 3 + k) for k in range(3)]
        point = mi.Point3f(*(dr.dot(row.xyz, mi.Vector3f(plane.point)) + row.w for row in rows))
        world.append(Plane(point, mi.Vector3f(*(dr.dot(row.xyz, plane.normal) for row in rows))))
    return world


@frozen
def reflected(view: View, plane: Plane) -> View:
    """The camera whose picture a flat mirror shows, at the same pixels as `view` sees the mirror. It turns left to right."""
    n = plane.normal

    def turned(d: mi.Vector3f) -> mi.Vector3f:
        return d - 2 * dr.dot(d, n) * n

    def moved(p: mi.Point3f) -> mi.Point3f:
        return p - 2 * dr.dot(p - plane.point, n) * n

    def row(r: mi.Vector4f) -> mi.Vector4f:
        axis = turned(r.xyz)
        return mi.Vector4f(axis.x, axis.y, axis.z, r.w + 2 * dr.dot(r.xyz, n) * dr.dot(mi.Vector3f(plane.point), n))

    return replace(
        view,
        eye=moved(view.eye),
        x=row(view.x),
        y=row(view.y),
        w=row(view.w),
        right=turned(view.right),
        down=turned(view.down),
        axis=turned(view.axis),
        origin=moved(view.origin),
    )


@dataclass
class Cut:
    """What `raster.rasterize` is given so that it draws what a mirror shows, and nothing else.

    view   the mirrored camera
    limit  float [height * width]: -inf at pixels that do not show the mirror
    order  what is sorted by; None for nearness
    points where vertices are drawn; None for where they are
    beside bool [height * width]: pixels at which the plane of the cut is not that of the mirror
    """

    view: View
    limit: mi.Float
    order: depths.Order | None
    points: mi.Float | None
    beside: mi.Bool


@frozen
def cut(view: View, plane: Plane, world: geometry.Geometry, shows: mi.Bool, clip: str, near_at: str) -> Cut:
    """How a mirror cuts what its mirrored camera `view` sees.

    shows    bool [height * width], the pixels that show the mirror
    near_at  "farthest" or "nearest" point of the mirror, for "near_plane"
    """
    lane = dr.arange(mi.UInt32, view.width * view.height)
    row = lane // view.width
    column = mi.Float(lane - row * view.width) + 0.5
    base, d = depths.on_ray(view, column, mi.Float(row) + 0.5, mi.Float(0)), raster.ray_through(view, lane)
    offset = dr.dot(plane.point - base, plane.normal) / dr.dot(d, plane.normal)
    nearness = depths.nearness(view, offset)
    open_ = shows & dr.isfinite(nearness)
    limit = dr.select(open_, nearness if clip == "discard" else dr.inf, -dr.inf)
    made = Cut(view, limit, None, None, dr.zeros(mi.Bool, view.width * view.height))
    if clip == "oblique":
        made.order = _oblique(view, plane)
    elif clip == "near_plane":
        depth = view.depth + offset
        edge = dr.max(dr.select(open_, depth, 0)) if near_at == "farthest" else dr.min(dr.select(open_, depth, dr.inf))
        made.view = replace(view, near=dr.select(dr.isfinite(edge), dr.maximum(view.near, edge), view.near))
        made.beside = open_ & (dr.abs(made.view.near - depth) > 1e-3 * depth)
    elif clip == "vertex_scale":
        made.points = _scaled(view, plane, world)
    return made


def _oblique(view: View, plane: Plane) -> depths.Order:
    """Lengyel's depth, turned around: 0 on the plane and -2 on a far plane that touches the picture's corner at infinity.

    His third row is 2 C / (C·q) less the fourth, of the plane C, which is negative at the eye, and of the frustum's corner q
    that lies farthest on its other side. The far plane of the camera's own frustum is at infinity here, and so is q.
    """
    n = dr.select(dr.dot(view.eye - plane.point, plane.normal) > 0, -plane.normal, plane.normal)
    corners = [view.axis + c * view.right + r * view.down for c in (0, view.width) for r in (0, view.height)]
    reach = dr.maximum(dr.maximum(*(dr.dot(q, n) for q in corners[:2])), dr.maximum(*(dr.dot(q, n) for q in corners[2:])))
    C = (2 * dr.rcp(dr.select(reach > 0, reach, dr.inf))) * n
    row = mi.Vector4f(-C.x, -C.y, -C.z, dr.dot(C, mi.Vector3f(plane.point)))
    return depths.Order(row, mi.Float(0), mi.Float(-2))


def _scaled(view: View, plane: Plane, world: geometry.Geometry) -> mi.Float:
    """The vertices, each moved along its ray from the eye by the near plane's depth over the mirror plane's."""
    p = dr.gather(mi.Vector4f, world.points, dr.arange(mi.UInt32, world.vertex_count))
    way = mi.Point3f(p.xyz) - view.eye
    slope = _away(dr.dot(plane.normal, view.w.xyz), mi.Float(STEEP))
    z = dr.dot(view.w.xyz, way) - dr.dot(mi.Point3f(p.xyz) - plane.point, plane.normal) / slope
    moved = view.eye + way * (view.near / _away(z, CLOSE * view.near))
    return packets.stored(mi.Vector4f(moved.x, moved.y, moved.z, p.w), world.vertex_count)


def _away(value: mi.Float, least: mi.Float) -> mi.Float:
    """The value, at least so far from zero."""
    return dr.select(dr.abs(value) < least, dr.select(value < 0, -least, least), value)
