"""Secant triangle: three samples of the mirror close in on each vertex's reflection point, and the moved triangles are drawn.

A star-shaped mirror is one function of direction, r(u). For every vertex V, three directions are tried; where the gradient
of the light's path by way of the mirror would vanish, if it were linear between them, is the next sample. The scene is
then drawn with its vertices at their reflection points.
Paper: Roger, Holzschuch, "Accurate specular reflections in real-time", Eurographics 2006; section 3.

Assumes a star-shaped mirror. The paper assumes one reflection per vertex: mirrors with several show the one that the search
comes to. `multi` lifts that. Fails where triangles are long (images of edges are straight), and near outlines, where a secant
may leave the mirror's visible side: its own test then says "not converged". Shows no second bounce.

Where we differ:
* The printed equation (1) is a transpose and has other zeros than the path's length: kernels.secant.
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
  triangles join what belongs together (kernels.several, kernels.branches). Rays ask whether the mirror hides a reflection from
  the eye or from the vertex.
* On a mirror that is not convex, a root that the mirror hides from the eye is no reflection; and, with `own = "black"`, a ray
  per pixel asks whether the mirror meets itself: there it is black. The paper knows neither.
* `self_occlusion`: the paper's test against the mirror's nearest back. A convex mirror cannot fail it and is not asked.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import drjit as dr
import mitsuba as mi
import numpy as np
from pydantic import Field

from benchharness.api import Frame, Method, Reflection, Vertices, View
from benchharness.kernels import optics, placement
from benchharness.kernels.frozen import frozen
from benchharness.kernels.vertices import branches, newton, search, secant, several, starmap, vertexwise, virtual
from benchharness.scene import Mesh, Reflector, Scene

WIDENING = 1.25  # of tan(fov / 2), of the mirror's picture whose planes "emdt_mirror" mirrors in
FARTHEST = 4.0  # scene diagonals: longest distance that "screen_linear" tells apart


@dataclass
class Options:
    """The parameters that the kernels are compiled for."""

    search: secant.Options
    newton: str
    hidden: str
    depth: str


@dataclass
class Mirror:
    """One reflector: as a function of direction, and as a mesh. `sheet`: what is seen of it, as a mesh; None if it is convex.
    `seeds`: where searches for several reflections may start, None where there is one at most."""

    star: starmap.StarMap
    mesh: newton.Mesh
    sheet: newton.Mesh | None
    seeds: several.Seeds | None


@dataclass
class Ends:
    """Where the searches of a frame ended, per vertex: direction (3 floats), and whether it is worth starting from."""

    u: mi.Float
    warm: mi.Bool

    @staticmethod
    def cold(count: int) -> Ends:
        return Ends(dr.zeros(mi.Float, 3 * count), dr.zeros(mi.Bool, count))


@dataclass
class State:
    """
    ends   per reflector, where the last searches ended; None for those with several reflections
    view   the camera of the last frame
    d_max  no reflected ray is longer, metres
    """

    scenery: vertexwise.Scenery
    mirrors: list[Mirror]
    ends: list[Ends | None]
    view: View | None
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
    other_mirrors   other mirrors in this one: "black", or "omitted" to show what is behind them
    self_reflection  the mirror in itself, where it is not convex: "black", which takes one ray per pixel of it, or "omitted"
    max_iter        samples, and again points, after which a search gives up
    multi           reflections per vertex that are found and drawn; with more than one, every search is a cold one from a
                    small triangle around a point of the mirror, and hidden vertices are "cut" or their triangles dropped
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
    other_mirrors: Literal["black", "omitted"] = "black"
    self_reflection: Literal["black", "omitted"] = "black"
    max_iter: Annotated[int, Field(ge=1, le=65536)] = 60
    multi: Annotated[int, Field(ge=1, le=8)] = 1

    paper: ClassVar[str] = "Roger and Holzschuch 2006"
    limits: ClassVar[dict[str, str]] = {
        "F-15": "where two triangles' edges end in a third's, less than two pixels of bend open a crack between their images",
        "F-16": "images of two triangles are bent in depth too, and of thin layers either may come out nearer",
        "F-20": "one reflection per vertex is looked for, and nothing says that there are more; `multi` finds them",
        "F-21": "at a focus half vector and normal agree all over the mirror, and one root cannot be told from the next",
        "F-25, F-26": "on bumps, where two roots are about to meet, rounding moves the point that is found by pixels",
    }

    def __post_init__(self) -> None:
        if self.depth == "screen_linear" and self.hidden in ("cut", "emdt_mirror"):
            raise ValueError(f'secant_triangle: depth "screen_linear" with hidden "{self.hidden}"; accepted: "drop" or "clamp"')
        if self.multi > 1 and (self.hidden not in ("cut", "drop") or self.depth != "perspective"):
            raise ValueError(
                f'secant_triangle: multi {self.multi} with hidden "{self.hidden}" and depth "{self.depth}"; '
                'accepted: "cut" or "drop", and "perspective"'
            )

    def refuses(self, scene: Scene) -> str | None:
        for reflector in scene.reflectors:
            try:
                _star(reflector, self.resolution, starmap.check)
            except starmap.NotStarShapedError as error:
                return f"reflector {reflector.name}: {error}"
        return None

    def prepare(self, scene: Scene) -> State:
        mirrors = []
        for reflector in scene.reflectors:
            star, mesh = _star(reflector, self.resolution)
            walked, seeds = newton.mesh(mesh.vertices, mesh.normals, mesh.faces, backs=reflector.closed is None), None
            sheet = None if walked.convex else _sheet(reflector, mesh, walked)
            if self.multi > 1 and not walked.convex:
                seeds = several.seeds(mesh.vertices, mesh.normals, mesh.faces, backs=reflector.closed is None)
            mirrors.append(Mirror(star, walked, sheet, seeds))
        corners = np.concatenate([np.asarray(part.mesh.transformed(part.pose(0.0)).vertices) for part in scene.parts])
        d_max = dr.opaque(mi.Float, FARTHEST * float(np.linalg.norm(np.ptp(corners, axis=0))))
        return State(vertexwise.scenery(scene), mirrors, [], None, d_max)

    def update(self, state: State, frame: Frame) -> State:
        return replace(state, scenery=vertexwise.posed(state.scenery, frame))

    def shade(self, state: State, frame: Frame) -> tuple[Reflection, State]:
        options = Options(secant.Options(self.residual, self.stop, self.start), self.newton, self.hidden, self.depth)
        warm = self.warm and state.view is not None
        seen = state.scenery
        count, shown_parts = seen.triangles.vertex_count, seen.parts_shown(self.other_mirrors)
        tau, max_iter = dr.opaque(mi.Float, self.tau), dr.opaque(mi.UInt32, self.max_iter)
        doubted = dr.opaque(mi.UInt32, seen.objects) if frame.doubts else None
        policy = {"cut": "cut", "drop": "drop", "emdt_mirror": "keep", "clamp": "keep"}[self.hidden]

        def solve(i: int, part: mi.UInt32) -> vertexwise.Solved:
            mirror, picture, back = state.mirrors[i], None, None
            pose = placement.pose_of(frame.poses, part)
            own = branches.meeting(
                mirror.mesh if mirror.sheet is None else mirror.sheet, pose, self.self_reflection, frame.doubts
            )
            if mirror.seeds is not None:
                made, backtracks = _solve_several(
                    seen.world,
                    shown_parts,
                    mirror,
                    pose,
                    part,
                    frame.view,
                    tau,
                    max_iter,
                    self.multi,
                    options,
                    doubted,
                )
                more = {"backtracks": backtracks}
                return branches.solved(made, mirror.mesh, mirror.seeds, pose, frame, i, part, self.hidden, own, more)
            if self.hidden == "emdt_mirror":
                window = search.window(frame.view, frame.boxes[i], WIDENING)
                picture = (search.render(frame.proxies[i], frame.poses, part, window.view), window.view)
            behind = self.self_occlusion and mirror.mesh.closed and not mirror.mesh.convex
            if behind:
                back = virtual.nearest_back(frame.proxies[i], frame.poses, part, frame.view)
            images, end, report, backtracks = _solve(
                seen.world.points, shown_parts, mirror, picture, pose, part, frame.view,
                state.view if warm else frame.view, state.ends[i] if warm else Ends.cold(count), count, state.d_max, tau,
                max_iter, options, doubted,
            )  # fmt: skip
            drawing = virtual.Drawing(policy, self.depth, behind)
            hider, whole = newton.Shadow(mirror.mesh, pose), mirror.mesh.convex and self.hidden != "drop"
            return vertexwise.Solved(images, end, report, drawing, hider, back, whole, {"backtracks": backtracks}, own=own)

        shown = vertexwise.shown(seen, frame, solve)
        if self.multi == 1:
            meshes = [m.mesh if m.sheet is None else m.sheet for m in state.mirrors]
            shown.report["valid"] = several.valid(meshes, seen.objects, frame, seen.world.points, shown.report)
        vertices = Vertices(**shown.report, further=[Vertices(**report) for report in shown.further])
        reflection = Reflection(shown.L, shown.distance, shown.found, vertices, shown.counters, shown.doubt)
        return reflection, replace(state, ends=shown.ends, view=frame.view)


def _star(reflector: Reflector, resolution: int, make: Callable = starmap.build):
    """The map of a reflector, or what else `make` makes of its mesh, and that mesh: its closed stand-in if that is star-shaped,
    else the sheet."""
    meshes = [mesh for mesh in (reflector.closed, reflector.mesh) if mesh is not None]
    for mesh in meshes[:-1]:
        try:
            return make(mesh.vertices, mesh.normals, mesh.faces, resolution), mesh
        except starmap.NotStarShapedError:
            pass
    mesh = meshes[-1]
    return make(mesh.vertices, mesh.normals, mesh.faces, resolution), mesh


def _sheet(reflector: Reflector, mesh: Mesh, walked: newton.Mesh) -> newton.Mesh:
    """What is seen of a reflector; `walked` if that was made of it."""
    sheet = reflector.mesh
    return walked if mesh is sheet else newton.mesh(sheet.vertices, sheet.normals, sheet.faces, reflector.closed is None)


@frozen
def _solve(
    points, shown_parts, mirror: Mirror, picture, pose: list, part, view: View, last_view: View, last: Ends, count: int, d_max,
    tau, max_iter, options: Options, doubted,
):  # fmt: skip
    """Virtual vertices, where the searches ended, what is reported of each vertex, and how often a sample came back.
    `doubted`: parts from this number on are mirrors, None where no doubt is asked for."""
    star, mesh = mirror.star, mirror.mesh
    lane, V, active = vertexwise.vertices(points, part, shown_parts, count)
    where = placement.place(pose, V, view)

    # The mirror between eye and vertex hides it for certain if it is convex.
    rays = options.newton != "off"
    sight = newton.look_at(mesh, where, active) if rays else None
    shadow = sight.shadow if sight is not None else mi.Bool(False)
    searched = active & ~shadow if mesh.convex else mi.Bool(active)
    triangle = active & ~shadow  # in the shadow of one that is not convex, V may be reflected, but not where a sphere would

    # The triangle, and Newton's method after it.
    warm = last.warm & ~vertexwise.was_cut(view, last_view)
    u = dr.gather(mi.Vector3f, last.u, lane)
    s = secant.solve(options.search, star, where, u, warm, triangle | (searched & warm), tau, max_iter)
    R, n, converged, residual, iterations = s.R, s.n, s.converged, s.residual, s.iterations
    behind = s.behind
    if sight is None:
        converged = s.converged & secant.settled(options.search.residual, star, where, s, s.converged)
    else:
        first, met = newton.located(mesh, star.centre, s.u, s.converged)
        converged = met if options.newton == "always" else newton.arrived(mesh, where, first, met)
        goes_on = searched & (mi.Bool(options.newton == "always") | ~converged)
        begins_anew = goes_on & ~met & ~sight.near
        candidate, promising = newton.best_candidate(mesh, where, begins_anew, shadow)
        first = dr.select(sight.near, sight.on, dr.select(begins_anew, candidate, first))
        goes_on &= dr.select(begins_anew, promising, met | sight.near)
        walked = newton.walk(mesh, where, first, goes_on, max_iter, sight.touches, shadow & ~warm)
        R, n = dr.select(goes_on, walked.R, R), dr.select(goes_on, walked.n, n)
        converged = dr.select(goes_on, walked.converged, converged)
        residual = dr.select(goes_on, walked.residual, residual)
        iterations += walked.iterations
        behind = active & ~converged & (shadow | (dr.dot(where.V - R, n) <= 0))
    reflected = searched & ~behind & (converged | (residual < search.STRAY))
    hidden = active & (behind | shadow) & ~reflected
    seen = None
    if mirror.sheet is not None:
        # A root that the mirror hides from the eye is no reflection.
        seen = ~reflected | several.is_free(mirror.sheet, R, n, where.eye, reflected)
    u = placement.unit(R - star.centre)
    R, n = placement.point_to_world(pose, R), placement.normal_to_world(pose, n)

    # Where the images go.
    if options.hidden == "clamp":
        edge = placement.point_to_world(pose, secant.outline(star, where, hidden))
        R = dr.select(hidden, edge, R)
    on_eye_ray = reflected | hidden if options.hidden == "clamp" else reflected
    if options.depth == "screen_linear":
        image = virtual.sorted_by_length(R, dr.norm(V - R), d_max, view)
    else:
        image = optics.on_ray(V, R, view.eye)
    image = dr.select(on_eye_ray, image, V)
    if options.hidden == "emdt_mirror":
        texels, camera = picture
        c, r, visible = search.texel_of(camera, V)
        visible, P, N = search.fetch(texels, camera, c, r, hidden & visible)
        image = dr.select(hidden, optics.mirrored(V, dr.select(visible, P, R), dr.select(visible, N, n)), image)

    kind, region = vertexwise.kinds(reflected, hidden)
    if sight is not None and mesh.convex and options.hidden == "cut":
        # What lies flush with a convex mirror is its own image, before it or in it: only triangles that leave it have one.
        kind = dr.select(sight.touches & reflected, mi.Float(virtual.HIDDEN), kind)
    images = virtual.Images(
        vertexwise.packets(image, kind, lane, count), vertexwise.packets(R, mi.Float(0), lane, count), seen
    )  # fmt: skip
    if seen is not None:
        reflected, converged = reflected & seen, converged & seen
        region = dr.select(seen, region, vertexwise.UNKNOWN)
    if doubted is not None:
        images.sure = vertexwise.sureness(n, searched & ~converged, points, lane, doubted, count)
    report = {
        "R": mi.Point3f(R), "n": mi.Normal3f(n), "virtual": mi.Point3f(image), "converged": mi.Bool(converged),
        "valid": mi.Bool(converged), "region": region, "iterations": iterations, "residual": mi.Float(residual),
        "border": dr.zeros(mi.Bool, count),
    }  # fmt: skip
    end = Ends(dr.empty(mi.Float, 3 * count), mi.Bool(reflected))
    dr.scatter(end.u, u, lane)
    return images, end, report, s.backtracks


@frozen
def _solve_several(
    world, shown_parts, mirror: Mirror, pose: list, part, view: View, tau, max_iter, multi: int, options: Options, doubted
):  # fmt: skip
    """Virtual vertices, triangles and reports of several reflections per vertex, and how often a sample came back."""
    star, mesh, count = mirror.star, mirror.mesh, world.vertex_count
    starts = several.begin(mirror.seeds, mesh, pose, view, world.points, part, shown_parts, count, multi)
    where, active = starts.where, starts.active
    u = placement.unit(starts.P - star.centre)
    s = secant.solve(options.search, star, where, u, mi.Bool(True), active, tau, max_iter)
    if options.newton == "off":
        exact = s.converged & secant.settled(options.search.residual, star, where, s, s.converged)
        ends = several.Ends(s.R, s.n, s.converged, exact, s.residual, s.iterations, None)
    else:
        # On from the triangle's last sample; from its start where it was lost.
        first, met = newton.located(mesh, star.centre, s.u, s.converged)
        exact = met if options.newton == "always" else newton.arrived(mesh, where, first, met)
        goes_on = active & (mi.Bool(options.newton == "always") | ~exact | starts.touches)
        met &= ~starts.touches
        first = newton.Where(dr.select(met, first.triangle, starts.on.triangle), dr.select(met, first.b, starts.on.b))
        walked = newton.walk(mesh, where, first, goes_on, max_iter, starts.touches)
        converged = dr.select(goes_on, walked.converged, exact)
        ends = several.Ends(
            dr.select(goes_on, walked.R, s.R), dr.select(goes_on, walked.n, s.n), converged, converged,
            dr.select(goes_on, walked.residual, s.residual), s.iterations + walked.iterations, None,
        )  # fmt: skip
    found = several.finish(ends, starts, mesh, pose, view, count, multi)
    made = branches.arranged(found, mesh, pose, world, part, shown_parts, view, multi, doubted)
    return made, several.per_vertex(s.backtracks, count, multi)
