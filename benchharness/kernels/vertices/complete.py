"""All reflection points of vertices in a mirror: which triangles may hold one (`cones`), and the roots of these (`polynomial`).

A vertex has a list of triangles; each triangle of a list is a lane, which finds its roots; those that are different points are
a vertex's. They are what `several` takes for starts of searches, which have arrived.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels import placement
from benchharness.kernels.placement import MirrorFrame
from benchharness.kernels.vertices import mirrormesh, several, sight
from benchharness.kernels.vertices.cones import Clusters, reaches
from benchharness.kernels.vertices.mirrormesh import MirrorMesh, SurfacePoint
from benchharness.kernels.vertices.polynomial import ROOTS, TriangleRoots, bounded, faces_both, fields, roots_of
from benchharness.kernels.vertices.problems import Problem
from benchharness.kernels.vertices.several import NONE, Starts

LISTED = 32  # triangles per vertex that may hold a root
SAME = 1e-4  # of the mirror's size; roots on different triangles that are nearer to each other are one


@dr.syntax
def listed(
    grouped: Clusters, mesh: MirrorMesh, local: MirrorFrame, active: mi.Bool, most: int
) -> tuple[list[mi.UInt32], mi.UInt32, mi.UInt32]:
    """The first `most` triangles that may hold a root, NONE after the last; how many may; and how many were asked."""
    found = [mi.UInt32(NONE) for _ in range(most)]
    count = mi.UInt32(0)  # triangles that may hold a root,
    asked = mi.UInt32(0)  # triangles asked,
    g = mi.UInt32(0)  # and the group
    while dr.hint(active & (g < grouped.groups.count), label="look for triangles with roots"):
        c, last = reaches(grouped.groups, g, local)
        while dr.hint(c < last, label="ask the clusters of a group"):
            k, end = reaches(grouped.clusters, c, local)
            while dr.hint(k < end, label="ask the triangles of a cluster"):
                triangle = dr.gather(mi.UInt32, grouped.order, k)
                f = fields(mesh, local, triangle, True)
                kept = faces_both(f)
                if kept:
                    kept = ~bounded(f).empty
                for i in range(most):
                    found[i] = dr.select(kept & (count == i), triangle, found[i])
                count += dr.select(kept, mi.UInt32(1), 0)
                asked += 1
                k += 1
            c += 1
        g += 1
    return found, count, asked


@dataclass
class Roots:
    """The reflection points of each vertex in a mirror, whatever hides them.

    on        the first of them
    count     how many there are of these
    complete  there are no others
    work      triangles asked, and parts of them
    """

    on: list[SurfacePoint]
    count: mi.UInt32
    complete: mi.Bool
    work: mi.UInt32


def roots(grouped: Clusters, mesh: MirrorMesh, problem: Problem, active: mi.Bool, most: int, room: int = LISTED) -> Roots:
    """Up to `most` reflection points of every vertex of a problem that is `active`. `room`: triangles per vertex that are
    looked into."""
    count, pose, view = problem.count, problem.pose, problem.view
    lane, V, _ = problem.vertices()
    local = placement.mirror_frame(pose, V, view)
    triangles, may, asked = listed(grouped, mesh, local, active, room)
    may, asked = dr.select(active, may, 0), mi.UInt32(asked)
    dr.eval(triangles, may, asked)  # at once: each scatter into one array is a kernel of its own
    slots = dr.empty(mi.UInt32, room * count)
    for k, triangle in enumerate(triangles):
        dr.scatter(slots, triangle, k * count + lane)
    dr.eval(slots)

    slot = dr.arange(mi.UInt32, room * count)
    triangle = dr.gather(mi.UInt32, slots, slot)
    there = triangle != NONE
    V = mi.Point3f(dr.gather(mi.Vector4f, problem.world.points, slot % count).xyz)
    f = fields(mesh, placement.mirror_frame(pose, V, view), dr.select(there, triangle, 0), there)
    solved = roots_of(f, there)
    solved.count = dr.select(there, solved.count, 0)
    solved.settled |= ~there
    solved.nodes = dr.select(there, solved.nodes, 0)
    dr.eval(solved)

    on, different, complete, nodes = _different(mesh, local, solved, slots, may, count, most, room)
    return Roots(on, different, complete & (may <= room), asked + nodes)


@dr.syntax
def _different(
    mesh: MirrorMesh,
    local: MirrorFrame,
    solved: TriangleRoots,
    slots: mi.UInt32,
    may: mi.UInt32,
    lanes: int,
    most: int,
    room: int,
) -> tuple[list[SurfacePoint], mi.UInt32, mi.Bool, mi.UInt32]:
    """Of the roots of a vertex's triangles, those that are different points, shortest paths first; how many; whether there is
    room for all, and all triangles are settled; and parts asked."""
    lane = dr.arange(mi.UInt32, lanes)
    on = [SurfacePoint(mi.UInt32(0), mi.Point2f(0)) for _ in range(most)]
    P, way = [mi.Point3f(0) for _ in range(most)], [mi.Float(dr.inf) for _ in range(most)]
    complete, nodes, k = mi.Bool(True), mi.UInt32(0), mi.UInt32(0)
    while dr.hint(k < dr.minimum(may, room), label="tell roots apart"):
        slot = k * lanes + lane
        triangle = dr.gather(mi.UInt32, slots, slot)
        found = dr.gather(mi.UInt32, solved.count, slot)
        complete &= dr.gather(mi.Bool, solved.settled, slot)
        nodes += dr.gather(mi.UInt32, solved.nodes, slot)
        for i in range(ROOTS):
            new = i < found
            own = SurfacePoint(mi.UInt32(triangle), dr.gather(mi.Point2f, solved.b[i], slot, new))
            point = mirrormesh.position(mesh, own, new)
            for j in range(most):
                new &= (way[j] == dr.inf) | (dr.norm(point - P[j]) > SAME * mesh.size)
            length = dr.select(new, dr.norm(local.eye - point) + dr.norm(local.V - point), dr.inf)
            for j in range(most):
                shorter = length < way[j]
                longer = [dr.select(shorter, *two) for two in ((on[j], own), (P[j], point), (way[j], length))]
                on[j], P[j], way[j] = (dr.select(shorter, *two) for two in ((own, on[j]), (point, P[j]), (length, way[j])))
                own, point, length = longer
            complete &= length == dr.inf
        k += 1
    count = mi.UInt32(0)
    for j in range(most):
        count += dr.select(way[j] < dr.inf, mi.UInt32(1), 0)
    return on, count, complete, nodes


def begin(grouped: Clusters, mesh: MirrorMesh, problem: Problem, multi: int) -> tuple[Starts, mi.Bool, mi.UInt32]:
    """All reflection points of every vertex, as what searches start from; whether a vertex has no others; and the work. One
    more start, in place of the last, where V is close to the mirror: there a triangle is large beside its distance."""
    most, count = several.tries(multi), problem.count
    lane, V, active = problem.vertices()
    seen = sight.look_at(mesh, placement.mirror_frame(problem.pose, V, problem.view), active)
    found = roots(grouped, mesh, problem, active, most)
    touching, complete, work = mi.Bool(seen.touches), mi.Bool(found.complete), dr.select(active, found.work, 0)
    dr.eval(found, seen, touching, complete, work)
    triangle, weights = dr.empty(mi.UInt32, most * count), dr.empty(mi.Float, 2 * most * count)
    for k, on in enumerate(found.on):
        own, b = dr.select(active & (k < found.count), on.triangle, NONE), on.b
        if k == most - 1:
            own, b = dr.select(seen.near, seen.on.triangle, own), dr.select(seen.near, seen.on.b, b)
        dr.scatter(triangle, own, k * count + lane)
        dr.scatter(weights, b, k * count + lane)
    dr.eval(triangle, weights)
    return several.starts_on(triangle, weights, touching, mesh, problem, most), complete, work
