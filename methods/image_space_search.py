"""Image-space search: every vertex is moved to where the mirror shows it, and the moved triangles are drawn.

Per reflector, its first points and normals are rendered from the eye into a texture. For every vertex V of the rest of the
scene, a search climbs from texel to texel to the point R whose normal bisects the directions to V and to the eye; V is
placed behind R, and the scene with these virtual vertices is rasterized where the mirror is seen.
Paper: Estalella, Martin, Drettakis, Tost, "A GPU-driven algorithm for accurate interactive reflections on curved objects",
EGSR 2006; sections 4 and 5.

Assumes one reflection point per vertex, found on the reflector's closed stand-in. Fails where a vertex has several (concave
and mixed mirrors: one is found, which one depends on the start), where triangles are long (the image of an edge is
straight between its virtual end points), and where the mirror's own wall stands between a vertex and its reflection point (no
test for that: a bowl seen from inside shows what is behind it). Shows no second bounce and not the reflector itself.

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
* A vertex that starts on a texel that the reflector has left begins anew from the middle of the reflector's picture.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import drjit as dr
import mitsuba as mi
from pydantic import Field

from benchharness.api import Frame, Method, Reflection, Vertices, View
from benchharness.kernels import geometry, optics, search, virtual
from benchharness.kernels.frozen import frozen
from benchharness.scene import Scene

COLD = 0xFFFF_FFFF
PYRAMID_STRIDE = 32  # texels; first stride of a cold search
CUT_TURN = 0.05  # radians of turn from one frame to the next that make a cut

UNKNOWN, REFLECTED, UNREFLECTED, HIDDEN = range(4)


@dataclass
class Options:
    """The parameters that the kernels are compiled for."""

    score: str
    neighbourhood: str
    placement: str
    subtexel: bool
    hidden: str
    pyramid: bool
    warm: str


@dataclass
class Ends:
    """Where the searches of a frame ended, per vertex: codes of texels (`search.Window`; COLD for none), and points, 3 floats
    each."""

    codes: mi.UInt32
    points: mi.Float

    @staticmethod
    def cold(count: int) -> Ends:
        return Ends(dr.full(mi.UInt32, COLD, count), dr.zeros(mi.Float, 3 * count))


@dataclass
class State:
    """
    triangles     the scene in object space; attributes: radiance, black for reflectors
    world         the scene in world space
    surroundings  radiance at infinity, None for a scene without
    ends          per reflector, where the last searches ended
    view          the camera of the last frame
    """

    triangles: geometry.Geometry
    world: geometry.Geometry
    surroundings: mi.Color3f | None
    objects: int
    ends: list[Ends]
    view: View | None


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
    """

    score: Literal["sq", "dot"] = "sq"
    neighbourhood: Literal["cross_then_diag", "full8", "cross_only"] = "cross_then_diag"
    placement: Literal["on_ray", "mirror"] = "on_ray"
    subtexel: bool = True
    widening: Annotated[float, Field(ge=1, le=4)] = 1.25
    hidden: Literal["cut", "lookup", "simple", "full"] = "cut"
    start: Literal["pyramid", "centre"] = "pyramid"
    warm: Literal["point", "texel", "off"] = "point"
    max_iter: Annotated[int, Field(ge=1)] = 4096

    paper: ClassVar[str] = "Estalella et al. 2006"

    def prepare(self, scene: Scene) -> State:
        triangles = geometry.of_scene(scene)
        surroundings = mi.Color3f(scene.background) if max(scene.background) > 0 else None
        return State(triangles, triangles, surroundings, len(scene.objects), [], None)

    def update(self, state: State, frame: Frame) -> State:
        return replace(state, world=geometry.placed(state.triangles, frame.poses))

    def shade(self, state: State, frame: Frame) -> tuple[Reflection, State]:
        options = Options(
            self.score, self.neighbourhood, self.placement, self.subtexel, self.hidden, self.start == "pyramid", self.warm
        )
        warm = self.warm != "off" and state.view is not None
        L, distance, found, ends, reports = mi.Color3f(0), mi.Float(0), mi.Bool(False), [], []
        for i, proxy in enumerate(frame.proxies):
            part = dr.opaque(mi.UInt32, state.objects + i)
            last = state.ends[i] if warm else Ends.cold(state.triangles.vertex_count)
            window = search.window(frame.view, frame.boxes[i], self.widening)
            texels = search.render(proxy, frame.poses, part, window.view)
            images, end, report = _search(
                state.world.points, texels, window, part, frame.view, state.view if warm else frame.view,
                last, state.triangles.vertex_count, dr.opaque(mi.UInt32, self.max_iter), options,
            )  # fmt: skip
            own, length, covered = virtual.draw(
                images, state.world.points, state.world, part, frame.view, frame.p, frame.reflector,
                dr.opaque(mi.Int32, i), (texels, window.view), self.hidden == "cut",
            )  # fmt: skip
            L, distance, found = (own, length, covered) if i == 0 else (L + own, distance + length, found | covered)
            ends.append(end)
            reports.append(report)
        if state.surroundings is not None:
            # What no triangle covers is the surroundings if the scene has any, else unanswered.
            sky = frame.active & ~found
            L, distance, found = dr.select(sky, state.surroundings, L), dr.select(sky, dr.inf, distance), frame.active
        vertices = Vertices(**{name: _joined([r[name] for r in reports]) for name in reports[0] if name != "reads"})
        counters = {"iterations": vertices.iterations, "texel_reads": dr.concat([r["reads"] for r in reports])}
        reflection = Reflection(L, distance, found, vertices, counters)
        return reflection, replace(state, ends=ends, view=frame.view)


@frozen
def _search(
    points, texels, window: search.Window, part, view: View, last_view: View, last, count: int, max_iter, options: Options,
):  # fmt: skip
    """Virtual vertices, the texels where the searches ended, and what is reported of each vertex."""
    camera = window.view
    cold_column, cold_row = search.middle(texels, window)

    # Start: where the last search ended, unless the view was cut or the reflector is not there any more.
    lane = dr.arange(mi.UInt32, count)
    V = dr.gather(mi.Vector4f, points, lane)
    active = mi.UInt32(V.w) != part
    V = mi.Point3f(V.x, V.y, V.z)
    column, row = window.texel(last.codes)
    stays = (last.codes != COLD) & ~_cut(view, last_view)
    if options.warm == "point":
        c, r, seen = search.texel_of(camera, dr.gather(mi.Point3f, last.points, lane))
        seen &= search.fetch(texels, camera, c, r, stays & seen)[0]
        column, row = dr.select(seen, c, column), dr.select(seen, r, row)
    stays &= search.fetch(texels, camera, column, row, stays)[0]
    column, row = dr.select(stays, column, cold_column), dr.select(stays, row, cold_row)
    stride = dr.select(stays, 1, PYRAMID_STRIDE) if options.pyramid else mi.Int32(1)
    found = search.find(
        options.score, options.neighbourhood, options.subtexel, texels, camera, V, column, row, stride, active, max_iter
    )
    R, n, reflected, hidden = found.R, found.n, found.reflected, found.hidden

    # The image: behind the point for what is reflected, in front of the mirror for what is hidden.
    image = optics.on_ray(V, R, camera.eye) if options.placement == "on_ray" else optics.mirrored(V, R, n)
    plane_R, plane_n = R, n
    if options.hidden in ("lookup", "full"):
        c, r, seen = search.texel_of(camera, V)
        if options.hidden == "full":
            c, r, *_ = search.climb(
                "inverse", options.neighbourhood, texels, camera, V, c, r, mi.Int32(1), hidden & seen, max_iter
            )
        seen, P, N = search.fetch(texels, camera, c, r, hidden & seen)
        plane_R, plane_n = dr.select(seen, P, R), dr.select(seen, N, n)
    image = dr.select(hidden, optics.mirrored(V, plane_R, plane_n), dr.select(reflected, image, V))
    kind = dr.select(reflected, virtual.REFLECTED, dr.select(hidden, virtual.HIDDEN, virtual.NONE))
    images = virtual.Images(dr.empty(mi.Float, 4 * count), dr.empty(mi.Float, 4 * count))
    dr.scatter(images.moved, mi.Vector4f(image.x, image.y, image.z, kind), lane)
    dr.scatter(images.at, mi.Vector4f(R.x, R.y, R.z, 0), lane)

    region = dr.select(reflected, mi.UInt32(REFLECTED), dr.select(hidden, mi.UInt32(HIDDEN), mi.UInt32(UNKNOWN)))
    report = {
        "R": mi.Point3f(R), "n": mi.Normal3f(n), "virtual": mi.Point3f(image),
        "converged": found.converged, "valid": found.valid, "region": region,
        "iterations": found.iterations, "residual": found.residual, "border": found.border, "reads": found.reads,
    }  # fmt: skip
    end = Ends(dr.select(reflected | hidden, window.code(found.column, found.row), COLD), mi.Float(0))
    if options.warm == "point":
        end.points = dr.empty(mi.Float, 3 * count)
        dr.scatter(end.points, R, lane)
    return images, end, report


def _joined(arrays: list):
    """The lanes of several arrays of one type, one after the other."""
    kind = type(arrays[0])
    if dr.depth_v(kind) == 1:
        return dr.concat(arrays)
    return kind(*(dr.concat([a[k] for a in arrays]) for k in range(len(arrays[0]))))


def _cut(view: View, last: View) -> mi.Bool:
    """Whether the camera turned too far since the last frame for its searches to be near, or its texels are others."""
    turned = dr.norm(dr.normalize(view.w.xyz) - dr.normalize(last.w.xyz)) > CUT_TURN
    zoomed = dr.abs(dr.norm(view.right) / dr.norm(last.right) - 1) > 1e-6
    return turned | zoomed | mi.Bool((view.width, view.height) != (last.width, last.height))
