"""How far the images of edges are off the straight lines between the images of their ends, in pixels.

`predicted` tells it from the mirror's normals at both ends (`bent`). Once the middle of an edge is found, `measured` knows it:
that of its halves is a quarter of it where the mirror is smooth, and what the prediction was wrong by, it is expected to be
wrong by again.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels import packets
from benchharness.kernels.placement import unit
from benchharness.kernels.types import View
from benchharness.kernels.vertices import bent, virtual
from benchharness.kernels.vertices.assembly import pixel

LEAST_TURN = 0.1  # radians that a mirror's normal is taken to turn by along an edge of which nothing but its ends is known
LEAST_GAIN = 0.125  # of an edge's error, what the errors of its halves are taken to be at least
OFF = (1.0, 4.0)  # what a prediction is taken to be wrong by, at least and at most; once alone it may be small by symmetry
STALLED = 0.5  # of the error of an edge, that of its halves; where the mirror's normals jump, it stays, whatever is split
PATIENCE = 3  # times in a row that it may, of edges whose images are longer than
SHORT = 16.0  # pixels
CUT_ROUNDS = 6  # in which edges are split that are partly hidden: each halves what is cut off where the hidden region begins
MARGIN = 16.0  # pixels around the picture; what is beyond is taken to be straight


@dataclass
class Known:
    """What is known of vertices, one lane each.

    world   packets of their places and parts
    images  virtual vertices
    normal  packets: the mirror's normal at the reflection point, and the error in pixels of the edge that the vertex is the
            middle of, negative where there is none or it could not be measured
    off     what the prediction of that error has to be multiplied by; 0 where splitting no longer serves
    stalls  how many times in a row the error of edges has not fallen to half when they were split, up to that one
    born    packets: the ends of that edge, the vertex itself twice where there is none; a number that stays the same from frame
            to frame; and in which round it was split, 0 where there is none
    """

    world: mi.Float
    images: virtual.Images
    normal: mi.Float
    off: mi.Float
    stalls: mi.Float
    born: mi.UInt32


@dataclass
class Mirror:
    """What is taken for granted of a mirror.

    least     LEAST_TURN, 0 for a flat one
    patience  PATIENCE; 1 for one in which a vertex may have several images: there they jump, and no edge across a jump is right
    cut       CUT_ROUNDS; 1 for such a one, whose vertices may have no image where those beside them have
    """

    least: mi.Float
    patience: mi.Float
    cut: mi.UInt32

    @staticmethod
    def of(*, flat: bool, single: bool) -> Mirror:
        """`single`: no vertex has several images."""
        return Mirror(
            dr.opaque(mi.Float, 0.0 if flat else LEAST_TURN),
            dr.opaque(mi.Float, PATIENCE if single else 1),
            dr.opaque(mi.UInt32, CUT_ROUNDS if single else 1),
        )


@dataclass
class Ends:
    """The ends of edges.

    index   their numbers
    middle  whether each is the middle of the edge that this one is a half of, or lies within a triangle with
    """

    index: tuple[mi.UInt32, mi.UInt32]
    middle: tuple[mi.Bool, mi.Bool]


def predicted(known: Known, ends: Ends, view: View, mirror: Mirror) -> mi.Float:
    """How far the images of edges are off."""
    a, b = ends.index
    rounds = dr.maximum(*(dr.gather(mi.UInt32, known.born, 4 * i + 3) for i in ends.index))
    reflected = [dr.gather(mi.Float, known.images.moved, 4 * i + 3) == virtual.REFLECTED for i in ends.index]
    R = [dr.gather(mi.Vector4f, known.images.at, i) for i in ends.index]
    normal = [dr.gather(mi.Vector4f, known.normal, i) for i in ends.index]
    x = [pixel(view, q) for q in R]
    to_outline = []
    for k, i in ((0, b), (1, a)):
        away = pixel(view, dr.gather(mi.Vector4f, known.world, i))
        to = dr.clip(away, mi.Point2f(-MARGIN), mi.Point2f(view.width + MARGIN, view.height + MARGIN))
        rest = dr.asin(dr.clip(dr.dot(normal[k].xyz, unit(view.eye - R[k].xyz)), 0, 1))
        to_outline.append(dr.select((mirror.least > 0) & (rounds < mirror.cut), 0.125 * dr.norm(x[k] - to) * rest, 0))
    turn = 2 * dr.asin(dr.minimum(0.5 * dr.norm(normal[0].xyz - normal[1].xyz), 1))
    errors = [dr.select(middle, q.w, -1) for middle, q in zip(ends.middle, normal, strict=True)]
    error, off = dr.maximum(*errors), mi.Float(0)
    for e, i in zip(errors, ends.index, strict=True):
        off = dr.maximum(off, dr.select(e >= 0, dr.gather(mi.Float, known.off, i), 0))
    is_measured = error >= 0
    straight = 0.125 * dr.norm(x[0] - x[1]) * dr.select(is_measured, off * turn, dr.maximum(bent.WIDER * turn, mirror.least))
    straight = dr.select(is_measured & (off > 0), dr.maximum(straight, LEAST_GAIN * error), straight)
    both = reflected[0] & reflected[1]
    found = dr.select(both, straight, dr.select(reflected[0], to_outline[0], dr.select(reflected[1], to_outline[1], 0)))
    low, high = dr.minimum(x[0], x[1]), dr.maximum(x[0], x[1])
    seen = (high.x > -MARGIN) & (high.y > -MARGIN) & (low.x < view.width + MARGIN) & (low.y < view.height + MARGIN)
    return dr.select(seen | ~both, found, 0)


@dataclass
class Measured:
    """What is known of the edges that vertices are the middles of: `Known.normal`, `off` and `stalls`."""

    normal: mi.Float
    off: mi.Float
    stalls: mi.Float


def measured(
    known: Known,
    moved: mi.Float,
    normals: mi.Normal3f,
    born: mi.UInt32,
    view: View,
    mirror: Mirror,
    lane: mi.UInt32,
    count: int,
) -> Measured:
    """What the middles of edges say of them: `count` vertices, of which these are the images, the mirror's normals and
    `Known.born`. `known`: what is known of their ends."""
    parents = dr.gather(mi.Vector4u, born, lane)
    index = (parents.x, parents.y)
    ends = [dr.gather(mi.Vector4f, known.images.moved, i) for i in index]
    middle = dr.gather(mi.Vector4f, moved, lane)
    found = parents.x != parents.y
    for q in (*ends, middle):
        found &= q.w == virtual.REFLECTED
    error = dr.norm(pixel(view, middle) - pixel(view, 0.5 * (ends[0] + ends[1])))
    length = dr.norm(pixel(view, ends[0]) - pixel(view, ends[1]))
    n = [dr.gather(mi.Vector4f, known.normal, i).xyz for i in index]
    sagitta = 0.25 * length * dr.asin(dr.minimum(0.5 * dr.norm(n[0] - n[1]), 1))
    off = dr.clip(error * dr.rcp(dr.maximum(sagitta, 1e-6)), dr.select(parents.w > 1, OFF[0], bent.WIDER), OFF[1])
    last, stalls = mi.Float(-1), mi.Float(0)  # the error of the edge that this one is a part of, and its stalls
    for i in index:
        of_last = (parents.w > 1) & (dr.gather(mi.UInt32, known.born, 4 * i + 3) + 1 == parents.w)
        there = dr.select(of_last, dr.gather(mi.Float, known.normal, 4 * i + 3), -1)
        stalls = dr.select(there > last, dr.gather(mi.Float, known.stalls, i), stalls)
        last = dr.maximum(last, there)
    stalls = dr.select((last >= 0) & (error > STALLED * last), stalls + 1, 0)
    given_up = (stalls >= mirror.patience) | ((stalls > 0) & (length < SHORT))
    off = dr.select(found, dr.select(given_up, 0, off), bent.WIDER)
    normal = packets.joined(mi.Vector3f(normals), dr.select(found, error, -1), count)
    return Measured(normal, off, dr.select(found, stalls, 0))
