"""Impostors: a part of the scene as a picture of itself, taken from the side of the mirror that will show it.

Popescu, Mei, Dauble and Sacks 2006, 3 and 4: a camera with a narrow field of view looks at the part from where the mirror
is. The picture stands in for the part, as a billboard on the plane through the part's centroid that faces the camera, or
with its depth.

This file measures the parts and places the cameras, on the host; `kernels.images.capture` takes the pictures.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
import trimesh

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
    """An impostor camera, or many at once: where it stands and what it sees, float64, in world space unless said.

    Fields of many have the same leading axes, here left out.

    centre   B [3]: the camera looks at it along -k; the billboard lies in the plane through it with normal k
    a, b, k  unit axes [3]: columns of the picture grow along a, rows along b, a x b = -k
    half     half the width and height of what is seen, in the billboard's plane, [2]
    distance of the camera from B
    near, far  depths between which the part lies
    """

    centre: np.ndarray
    a: np.ndarray
    b: np.ndarray
    k: np.ndarray
    half: np.ndarray
    distance: np.ndarray
    near: np.ndarray
    far: np.ndarray

    @property
    def eye(self) -> np.ndarray:
        """Where the camera is, [3]."""
        return self.centre + self.distance[..., None] * self.k

    def moved(self, pose: np.ndarray) -> ImpostorCamera:
        """Carried by a rigid pose, float64 [3, 4]; many of them each by its own, or all by one."""
        turn, shift = pose[..., :3], pose[..., 3]
        a, b, k = (np.einsum("...ij,...j->...i", turn, axis) for axis in (self.a, self.b, self.k))
        return replace(self, centre=np.einsum("...ij,...j->...i", turn, self.centre) + shift, a=a, b=b, k=k)

    def at(self, numbers: np.ndarray) -> ImpostorCamera:
        """Some of many."""
        return ImpostorCamera(*(getattr(self, field.name)[numbers] for field in fields(self)))

    def put(self, numbers: np.ndarray, others: ImpostorCamera) -> None:
        """Writes others in the places `numbers`."""
        for field in fields(self):
            getattr(self, field.name)[numbers] = getattr(others, field.name)


def many(count: int) -> ImpostorCamera:
    """Room for so many cameras: until `put` writes others, all see a cube of side 2 around the origin from above."""
    axes = [np.tile(axis, (count, 1)) for axis in ([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0])]
    distance = 1 / np.sin(0.5 * FIELD)
    numbers = [np.full(count, number) for number in (distance, distance - 1, distance + 1)]
    return ImpostorCamera(*axes, np.ones((count, 2)), *numbers)


def facing(shape: Shape, towards: np.ndarray) -> ImpostorCamera:
    """The camera that looks at a part from the direction `towards` [3], in the part's space; from [N, 3], as many.

    Its field of view just holds the sphere around the part: distance radius / sin(5 degrees). A `towards` of no length
    stands for the direction upwards.
    """
    length = np.linalg.norm(towards, axis=-1, keepdims=True)
    k = np.where(length > 1e-9 * shape.radius, towards / np.maximum(length, 1e-300), [0.0, 0.0, 1.0])
    a = np.cross(np.where(np.abs(k[..., 2:]) < 0.99, [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]), k)
    a /= np.linalg.norm(a, axis=-1, keepdims=True)
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
    """Cameras with their near and far depths around a part."""
    a, b, k = axes
    height = (shape.vertices - centre) @ np.moveaxis(k, -1, 0)
    margin = 1e-4 * shape.radius
    return ImpostorCamera(
        centre=np.broadcast_to(centre, k.shape),
        a=a,
        b=b,
        k=k,
        half=np.broadcast_to(half, (*k.shape[:-1], 2)),
        distance=np.broadcast_to(distance, k.shape[:-1]),
        near=distance - height.max(axis=0) - margin,
        far=distance - height.min(axis=0) + margin,
    )


def onto(camera: ImpostorCamera, size: np.ndarray, column: np.ndarray, row: np.ndarray) -> np.ndarray:
    """What takes a point P to (column, row, 1) depth / distance, where the camera sees it: float64 [3, 4], times (P, 1).

    size         texels across the picture
    column, row  of its first texel, amid others
    """
    focal = 0.5 * np.asarray(size)[..., None] * camera.distance[..., None] / camera.half
    corner = np.stack([column, row], axis=-1) + 0.5 * np.asarray(size)[..., None]
    x = focal[..., :1] * camera.a - corner[..., :1] * camera.k
    y = focal[..., 1:] * camera.b - corner[..., 1:] * camera.k
    turn = np.stack([x, y, -camera.k], axis=-2) / camera.distance[..., None, None]
    return np.concatenate([turn, -np.einsum("...ij,...j->...i", turn, camera.eye)[..., None]], axis=-1)


def packets_of(camera: ImpostorCamera, size: np.ndarray, start: np.ndarray) -> np.ndarray:
    """The cameras of N depth maps of size x size texels, float64 [N, 4, 4] as `kernels.images.relief` reads them.

    start  how far a ray runs, metres, before it may meet this map
    """
    axes = np.stack([camera.a, camera.b, -camera.k], axis=1)
    rows = np.concatenate([axes, -np.einsum("nij,nj->ni", axes, camera.eye)[..., None]], axis=2)
    lens = np.stack([0.5 * size * camera.distance / camera.half[:, 0], camera.near, camera.far, start], axis=1)
    return np.concatenate([rows, lens[:, None]], axis=1)
