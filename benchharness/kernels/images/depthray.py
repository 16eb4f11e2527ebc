"""Rays against depth maps: as segments of a map, met with its simplified rows or texel by texel (Popescu et al. 2006, 4.3).

A ray is clipped to the map's frustum in the camera's space, before it is projected: what starts behind the camera or crosses
its plane is then as good as any other. Its image is a segment a - b in (x, y, zgl), see `kernels.images.depthmap`, on which
points at t in [0, 1] follow one another as on the ray, but not at its pace: `Segment.distance` undoes the perspective. A ray
through the camera's centre has a point for an image and is no special case: sides are told by cross products, nothing is
divided by the image's length.

The row nearest to the image is that of rotation round(angle n / pi) through its midpoint (`anchor` "mid"): it leaves the
image by |ab| / 2 tan(pi / 2n) at most, half as far as the row through its start ("start"). Through neither does the
paper say which.

A hit passes from in front of the surface to behind it. A ray that comes from behind, where the map shows nothing of the object,
goes through the back unseen; `both_sides` lets it hit there.

Doubt. What lies behind the surface, as the camera sees it, the map does not know: from where a ray first runs there, before
its hit, something may be missed. Likewise from its start where its row has not all its spans. A hit is doubted where the
surface has a step: there it may join what stands apart.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import drjit as dr
import mitsuba as mi

from benchharness.kernels.images.depthmap import BACKGROUND, COVERED, Layout, Place, texel

Anchor = Literal["mid", "start"]
"""Through which point of a ray's image its row goes."""

POINT = 1e-6  # pixels: an image shorter than this has no angle
FARTHEST = 1e30  # of a clipped ray's parameter
STEP = 0.05  # of zgl from one sample to the next. Of 256 samples over what is as deep as wide, it is a slope of 86 degrees
BEHIND = 0.02  # of zgl: a ray less far behind a surface may be before it, for simplified rows are as far off


@dataclass
class Segment:
    """What of a ray a map's camera sees. Ends a and b in (x, y, zgl), s the ray's parameter, Z depth in metres.

    active  whether it sees anything; where it does not, all else is finite and meaningless
    """

    a: mi.Vector3f
    b: mi.Vector3f
    s_a: mi.Float
    s_b: mi.Float
    Z_a: mi.Float
    Z_b: mi.Float
    map: mi.UInt32
    active: mi.Bool

    def point(self, t: mi.Float) -> mi.Vector3f:
        """(x, y, zgl) at t."""
        return dr.fma(t, self.b - self.a, self.a)

    def distance(self, t: mi.Float) -> mi.Float:
        """The ray's parameter at t: 1 / Z and s / Z are linear in t."""
        at_a, at_b = (1 - t) * self.Z_b, t * self.Z_a
        return (at_a * self.s_a + at_b * self.s_b) / (at_a + at_b)


@dataclass
class Hit:
    """The first hit of every lane: t on its segment and the point (x, y) of the map there, for looking up its texture.

    work    segments tested (`meet_rows`) or texels read (`meet_texels`)
    step    the hit is on a step
    hidden  t from which something may be missed, before the hit if there is one; inf for nowhere
    """

    found: mi.Bool
    t: mi.Float
    x: mi.Float
    y: mi.Float
    work: mi.UInt32
    step: mi.Bool = field(default_factory=lambda: mi.Bool(False))
    hidden: mi.Float = field(default_factory=lambda: mi.Float(dr.inf))


def project(
    cameras: mi.Float,
    w: mi.UInt32 | int,
    map: mi.UInt32,
    o: mi.Point3f,
    d: mi.Vector3f,
    s_min: mi.Float | float = 0.0,
    active: mi.Bool | bool = True,
) -> Segment:
    """The ray o + s d for s >= s_min as map number `map`, of w x w texels, sees it. d need not have length 1."""
    active = mi.Bool(active)
    rows = [dr.gather(mi.Vector4f, cameras, 4 * map + k, active) for k in range(3)]
    lens = dr.gather(mi.Vector4f, cameras, 4 * map + 3, active)
    lens = dr.select(active, lens, mi.Vector4f(1, 1, 2, 0))
    focal, zn, zf = lens.x, lens.y, lens.z
    P = mi.Vector3f(*(row.x * o.x + row.y * o.y + row.z * o.z + row.w for row in rows))
    D = mi.Vector3f(*(row.x * d.x + row.y * d.y + row.z * d.z for row in rows))

    # Clip to value + s rate >= 0 for every plane of the frustum.
    across = mi.Float(w)
    half = 0.5 * across
    planes = (
        (P.z - zn, D.z),
        (zf - P.z, -D.z),
        (focal * P.x + half * P.z, focal * D.x + half * D.z),
        (half * P.z - focal * P.x, half * D.z - focal * D.x),
        (focal * P.y + half * P.z, focal * D.y + half * D.z),
        (half * P.z - focal * P.y, half * D.z - focal * D.y),
    )
    low, high = mi.Float(s_min), mi.Float(FARTHEST)
    for value, rate in planes:
        crossing = dr.clip(-value / dr.select(rate == 0, 1, rate), -FARTHEST, FARTHEST)
        low = dr.select(rate > 0, dr.maximum(low, crossing), low)
        high = dr.select(rate < 0, dr.minimum(high, crossing), high)
        active &= (rate != 0) | (value >= 0)
    active &= (low <= high) & (high < FARTHEST)
    low, high = dr.select(active, low, 0), dr.select(active, high, 0)

    c = 0.5 * (across - 1)
    scale = dr.rcp(dr.rcp(zn) - dr.rcp(zf))

    def seen(s: mi.Float) -> tuple[mi.Vector3f, mi.Float]:
        """(x, y, zgl) and Z."""
        q = dr.fma(D, s, P)
        Z = dr.clip(q.z, zn, zf)
        edge = mi.Vector3f(dr.fma(focal, q.x / Z, c), dr.fma(focal, q.y / Z, c), (dr.rcp(zn) - dr.rcp(Z)) * scale)
        return dr.clip(edge, mi.Vector3f(-0.5, -0.5, 0), mi.Vector3f(across - 0.5, across - 0.5, 1)), Z

    (a, Z_a), (b, Z_b) = seen(low), seen(high)
    return Segment(a, b, low, high, Z_a, Z_b, map, active)


def turns_of(segment: Segment, layout: Layout) -> mi.Float:
    """By how many angular increments a segment's image is turned from the rows of rotation 0, in [0, n]."""
    along = segment.b - segment.a
    is_point = along.x * along.x + along.y * along.y < POINT * POINT
    psi = dr.select(is_point, 0, dr.atan2(along.y, dr.select(is_point, 1, along.x)))
    psi = dr.select(psi < 0, psi + dr.pi, psi)
    return psi * (layout.n / dr.pi)


def row_of(
    segment: Segment, layout: Layout, anchor: Anchor, *, second: bool = False
) -> tuple[mi.UInt32, mi.Bool, mi.Float, mi.Float]:
    """The row nearest to a segment's image: its index in the buffer, whether there is one, and u of a and of b. `second`: the
    nearest of the rotation on the other side of the image."""
    assert anchor in ("mid", "start"), anchor
    turns = turns_of(segment, layout)
    turn = mi.UInt32(dr.floor(turns + 0.5))
    if second:
        turn = dr.select(turns > mi.Float(turn), turn + 1, turn + (layout.n - 1))
    turn = dr.select(turn >= layout.n, turn - layout.n, turn)  # pi is 0 with u the other way
    sine, cosine = dr.sincos(mi.Float(turn) * (dr.pi / layout.n))
    place = layout.place(segment.map)
    c = 0.5 * (mi.Float(place.w) - 1)

    def u(q: mi.Vector3f) -> mi.Float:
        """How far along the row a point is, samples."""
        return (q.x - c) * cosine + (q.y - c) * sine + c

    q = segment.a if anchor == "start" else 0.5 * (segment.a + segment.b)
    down = mi.Int32(dr.floor((q.y - c) * cosine - (q.x - c) * sine + (c + 0.5)))
    inside = segment.active & (down >= 0) & (down < mi.Int32(place.w))
    row = place.row + turn * place.w + mi.UInt32(down)
    return dr.select(inside, row, 0), inside, u(segment.a), u(segment.b)


@dr.syntax
def meet_rows(
    segment: Segment,
    rows: mi.Float,
    layout: Layout,
    anchor: Anchor = "mid",
    both_sides: bool = False,
    dropped: mi.UInt32 | None = None,
    second: bool = False,
) -> Hit:
    """Where rays first meet the simplified row that lies nearest to them.

    both_sides  they hit from behind the surface too
    dropped     spans that have no room, per row; None: that does not count
    second      as in `row_of`
    """
    row, active, u_a, u_b = row_of(segment, layout, anchor, second=second)
    du, dz = u_b - u_a, segment.b.z - segment.a.z
    u_start, u_end = dr.minimum(u_a, u_b), dr.maximum(u_a, u_b)
    onward = du > 0
    t, found = mi.Float(1), mi.Bool(False)  # the first hit so far
    is_step = mi.Bool(False)  # whether it is on a step
    is_hidden, u_hidden = mi.Bool(False), mi.Float(0)  # whether the ray runs behind the surface before it, and from where on
    u, zgl, is_up = (
        mi.Float(layout.place(segment.map).w),
        mi.Float(BACKGROUND),
        mi.Bool(True),
    )  # the last point, and whether the pen is lifted
    tests = mi.UInt32(0)  # segments tested
    packet = mi.UInt32(0)  # two points each
    while dr.hint(active & (packet < layout.m // 2), label="walk a simplified row"):
        two = dr.gather(mi.Vector4f, rows, row * (layout.m // 2) + packet, active)
        for u_code, zgl_new in ((two.x, two.y), (two.z, two.w)):
            up_new = u_code < 0
            u_new = dr.select(up_new, -u_code - 1, u_code)
            is_over = is_up & up_new & (u_new == u)
            is_single = is_up & up_new & ~is_over

            # The segment between the last point and this one; sides of its ends are equal for both neighbours.
            u_0, z_0 = dr.select(is_single, u_new - 0.5, u), dr.select(is_single, zgl_new, zgl)
            u_1 = dr.select(is_single, u_new + 0.5, u_new)
            side_0 = (u_0 - u_a) * dz - (z_0 - segment.a.z) * du
            side_1 = (u_1 - u_a) * dz - (zgl_new - segment.a.z) * du
            turn = side_1 - side_0
            ahead = (u_0 - u_a) * (zgl_new - z_0) - (z_0 - segment.a.z) * (u_1 - u_0)
            crosses = (side_0 <= 0) & (side_1 >= 0)
            if dr.hint(both_sides, mode="scalar"):
                crosses |= (side_0 >= 0) & (side_1 <= 0)
            is_drawn = active & ~is_over & (is_single | ~is_up)
            # t = -ahead / turn, in [0, 1] and less than the nearest so far
            sign = dr.select(turn < 0, mi.Float(-1), mi.Float(1))
            reach, size = -ahead * sign, dr.abs(turn)
            hit = is_drawn & crosses & (size > 0) & (reach >= 0) & (reach <= size * t)
            t = dr.select(hit, dr.minimum(reach / dr.select(hit, size, 1), 1), t)
            found |= hit
            tests += dr.select(is_drawn, 1, 0)
            is_step = dr.select(hit, dr.abs(zgl_new - z_0) > STEP * (u_1 - u_0), is_step)

            # Behind the segment, amid what the ray and it share. Where u falls along the ray, a hit comes before all so far.
            low, high = dr.maximum(u_0, u_start), dr.minimum(u_1, u_end)
            past = 2 * u_1 - low - high, low + high - 2 * u_0
            past = (side_0 * past[0] + side_1 * past[1]) * dr.sign(du)
            is_behind = is_drawn & ~hit & (low < high) & (past > 2 * BEHIND * dr.abs(du) * (u_1 - u_0))
            is_first = is_behind & ~(onward & is_hidden)
            u_hidden = dr.select(is_first, dr.select(onward, low, high), u_hidden)
            is_hidden = is_behind | (is_hidden & (onward | ~hit))

            # u grows: no later segment is nearer once the ray, or its way to the hit, is over.
            active &= ~is_over & (u_1 <= u_end) & ~(found & (du > 0))
            u, zgl, is_up = u_new, zgl_new, up_new
        packet += 1
    hidden = dr.select(is_hidden, (u_hidden - u_a) / dr.select(du == 0, 1, du), dr.inf)
    if dr.hint(dropped is not None, mode="scalar"):
        hidden = dr.select(dr.gather(mi.UInt32, dropped, row, segment.active) > 0, 0, hidden)
    q = segment.point(t)
    return Hit(found, t, q.x, q.y, tests, is_step, hidden)


@dr.syntax
def meet_texels(
    segment: Segment,
    depth: mi.Float,
    w: int,
    split_jump: float | None = None,
    both_sides: bool = False,
    place: Place | None = None,
) -> Hit:
    """Where rays first meet the map itself, looked at in steps of a texel along their images: slow and plain.

    w           texels on a side of all maps
    place       where each lane's map lies, for maps of sizes of their own
    split_jump  where neighbouring samples differ by more than this, nothing joins them; None or 0: all are joined
    both_sides  they hit from behind the surface too
    """
    place = Place(segment.map * (w * w), mi.UInt32(w), mi.UInt32(0)) if place is None else place
    along = segment.b - segment.a
    steps = dr.maximum(mi.UInt32(dr.ceil(dr.maximum(dr.abs(along.x), dr.abs(along.y)))), 1)
    step = dr.rcp(mi.Float(steps))
    t, found = mi.Float(1), mi.Bool(False)  # the hit
    is_step = mi.Bool(False)  # whether it is on a step
    hidden = mi.Float(dr.inf)  # from where on the ray is behind the surface
    before, gap_before = mi.Float(BACKGROUND), mi.Float(0)  # the last sample, and how far the ray was behind it
    run = mi.UInt32(0)  # samples joined up to that one
    reads = mi.UInt32(0)  # texels read
    k = mi.UInt32(0)  # steps
    active = mi.Bool(segment.active)
    while dr.hint(active & (k <= steps + 1), label="walk the texels of a ray"):
        t_k = mi.Float(k) * step
        q = segment.point(t_k)
        is_read = k <= steps
        zgl = texel(depth, place, q.x, q.y, active & is_read)
        reads += dr.select(is_read, 1, 0)
        covered, was_covered = zgl < COVERED, before < COVERED
        joined = covered & was_covered
        if dr.hint((split_jump or 0) > 0, mode="scalar"):
            joined &= dr.abs(zgl - before) <= split_jump

        # From the last sample to this one, or across a sample that stands alone: flat, and a step wide.
        gap = q.z - zgl
        alone = was_covered & ~joined & (run == 1)
        half = 0.5 * along.z * step
        from_ = dr.select(alone, dr.select(k == 1, gap_before, gap_before - half), gap_before)
        to = dr.select(alone, dr.select(is_read, gap_before + half, gap_before), gap)
        crosses = (from_ <= 0) & (to > 0)
        if dr.hint(both_sides, mode="scalar"):
            crosses |= (from_ >= 0) & (to < 0)
        found = (joined | alone) & crosses
        share = -from_ / dr.select(crosses, to - from_, 1)
        start = dr.select(alone & (k > 1), t_k - 1.5 * step, t_k - step)
        length = dr.select(alone, dr.select((k == 1) | ~is_read, 0.5 * step, step), step)
        t = dr.select(found, dr.clip(dr.fma(share, length, start), 0, 1), t)
        is_step = found & joined & (dr.abs(zgl - before) > STEP)
        hidden = dr.select(active & covered & ~found & (gap > BEHIND), dr.minimum(hidden, t_k), hidden)

        run = dr.select(joined, run + 1, 1)
        before, gap_before = mi.Float(zgl), mi.Float(gap)
        active &= ~found
        k += 1
    q = segment.point(t)
    return Hit(found, t, q.x, q.y, reads, is_step, hidden)
