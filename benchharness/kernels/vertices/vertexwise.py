"""What all methods share that move vertices: in each mirror, find every vertex's image, draw the images, put them together.

A method brings the finding: it solves one `Problem` per mirror, or per group of mirrors that it can solve together.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, TypeVar

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels import geometry, lanes, optics, passage, planes, surroundings
from benchharness.kernels import pixels as spreading
from benchharness.kernels.frozen import frozen
from benchharness.kernels.types import Frame, Reflection, Vertices, View
from benchharness.kernels.vertices import (
    adjacency,
    drawlist,
    edgeerror,
    exact,
    flatsheet,
    higherorder,
    meshwalk,
    nearlist,
    reporting,
    several,
    sight,
    tessellation,
    textures,
    virtual,
)
from benchharness.kernels.vertices.mirrormesh import MirrorMesh
from benchharness.kernels.vertices.problems import UNKNOWN, Found, Problem
from benchharness.kernels.vertices.scenery import Scenery


class SelfMeeting(Protocol):
    """What is asked where a mirror meets itself, and whether it is black there."""

    black: bool

    def meets(self, frame: Frame, distance: mi.Float, found: mi.Bool, here: mi.Bool) -> tuple[mi.Bool, mi.Float]:
        """Whether the ray that a pixel reflects meets the mirror before what is drawn there, and how far away."""
        ...


@dataclass
class Kept:
    """What the next frame needs of a group of mirrors: where its searches ended, in which draw list, and what that was split
    into."""

    end: Any
    choice: drawlist.Choice | None
    pieces: tessellation.Tessellated | None


@dataclass
class State:
    """What all these methods keep.

    scenery  what is reflected
    ends     per group of mirrors, what was kept of the last frame
    view     its camera; None before the first
    """

    scenery: Scenery
    ends: list[Kept]
    view: View | None


S = TypeVar("S", bound=State)


@dataclass
class Solved:
    """The images in a group of mirrors.

    found      what was found of the problem's vertices; of several reflections per vertex, `Vertices.further` has the rest
    drawing    how to draw them
    hider      what is asked whether the mirror hides a point, needed for "cut"
    back       nearness of the mirror's nearest back at each pixel, None if nothing can be behind it
    whole      what no triangle covers is nothing that is reflected, as long as every vertex of an object is reflected or
               hidden: the mirror is convex, and no triangle is dropped
    triangles  what the images are of where a vertex has several (`branches`), None for the scene itself
    own        per number of a mirror, what is asked where it meets itself; those that do not ask are missing
    further    finds the same of other vertices, from where it is told to start; None where no edge can be split
    """

    found: Found
    drawing: virtual.Drawing
    hider: virtual.Hider | None = None
    back: mi.Float | None = None
    whole: bool = False
    triangles: geometry.Geometry | None = None
    own: dict[int, SelfMeeting] = field(default_factory=dict)
    further: Callable[[Problem, Any], Found] | None = None


def shown(
    state: S,
    frame: Frame,
    solve: Callable[[int, Problem, Any], Solved],
    cold: Callable[[int], Any],
    *,
    other_mirrors: str,
    max_iter: int,
    warm: bool,
    sheets: list[MirrorMesh] | None,
) -> tuple[Reflection, S]:
    """The reflection in all mirrors, and the state that the next frame starts from.

    solve          solves the problem of group number g, from what it ended with in the last frame
    cold           what there is to start from where nothing is known, of so many vertices
    other_mirrors  as `Scenery.parts_shown` has them
    warm           whether the last frame is started from
    sheets         what is seen of each mirror, to be asked which reflections it hides; None where solvers asked it
    """
    seen, last_view = state.scenery, state.view if warm else None
    parts = seen.parts_shown(other_mirrors)
    problem = Problem(
        world=seen.world,
        part=mi.UInt32(0),  # of each group in turn
        shown_parts=dr.opaque(mi.UInt32, parts),
        mirrors=dr.opaque(mi.UInt32, seen.objects) if frame.doubts else None,
        poses=frame.poses,
        view=frame.view,
        last_view=frame.view if last_view is None else last_view,
        max_iter=dr.opaque(mi.UInt32, max_iter),
    )
    drawn = []
    for g, group in enumerate(seen.groups):
        before = state.ends[g] if last_view is not None else None
        drawn.append(_drawn(seen, frame, problem, group, lambda p, end, g=g: solve(g, p, end), parts, before, cold))
    picture = _interpolated(frame, drawn) if seen.beside is None else _by_rays(seen, seen.beside, frame, drawn)
    L, distance, found, doubt = picture.L, picture.distance, picture.found, picture.doubt
    for one in drawn:
        for i, own in one.solved.own.items():
            met, t = own.meets(frame, distance, found, frame.reflector == i)
            if doubt is not None:
                doubt |= met
            if own.black:
                L, distance, found = dr.select(met, 0, L), dr.select(met, t, distance), found | met
    if seen.surroundings is not None:
        # What no triangle covers is the surroundings where a ray can come from there, else unanswered.
        sky = frame.active & ~found & ~passage.walled(seen.enclosed, frame.reflector)
        far = _reflected(seen.surroundings, frame.v, frame.n, sky)
        L, distance, found = dr.select(sky, far, L), dr.select(sky, dr.inf, distance), found | sky
        if doubt is not None:
            doubt |= _may_be_lost(seen, frame, drawn, sky)
    vertices = _found(drawn)
    if sheets is not None:
        vertices.valid = several.valid(sheets, seen.objects, frame, seen.world.points, vertices)
    counters = reporting.counters([one.told for one in drawn])
    reflection = Reflection(L, distance, found, vertices, {**counters, **picture.counters}, doubt)
    ends = [Kept(one.solved.found.end, one.choice, one.pieces) for one in drawn]
    return reflection, replace(state, ends=ends, view=frame.view)


def _found(drawn: list[_Drawn]) -> Vertices:
    """What was found of the vertices of the scene in all mirrors."""
    found: dict[int, Vertices] = {}
    for one in drawn:
        for k, i in enumerate(one.group):
            vertices = one.solved.found.vertices
            found[i] = vertices if one.choice is None else reporting.of_scene(vertices, one.choice.lanes[k])
    return reporting.of_mirrors([found[i] for i in sorted(found)])


def _drawn(
    seen: Scenery,
    frame: Frame,
    problem: Problem,
    group: list[int],
    solve: Callable[[Problem, Any], Solved],
    parts: int,
    last: Kept | None,
    cold: Callable[[int], Any],
) -> _Drawn:
    """A group of mirrors, solved and drawn."""
    choice, stock, part = None, seen.stock, dr.opaque(mi.UInt32, seen.objects + group[0])
    end = None if last is None else last.end
    plane = seen.plane_of[group[0]] if len(group) == 1 else None
    if plane is not None:
        (plane,) = planes.placed([plane], frame.poses, [part])
    problem = replace(problem, part=part, plane=plane)
    if stock is not None:
        old = None if last is None else last.choice
        if seen.near is None:
            choice = drawlist.chosen(stock, group, frame, seen.objects, parts, seen.lod_px, old)
        else:
            choice = nearlist.chosen(stock, group, seen.near, seen.objects, parts, old)
        made = choice.made
        if end is not None and old is not None and old is not choice:
            if last is not None and last.pieces is not None:
                end = lanes.first(last.pieces.made.ends, last.pieces.room, last.pieces.base)
            cold_ends = cold(made.vertex_count)
            if seen.near is None:
                end = drawlist.carried(end, cold_ends, old, choice, stock)
            else:
                end = nearlist.carried(end, cold_ends, old, choice)
        world = drawlist.world_of(stock.points, made, frame.poses, seen.world, carries=seen.beside is None)
        problem = replace(problem, world=world)
        if len(group) > 1:
            problem = replace(problem, part=made.part, mirror=made.mirror, of_triangles=(made.face_part, made.face_mirror))
    one, pieces = _solved(seen, problem, group, solve, choice, last, end, cold)
    boxes = np.array([frame.boxes[i] for i in group])
    box = tuple(map(int, (*boxes[:, :2].min(axis=0), *boxes[:, 2:].max(axis=0))))
    window = textures.window(frame.view, box, 1.0)
    members = mi.UInt32([int(i in group) for i in range(len(seen.enclosed))])
    layer = dr.opaque(mi.UInt32, seen.objects) if len(group) > 1 else None
    pixel, target = _within(window, frame.view.width, frame.p, frame.reflector, members, layer, one.back)
    owner = part if problem.of_triangles is None else problem.of_triangles[0]
    images, triangles, hider = one.found.images, one.triangles or problem.world, one.hider
    if pieces is not None:
        images, triangles = pieces.made.known.images, pieces.world
        if problem.of_triangles is not None:
            owner = dr.gather(mi.UInt32, owner, pieces.piece_of)
            hider = hider.of(pieces.piece_of) if isinstance(hider, sight.Shadows) else hider
    drawing = one.drawing
    if plane is not None:
        drawing, hider = replace(drawing, rigid=True), flatsheet.Behind(plane)
    nearest = virtual.nearest(images, triangles, owner, target, drawing, hider)
    return _Drawn(group, choice, problem, one, pixel, target, nearest, pieces)


def _solved(
    seen: Scenery,
    problem: Problem,
    group: list[int],
    solve: Callable[[Problem, Any], Solved],
    choice: drawlist.Choice | None,
    last: Kept | None,
    end: Any,
    cold: Callable[[int], Any],
) -> tuple[Solved, tessellation.Tessellated | None]:
    """A group of mirrors solved, and what its triangles were split into, None where none are."""
    start = cold(problem.count) if end is None else end
    edges = None if choice is None else choice.made.edges
    if edges is None or choice is None or seen.stock is None:
        return solve(problem, start), None
    flat, single = (all(told[i] for i in group) for told in (seen.flat, seen.bulges))
    asked = tessellation.Asked(problem, edges, seen.split_px, edgeerror.Mirror.of(flat=flat, single=flat or single))
    before = None if last is None else last.pieces
    if before is not None and last is not None and last.choice is choice:
        fine = tessellation.again(before, problem)
        one = solve(fine, before.made.ends)
        pieces, remembered = tessellation.kept(before, asked, fine, one.found)
        if pieces is not None:
            return one, pieces
        one.found, before = tessellation.of_list(one.found, before), remembered
    else:
        one = solve(problem, start)
    if one.further is None:
        return one, None
    still = drawlist.world_of(seen.stock.points, choice.made, seen.still, seen.triangles, carries=seen.beside is None)
    pieces = tessellation.tessellated(asked, still, one.found, one.further, cold, before)
    return one, pieces


@dataclass
class _Drawn:
    """A group of mirrors drawn: their numbers, draw list, problem and what was solved; the pixels of their part of the picture,
    what is there, and the nearest virtual triangles."""

    group: list[int]
    choice: drawlist.Choice | None
    problem: Problem
    solved: Solved
    pixel: mi.UInt32
    target: virtual.Target
    nearest: virtual.Nearest
    pieces: tessellation.Tessellated | None

    @property
    def told(self) -> tuple[Vertices, dict[str, mi.UInt32]]:
        """What was found of the vertices, and counters."""
        if self.pieces is None:
            return self.solved.found.vertices, self.solved.found.counters
        return replace(self.solved.found.vertices, iterations=self.pieces.iterations), self.pieces.counters


def _interpolated(frame: Frame, drawn: list[_Drawn]) -> Reflection:
    """What virtual triangles show."""
    count = frame.view.width * frame.view.height
    numbers, found = [dr.zeros(mi.Float, count) for _ in range(4)], dr.zeros(mi.Bool, count)
    doubt = dr.zeros(mi.Bool, count) if frame.doubts else None
    for one in drawn:
        shows = virtual.interpolated(one.nearest, one.target, one.solved.drawing.depth)
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
        counters = {"unmet": mi.UInt32(0)} | ({} if seen.mirrors is None else {"second_order": mi.UInt32(0)})
        return Reflection(mi.Color3f(nothing), nothing, dr.zeros(mi.Bool, count), None, counters, doubt)
    number = exact.numbers(frame.pixels, count)
    covering, small = (dr.full(mi.UInt32, adjacency.NONE, dr.width(frame.pixels)) for _ in range(2))
    for one in drawn:
        assert one.choice is not None
        own, made = one.target.own, one.choice.made
        names, pieces = made.names, one.pieces
        if pieces is not None:
            names = dr.gather(mi.UInt32, names, pieces.piece_of)
        called = virtual.named(one.nearest, one.target, names, dr.width(names))
        lane = dr.gather(mi.UInt32, number, one.pixel, own)
        for target, named in zip((covering, small), called, strict=True):
            dr.scatter(target, named, lane, own)
    asked = meshwalk.Asked(seen.world, beside, dr.opaque(mi.UInt32, seen.objects))
    shows, pixels = exact.shown(
        asked, frame, number, exact.Named(covering, small), frame.active & passage.walled(seen.enclosed, frame.reflector)
    )
    counters = {"unmet": mi.UInt32(shows.unmet)}
    if seen.mirrors is not None:
        counters["second_order"] = mi.UInt32(shows.mirror)
        shows = higherorder.followed(shows, pixels, asked, seen.mirrors, frame.poses, seen.surroundings)
    x, y, z, distance, found = spreading.spread([*shows.L, shows.distance, shows.found], frame.pixels, frame.view)
    doubt = exact.doubted(shows, pixels) if frame.doubts else None
    return Reflection(mi.Color3f(x, y, z), distance, frame.active & found, None, counters, doubt)


def _may_be_lost(seen: Scenery, frame: Frame, drawn: list[_Drawn], sky: mi.Bool) -> mi.Bool:
    """Where nothing is drawn, and a triangle may be missing: one that has no image, and is in the way of the reflected ray."""
    assert seen.boxes is not None
    asked = mi.Bool(False)
    for one in drawn:
        problem, solved = one.problem, one.solved
        lane = dr.arange(mi.UInt32, problem.count)
        part = dr.gather(mi.Float, problem.world.points, 4 * lane + 3)
        unknown = (dr.gather(mi.UInt32, solved.found.vertices.region, lane) == UNKNOWN) & (part < seen.objects)
        for k, i in enumerate(one.group):
            mine = unknown if problem.mirror is None else unknown & (problem.mirror == k)
            asked |= (frame.reflector == i) & (dr.any(mine) if solved.whole else mi.Bool(True))
    own = mi.UInt32(dr.maximum(frame.reflector, 0)) + seen.objects
    return passage.meets(seen.boxes, frame.poses, own, frame.p, optics.reflect(frame.v, frame.n), sky & asked)


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
    window: textures.Window,
    width: int,
    p: mi.Point3f,
    reflector: mi.Int32,
    members: mi.UInt32,
    first: mi.UInt32 | None,
    back: mi.Float | None,
) -> tuple[mi.UInt32, virtual.Target]:
    """The pixels that a window covers, in its order, and what is there of mirrors.

    members  per mirror of the scene, 1 for those that are meant
    first    the part of the scene's first mirror where `virtual.Target.layer` is wanted, else None
    """
    lane = dr.arange(mi.UInt32, window.view.width * window.view.height)
    row = lane // window.view.width
    pixel = (row + mi.UInt32(window.top)) * width + lane - row * window.view.width + mi.UInt32(window.left)
    number, p = dr.gather(mi.Int32, reflector, pixel), dr.gather(mi.Point3f, p, pixel)
    own = number >= 0
    own &= dr.gather(mi.UInt32, members, mi.UInt32(number), own) == 1
    layer = None if first is None else mi.UInt32(dr.maximum(number, 0)) + first
    return pixel, virtual.Target(window.view, p, own, None if back is None else dr.gather(mi.Float, back, pixel), layer)
