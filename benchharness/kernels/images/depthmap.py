"""Depth maps as impostors: layout, and rows across them at any angle (Popescu et al. 2006, section 4.1).

A depth map is what a pinhole camera saw of an object, with near and far planes around the object's bounding box. A ray
projects to a segment of the map, and the object's profile along that segment is a row of the map turned by the segment's
angle. So every row of n rotations (pi i / n) is simplified once to a polyline of at most m points: what a ray then meets is
found among at most m - 1 segments. No map is stored rotated.

`count` maps of w x w texels lie in one buffer each; or maps of sizes of their own do, one after the other:

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

As many rows and samples as the map has texels on a side leave its corners out when it is turned: 17 % of it at 45 degrees,
half of that for want of rows and half for want of samples. An object in the circle of w texels across loses nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

BACKGROUND = 2.0  # zgl where nothing was seen
COVERED = 1.5  # zgl below which something was


@dataclass
class Layout:
    """Sizes of the buffers: `w` texels on a side, `n` rotations, `m` points in a row; `count` maps.

    places  for maps of sizes of their own, packets of each: first texel, texels on a side, first row, 0; `w` is then the
            largest. None where all have w
    """

    count: int
    w: int
    n: int
    m: int
    places: mi.UInt32 | None = None

    def __post_init__(self) -> None:
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
        """How many simplified rows there are in all, of maps of one size."""
        return self.count * self.n * self.w

    def place(self, map: mi.UInt32) -> Place:
        """Where a lane's map lies."""
        if self.places is None:
            return Place(map * (self.w * self.w), mi.UInt32(self.w), map * (self.n * self.w))
        packet = dr.gather(mi.Vector4u, self.places, map)
        return Place(packet.x, packet.y, packet.z)

    @property
    def byte_count(self) -> int:
        """What the simplified rows take in memory."""
        return self.row_count * self.m * 8


@dataclass
class Place:
    """Where a lane's map lies: its first texel, texels on a side, first row."""

    first: mi.UInt32
    w: mi.UInt32
    row: mi.UInt32


@dataclass
class Row:
    """Where a lane's row lies, and its samples.

    depth, map, place  all maps, the number of the row's own, and where that lies
    x, y               sample 0, texels
    sine, cosine       the row's direction
    """

    depth: mi.Float
    map: mi.UInt32
    place: Place
    x: mi.Float
    y: mi.Float
    sine: mi.Float
    cosine: mi.Float

    @property
    def w(self) -> mi.UInt32:
        """Its samples."""
        return self.place.w

    def sample(self, u: mi.UInt32, active: mi.Bool | bool = True) -> mi.Float:
        """zgl of sample u; BACKGROUND outside of the map."""
        along = mi.Float(u)
        return texel(self.depth, self.place, dr.fma(along, self.cosine, self.x), dr.fma(along, self.sine, self.y), active)


def texel(depth: mi.Float, place: Place, x: mi.Float, y: mi.Float, active: mi.Bool | bool = True) -> mi.Float:
    """zgl of the texel of a map nearest to (x, y), pixels; BACKGROUND outside of the map."""
    column, row = mi.Int32(dr.floor(x + 0.5)), mi.Int32(dr.floor(y + 0.5))
    w = mi.Int32(place.w)
    inside = (column >= 0) & (row >= 0) & (column < w) & (row < w) & active
    zgl = dr.gather(mi.Float, depth, place.first + mi.UInt32(row * w + column), inside)
    return dr.select(inside, zgl, BACKGROUND)


def row_at(depth: mi.Float, layout: Layout, index: mi.UInt32, map: mi.UInt32 | None = None) -> Row:
    """The row with number `index`, in the order of their buffer; `map`: whose it is, for maps of sizes of their own."""
    map = index // (layout.n * layout.w) if map is None else map
    place = layout.place(map)
    own = index - place.row
    turn = own // dr.maximum(place.w, 1)
    sine, cosine = dr.sincos(mi.Float(turn) * (dr.pi / layout.n))
    c = 0.5 * (mi.Float(place.w) - 1)
    down = mi.Float(own - turn * place.w) - c
    x, y = c - c * cosine - down * sine, c - c * sine + down * cosine
    return Row(depth, map, place, x, y, sine, cosine)
