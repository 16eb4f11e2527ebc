"""Newton's method on the mirror's mesh for each vertex's reflection point; the moved triangles are drawn.

For every vertex V, a walk over the mirror's triangles goes where half vector and interpolated normal agree, with the mesh's own
derivatives: kernels.newton. Nothing is precomputed but a hierarchy over the mirror alone, which moves with it.
After Jakob and Marschner 2012, "Manifold exploration", with the damping of Zeltner, Georgiev and Jakob 2020.

With `multi = 1`, finds one reflection per vertex: of several, the one that the walk comes to from the best of a few hundred
points of the mirror, or from the last frame's. A root that the mirror hides from the eye is no reflection. With more,
walks start from all points of the mirror that agree better than those around them, rays ask what the mirror hides, and
triangles join what belongs together (kernels.several, kernels.branches). Where the mirror meets itself it is black: one ray
per pixel of a mirror that is not convex (`self_reflection`). Of two reflections that are about to meet on a caustic, one may
be missed, and triangles that reach over the caustic are not drawn.

Needs no star-shaped and no convex mirror. Fails where triangles are long: images of edges are straight. Shows no second
bounce.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import drjit as dr
import mitsuba as mi
from pydantic import Field

from benchharness.api import Frame, Method, Reflection, Vertices, View
from benchharness.kernels import optics, placement
from benchharness.kernels.frozen import frozen
from benchharness.kernels.vertices import branches, newton, search, several, vertexwise, virtual
from benchharness.scene import Reflector, Scene


@dataclass
class Ends:
    """Where the walks of a frame ended, per vertex: triangle, weights, and whether it is worth starting from."""

    on: newton.Where
    warm: mi.Bool

    @staticmethod
    def cold(count: int) -> Ends:
        return Ends(newton.Where(dr.zeros(mi.UInt32, count), dr.zeros(mi.Point2f, count)), dr.zeros(mi.Bool, count))


@dataclass
class State:
    """
    seeds  per reflector, where the walks for several reflections may start; None where there is one at most
    ends   per reflector, where the last walks ended; None for those
    view   the camera of the last frame
    """

    scenery: vertexwise.Scenery
    mirrors: list[newton.Mesh]
    seeds: list[several.Seeds | None]
    ends: list[Ends | None]
    view: View | None


@dataclass(frozen=True)
class Newton(Method):
    """
    warm      start where the last frame's walk ended, and anew where that leads nowhere
    hidden    triangles with hidden vertices: "cut" where they become hidden, or "drop"
    other_mirrors    other mirrors in this one: "black", or "omitted" to show what is behind them
    self_reflection  the mirror in itself, where it is not convex: "black", which takes one ray per pixel of it, or "omitted"
    max_iter  points after which a walk gives up
    multi     reflections per vertex that are found and drawn; with more than one, every walk is a cold one
    """

    warm: bool = True
    hidden: Literal["cut", "drop"] = "cut"
    other_mirrors: Literal["black", "omitted"] = "black"
    self_reflection: Literal["black", "omitted"] = "black"
    max_iter: Annotated[int, Field(ge=1, le=65536)] = 60
    multi: Annotated[int, Field(ge=1, le=8)] = 1

    paper: ClassVar[str] = "Jakob and Marschner 2012"
    limits: ClassVar[dict[str, str]] = {
        "F-15": "where two triangles' edges end in a third's, less than two pixels of bend open a crack between their images",
        "F-16": "images of two triangles are bent in depth too, and of thin layers either may come out nearer",
        "F-20, F-21": "half a focal length away roots lie so close that a search may stop beside the one it calls its own",
        "F-20": "one reflection per vertex is looked for, and nothing says that there are more; `multi` finds them",
        "F-21": "at a focus half vector and normal agree all over the mirror, and one root cannot be told from the next",
        "F-25, F-26": "on bumps, where two roots are about to meet, rounding moves the point that is found by pixels",
    }

    def prepare(self, scene: Scene) -> State:
        mirrors = [_mesh(reflector) for reflector in scene.reflectors]
        seeds = [
            several.seeds(r.mesh.vertices, r.mesh.normals, r.mesh.faces, backs=r.closed is None)
            if self.multi > 1 and not mesh.convex
            else None
            for r, mesh in zip(scene.reflectors, mirrors, strict=True)
        ]
        return State(vertexwise.scenery(scene), mirrors, seeds, [], None)

    def update(self, state: State, frame: Frame) -> State:
        return replace(state, scenery=vertexwise.posed(state.scenery, frame))

    def shade(self, state: State, frame: Frame) -> tuple[Reflection, State]:
        warm = self.warm and state.view is not None
        seen = state.scenery
        count, shown_parts = seen.triangles.vertex_count, seen.parts_shown(self.other_mirrors)
        max_iter = dr.opaque(mi.UInt32, self.max_iter)
        doubted = dr.opaque(mi.UInt32, seen.objects) if frame.doubts else None

        def solve(i: int, part: mi.UInt32) -> vertexwise.Solved:
            mesh, seeds, pose = state.mirrors[i], state.seeds[i], placement.pose_of(frame.poses, part)
            own = branches.meeting(mesh, pose, self.self_reflection, frame.doubts)
            if seeds is not None:
                made = _solve_several(
                    seen.world, shown_parts, mesh, seeds, pose, part, frame.view, self.multi, max_iter, doubted
                )
                return branches.solved(made, mesh, seeds, pose, frame, i, part, self.hidden, own)
            images, end, report = _solve(
                seen.world.points, shown_parts, mesh, pose, part, frame.view,
                state.view if warm else frame.view, state.ends[i] if warm else Ends.cold(count), count, max_iter, doubted,
                self.hidden == "cut",
            )  # fmt: skip
            behind = mesh.closed and not mesh.convex
            back = virtual.nearest_back(frame.proxies[i], frame.poses, part, frame.view) if behind else None
            drawing, whole = virtual.Drawing(self.hidden, behind=behind), mesh.convex and self.hidden == "cut"
            return vertexwise.Solved(images, end, report, drawing, newton.Shadow(mesh, pose), back, whole, own=own)

        shown = vertexwise.shown(seen, frame, solve)
        if self.multi == 1:
            shown.report["valid"] = several.valid(state.mirrors, seen.objects, frame, seen.world.points, shown.report)
        vertices = Vertices(**shown.report, further=[Vertices(**report) for report in shown.further])
        reflection = Reflection(shown.L, shown.distance, shown.found, vertices, shown.counters, shown.doubt)
        return reflection, replace(state, ends=shown.ends, view=frame.view)


def _mesh(reflector: Reflector) -> newton.Mesh:
    """The closed stand-in if it is convex: then it has no more reflections than the sheet that is seen, and no rim. Else the
    sheet: on a bowl's wall or the inside of a ring, walks would end on sides that the eye never sees."""
    sheet, closed = reflector.mesh, reflector.closed
    if closed is not None:
        solid = newton.mesh(closed.vertices, closed.normals, closed.faces)
        if solid.convex:
            return solid
    return newton.mesh(sheet.vertices, sheet.normals, sheet.faces, backs=closed is None)


@frozen
def _solve(
    points, shown_parts, mesh: newton.Mesh, pose: list, part, view: View, last_view: View, last: Ends, count: int, max_iter,
    doubted, cuts: bool,
):  # fmt: skip
    """Virtual vertices, where the walks ended, and what is reported of each vertex. `doubted`: parts from this number on are
    mirrors, None where no doubt is asked for."""
    lane, V, active = vertexwise.vertices(points, part, shown_parts, count)
    where = placement.place(pose, V, view)

    # The mirror between eye and vertex hides it for certain if it is convex.
    sight = newton.look_at(mesh, where, active)
    shadow = sight.shadow
    searched = active & ~shadow if mesh.convex else mi.Bool(active)
    warm = last.warm & ~vertexwise.was_cut(view, last_view)
    first, promising = newton.best_candidate(mesh, where, searched & ~warm & ~sight.near, shadow)
    first = dr.select(sight.near, sight.on, dr.select(warm, last.on, first))
    searched &= warm | promising | sight.near
    walked = newton.walk(mesh, where, first, searched, max_iter, sight.touches, shadow & ~warm)

    # What began warm and came to nothing begins anew: the last frame's point may be a root of another kind.
    lost = searched & warm & ~sight.near & ~walked.converged
    first, promising = newton.best_candidate(mesh, where, lost, shadow)
    searched &= ~lost | promising
    again = newton.walk(mesh, where, first, lost & promising, max_iter, False, shadow)
    iterations = walked.iterations + again.iterations
    walked = dr.select(lost & promising, again, walked)

    behind = shadow | ~searched | (dr.dot(where.V - walked.R, walked.n) <= 0)
    reflected = walked.converged | (searched & ~behind & (walked.residual < search.STRAY))
    hidden = active & behind & ~reflected
    R, n = placement.point_to_world(pose, walked.R), placement.normal_to_world(pose, walked.n)
    image = dr.select(reflected, optics.on_ray(V, R, view.eye), V)
    kind, region = vertexwise.kinds(reflected, hidden)
    if mesh.convex and cuts:
        # What lies flush with a convex mirror is its own image, before it or in it: only triangles that leave it have one.
        kind = dr.select(sight.touches & reflected, mi.Float(virtual.HIDDEN), kind)
    images = virtual.Images(vertexwise.packets(image, kind, lane, count), vertexwise.packets(R, mi.Float(0), lane, count))
    converged = walked.converged
    if not mesh.convex:
        # A root that the mirror hides from the eye is no reflection.
        images.seen = ~reflected | several.is_free(mesh, walked.R, walked.n, where.eye, reflected)
        reflected, converged = reflected & images.seen, converged & images.seen
        region = dr.select(images.seen, region, vertexwise.UNKNOWN)
    if doubted is not None:
        images.sure = vertexwise.sureness(n, searched & ~converged, points, lane, doubted, count)
    report = {
        "R": R, "n": n, "virtual": mi.Point3f(image), "converged": converged, "valid": mi.Bool(converged),
        "region": region, "iterations": iterations, "residual": walked.residual, "border": dr.zeros(mi.Bool, count),
    }  # fmt: skip
    return images, Ends(walked.on, mi.Bool(reflected)), report


@frozen
def _solve_several(
    world, shown_parts, mesh: newton.Mesh, seeds, pose: list, part, view: View, multi: int, max_iter, doubted=None
):  # fmt: skip
    """Virtual vertices, triangles and reports of several reflections per vertex."""
    starts = several.begin(seeds, mesh, pose, view, world.points, part, shown_parts, world.vertex_count, multi)
    walked = newton.walk(mesh, starts.where, starts.on, starts.active, max_iter, starts.touches)
    ends = several.Ends(
        walked.R, walked.n, walked.converged, walked.converged, walked.residual, walked.iterations, walked.on
    )  # fmt: skip
    found = several.finish(ends, starts, mesh, pose, view, world.vertex_count, multi)
    return branches.arranged(found, mesh, pose, world, part, shown_parts, view, multi, doubted)
