"""Splitting edges: which ones, and what becomes of the triangles beside them.

A triangle with one, two or three sides that are split becomes two, three or four. Whether an edge is split, that edge alone
decides, so that the triangles on both its sides agree.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels import geometry, raster
from benchharness.kernels.frozen import frozen
from benchharness.kernels.lanes import NONE
from benchharness.kernels.types import View
from benchharness.kernels.vertices import virtual
from benchharness.kernels.vertices.assembly import turned
from benchharness.kernels.vertices.edgeerror import Ends, Known, Mirror, predicted

JOINED_AT = 0.5  # of the error that splits an edge; one that was split in the last frame is split down to this
BITS = 18  # of the memory of edges that were split


@dataclass
class Front:
    """Triangles that may yet be split.

    edges   packets: two ends, the edge that decides, free
    faces   packets: three corners, the triangle of the draw list that it is a piece of, NONE where it fills up
    sides   packets: edges from the first corner to the second, on to the third, and back, NONE for those that stay whole; free
    """

    edges: mi.UInt32
    faces: mi.UInt32
    sides: mi.UInt32
    edge_count: int
    face_count: int


@dataclass
class Marks:
    """Which edges are split.

    edge      whether each is
    key       of each, what its middle will be known by
    number    of the round
    ranks     per edge, how many are split up to it, itself included
    sums      of triangles up to each: pieces that they become, and edges in their insides, 32 bits each
    whole     whether a triangle stays whole
    totals    how many edges are split; the last of the sums; how many triangles stay whole
    """

    edge: mi.Bool
    key: mi.UInt32
    number: mi.UInt32
    ranks: mi.UInt32
    sums: mi.UInt64
    whole: mi.Bool
    totals: mi.UInt64


@dataclass
class Lanes:
    """0, 1, 2 .. for every edge and for every triangle. A recorded kernel has as many lanes as an array that it reads in order;
    where there is none, it takes another's size for a hint, and what grows by itself misleads it."""

    edges: mi.UInt32
    faces: mi.UInt32


@dataclass
class Limits:
    """When edges are split.

    pixels  their error
    was     memory of the last frame's, as `remembered` makes it
    mirror  what is taken for granted of it
    """

    pixels: mi.Float
    was: mi.Bool
    mirror: Mirror


def room_for(count: int) -> int:
    """The next power of two, at least 16: few sizes, so that few are recorded."""
    return 1 << max((count - 1).bit_length(), 4)


@functools.lru_cache(maxsize=256)
def _numbers(count: int, variant: str) -> mi.UInt32:
    numbers = dr.arange(mi.UInt32, count)
    dr.eval(numbers)
    return numbers


def count_to(count: int) -> mi.UInt32:
    """0, 1, 2 .. in memory."""
    return _numbers(count, mi.variant())


def mixed(x: mi.UInt32) -> mi.UInt32:
    """A number in which every bit of x has a part: the last step of MurmurHash3 (Appleby)."""
    x = x ^ (x >> 16)
    x *= mi.UInt32(0x85EBCA6B)
    x ^= x >> 13
    x *= mi.UInt32(0xC2B2AE35)
    return x ^ (x >> 16)


@frozen
def marked(
    front: Front,
    known: Known,
    listed: mi.UInt32,
    owner: mi.UInt32,
    view: View,
    limits: Limits,
    number: mi.UInt32,
    lanes: Lanes,
) -> Marks:
    """Which edges are split. `listed`: the draw list's triangles; `owner`: their mirror's part; `number`: of the round, from
    1."""
    f, lane = lanes.faces, lanes.edges
    face, sides = dr.gather(mi.Vector4u, front.faces, f), dr.gather(mi.Vector4u, front.sides, f)
    exists = face.w != NONE
    part = dr.gather(mi.UInt32, owner, face.w, exists) if dr.width(owner) > 1 else owner
    shown = exists & is_shown(known, face, dr.gather(mi.UInt32, listed, 4 * face.w + 3, exists), part, exists)
    wanted = dr.zeros(mi.Bool, front.edge_count)
    for side in (sides.x, sides.y, sides.z):
        asks = shown & (side != NONE)
        dr.scatter(wanted, mi.Bool(True), dr.gather(mi.UInt32, front.edges, 4 * side + 2, asks), asks)

    own = dr.gather(mi.Vector4u, front.edges, lane)
    decides = dr.gather(mi.Vector4u, front.edges, own.z)
    a, b = decides.x, decides.y
    born = [dr.gather(mi.Vector4u, known.born, end) for end in (a, b)]
    keys = [one.z for one in born]
    key = mixed(dr.minimum(*keys) * mi.UInt32(0x9E3779B1) + dr.maximum(*keys))
    ends = Ends((a, b), tuple((number > 1) & (one.w + 1 == number) for one in born))
    pixels = dr.select(dr.gather(mi.Bool, limits.was, key & mi.UInt32((1 << BITS) - 1)), JOINED_AT, 1) * limits.pixels
    splits = dr.gather(mi.Bool, wanted, own.z) & (own.x != own.y) & (predicted(known, ends, view, limits.mirror) > pixels)
    ranks = dr.prefix_reduce(dr.ReduceOp.Add, dr.select(splits, mi.UInt32(1), 0), exclusive=False)

    sides_split = mi.UInt32(0)
    for side in (sides.x, sides.y, sides.z):
        sides_split += dr.select(dr.gather(mi.Bool, splits, side, side != NONE), mi.UInt32(1), 0)
    sums = dr.prefix_reduce(dr.ReduceOp.Add, _pieces(sides_split), exclusive=False)
    whole = exists & (sides_split == 0)
    stays = dr.zeros(mi.UInt64, 1)
    dr.scatter_reduce(dr.ReduceOp.Add, stays, mi.UInt64(1), mi.UInt32(0), whole)
    which = dr.arange(mi.UInt32, 3)
    last = mi.UInt64(dr.gather(mi.UInt32, ranks, mi.UInt32(front.edge_count - 1)))
    totals = dr.select(which == 0, last, dr.gather(mi.UInt64, sums, mi.UInt32(front.face_count - 1)))
    totals = dr.select(which == 2, dr.gather(mi.UInt64, stays, mi.UInt32(0)), totals)
    return Marks(splits, key, mi.UInt32(number), ranks, sums, whole, totals)


def _pieces(split: mi.UInt32) -> mi.UInt64:
    """What `Marks.sums` adds up, of triangles with so many sides that are split."""
    return dr.select(split > 0, mi.UInt64(split + 1) | (mi.UInt64(split) << 32), 0)


def is_shown(known: Known, face: mi.Vector4u, tag: mi.UInt32, part: mi.UInt32, exists: mi.Bool) -> mi.Bool:
    """Whether a triangle has an image, of its front, in the mirror of this part."""
    index = (face.x, face.y, face.z)
    V = [dr.gather(mi.Vector4f, known.world, i, exists).xyz for i in index]
    normal = dr.cross(V[1] - V[0], V[2] - V[0])
    fronts, reflected = (tag & raster.CLOSED) == 0, mi.Bool(False)
    for v, i in zip(V, index, strict=True):
        there = dr.gather(mi.Float, known.images.moved, 4 * i + 3, exists) == virtual.REFLECTED
        reflected |= there
        fronts |= there & (dr.dot(dr.gather(mi.Vector4f, known.images.at, i, exists).xyz - v, normal) > 0)
    return (geometry.part_of(mi.Vector4u(0, 0, 0, tag)) != part) & reflected & fronts


@frozen
def split(
    front: Front, marks: Marks, points: mi.Float, count: mi.UInt32, lanes: Lanes, sizes: tuple[int, int, int]
) -> tuple[Front, mi.UInt32]:
    """The pieces of triangles that are split; and `edgeerror.Known.born` of the new vertices.

    points  packets of all vertices so far
    count   how many these are
    sizes   room for new vertices, for edges in the inside of triangles, and for pieces
    """
    (new, inner, pieces), f, lane = sizes, lanes.faces, lanes.edges
    edge = dr.gather(mi.Vector4u, front.edges, lane)
    rank = marks.ranks - 1
    middle = count + rank
    born = dr.zeros(mi.UInt32, 4 * new)
    dr.scatter(born, mi.Vector4u(edge.x, edge.y, marks.key, marks.number), rank, marks.edge)
    edges = dr.zeros(mi.UInt32, 4 * (2 * new + inner))
    decides = dr.gather(mi.UInt32, marks.ranks, edge.z) - 1
    dr.scatter(edges, mi.Vector4u(edge.x, middle, 2 * decides, 0), 2 * rank, marks.edge)
    dr.scatter(edges, mi.Vector4u(middle, edge.y, 2 * decides + 1, 0), 2 * rank + 1, marks.edge)

    face, side = dr.gather(mi.Vector4u, front.faces, f), dr.gather(mi.Vector4u, front.sides, f)
    sides = [side.x, side.y, side.z]
    is_split = [dr.gather(mi.Bool, marks.edge, s, s != NONE) for s in sides]
    many = mi.UInt32(0)
    for one in is_split:
        many += dr.select(one, mi.UInt32(1), 0)
    before = dr.gather(mi.UInt64, marks.sums, f) - _pieces(many)
    first, first_inner = mi.UInt32(before & NONE), mi.UInt32(before >> 32) + 2 * new

    # Turned so that with one split side it is the first, and with two it is the last that stays whole.
    one_turn = dr.select(is_split[0], 0, dr.select(is_split[1], 1, 2))
    two_turn = dr.select(~is_split[2], 0, dr.select(~is_split[0], 1, 2))
    turn = dr.select(many == 1, one_turn, dr.select(many == 2, two_turn, 0))
    v, s = turned([face.x, face.y, face.z], turn), turned(sides, turn)
    halves, m = [], []
    for k in range(3):
        there = (many > k) & (s[k] != NONE)
        r = dr.gather(mi.UInt32, marks.ranks, s[k], there) - 1
        begins = dr.gather(mi.UInt32, front.edges, 4 * s[k], there) == v[k]
        halves.append((2 * r + dr.select(begins, mi.UInt32(0), 1), 2 * r + dr.select(begins, mi.UInt32(1), 0)))
        m.append(count + r)
    one, two, three = many == 1, many == 2, many == 3
    none, (i0, i1, i2) = mi.UInt32(NONE), (first_inner + k for k in range(3))

    # The shorter diagonal of what two split sides leave: from the first corner to the second middle, or from the first to the
    # last corner.
    middles = []
    for k in (0, 1):
        ends = [dr.gather(mi.UInt32, front.edges, 4 * s[k] + end, two) for end in (0, 1)]
        middles.append(0.5 * (_place(points, ends[0], two) + _place(points, ends[1], two)))
    short = dr.norm(_place(points, v[0], two) - middles[1]) <= dr.norm(_place(points, v[2], two) - middles[0])

    new_faces, new_sides = (dr.full(mi.UInt32, NONE, 4 * pieces) for _ in range(2))

    def piece(k: int, active: mi.Bool, at: tuple, by: tuple) -> None:
        dr.scatter(new_faces, mi.Vector4u(*at, face.w), first + k, active)
        dr.scatter(new_sides, mi.Vector4u(*by, none), first + k, active)

    def line(k: int, active: mi.Bool, a: mi.UInt32, b: mi.UInt32) -> None:
        dr.scatter(edges, mi.Vector4u(a, b, first_inner + k, 0), first_inner + k, active)

    piece(0, one, (v[0], m[0], v[2]), (halves[0][0], i0, none))
    piece(1, one, (m[0], v[1], v[2]), (halves[0][1], none, i0))
    line(0, one, m[0], v[2])

    piece(0, two, (m[0], v[1], m[1]), (halves[0][1], halves[1][0], i0))
    line(0, two, m[0], m[1])
    a, b = two & short, two & ~short
    piece(1, a, (v[0], m[0], m[1]), (halves[0][0], i0, i1))
    piece(2, a, (v[0], m[1], v[2]), (i1, halves[1][1], none))
    line(1, a, v[0], m[1])
    piece(1, b, (v[0], m[0], v[2]), (halves[0][0], i1, none))
    piece(2, b, (m[0], m[1], v[2]), (i0, halves[1][1], i1))
    line(1, b, m[0], v[2])

    for k, i in enumerate((i0, i1, i2)):
        behind = (k + 2) % 3
        piece(k, three, (v[k], m[k], m[behind]), (halves[k][0], i, halves[behind][1]))
        line(k, three, m[k], m[behind])
    piece(3, three, (m[0], m[1], m[2]), (i1, i2, i0))
    return Front(edges, new_faces, new_sides, 2 * new + inner, pieces), born


def _place(points: mi.Float, i: mi.UInt32, active: mi.Bool) -> mi.Point3f:
    return mi.Point3f(dr.gather(mi.Vector4f, points, i, active).xyz)


def finished(faces: mi.UInt32, whole: mi.Bool, listed: mi.UInt32, count: int) -> tuple[mi.UInt32, mi.UInt32]:
    """Of the triangles of fronts those that stay whole, as those of a `geometry.Geometry`, and what they are pieces of; with
    such that fill up."""
    kept = dr.compress(whole)
    face = dr.gather(mi.Vector4u, faces, kept)
    face.w, piece_of = dr.gather(mi.UInt32, listed, 4 * face.w + 3), mi.UInt32(face.w)
    made, pieces = dr.zeros(mi.UInt32, 4 * count), dr.zeros(mi.UInt32, count)
    lane = count_to(dr.width(kept))
    dr.scatter(made, face, lane)
    dr.scatter(pieces, piece_of, lane)
    return made, pieces


def remembered(known: Known, base: int, count: int, room: int) -> mi.Bool:
    """A memory of the edges that were split: of vertices from number `base` to `count`, of `room`."""
    table, lane = dr.zeros(mi.Bool, 1 << BITS), count_to(room)
    is_new = (lane >= base) & (lane < dr.opaque(mi.UInt32, count))
    dr.scatter(table, mi.Bool(True), dr.gather(mi.UInt32, known.born, 4 * lane + 2) & mi.UInt32((1 << BITS) - 1), is_new)
    return table
