"""Triangles on the device, in the layout that the other kernels read.

    points      4 floats per vertex: x, y, z, number of the part (as a float, exact below 2^24)
    attributes  4 floats per vertex: radiance of what is lit, unit normal of what reflects; the last is free. None where only
                places matter
    faces       4 integers per triangle: three vertices, number of the part (and raster.CLOSED, see `part_of`)
    shine       what highlights need beside (`kernels.lighting`), None for a scene without: then nothing of it is compiled
    paint       what textures and light maps need beside (`kernels.painting`), likewise; radiance is without them
    normal_maps  of mirrors (`kernels.normalmap`), likewise; normals are without them. `of_scene` has none

One vertex or one triangle is one packet load of 16 bytes. `upload` and `of_scene` give object space, `placed` world space.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from benchharness.kernels import lighting, normalmap, packets, painting, raster
from benchharness.kernels.types import SceneLike


@dataclass
class Geometry:
    """Triangles of parts, in the layout above."""

    points: mi.Float
    attributes: mi.Float | None
    faces: mi.UInt32
    vertex_count: int
    face_count: int
    shine: lighting.Shine | None = None
    paint: painting.Paint | None = None
    normal_maps: painting.Paint | None = None


def of_scene(scene: SceneLike) -> Geometry:
    """All parts of a scene that was baked: objects with their light, mirrors black."""
    lit = [(o.mesh.vertices, o.mesh.radiance, o.mesh.faces) for o in scene.objects]
    black = [(r.mesh.vertices, np.zeros_like(r.mesh.vertices), r.mesh.faces) for r in scene.reflectors]
    return upload(lit + black, lighting.shine_of(scene), painting.paint_of(scene))


def of_scene_seen(scene: SceneLike) -> Geometry:
    """All parts of a scene that was baked, as the eye sees them: objects with their light, mirrors with their normals and their
    normal maps."""
    lit = [(o.mesh.vertices, np.asarray(o.mesh.radiance), o.mesh.faces) for o in scene.objects]
    mirrors = [(r.mesh.vertices, np.asarray(r.mesh.normals), r.mesh.faces) for r in scene.reflectors]
    seen = upload(lit + mirrors, lighting.shine_of(scene), painting.paint_of(scene))
    return replace(seen, normal_maps=normalmap.maps_of(scene))


def upload(
    meshes: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]],
    shine: lighting.Shine | None = None,
    paint: painting.Paint | None = None,
) -> Geometry:
    """One Geometry out of parts (vertices [V, 3], attributes [V, 3], faces [F, 3]), numbered in their order."""
    points, attributes, faces, start = [], [], [], 0
    for part, (v, a, f) in enumerate(meshes):
        points.append(packets.of_rows(v, part))
        attributes.append(packets.of_rows(a))
        tag = np.where(oriented_closed_faces(v, f), part | raster.CLOSED, part)
        faces.append(np.column_stack([np.asarray(f, np.int64) + start, tag]).astype(np.uint32))
        start += len(v)
    packed_faces = np.concatenate(faces)
    return Geometry(
        mi.Float(np.concatenate(points).ravel()),
        mi.Float(np.concatenate(attributes).ravel()),
        mi.UInt32(packed_faces.ravel()),
        start,
        len(packed_faces),
        shine,
        paint,
    )


def part_of(face: mi.Vector4u) -> mi.UInt32:
    """The number of the part that a triangle belongs to."""
    return face.w & (raster.CLOSED - 1)


def oriented_closed_faces(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Per face whether it belongs to a closed, consistently wound piece, bool [F]: no back of such a face is ever seen.

    Every edge of the piece is run through as often in one direction as in the other; vertices at the same place count as
    one, so that boxes that touch are as closed as they were apart. An edge may have more than two faces; light is baked by
    `modelling.winding.closed_faces`, where it may not, and the winding does not matter.
    """
    f = welded(vertices)[faces]
    count = int(f.max()) + 1
    edges = np.stack([f, np.roll(f, -1, axis=1)], axis=2).reshape(-1, 2).astype(np.int64)
    forward, backward = edges[:, 0] * count + edges[:, 1], edges[:, 1] * count + edges[:, 0]
    met, inverse, uses = np.unique(forward, return_inverse=True, return_counts=True)
    place = np.minimum(np.searchsorted(met, backward), len(met) - 1)
    sound = (met[place] == backward) & (uses[place] == uses[inverse])
    graph = coo_array((np.ones(len(edges)), edges.T), shape=(count, count))
    _, piece = connected_components(graph, directed=False)
    torn = np.zeros(piece.max() + 1, bool)
    torn[piece[edges[~sound, 0]]] = True
    return ~torn[piece[f[:, 0]]]


def welded(vertices: np.ndarray) -> np.ndarray:
    """A number per place for vertices [V, 3], int64 [V]; those that round to the same millionth of the size are at one."""
    size = max(float(np.ptp(vertices, axis=0).max()), 1e-30)
    _, place = np.unique(np.round(vertices / (1e-6 * size)).astype(np.int64), axis=0, return_inverse=True)
    return place.reshape(-1)


def radiance(triangles: Geometry, face: mi.Vector4u, weights: mi.Vector3f, viewer: mi.Point3f, active: mi.Bool) -> mi.Color3f:
    """What leaves triangles at the points `weights` towards `viewer`: baked light, coloured, and highlights seen from there.

    viewer   the eye for what is seen directly, the reflection point for what a mirror shows; world space
    triangles  in world space if they have any shine; `raster.interpolate` says what face and weights are
    """
    value = raster.interpolate(triangles.attributes, face, weights, active)
    L = mi.Color3f(value.x, value.y, value.z)
    if triangles.paint is not None:
        L = painting.seen(triangles.paint, L, part_of(face), face, weights, active)
    if triangles.shine is None:
        return L
    spot = lighting.Spot(triangles.points, face, part_of(face), weights)
    return L + lighting.seen_from(viewer, triangles.shine, spot, active)


def placed(triangles: Geometry, poses: mi.Float) -> Geometry:
    """Triangles in object space -> in world space: points, and the normals that highlights need. `poses` as in `posed`."""
    shine, count = triangles.shine, triangles.vertex_count
    if shine is not None:
        shine = replace(shine, normals=turned(triangles.points, shine.normals, count, poses))
    return replace(triangles, points=posed(triangles.points, count, poses), shine=shine)


def placed_seen(triangles: Geometry, poses: mi.Float, objects: int) -> Geometry:
    """What `of_scene_seen` has -> in world space, the mirrors' normals too. `objects`: the first mirror's part."""
    world = placed(triangles, poses)
    lane = dr.arange(mi.UInt32, triangles.vertex_count)
    part = dr.gather(mi.Float, triangles.points, lane * 4 + 3)
    normals = dr.gather(mi.Vector4f, turned(triangles.points, triangles.attributes, triangles.vertex_count, poses), lane)
    kept = dr.gather(mi.Vector4f, triangles.attributes, lane)
    world.attributes = packets.stored(dr.select(part >= objects, normals, kept), triangles.vertex_count)
    return world


def posed(points: mi.Float, vertex_count: int, poses: mi.Float, source: mi.UInt32 | None = None) -> mi.Float:
    """Points in world space. `poses`: 12 floats per part, the rows of its 3 x 4 object-to-world matrix. `source`: the number of
    each of `vertex_count` points, where that is not its place."""
    p, rows = _pose_of(points, vertex_count, poses, source)
    q = mi.Vector4f(p.x, p.y, p.z, 1.0)
    return packets.stored(mi.Vector4f(*(dr.dot(row, q) for row in rows), p.w), vertex_count)


def turned(points: mi.Float, normals: mi.Float, vertex_count: int, poses: mi.Float) -> mi.Float:
    """Normals in world space, for rigid poses. `points` tells the part of each vertex."""
    _, rows = _pose_of(points, vertex_count, poses)
    n = dr.gather(mi.Vector4f, normals, dr.arange(mi.UInt32, vertex_count))
    q = mi.Vector4f(n.x, n.y, n.z, 0.0)
    return packets.stored(mi.Vector4f(*(dr.dot(row, q) for row in rows), 0.0), vertex_count)


def turned_of(n: mi.Vector3f, poses: mi.Float, part: mi.UInt32, active: mi.Bool) -> mi.Vector3f:
    """Directions of object space in world space, each with the pose of its part."""
    return mi.Vector3f(*(dr.dot(dr.gather(mi.Vector4f, poses, part * 3 + k, active).xyz, n) for k in range(3)))


def _pose_of(
    points: mi.Float, vertex_count: int, poses: mi.Float, source: mi.UInt32 | None = None
) -> tuple[mi.Vector4f, list[mi.Vector4f]]:
    """The packet of each vertex, and the rows of its part's pose."""
    p = dr.gather(mi.Vector4f, points, dr.arange(mi.UInt32, vertex_count) if source is None else source)
    part = mi.UInt32(p.w)
    return p, [dr.gather(mi.Vector4f, poses, part * 3 + k) for k in range(3)]
