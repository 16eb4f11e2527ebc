"""Rotated rows of depth maps as polylines of few points (Popescu et al. 2006, section 4.2; layout: `kernels.images.depthmap`).

Every span of a row begins as one segment. The segment with the worst sample is split there, until the row has m points or the
polyline goes through all samples. A row with more than m / 2 spans keeps the longest. One lane per row, and no row is kept:
samples are read from the map whenever they are needed.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels.images.depthmap import BACKGROUND, COVERED, Layout, Row, row_at

ROUNDING = 1e-6  # zgl: errors of a polyline below this are float32's, and split nothing
NONE = 0xFFFF_FFFF  # no segment


@dataclass
class Segments:
    """The segments of a lane's polyline, m at most: end samples, the worst sample between and its error, the next segment.

    Indices must be as wide as the lanes from the start: one that begins as a single number is taken as the same in all lanes.
    """

    first: dr.Local
    last: dr.Local
    worst: dr.Local
    error: dr.Local
    following: dr.Local


def build(
    depth: mi.Float,
    layout: Layout,
    split_jump: float | None = None,
    maps: mi.UInt32 | None = None,
    *,
    wide: bool = False,
) -> tuple[mi.Float, mi.UInt32]:
    """Simplified rows of all maps, and per row [count, n, w] how many spans were dropped as more than m / 2.

    split_jump  where neighbouring samples differ by more than this, a new span starts; None or 0: nowhere
    maps        per row, whose it is, for maps of sizes of their own
    wide        spans end half a sample beyond their last ones, as wide as their samples are; else at the middle of those
    """
    lane = dr.arange(mi.UInt32, layout.row_count if maps is None else dr.width(maps))
    row = row_at(depth, layout, lane, maps)
    segments = Segments(*(dr.alloc_local(kind, layout.m) for kind in (mi.UInt32, mi.UInt32, mi.UInt32, mi.Float, mi.UInt32)))
    spans, dropped = _spans(row, segments, layout.m // 2, split_jump or 0.0)
    _refine(row, segments, spans, layout.m)
    return _written(row, segments, spans, lane, layout, wide=wide), dropped


@dr.syntax
def _spans(row: Row, segments: Segments, room: int, split_jump: float) -> tuple[mi.UInt32, mi.UInt32]:
    """The longest spans of the row in their order, `room` at most, the first of equals. Returns (kept, dropped)."""
    lanes = dr.width(row.x)
    u = mi.UInt32(0)  # the sample
    before = mi.Float(BACKGROUND)  # the one before it
    first = mi.UInt32(0)  # where the span began
    kept, dropped = dr.zeros(mi.UInt32, lanes), mi.UInt32(0)  # spans so far
    while dr.hint(u <= row.w, label="find the spans of a row"):
        zgl = row.sample(u, u < row.w)
        covered, was_covered = zgl < COVERED, before < COVERED
        joined = covered & was_covered
        if dr.hint(split_jump > 0, mode="scalar"):
            joined &= dr.abs(zgl - before) <= split_jump
        ended = was_covered & ~joined
        begun = covered & ~joined
        length = u - first

        if ended:  # seldom, and memory of lanes is slow
            # No room: the shortest gives way, the last of equals, and those behind it move up. Or this one is shorter still.
            crowded = kept == room
            k, shortest, least = dr.zeros(mi.UInt32, lanes), dr.zeros(mi.UInt32, lanes), mi.UInt32(NONE)
            while dr.hint(crowded & (k < room), label="find the shortest span"):
                other = segments.last[k] - segments.first[k] + 1
                shorter = other <= least
                least, shortest = dr.select(shorter, other, least), dr.select(shorter, k, shortest)
                k += 1
            replaced = crowded & (length > least)
            k = mi.UInt32(shortest)
            while dr.hint(replaced & (k + 1 < room), label="close the gap"):
                segments.first.write(segments.first[k + 1], k)
                segments.last.write(segments.last[k + 1], k)
                k += 1

            taken = ~crowded | replaced
            slot = dr.minimum(kept, room - 1)
            segments.first.write(first, slot, taken)
            segments.last.write(u - 1, slot, taken)
            kept += dr.select(~crowded, mi.UInt32(1), 0)
            dropped += dr.select(crowded, mi.UInt32(1), 0)
        first = dr.select(begun, u, first)
        before = mi.Float(zgl)
        u += 1
    return kept, dropped


@dr.syntax
def _scan(row: Row, first: mi.UInt32, middle: mi.UInt32, last: mi.UInt32) -> tuple[mi.UInt32, mi.Float, mi.UInt32, mi.Float]:
    """The worst samples of the polyline first - middle - last: (sample, error) of either part, in zgl."""
    z_first, z_middle, z_last = row.sample(first), row.sample(middle), row.sample(last)
    slope_left = (z_middle - z_first) / mi.Float(dr.maximum(middle - first, 1))
    slope_right = (z_last - z_middle) / mi.Float(dr.maximum(last - middle, 1))
    u = first + 1
    left, error_left = mi.UInt32(first), mi.Float(0)
    right, error_right = mi.UInt32(last), mi.Float(0)
    while dr.hint(u < last, label="scan a segment"):
        is_left = u < middle
        start, z_start = dr.select(is_left, first, middle), dr.select(is_left, z_first, z_middle)
        line = dr.fma(mi.Float(u - start), dr.select(is_left, slope_left, slope_right), z_start)
        error = dr.abs(row.sample(u) - line)
        worse_left = is_left & (error > error_left)
        worse_right = ~is_left & (error > error_right)
        left, error_left = dr.select(worse_left, u, left), dr.select(worse_left, error, error_left)
        right, error_right = dr.select(worse_right, u, right), dr.select(worse_right, error, error_right)
        u += 1
    return left, error_left, right, error_right


@dr.syntax
def _refine(row: Row, segments: Segments, spans: mi.UInt32, m: int) -> None:
    """Splits the worst segment at its worst sample while there is room for a point."""
    lanes = dr.width(row.x)
    k, points = dr.zeros(mi.UInt32, lanes), mi.UInt32(0)
    while dr.hint(k < spans, label="spans as segments"):
        first, last = segments.first[k], segments.last[k]
        worst, error, _, _ = _scan(row, first, last, last)
        segments.worst.write(worst, k)
        segments.error.write(error, k)
        segments.following.write(dr.select(k + 1 < spans, k + 1, NONE), k)
        points += dr.select(first == last, mi.UInt32(1), mi.UInt32(2))
        k += 1

    count = mi.UInt32(spans)
    running = (points < m) & (spans > 0)
    while dr.hint(running, label="split the worst segment"):
        k, worst, error = dr.zeros(mi.UInt32, lanes), dr.zeros(mi.UInt32, lanes), mi.Float(-1)
        while dr.hint(k < count, label="find the worst segment"):
            other = segments.error[k]
            worse = other > error
            worst, error = dr.select(worse, k, worst), dr.select(worse, other, error)
            k += 1
        running &= error > ROUNDING
        first, middle, last = (part.read(worst, running) for part in (segments.first, segments.worst, segments.last))
        left, error_left, right, error_right = _scan(row, first, middle, last)
        following = segments.following.read(worst, running)
        halves = (
            (segments.first, first, middle),
            (segments.last, middle, last),
            (segments.worst, left, right),
            (segments.error, error_left, error_right),
            (segments.following, count, following),
        )
        for part, of_left, of_right in halves:
            part.write(of_right, count, running)
            part.write(of_left, worst, running)
        count += dr.select(running, 1, 0)
        points += dr.select(running, 1, 0)
        running &= points < m


@dr.syntax
def _written(row: Row, segments: Segments, spans: mi.UInt32, lane: mi.UInt32, layout: Layout, *, wide: bool) -> mi.Float:
    """The points of all segments in order, two to a packet."""
    rows = dr.empty(mi.Float, 2 * layout.m * dr.width(lane))
    k = dr.select(spans > 0, mi.UInt32(0), NONE)
    at_end, was_up = mi.Bool(False), mi.Bool(True)
    u, zgl = -(mi.Float(row.w) + 1), mi.Float(BACKGROUND)
    packet = mi.UInt32(0)
    while dr.hint(packet < layout.m // 2, label="write a row"):
        two = []
        for _ in range(2):
            active = k != NONE
            first, last, following = (part.read(k, active) for part in (segments.first, segments.last, segments.following))
            at = dr.select(at_end, last, first)
            is_up = at_end | (first == last)
            zgl = dr.select(active, row.sample(at, active), zgl)
            place = mi.Float(at)
            if dr.hint(wide, mode="scalar"):
                half = dr.select(at_end, mi.Float(0.5), dr.select(was_up, mi.Float(-0.5), 0))
                place = dr.maximum(place + dr.select(first == last, 0, half), 0)
            was_up = dr.select(active, is_up, was_up)
            u = dr.select(active, dr.select(is_up, -(place + 1), place), u)
            is_followed = active & (following != NONE)
            goes_on = is_followed & (segments.first.read(following, is_followed) == last)
            k = dr.select(active & (is_up | goes_on), following, k)
            at_end = active & ~is_up & ~goes_on
            two += [mi.Float(u), mi.Float(zgl)]
        dr.scatter(rows, mi.Vector4f(*two), lane * (layout.m // 2) + packet)
        packet += 1
    return rows
