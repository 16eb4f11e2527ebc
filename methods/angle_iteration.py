"""Angle iteration: turn a direction by what half vector and normal differ in, until they agree; the moved triangles are drawn.

A reconstruction of Estalella, Martin, Drettakis, Tost, Devillers, Cazals, "Accurate interactive specular reflections on curved
objects", VMV 2005. Later papers tell of it that two cube maps hold a mirror's points and its normals, by direction from its
centre, that a candidate moves by the angles between normal, vertex and eye until they obey the law of reflection, in a fixed
number of steps on the CPU, and that vertices between others may be interpolated. The exact step was not at hand: the one here
is ours, u <- unit(u + lam (B(u) - n(u))), from halfway between the directions to eye and vertex (kernels.vertices.angles).

One cube map holds both, the points by their distances and the normals by their gradient (kernels.vertices.starmap). It is made
once and moves with the mirror.

Assumes a star-shaped mirror that is seen from outside, and one reflection per vertex. On a ball, `damping = "naive"` runs away
from vertices nearer than half a radius, and from those that are seen at grazing incidence; "half" from fewer; "local" from
none. Elsewhere, steps are right as far as the mirror turns as a ball of its distance from the centre would: "local" halves
those that do not help, and gives up where nothing does, as on sharp tips and on what is flat.

What has not converged says so: the mirror's mesh is asked whether Newton's next step from there would be short, and one ray
from the eye to every vertex whether the mirror hides it. A root that a mirror which is not convex hides from the eye is no
reflection; there, one ray per pixel asks where the mirror meets itself, and it is black (`self_reflection`). Shows no second
bounce. Fails where triangles are long: images of edges are straight.

With `exact_every` above 1 some vertices are searched, and the points of the rest interpolated between theirs and put on the
mirror again (kernels.vertices.between). What that leaves more than a quarter pixel off says so, like a search that has not
converged. Where a corner is hidden or was not found, a vertex is searched itself.
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
    angles,
    between,
    branches,
    mirrormesh,
    newton,
    problems,
    scenery,
    search,
    secant,
    sight,
    single,
    starmirror,
    vertexwise,
    virtual,
)
from benchharness.scene import Scene


@dataclass
class State(vertexwise.State):
    """
    mirrors  per reflector, what is searched
    lying    which vertices are searched, and between which the others lie; None where all are
    """

    mirrors: list[starmirror.StarMirror]
    lying: between.Between | None


@dataclass(frozen=True)
class AngleIteration(Method):
    """
    resolution  texels per edge of a face of the map of points and normals
    damping     how much of half vector less normal a step takes: all of it ("naive"), "half", or as much as is right on a ball
                ("local")
    warm        start where the last frame's iteration ended, and anew where that leads nowhere
    hidden      triangles with hidden vertices: "cut" where they become hidden, or "drop"
    other_mirrors    other mirrors in this one: "black"; "reflective", which "ray" is needed for (kernels.vertices.higherorder);
                or "omitted" to show what is behind them
    self_reflection  the mirror in itself, where it is not convex: "black", which takes one ray per pixel of it, or "omitted"
    max_iter    directions after which an iteration gives up
    resolve     what a pixel shows: "interpolate" between the corners of the triangle that covers it, or what its own "ray"
                meets of the triangles that it and the pixels around it name (kernels.vertices.exact)
    lod_px      levels of detail: of every part the coarsest whose error is seen no larger than this in a mirror, pixels;
                0 for none. Only with "ray", which shows the part itself and not what stands for it
    split_px    edges are split whose images are off a straight line by more than this, pixels (kernels.vertices.tessellation);
                0 for none
    exact_every  of so many places of a part about one is searched, the rest lie between. Above 1 only with `split_px` 0 and
                "interpolate": what splitting and rays ask of vertices are their own points
    """

    resolution: Annotated[int, Field(ge=8, le=2048)] = 256
    damping: Literal["naive", "half", "local"] = "local"
    warm: bool = True
    hidden: Literal["cut", "drop"] = "cut"
    other_mirrors: Literal["black", "reflective", "omitted"] = "black"
    self_reflection: Literal["black", "omitted"] = "black"
    max_iter: Annotated[int, Field(ge=1, le=65536)] = 60
    resolve: Literal["interpolate", "ray"] = "interpolate"
    lod_px: Annotated[float, Field(ge=0, le=1e3)] = 0.0
    split_px: Annotated[float, Field(ge=0, le=1e3)] = scenery.SPLIT_PX
    exact_every: Annotated[int, Field(ge=1, le=65536)] = 1

    knobs: ClassVar[tuple[Knob, ...]] = (
        Knob("resolution", (16, 64, 256), {"split_px": 1.0}),
        Knob("split_px", (16.0, 4.0, 2.0, 1.0, 0.5, 0.25)),
        Knob("max_iter", (4, 8, 16, 60), {"split_px": 1.0}),
        Knob("exact_every", (64, 16, 4, 1), {"split_px": 0.0}),
    )
    family: ClassVar[str] = "moved vertices"
    paper: ClassVar[str] = "Estalella et al. 2005, reconstructed"
    limits: ClassVar[dict[str, str]] = {
        "F-15": "where two triangles' edges end in a third's, less than two pixels of bend open a crack between their images",
        "F-16": "images of two triangles are bent in depth too, and of thin layers either may come out nearer",
        "F-20": "one reflection per vertex is looked for, and nothing says that there are more",
        "F-21": "at a focus half vector and normal agree all over the mirror, and one root cannot be told from the next",
        "F-25, F-26": "on bumps, where two roots are about to meet, rounding moves the point that is found by pixels",
    }

    def __post_init__(self) -> None:
        scenery.check(self.resolve, self.lod_px, self.split_px, 1, "angle_iteration", self.other_mirrors)
        if self.exact_every > 1 and (self.split_px > 0 or self.resolve != "interpolate"):
            raise ValueError(
                f"angle_iteration: exact_every {self.exact_every} with split_px {self.split_px:g} and resolve "
                f'"{self.resolve}"; accepted: 1, or split_px 0 and "interpolate"'
            )

    def refuses(self, scene: Scene) -> str | None:
        return normalmap.refusal(scene.reflectors) or starmirror.refusal(scene.reflectors, self.resolution, outside=True)

    def prepare(self, scene: Scene) -> State:
        made = [starmirror.of_reflector(reflector, self.resolution) for reflector in scene.reflectors]
        searched = [mesh for _, mesh in made]
        seen = scenery.of_scene(scene, searched, self.resolve, self.lod_px, self.split_px, others=self.other_mirrors)
        lying = None if self.exact_every == 1 else between.of_scene(scene, self.exact_every)
        return State(seen, [], None, [mirror for mirror, _ in made], lying)

    def update(self, state: State, frame: Frame) -> State:
        return replace(state, scenery=scenery.posed(state.scenery, frame))

    def shade(self, state: State, frame: Frame) -> tuple[Reflection, State]:
        drawing, lying = virtual.Drawing(self.hidden), state.lying

        def solve(i: int, problem: problems.Problem, last: starmirror.Ends) -> vertexwise.Solved:
            mirror, pose = state.mirrors[i], problem.pose
            own = branches.meeting(i, mirror.seen, pose, self.self_reflection, frame.doubts)
            closed = mirror.mesh.closed and not mirror.mesh.convex
            back = virtual.nearest_back(frame.proxies[i], frame.poses, problem.part, frame.view) if closed else None

            def find(asked: problems.Problem, start: starmirror.Ends) -> problems.Found:
                if lying is None:
                    return problems.Found(*_solve(asked, mirror, start, self.damping, self.hidden))
                few = problems.Found(*_solve(between.of_searched(asked, lying), mirror, start, self.damping, self.hidden))
                images, found, counted = _interpolated(asked, mirror, few, lying, self.damping, self.hidden)
                return problems.Found(images, found, few.end, {"interpolated": counted})

            hider, whole = sight.Shadow(mirror.mesh, pose), mirror.mesh.convex and self.hidden == "cut"
            return vertexwise.Solved(find(problem, last), drawing, hider, back, whole, own=own, further=find)

        return vertexwise.shown(
            state,
            frame,
            solve,
            lambda count: starmirror.Ends.cold(count if lying is None else lying.count),
            other_mirrors=self.other_mirrors,
            max_iter=self.max_iter,
            warm=self.warm,
            sheets=[mirror.seen for mirror in state.mirrors],
        )


@frozen
def _solve(
    problem: problems.Problem, mirror: starmirror.StarMirror, last: starmirror.Ends, damping: str, hides: str
) -> tuple[virtual.Images, Vertices, starmirror.Ends]:
    """Virtual vertices, what was found of each vertex, and where the iterations ended."""
    star, mesh = mirror.star, mirror.mesh
    (lane, V, active), max_iter = problem.vertices(), problem.max_iter
    local = placement.mirror_frame(problem.pose, V, problem.view)

    # The mirror between eye and vertex hides it for certain if it is convex.
    seen = sight.look_at(mesh, local, active)
    searched = active & ~seen.shadow if mesh.convex else mi.Bool(active)
    warm = last.warm & ~problems.was_cut(problem.view, problem.last_view)
    cold = angles.first_guess(star, local)
    u = dr.select(warm, dr.gather(mi.Vector3f, last.u, lane), cold)
    s = angles.iterate(damping, star, local, u, searched, max_iter)

    # What began warm and came to nothing begins anew.
    lost = searched & warm & ~s.converged
    again = angles.iterate(damping, star, local, cold, lost, max_iter)
    iterations = s.iterations + again.iterations
    s = dr.select(lost, again, s)
    s.iterations = iterations
    end = _ended(problem, mirror, local, seen, searched, s)
    images, vertices, shown = single.images_of(problem, end, seen, mirror.sheet, flush=mesh.convex and hides == "cut")
    ends = starmirror.Ends(dr.empty(mi.Float, 3 * problem.count), shown)
    dr.scatter(ends.u, placement.unit(end.R - star.centre), lane)
    return images, vertices, ends


@frozen
def _interpolated(
    problem: problems.Problem,
    mirror: starmirror.StarMirror,
    few: problems.Found,
    lying: between.Between,
    damping: str,
    hides: str,
) -> tuple[virtual.Images, Vertices, mi.UInt32]:
    """The same of all vertices, of what was found of those that are searched; and which were interpolated, 1 of each."""
    star, mesh = mirror.star, mirror.mesh
    lane, V, active = problem.vertices()
    local = placement.mirror_frame(problem.pose, V, problem.view)
    seen = sight.look_at(mesh, local, active)
    searched = active & ~seen.shadow if mesh.convex else mi.Bool(active)
    found = few.vertices
    here = between.interpolated(lying, few.end.u, found.converged, lane)
    steps = dr.select(here.searched, dr.gather(mi.UInt32, found.iterations, here.own), 0)
    closed = ~here.searched | dr.gather(mi.Bool, found.converged, here.own)
    known = searched & (here.whole | here.searched)
    s = secant.judged(star, local, placement.unit(here.value), closed, steps, mi.UInt32(0), known)
    alone = searched & ~known
    again = angles.iterate(damping, star, local, angles.first_guess(star, local), alone, problem.max_iter)
    s = dr.select(alone, again, s)
    end = _ended(problem, mirror, local, seen, searched, s)
    images, vertices, _ = single.images_of(problem, end, seen, mirror.sheet, flush=mesh.convex and hides == "cut")
    return images, vertices, dr.select(known & ~here.searched, mi.UInt32(1), 0)


def _ended(
    problem: problems.Problem,
    mirror: starmirror.StarMirror,
    local: placement.MirrorFrame,
    seen: sight.Sight,
    searched: mi.Bool,
    s: secant.Solution,
) -> single.Ended:
    """What has come of directions, asked of the mirror's mesh."""
    star, mesh = mirror.star, mirror.mesh
    on, met = sight.located(mesh, star.centre, s.u, s.converged)
    converged = s.converged & newton.arrived(mesh, local, on, met)

    # A vertex on the mirror is its own reflection point.
    n = dr.select(seen.touches, newton.newton_step(mesh, local, seen.on, seen.touches).N, s.n)
    R = dr.select(seen.touches, mirrormesh.position(mesh, seen.on, seen.touches), s.R)
    converged = dr.select(seen.touches, searched & (dr.dot(n, local.eye - R) > 0), converged)
    return single.Ended(
        R=R,
        n=mi.Normal3f(n),
        searched=searched,
        hidden=seen.shadow | ~searched | (dr.dot(local.V - R, n) <= 0),
        near=s.residual < search.STRAY,
        converged=converged,
        residual=dr.select(seen.touches, 0, s.residual),
        iterations=s.iterations,
    )
