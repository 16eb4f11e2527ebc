"""What methods share whose searches are Newton's walks: which mesh of a mirror is walked on, and what walks find of vertices.

All convex mirrors of a scene are searched together, each other one alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels import optics, placement
from benchharness.kernels.frozen import frozen
from benchharness.kernels.types import Frame, MeshLike, ReflectorLike, Vertices
from benchharness.kernels.vertices import branches, mirrormesh, newton, problems, search, several, sight, vertexwise, virtual
from benchharness.kernels.vertices.mirrormesh import MirrorMesh, SurfacePoint


@dataclass
class Ends:
    """Where the walks of a frame ended, per vertex: triangle, weights, and whether it is worth starting from."""

    on: SurfacePoint
    warm: mi.Bool

    @staticmethod
    def cold(count: int) -> Ends:
        return Ends(SurfacePoint(dr.zeros(mi.UInt32, count), dr.zeros(mi.Point2f, count)), dr.zeros(mi.Bool, count))


@dataclass
class Mirrors:
    """
    meshes  per reflector, the mesh that walks are on
    groups  numbers of the reflectors that are searched together
    joined  per group, the mirrors that it joins; None for one alone
    """

    meshes: list[MirrorMesh]
    groups: list[list[int]]
    joined: list[mirrormesh.Joined | None]


def mirrors_of(reflectors: Sequence[ReflectorLike]) -> tuple[Mirrors, list[MeshLike]]:
    """The mirrors of a scene, and the meshes of theirs that are searched."""
    both = [mesh_of(reflector) for reflector in reflectors]
    searched, meshes = [mesh for mesh, _ in both], [walked for _, walked in both]
    together = [i for i, mesh in enumerate(meshes) if mesh.convex]
    groups = [[i] for i, mesh in enumerate(meshes) if not mesh.convex or len(together) == 1]
    if len(together) > 1:
        groups.append(together)
    joined = [None if len(group) == 1 else _joined([searched[i] for i in group]) for group in groups]
    return Mirrors(meshes, groups, joined), searched


def _joined(meshes: list[MeshLike]) -> mirrormesh.Joined:
    return mirrormesh.joined([(mesh.vertices, mesh.normals, mesh.faces) for mesh in meshes])


def mesh_of(reflector: ReflectorLike) -> tuple[MeshLike, MirrorMesh]:
    """What is searched, and that ready to be walked on. The closed stand-in if it is convex: then it has no more reflections
    than the sheet that is seen, and no rim. Else the sheet: on a bowl's wall or the inside of a ring, walks would end on sides
    that the eye never sees."""
    sheet, closed = reflector.mesh, reflector.closed
    if closed is not None:
        solid = mirrormesh.build(closed.vertices, closed.normals, closed.faces)
        if solid.convex:
            return closed, solid
    return sheet, mirrormesh.build(sheet.vertices, sheet.normals, sheet.faces, backs=closed is None)


def meeting(mirrors: Mirrors, g: int, objects: int, frame: Frame, own: str) -> dict[int, branches.Own]:
    """What is asked where the mirrors of group g meet themselves. `objects`: how many parts are; `own`: "black" or
    "omitted"."""
    asked: dict[int, branches.Own] = {}
    for i in mirrors.groups[g]:
        pose = placement.pose_of(frame.poses, dr.opaque(mi.UInt32, objects + i))
        asked |= branches.meeting(i, mirrors.meshes[i], pose, own, frame.doubts)
    return asked


def solved(
    mirrors: Mirrors,
    g: int,
    problem: problems.Problem,
    last: Ends,
    frame: Frame,
    own: dict[int, branches.Own],
    drawing: virtual.Drawing,
) -> vertexwise.Solved:
    """The images in group g, one of each vertex at most. `last`: where walks of the same vertices ended; `own`: `meeting`."""
    i, joined = mirrors.groups[g][0], mirrors.joined[g]
    mesh = mirrors.meshes[i]
    mirror = mesh if joined is None else joined

    def find(asked: problems.Problem, start: Ends) -> problems.Found:
        return problems.Found(*_solve(asked, mirror, start, drawing.hidden))

    if joined is not None:
        assert problem.of_triangles is not None
        hider, back = sight.Shadows(joined, frame.poses, *problem.of_triangles), None
    else:
        hider = sight.Shadow(mesh, problem.pose)
        back = None
        if mesh.closed and not mesh.convex:
            back = virtual.nearest_back(frame.proxies[i], frame.poses, problem.part, frame.view)
    whole = (mesh.convex or problem.plane is not None) and drawing.hidden == "cut"
    return vertexwise.Solved(find(problem, last), drawing, hider, back, whole, own=own, further=find)


@frozen
def _solve(
    problem: problems.Problem, mirror: MirrorMesh | mirrormesh.Joined, last: Ends, hides: str
) -> tuple[virtual.Images, Vertices, Ends]:
    """Virtual vertices, what was found of each vertex, and where the walks ended. `hides`: as `virtual.Drawing.hidden`."""
    (_, V, active), pose, view, max_iter = problem.vertices(), problem.pose, problem.view, problem.max_iter
    if isinstance(mirror, MirrorMesh):
        mesh = mirror
    else:
        assert problem.mirror is not None
        mesh, pose = mirror.at(problem.mirror, pose)
    local = placement.mirror_frame(pose, V, view)

    # The mirror between eye and vertex hides it for certain if it is convex.
    seen = sight.look_at(mesh, local, active)
    shadow = seen.shadow
    searched = active & ~shadow if mesh.convex else mi.Bool(active)
    warm = last.warm & ~problems.was_cut(view, problem.last_view)
    first, promising = newton.best_candidate(mesh, local, searched & ~warm & ~seen.near, shadow)
    first = dr.select(seen.near, seen.on, dr.select(warm, last.on, first))
    searched &= warm | promising | seen.near
    walked = newton.walk(mesh, local, first, searched, max_iter, touches=seen.touches, briefly=shadow & ~warm)

    # What began warm and came to nothing begins anew: the last frame's point may be a root of another kind.
    lost = searched & warm & ~seen.near & ~walked.converged
    first, promising = newton.best_candidate(mesh, local, lost, shadow)
    searched &= ~lost | promising
    again = newton.walk(mesh, local, first, lost & promising, max_iter, briefly=shadow)
    iterations = walked.iterations + again.iterations
    walked = dr.select(lost & promising, again, walked)

    behind = shadow | ~searched | (dr.dot(local.V - walked.R, walked.n) <= 0)
    reflected = walked.converged | (searched & ~behind & (walked.residual < search.STRAY))
    hidden = active & behind & ~reflected
    R, n = placement.point_to_world(pose, walked.R), placement.normal_to_world(pose, walked.n)
    converged, free = walked.converged, None
    if not mesh.convex:
        # A root that the mirror hides from the eye is no reflection.
        free = ~reflected | sight.is_free(mesh, walked.R, walked.n, local.eye, reflected)
        converged = converged & free
    answer = problems.Answer(
        R=R,
        n=n,
        image=dr.select(reflected, optics.on_ray(V, R, view.eye), V),
        reflected=reflected,
        hidden=hidden,
        converged=converged,
        unsure=searched & ~converged,
        residual=walked.residual,
        iterations=iterations,
        free=free,
        flush=seen.touches if mesh.convex and hides == "cut" else None,
    )
    warm = reflected if free is None else reflected & free
    return *problems.images_of(problem, answer), Ends(walked.on, mi.Bool(warm))


def ended(starts: several.Starts, mesh: MirrorMesh, problem: problems.Problem) -> several.Ends:
    """Where the walks from several starts per vertex ended."""
    walked = newton.walk(mesh, starts.local, starts.on, starts.active, problem.max_iter, touches=starts.touches)
    return several.Ends(
        R=walked.R,
        n=walked.n,
        reflected=walked.converged,
        converged=walked.converged,
        residual=walked.residual,
        iterations=walked.iterations,
        on=walked.on,
    )
