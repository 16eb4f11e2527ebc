"""Newton's method on the mirror's mesh for each vertex's reflection point; the moved triangles are drawn.

For every vertex V, a walk over the mirror's triangles goes where half vector and interpolated normal agree, with the mesh's own
derivatives: kernels.vertices.newton. Nothing is precomputed but a hierarchy over the mirror alone, which moves with it.
After Jakob and Marschner 2012, "Manifold exploration", with the damping of Zeltner, Georgiev and Jakob 2020.

With `multi = 1`, finds one reflection per vertex: of several, the one that the walk comes to from the best of a few hundred
points of the mirror, or from the last frame's. A root that the mirror hides from the eye is no reflection. With more,
walks start from all points of the mirror that agree better than those around them, rays ask what the mirror hides, and
triangles join what belongs together (kernels.vertices.several, .branches). Where the mirror meets itself it is black: one ray
per pixel of a mirror that is not convex (`self_reflection`). Of two reflections that are about to meet on a caustic, one may
be missed, and triangles that reach over the caustic are not drawn.

Needs no star-shaped and no convex mirror. Fails where triangles are long: images of edges are straight. Shows second
bounces with `other_mirrors = "reflective"` alone, and none of a mirror in itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import drjit as dr
import mitsuba as mi
from pydantic import Field

from benchharness.api import Frame, Knob, Method, Reflection, Vertices
from benchharness.kernels import optics, placement
from benchharness.kernels.frozen import frozen
from benchharness.kernels.vertices import (
    branches,
    mirrormesh,
    newton,
    problems,
    scenery,
    search,
    several,
    sight,
    vertexwise,
    virtual,
)
from benchharness.kernels.vertices.mirrormesh import MirrorMesh, SurfacePoint
from benchharness.scene import Mesh, Reflector, Scene


@dataclass
class Ends:
    """Where the walks of a frame ended, per vertex: triangle, weights, and whether it is worth starting from."""

    on: SurfacePoint
    warm: mi.Bool

    @staticmethod
    def cold(count: int) -> Ends:
        return Ends(SurfacePoint(dr.zeros(mi.UInt32, count), dr.zeros(mi.Point2f, count)), dr.zeros(mi.Bool, count))


@dataclass
class State(vertexwise.State):
    """
    mirrors  per reflector, the mesh that walks are on
    seeds    per reflector, where the walks for several reflections may start; None where there is one at most
    joined   per group of reflectors, the mirrors that it joins; None for one alone
    """

    mirrors: list[MirrorMesh]
    seeds: list[several.Seeds | None]
    joined: list[mirrormesh.Joined | None]


@dataclass(frozen=True)
class Newton(Method):
    """
    warm      start where the last frame's walk ended, and anew where that leads nowhere
    hidden    triangles with hidden vertices: "cut" where they become hidden, or "drop"
    other_mirrors    other mirrors in this one: "black"; "reflective", which "ray" is needed for (kernels.vertices.higherorder);
              or "omitted" to show what is behind them
    self_reflection  the mirror in itself, where it is not convex: "black", which takes one ray per pixel of it, or "omitted"
    max_iter  points after which a walk gives up
    multi     reflections per vertex that are found and drawn; with more than one, every walk is a cold one
    resolve   what a pixel shows: "interpolate" between the corners of the triangle that covers it, or what its own "ray" meets
              of the triangles that it and the pixels around it name (kernels.vertices.exact)
    lod_px    levels of detail: of every part the coarsest whose error is seen no larger than this in a mirror, pixels;
              0 for none. Only with "ray", which shows the part itself and not what stands for it
    split_px  edges are split whose images are off a straight line by more than this, pixels (kernels.vertices.tessellation);
              0 for none. None: 0.5, and none where `multi` is more than 1, with which no edge can be split
    """

    warm: bool = True
    hidden: Literal["cut", "drop"] = "cut"
    other_mirrors: Literal["black", "reflective", "omitted"] = "black"
    self_reflection: Literal["black", "omitted"] = "black"
    max_iter: Annotated[int, Field(ge=1, le=65536)] = 60
    multi: Annotated[int, Field(ge=1, le=8)] = 1
    resolve: Literal["interpolate", "ray"] = "interpolate"
    lod_px: Annotated[float, Field(ge=0, le=1e3)] = 0.0
    split_px: Annotated[float, Field(ge=0, le=1e3)] | None = None

    def __post_init__(self) -> None:
        scenery.check(self.resolve, self.lod_px, self.split_px, self.multi, "newton", self.other_mirrors)

    knobs: ClassVar[tuple[Knob, ...]] = (
        Knob("split_px", (16.0, 4.0, 2.0, 1.0, 0.5, 0.25)),
        Knob("split_px", (64.0, 16.0, 4.0, 1.0), {"resolve": "ray"}),
        Knob("lod_px", (16.0, 4.0, 1.0, 0.0), {"resolve": "ray", "split_px": 1.0}),
        Knob("multi", (1, 2, 4), split=True),
    )
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
        meshes = [_mesh(reflector) for reflector in scene.reflectors]
        searched, mirrors = [mesh for mesh, _ in meshes], [walked for _, walked in meshes]
        seeds = [
            several.seeds(r.mesh.vertices, r.mesh.normals, r.mesh.faces, backs=r.closed is None)
            if self.multi > 1 and not mesh.convex
            else None
            for r, mesh in zip(scene.reflectors, mirrors, strict=True)
        ]
        together = [i for i, mesh in enumerate(mirrors) if mesh.convex]
        groups = [[i] for i, mesh in enumerate(mirrors) if not mesh.convex or len(together) == 1]
        if len(together) > 1:
            groups.append(together)
        joined = [None if len(group) == 1 else _joined([searched[i] for i in group]) for group in groups]
        seen = scenery.of_scene(
            scene,
            searched,
            self.resolve,
            self.lod_px,
            scenery.pixels(self.split_px, told=self.multi == 1),
            groups,
            self.other_mirrors,
        )
        return State(seen, [], None, mirrors, seeds, joined)

    def update(self, state: State, frame: Frame) -> State:
        return replace(state, scenery=scenery.posed(state.scenery, frame))

    def shade(self, state: State, frame: Frame) -> tuple[Reflection, State]:
        seen = state.scenery
        drawing = virtual.Drawing(self.hidden)

        def solve(g: int, problem: problems.Problem, last: Ends) -> vertexwise.Solved:
            group, joined, own = seen.groups[g], state.joined[g], {}
            for i in group:
                pose = placement.pose_of(frame.poses, dr.opaque(mi.UInt32, seen.objects + i))
                own |= branches.meeting(i, state.mirrors[i], pose, self.self_reflection, frame.doubts)
            i, pose = group[0], problem.pose
            mesh, seeds = state.mirrors[i], state.seeds[i]
            mirror = mesh if joined is None else joined

            def find(asked: problems.Problem, start: Ends) -> problems.Found:
                return problems.Found(*_solve(asked, mirror, start, self.hidden))

            if joined is not None:
                assert problem.of_triangles is not None
                hider, back = sight.Shadows(joined, frame.poses, *problem.of_triangles), None
            else:
                hider = sight.Shadow(mesh, pose)
                closed = mesh.closed and not mesh.convex if seeds is None else seeds.closed
                back = virtual.nearest_back(frame.proxies[i], frame.poses, problem.part, frame.view) if closed else None
            if seeds is not None:
                return branches.solved(_solve_several(problem, mesh, seeds, self.multi), hider, back, drawing, own)
            whole = mesh.convex and self.hidden == "cut"
            return vertexwise.Solved(find(problem, last), drawing, hider, back, whole, own=own, further=find)

        return vertexwise.shown(
            state,
            frame,
            solve,
            Ends.cold,
            other_mirrors=self.other_mirrors,
            max_iter=self.max_iter,
            warm=self.warm,
            sheets=state.mirrors if self.multi == 1 else None,
        )


def _joined(meshes: list[Mesh]) -> mirrormesh.Joined:
    return mirrormesh.joined([(mesh.vertices, mesh.normals, mesh.faces) for mesh in meshes])


def _mesh(reflector: Reflector) -> tuple[Mesh, MirrorMesh]:
    """What is searched, and that ready to be walked on. The closed stand-in if it is convex: then it has no more reflections
    than the sheet that is seen, and no rim. Else the sheet: on a bowl's wall or the inside of a ring, walks would end on sides
    that the eye never sees."""
    sheet, closed = reflector.mesh, reflector.closed
    if closed is not None:
        solid = mirrormesh.build(closed.vertices, closed.normals, closed.faces)
        if solid.convex:
            return closed, solid
    return sheet, mirrormesh.build(sheet.vertices, sheet.normals, sheet.faces, backs=closed is None)


@frozen
def _solve(
    problem: problems.Problem, mirror: MirrorMesh | mirrormesh.Joined, last: Ends, hides: str
) -> tuple[virtual.Images, Vertices, Ends]:
    """Virtual vertices, what was found of each vertex, and where the walks ended. `hides`: as `Newton.hidden` has it."""
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


@frozen
def _solve_several(problem: problems.Problem, mesh: MirrorMesh, seeds: several.Seeds, multi: int) -> branches.Arranged:
    """Virtual vertices, triangles and what was found of several reflections per vertex."""
    starts = several.begin(seeds, mesh, problem, multi)
    walked = newton.walk(mesh, starts.local, starts.on, starts.active, problem.max_iter, touches=starts.touches)
    ends = several.Ends(
        R=walked.R,
        n=walked.n,
        reflected=walked.converged,
        converged=walked.converged,
        residual=walked.residual,
        iterations=walked.iterations,
        on=walked.on,
    )
    return branches.arranged(several.finish(ends, starts, mesh, problem, multi), mesh, problem, multi)
