"""What all methods share that move vertices: in each mirror, find every vertex's image, draw the images, put them together.

A method brings the finding: `solve(i, part)` for mirror number i, whose part has number `part`. `frame` is a
`benchharness.api.Frame`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import drjit as dr
import mitsuba as mi

from benchharness.kernels import geometry, optics, passage, surroundings
from benchharness.kernels.frozen import frozen
from benchharness.kernels.vertices import search, virtual

UNKNOWN, REFLECTED, UNREFLECTED, HIDDEN = range(4)  # benchharness.api.Vertices.region


@dataclass
class Scenery:
    """What is reflected.

    triangles     the scene in object space; attributes: radiance, black for reflectors
    world         the scene in world space
    surroundings  what is at infinity; None where no mirror can show it, or where it is dark
    objects       how many parts are objects; reflectors come after them
    enclosed      per reflector, `benchharness.scene.Scene.enclosed`
    boxes         that hold all parts; None without surroundings
    """

    triangles: geometry.Geometry
    world: geometry.Geometry
    surroundings: surroundings.Surroundings | None
    objects: int
    enclosed: tuple[bool, ...]
    boxes: passage.Boxes | None

    def parts_shown(self, others: str) -> mi.UInt32:
        """Parts from this number on are left out: other mirrors are shown "black" or "omitted"."""
        return dr.opaque(mi.UInt32, self.objects if others == "omitted" else 0xFFFF_FFFF)


@dataclass
class Solved:
    """One mirror's images.

    end       what the next frame starts from
    report    the fields of `benchharness.api.Vertices`
    drawing   how to draw them; `hider` and `back` as `kernels.virtual.draw` takes them
    counters  further work, integers per vertex

    With several reflections per vertex (`kernels.branches`):

    whole      what no triangle covers is nothing that is reflected, as long as every vertex of an object is reflected or
               hidden: the mirror is convex, and no triangle is dropped
    further    the same fields as `report`, of the second reflection and so on
    triangles  what the images are of, None for the scene itself
    own        what is asked where the mirror meets itself, None for what does not ask
    """

    images: virtual.Images
    end: Any
    report: dict[str, Any]
    drawing: virtual.Drawing
    hider: Any = None
    back: mi.Float | None = None
    whole: bool = False
    counters: dict[str, mi.UInt32] = field(default_factory=dict)
    further: list[dict[str, Any]] = field(default_factory=list)
    triangles: geometry.Geometry | None = None
    own: Any = None


def scenery(scene) -> Scenery:
    """What a `benchharness.scene.Scene` shows, uploaded."""
    triangles = geometry.of_scene(scene)
    any_light = scene.environment is not None or max(scene.background) > 0
    around = surroundings.of_scene(scene) if any_light and not all(scene.enclosed) else None
    boxes = None if around is None else passage.of_scene(scene)
    return Scenery(triangles, triangles, around, len(scene.objects), scene.enclosed, boxes)


def posed(seen: Scenery, frame) -> Scenery:
    """With every part where it is in this frame."""
    return replace(seen, world=geometry.placed(seen.triangles, frame.poses))


@dataclass
class Shown:
    """The fields of `benchharness.api.Reflection`, those of its `vertices` as `report` and `further`, and per mirror what the
    next frame starts from. `doubt`: None where it is not asked for."""

    L: mi.Color3f
    distance: mi.Float
    found: mi.Bool
    doubt: mi.Bool | None
    report: dict[str, Any]
    counters: dict[str, mi.UInt32]
    ends: list
    further: list[dict[str, Any]]


def shown(seen: Scenery, frame, solve: Callable[[int, mi.UInt32], Solved]) -> Shown:
    """The reflection in all mirrors, each drawn in its own part of the picture."""
    count = frame.view.width * frame.view.height
    numbers, solved = [dr.zeros(mi.Float, count) for _ in range(4)], []
    found, doubt = dr.zeros(mi.Bool, count), dr.zeros(mi.Bool, count) if frame.doubts else None
    for i in range(len(frame.proxies)):
        part = dr.opaque(mi.UInt32, seen.objects + i)
        one = solve(i, part)
        window = search.window(frame.view, frame.boxes[i], 1.0)
        pixel, p, reflector, back = _within(window, frame.view.width, frame.p, frame.reflector, one.back)
        own, length, covered, unsure = virtual.draw(
            one.images, one.triangles or seen.world, part, window.view, p, reflector, dr.opaque(mi.Int32, i), one.drawing,
            one.hider, back,
        )  # fmt: skip
        for target, value in zip(numbers, (own.x, own.y, own.z, length), strict=True):
            dr.scatter(target, value, pixel, covered)
        dr.scatter(found, covered, pixel, covered)
        if doubt is not None:
            dr.scatter(doubt, unsure, pixel, unsure)
        solved.append(one)
    L, distance = mi.Color3f(*numbers[:3]), numbers[3]
    for i, one in enumerate(solved):
        if one.own is not None:
            met, t = one.own.meets(frame, distance, found, frame.reflector == i)
            if doubt is not None:
                doubt |= met
            if one.own.black:
                L, distance, found = dr.select(met, 0, L), dr.select(met, t, distance), found | met
    if seen.surroundings is not None:
        # What no triangle covers is the surroundings where a ray can come from there, else unanswered.
        sky = frame.active & ~found & ~passage.walled(seen.enclosed, frame.reflector)
        far = _reflected(seen.surroundings, frame.v, frame.n, sky)
        L, distance, found = dr.select(sky, far, L), dr.select(sky, dr.inf, distance), found | sky
        if doubt is not None:
            doubt |= _may_be_lost(seen, frame, solved, sky)
    report = {name: _joined([one.report[name] for one in solved]) for name in solved[0].report}
    most = max(len(one.further) for one in solved)
    further = [{name: _joined([_place(one, k)[name] for one in solved]) for name in report} for k in range(most)]
    names = dict.fromkeys(name for one in solved for name in one.counters)
    counters = {name: _joined([_counted(one, name) for one in solved]) for name in names}
    ends = [one.end for one in solved]
    return Shown(L, distance, found, doubt, report, {"iterations": report["iterations"], **counters}, ends, further)


def _may_be_lost(seen: Scenery, frame, solved: list[Solved], sky: mi.Bool) -> mi.Bool:
    """Where nothing is drawn, and a triangle may be missing: one that has no image, and is in the way of the reflected ray."""
    assert seen.boxes is not None
    part = dr.gather(mi.Float, seen.world.points, 4 * dr.arange(mi.UInt32, seen.world.vertex_count) + 3)
    asked = mi.Bool(False)
    for i, one in enumerate(solved):
        unknown = (one.report["region"] == UNKNOWN) & (part < seen.objects)
        asked |= (frame.reflector == i) & (dr.any(unknown) if one.whole else mi.Bool(True))
    own = mi.UInt32(dr.maximum(frame.reflector, 0)) + seen.objects
    return passage.meets(seen.boxes, frame.poses, own, frame.p, optics.reflect(frame.v, frame.n), sky & asked)


def _place(one: Solved, k: int) -> dict[str, Any]:
    """The fields of a mirror's further reflection number k; zeros where it has none."""
    if k < len(one.further):
        return one.further[k]
    return {name: dr.zeros(type(array), dr.width(array)) for name, array in one.report.items()}


def _counted(one: Solved, name: str) -> mi.UInt32:
    """A counter of a mirror. Where another mirror may have several reflections per vertex and this one has one at most, its own
    is counted here."""
    if name in one.counters:
        return one.counters[name]
    if name == "reflections":
        return dr.select(one.report["valid"], mi.UInt32(1), 0)
    return one.report["iterations"] if name == "iterations" else dr.zeros(mi.UInt32, dr.width(one.report["iterations"]))


def _reflected(around: surroundings.Surroundings, v: mi.Vector3f, n: mi.Normal3f, sky: mi.Bool) -> mi.Color3f:
    """The surroundings in each pixel's own mirror direction."""
    if around.texels is None:
        return surroundings.radiance(around, v)
    return _looked_up(around, v, n, sky)


@frozen
def _looked_up(around: surroundings.Surroundings, v: mi.Vector3f, n: mi.Normal3f, sky: mi.Bool) -> mi.Color3f:
    return surroundings.radiance(around, optics.reflect(v, n), sky)


@frozen
def _within(window: search.Window, width: int, p: mi.Point3f, reflector: mi.Int32, back: mi.Float | None):
    """The pixels that a window covers, in its order, and what is there."""
    lane = dr.arange(mi.UInt32, window.view.width * window.view.height)
    row = lane // window.view.width
    pixel = (row + mi.UInt32(window.top)) * width + lane - row * window.view.width + mi.UInt32(window.left)
    seen = dr.gather(mi.Point3f, p, pixel), dr.gather(mi.Int32, reflector, pixel)
    return pixel, *seen, None if back is None else dr.gather(mi.Float, back, pixel)


def _joined(arrays: list):
    """The lanes of several arrays of one type, one after the other."""
    kind = type(arrays[0])
    if dr.depth_v(kind) == 1:
        return dr.concat(arrays)
    return kind(*(dr.concat([a[k] for a in arrays]) for k in range(len(arrays[0]))))


CUT_TURN = 0.05  # radians of turn from one frame to the next that make a cut


def was_cut(view, last) -> mi.Bool:
    """Whether the camera turned too far since the last frame for its answers to be near, or its texels are others."""
    turned = dr.norm(dr.normalize(view.w.xyz) - dr.normalize(last.w.xyz)) > CUT_TURN
    zoomed = dr.abs(dr.norm(view.right) / dr.norm(last.right) - 1) > 1e-6
    return turned | zoomed | mi.Bool((view.width, view.height) != (last.width, last.height))


def vertices(points: mi.Float, part: mi.UInt32, shown_parts: mi.UInt32, count: int) -> tuple[mi.UInt32, mi.Point3f, mi.Bool]:
    """Lane, position and whether it is searched, of every vertex: those of the mirror's own part and of parts left out
    (`Scenery.parts_shown`) are not."""
    lane = dr.arange(mi.UInt32, count)
    V = dr.gather(mi.Vector4f, points, lane)
    return lane, mi.Point3f(V.x, V.y, V.z), (mi.UInt32(V.w) != part) & (mi.UInt32(V.w) < shown_parts)


def packets(values: mi.Point3f, fourth: mi.Float, lane: mi.UInt32, count: int) -> mi.Float:
    """Points and a fourth number, 4 floats per vertex."""
    out = dr.empty(mi.Float, 4 * count)
    dr.scatter(out, mi.Vector4f(values.x, values.y, values.z, fourth), lane)
    return out


def sureness(n: mi.Normal3f, unsure: mi.Bool, points: mi.Float, lane: mi.UInt32, objects: mi.UInt32, count: int) -> mi.Float:
    """`virtual.Images.sure` of vertices `lane` of `points`: not sure is also what other mirrors show, which is not drawn."""
    part = mi.UInt32(dr.gather(mi.Float, points, 4 * (lane % (dr.width(points) // 4)) + 3))
    return packets(mi.Point3f(n), dr.select(unsure | (part >= objects), mi.Float(1), 0), lane, count)


def kinds(reflected: mi.Bool, hidden: mi.Bool) -> tuple[mi.Float, mi.UInt32]:
    """The kind of a virtual vertex and its region."""
    kind = dr.select(reflected, mi.Float(virtual.REFLECTED), dr.select(hidden, mi.Float(virtual.HIDDEN), virtual.NONE))
    return kind, dr.select(reflected, mi.UInt32(REFLECTED), dr.select(hidden, mi.UInt32(HIDDEN), mi.UInt32(UNKNOWN)))
