"""Where the simplified rows of depth maps are kept: one map's after the other's, whatever their sizes.

Those of maps that were taken again are built again; the others keep theirs.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels.frozen import frozen_by_width, roomy
from benchharness.kernels.images import atlas, depthrows
from benchharness.kernels.images.capture import CaptureOptions
from benchharness.kernels.images.depthmap import Layout
from benchharness.kernels.images.shelf import Shelf

GRAIN = 8  # rows: all maps have multiples of this many


@dataclass
class Rows:
    """Rows of N maps, as `kernels.images.depthmap` has them.

    counts   rows of each map, int [N]; 0 where there is none
    firsts   first row of each, int [N]
    points   of all rows
    dropped  of each row, spans that had no room
    dropped_last  of the maps that were built last together
    """

    counts: np.ndarray
    firsts: np.ndarray
    points: mi.Float
    dropped: mi.UInt32
    dropped_last: mi.UInt32


def put(before: Rows | None, depths: Shelf, new: np.ndarray, options: CaptureOptions) -> Rows:
    """The rows of `before` with those of the maps `new`, int [K], built from their depths; what has size 0 is let go."""
    n, m = options.rotations, options.points
    if before is None:
        none = np.zeros(len(depths.sizes), int)
        before = Rows(none, none, dr.zeros(mi.Float, 4), dr.zeros(mi.UInt32, 2), mi.UInt32(0))
    own = n * depths.sizes[new]
    starts, total = np.cumsum(own) - own, int(own.sum())
    places = _table(len(new), 4, 2, total)
    places[: len(new), :3] = np.stack([depths.firsts[new], depths.sizes[new], starts], axis=1)
    widest, lanes = int(depths.sizes.max()), roomy(total)
    built = _built(depths.texels, mi.UInt32(places.ravel()), len(places), widest, n, m, options.split_jump, lanes, options.seen)

    counts = n * depths.sizes
    firsts, total = np.cumsum(counts) - counts, int(counts.sum())
    fresh = np.zeros(len(counts), int)
    fresh[new] = 1
    source = before.firsts.copy()
    source[new] = starts
    held = np.flatnonzero(counts)
    table = _table(len(held), 4, 0, total)
    table[: len(held)] = np.stack([firsts, source, fresh, counts], axis=1)[held]
    numbers, kept = mi.UInt32(table.ravel()), (before.points, before.dropped)
    points, dropped = _merged(built[:2], kept, numbers, len(table), m, roomy(total))
    return Rows(counts, firsts, points, dropped, built[2])


def _table(count: int, columns: int, starts: int, total: int) -> np.ndarray:
    """Room for `count` maps and at least one more, which begins where all rows end and has none; `starts`: that column."""
    table = np.zeros((roomy(count + 1), columns), np.uint32)
    table[:, starts] = total
    return table


@frozen_by_width
def _built(
    depth: mi.Float, places: mi.UInt32, maps: int, w: int, n: int, m: int, split_jump: float, lanes: int, wide: bool
) -> tuple[mi.Float, mi.UInt32, mi.UInt32]:
    """The rows of maps at `places`, how many spans were dropped of each, and of all."""
    starts = dr.gather(mi.UInt32, places, 4 * dr.arange(mi.UInt32, maps) + 2)
    layout = Layout(maps, w, n, m, places)
    rows, dropped = depthrows.build(depth, layout, split_jump, _owner(starts, maps, lanes), wide=wide)
    return rows, dropped, dr.sum(dropped)


def _owner(starts: mi.UInt32, maps: int, lanes: int) -> mi.UInt32:
    """Whose each of `lanes` rows is."""
    return dr.gather(mi.UInt32, atlas.owners(starts // GRAIN, maps, -(-lanes // GRAIN)), dr.arange(mi.UInt32, lanes) // GRAIN)


@frozen_by_width
def _merged(
    built: tuple[mi.Float, mi.UInt32], kept: tuple[mi.Float, mi.UInt32], table: mi.UInt32, maps: int, m: int, lanes: int
) -> tuple[mi.Float, mi.UInt32]:
    """Every row from where it is. `table`: per map the first row here and there, whether that is among those built, and how
    many rows it has."""
    starts = dr.gather(mi.UInt32, table, 4 * dr.arange(mi.UInt32, maps))
    own = _owner(starts, maps, lanes)
    lane = dr.arange(mi.UInt32, lanes)
    packet = dr.gather(mi.Vector4u, table, own)
    local, new = lane - packet.x, packet.z == 1
    there, row = local < packet.w, packet.y + local
    of_new, of_kept = (dr.gather(mi.UInt32, own[1], row, there & here) for own, here in ((built, new), (kept, ~new)))
    dropped = dr.select(new, of_new, of_kept)

    points = dr.empty(mi.Float, 2 * m * lanes)
    each = m // 2
    lane = dr.arange(mi.UInt32, lanes * each)
    packet = dr.gather(mi.Vector4u, table, dr.gather(mi.UInt32, own, lane // each))
    local, new = lane - packet.x * each, packet.z == 1
    there, source = local < packet.w * each, packet.y * each + local
    of_new, of_kept = (dr.gather(mi.Vector4f, own[0], source, there & here) for own, here in ((built, new), (kept, ~new)))
    dr.scatter(points, dr.select(new, of_new, of_kept), lane)
    return points, dropped
