"""What a ray meets first: Embree's bounding volume hierarchies, through Mitsuba, and how they follow what moves.

Two ways to serve parts that move. `ANEW` is one hierarchy over everything, built again whenever a pose changed: Mitsuba has
no refit, and what it builds for instances takes as long. `BODIES` never builds again: parts that stand still are one
hierarchy, and those that share a motion, which move as one rigid body, another, in object space. It is the ray that moves
there: through the inverse of the body's pose, which leaves distances as they are. Bodies are asked one after the other, each
for what is nearer than what was met so far, and only by rays that reach its box.

Robust: no ray slips through the edge between two triangles, as it does by default where it runs along them. Embree then
builds without spatial splits, in a quarter of the time, and traverses more slowly, by a quarter to a half.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels import geometry, mitsuba_mesh
from benchharness.kernels.types import SceneLike

Way = Literal["anew", "bodies"]
ANEW, BODIES = "anew", "bodies"
SLACK = 1e-5  # relative; some 80 roundings of a float32, of which the distance to a box's side takes about five


@dataclass
class Tree:
    """A bounding volume hierarchy.

    scene      Mitsuba's, of one mesh
    first      number of its first triangle in `Hierarchies.faces`
    part       whose pose takes its space to world space; None: it is in world space
    low, high  a box around it, in its space: a little larger, so that no ray that meets it lies in the plane of a side
    """

    scene: Any
    first: mi.UInt32
    part: mi.UInt32 | None
    low: mi.Point3f
    high: mi.Point3f


@dataclass
class Hierarchies:
    """All of a scene, for rays.

    faces   as in `geometry.Geometry`, a tree's triangles in a row
    poses   12 floats per part, as in `geometry.posed`
    points  those of the geometry where the one tree is to be built again, else None
    """

    trees: list[Tree]
    faces: mi.UInt32
    poses: mi.Float
    points: mi.Float | None
    vertex_count: int


@dataclass
class Meeting:
    """What rays met first; `face` and `weights` as in `raster.interpolate`, `t` is infinite where nothing was."""

    found: mi.Bool
    t: mi.Float
    face: mi.Vector4u
    weights: mi.Vector3f


def of_scene(
    scene: SceneLike, triangles: geometry.Geometry, time: float, way: Way = BODIES, *, robust: bool = True
) -> Hierarchies:
    """The hierarchies of a scene as it stands at `time`; `triangles`: its parts, in object space."""
    poses = mi.Float(np.asarray(scene.poses(time), np.float32).ravel())
    motions = [part.motion for part in scene.parts]
    anew = way == ANEW and any(motion is not None for motion in motions)
    points = geometry.posed(triangles.points, triangles.vertex_count, poses) if anew else triangles.points
    points, packets = np.array(points).reshape(-1, 4)[:, :3], np.array(triangles.faces).reshape(-1, 4)
    owner = np.array(geometry.part_of(mi.Vector4u(packets.T)))
    trees, faces, first = [], [], 0
    for group in [list(range(len(motions)))] if anew else rigid(motions):
        mine = packets[np.isin(owner, group)]
        used, corners = np.unique(mine[:, :3], return_inverse=True)
        if anew:  # `moved` poses all vertices, in their order
            used, corners = np.arange(len(points)), mine[:, :3]
        margin = max(SLACK * float(np.abs(points[used]).max()), 1e-30)
        low = mi.Point3f(*map(float, points[used].min(axis=0) - margin))
        high = mi.Point3f(*map(float, points[used].max(axis=0) + margin))
        still = anew or motions[group[0]] is None
        tree = Tree(
            mitsuba_mesh.scene(points[used], corners.reshape(-1, 3), robust=robust),
            mi.UInt32(first),
            None if still else mi.UInt32(group[0]),
            low,
            high,
        )
        dr.make_opaque(tree.first, tree.part, low, high)
        trees.append(tree)
        faces.append(mine)
        first += len(mine)
    ordered = mi.UInt32(np.concatenate(faces).ravel())
    return Hierarchies(trees, ordered, poses, triangles.points if anew else None, triangles.vertex_count)


def rigid(motions: Sequence[Any]) -> list[list[int]]:
    """Numbers of the parts that move as one: those without motion, if any, then those that share the same one."""
    groups: dict[int, list[int]] = {}
    for part, motion in enumerate(motions):
        groups.setdefault(0 if motion is None else id(motion), []).append(part)
    return [groups[key] for key in sorted(groups, key=lambda key: key != 0)]


def moved(hierarchies: Hierarchies, poses: mi.Float) -> Hierarchies:
    """The hierarchies with the parts at `poses`, as in `geometry.posed`.

    What was built anew is so for the hierarchies given, too.
    """
    if hierarchies.points is not None:
        count = hierarchies.vertex_count
        params = mi.traverse(hierarchies.trees[0].scene)
        params["surface.vertex_positions"] = triples(geometry.posed(hierarchies.points, count, poses), count)
        params.update()
    return replace(hierarchies, poses=poses)


def meet(hierarchies: Hierarchies, ray: mi.Ray3f, active: mi.Bool | bool = True, *, coherent: bool = False) -> Meeting:
    """What is met first, at any distance.

    coherent  Embree may traverse with packets of rays, for rays that go together; it misses what rays that part from a
              curved mirror meet, and is slower for them

    On a graphics card each tree is a kernel of its own: OptiX has one shader binding table per kernel, and Dr.Jit drops the
    rays of any other scene with no more than a warning.
    """
    t, triangle, uv = mi.Float(dr.inf), mi.UInt32(0), mi.Point2f(0)
    several = len(hierarchies.trees) > 1
    for tree in hierarchies.trees:
        own, asked = mi.Ray3f(ray.o, ray.d), mi.Bool(active)
        if tree.part is not None:
            own = _within(hierarchies.poses, tree.part, ray)
            asked &= _reaches(own, tree, t)
        own.maxt = t
        hit = tree.scene.ray_intersect_preliminary(own, coherent=coherent, active=asked)
        nearer = hit.is_valid()
        t = dr.select(nearer, hit.t, t)
        triangle = dr.select(nearer, hit.prim_index + tree.first, triangle)
        uv = dr.select(nearer, hit.prim_uv, uv)
        if several and dr.backend_v(t) == dr.JitBackend.CUDA:
            dr.eval(t, triangle, uv)
    found = dr.isfinite(t)
    face = dr.gather(mi.Vector4u, hierarchies.faces, triangle, found)
    return Meeting(found, t, face, mi.Vector3f(1 - uv.x - uv.y, uv.x, uv.y))


def _within(poses: mi.Float, part: mi.UInt32, ray: mi.Ray3f) -> mi.Ray3f:
    """A ray of world space in the space of a part."""
    a, b, c = (dr.gather(mi.Vector4f, poses, part * 3 + k) for k in range(3))
    o, d = ray.o - mi.Point3f(a.w, b.w, c.w), ray.d
    return mi.Ray3f(mi.Point3f(a.xyz * o.x + b.xyz * o.y + c.xyz * o.z), a.xyz * d.x + b.xyz * d.y + c.xyz * d.z)


def _reaches(ray: mi.Ray3f, tree: Tree, t: mi.Float) -> mi.Bool:
    """Whether a ray gets into the tree's box before t."""
    one, other = (tree.low - ray.o) / ray.d, (tree.high - ray.o) / ray.d
    enters, leaves = dr.max(dr.minimum(one, other)), dr.min(dr.maximum(one, other)) * (1 + SLACK)
    return (leaves >= 0) & (enters <= leaves) & (enters <= t * (1 + SLACK))


def triples(packed: Any, count: int) -> Any:
    """3 values per element, as Mitsuba wants them, of 4 per element."""
    lane = dr.arange(mi.UInt32, 3 * count)
    return dr.gather(type(packed), packed, lane // 3 * 4 + lane % 3)
