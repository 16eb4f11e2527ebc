"""Specular polynomials: all reflection points of every vertex, from bounds of polynomials; the moved triangles are drawn.

On a triangle whose normals are interpolated and not normalised, the law of reflection is a system of polynomials in two
weights. Its roots on all triangles are all reflection points of the mirror, whether the light's path is shortest, longest or
neither there, and however close to one another: nothing has to be started from, and nothing to be remembered from the last
frame. Paper: Fan, Guo, Wang, Xiao, Zhang, Zhou, Chen, Hong, Guo, Yan, "Specular polynomials", SIGGRAPH 2024, for one bounce.

Where we differ: the paper eliminates one weight by a resultant, a polynomial of degree 8, for every triangle that it asks.
Where eye and vertex lie in one direction along the normal of a ball or a plane, nothing can be eliminated; so roots are
isolated by bounds in Bernstein's basis instead, which most triangles fail at once (kernels.vertices.polynomial). Others are
ruled out by cones of half vectors and of normals (.cones, .complete). Each root is handed to Newton's method on the normalised
law, which has arrived there already.

Up to `multi` reflections of a vertex are drawn, first those that the mirror hides neither from the eye nor from the vertex, as
by other methods with `multi` (.several, .branches); a mirror that is convex shows one. Where a vertex lies close to the mirror,
the point behind it is asked too. What has not converged: vertices with more reflections than there is room for, and those
with more triangles, or parts of them, than are looked into, as at a focus.

Where the mirror meets itself it is black: one ray per pixel of a mirror that is not convex (`self_reflection`). Triangles that
reach over a caustic are not drawn. Shows no second bounce. Fails where triangles are long in a mirror that is not convex:
images of edges are straight. Costs a pass over the mirror's groups of triangles for every vertex and frame.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import drjit as dr
import mitsuba as mi
from pydantic import Field

from benchharness.api import Frame, Knob, Method, Reflection, Vertices
from benchharness.kernels import normalmap, placement
from benchharness.kernels.frozen import frozen
from benchharness.kernels.vertices import (
    branches,
    complete,
    cones,
    newton,
    problems,
    scenery,
    search,
    several,
    sight,
    single,
    vertexwise,
    virtual,
    walks,
)
from benchharness.kernels.vertices.mirrormesh import MirrorMesh
from benchharness.scene import Scene

STEPS = 60  # of Newton's method; where it starts from a root, one or two
OF_CONVEX = 2  # roots of a convex mirror's mesh, whose normals are smoother than its facets, that are chosen from
ROOM_OF_CONVEX = 8  # triangles


@dataclass
class State(vertexwise.State):
    """`mirrors`, `grouped`: per reflector, the mesh and its clusters."""

    mirrors: list[MirrorMesh]
    grouped: list[cones.Clusters]


@dataclass
class Ends:
    """Whether a vertex has an image. The next frame asks for nothing of the last one."""

    shown: mi.Bool

    @staticmethod
    def cold(count: int) -> Ends:
        return Ends(dr.zeros(mi.Bool, count))


@dataclass(frozen=True)
class SpecularPolynomial(Method):
    """
    multi     reflections per vertex that are drawn, in a mirror that is not convex; all are found
    hidden    triangles with hidden vertices: "cut" where they become hidden, or "drop"
    other_mirrors    other mirrors in this one: "black", or "omitted" to show what is behind them
    self_reflection  the mirror in itself, where it is not convex: "black", which takes one ray per pixel of it, or "omitted"
    resolve   what a pixel shows: "interpolate" between the corners of the triangle that covers it, or what its own "ray" meets
              of the triangles that it and the pixels around it name (kernels.vertices.exact)
    lod_px    levels of detail: of every part the coarsest whose error is seen no larger than this in a mirror, pixels;
              0 for none. Only with "ray", which shows the part itself and not what stands for it
    split_px  edges are split whose images in a convex mirror are off a straight line by more than this, pixels
              (kernels.vertices.tessellation); 0 for none. In others, where a vertex may have several images, none is
    """

    multi: Annotated[int, Field(ge=1, le=8)] = 4
    hidden: Literal["cut", "drop"] = "cut"
    other_mirrors: Literal["black", "omitted"] = "black"
    self_reflection: Literal["black", "omitted"] = "black"
    resolve: Literal["interpolate", "ray"] = "interpolate"
    lod_px: Annotated[float, Field(ge=0, le=1e3)] = 0.0
    split_px: Annotated[float, Field(ge=0, le=1e3)] = scenery.SPLIT_PX

    knobs: ClassVar[tuple[Knob, ...]] = (
        Knob("multi", (1, 2, 4), split=True),
        Knob("split_px", (16.0, 4.0, 2.0, 1.0, 0.5, 0.25)),
    )
    family: ClassVar[str] = "moved vertices"
    paper: ClassVar[str] = "Fan et al. 2024"
    limits: ClassVar[dict[str, str]] = {
        "F-15": "where two triangles' edges end in a third's, less than two pixels of bend open a crack between their images",
        "F-16": "images of two triangles are bent in depth too, and of thin layers either may come out nearer",
        "F-21": "at a focus half vector and normal agree all over the mirror, and one root cannot be told from the next",
    }

    def __post_init__(self) -> None:
        scenery.check(self.resolve, self.lod_px, None, self.multi, "specular_polynomial")

    def refuses(self, scene: Scene) -> str | None:
        return normalmap.refusal(scene.reflectors)

    def prepare(self, scene: Scene) -> State:
        meshes, mirrors = zip(*map(walks.mesh_of, scene.reflectors), strict=True)
        grouped = [
            cones.clusters(mesh.vertices, mesh.normals, mesh.faces, reflector.closed is None)
            for mesh, reflector in zip(meshes, scene.reflectors, strict=True)
        ]
        seen = scenery.of_scene(scene, meshes, self.resolve, self.lod_px, self.split_px)
        return State(seen, [], None, list(mirrors), grouped)

    def update(self, state: State, frame: Frame) -> State:
        return replace(state, scenery=scenery.posed(state.scenery, frame))

    def shade(self, state: State, frame: Frame) -> tuple[Reflection, State]:
        drawing = virtual.Drawing(self.hidden)

        def solve(i: int, problem: problems.Problem, last: Ends) -> vertexwise.Solved:
            mesh, grouped, pose = state.mirrors[i], state.grouped[i], problem.pose
            own = branches.meeting(i, mesh, pose, self.self_reflection, frame.doubts)
            hider = sight.Shadow(mesh, pose)
            if not mesh.convex:
                back = virtual.nearest_back(frame.proxies[i], frame.poses, problem.part, frame.view) if mesh.closed else None
                made = _solve_several(problem, mesh, grouped, self.multi)
                return branches.solved(made, hider, back, drawing, own)

            def find(asked: problems.Problem, start: Ends) -> problems.Found:
                return problems.Found(*_solve(asked, mesh, grouped, self.hidden))

            whole = self.hidden == "cut"
            return vertexwise.Solved(find(problem, last), drawing, hider, None, whole, own=own, further=find)

        return vertexwise.shown(
            state,
            frame,
            solve,
            Ends.cold,
            other_mirrors=self.other_mirrors,
            max_iter=STEPS,
            warm=False,
            sheets=None,
        )


@frozen
def _solve(
    problem: problems.Problem, mesh: MirrorMesh, grouped: cones.Clusters, hides: str
) -> tuple[virtual.Images, Vertices, Ends]:
    """Virtual vertices, what was found of each vertex, and which have an image, in a convex mirror."""
    _, V, active = problem.vertices()
    local = placement.mirror_frame(problem.pose, V, problem.view)
    seen = sight.look_at(mesh, local, active)
    searched = active & ~seen.shadow
    found = complete.roots(grouped, mesh, problem, searched & ~seen.near, OF_CONVEX, ROOM_OF_CONVEX)
    none = found.count == 0
    first, steepest = newton.best_candidate(mesh, local, searched & none & ~seen.near)[0], mi.Float(-1)
    for k, on in enumerate(found.on):
        at = newton.newton_step(mesh, local, on, searched & (k < found.count))
        cosine = dr.dot(dr.normalize(local.eye - at.P), at.N)
        better = (k < found.count) & (cosine > steepest)
        first, steepest = dr.select(better, on, first), dr.select(better, cosine, steepest)
    first = dr.select(seen.near, seen.on, first)
    walked = newton.walk(mesh, local, first, searched, problem.max_iter, touches=seen.touches)
    end = single.Ended(
        R=walked.R,
        n=walked.n,
        searched=searched,
        hidden=seen.shadow | ~searched | (dr.dot(local.V - walked.R, walked.n) <= 0),
        near=walked.residual < search.STRAY,
        converged=walked.converged,
        residual=walked.residual,
        iterations=walked.iterations,
    )
    images, vertices, shown = single.images_of(problem, end, seen, None, flush=hides == "cut")
    return images, vertices, Ends(shown)


@frozen
def _solve_several(problem: problems.Problem, mesh: MirrorMesh, grouped: cones.Clusters, multi: int) -> branches.Arranged:
    """Virtual vertices, triangles and what was found of several reflections per vertex."""
    starts, whole, work = complete.begin(grouped, mesh, problem, multi)
    ends = walks.ended(starts, mesh, problem)
    made = branches.arranged(several.finish(ends, starts, mesh, problem, multi), mesh, problem, multi)
    made.vertices.converged &= whole
    made.counters["parts"] = work
    return made
