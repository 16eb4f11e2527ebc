"""Tessellation by error: edges are split whose images bend, round by round, until the rest is straight to within some pixels.

The vertices that are new lie in the middles of edges, carry the mean of what their ends carry, and are searched from where one
of their ends was reflected. What came out is kept for the next frame, whose vertices are then searched all at once, and given
up when too many images have come to bend, or too many vertices have become idle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels import geometry, lanes, packets
from benchharness.kernels.frozen import frozen, roomy
from benchharness.kernels.lanes import NONE
from benchharness.kernels.placement import unit
from benchharness.kernels.types import View
from benchharness.kernels.vertices import bent, splitting, virtual
from benchharness.kernels.vertices.edgeerror import Ends, Known, Mirror, measured, predicted
from benchharness.kernels.vertices.edges import EdgeList
from benchharness.kernels.vertices.problems import Found, Problem
from benchharness.kernels.vertices.splitting import count_to

ROUNDS = 6  # at most: an edge becomes 64
LATE = 1.5  # times the error that splits an edge: what was not split is given up when some images bend by more,
MOST_LATE = 0.01  # this share of the triangles that are shown;
CUT = 0.1  # and where it is this share, the camera jumped, and nothing of it is worth remembering
IDLE = 0.25  # of that error: what was split is given up when many middles serve for less,
MOST_IDLE = 0.2  # this share of them


@dataclass
class Carried:
    """What vertices carry: packets of their places and parts in object space, and of their normals there; what
    `geometry.Geometry` has; and `Problem.part` and `mirror`. None without light, highlights or textures, or with one mirror."""

    places: mi.Float
    attributes: mi.Float | None
    normals: mi.Float | None
    visibility: mi.Float | None
    uv: mi.Float | None
    part: mi.UInt32 | None
    mirror: mi.UInt32 | None

    @staticmethod
    def of(problem: Problem, still: geometry.Geometry) -> Carried:
        """Of the vertices of a problem; `still`: in object space."""
        normals, visibility = (None, None) if still.shine is None else (still.shine.normals, still.shine.visibility)
        uv = None if still.paint is None else still.paint.uv
        part = None if problem.mirror is None else problem.part
        return Carried(still.points, still.attributes, normals, visibility, uv, part, problem.mirror)


@dataclass
class Vertices:
    """All there is of vertices: what is known of them, what they carry, and what searches of them start from."""

    known: Known
    carried: Carried
    ends: Any


@dataclass
class Tessellated:
    """Triangles fine enough to be drawn straight.

    made        of all vertices, those of the draw list first
    world       all triangles
    piece_of    of each, the one of the draw list that it is a piece of
    was         edges that were split, by their keys
    base        how many vertices are the draw list's
    late, idle  how many triangles and vertices were so at once
    iterations  of all vertices
    counters    of all vertices, as `problems.Found` has them
    """

    made: Vertices
    world: geometry.Geometry
    piece_of: mi.UInt32
    was: mi.Bool
    base: int
    late: int
    idle: int
    iterations: mi.UInt32
    counters: dict[str, mi.UInt32] = field(default_factory=dict)

    @property
    def room(self) -> int:
        """Vertices."""
        return self.world.vertex_count


@dataclass
class Asked:
    """What is to be tessellated.

    problem  the vertices and triangles of a draw list
    edges    of the triangles
    pixels   by which images of edges may be off
    mirror   what is taken for granted of it
    """

    problem: Problem
    edges: EdgeList
    pixels: float
    mirror: Mirror

    @property
    def owner(self) -> mi.UInt32:
        """The part of the mirror, one per triangle where there are several."""
        return self.problem.part if self.problem.of_triangles is None else self.problem.of_triangles[0]

    def limits(self, was: mi.Bool) -> splitting.Limits:
        return splitting.Limits(dr.opaque(mi.Float, self.pixels), was, self.mirror)


def tessellated(
    asked: Asked,
    still: geometry.Geometry,
    first: Found,
    further: Callable[[Problem, Any], Found],
    cold: Callable[[int], Any],
    before: Tessellated | None,
) -> Tessellated:
    """The triangles of a problem, edges split whose images are off by more than so many pixels.

    still    the problem's triangles in object space
    first    what was found of its own vertices
    further  finds the same of others, from where it is told to start
    cold     what there is to start from where nothing is known
    before   what came out of an earlier frame
    """
    problem, edges = asked.problem, asked.edges
    world, view, base = problem.world, problem.view, problem.count
    limits = asked.limits(dr.zeros(mi.Bool, 1 << splitting.BITS) if before is None else before.was)
    room = max(roomy(base + base // 4), 0 if before is None else before.room)
    known = _known(world.points, first.images, first.vertices.n, count_to(base), base)
    made = lanes.roomy(Vertices(known, Carried.of(problem, still), first.end), base, room)
    counted, iterations = [first.counters], [first.vertices.iterations]
    front = splitting.Front(edges.edges, _numbered(world.faces, world.face_count), edges.sides, edges.count, world.face_count)
    whole: list[tuple[mi.UInt32, mi.Bool]] = []
    count, stays = base, 0
    for number in range(1, ROUNDS + 2):
        if number > ROUNDS:
            limits = replace(limits, pixels=dr.opaque(mi.Float, dr.inf))
        numbers = splitting.Lanes(count_to(front.edge_count), count_to(front.face_count))
        marks = splitting.marked(
            front, made.known, world.faces, asked.owner, view, limits, dr.opaque(mi.UInt32, number), numbers
        )
        whole.append((front.faces, marks.whole))
        split, sums, stay = (int(n) for n in np.array(marks.totals))
        stays += stay
        if split == 0:
            break
        new = splitting.room_for(split)
        if count + new > room:
            wanted = roomy(2 * new + count)
            made, room = lanes.roomy(made, room, wanted), wanted
        sizes = new, max(2 * new, splitting.room_for(sums >> 32)), max(4 * new, splitting.room_for(sums & NONE))
        here, lane = dr.opaque(mi.UInt32, count), count_to(new)
        front, born = splitting.split(front, marks, made.known.world, here, numbers, sizes)
        between, points, begun = _between(made, problem.part, born, cold(new), lane, new)
        found = further(_of_new(problem, between, points, new), begun)
        told = _told(made.known, found.images.moved, found.vertices.n, born, view, asked.mirror, lane, new)
        new_known = Known(points, found.images, told.normal, told.off, told.stalls, born)
        lanes.put(made, Vertices(new_known, between, found.end), here, lane)
        counted.append(found.counters)
        iterations.append(found.vertices.iterations)
        count += new
    total = roomy(stays)
    faces, piece_of = splitting.finished(*(lanes.joined([one[k] for one in whole]) for k in range(2)), world.faces, total)
    if room > count:
        made.carried.places = _unsearched(made.carried.places, problem.part, dr.opaque(mi.UInt32, count), count_to(room), room)
    names = dict.fromkeys(name for one in counted for name in one)
    answer = Tessellated(
        made=made,
        world=_geometry(made.carried, made.known.world, problem, faces, room, total),
        piece_of=piece_of,
        was=splitting.remembered(made.known, base, count, room),
        base=base,
        late=0,
        idle=0,
        iterations=dr.concat(iterations),
        counters={name: dr.concat([one[name] for one in counted]) for name in names},
    )
    late, _, idle, _ = _state(answer, asked)
    return replace(answer, late=late, idle=idle)


def again(before: Tessellated, problem: Problem) -> Problem:
    """The problem of all vertices of an earlier frame's triangles. `problem`: that of the draw list's."""
    carried, old = before.made.carried, before.world
    points = geometry.posed(carried.places, before.room, problem.poses)
    world = _geometry(carried, points, problem, old.faces, before.room, old.face_count)
    part = problem.part if carried.part is None else carried.part
    return replace(problem, world=world, part=part, mirror=carried.mirror)


def kept(before: Tessellated, asked: Asked, fine: Problem, found: Found) -> tuple[Tessellated | None, Tessellated | None]:
    """An earlier frame's triangles with what was found of their vertices, the problem `again`; None if they are given up. And
    what is to be remembered of them: nothing after a cut."""
    old, lane = before.made.known, count_to(before.room)
    known = replace(old, world=fine.world.points, images=found.images)
    normals = _normals(found.vertices.n, before.room)
    ends, n = replace(known, normal=normals), found.vertices.n
    told = _told(ends, found.images.moved, n, old.born, fine.view, asked.mirror, lane, before.room)
    known = replace(known, normal=told.normal, off=dr.select(old.off > 0, told.off, 0))
    made = replace(before.made, known=known, ends=found.end)
    answer = replace(before, made=made, world=fine.world, iterations=found.vertices.iterations, counters=found.counters)
    late, shown, idle, new = _state(answer, asked)
    if late > before.late + MOST_LATE * shown or idle > before.idle + MOST_IDLE * new:
        return None, None if late > CUT * shown else before
    return answer, before


def of_list(found: Found, before: Tessellated) -> Found:
    """What was found of the draw list's own vertices, of what was found of all."""
    base = before.base
    images, end = lanes.first(found.images, before.room, base), lanes.first(found.end, before.room, base)
    told = {name: lanes.first(value, before.room, base) for name, value in vars(found.vertices).items() if name != "further"}
    counters = {name: lanes.first(value, before.room, base) for name, value in found.counters.items()}
    return Found(images, replace(found.vertices, **told), end, counters)


def _state(made: Tessellated, asked: Asked) -> tuple[int, int, int, int]:
    """Triangles that are late, that are shown, middles that are idle, and that are new."""
    owner = asked.owner
    if dr.width(owner) > 1:
        owner = dr.gather(mi.UInt32, owner, made.piece_of)
    limits = asked.limits(made.was)
    total = made.world.face_count
    totals = _counts(made.made.known, made.world.faces, owner, asked.problem.view, limits, count_to(total), count_to(made.room))
    late, shown, idle, new = (int(n) for n in np.array(totals))
    return late, shown, idle, new


@frozen
def _counts(
    known: Known, faces: mi.UInt32, owner: mi.UInt32, view: View, limits: splitting.Limits, f: mi.UInt32, lane: mi.UInt32
) -> mi.UInt32:
    face, totals = dr.gather(mi.Vector4u, faces, f), dr.zeros(mi.UInt32, 4)
    exists = face.x != face.y
    shown = exists & splitting.is_shown(known, face, face.w, owner, exists)
    worst = mi.Float(0)
    for a, b in ((face.x, face.y), (face.y, face.z), (face.z, face.x)):
        rounds = [dr.gather(mi.UInt32, known.born, 4 * i + 3) for i in (a, b)]
        last = dr.maximum(*rounds)
        ends = Ends((a, b), tuple((one == last) & (last > 0) for one in rounds))
        worst = dr.maximum(worst, predicted(known, ends, view, limits.mirror))
    one = mi.UInt32(1)
    dr.scatter_reduce(dr.ReduceOp.Add, totals, one, mi.UInt32(0), shown & (worst > LATE * limits.pixels))
    dr.scatter_reduce(dr.ReduceOp.Add, totals, one, mi.UInt32(1), shown)
    error = dr.gather(mi.Float, known.normal, 4 * lane + 3)
    new = dr.gather(mi.UInt32, known.born, 4 * lane + 3) > 0
    dr.scatter_reduce(dr.ReduceOp.Add, totals, one, mi.UInt32(2), new & (error < IDLE * limits.pixels))
    dr.scatter_reduce(dr.ReduceOp.Add, totals, one, mi.UInt32(3), new)
    return totals


def _geometry(
    carried: Carried, points: mi.Float, problem: Problem, faces: mi.UInt32, vertices: int, count: int
) -> geometry.Geometry:
    """Triangles in world space, of these places there; what is one for all of them, the problem has."""
    shine, paint = problem.world.shine, problem.world.paint
    if shine is not None and carried.normals is not None:
        normals = geometry.turned(carried.places, carried.normals, vertices, problem.poses)
        shine = replace(shine, normals=normals, visibility=carried.visibility)
    shine = None if carried.normals is None else shine
    paint = None if paint is None or carried.uv is None else replace(paint, uv=carried.uv)
    return geometry.Geometry(points, carried.attributes, faces, vertices, count, shine, paint)


@frozen
def _known(points: mi.Float, images: virtual.Images, n: mi.Normal3f, lane: mi.UInt32, count: int) -> Known:
    """What is known of the vertices of a draw list."""
    born = packets.stored(mi.Vector4u(lane, lane, splitting.mixed(lane), 0), count)
    normal = packets.joined(mi.Vector3f(n), mi.Float(-1), count)
    return Known(mi.Float(points), images, normal, dr.full(mi.Float, bent.WIDER, count), dr.zeros(mi.Float, count), born)


@frozen
def _normals(n: mi.Normal3f, count: int) -> mi.Float:
    """Packets of the mirror's normals."""
    return packets.joined(mi.Vector3f(n), mi.Float(-1), count)


@frozen
def _numbered(faces: mi.UInt32, count: int) -> mi.UInt32:
    """The triangles of a list as those of a `splitting.Front`."""
    f = dr.arange(mi.UInt32, count)
    face = dr.gather(mi.Vector4u, faces, f)
    return packets.stored(mi.Vector4u(face.x, face.y, face.z, f), count)


@frozen
def _unsearched(places: mi.Float, owner: mi.UInt32, count: mi.UInt32, lane: mi.UInt32, room: int) -> mi.Float:
    """Places, of which those after so many are of their mirror's part: such are not searched."""
    p = dr.gather(mi.Vector4f, places, lane)
    own = mi.Float(owner) if dr.width(owner) == 1 else mi.Float(0)
    return packets.joined(mi.Point3f(p.xyz), dr.select(lane < count, p.w, own), room)


@frozen
def _between(
    made: Vertices, owner: mi.UInt32, born: mi.UInt32, cold: Any, lane: mi.UInt32, count: int
) -> tuple[Carried, mi.Float, Any]:
    """What new vertices carry; packets of their places; and what their searches start from: where the end of their edge was
    found that is reflected. Those that fill up are of their mirror's part, `owner` where there is one, and so not searched."""
    parents, carried = dr.gather(mi.Vector4u, born, lane), made.carried
    a, b = parents.x, parents.y

    def mean(buffer: mi.Float) -> mi.Vector4f:
        return 0.5 * (dr.gather(mi.Vector4f, buffer, a) + dr.gather(mi.Vector4f, buffer, b))

    part = None if carried.part is None else dr.gather(mi.UInt32, carried.part, a)
    mirror = None if carried.mirror is None else dr.gather(mi.UInt32, carried.mirror, a)
    own = mi.Float(owner if part is None else part)
    points, places = (
        packets.joined(mi.Point3f(p.xyz), dr.select(a == b, own, p.w), count)
        for p in (mean(made.known.world), mean(carried.places))
    )
    attributes, normals, visibility = None, None, None
    uv = None if carried.uv is None else packets.stored(mean(carried.uv), count)
    if carried.attributes is not None:
        attributes = packets.stored(mean(carried.attributes), count)
    if carried.normals is not None and carried.visibility is not None:
        n = mean(carried.normals)
        normals = packets.joined(unit(n.xyz), n.w, count)
        visibility = packets.stored(mean(carried.visibility), count)
    is_first = dr.gather(mi.Float, made.known.images.moved, 4 * a + 3) == virtual.REFLECTED
    parent = dr.select(a == b, mi.UInt32(NONE), dr.select(is_first, a, b))
    begun = lanes.gathered(made.ends, cold, parent, dr.width(made.known.off))
    return Carried(places, attributes, normals, visibility, uv, part, mirror), points, begun


def _of_new(problem: Problem, carried: Carried, points: mi.Float, count: int) -> Problem:
    """The problem of new vertices."""
    world = replace(problem.world, points=points, attributes=None, shine=None, paint=None, vertex_count=count)
    part = problem.part if carried.part is None else carried.part
    return replace(problem, world=world, part=part, mirror=carried.mirror, last_view=problem.view)


_told = frozen(measured)
