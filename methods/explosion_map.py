"""Explosion map: each vertex is looked up in a map of where the mirror sends the eye's rays; the moved triangles are drawn.

For every frame and mirror, the eye's rays through the mirror's vertices are reflected and met with a sphere about the mirror.
Where they arrive, as directions from the centre, the mirror's triangles are rasterized; a vertex of the scene finds its
triangle by its own direction from the centre, and the reflection point between the triangle's corners. Paper: Ofek, Rappoport,
"Interactive reflections on curved objects", SIGGRAPH 1998; written from what others tell of it (kernels.vertices.explosion).

Assumes that everything lies on the sphere, `radius` times as large as the mirror: what lies nearer or farther is shown where
something on the sphere, in the same direction, would be. Nothing is iterated; what is shown depends on the frame alone. Where
texels of the map are wide, a vertex finds a triangle beside its own, and near the map's rim none.

The point found is asked for Newton's next step: where that is not short, the vertex has not converged; most have not.
The paper mirrors a vertex in the plane of point and normal (`placement = "plane"`), which takes it off the eye's ray through
the point; "on_ray" keeps it there. One ray from the eye asks whether the mirror hides a vertex; what has no triangle in the
map counts as hidden too. Mirrors that are hollow anywhere are refused: there, rays cross before the sphere, and a direction
has several triangles. Shows no second bounce. Fails where triangles are long: images of edges are straight.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import drjit as dr
import mitsuba as mi
import numpy as np
from pydantic import Field

from benchharness.api import Frame, Knob, Method, Reflection, Vertices, View
from benchharness.kernels import normalmap, placement
from benchharness.kernels.frozen import frozen
from benchharness.kernels.vertices import (
    branches,
    explosion,
    mirrormesh,
    newton,
    problems,
    scenery,
    sight,
    single,
    vertexwise,
    virtual,
)
from benchharness.kernels.vertices.mirrormesh import MirrorMesh
from benchharness.scene import Mesh, Reflector, Scene


@dataclass
class Mirror:
    """One reflector: its mesh, how many vertices and triangles that has, the sphere about it, its map's
    texels."""

    mesh: MirrorMesh
    vertex_count: int
    face_count: int
    sphere: explosion.Sphere
    texels: View


@dataclass
class State(vertexwise.State):
    """`mirrors`: per reflector, what is searched."""

    mirrors: list[Mirror]


@dataclass
class Ends:
    """Whether a vertex has an image. The next frame asks for nothing of the last one."""

    shown: mi.Bool

    @staticmethod
    def cold(count: int) -> Ends:
        return Ends(dr.zeros(mi.Bool, count))


@dataclass(frozen=True)
class ExplosionMap(Method):
    """
    resolution  texels along each side of the map
    radius      of the sphere, in radii of the smallest one about the mirror's centre that holds the mirror
    placement   where images go: behind the point that was found, "on_ray" of the eye, or mirrored in the "plane" there, as in
                the paper
    hidden      triangles with hidden vertices: "cut" where they become hidden, or "drop"
    other_mirrors    other mirrors in this one: "black"; "reflective", which "ray" is needed for (kernels.vertices.higherorder);
                or "omitted" to show what is behind them
    self_reflection  the mirror in itself, where it is not convex: "black", which takes one ray per pixel of it, or "omitted"
    resolve     what a pixel shows: "interpolate" between the corners of the triangle that covers it, or what its own "ray"
                meets of the triangles that it and the pixels around it name (kernels.vertices.exact)
    lod_px      levels of detail: of every part the coarsest whose error is seen no larger than this in a mirror, pixels;
                0 for none. Only with "ray", which shows the part itself and not what stands for it
    split_px    edges are split whose images are off a straight line by more than this, pixels; 0 for none, since images
                are off themselves (kernels.vertices.tessellation)
    """

    resolution: Annotated[int, Field(ge=8, le=8192)] = 512
    radius: Annotated[float, Field(gt=1, le=1e4)] = 3.0
    placement: Literal["on_ray", "plane"] = "on_ray"
    hidden: Literal["cut", "drop"] = "cut"
    other_mirrors: Literal["black", "reflective", "omitted"] = "black"
    self_reflection: Literal["black", "omitted"] = "black"
    resolve: Literal["interpolate", "ray"] = "interpolate"
    lod_px: Annotated[float, Field(ge=0, le=1e3)] = 0.0
    split_px: Annotated[float, Field(ge=0, le=1e3)] = 0.0

    knobs: ClassVar[tuple[Knob, ...]] = (Knob("resolution", (64, 128, 256, 512, 1024), split=True),)
    family: ClassVar[str] = "moved vertices"
    paper: ClassVar[str] = "Ofek and Rappoport 1998"
    limits: ClassVar[dict[str, str]] = {
        "F-15": "where two triangles' edges end in a third's, less than two pixels of bend open a crack between their images",
        "F-16": "images of two triangles are bent in depth too, and of thin layers either may come out nearer",
    }

    def __post_init__(self) -> None:
        scenery.check(self.resolve, self.lod_px, self.split_px, 1, "explosion_map", self.other_mirrors)

    def refuses(self, scene: Scene) -> str | None:
        for reflector in scene.reflectors:
            if not scenery.nowhere_hollow(_mesh(reflector)):
                return (
                    f"reflector {reflector.name}: it is hollow somewhere; accepted: a mirror that bulges or is flat everywhere"
                )
        return normalmap.refusal(scene.reflectors)

    def prepare(self, scene: Scene) -> State:
        mirrors, searched = [], [_mesh(reflector) for reflector in scene.reflectors]
        for reflector, mesh in zip(scene.reflectors, searched, strict=True):
            walked = mirrormesh.build(mesh.vertices, mesh.normals, mesh.faces, backs=reflector.closed is None)
            middle = 0.5 * (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))
            around = float(np.linalg.norm(mesh.vertices - middle, axis=1).max())
            sphere = explosion.Sphere(mi.Point3f(middle.tolist()), mi.Float(self.radius * around))
            dr.make_opaque(sphere)
            mirrors.append(Mirror(walked, len(mesh.vertices), len(mesh.faces), sphere, explosion.view(self.resolution)))
        seen = scenery.of_scene(scene, searched, self.resolve, self.lod_px, self.split_px, others=self.other_mirrors)
        return State(seen, [], None, mirrors)

    def update(self, state: State, frame: Frame) -> State:
        return replace(state, scenery=scenery.posed(state.scenery, frame))

    def shade(self, state: State, frame: Frame) -> tuple[Reflection, State]:
        drawing = virtual.Drawing(self.hidden)

        def solve(i: int, problem: problems.Problem, last: Ends) -> vertexwise.Solved:
            mirror, pose = state.mirrors[i], problem.pose
            mesh = mirror.mesh
            own = branches.meeting(i, mesh, pose, self.self_reflection, frame.doubts)
            eye = placement.mirror_frame(pose, mi.Point3f(0), problem.view).eye
            made = explosion.exploded(mesh, mirror.vertex_count, mirror.face_count, mirror.sphere, eye, mirror.texels)
            hides = mesh.convex and self.hidden == "cut"

            def find(asked: problems.Problem, start: Ends) -> problems.Found:
                return problems.Found(*_solve(asked, mesh, made, self.placement, hides))

            return vertexwise.Solved(find(problem, last), drawing, sight.Shadow(mesh, pose), None, hides, own=own, further=find)

        return vertexwise.shown(
            state,
            frame,
            solve,
            Ends.cold,
            other_mirrors=self.other_mirrors,
            max_iter=1,
            warm=False,
            sheets=[mirror.mesh for mirror in state.mirrors],
        )


def _mesh(reflector: Reflector) -> Mesh:
    """What is searched: the closed stand-in if that is convex, else the sheet that is seen."""
    closed = reflector.closed
    return closed if closed is not None and mirrormesh.is_convex(closed.vertices, closed.faces) else reflector.mesh


@frozen
def _solve(
    problem: problems.Problem, mesh: MirrorMesh, made: explosion.ExplosionMap, placed: str, hides: bool
) -> tuple[virtual.Images, Vertices, Ends]:
    """Virtual vertices, what was found of each vertex, and which have an image."""
    _, V, active = problem.vertices()
    local = placement.mirror_frame(problem.pose, V, problem.view)
    seen = sight.look_at(mesh, local, active)
    searched = active & ~seen.shadow if mesh.convex else mi.Bool(active)
    on, there = explosion.looked_up(mesh, made, local.V, searched)
    at = newton.newton_step(mesh, local, on, there)
    front = (dr.dot(local.V - at.P, at.N) > 0) & (dr.dot(local.eye - at.P, at.N) > 0)
    end = single.Ended(
        R=at.P,
        n=at.N,
        searched=searched,
        hidden=seen.shadow | ~there | ~front,
        near=there,
        converged=there & at.proven(),
        residual=dr.select(there, at.f, 0),
        iterations=dr.select(searched, mi.UInt32(1), 0),
    )
    images, vertices, shown = single.images_of(problem, end, seen, None if mesh.convex else mesh, flush=hides, placed=placed)
    return images, vertices, Ends(shown)
