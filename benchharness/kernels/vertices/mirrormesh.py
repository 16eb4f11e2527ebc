"""A mirror's triangle mesh, ready for searches that walk on it: corners, normals, and a hierarchy for rays.

Positions are in the mirror's own frame (`kernels.placement`), so that all of it is built once. Where a cold search may start is
chosen here, too: points spread over the mesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np
import trimesh

from benchharness.kernels import geometry, mitsuba_mesh, raster
from benchharness.kernels.placement import MirrorFrame, unit

CANDIDATES = 192  # points of the mesh that a cold search chooses its start from
TIED = 1e-3  # share by which one distance is larger than another and counts as equal
SKEW = (0.519, 0.288, 0.805)  # a direction that no symmetry of a mesh is likely to share
ROUNDING = 1e-6  # of a mesh's size; mean depth of hollows in a mesh that counts as convex
SPACING = 4.0  # of the largest mirror's size, between mirrors that are joined
NEAREST = 1e-5  # of the mirror's size; a vertex nearer to the mirror than this touches it


@dataclass
class MirrorMesh:
    """A mirror's mesh.

    scene       its triangles alone, for rays
    vertices    8 floats per vertex: position, 0, normal, 0
    faces       4 integers per triangle: three vertices, and `kernels.raster.CLOSED` where its back is never seen
    candidates  triangles spread over the mesh, at whose middles a search may start
    middles     those middles, as `middles_of` has them
    first       the first of them; not 0 where several meshes are `Joined`, and then
    tries       how many there are from there on
    centre      the middle of its bounding box
    size        of its bounding box's diagonal
    convex      whether E sees no reflection of V exactly where the mirror stands between them
    closed      whether no back of it is ever seen
    """

    scene: mi.Scene
    vertices: mi.Float
    faces: mi.UInt32
    candidates: mi.UInt32
    middles: mi.Float
    first: mi.UInt32
    tries: int
    centre: mi.Point3f
    size: mi.Float
    convex: bool
    closed: bool


@dataclass
class SurfacePoint:
    """A point of the mesh: triangle, and weights of its second and third corner."""

    triangle: mi.UInt32
    b: mi.Point2f


def build(vertices: np.ndarray, normals: np.ndarray, faces: np.ndarray, backs: bool = True) -> MirrorMesh:
    """The mesh of host arrays [V, 3], [V, 3], [F, 3]. `backs`: whether an open mesh is a mirror on its back too."""
    zero = np.zeros((len(vertices), 1))
    packed = np.hstack([vertices, zero, normals, zero]).astype(np.float32)
    tags = np.where(geometry.oriented_closed_faces(vertices, faces) | (not backs), raster.CLOSED, 0)
    quads = np.hstack([faces, tags[:, None]]).astype(np.uint32)
    size = mi.Float(float(np.linalg.norm(np.ptp(vertices, axis=0))))
    centre = mi.Point3f(*(0.5 * (vertices.min(axis=0) + vertices.max(axis=0))).tolist())
    chosen = spread(vertices, faces, CANDIDATES)
    middles = middles_of(vertices, normals, faces[chosen], tags[chosen] == 0)
    candidates = mi.UInt32(chosen.astype(np.uint32))
    dr.make_opaque(size, centre, candidates)
    return MirrorMesh(
        scene=mitsuba_mesh.scene(vertices, faces),
        vertices=mi.Float(packed.ravel()),
        faces=mi.UInt32(quads.ravel()),
        candidates=candidates,
        middles=middles,
        first=mi.UInt32(0),
        tries=len(chosen),
        centre=centre,
        size=size,
        convex=is_convex(vertices, faces),
        closed=bool((tags == raster.CLOSED).all()),
    )


@dataclass
class Joined:
    """Several convex mirrors in one hierarchy, so that a vertex of each can be searched in one kernel.

    Each has a cell of its own in a space that they share, SPACING of the largest away from the next: what is asked of one is
    never so far from it.

    mesh   all of them; its `size`, `centre` and `first` have a lane per mirror
    shift  per mirror, what takes points of its own space to its cell
    """

    mesh: MirrorMesh
    shift: mi.Point3f

    def at(self, number: mi.UInt32, pose: list[mi.Vector4f]) -> tuple[MirrorMesh, list[mi.Vector4f]]:
        """The mirrors `number`, one per lane, and rows of the matrices that take points of their cells to the world. `pose`:
        those that take points of their own spaces there."""
        shift, mesh = dr.gather(mi.Point3f, self.shift, number), self.mesh
        rows = [mi.Vector4f(row.x, row.y, row.z, row.w - dr.dot(row.xyz, shift)) for row in pose]
        lanes = {name: dr.gather(type(a), a, number) for name in ("size", "centre", "first") for a in [getattr(mesh, name)]}
        return replace(mesh, **lanes), rows


def joined(meshes: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> Joined:
    """Several convex mirrors, host arrays as `build` takes them."""
    boxes = [(v.min(axis=0), v.max(axis=0)) for v, _, _ in meshes]
    across = int(np.ceil(len(meshes) ** (1 / 3)))
    cells = np.stack(np.unravel_index(np.arange(len(meshes)), (across,) * 3), axis=1) - 0.5 * (across - 1)
    centres = cells * SPACING * max(float(np.linalg.norm(high - low)) for low, high in boxes)
    shifts = centres - [0.5 * (low + high) for low, high in boxes]
    moved = [build(v + shift, n, f) for (v, n, f), shift in zip(meshes, shifts, strict=True)]
    starts = np.cumsum([0, *(len(v) for v, _, _ in meshes)])
    triangles = np.cumsum([0, *(len(f) for _, _, f in meshes)])
    vertices = np.concatenate([v + shift for (v, _, _), shift in zip(meshes, shifts, strict=True)])
    faces = np.concatenate([f + start for (_, _, f), start in zip(meshes, starts, strict=False)])
    tries = max(one.tries for one in moved)
    candidates, middles, quads = [], [], []
    for one, start, first in zip(moved, starts, triangles, strict=False):
        again = np.arange(tries) % one.tries
        candidates.append(np.array(one.candidates)[again] + first)
        middles.append(np.array(one.middles).reshape(-1, 8)[again])
        quads.append(np.array(one.faces).reshape(-1, 4) + np.array([start, start, start, 0], np.uint32))
    sizes, numbers = mi.Float(np.concatenate([np.array(one.size) for one in moved])), np.arange(len(meshes))
    all_candidates, first = mi.UInt32(np.concatenate(candidates)), mi.UInt32(numbers * tries)
    middle, shift = mi.Point3f(centres.T), mi.Point3f(shifts.T)
    dr.make_opaque(sizes, middle, shift, first)
    mesh = MirrorMesh(
        scene=mitsuba_mesh.scene(vertices, faces),
        vertices=mi.Float(np.concatenate([np.array(one.vertices) for one in moved])),
        faces=mi.UInt32(np.concatenate(quads).astype(np.uint32).ravel()),
        candidates=all_candidates,
        middles=mi.Float(np.concatenate(middles).ravel()),
        first=first,
        tries=tries,
        centre=middle,
        size=sizes,
        convex=all(one.convex for one in moved),
        closed=all(one.closed for one in moved),
    )
    return Joined(mesh, shift)


def spread(vertices: np.ndarray, faces: np.ndarray, count: int) -> np.ndarray:
    """`count` triangles, or all, whose middles lie far from each other: each the farthest from those before it.

    Symmetric meshes have many that are as far. Of these it is the one farthest along SKEW, and not the first, nor the one that
    rounding favours: the choice stays when triangles are numbered otherwise, or vertices move by their rounding.
    """
    middles = vertices[faces].mean(axis=1)
    along = middles @ SKEW
    chosen, distance = [], np.full(len(faces), np.inf)
    for _ in range(min(count, len(faces))):
        as_far = distance >= (1 - TIED) * distance.max()
        chosen.append(int(np.where(as_far, along, -np.inf).argmax()))
        away = middles - middles[chosen[-1]]
        distance = np.minimum(distance, np.sqrt(np.einsum("ij,ij->i", away, away)))
    return np.array(chosen)


def middles_of(vertices: np.ndarray, normals: np.ndarray, faces: np.ndarray, two_sided: np.ndarray) -> mi.Float:
    """The middles of triangles, 8 floats each: position, 1 where `two_sided` (a mirror on both sides), unit normal, 0."""
    normal = normals[faces].sum(axis=1)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    both = two_sided[:, None]
    return mi.Float(np.hstack([vertices[faces].mean(axis=1), both, normal, 0 * both]).astype(np.float32).ravel())


def agreement(middles: mi.Float, k: mi.UInt32, local: MirrorFrame) -> tuple[mi.Float, mi.Bool]:
    """The cosine of half vector and normal at middle number k, and whether E and V are in front of it. A sheet's normal is that
    of the side that the eye sees."""
    point, normal = (dr.gather(mi.Vector4f, middles, 2 * k + i) for i in (0, 1))
    P, N = point.xyz, normal.xyz
    w_E, w_V = unit(local.eye - P), unit(local.V - P)
    N = dr.select((point.w > 0) & (dr.dot(N, w_E) < 0), -N, N)
    return dr.dot(unit(w_E + w_V), N), (dr.dot(N, w_E) > 0) & (dr.dot(N, w_V) > 0)


def is_convex(vertices: np.ndarray, faces: np.ndarray) -> bool:
    """Whether the mesh is closed, in one piece, wound outwards, and convex but for rounding.

    Convex: no edge is hollow; and, as a hollow may be too wide to show at single edges of a fine mesh, its convex hull
    holds no more than it does itself.
    """
    solid = trimesh.Trimesh(vertices, faces)
    if not (solid.is_convex and solid.is_winding_consistent):
        return False
    return bool(solid.convex_hull.volume - solid.volume < ROUNDING * solid.scale * solid.area)


def corners(
    mesh: MirrorMesh, triangle: mi.UInt32, eye: mi.Point3f, active: mi.Bool | bool
) -> tuple[list[mi.Point3f], list[mi.Vector3f]]:
    """Positions and normals of a triangle's corners. A sheet is a mirror on both sides: its normals are turned to the eye's."""
    face = dr.gather(mi.Vector4u, mesh.faces, triangle, active)
    index = (face.x, face.y, face.z)
    p = [dr.gather(mi.Vector4f, mesh.vertices, 2 * i, active).xyz for i in index]
    n = [dr.gather(mi.Vector4f, mesh.vertices, 2 * i + 1, active).xyz for i in index]
    away = ((face.w & raster.CLOSED) == 0) & (dr.dot(dr.cross(p[1] - p[0], p[2] - p[0]), eye - p[0]) < 0)
    return p, [dr.select(away, -v, v) for v in n]


def position(mesh: MirrorMesh, on: SurfacePoint, active: mi.Bool) -> mi.Point3f:
    """The position of a point of the mesh."""
    face = dr.gather(mi.Vector4u, mesh.faces, on.triangle, active)
    p = [dr.gather(mi.Vector4f, mesh.vertices, 2 * i, active).xyz for i in (face.x, face.y, face.z)]
    return mi.Point3f(p[0] + on.b.x * (p[1] - p[0]) + on.b.y * (p[2] - p[0]))
