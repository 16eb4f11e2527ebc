"""Where pictures are kept: one after the other in one buffer, each with its mip levels, whatever their sizes.

What was taken on a sheet (`kernels.images.atlas`) is put in, and what is not taken again keeps its texels.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels import packets
from benchharness.kernels.frozen import frozen_by_width, roomy
from benchharness.kernels.images import atlas
from benchharness.kernels.images.atlas import Sheet

GRAIN = 16  # texels: all pictures are multiples of this long
NOWHERE = 0xFFFF_FFFF  # no texel


@dataclass
class Shelf:
    """Pictures of N slots.

    sizes   texels across, int [N]; 0 where there is none
    firsts  first texel of each, int [N]
    texels  packets of 4 floats for pictures, one float for depth maps
    """

    sizes: np.ndarray
    firsts: np.ndarray
    texels: mi.Float

    @property
    def places(self) -> mi.UInt32:
        """Packets of each slot: first texel, texels across, 0, 0."""
        packed = np.zeros((max(len(self.sizes), 1), 4), np.uint32)
        packed[: len(self.sizes), 0], packed[: len(self.sizes), 1] = self.firsts, self.sizes
        return mi.UInt32(packed.ravel())


def empty(count: int) -> Shelf:
    """No picture yet."""
    return Shelf(np.zeros(count, int), np.zeros(count, int), dr.zeros(mi.Float, 4))


@dataclass(frozen=True, eq=False)
class New:
    """What was taken: of which slots, int [K], and the column and row of each one's first texel."""

    slots: np.ndarray
    columns: np.ndarray
    rows: np.ndarray


def length(sizes: np.ndarray, mip: bool) -> np.ndarray:
    """How many texels pictures of `sizes` have in all their levels."""
    squares = sizes.astype(np.int64) ** 2
    return np.where(sizes > 0, (4 * squares - atlas.COARSEST**2) // 3, 0) if mip else squares


def put(before: Shelf, sizes: np.ndarray, sheet: Sheet, new: New, *, mip: bool, depths: bool = False) -> Shelf:
    """The pictures of `before` with those of a sheet in their places; what has size 0 now is let go.

    Nothing but what is new is touched while all have the sizes and places that they had.

    depths  of the sheet, not its texels
    """
    lengths = length(sizes, mip)
    firsts, total = before.firsts, 0
    texels = before.texels
    if ((sizes != before.sizes) & (sizes > 0)).any():
        firsts, total = np.cumsum(lengths) - lengths, int(lengths.sum())
        kept = np.setdiff1d(np.flatnonzero(sizes), new.slots)
        table = _table(len(kept), total)
        table[: len(kept), :3] = np.stack([firsts[kept], lengths[kept], before.firsts[kept]], axis=1)
        texels = _moved(texels, mi.UInt32(table.ravel()), len(table), roomy(total), depths)
    starts, total = np.cumsum(lengths[new.slots]) - lengths[new.slots], int(lengths[new.slots].sum())
    table = _table(len(new.slots), total)
    table[: len(starts), 0], table[: len(starts), 1], table[: len(starts), 2] = starts, sizes[new.slots], firsts[new.slots]
    table[: len(starts), 4], table[: len(starts), 5] = new.columns, new.rows
    levels = atlas.levels_of(int(sizes[new.slots].max()), mip)
    pages = sheet.depth if depths else sheet.texels
    lanes, numbers = roomy(total), mi.UInt32(table.ravel())
    value, place = _taken(pages, numbers, len(table), sheet.width, sheet.height, levels, lanes, depths)
    texels = type(texels)(texels)
    dr.scatter(texels, value, place, place != NOWHERE)
    return Shelf(sizes, firsts, texels)


def _table(count: int, total: int) -> np.ndarray:
    """Room for `count` pictures and at least one more, of no size, which begins where all others end."""
    table = np.zeros((roomy(count + 1), 8), np.uint32)
    table[:, 0] = total
    return table


def _owner(table: mi.UInt32, count: int, lane: mi.UInt32, lanes: int) -> mi.UInt32:
    """Whose each lane is, by the first number of each of the `count` rows of a table."""
    starts = dr.gather(mi.UInt32, table, 8 * dr.arange(mi.UInt32, count))
    return dr.gather(mi.UInt32, atlas.owners(starts // GRAIN, count, lanes // GRAIN), lane // GRAIN)


@frozen_by_width
def _moved(texels: mi.Float, table: mi.UInt32, count: int, lanes: int, depths: bool) -> mi.Float:
    """Pictures at other places. `table`: of those that stay, the first texel here, how many, the first there."""
    lane = dr.arange(mi.UInt32, lanes)
    own = dr.gather(mi.Vector4u, table, 2 * _owner(table, count, lane, lanes))
    local = lane - own.x
    value = dr.gather(mi.Float if depths else mi.Vector4f, texels, own.z + local, local < own.y)
    return value if depths else packets.stored(value, lanes)


@frozen_by_width
def _taken(
    pages: mi.Float, table: mi.UInt32, count: int, width: int, height: int, levels: int, lanes: int, depths: bool
) -> tuple[mi.Float | mi.Vector4f, mi.UInt32]:
    """New texels, from a sheet of some size, and where they go. `table`: of those that are new, the first lane, texels across,
    the first texel, nothing, column and row on the sheet."""
    lane = dr.arange(mi.UInt32, lanes)
    number = _owner(table, count, lane, lanes)
    own, corner = (dr.gather(mi.Vector4u, table, 2 * number + k) for k in range(2))
    local = lane - own.x

    # The level, and how many texels come before it: in the picture, on the sheet.
    level, before, on_sheet = mi.UInt32(0), mi.UInt32(0), mi.UInt32(0)
    end, end_on_sheet = mi.UInt32(0), 0
    for k in range(1, levels):
        end, end_on_sheet = end + (own.y * own.y >> (2 * k - 2)), end_on_sheet + (width * height >> (2 * k - 2))
        deeper = local >= end
        level, before = dr.select(deeper, k, level), dr.select(deeper, end, before)
        on_sheet = dr.select(deeper, end_on_sheet, on_sheet)
    across, inside = own.y >> level, local - before
    row = inside // dr.maximum(across, 1)
    page = on_sheet + ((corner.y >> level) + row) * (width >> level) + (corner.x >> level) + inside - row * across
    there = inside < across * across
    value = dr.gather(mi.Float if depths else mi.Vector4f, pages, page, there)
    return value, dr.select(there, own.z + local, NOWHERE)
