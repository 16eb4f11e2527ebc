"""Rays that meet parts of the scene shown by depth maps (Popescu et al. 2006, 4): the nearest hit over all maps of a mirror."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels.images import depthmap, depthray, rowpair
from benchharness.kernels.images.candidates import NONE, Candidates, Ray
from benchharness.kernels.images.depthmap import Layout


@dataclass
class Reliefs:
    """All depth maps of a scene, and which of them each mirror shows.

    depth       as `kernels.images.depthmap` has it
    rows        simplified, likewise; None where rays march over the texels
    dropped     spans that have no room, per row; None likewise
    cameras     likewise, the free number being how far a ray runs, in metres, before it may meet this map
    slots       of the pictures that belong to the maps
    parts       that the maps show
    candidates  the maps that each mirror shows, those of one part one after the other
    """

    depth: mi.Float
    rows: mi.Float | None
    dropped: mi.UInt32 | None
    cameras: mi.Float
    slots: mi.UInt32
    parts: mi.UInt32
    candidates: Candidates
    layout: Layout


@dataclass
class Walk:
    """How rays look into depth maps.

    split_jump  as in `depthray.meet_texels`; the rows have their own already
    anchor      as in `depthray.meet_rows`
    pair        they are met by two rows each (`rowpair`)
    """

    split_jump: float = 0.0
    anchor: depthray.Anchor = "mid"
    pair: bool = False


@dataclass
class Hit:
    """The nearest hit of a ray, and what the search for it says besides.

    t       of the hit; inf for none
    slot    whose picture shows it
    x, y    where in this picture, [-1, 1] across
    work    segments or texels looked at
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
def nearest(reliefs: Reliefs, columns: int, ray: Ray, nearer: mi.Float, walk: Walk) -> Hit:
    """Tests a ray, t < nearer, against the depth maps in the first `columns` columns of its mirror's candidates."""
    t = mi.Float(nearer)  # of the nearest hit so far
    nearest_map = mi.UInt32(NONE)  # which shows it
    x, y = mi.Float(0), mi.Float(0)  # where in this map, texels
    doubt = mi.Bool(False)  # whether it lies on a step
    work = mi.UInt32(0)  # segments or texels looked at
    missed = mi.Float(dr.inf)  # from where on all maps of some part have lost the ray
    part, lost = mi.UInt32(NONE), mi.Float(dr.inf)  # the last map's part, and from where on all its maps so far have
    column = mi.UInt32(0)
    while dr.hint(column < columns, label="depth maps of a mirror"):
        candidate = reliefs.candidates.at(ray.mirror, column)
        listed = candidate != NONE
        candidate = dr.select(listed, candidate, 0)
        start = dr.gather(mi.Float, reliefs.cameras, candidate * 16 + 15)
        place = reliefs.layout.place(candidate)
        segment = depthray.project(reliefs.cameras, place.w, candidate, ray.o, ray.d, start, listed)
        segment.active &= segment.s_a < t
        hidden = mi.Float(dr.inf)
        if segment.active:  # many rays pass by
            if dr.hint(reliefs.rows is None, mode="scalar"):
                hit = depthray.meet_texels(segment, reliefs.depth, reliefs.layout.w, walk.split_jump, place=place)
            elif dr.hint(walk.pair, mode="scalar"):
                hit = rowpair.meet(
                    segment, reliefs.rows, reliefs.layout, reliefs.depth, place, walk.anchor, dropped=reliefs.dropped
                )
            else:
                hit = depthray.meet_rows(segment, reliefs.rows, reliefs.layout, walk.anchor, dropped=reliefs.dropped)
                # The row lies beside the ray's image: what it shows may not be in the picture there.
                there = depthmap.texel(reliefs.depth, place, hit.x, hit.y, hit.found)
                hit.found &= there < depthmap.COVERED
            distance = segment.distance(hit.t)
            closer = hit.found & (distance < t)
            t, nearest_map = dr.select(closer, distance, t), dr.select(closer, candidate, nearest_map)
            x, y = dr.select(closer, hit.x, x), dr.select(closer, hit.y, y)
            doubt = dr.select(closer, hit.step, doubt)
            hidden = dr.select(hit.hidden < dr.inf, segment.distance(dr.minimum(hit.hidden, 1)), dr.inf)
            work += hit.work
        shown = dr.gather(mi.UInt32, reliefs.parts, candidate, listed)
        missed = dr.select(shown == part, missed, dr.minimum(missed, lost))
        lost = dr.select(shown == part, dr.maximum(lost, hidden), hidden)
        part = mi.UInt32(shown)
        column += 1
    found = nearest_map != NONE
    per_texel = 2 * dr.rcp(mi.Float(reliefs.layout.place(dr.select(found, nearest_map, 0)).w))
    slot = dr.gather(mi.UInt32, reliefs.slots, nearest_map, found)
    u, v = (x + 0.5) * per_texel - 1, (y + 0.5) * per_texel - 1
    return Hit(dr.select(found, t, dr.inf), slot, u, v, work, doubt, dr.minimum(missed, lost))
