"""Which impostors the rays of each mirror are tested against, and those rays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels.differentials import RayDifferential

NONE = 0xFFFF_FFFF  # no impostor

Listed = tuple[list[int], list[int]]
"""What a mirror shows of one kind: impostors of objects, impostors of mirrors."""


@dataclass
class Ray:
    """A ray o + t d, t > 0, that leaves a mirror.

    mirror        the mirror's number
    o, d          start and unit direction, world space
    differential  how it moves from one pixel to the next
    """

    mirror: mi.UInt32
    o: mi.Point3f
    d: mi.Vector3f
    differential: RayDifferential


@dataclass
class Candidates:
    """A row of impostors for each mirror.

    table    uint32 [mirrors, columns]: billboards or depth maps by number, NONE where a mirror has fewer
    columns  how many there are; the first `objects` of them show objects, the rest other mirrors and the mirror itself
    """

    table: mi.UInt32
    columns: int
    objects: int

    def at(self, mirror: mi.UInt32, column: mi.UInt32) -> mi.UInt32:
        """The impostor in a column of a mirror's row."""
        return dr.gather(mi.UInt32, self.table, mirror * self.columns + column)


def of_lists(shown: Sequence[Listed], there: np.ndarray | None = None) -> Candidates:
    """What each mirror shows, as a table. `there`: bool, by number, which impostors there are; all if None."""
    objects = max((len(own) for own, _ in shown), default=0)
    columns = objects + max((len(mirrors) for _, mirrors in shown), default=0)
    table = np.full((len(shown), max(columns, 1)), NONE, np.uint32)
    for row, (own, mirrors) in zip(table, shown, strict=True):
        row[: len(own)] = own
        row[objects : objects + len(mirrors)] = mirrors
    if there is not None:
        listed = table != NONE
        table[listed] = np.where(there[table[listed]], table[listed], NONE)
    return Candidates(mi.UInt32(table.ravel()), columns, objects)
