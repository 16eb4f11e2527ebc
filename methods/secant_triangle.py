"""Secant triangle: three samples of the mirror close in on each vertex's reflection point, and the moved triangles are drawn.

A star-shaped mirror is one function of direction, r(u). For every vertex V, three directions are tried; where the gradient
of the light's path by way of the mirror would vanish, if it were linear between them, is the next sample. The scene is
then drawn with its vertices at their reflection points.
Paper: Roger, Holzschuch, "Accurate specular reflections in real-time", Eurographics 2006; section 3.

Assumes a star-shaped mirror. The paper assumes one reflection per vertex: mirrors with several show the one that the search
comes to. `multi` lifts that. Fails where triangles are long (images of edges are straight), and near outlines, where a secant
may leave the mirror's visible side: its own test then says "not converged". Shows
second bounces with `other_mirrors = "reflective"` alone, and none of a mirror in itself.

Where we differ:
* The printed equation (1) is a transpose and has other zeros than the path's length: kernels.vertices.secant.
* `stop = "area"` is the paper's. A triangle that has become a sliver has no area and may be pixels long: "edge" asks for the
  longest edge.
* `start = "near"` begins with a small triangle where a sphere would reflect V; the paper's begins with one as wide as the angle
  between V and E. `warm` begins at the last frame's answer.
* Half vector and normal may nearly agree far from where they do: near a focus, an edge, on what is flat or a needle. Newton's
  next step on the mesh is asked for, and a search has converged only where that is short. With `newton` off there is no mesh:
  a triangle one texel of the map wide must lead back to the same point.
* `newton = "always"` lets Newton's method on the mirror's own mesh go on from the triangle's last sample, and begin anew where
  the triangle was lost; "restart" only what has not converged. It also asks one ray from eye to vertex whether the mirror
  hides it.
* The paper is silent on hidden vertices. `hidden = "drop"` leaves their triangles out; "emdt_mirror" mirrors them as Estalella
  et al. 2006 do; "clamp" puts them on the outline; "cut" ends triangles where they become hidden.
* `depth = "screen_linear"` is the paper's: triangles span reflection points and are sorted by the distance to what is
  reflected, linear on the screen. "perspective" draws triangles in space, behind the mirror, where each image is.
* `multi` finds up to so many reflections per vertex: triangles close in around points spread over the mirror, and the scene's
  triangles join what belongs together (kernels.vertices.several, .branches). Rays ask whether the mirror hides a reflection
  from the eye or from the vertex.
* On a mirror that is not convex, a root that the mirror hides from the eye is no reflection; and, with `own = "black"`, a ray
  per pixel asks whether the mirror meets itself: there it is black. The paper knows neither.
* `self_occlusion`: the paper's test against the mirror's nearest back. A convex mirror cannot fail it and is not asked.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import drjit as dr
import mitsuba as mi
import numpy as np
from pydantic import Field

from benchharness.api import Frame, Knob, Method, Reflection, Vertices, View
from benchharness.kernels import normalmap, optics, placement
from benchharness.kernels.frozen import frozen
from benchharness.kernels.vertices import (
    branches,
    problems,
    refinement,
    scenery,
    search,
    secant,
    several,
    sight,
    starmirror,
    textures,
    vertexwise,
    virtual,
)
from benchharness.scene import Scene

WIDENING = 1.25  # of tan(fov / 2), of the mirror's picture whose planes "emdt_mirror" mirrors in
FARTHEST = 4.0  # scene diagonals: longest distance that "screen_linear" tells apart


@dataclass
class Options:
    """The parameters that the kernels are compiled for; `newton`, `hidden` and `depth` as `SecantTriangle` has them."""

    search: secant.Options
    newton: str
    hidden: str
    depth: str


@dataclass
class Scale:
    """The numbers of a search that are no part of the problem.

    tau    pixels ("edge") or pixels squared ("area") at which a triangle is small
    d_max  no reflected ray is longer, metres
    """

    tau: mi.Float
    d_max: mi.Float


@dataclass
class Mirror(starmirror.StarMirror):
    """One reflector. `seeds`: where searches for several reflections may start, None where there is one at most."""

    seeds: several.Seeds | None


@dataclass
class State(vertexwise.State):
    """
    mirrors  per reflector, what is searched
    d_max    no reflected ray is longer, metres
    """

    mirrors: list[Mirror]
    d_max: mi.Float


@dataclass(frozen=True)
class SecantTriangle(Method):
    """
    resolution      texels per edge of a face of the map of r(u)
    residual        "param": derivative of the path's length in u; "surface": its part in the tangent plane
    stop            when the triangle is small on the screen: its longest "edge", or its "area" as in the paper
    tau             how small, pixels ("edge") or pixels squared ("area")
    start           "near" the answer, or as wide as the "paper"
    warm            start where the last frame's search ended
    newton          go on by Newton's method: "restart" if the triangle was lost, "always", or "off" as in the paper
    hidden          triangles with hidden vertices: "cut", "drop", "emdt_mirror" or "clamp"; see above
    depth           "perspective", or "screen_linear" as in the paper (which knows no "cut" and no "emdt_mirror")
    self_occlusion  leave out what lies behind the mirror's own nearest back
    other_mirrors   other mirrors in this one: "black"; "reflective", which "ray" is needed for (kernels.vertices.higherorder);
                    or "omitted" to show what is behind them
    self_reflection  the mirror in itself, where it is not convex: "black", which takes one ray per pixel of it, or "omitted"
    max_iter        samples, and again points, after which a search gives up
    multi           reflections per vertex that are found and drawn; with more than one, every search is a cold one from a
                    small triangle around a point of the mirror, and hidden vertices are "cut" or their triangles dropped
    resolve         what a pixel shows: "interpolate" between the corners of the triangle that covers it, as the paper does, or
                    what its own "ray" meets of the triangles that it and the pixels around it name (kernels.vertices.exact)
    lod_px          levels of detail: of every part the coarsest whose error is seen no larger than this in a mirror, pixels;
                    0 for none. Only with "ray", which shows the part itself and not what stands for it
    split_px        edges are split whose images are off a straight line by more than this, pixels; 0 for none. None: 0.5, and
                    none where `multi` is more than 1, with which no edge can be split (kernels.vertices.tessellation)
    """

    resolution: Annotated[int, Field(ge=8, le=2048)] = 256
    residual: Literal["param", "surface"] = "param"
    stop: Literal["edge", "area"] = "edge"
    tau: Annotated[float, Field(gt=0, le=1e6)] = 1.0
    start: Literal["near", "paper"] = "near"
    warm: bool = True
    newton: Literal["restart", "always", "off"] = "restart"
    hidden: Literal["cut", "drop", "emdt_mirror", "clamp"] = "cut"
    depth: Literal["perspective", "screen_linear"] = "perspective"
    self_occlusion: bool = True
    other_mirrors: Literal["black", "reflective", "omitted"] = "black"
    self_reflection: Literal["black", "omitted"] = "black"
    max_iter: Annotated[int, Field(ge=1, le=65536)] = 60
    multi: Annotated[int, Field(ge=1, le=8)] = 1
    resolve: Literal["interpolate", "ray"] = "interpolate"
    lod_px: Annotated[float, Field(ge=0, le=1e3)] = 0.0
    split_px: Annotated[float, Field(ge=0, le=1e3)] | None = None

    knobs: ClassVar[tuple[Knob, ...]] = (
        Knob("split_px", (16.0, 4.0, 2.0, 1.0, 0.5, 0.25)),
        Knob("split_px", (64.0, 16.0, 4.0, 1.0), {"resolve": "ray"}),
        Knob("resolution", (16, 64, 256), {"split_px": 1.0}),
    )
    family: ClassVar[str] = "moved vertices"
    paper: ClassVar[str] = "Roger and Holzschuch 2006"
    limits: ClassVar[dict[str, str]] = {
        "F-15": "where two triangles' edges end in a third's, less than two pixels of bend open a crack between their images",
        "F-16": "images of two triangles are bent in depth too, and of thin layers either may come out nearer",
        "F-20": "one reflection per vertex is looked for, and nothing says that there are more; `multi` finds them",
        "F-21": "at a focus half vector and normal agree all over the mirror, and one root cannot be told from the next",
        "F-25, F-26": "on bumps, where two roots are about to meet, rounding moves the point that is found by pixels",
    }

    def __post_init__(self) -> None:
        scenery.check(self.resolve, self.lod_px, self.split_px, self.multi, "secant_triangle", self.other_mirrors)
        if self.depth == "screen_linear" and self.hidden in ("cut", "emdt_mirror"):
            raise ValueError(f'secant_triangle: depth "screen_linear" with hidden "{self.hidden}"; accepted: "drop" or "clamp"')
        if self.multi > 1 and (self.hidden not in ("cut", "drop") or self.depth != "perspective"):
            raise ValueError(
                f'secant_triangle: multi {self.multi} with hidden "{self.hidden}" and depth "{self.depth}"; '
                'accepted: "cut" or "drop", and "perspective"'
            )

    def refuses(self, scene: Scene) -> str | None:
        return normalmap.refusal(scene.reflectors) or starmirror.refusal(scene.reflectors, self.resolution)

    def prepare(self, scene: Scene) -> State:
        mirrors, searched = [], []
        for reflector in scene.reflectors:
            (made, mesh), seeds = starmirror.of_reflector(reflector, self.resolution), None
            if self.multi > 1 and not made.mesh.convex:
                seeds = several.seeds(mesh.vertices, mesh.normals, mesh.faces, backs=reflector.closed is None)
            searched.append(mesh)
            mirrors.append(Mirror(made.star, made.mesh, made.sheet, seeds))
        corners = np.concatenate([np.asarray(part.mesh.transformed(part.pose(0.0)).vertices) for part in scene.parts])
        d_max = dr.opaque(mi.Float, FARTHEST * float(np.linalg.norm(np.ptp(corners, axis=0))))
        pixels = scenery.pixels(self.split_px, told=self.multi == 1)
        seen = scenery.of_scene(scene, searched, self.resolve, self.lod_px, pixels, others=self.other_mirrors)
        return State(seen, [], None, mirrors, d_max)

    def update(self, state: State, frame: Frame) -> State:
        return replace(state, scenery=scenery.posed(state.scenery, frame))

    def shade(self, state: State, frame: Frame) -> tuple[Reflection, State]:
        options = Options(secant.Options(self.residual, self.stop, self.start), self.newton, self.hidden, self.depth)
        scale = Scale(dr.opaque(mi.Float, self.tau), state.d_max)
        policy = {"cut": "cut", "drop": "drop", "emdt_mirror": "keep", "clamp": "keep"}[self.hidden]
        drawing = virtual.Drawing(policy, self.depth)

        def solve(i: int, problem: problems.Problem, last: starmirror.Ends) -> vertexwise.Solved:
            mirror, pose, proxy = state.mirrors[i], problem.pose, frame.proxies[i]
            own = branches.meeting(i, mirror.seen, pose, self.self_reflection, frame.doubts)
            hider = sight.Shadow(mirror.mesh, pose)
            closed = self.self_occlusion and mirror.mesh.closed and not mirror.mesh.convex
            if mirror.seeds is not None:
                closed = mirror.seeds.closed
            back = virtual.nearest_back(proxy, frame.poses, problem.part, frame.view) if closed else None
            if mirror.seeds is not None:
                made, backtracks = _solve_several(problem, mirror, self.multi, scale, options)
                return branches.solved(made, hider, back, drawing, own, {"backtracks": backtracks})
            picture = None
            if self.hidden == "emdt_mirror":
                camera = textures.window(frame.view, frame.boxes[i], WIDENING).view
                picture = textures.render(proxy, frame.poses, problem.part, camera)

            def find(asked: problems.Problem, start: starmirror.Ends) -> problems.Found:
                images, vertices, end, backtracks = _solve(asked, mirror, picture, start, scale, options)
                return problems.Found(images, vertices, end, {"backtracks": backtracks})

            whole = mirror.mesh.convex and self.hidden != "drop"
            return vertexwise.Solved(find(problem, last), drawing, hider, back, whole, own=own, further=find)

        return vertexwise.shown(
            state,
            frame,
            solve,
            starmirror.Ends.cold,
            other_mirrors=self.other_mirrors,
            max_iter=self.max_iter,
            warm=self.warm,
            sheets=[mirror.seen for mirror in state.mirrors] if self.multi == 1 else None,
        )


@frozen
def _solve(
    problem: problems.Problem,
    mirror: Mirror,
    picture: textures.Texture | None,
    last: starmirror.Ends,
    scale: Scale,
    options: Options,
) -> tuple[virtual.Images, Vertices, starmirror.Ends, mi.UInt32]:
    """Virtual vertices, what was found of each vertex, where the searches ended, and how often a sample came back."""
    star, mesh = mirror.star, mirror.mesh
    (lane, V, active), pose, view = problem.vertices(), problem.pose, problem.view
    local = placement.mirror_frame(pose, V, view)

    # The mirror between eye and vertex hides it for certain if it is convex.
    seen = sight.look_at(mesh, local, active) if options.newton != "off" else None
    shadow = mi.Bool(False) if seen is None else seen.shadow
    searched = active & ~shadow if mesh.convex else mi.Bool(active)
    triangle = active & ~shadow  # in the shadow of one that is not convex, V may be reflected, but not where a sphere would

    # The triangle, and Newton's method after it.
    warm = last.warm & ~problems.was_cut(view, problem.last_view)
    u = dr.gather(mi.Vector3f, last.u, lane)
    s = secant.solve(options.search, star, local, u, warm, triangle | (searched & warm), scale.tau, problem.max_iter)
    found, behind = s, s.behind
    if seen is None:
        converged = s.converged & secant.settled(options.search.residual, star, local, s, s.converged)
    else:
        known = refinement.Searched(seen, searched, warm)
        always = options.newton == "always"
        found = refinement.refined(mesh, star.centre, local, s, known, problem.max_iter, always=always)
        converged = found.converged
        behind = active & ~converged & (shadow | (dr.dot(local.V - found.R, found.n) <= 0))
    reflected = searched & ~behind & (converged | (found.residual < search.STRAY))
    hidden = active & (behind | shadow) & ~reflected
    free = None
    if mirror.sheet is not None:
        # A root that the mirror hides from the eye is no reflection.
        free = ~reflected | sight.is_free(mirror.sheet, found.R, found.n, local.eye, reflected)
        converged = converged & free
    u = placement.unit(found.R - star.centre)
    R, n = placement.point_to_world(pose, found.R), placement.normal_to_world(pose, found.n)
    if options.hidden == "clamp":
        R = dr.select(hidden, placement.point_to_world(pose, secant.outline(star, local, hidden)), R)
    answer = problems.Answer(
        R=R,
        n=n,
        image=V,
        reflected=reflected,
        hidden=hidden,
        converged=converged,
        unsure=searched & ~converged,
        residual=found.residual,
        iterations=found.iterations,
        free=free,
        flush=None if seen is None or not mesh.convex or options.hidden != "cut" else seen.touches,
    )
    answer.image = _image(answer, V, picture, view, scale.d_max, options)
    end = starmirror.Ends(dr.empty(mi.Float, 3 * problem.count), mi.Bool(reflected if free is None else reflected & free))
    dr.scatter(end.u, u, lane)
    return *problems.images_of(problem, answer), end, s.backtracks


def _image(
    found: problems.Answer, V: mi.Point3f, picture: textures.Texture | None, view: View, d_max: mi.Float, options: Options
) -> mi.Point3f:
    """Where the images of vertices V go."""
    R, hidden = found.R, found.hidden
    on_eye_ray = found.reflected | hidden if options.hidden == "clamp" else found.reflected
    if options.depth == "screen_linear":
        image = virtual.sorted_by_length(R, dr.norm(V - R), d_max, view)
    else:
        image = optics.on_ray(V, R, view.eye)
    image = dr.select(on_eye_ray, image, V)
    if picture is not None:
        c, r, visible = picture.seen_at(V)
        visible, P, N = picture.at(c, r, hidden & visible)
        plane = dr.select(visible, P, R), dr.select(visible, N, found.n)
        image = dr.select(hidden, optics.mirrored(V, *plane), image)
    return image


@frozen
def _solve_several(
    problem: problems.Problem, mirror: Mirror, multi: int, scale: Scale, options: Options
) -> tuple[branches.Arranged, mi.UInt32]:
    """Virtual vertices, triangles and what was found of several reflections per vertex, and how often a sample came back."""
    star, mesh = mirror.star, mirror.mesh
    assert mirror.seeds is not None
    starts = several.begin(mirror.seeds, mesh, problem, multi)
    local, u = starts.local, placement.unit(starts.P - star.centre)
    s = secant.solve(options.search, star, local, u, mi.Bool(True), starts.active, scale.tau, problem.max_iter)
    if options.newton == "off":
        exact = s.converged & secant.settled(options.search.residual, star, local, s, s.converged)
        ends = several.Ends(s.R, s.n, s.converged, exact, s.residual, s.iterations, None)
    else:
        always = options.newton == "always"
        ends = refinement.refined_from(starts, mesh, star.centre, s, problem.max_iter, always=always)
    made = branches.arranged(several.finish(ends, starts, mesh, problem, multi), mesh, problem, multi)
    return made, several.per_vertex(s.backtracks, problem.count, multi)
