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

Before a flat sheet nothing bends: what lies beyond its edge is mirrored in its plane (kernels.vertices.flatsheet).

Needs no star-shaped and no convex mirror. Fails where triangles are long: images of edges are straight. Shows second
bounces with `other_mirrors = "reflective"` alone, and none of a mirror in itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from benchharness.api import Frame, Knob, Method, Reflection
from benchharness.kernels import normalmap
from benchharness.kernels.frozen import frozen
from benchharness.kernels.vertices import (
    branches,
    mirrormesh,
    problems,
    scenery,
    several,
    sight,
    vertexwise,
    virtual,
    walks,
)
from benchharness.kernels.vertices.mirrormesh import MirrorMesh
from benchharness.scene import Scene


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
    family: ClassVar[str] = "moved vertices"
    paper: ClassVar[str] = "Jakob and Marschner 2012"
    limits: ClassVar[dict[str, str]] = {
        "F-15": "where two triangles' edges end in a third's, less than two pixels of bend open a crack between their images",
        "F-16": "images of two triangles are bent in depth too, and of thin layers either may come out nearer",
        "F-20, F-21": "half a focal length away roots lie so close that a search may stop beside the one it calls its own",
        "F-20": "one reflection per vertex is looked for, and nothing says that there are more; `multi` finds them",
        "F-21": "at a focus half vector and normal agree all over the mirror, and one root cannot be told from the next",
        "F-25, F-26": "on bumps, where two roots are about to meet, rounding moves the point that is found by pixels",
    }

    def refuses(self, scene: Scene) -> str | None:
        return normalmap.refusal(scene.reflectors)

    def prepare(self, scene: Scene) -> State:
        mirrors, searched = walks.mirrors_of(scene.reflectors)
        seeds = [
            several.seeds(r.mesh.vertices, r.mesh.normals, r.mesh.faces, backs=r.closed is None)
            if self.multi > 1 and not mesh.convex
            else None
            for r, mesh in zip(scene.reflectors, mirrors.meshes, strict=True)
        ]
        split_px = scenery.pixels(self.split_px, told=self.multi == 1)
        seen = scenery.of_scene(scene, searched, self.resolve, self.lod_px, split_px, mirrors.groups, self.other_mirrors)
        return State(seen, [], None, mirrors.meshes, seeds, mirrors.joined)

    def update(self, state: State, frame: Frame) -> State:
        return replace(state, scenery=scenery.posed(state.scenery, frame))

    def shade(self, state: State, frame: Frame) -> tuple[Reflection, State]:
        seen = state.scenery
        drawing = virtual.Drawing(self.hidden)
        mirrors = walks.Mirrors(state.mirrors, seen.groups, state.joined)

        def solve(g: int, problem: problems.Problem, last: walks.Ends) -> vertexwise.Solved:
            own = walks.meeting(mirrors, g, seen.objects, frame, self.self_reflection)
            i = seen.groups[g][0]
            mesh, seeds = state.mirrors[i], state.seeds[i]
            if seeds is None:
                return walks.solved(mirrors, g, problem, last, frame, own, drawing)
            back = virtual.nearest_back(frame.proxies[i], frame.poses, problem.part, frame.view) if seeds.closed else None
            hider = sight.Shadow(mesh, problem.pose)
            return branches.solved(_solve_several(problem, mesh, seeds, self.multi), hider, back, drawing, own)

        return vertexwise.shown(
            state,
            frame,
            solve,
            walks.Ends.cold,
            other_mirrors=self.other_mirrors,
            max_iter=self.max_iter,
            warm=self.warm,
            sheets=state.mirrors if self.multi == 1 else None,
        )


@frozen
def _solve_several(problem: problems.Problem, mesh: MirrorMesh, seeds: several.Seeds, multi: int) -> branches.Arranged:
    """Virtual vertices, triangles and what was found of several reflections per vertex."""
    starts = several.begin(seeds, mesh, problem, multi)
    ends = walks.ended(starts, mesh, problem)
    return branches.arranged(several.finish(ends, starts, mesh, problem, multi), mesh, problem, multi)
