"""Several reflection points per vertex: where searches start, which of their ends are different points, and which are seen.

Half vector and normal agree at every reflection point, whether the light's path is shortest, longest or neither there: each
is a maximum of their agreement over the mirror. So the agreement is evaluated at points spread over the mirror (`Seeds`), and a
search starts at each that agrees better than those around it. The searches are the methods' own, each in a lane: number
k * count + v is the k-th start of vertex v of `count`.

Of the ends, those that lie within a pixel of a better one are left out. An end is *seen* if no other part of the mirror stands
between it and the eye, nor between it and the vertex: otherwise the mirror meets itself there, and there is no image. Seen
ends come first. What is not seen is kept after them if there is room: a triangle may reach from one to the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy.spatial import KDTree

from benchharness.kernels import geometry, placement
from benchharness.kernels.placement import MirrorFrame
from benchharness.kernels.types import Frame, Vertices, View
from benchharness.kernels.vertices import mirrormesh, newton, sight
from benchharness.kernels.vertices.mirrormesh import MirrorMesh, SurfacePoint
from benchharness.kernels.vertices.problems import Problem

SEEDS = 1024  # points of the mirror; half as many miss four times as many reflections of a ball with bumps
AROUND = 6  # neighbours that a seed is compared with; more hide one of two reflections that are close
AGREES = 0.3  # least cosine of half vector and normal where a search starts
MORE = 2  # starts beyond twice the reflections that there is room for: some come to the same point, some to none
APART = 1.0  # pixels at the point's depth, and
APART_SHARE = 2e-3  # of the mirror's size: points nearer to each other are one
NONE = 0xFFFF_FFFF
FIRST, SECOND = 0, 1  # rank of ends: those that are seen come first


@dataclass
class Seeds:
    """Points of a mirror's mesh at which searches may start, in the mirror's frame.

    triangles   the triangles that they are the middles of
    middles     as `mirrormesh.middles_of` has them
    neighbours  AROUND numbers of the nearest other seeds each
    count       how many
    closed      whether no back of the mirror is ever seen
    """

    triangles: mi.UInt32
    middles: mi.Float
    neighbours: mi.UInt32
    count: int
    closed: bool


def seeds(vertices: np.ndarray, normals: np.ndarray, faces: np.ndarray, backs: bool = True) -> Seeds:
    """The seeds of a mesh, given as `mirrormesh.build` takes it."""
    chosen = mirrormesh.spread(vertices, faces, SEEDS)
    both = np.full(len(chosen), backs) & ~geometry.oriented_closed_faces(vertices, faces)[chosen]
    middle = vertices[faces[chosen]].mean(axis=1)
    # A mirror of few triangles has few seeds: a seed may be its own neighbour, which changes nothing.
    near = KDTree(middle).query(middle, min(AROUND + 1, len(chosen)))[1].reshape(len(chosen), -1)[:, 1:]
    around = np.tile(np.arange(len(chosen))[:, None], (1, AROUND))
    around[:, : near.shape[1]] = near
    return Seeds(
        triangles=mi.UInt32(chosen.astype(np.uint32)),
        middles=mirrormesh.middles_of(vertices, normals, faces[chosen], both),
        neighbours=mi.UInt32(around.astype(np.uint32).ravel()),
        count=len(chosen),
        closed=not both.any(),
    )


def tries(multi: int) -> int:
    """How many searches are made per vertex."""
    return 2 * multi + MORE


@dataclass
class Starts:
    """Where `tries` searches per vertex start.

    vertex   of each lane
    V        its position in the world,
    local    and in the mirror's frame
    on       the point of the mesh,
    P        and its position
    active   whether there is a start
    touches  V lies on the mirror there
    """

    vertex: mi.UInt32
    V: mi.Point3f
    local: MirrorFrame
    on: SurfacePoint
    P: mi.Point3f
    active: mi.Bool
    touches: mi.Bool


@dr.syntax
def _choose(grid: Seeds, local: MirrorFrame, active: mi.Bool, most: int) -> list[mi.UInt32]:
    """The `most` seeds that agree best of those that agree better than their neighbours."""
    values = dr.alloc_local(mi.Float, grid.count)
    k = mi.UInt32(0)
    while dr.hint(active & (k < grid.count), label="compare half vector and normal at the seeds"):
        values[k] = mirrormesh.agreement(grid.middles, k, local)[0]
        k += 1
    agreement, chosen = [mi.Float(AGREES) for _ in range(most)], [mi.UInt32(NONE) for _ in range(most)]
    k = mi.UInt32(0)
    while dr.hint(active & (k < grid.count), label="choose the seeds that agree best"):
        value, index = mi.Float(values[k]), mi.UInt32(k)
        for i in range(AROUND):
            other = values[dr.gather(mi.UInt32, grid.neighbours, AROUND * k + i)]
            value = dr.select(other > values[k], -dr.inf, value)
        for i in range(most):
            better = value > agreement[i]
            moved_value, moved_index = dr.select(better, agreement[i], value), dr.select(better, chosen[i], index)
            agreement[i], chosen[i] = dr.select(better, value, agreement[i]), dr.select(better, index, chosen[i])
            value, index = moved_value, moved_index
        k += 1
    return chosen


def begin(grid: Seeds, mesh: MirrorMesh, problem: Problem, multi: int) -> Starts:
    """The starts of every vertex of the scene. One more, in place of the last, where V is close to the mirror: right behind it,
    where the half vector changes within less than seeds are apart."""
    most, count = tries(multi), problem.count
    pose, view = problem.pose, problem.view
    lane, V, active = problem.vertices()
    local = placement.mirror_frame(pose, V, view)
    seen = sight.look_at(mesh, local, active)
    chosen = _choose(grid, local, active, most)
    dr.eval(chosen, seen)  # or each of the scatters below is a kernel that does all this again
    triangle, weights = dr.empty(mi.UInt32, most * count), dr.empty(mi.Float, 2 * most * count)
    for i, index in enumerate(chosen):
        there = active & (index != NONE)
        own, b = dr.select(there, dr.gather(mi.UInt32, grid.triangles, index, there), NONE), mi.Point2f(1 / 3)
        if i == most - 1:
            own, b = dr.select(seen.near, seen.on.triangle, own), dr.select(seen.near, seen.on.b, b)
        dr.scatter(triangle, own, i * count + lane)
        dr.scatter(weights, b, i * count + lane)
    touching = mi.Bool(seen.touches)
    dr.eval(triangle, weights, touching)

    return starts_on(triangle, weights, touching, mesh, problem, most)


def starts_on(
    triangle: mi.UInt32, weights: mi.Float, touching: mi.Bool, mesh: MirrorMesh, problem: Problem, most: int
) -> Starts:
    """The starts on triangles [most V] of a mirror, NONE for none, at their `weights` [most V, 2]. `touching`: per vertex,
    `sight.Sight.touches`; its last start stands for that."""
    count = problem.count
    lane = dr.arange(mi.UInt32, most * count)
    vertex = lane % count
    triangle = dr.gather(mi.UInt32, triangle, lane)
    active = triangle != NONE
    on = SurfacePoint(dr.select(active, triangle, 0), dr.gather(mi.Point2f, weights, lane))
    V = mi.Point3f(dr.gather(mi.Vector4f, problem.world.points, vertex).xyz)
    return Starts(
        vertex=vertex,
        V=V,
        local=placement.mirror_frame(problem.pose, V, problem.view),
        on=on,
        P=mirrormesh.position(mesh, on, active),
        active=active,
        touches=(lane >= (most - 1) * count) & dr.gather(mi.Bool, touching, vertex),
    )


@dataclass
class Ends:
    """Where the searches ended, a lane per start, in the mirror's frame. Fields as in `newton.Solution`.

    reflected  R is near enough to a reflection point to be drawn
    on         where on the mesh R is, None if the search does not know
    """

    R: mi.Point3f
    n: mi.Normal3f
    reflected: mi.Bool
    converged: mi.Bool
    residual: mi.Float
    iterations: mi.UInt32
    on: SurfacePoint | None


@dataclass
class Found:
    """The different reflections of each vertex: lane k * count + v is the k-th of vertex v; world space.

    filled      whether there is one; the other fields are 0 where not
    seen        the mirror hides it neither from the eye nor from the vertex
    kind        `newton.MINIMUM`, `SADDLE` or `MAXIMUM`
    reflections per vertex, how many are seen, also those that there is no room for
    work        per vertex, iterations of all searches
    """

    R: mi.Point3f
    n: mi.Normal3f
    filled: mi.Bool
    converged: mi.Bool
    seen: mi.Bool
    kind: mi.UInt32
    residual: mi.Float
    iterations: mi.UInt32
    reflections: mi.UInt32
    work: mi.UInt32


def valid(meshes: list[MirrorMesh], first: int, frame: Frame, points: mi.Float, found: Vertices) -> mi.Bool:
    """Which valid reflections, one per vertex, the mirror hides neither from the eye nor from the vertex. It has not been
    evaluated: rays are cast when somebody reads it.

    meshes  one per reflector; those that are convex are not asked
    first   part number of the first
    points  of the scene; see `kernels.geometry.Geometry`
    """
    hidden, count = mi.Bool(False), dr.width(points) // 4
    lane = dr.arange(mi.UInt32, len(meshes) * count)
    V = mi.Point3f(dr.gather(mi.Vector4f, points, lane % count).xyz)
    for i, mesh in enumerate(meshes):
        if not mesh.convex:
            pose = placement.pose_of(frame.poses, mi.UInt32(first + i))
            local, R = (placement.mirror_frame(pose, p, frame.view) for p in (V, found.R))
            asked = found.valid & (lane >= i * count) & (lane < (i + 1) * count)
            n = placement.normal_to_mirror(pose, found.n)
            hidden |= asked & ~sight.is_seen(mesh, local, R.V, n, asked)
    return found.valid & ~hidden


def finish(ends: Ends, starts: Starts, mesh: MirrorMesh, problem: Problem, multi: int) -> Found:
    """Which ends are different points in front of the eye, those that are seen first, in the order of their starts."""
    pose, local = problem.pose, starts.local
    in_view = dr.dot(local.w, mi.Vector4f(ends.R.x, ends.R.y, ends.R.z, 1)) > problem.view.near
    reflected = starts.active & ends.reflected & in_view
    on = ends.on
    if on is None:
        on, _ = sight.first_met(mesh, sight.sight_line(mesh, local.eye, ends.R)[0], reflected)
    kind = newton.kind(mesh, local, on, reflected)
    seen = reflected & sight.is_seen(mesh, local, ends.R, ends.n, reflected)
    rank = dr.select(seen, mi.UInt32(FIRST), dr.select(reflected, mi.UInt32(SECOND), NONE))
    converged = reflected & ends.converged
    iterations = dr.select(starts.active, ends.iterations, 0)
    R, n = dr.select(reflected, ends.R, 0), dr.select(reflected, ends.n, 0)
    residual = dr.select(reflected, ends.residual, 0)
    dr.eval(R, n, converged, kind, rank, residual, iterations)

    source, reflections = _ordered(R, rank, mesh, problem, multi)
    work = per_vertex(iterations, problem.count, multi)
    dr.eval(source, reflections, work)

    source = dr.gather(mi.UInt32, source, dr.arange(mi.UInt32, multi * problem.count))
    filled = source != NONE

    def of(array: Any) -> Any:
        return dr.gather(type(array), array, source, filled)

    rank = of(rank)
    R = placement.point_to_world(pose, of(R))
    n = placement.normal_to_world(pose, of(n))
    return Found(
        R=mi.Point3f(dr.select(filled, R, 0)),
        n=mi.Normal3f(dr.select(filled, n, 0)),
        filled=filled,
        converged=filled & of(converged),
        seen=filled & (rank == FIRST),
        kind=of(kind),
        residual=of(residual),
        iterations=of(iterations),
        reflections=reflections,
        work=work,
    )


def _ordered(R: mi.Point3f, rank: mi.UInt32, mesh: MirrorMesh, problem: Problem, multi: int) -> tuple[mi.UInt32, mi.UInt32]:
    """Which end is the k-th reflection of vertex v, number k * count + v, NONE for none; and how many of a vertex are seen.

    An end is left out where a better one is near. Its place is how many come before it.
    """
    most, count, view = tries(multi), problem.count, problem.view
    lane, depth_row = dr.arange(mi.UInt32, count), _depth_row(problem.pose, view)
    near_by, ranks, points = [], [], []
    for i in range(most):
        at = i * count + lane
        points.append(dr.gather(mi.Point3f, R, at))
        ranks.append(dr.gather(mi.UInt32, rank, at))
        depth = dr.dot(depth_row, mi.Vector4f(points[i].x, points[i].y, points[i].z, 1))
        near_by.append(dr.maximum(APART * dr.norm(view.right) * depth, APART_SHARE * mesh.size))
    different = [r != NONE for r in ranks]
    for i in range(most):
        for j in range(i):
            near = dr.norm(points[i] - points[j]) < dr.minimum(near_by[i], near_by[j])
            one = (ranks[i] != NONE) & (ranks[j] != NONE) & near
            different[i] &= ~(one & (ranks[j] <= ranks[i]))
            different[j] &= ~(one & (ranks[i] < ranks[j]))
    reflections, places, kept = mi.UInt32(0), [], []
    for i in range(most):
        place = mi.UInt32(0)
        for j in range(most):
            if j != i:
                before = ranks[j] <= ranks[i] if j < i else ranks[j] < ranks[i]
                place += dr.select(different[j] & before, 1, 0)
        places.append(place * count + lane)
        kept.append(different[i] & (place < multi))
        reflections += dr.select(different[i] & (ranks[i] == FIRST), 1, 0)
    dr.eval(places, kept, reflections)  # at once, as in `begin`
    source = dr.full(mi.UInt32, NONE, multi * count)
    for i in range(most):
        dr.scatter(source, i * count + lane, places[i], kept[i])
    return source, reflections


def _depth_row(pose: list[mi.Vector4f], view: View) -> mi.Vector4f:
    """The row that gives depths of points in the mirror's frame."""
    return placement.mirror_frame(pose, mi.Point3f(0), view).w


def per_vertex(work: mi.UInt32, count: int, multi: int) -> mi.UInt32:
    """The sum of a number over all starts of a vertex."""
    lane, total = dr.arange(mi.UInt32, count), mi.UInt32(0)
    for i in range(tries(multi)):
        total += dr.gather(mi.UInt32, work, i * count + lane)
    return total
