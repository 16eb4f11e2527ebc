"""What all methods share that move vertices: in each mirror, find every vertex's image, draw the images, put them together.

A method brings the finding: it solves one `Problem` per mirror.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import Any, Protocol

import drjit as dr
import mitsuba as mi

from benchharness.kernels import geometry, optics, passage, surroundings
from benchharness.kernels import pixels as spreading
from benchharness.kernels.frozen import frozen
from benchharness.kernels.types import Frame, Reflection, SceneLike, Vertices, View
from benchharness.kernels.vertices import adjacency, exact, meshwalk, textures, virtual
from benchharness.kernels.vertices.problems import UNKNOWN, Problem


@dataclass
class Scenery:
    """What is reflected.

    triangles     the scene in object space; attributes: radiance, black for reflectors
    world         the scene in world space
    surroundings  what is at infinity; None where no mirror can show it, or where it is dark
    objects       how many parts are objects; reflectors come after them
    enclosed      per reflector, `benchharness.scene.Scene.enclosed`
    boxes         that hold all parts; None without surroundings
    beside        `adjacency.neighbours`, None where no ray asks
    """

    triangles: geometry.Geometry
    world: geometry.Geometry
    surroundings: surroundings.Surroundings | None
    objects: int
    enclosed: tuple[bool, ...]
    boxes: passage.Boxes | None
    beside: mi.UInt32 | None

    def parts_shown(self, others: str) -> mi.UInt32:
        """Parts from this number on are left out: other mirrors are shown "black" or "omitted"."""
        return dr.opaque(mi.UInt32, self.objects if others == "omitted" else 0xFFFF_FFFF)


class SelfMeeting(Protocol):
    """What is asked where a mirror meets itself, and whether it is black there."""

    black: bool

    def meets(self, frame: Frame, distance: mi.Float, found: mi.Bool, here: mi.Bool) -> tuple[mi.Bool, mi.Float]:
        """Whether the ray that a pixel reflects meets the mirror before what is drawn there, and how far away."""
        ...


@dataclass
class Solved:
    """One mirror's images.

    images     virtual vertices
    end        what the next frame starts from
    vertices   what was found of each vertex; with several reflections per vertex, `further` has the rest
    drawing    how to draw them
    hider      what is asked whether the mirror hides a point, needed for "cut"
    back       nearness of the mirror's nearest back at each pixel, None if nothing can be behind it
    whole      what no triangle covers is nothing that is reflected, as long as every vertex of an object is reflected or
               hidden: the mirror is convex, and no triangle is dropped
    counters   further work, integers per vertex
    triangles  what the images are of where a vertex has several (`branches`), None for the scene itself
    own        what is asked where the mirror meets itself, None for what does not ask
    """

    images: virtual.Images
    end: Any
    vertices: Vertices
    drawing: virtual.Drawing
    hider: virtual.Hider | None = None
    back: mi.Float | None = None
    whole: bool = False
    counters: dict[str, mi.UInt32] = field(default_factory=dict)
    triangles: geometry.Geometry | None = None
    own: SelfMeeting | None = None


def scenery(scene: SceneLike, resolve: str = "interpolate") -> Scenery:
    """What a `benchharness.scene.Scene` shows, uploaded. `resolve`: what pixels show, "interpolate" or "ray"."""
    triangles = geometry.of_scene(scene)
    any_light = scene.environment is not None or max(scene.background) > 0
    around = surroundings.of_scene(scene) if any_light and not all(scene.enclosed) else None
    boxes = None if around is None else passage.of_scene(scene)
    beside = adjacency.neighbours(scene) if resolve == "ray" else None
    return Scenery(triangles, triangles, around, len(scene.objects), tuple(scene.enclosed), boxes, beside)


def posed(seen: Scenery, frame: Frame) -> Scenery:
    """The scenery with every part where it is in this frame."""
    return replace(seen, world=geometry.placed(seen.triangles, frame.poses))


def shown(
    seen: Scenery,
    frame: Frame,
    solve: Callable[[int, Problem], Solved],
    *,
    other_mirrors: str,
    max_iter: int,
    last_view: View | None,
) -> tuple[Reflection, list]:
    """The reflection in all mirrors, each drawn in its own part of the picture, and per mirror what the next frame starts from.

    solve          solves the problem of mirror number i
    other_mirrors  as `Scenery.parts_shown` has them
    last_view      the camera of the last frame, None if nothing is known of it
    """
    problem = Problem(
        world=seen.world,
        part=mi.UInt32(0),  # of each mirror in turn
        shown_parts=seen.parts_shown(other_mirrors),
        mirrors=dr.opaque(mi.UInt32, seen.objects) if frame.doubts else None,
        poses=frame.poses,
        view=frame.view,
        last_view=frame.view if last_view is None else last_view,
        max_iter=dr.opaque(mi.UInt32, max_iter),
    )
    solved, drawn = [], []
    for i in range(len(frame.proxies)):
        part = dr.opaque(mi.UInt32, seen.objects + i)
        one = solve(i, replace(problem, part=part))
        window, layer = textures.window(frame.view, frame.boxes[i], 1.0), dr.opaque(mi.Int32, i)
        pixel, target = _within(window, frame.view.width, frame.p, frame.reflector, layer, one.back)
        nearest = virtual.nearest(one.images, one.triangles or seen.world, part, target, one.drawing, one.hider)
        solved.append(one)
        drawn.append(_Drawn(pixel, target, nearest, one.drawing.depth))
    picture = _interpolated(frame, drawn) if seen.beside is None else _by_rays(seen, seen.beside, frame, drawn)
    L, distance, found, doubt = picture.L, picture.distance, picture.found, picture.doubt
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
    vertices, counters = _reported(solved)
    return Reflection(L, distance, found, vertices, {**counters, **picture.counters}, doubt), [one.end for one in solved]


@dataclass
class _Drawn:
    """One mirror's images drawn: the pixels of its part of the picture, what is there, the nearest virtual triangles, and how
    to interpolate them."""

    pixel: mi.UInt32
    target: virtual.Target
    nearest: virtual.Nearest
    depth: str


def _interpolated(frame: Frame, drawn: list[_Drawn]) -> Reflection:
    """What virtual triangles show."""
    count = frame.view.width * frame.view.height
    numbers, found = [dr.zeros(mi.Float, count) for _ in range(4)], dr.zeros(mi.Bool, count)
    doubt = dr.zeros(mi.Bool, count) if frame.doubts else None
    for one in drawn:
        shows = virtual.interpolated(one.nearest, one.target, one.depth)
        for values, value in zip(numbers, (*shows.L, shows.distance), strict=True):
            dr.scatter(values, value, one.pixel, shows.covered)
        dr.scatter(found, shows.covered, one.pixel, shows.covered)
        if doubt is not None:
            dr.scatter(doubt, shows.doubt, one.pixel, shows.doubt)
    return Reflection(mi.Color3f(*numbers[:3]), numbers[3], found, doubt=doubt)


def _by_rays(seen: Scenery, beside: mi.UInt32, frame: Frame, drawn: list[_Drawn]) -> Reflection:
    """What the pixels' own rays meet of what virtual triangles are images of."""
    count = frame.view.width * frame.view.height
    if dr.width(frame.pixels) == 0:  # no mirror in view
        nothing = dr.zeros(mi.Float, count)
        doubt = dr.zeros(mi.Bool, count) if frame.doubts else None
        return Reflection(mi.Color3f(nothing), nothing, dr.zeros(mi.Bool, count), None, {"unmet": mi.UInt32(0)}, doubt)
    number = exact.numbers(frame.pixels, count)
    names = dr.full(mi.UInt32, adjacency.NONE, dr.width(frame.pixels))
    for one in drawn:
        own = one.target.own
        named = virtual.named(one.nearest, one.target, seen.world.face_count)
        dr.scatter(names, named, dr.gather(mi.UInt32, number, one.pixel, own), own)
    asked = meshwalk.Asked(seen.world, beside, dr.opaque(mi.UInt32, seen.objects))
    shows, pixels = exact.shown(asked, frame, number, names, frame.active & passage.walled(seen.enclosed, frame.reflector))
    x, y, z, distance, found = spreading.spread([*shows.L, shows.distance, shows.found], frame.pixels, frame.view)
    doubt = exact.doubted(shows, pixels) if frame.doubts else None
    return Reflection(mi.Color3f(x, y, z), distance, frame.active & found, None, {"unmet": mi.UInt32(shows.unmet)}, doubt)


def _reported(solved: list[Solved]) -> tuple[Vertices, dict[str, mi.UInt32]]:
    """What was found of the vertices in all mirrors, and the counters."""
    vertices = _joined_vertices([one.vertices for one in solved])
    most = max(len(one.vertices.further) for one in solved)
    vertices.further = [_joined_vertices([_place(one.vertices, k) for one in solved]) for k in range(most)]
    names = dict.fromkeys(name for one in solved for name in one.counters)
    counters = {name: _joined([_counted(one, name) for one in solved]) for name in names}
    return vertices, {"iterations": vertices.iterations, **counters}


def _may_be_lost(seen: Scenery, frame: Frame, solved: list[Solved], sky: mi.Bool) -> mi.Bool:
    """Where nothing is drawn, and a triangle may be missing: one that has no image, and is in the way of the reflected ray."""
    assert seen.boxes is not None
    part = dr.gather(mi.Float, seen.world.points, 4 * dr.arange(mi.UInt32, seen.world.vertex_count) + 3)
    asked = mi.Bool(False)
    for i, one in enumerate(solved):
        unknown = (one.vertices.region == UNKNOWN) & (part < seen.objects)
        asked |= (frame.reflector == i) & (dr.any(unknown) if one.whole else mi.Bool(True))
    own = mi.UInt32(dr.maximum(frame.reflector, 0)) + seen.objects
    return passage.meets(seen.boxes, frame.poses, own, frame.p, optics.reflect(frame.v, frame.n), sky & asked)


NAMES = tuple(f.name for f in fields(Vertices) if f.name != "further")


def _joined_vertices(parts: list[Vertices]) -> Vertices:
    """The lanes of several mirrors' vertices, one after the other; `further` is left empty."""
    return Vertices(**{name: _joined([getattr(part, name) for part in parts]) for name in NAMES})


def _place(vertices: Vertices, k: int) -> Vertices:
    """A mirror's further reflection number k; zeros where it has none."""
    if k < len(vertices.further):
        return vertices.further[k]
    arrays = {name: getattr(vertices, name) for name in NAMES}
    return Vertices(**{name: dr.zeros(type(array), dr.width(array)) for name, array in arrays.items()})


def _counted(one: Solved, name: str) -> mi.UInt32:
    """A counter of a mirror. Where another mirror may have several reflections per vertex and this one has one at most, its own
    is counted here."""
    if name in one.counters:
        return one.counters[name]
    if name == "reflections":
        return dr.select(one.vertices.valid, mi.UInt32(1), 0)
    iterations = one.vertices.iterations
    return iterations if name == "iterations" else dr.zeros(mi.UInt32, dr.width(iterations))


def _reflected(around: surroundings.Surroundings, v: mi.Vector3f, n: mi.Normal3f, sky: mi.Bool) -> mi.Color3f:
    """The surroundings in each pixel's own mirror direction."""
    if around.texels is None:
        return surroundings.radiance(around, v)
    return _looked_up(around, v, n, sky)


@frozen
def _looked_up(around: surroundings.Surroundings, v: mi.Vector3f, n: mi.Normal3f, sky: mi.Bool) -> mi.Color3f:
    return surroundings.radiance(around, optics.reflect(v, n), sky)


@frozen
def _within(
    window: textures.Window, width: int, p: mi.Point3f, reflector: mi.Int32, layer: mi.Int32, back: mi.Float | None
) -> tuple[mi.UInt32, virtual.Target]:
    """The pixels that a window covers, in its order, and what is there of mirror number `layer`."""
    lane = dr.arange(mi.UInt32, window.view.width * window.view.height)
    row = lane // window.view.width
    pixel = (row + mi.UInt32(window.top)) * width + lane - row * window.view.width + mi.UInt32(window.left)
    own, p = dr.gather(mi.Int32, reflector, pixel) == layer, dr.gather(mi.Point3f, p, pixel)
    return pixel, virtual.Target(window.view, p, own, None if back is None else dr.gather(mi.Float, back, pixel))


def _joined(arrays: list):
    """The lanes of several arrays of one type, one after the other."""
    kind = type(arrays[0])
    if dr.depth_v(kind) == 1:
        return dr.concat(arrays)
    return kind(*(dr.concat([a[k] for a in arrays]) for k in range(len(arrays[0]))))
