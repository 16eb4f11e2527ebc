"""Depth maps as impostors: layout, and their rotated rows made simple (Popescu et al. 2006, sections 4.1 and 4.2).

A depth map is what a pinhole camera saw of an object, with near and far planes around the object's bounding box. A ray
projects to a segment of the map, and the object's profile along that segment is a row of the map turned by the segment's
angle. So every row of n rotations (pi i / n) is simplified once to a polyline of at most m points: what a ray then meets is
found among at most m - 1 segments. No map is stored rotated.

`count` maps of w x w texels lie in one buffer each:

    depth    Float [count, w, w], row major: zgl = (1/zn - 1/z) / (1/zn - 1/zf), 0 at the near plane and 1 at the far plane,
             in which straight lines stay straight; BACKGROUND where nothing was seen. Texel (row i, column j) has its centre
             at x = j, y = i; the middle of the map is c = (w - 1) / 2
    cameras  Float [count, 4, 4]: three rows of the rigid world-to-camera matrix (X to the right along a row, Y down, Z ahead),
             then focal length in texels, zn, zf, 0. x = c + focal X / Z, y = c + focal Y / Z
    rows     Float [count, n, w, m, 2]: points (u, zgl) of row j of rotation i, by increasing u. Sample u lies at
             x = c + (u - c) cos - (j - c) sin,  y = c + (u - c) sin + (j - c) cos,  and is the nearest texel there

A span is a run of samples without background between. Its last point is stored with -(u + 1) for u: there the pen is lifted,
and no segment leads on. A span of one sample is one such point; rays meet it as if it were flat and one sample wide, for it has
no extent otherwise. Unused slots repeat the last point with the pen up; a row without any has u = w and BACKGROUND.

As many rows and samples as the map has texels on a side leave its corners out when it is turned: 8.5 % of it at 45 degrees.
What an object's circumscribed circle fits into w texels loses nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

BACKGROUND = 2.0  # zgl where nothing was seen
COVERED = 1.5  # zgl below which something was
ROUNDING = 1e-6  # zgl: errors of a polyline below this are float32's, and split nothing
NONE = 0xFFFFFFFF


@dataclass
class Layout:
    """Sizes of the buffers: `w` texels on a side, `n` rotations, `m` points in a row; `count` maps."""

    count: int
    w: int
    n: int
    m: int

    def __post_init__(self):
        if self.count < 1:
            raise ValueError(f"depth maps: count = {self.count}; at least 1 is needed")
        if not 2 <= self.w <= 4096:
            raise ValueError(f"depth maps: w = {self.w} texels; 2 to 4096 are possible")
        if not 1 <= self.n <= 180:
            raise ValueError(f"depth maps: n = {self.n} rotations; 1 to 180 are possible")
        if self.m % 2 or not 2 <= self.m <= 64:
            raise ValueError(f"depth maps: m = {self.m} points in a row; an even number from 2 to 64 is possible")

    @property
    def row_count(self) -> int:
        return self.count * self.n * self.w

    @property
    def byte_count(self) -> int:
        """Of the simplified rows."""
        return self.row_count * self.m * 8


@dataclass
class Row:
    """Where a lane's row lies, and its samples."""

    depth: mi.Float
    map: mi.UInt32
    w: int
    x: mi.Float  # of sample 0, pixels
    y: mi.Float
    sine: mi.Float
    cosine: mi.Float

    def sample(self, u: mi.UInt32, active=True) -> mi.Float:
        """zgl of sample u; BACKGROUND outside of the map."""
        along = mi.Float(u)
        return texel(self.depth, self.w, self.map, dr.fma(along, self.cosine, self.x), dr.fma(along, self.sine, self.y), active)


@dataclass
class Segments:
    """The segments of a lane's polyline, m at most: first and last sample, the worst in between and its error, the following."""

    first: dr.Local
    last: dr.Local
    worst: dr.Local
    error: dr.Local
    following: dr.Local


def texel(depth: mi.Float, w: int, map: mi.UInt32, x: mi.Float, y: mi.Float, active=True) -> mi.Float:
    """zgl of the texel nearest to (x, y), pixels; BACKGROUND outside of the map."""
    column, row = mi.Int32(dr.floor(x + 0.5)), mi.Int32(dr.floor(y + 0.5))
    inside = (column >= 0) & (row >= 0) & (column < w) & (row < w) & active
    zgl = dr.gather(mi.Float, depth, (map * w + mi.UInt32(row)) * w + mi.UInt32(column), inside)
    return dr.select(inside, zgl, BACKGROUND)


def build(depth: mi.Float, layout: Layout, split_jump: float | None = None) -> tuple[mi.Float, mi.UInt32]:
    """Simplified rows of all maps, and per row [count, n, w] how many spans were dropped as more than m / 2.

    split_jump  where neighbouring samples differ by more than this, a new span starts; None or 0: nowhere
    """
    lane = dr.arange(mi.UInt32, layout.row_count)
    turn = lane // layout.w
    map = turn // layout.n
    sine, cosine = dr.sincos(mi.Float(turn - map * layout.n) * (dr.pi / layout.n))
    c = 0.5 * (layout.w - 1)
    down = mi.Float(lane - turn * layout.w) - c
    x, y = c - c * cosine - down * sine, c - c * sine + down * cosine
    row = Row(depth, map, layout.w, x, y, sine, cosine)
    segments = Segments(*(dr.alloc_local(kind, layout.m) for kind in (mi.UInt32, mi.UInt32, mi.UInt32, mi.Float, mi.UInt32)))
    spans, dropped = _spans(row, segments, layout.m // 2, split_jump or 0.0)
    _refine(row, segments, spans, layout.m)
    return _written(row, segments, spans, lane, layout), dropped


@dr.syntax
def _spans(row: Row, segments: Segments, room: int, split_jump: float) -> tuple[mi.UInt32, mi.UInt32]:
    """The longest spans of the row in their order, `room` at most, the first of equals. Returns (kept, dropped)."""
    u, first = mi.UInt32(0), mi.UInt32(0)
    kept, dropped = mi.UInt32(0), mi.UInt32(0)
    before = mi.Float(BACKGROUND)
    while dr.hint(u <= row.w, label="find the spans of a row"):
        zgl = row.sample(u, u < row.w)
        covered, was_covered = zgl < COVERED, before < COVERED
        joined = covered & was_covered
        if dr.hint(split_jump > 0, mode="scalar"):
            joined &= dr.abs(zgl - before) <= split_jump
        if was_covered & ~joined:
            length = u - first
            if kept == room:
                # The shortest gives way, the last of equals; those behind it move up.
                k, shortest, least = mi.UInt32(0), mi.UInt32(0), mi.UInt32(NONE)
                while dr.hint(k < room, label="find the shortest span"):
                    other = segments.last[k] - segments.first[k] + 1
                    if other <= least:
                        least, shortest = mi.UInt32(other), mi.UInt32(k)
                    k += 1
                dropped += 1
                if length > least:
                    k = mi.UInt32(shortest)
                    while dr.hint(k + 1 < room, label="close the gap"):
                        segments.first.write(segments.first[k + 1], k)
                        segments.last.write(segments.last[k + 1], k)
                        k += 1
                    segments.first.write(first, k)
                    segments.last.write(u - 1, k)
            else:
                segments.first.write(first, kept)
                segments.last.write(u - 1, kept)
                kept += 1
        if covered & ~joined:
            first = mi.UInt32(u)
        before = mi.Float(zgl)
        u += 1
    return kept, dropped


@dr.syntax
def _scan(row: Row, first, middle, last):
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
    k, points = mi.UInt32(0), mi.UInt32(0)
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
        k, worst, error = mi.UInt32(0), mi.UInt32(0), mi.Float(-1)
        while dr.hint(k < count, label="find the worst segment"):
            other = segments.error[k]
            if other > error:
                worst, error = mi.UInt32(k), mi.Float(other)
            k += 1
        if error > ROUNDING:
            first, middle, last = segments.first[worst], segments.worst[worst], segments.last[worst]
            left, error_left, right, error_right = _scan(row, first, middle, last)
            segments.first.write(middle, count)
            segments.last.write(last, count)
            segments.worst.write(right, count)
            segments.error.write(error_right, count)
            segments.following.write(segments.following[worst], count)
            segments.last.write(middle, worst)
            segments.worst.write(left, worst)
            segments.error.write(error_left, worst)
            segments.following.write(count, worst)
            count += 1
            points += 1
        running = (points < m) & (error > ROUNDING)


@dr.syntax
def _written(row: Row, segments: Segments, spans: mi.UInt32, lane: mi.UInt32, layout: Layout) -> mi.Float:
    """The points of all segments in order, two to a packet."""
    rows = dr.empty(mi.Float, 2 * layout.m * layout.row_count)
    k = dr.select(spans > 0, mi.UInt32(0), NONE)
    at_end = mi.Bool(False)
    u, zgl = mi.Float(-(layout.w + 1.0)), mi.Float(BACKGROUND)
    packet = mi.UInt32(0)
    while dr.hint(packet < layout.m // 2, label="write a row"):
        two = []
        for _ in range(2):
            if k != NONE:
                first, last, following = segments.first[k], segments.last[k], segments.following[k]
                at = dr.select(at_end, last, first)
                is_up = at_end | (first == last)
                zgl = row.sample(at)
                u = dr.select(is_up, -(mi.Float(at) + 1), mi.Float(at))
                goes_on = mi.Bool(False)
                if following != NONE:
                    goes_on = segments.first[following] == last
                at_end = ~is_up & ~goes_on
                k = dr.select(is_up | goes_on, following, k)
            two += [mi.Float(u), mi.Float(zgl)]
        dr.scatter(rows, mi.Vector4f(*two), lane * (layout.m // 2) + packet)
        packet += 1
    return rows
