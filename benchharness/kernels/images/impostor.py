"""Impostors: a part of the scene as a picture of itself, taken from the side of the mirror that will show it.

Popescu, Mei, Dauble and Sacks 2006, 3 and 4: a camera with a narrow field of view looks at the part from where the mirror
is. The picture stands in for the part, as a billboard on the plane through the part's centroid that faces the camera, or
with its depth.

This file measures the parts and places the cameras, on the host; `kernels.images.capture` takes the pictures.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np
import trimesh

from benchharness.kernels.types import View

FIELD = np.radians(10.0)  # full angle that a camera sees (PMDS06 3)
FLAT = 0.05  # thickness over length up to which a part is a plane
ROD = 0.5  # thickness over width from which it is none: what is as thick as wide has no plane of its own
LEAST = 1e-9  # metres: half a side of what has no extent


@dataclass(frozen=True, eq=False)
class Shape:
    """A part, in its own space.

    vertices   that its faces use, float64 [N, 3]
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
class ImpostorCamera:
    """An impostor camera: where it stands and what it sees, float64, world space unless said.

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
        """Where the camera is, float64 [3]."""
        return self.centre + self.distance * self.k

    def moved(self, pose: np.ndarray) -> ImpostorCamera:
        """Carried by a rigid pose, float64 [3, 4]."""
        turn, shift = pose[:, :3], pose[:, 3]
        a, b, k = (turn @ axis for axis in (self.a, self.b, self.k))
        return replace(self, centre=turn @ self.centre + shift, a=a, b=b, k=k)


def facing(shape: Shape, towards: np.ndarray) -> ImpostorCamera:
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
    return _around(shape, shape.centroid, (a, np.cross(a, k), k), (half, half), distance)


def on_plane(shape: Shape, side: np.ndarray) -> ImpostorCamera:
    """The camera for a flat part: the picture is its own rectangle, on and seen from the side that `side` [3] lies on."""
    assert shape.plane is not None
    a, b, k, centre, (ha, hb, _) = shape.plane
    if np.dot(side - centre, k) < 0:
        k, a, b, ha, hb = -k, b, a, hb, ha  # turned over
    centre = centre + np.max((shape.vertices - centre) @ k) * k
    return _around(shape, centre, (a, -b, k), (max(ha, LEAST), max(hb, LEAST)), shape.radius / np.sin(0.5 * FIELD))


def _around(
    shape: Shape,
    centre: np.ndarray,
    axes: tuple[np.ndarray, np.ndarray, np.ndarray],
    half: tuple[float, float],
    distance: float,
) -> ImpostorCamera:
    """The camera with its near and far depths around a part."""
    depth = distance - (shape.vertices - centre) @ axes[2]
    margin = 1e-4 * shape.radius
    return ImpostorCamera(
        centre, *axes, half=half, distance=distance, near=float(depth.min()) - margin, far=float(depth.max()) + margin
    )


def view_of(camera: ImpostorCamera, width: int) -> View:
    """The camera on the device, for a picture of width x width texels."""
    focal = [0.5 * width * camera.distance / half for half in camera.half]
    eye, forward = camera.eye, -camera.k

    def row(direction: np.ndarray) -> mi.Vector4f:
        return mi.Vector4f(*map(float, direction), float(-np.dot(direction, eye)))

    right, down = camera.a / focal[0], camera.b / focal[1]
    made = View(
        eye=mi.Point3f(*map(float, eye)),
        x=row(focal[0] * camera.a + 0.5 * width * forward),
        y=row(focal[1] * camera.b + 0.5 * width * forward),
        w=row(forward),
        right=mi.Vector3f(*map(float, right)),
        down=mi.Vector3f(*map(float, down)),
        axis=mi.Vector3f(*map(float, forward - 0.5 * width * (right + down))),
        depth=mi.Float(0),
        origin=mi.Point3f(*map(float, eye)),
        near=mi.Float(0.5 * camera.near),
        width=width,
        height=width,
    )
    dr.make_opaque(made)
    return made


def packet_of(camera: ImpostorCamera, width: int, start: float) -> list[float]:
    """The camera of a depth map of width x width texels, 16 numbers as `kernels.images.relief` reads them.

    start  how far a ray runs, metres, before it may meet this map
    """
    rows = [[*axis, -float(np.dot(axis, camera.eye))] for axis in (camera.a, camera.b, -camera.k)]
    return [*rows[0], *rows[1], *rows[2], 0.5 * width * camera.distance / camera.half[0], camera.near, camera.far, start]
