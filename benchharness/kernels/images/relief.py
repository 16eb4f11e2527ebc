"""Rays that meet parts of the scene shown by depth maps (Popescu et al. 2006, 4): the nearest hit over all maps of a mirror."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels.images import depthmap, depthray
from benchharness.kernels.images.billboard import NONE
from benchharness.kernels.images.depthmap import Layout


@dataclass
class Reliefs:
    """All depth maps of a scene, and which of them each mirror shows.

    depth    as `kernels.depthmap` has it
    rows     simplified, likewise; None where rays march over the texels
    dropped  spans that have no room, per row; None likewise
    cameras  likewise, the free number being how far a ray runs, in metres, before it may meet this map
    slots    of the pictures that belong to the maps
    parts    that the maps show
    lists    [mirrors, columns]: maps, NONE where a mirror has fewer; the first `objects` columns show objects
    columns  the rest shows other mirrors, and the mirror itself
    """

    depth: mi.Float
    rows: mi.Float | None
    dropped: mi.UInt32 | None
    cameras: mi.Float
    slots: mi.UInt32
    parts: mi.UInt32
    lists: mi.UInt32
    columns: int
    objects: int
    layout: Layout


@dataclass
class Hit:
    """The nearest hit, t = inf for none: slot, where in its picture ([-1, 1] across), and segments or texels looked at.

    doubt   it may join what stands apart
    missed  from this t on something may be that no map of its part shows; inf for nowhere
    """

    t: mi.Float
    slot: mi.UInt32
    x: mi.Float
    y: mi.Float
    work: mi.UInt32
    doubt: mi.Bool
    missed: mi.Float


@dr.syntax
def nearest(
    reliefs: Reliefs, columns: int, mirror: mi.UInt32, o: mi.Point3f, d: mi.Vector3f, nearer: mi.Float, jump: float,
    anchor: str, active,
) -> Hit:  # fmt: skip
    """Tests the ray o + t d, t < nearer, d unit, against the depth maps in the first `columns` columns of a mirror's list.

    jump    as `split_jump` of `depthray.meet_texels`; the rows have their own already
    anchor  as in `depthray.meet_rows`
    """
    t, map, x, y, work = mi.Float(nearer), mi.UInt32(NONE), mi.Float(0), mi.Float(0), mi.UInt32(0)
    doubt, missed = mi.Bool(False), mi.Float(dr.inf)
    # From where all maps of a part so far have lost the ray: they follow one another in the list.
    part, lost = mi.UInt32(NONE), mi.Float(dr.inf)
    column = mi.UInt32(0)
    while dr.hint(active & (column < columns), label="depth maps of a mirror"):
        candidate = dr.gather(mi.UInt32, reliefs.lists, mirror * reliefs.columns + column)
        listed = candidate != NONE
        candidate = dr.select(listed, candidate, 0)
        start = dr.gather(mi.Float, reliefs.cameras, candidate * 16 + 15)
        segment = depthray.project(reliefs.cameras, reliefs.layout.w, candidate, o, d, start, listed)
        segment.active &= segment.s_a < t
        hidden = mi.Float(dr.inf)
        if segment.active:  # many rays pass by
            if dr.hint(reliefs.rows is None, mode="scalar"):
                hit = depthray.meet_texels(segment, reliefs.depth, reliefs.layout.w, jump)
            else:
                hit = depthray.meet_rows(segment, reliefs.rows, reliefs.layout, anchor, dropped=reliefs.dropped)
                # The row lies beside the ray's image: what it shows may not be in the picture there.
                there = depthmap.texel(reliefs.depth, reliefs.layout.w, candidate, hit.x, hit.y, hit.found)
                hit.found &= there < depthmap.COVERED
            distance = segment.distance(hit.t)
            closer = hit.found & (distance < t)
            t, map = dr.select(closer, distance, t), dr.select(closer, candidate, map)
            x, y = dr.select(closer, hit.x, x), dr.select(closer, hit.y, y)
            doubt = dr.select(closer, hit.step, doubt)
            hidden = dr.select(hit.hidden < dr.inf, segment.distance(dr.minimum(hit.hidden, 1)), dr.inf)
            work += hit.work
        shown = dr.gather(mi.UInt32, reliefs.parts, candidate, listed)
        missed = dr.select(shown == part, missed, dr.minimum(missed, lost))
        lost = dr.select(shown == part, dr.maximum(lost, hidden), hidden)
        part = mi.UInt32(shown)
        column += 1
    found = map != NONE
    per_texel = 2.0 / reliefs.layout.w
    slot = dr.gather(mi.UInt32, reliefs.slots, map, found)
    return Hit(
        dr.select(found, t, dr.inf),
        slot,
        (x + 0.5) * per_texel - 1,
        (y + 0.5) * per_texel - 1,
        work,
        doubt,
        dr.minimum(missed, lost),
    )
