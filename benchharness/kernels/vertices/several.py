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

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy.spatial import KDTree

from benchharness.kernels import geometry, placement
from benchharness.kernels.placement import Place, unit
from benchharness.kernels.vertices import newton, vertexwise

SEEDS = 1024  # points of the mirror; half as many miss four times as many reflections of a ball with bumps
AROUND = 6  # neighbours that a seed is compared with; more hide one of two reflections that are close
AGREES = 0.3  # least cosine of half vector and normal where a search starts
MORE = 2  # starts beyond twice the reflections that there is room for: some come to the same point, some to none
APART = 1.0  # pixels at the point's depth, and
APART_SHARE = 2e-3  # of the mirror's size: points nearer to each other are one
LIFT = 1e-4  # of the mirror's size; rays that ask whether the mirror meets itself start this far in front of it
NONE = 0xFFFF_FFFF
FIRST, SECOND = 0, 1  # rank of ends: those that are seen come first


@dataclass
class Seeds:
    """Points of a mirror's mesh at which searches may start; object space.

    triangles   the triangles that they are the middles of
    middles     8 floats each: middle, 1 if it is a mirror on both sides, unit normal there, 0
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
    """From host arrays as `newton.mesh` takes them."""
    chosen = newton.spread(vertices, faces, SEEDS)
    both = np.full((len(chosen), 1), backs) & ~geometry.oriented_closed_faces(vertices, faces)[chosen][:, None]
    middle = vertices[faces[chosen]].mean(axis=1)
    normal = normals[faces[chosen]].sum(axis=1)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    # A mirror of few triangles has few seeds: a seed may be its own neighbour, which changes nothing.
    near = KDTree(middle).query(middle, min(AROUND + 1, len(chosen)))[1].reshape(len(chosen), -1)[:, 1:]
    around = np.tile(np.arange(len(chosen))[:, None], (1, AROUND))
    around[:, : near.shape[1]] = near
    packed = np.hstack([middle, both, normal, 0 * both]).astype(np.float32)
    arrays = mi.UInt32(chosen.astype(np.uint32)), mi.Float(packed.ravel()), mi.UInt32(around.astype(np.uint32).ravel())
    return Seeds(*arrays, len(chosen), not both.any())


def tries(multi: int) -> int:
    """Searches per vertex."""
    return 2 * multi + MORE


@dataclass
class Starts:
    """Where `tries` searches per vertex start.

    vertex, V  of each lane; world space
    where      the same in the mirror's
    on, P      the point of the mesh
    active     whether there is a start
    touches    V lies on the mirror there
    """

    vertex: mi.UInt32
    V: mi.Point3f
    where: Place
    on: newton.Where
    P: mi.Point3f
    active: mi.Bool
    touches: mi.Bool


@dr.syntax
def _choose(grid: Seeds, where: Place, active, most: int) -> tuple[list, list]:
    """The `most` seeds that agree best of those that agree better than their neighbours: how well, and which."""
    values = dr.alloc_local(mi.Float, grid.count)
    k = mi.UInt32(0)
    while dr.hint(active & (k < grid.count), label="compare half vector and normal at the seeds"):
        point, normal = (dr.gather(mi.Vector4f, grid.middles, 2 * k + i) for i in (0, 1))
        P, N = point.xyz, normal.xyz
        w_E, w_V = unit(where.eye - P), unit(where.V - P)
        N = dr.select((point.w > 0) & (dr.dot(N, w_E) < 0), -N, N)
        values[k] = dr.dot(unit(w_E + w_V), N)
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
    return agreement, chosen


def begin(grid: Seeds, mirror: newton.Mesh, pose: list, view, points, part, shown_parts, count: int, multi: int) -> Starts:
    """The starts of every vertex of the scene (`vertexwise.vertices`). One more, in place of the last, where V is close to the
    mirror: right behind it, where the half vector changes within less than seeds are apart."""
    most = tries(multi)
    lane, V, active = vertexwise.vertices(points, part, shown_parts, count)
    where = placement.place(pose, V, view)
    sight = newton.look_at(mirror, where, active)
    _, chosen = _choose(grid, where, active, most)
    triangle, weights = dr.empty(mi.UInt32, most * count), dr.empty(mi.Float, 2 * most * count)
    for i, index in enumerate(chosen):
        there = active & (index != NONE)
        own, b = dr.select(there, dr.gather(mi.UInt32, grid.triangles, index, there), NONE), mi.Point2f(1 / 3)
        if i == most - 1:
            own, b = dr.select(sight.near, sight.on.triangle, own), dr.select(sight.near, sight.on.b, b)
        dr.scatter(triangle, own, i * count + lane)
        dr.scatter(weights, b, i * count + lane)
    touching = mi.Bool(sight.touches)
    dr.eval(triangle, weights, touching)

    lane = dr.arange(mi.UInt32, most * count)
    vertex = lane % count
    triangle = dr.gather(mi.UInt32, triangle, lane)
    active = triangle != NONE
    on = newton.Where(dr.select(active, triangle, 0), dr.gather(mi.Point2f, weights, lane))
    V = mi.Point3f(dr.gather(mi.Vector4f, points, vertex).xyz)
    touches = (lane >= (most - 1) * count) & dr.gather(mi.Bool, touching, vertex)
    return Starts(vertex, V, placement.place(pose, V, view), on, newton.position(mirror, on, active), active, touches)


@dataclass
class Ends:
    """Where the searches ended, a lane per start; mirror's space. Fields as in `newton.Solution`.

    reflected  R is near enough to a reflection point to be drawn
    on         where on the mesh R is, None if the search does not know
    """

    R: mi.Point3f
    n: mi.Normal3f
    reflected: mi.Bool
    converged: mi.Bool
    residual: mi.Float
    iterations: mi.UInt32
    on: newton.Where | None


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


def is_seen(mirror: newton.Mesh, where: Place, R: mi.Point3f, n: mi.Normal3f, active) -> mi.Bool:
    """Whether no part of the mirror stands between its point R and the eye, nor between R and V; mirror's space."""
    free = is_free(mirror, R, n, where.eye, active)
    return is_free(mirror, R, n, where.V, free)


def is_free(mirror: newton.Mesh, R: mi.Point3f, n: mi.Normal3f, end: mi.Point3f, active) -> mi.Bool:
    """Whether no part of the mirror stands between its point R and another point, such as the eye; mirror's space."""
    lifted = R + LIFT * mirror.size * mi.Vector3f(n)
    d = end - lifted
    length = dr.norm(d)
    ray = mi.Ray3f(lifted, d * dr.rcp(dr.maximum(length, 1e-20)))
    ray.maxt = dr.maximum(length - newton.SHADOWED * mirror.size, 0)
    return active & ~mirror.scene.ray_test(ray, active=active)


def valid(mirrors: list[newton.Mesh], first: int, frame, points, report: dict) -> mi.Bool:
    """Which of the reflections in a report (`benchharness.api.Vertices`, one per vertex) the mirror hides neither from the eye
    nor from the vertex. It has not been evaluated: rays are cast when somebody reads it.

    mirrors  one per reflector; those that are convex are not asked
    first    part number of the first
    points   of the scene; see `kernels.geometry.Geometry`
    report   lanes as there, `valid` where there is a reflection
    """
    valid, hidden, count = report["valid"], mi.Bool(False), dr.width(points) // 4
    lane = dr.arange(mi.UInt32, len(mirrors) * count)
    V = mi.Point3f(dr.gather(mi.Vector4f, points, lane % count).xyz)
    for i, mirror in enumerate(mirrors):
        if not mirror.convex:
            pose = placement.pose_of(frame.poses, mi.UInt32(first + i))
            where, R = placement.place(pose, V, frame.view), placement.place(pose, report["R"], frame.view).V
            asked = valid & (lane >= i * count) & (lane < (i + 1) * count)
            hidden |= asked & ~is_seen(mirror, where, R, placement.normal_to_mirror(pose, report["n"]), asked)
    return valid & ~hidden


def finish(ends: Ends, starts: Starts, mirror: newton.Mesh, pose: list, view, count: int, multi: int) -> Found:
    """Which ends are different points in front of the eye, those that are seen first, in the order of their starts."""
    most, where = tries(multi), starts.where
    in_view = dr.dot(where.w, mi.Vector4f(ends.R.x, ends.R.y, ends.R.z, 1)) > view.near
    reflected = starts.active & ends.reflected & in_view
    on = ends.on
    if on is None:
        ray, _ = newton.sight_line(mirror, where.eye, ends.R)
        hit = mirror.scene.ray_intersect_preliminary(ray, coherent=False, active=reflected)
        met = reflected & hit.is_valid()
        on = newton.Where(dr.select(met, hit.prim_index, 0), mi.Point2f(dr.select(met, hit.prim_uv, 0)))
    kind = newton.kind(mirror, where, on, reflected)
    seen = reflected & is_seen(mirror, where, ends.R, ends.n, reflected)
    rank = dr.select(seen, mi.UInt32(FIRST), dr.select(reflected, mi.UInt32(SECOND), NONE))
    converged = reflected & ends.converged
    iterations = dr.select(starts.active, ends.iterations, 0)
    R, n = dr.select(reflected, ends.R, 0), dr.select(reflected, ends.n, 0)
    residual = dr.select(reflected, ends.residual, 0)
    dr.eval(R, n, converged, kind, rank, residual, iterations)

    # Per vertex: an end is left out where a better one is near. A place in the order: how many come before.
    lane = dr.arange(mi.UInt32, count)
    near_by, ranks, points = [], [], []
    for i in range(most):
        at = i * count + lane
        points.append(dr.gather(mi.Point3f, R, at))
        ranks.append(dr.gather(mi.UInt32, rank, at))
        depth = dr.dot(where_w(pose, view), mi.Vector4f(points[i].x, points[i].y, points[i].z, 1))
        near_by.append(dr.maximum(APART * dr.norm(view.right) * depth, APART_SHARE * mirror.size))
    different = [r != NONE for r in ranks]
    for i in range(most):
        for j in range(i):
            one = (
                (ranks[i] != NONE) & (ranks[j] != NONE) & (dr.norm(points[i] - points[j]) < dr.minimum(near_by[i], near_by[j]))
            )
            different[i] &= ~(one & (ranks[j] <= ranks[i]))
            different[j] &= ~(one & (ranks[i] < ranks[j]))
    reflections = mi.UInt32(0)
    source = dr.full(mi.UInt32, NONE, multi * count)
    for i in range(most):
        place = mi.UInt32(0)
        for j in range(most):
            if j != i:
                before = ranks[j] <= ranks[i] if j < i else ranks[j] < ranks[i]
                place += dr.select(different[j] & before, 1, 0)
        dr.scatter(source, i * count + lane, place * count + lane, different[i] & (place < multi))
        reflections += dr.select(different[i] & (ranks[i] == FIRST), 1, 0)
    work = per_vertex(iterations, count, multi)
    dr.eval(source, reflections, work)

    source = dr.gather(mi.UInt32, source, dr.arange(mi.UInt32, multi * count))
    filled = source != NONE

    def of(array):
        return dr.gather(type(array), array, source, filled)

    rank = of(rank)
    R = placement.point_to_world(pose, of(R))
    n = placement.normal_to_world(pose, of(n))
    return Found(
        mi.Point3f(dr.select(filled, R, 0)), mi.Normal3f(dr.select(filled, n, 0)), filled,
        filled & of(converged), filled & (rank == FIRST), of(kind), of(residual), of(iterations), reflections, work,
    )  # fmt: skip


def where_w(pose: list, view) -> mi.Vector4f:
    """The row that gives depths of points in the mirror's space."""
    return placement.place(pose, mi.Point3f(0), view).w


def per_vertex(work: mi.UInt32, count: int, multi: int) -> mi.UInt32:
    """The sum of a number over all starts of a vertex."""
    lane, total = dr.arange(mi.UInt32, count), mi.UInt32(0)
    for i in range(tries(multi)):
        total += dr.gather(mi.UInt32, work, i * count + lane)
    return total
