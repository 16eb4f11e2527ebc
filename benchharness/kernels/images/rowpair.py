"""Rays between two rows of a depth map: what the nearest of either rotation beside a ray's image say, interpolated.

A row nearest to a ray's image is turned from it by up to half the angular increment, and leaves it by as many texels as half
its length times that angle. Popescu et al. 2006 (section 5) propose to look up the two best rows and to interpolate. The two
lie on either side of the image, as far away as their angles say: on a plane, the hits between them are those of the image
itself, to second order. Where only one row meets the surface, or the two meet different ones, there is nothing to interpolate:
the map says at the point between whether that is on its surface, and at the hit of one row alone whether it is near it.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from benchharness.kernels.images import depthray
from benchharness.kernels.images.depthmap import COVERED, Layout, Place, texel
from benchharness.kernels.images.depthray import Anchor, Hit, Segment

JOINED = 0.02  # of zgl: a point so near the map's surface is on it
NEAR = 0.1  # of zgl: what one row alone meets so far off the map's surface is none of it; steps are as large


def meet(
    segment: Segment,
    rows: mi.Float,
    layout: Layout,
    depth: mi.Float,
    place: Place,
    anchor: Anchor = "mid",
    dropped: mi.UInt32 | None = None,
) -> Hit:
    """Where rays first meet what two rows show, in the picture; arguments as `depthray.meet_rows` and `depthmap` have them."""
    one, two = (depthray.meet_rows(segment, rows, layout, anchor, dropped=dropped, second=k) for k in (False, True))
    (first, first_near), (second, second_near) = (_seen(segment, depth, place, hit) for hit in (one, two))
    turns = depthray.turns_of(segment, layout)
    t = dr.lerp(one.t, two.t, dr.abs(turns - dr.round(turns)))
    between, both = segment.point(t), first & second
    first &= second | first_near
    second &= both | second_near
    joined = both & (dr.abs(texel(depth, place, between.x, between.y, both) - between.z) < JOINED)
    t = dr.select(joined, t, dr.select(first, one.t, two.t))
    q = segment.point(t)
    step = (first & one.step) | (second & two.step)
    return Hit(first | second, t, q.x, q.y, one.work + two.work, step, dr.minimum(one.hidden, two.hidden))


def _seen(segment: Segment, depth: mi.Float, place: Place, hit: Hit) -> tuple[mi.Bool, mi.Bool]:
    """Whether a row's hit is in the picture, and whether near the surface there."""
    zgl = texel(depth, place, hit.x, hit.y, hit.found)
    return hit.found & (zgl < COVERED), hit.found & (dr.abs(zgl - segment.point(hit.t).z) < NEAR)
