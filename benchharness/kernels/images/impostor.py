"""Impostors: a part of the scene as a picture of itself, taken from the side of the mirror that will show it.

Popescu, Mei, Dauble and Sacks 2006, 3 and 4: a camera with a narrow field of view looks at the part from where the mirror
is. The picture stands in for the part, as a billboard on the plane through the part's centroid that faces the camera, or
with its depth.

This file places the cameras, on the host, and takes the pictures. A picture holds a packet of 4 floats per texel,
premultiplied with coverage: radiance of an object, or unit normal of a mirror in the axes of the camera, then coverage.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
import trimesh

from benchharness.kernels import geometry, raster
from benchharness.kernels.frozen import frozen
from benchharness.kernels.images.depthmap import BACKGROUND
from benchharness.kernels.types import View

FIELD = np.radians(10.0)  # full angle that a camera sees (PMDS06 3)
FLAT = 0.05  # thickness over length up to which a part is a plane
ROD = 0.5  # thickness over width from which it is none: what is as thick as wide has no plane of its own
LEAST = 1e-9  # metres: half a side of what has no extent


@dataclass(frozen=True, eq=False)
class Shape:
    """A part, in its own space.

    centroid   of its surface, weighted by area
    radius     of the sphere around the centroid that holds it
    low, high  its box
    plane      for a flat part: unit axes (rows) a, b along its smallest rectangle and k across, and the rectangle's middle
               (fourth row) and half sizes (first two of the fifth), float64 [5, 3]; None for one with a volume
    """

    vertices: np.ndarray
    centroid: np.ndarray
    radius: float
    low: np.ndarray
    high: np.ndarray
    plane: np.ndarray | None


def shape_of(vertices: np.ndarray, faces: np.ndarray) -> Shape:
    """Measures a mesh [V, 3], [F, 3]; vertices that no face uses do not count."""
    used = vertices[np.unique(faces)]
    corners = vertices[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    area = area + 1e-12 * max(area.max(), 1e-300)
    centroid = np.average(corners.mean(axis=1), axis=0, weights=area)
    radius = max(float(np.linalg.norm(used - centroid, axis=1).max()), LEAST)
    return Shape(used, centroid, radius, used.min(axis=0), used.max(axis=0), _plane(used, centroid))


def _plane(points: np.ndarray, centroid: np.ndarray) -> np.ndarray | None:
    """`Shape.plane` of points [N, 3]."""
    offset = points - centroid
    _, axes = np.linalg.eigh(offset.T @ offset)
    across = axes[:, 0]
    depth = offset @ across
    thickness, width, length = np.ptp(offset @ axes, axis=0)
    if thickness > FLAT * length or thickness > ROD * width or width <= 1e-9 * length:
        return None
    flat = np.stack([offset @ axes[:, 2], offset @ axes[:, 1]], axis=1)
    to_box, extents = trimesh.bounds.oriented_bounds_2D(flat)
    turn = to_box[:2, :2]
    middle = centroid + axes[:, [2, 1]] @ (-turn.T @ to_box[:2, 2]) + 0.5 * (depth.min() + depth.max()) * across
    a, b = (axes[:, [2, 1]] @ row for row in turn)
    return np.stack([a, b, np.cross(a, b), middle, [0.5 * extents[0], 0.5 * extents[1], 0.0]])


@dataclass(frozen=True, eq=False)
class Stand:
    """Where a camera stands and what it sees, float64, world space unless said.

    centre   B: the camera looks at it along -k; the billboard lies in the plane through it with normal k
    a, b, k  unit axes: columns of the picture grow along a, rows along b, a x b = -k
    half     half the width and height of what is seen, in the billboard's plane
    distance of the camera from B
    near, far  depths between which the part lies
    """

    centre: np.ndarray
    a: np.ndarray
    b: np.ndarray
    k: np.ndarray
    half: tuple[float, float]
    distance: float
    near: float
    far: float

    @property
    def eye(self) -> np.ndarray:
        return self.centre + self.distance * self.k

    def moved(self, pose: np.ndarray) -> Stand:
        """Carried by a rigid pose, float64 [3, 4]."""
        turn, shift = pose[:, :3], pose[:, 3]
        a, b, k = (turn @ axis for axis in (self.a, self.b, self.k))
        return Stand(turn @ self.centre + shift, a, b, k, self.half, self.distance, self.near, self.far)


def facing(shape: Shape, towards: np.ndarray) -> Stand:
    """The camera that looks at a part from the direction `towards` [3], in the part's space.

    Its field of view just holds the sphere around the part: distance radius / sin(5 degrees). A `towards` of no length
    stands for the direction upwards.
    """
    length = np.linalg.norm(towards)
    k = towards / length if length > 1e-9 * shape.radius else np.array([0.0, 0.0, 1.0])
    a = np.cross([0.0, 0.0, 1.0] if abs(k[2]) < 0.99 else [0.0, 1.0, 0.0], k)
    a /= np.linalg.norm(a)
    distance = shape.radius / np.sin(0.5 * FIELD)
    half = distance * np.tan(0.5 * FIELD)
    return _standing(shape, shape.centroid, a, np.cross(a, k), k, (half, half), distance)


def on_plane(shape: Shape, side: np.ndarray) -> Stand:
    """The camera for a flat part: the picture is its own rectangle, on and seen from the side that `side` [3] lies on."""
    assert shape.plane is not None
    a, b, k, centre, (ha, hb, _) = shape.plane
    if np.dot(side - centre, k) < 0:
        k, a, b, ha, hb = -k, b, a, hb, ha  # turned over
    centre = centre + np.max((shape.vertices - centre) @ k) * k
    return _standing(shape, centre, a, -b, k, (max(ha, LEAST), max(hb, LEAST)), shape.radius / np.sin(0.5 * FIELD))


def _standing(shape: Shape, centre, a, b, k, half, distance: float) -> Stand:
    depth = distance - (shape.vertices - centre) @ k
    margin = 1e-4 * shape.radius
    return Stand(centre, a, b, k, half, distance, float(depth.min()) - margin, float(depth.max()) + margin)


def window(stand: Stand, width: int) -> View:
    """The camera on the device, for a picture of width x width texels."""
    focal = [0.5 * width * stand.distance / half for half in stand.half]
    eye, forward = stand.eye, -stand.k

    def row(direction: np.ndarray) -> mi.Vector4f:
        return mi.Vector4f(*map(float, direction), float(-np.dot(direction, eye)))

    right, down = stand.a / focal[0], stand.b / focal[1]
    made = View(
        eye=mi.Point3f(*map(float, eye)),
        x=row(focal[0] * stand.a + 0.5 * width * forward),
        y=row(focal[1] * stand.b + 0.5 * width * forward),
        w=row(forward),
        right=mi.Vector3f(*map(float, right)),
        down=mi.Vector3f(*map(float, down)),
        axis=mi.Vector3f(*map(float, forward - 0.5 * width * (right + down))),
        depth=mi.Float(0),
        origin=mi.Point3f(*map(float, eye)),
        near=mi.Float(0.5 * stand.near),
        width=width,
        height=width,
    )
    dr.make_opaque(made)
    return made


def camera(stand: Stand, width: int, start: float) -> list[float]:
    """The camera of a depth map of width x width texels, 16 numbers as `kernels.relief` reads them."""
    rows = [[*axis, -float(np.dot(axis, stand.eye))] for axis in (stand.a, stand.b, -stand.k)]
    return [*rows[0], *rows[1], *rows[2], 0.5 * width * stand.distance / stand.half[0], stand.near, stand.far, start]


def faces_of(triangles: geometry.Geometry, part: int) -> tuple[mi.UInt32, int]:
    """The triangles of one part, as `kernels.raster` takes them, and how many. Waits for the device."""
    face = dr.gather(mi.Vector4u, triangles.faces, dr.arange(mi.UInt32, triangles.face_count))
    lane = dr.compress(geometry.part_of(face) == part)
    out = dr.empty(mi.UInt32, 4 * dr.width(lane))
    dr.scatter(out, dr.gather(mi.Vector4u, triangles.faces, lane), dr.arange(mi.UInt32, dr.width(lane)))
    return out, dr.width(lane)


def picture(
    world: geometry.Geometry, faces: mi.UInt32, count: int, camera: View, viewer: mi.Point3f, stand: mi.Vector2f, mirror: bool
) -> tuple[mi.Float, mi.Float]:
    """Takes the picture of `count` triangles: 4 floats per texel, and its depth map.

    world   in world space; attributes as `geometry.placed_all` has them
    viewer  who the highlights are seen from
    stand   near and far depth; the map holds (1/near - 1/z) / (1/near - 1/far), BACKGROUND where nothing is
    mirror  the triangles are a mirror's: normals, not radiance
    """
    visibility = raster.rasterize(world.points, faces, count, camera, cull="back")
    return _resolved(world, faces, visibility, camera, viewer, stand, mirror)


@frozen
def _resolved(world: geometry.Geometry, faces, visibility, camera: View, viewer, stand, mirror: bool):
    lane = dr.arange(mi.UInt32, camera.width * camera.height)
    hit, face, weights, p = raster.seen(world.points, faces, visibility, camera, lane)
    if mirror:
        n = dr.normalize(raster.interpolate(world.attributes, face, weights, hit).xyz)
        a, b, k = dr.normalize(camera.right), dr.normalize(camera.down), -camera.w.xyz
        value = mi.Vector3f(dr.dot(n, a), dr.dot(n, b), dr.dot(n, k))
    else:
        value = mi.Vector3f(geometry.radiance(world, face, weights, viewer, hit))
    z = dr.dot(p - camera.eye, camera.w.xyz)
    depth = (dr.rcp(stand.x) - dr.rcp(z)) / (dr.rcp(stand.x) - dr.rcp(stand.y))
    texels = dr.empty(mi.Float, 4 * camera.width * camera.height)
    dr.scatter(texels, dr.select(hit, mi.Vector4f(value.x, value.y, value.z, 1), 0), lane)
    return texels, dr.select(hit, dr.clip(depth, 0, 1), BACKGROUND)
