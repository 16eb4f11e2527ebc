"""Image-space search: every vertex is moved to where the mirror shows it, and the moved triangles are drawn.

Per reflector, its first points and normals are rendered from the eye into a texture. For every vertex V of the rest of the
scene, a search climbs from texel to texel to the point R whose normal bisects the directions to V and to the eye; V is
placed behind R, and the scene with these virtual vertices is rasterized where the mirror is seen.
Paper: Estalella, Martin, Drettakis, Tost, "A GPU-driven algorithm for accurate interactive reflections on curved objects",
EGSR 2006; sections 4 and 5.

The paper assumes one reflection point per vertex, on the reflector's closed stand-in. Where a vertex has several (concave
and mixed mirrors), one is found, which one depends on the start. `multi` lifts that. Fails
where triangles are long (the image of an edge is straight between its virtual end points). Shows second
bounces with `other_mirrors = "reflective"` alone, which the paper sketches in section 7, and none of a mirror in itself.

Where we differ:
* `placement = "mirror"` is the paper's: V mirrored in the plane at the best texel. It multiplies the error of the texel by
  the mirror's curvature; "on_ray" puts V on the eye's ray through R, which keeps the error within the texel.
* The printed equation (1), for hidden vertices, has the wrong sign: kernels.optics.mirrored.
* `hidden = "cut"` ends a triangle where it becomes hidden. The paper keeps its hidden vertices and mirrors them in a plane of
  the mirror: right for the topology, but a triangle that is large beside the mirror is swept across it.
* `subtexel` goes on from the best texel to where half vector and normal agree between texels (one Gauss-Newton step).
* `warm = "point"` carries the reflection point itself from frame to frame and looks where it is seen now. The paper carries
  its texel, which a mirror that moves or grows on the screen leaves behind.
* `start = "pyramid"` lets a cold search begin with wide strides; the paper starts at the centre with single texels.
* `multi` finds up to so many reflections per vertex: searches climb from texels spread over the mirror's picture, and triangles
  join what belongs together (kernels.vertices.several, .branches). Rays ask whether the mirror hides a reflection from the
  eye or from the vertex. On a mirror of few texels many searches
  end between texels that agree too little to tell a reflection from none; what is within two degrees of it is drawn.
* A vertex that starts on a texel that the reflector has left begins anew from the middle of the reflector's picture. So does,
  on a mirror that is not convex, one that starts warm and ends where half vector and normal do not agree.
* A mirror that is not convex may stand between a vertex and its reflection point, as a bowl's wall does. With `own = "black"`,
  a ray per pixel asks whether the mirror meets itself: there it is black.
* Before a flat sheet, a vertex whose search ends at the sheet's edge is mirrored in its plane (kernels.vertices.flatsheet).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import drjit as dr
import mitsuba as mi
from pydantic import Field

from benchharness.api import Frame, Knob, Method, Reflection, Vertices
from benchharness.kernels import normalmap, optics, placement
from benchharness.kernels.frozen import frozen
from benchharness.kernels.vertices import (
    branches,
    mirrormesh,
    problems,
    scenery,
    search,
    several,
    sight,
    textures,
    vertexwise,
    virtual,
)
from benchharness.kernels.vertices.mirrormesh import MirrorMesh
from benchharness.scene import Reflector, Scene

COLD = 0xFFFF_FFFF
NEAR = 0.03  # |half vector - normal| of an end that is drawn; what a texel turns the normal by on a mirror 70 texels wide
PYRAMID_STRIDE = 32  # texels; first stride of a cold search
SPLIT_PX = 1.0  # where nothing is said; images in small mirrors are off by half of it, now so and now so, and bend by chance


@dataclass
class Options:
    """The parameters that the kernels are compiled for, as `ImageSpaceSearch` has them. `pyramid`: start is "pyramid"."""

    search: search.Options
    placement: str
    hidden: str
    pyramid: bool
    warm: str


@dataclass
class Ends:
    """Where the searches of a frame ended, per vertex: codes of texels (`textures.Window`; COLD for none), and points, 3 floats
    each."""

    codes: mi.UInt32
    points: mi.Float

    @staticmethod
    def cold(count: int) -> Ends:
        return Ends(dr.full(mi.UInt32, COLD, count), dr.zeros(mi.Float, 3 * count))


@dataclass
class Mirror:
    """One reflector.

    mesh   the mesh that its picture is of
    sheet  the one that is seen of it
    seeds  where searches for several reflections may start, None where there is one at most
    """

    mesh: MirrorMesh
    sheet: MirrorMesh
    seeds: several.Seeds | None


@dataclass
class State(vertexwise.State):
    """mirrors: per reflector, its meshes."""

    mirrors: list[Mirror]


@dataclass(frozen=True)
class ImageSpaceSearch(Method):
    """
    score          "sq" compares half vector and normal by distance, "dot" by dot product as in the paper
    neighbourhood  which texels are tried: the cross and then the diagonals, all eight, or the cross alone (gets stuck)
    placement      where V goes: on the eye's ray through R, or its mirror image in the plane at R (the paper)
    subtexel       refine R between texels
    widening       the texture sees this much more than the picture in tan(fov / 2)
    hidden         triangles with hidden vertices: "cut" where they become hidden; or drawn with V mirrored in the plane of
                   the texel that V is seen in ("lookup"), of the one where the search ended ("simple", the paper in
                   practice), or of the one that its mirror image is reflected at ("full", the paper)
    start          cold search: "pyramid" halves the stride from 32 texels, "centre" takes single texels
    warm           start where the last frame's search ended: at its point, seen anew ("point"), at its texel as in the
                   paper ("texel"), or start cold in every frame ("off")
    max_iter       neighbourhoods after which a search gives up
    other_mirrors  other mirrors in this one: "black"; "reflective", which "ray" is needed for (kernels.vertices.higherorder);
                   or "omitted" to show what is behind them
    self_reflection  the mirror in itself, where it is not convex: "black", which takes one ray per pixel of it, or "omitted"
    multi          reflections per vertex that are found and drawn; with more than one, every search is a cold one from
                   texels spread over the mirror's picture, and hidden vertices are "cut"
    resolve        what a pixel shows: "interpolate" between the corners of the triangle that covers it, as the paper does, or
                   what its own "ray" meets of the triangles that it and the pixels around it name (kernels.vertices.exact)
    lod_px         levels of detail: of every part the coarsest whose error is seen no larger than this in a mirror, pixels;
                   0 for none. Only with "ray", which shows the part itself and not what stands for it
    split_px       edges are split whose images are off a straight line by more than this, pixels; 0 for none. None: 1, and
                   none where `multi` is more than 1, with which no edge can be split, and with `placement = "mirror"`,
                   whose images are off by more than that (kernels.vertices.tessellation)
    """

    score: Literal["sq", "dot"] = "sq"
    neighbourhood: Literal["cross_then_diag", "full8", "cross_only"] = "cross_then_diag"
    placement: Literal["on_ray", "mirror"] = "on_ray"
    subtexel: bool = True
    widening: Annotated[float, Field(ge=1, le=4)] = 1.25
    hidden: Literal["cut", "lookup", "simple", "full"] = "cut"
    start: Literal["pyramid", "centre"] = "pyramid"
    warm: Literal["point", "texel", "off"] = "point"
    max_iter: Annotated[int, Field(ge=1, le=65536)] = 4096
    other_mirrors: Literal["black", "reflective", "omitted"] = "black"
    self_reflection: Literal["black", "omitted"] = "black"
    multi: Annotated[int, Field(ge=1, le=8)] = 1
    resolve: Literal["interpolate", "ray"] = "interpolate"
    lod_px: Annotated[float, Field(ge=0, le=1e3)] = 0.0
    split_px: Annotated[float, Field(ge=0, le=1e3)] | None = None

    knobs: ClassVar[tuple[Knob, ...]] = (
        Knob("split_px", (16.0, 4.0, 2.0, 1.0, 0.5, 0.25)),
        Knob("split_px", (64.0, 16.0, 4.0, 1.0), {"resolve": "ray"}),
        Knob("multi", (1, 2, 4), split=True),
    )
    family: ClassVar[str] = "moved vertices"
    paper: ClassVar[str] = "Estalella et al. 2006"
    limits: ClassVar[dict[str, str]] = {
        "F-15": "where two triangles' edges end in a third's, less than two pixels of bend open a crack between their images",
        "F-20, F-21": "half a focal length away roots lie so close that a search may stop beside the one it calls its own",
        "F-20": "one reflection per vertex is looked for, and nothing says that there are more; `multi` finds them",
        "F-21": "at a focus half vector and normal agree all over the mirror, and one root cannot be told from the next",
        "F-25, F-26": "on bumps, where two roots are about to meet, rounding moves the point that is found by pixels",
    }

    def __post_init__(self) -> None:
        scenery.check(self.resolve, self.lod_px, self.split_px, self.multi, "image_space_search", self.other_mirrors)
        if self.multi > 1 and self.hidden != "cut":
            raise ValueError(f'image_space_search: multi {self.multi} with hidden "{self.hidden}"; accepted: "cut"')

    def refuses(self, scene: Scene) -> str | None:
        return normalmap.refusal(scene.reflectors)

    def prepare(self, scene: Scene) -> State:
        mirrors = [_mirror(reflector, self.multi) for reflector in scene.reflectors]
        searched = [reflector.closed or reflector.mesh for reflector in scene.reflectors]
        pixels = scenery.pixels(self.split_px, told=self.multi == 1 and self.placement == "on_ray", unsaid=SPLIT_PX)
        seen = scenery.of_scene(scene, searched, self.resolve, self.lod_px, pixels, others=self.other_mirrors)
        return State(seen, [], None, mirrors)

    def update(self, state: State, frame: Frame) -> State:
        return replace(state, scenery=scenery.posed(state.scenery, frame))

    def shade(self, state: State, frame: Frame) -> tuple[Reflection, State]:
        how = search.Options(self.score, self.neighbourhood, self.subtexel)
        options = Options(how, self.placement, self.hidden, self.start == "pyramid", self.warm)
        drawing = virtual.Drawing("cut" if self.hidden == "cut" else "keep")

        def solve(i: int, problem: problems.Problem, last: Ends) -> vertexwise.Solved:
            mirror, proxy = state.mirrors[i], frame.proxies[i]
            mesh, seeds, pose = mirror.mesh, mirror.seeds, problem.pose
            window = textures.window(frame.view, frame.boxes[i], self.widening)
            picture = textures.render(proxy, frame.poses, problem.part, window.view)
            own = branches.meeting(i, mirror.sheet, pose, self.self_reflection, frame.doubts)
            if seeds is not None:
                made, reads = _search_several(problem, mesh, seeds, picture, self.multi, options)
                back = virtual.nearest_back(proxy, frame.poses, problem.part, frame.view) if seeds.closed else None
                return branches.solved(made, sight.Shadow(mesh, pose), back, drawing, own, {"texel_reads": reads})
            roots: Literal["one", "several"] = "one" if mesh.convex else "several"

            def find(asked: problems.Problem, start: Ends) -> problems.Found:
                images, vertices, end, reads = _search(asked, picture, window, start, options, roots)
                return problems.Found(images, vertices, end, {"texel_reads": reads})

            whole = mesh.convex or problem.plane is not None
            return vertexwise.Solved(find(problem, last), drawing, picture, whole=whole, own=own, further=find)

        return vertexwise.shown(
            state,
            frame,
            solve,
            Ends.cold,
            other_mirrors=self.other_mirrors,
            max_iter=self.max_iter,
            warm=self.warm != "off",
            sheets=[mirror.sheet for mirror in state.mirrors] if self.multi == 1 else None,
        )


def _mirror(reflector: Reflector, multi: int) -> Mirror:
    """What its picture is of is the closed stand-in or the sheet. If that is convex, a vertex has one reflection."""
    sheet, mesh, backs = reflector.mesh, reflector.closed or reflector.mesh, reflector.closed is None
    solid = mirrormesh.build(mesh.vertices, mesh.normals, mesh.faces, backs)
    if solid.convex:
        return Mirror(solid, solid, None)
    open_ = solid if mesh is sheet else mirrormesh.build(sheet.vertices, sheet.normals, sheet.faces, backs)
    return Mirror(solid, open_, several.seeds(mesh.vertices, mesh.normals, mesh.faces, backs) if multi > 1 else None)


@frozen
def _search(
    problem: problems.Problem,
    picture: textures.Texture,
    window: textures.Window,
    last: Ends,
    options: Options,
    roots: Literal["one", "several"],
) -> tuple[virtual.Images, Vertices, Ends, mi.UInt32]:
    """Virtual vertices, what was found of each vertex, the texels where the searches ended, and texels read. `roots`: how many
    reflections a vertex may have."""
    lane, V, _ = problem.vertices()
    found = _found(problem, picture, window, last, options, roots)
    R, n, reflected, hidden = found.R, found.n, found.reflected, found.hidden

    # The image: behind the point for what is reflected, in front of the mirror for what is hidden.
    image = optics.on_ray(V, R, picture.view.eye) if options.placement == "on_ray" else optics.mirrored(V, R, n)
    plane_R, plane_n = R, n
    if options.hidden in ("lookup", "full"):
        c, r, seen = picture.seen_at(V)
        if options.hidden == "full":
            inverse = replace(options.search, score="inverse")
            start = search.Start(c, r, mi.Int32(1))
            top = search.climb(inverse, picture, V, start, hidden & seen, problem.max_iter)
            c, r = top.column, top.row
        seen, P, N = picture.at(c, r, hidden & seen)
        plane_R, plane_n = dr.select(seen, P, R), dr.select(seen, N, n)
    image = dr.select(hidden, optics.mirrored(V, plane_R, plane_n), dr.select(reflected, image, V))
    answer = problems.Answer(
        R=R,
        n=n,
        image=image,
        reflected=reflected,
        hidden=hidden,
        converged=found.converged,
        unsure=reflected & ~found.converged & (found.residual > NEAR),
        residual=found.residual,
        iterations=found.iterations,
        border=found.border,
    )
    images, vertices = problems.images_of(problem, answer)
    vertices.valid = found.valid
    end = Ends(dr.select(reflected | hidden, window.code(found.column, found.row), COLD), mi.Float(0))
    if options.warm == "point":
        end.points = dr.empty(mi.Float, 3 * problem.count)
        dr.scatter(end.points, R, lane)
    return images, vertices, end, found.reads


def _found(
    problem: problems.Problem,
    picture: textures.Texture,
    window: textures.Window,
    last: Ends,
    options: Options,
    roots: Literal["one", "several"],
) -> search.Found:
    """What the search of every vertex ended with."""
    cold_column, cold_row = textures.middle(picture, window)

    # Start: where the last search ended, unless the view was cut or the reflector is not there any more.
    lane, V, active = problem.vertices()
    column, row = window.texel(last.codes)
    stays = (last.codes != COLD) & ~problems.was_cut(problem.view, problem.last_view)
    if options.warm == "point":
        c, r, seen = picture.seen_at(dr.gather(mi.Point3f, last.points, lane))
        seen &= picture.at(c, r, stays & seen)[0]
        column, row = dr.select(seen, c, column), dr.select(seen, r, row)
    stays &= picture.at(column, row, stays)[0]
    stride = dr.select(stays, 1, PYRAMID_STRIDE) if options.pyramid else mi.Int32(1)
    start = search.Start(dr.select(stays, column, cold_column), dr.select(stays, row, cold_row), stride)
    found = search.find(options.search, picture, V, start, active, problem.max_iter)
    if roots == "several":
        # What began warm and came to nothing begins anew: the last frame's point may be a root of another kind.
        lost = stays & ~found.converged & (found.residual > NEAR)
        stride = dr.select(lost, PYRAMID_STRIDE, 1) if options.pyramid else mi.Int32(1)
        start = search.Start(cold_column, cold_row, stride)
        again = search.find(options.search, picture, V, start, active & lost, problem.max_iter)
        iterations, reads = found.iterations + again.iterations, found.reads + again.reads
        found = dr.select(lost, again, found)
        found.iterations, found.reads = iterations, reads
    return found


@frozen
def _search_several(
    problem: problems.Problem,
    mesh: MirrorMesh,
    seeds: several.Seeds,
    picture: textures.Texture,
    multi: int,
    options: Options,
) -> tuple[branches.Arranged, mi.UInt32]:
    """Virtual vertices, triangles and what was found of several reflections per vertex, and texels read per vertex."""
    pose = problem.pose
    starts = several.begin(seeds, mesh, problem, multi)
    column, row, seen = picture.seen_at(placement.point_to_world(pose, starts.P))
    active = starts.active & picture.at(column, row, starts.active & seen)[0]
    found = search.find(options.search, picture, starts.V, search.Start(column, row, mi.Int32(1)), active, problem.max_iter)
    ends = several.Ends(
        R=placement.mirror_frame(pose, found.R, problem.view).V,
        n=placement.normal_to_mirror(pose, found.n),
        reflected=found.valid | (found.reflected & (found.residual < NEAR)),
        converged=found.valid,
        residual=found.residual,
        iterations=found.iterations,
        on=None,
    )
    several_found = several.finish(ends, starts, mesh, problem, multi)
    made = branches.arranged(several_found, mesh, problem, multi, mirrored=options.placement == "mirror")
    return made, several.per_vertex(dr.select(active, found.reads, 0), problem.count, multi)
