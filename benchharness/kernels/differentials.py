"""Ray differentials: how the ray that a mirror reflects moves from one pixel to the next (Igehy 1999).

They are differences to the rays of the neighbouring pixels, whose first hits the G-buffer holds, and no derivatives: so they
are right for mirrors of any shape, and known for all that is drawn. At a ray's length t, its footprint is what lies between
it and its neighbours.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels import optics
from benchharness.kernels.types import View


@dataclass
class FirstHits:
    """What every pixel of the picture shows, as `benchharness.api.Frame` has it; lanes of pixels, or of some of them."""

    p: mi.Point3f
    n: mi.Normal3f
    reflector: mi.Int32

    def at(self, pixel: mi.UInt32) -> FirstHits:
        """The hits of some pixels."""
        return FirstHits(
            dr.gather(mi.Point3f, self.p, pixel),
            dr.gather(mi.Normal3f, self.n, pixel),
            dr.gather(mi.Int32, self.reflector, pixel),
        )


@dataclass
class RayDifferential:
    """Differences of a ray's start, `dp`, and of its unit direction, `dd`, to the rays of two neighbouring pixels."""

    dp: list[mi.Vector3f]
    dd: list[mi.Vector3f]

    def footprint(self, t: mi.Float) -> mi.Float:
        """Metres between neighbouring rays after t metres, the smaller of the two: what is drawn out stays sharp."""
        return dr.minimum(*(dr.norm(dp + t * dd) for dp, dd in zip(self.dp, self.dd, strict=True)))

    @property
    def turn(self) -> mi.Float:
        """By how much the direction turns from one pixel to the next, radians, the larger of two."""
        return dr.maximum(*(dr.norm(dd) for dd in self.dd))

    def pixels(self, t: mi.Float, e: mi.Vector3f) -> mi.Float:
        """How many pixels away the ray is that passes e, metres across, beside this one after t metres: least squares.

        Where only one neighbour is known, by that one alone; where none is, inf."""
        u, v = (dp + t * dd for dp, dd in zip(self.dp, self.dd, strict=True))
        uu, uv, vv, ue, ve = dr.dot(u, u), dr.dot(u, v), dr.dot(v, v), dr.dot(u, e), dr.dot(v, e)
        determinant = uu * vv - uv * uv
        both = determinant > 1e-6 * uu * vv
        scale = dr.rcp(dr.select(both, determinant, 1))
        two = dr.sqrt(dr.square((vv * ue - uv * ve) * scale) + dr.square((uu * ve - uv * ue) * scale))
        return dr.select(both, two, dr.norm(e) / dr.sqrt(dr.maximum(uu, vv)))


def reflected(hits: FirstHits, view: View) -> tuple[mi.Vector3f, RayDifferential, list[mi.Vector3f]]:
    """The mirror direction at every pixel's hit, and what `of_reflected` says of it."""
    r = optics.reflect(dr.normalize(view.eye - hits.p), hits.n)
    return r, *of_reflected(hits, view, dr.arange(mi.UInt32, view.width * view.height), hits, r)


def of_reflected(
    hits: FirstHits, view: View, pixel: mi.UInt32, here: FirstHits, d: mi.Vector3f
) -> tuple[RayDifferential, list[mi.Vector3f]]:
    """The differentials of the rays that leave along the mirror directions d, and how the normal turns to the same neighbours.

    The neighbours are to the right and below, at the picture's end to the left and above; all is 0 where a neighbour shows
    another mirror, or none.

    hits   of the whole picture
    pixel  which of them, per lane; `here`: their own hits
    """
    width, height = view.width, view.height
    row = pixel // width
    column = pixel - row * width
    dp, dd, dn = [], [], []
    for neighbour in (
        dr.select(column == width - 1, pixel - 1, pixel + 1),
        dr.select(row == height - 1, pixel - width, pixel + width),
    ):
        there = hits.at(dr.minimum(neighbour, width * height - 1))
        same = there.reflector == here.reflector
        turned = optics.reflect(dr.normalize(view.eye - there.p), there.n) - d
        dp.append(dr.select(same, mi.Vector3f(there.p - here.p), 0))
        dd.append(dr.select(same, turned, 0))
        dn.append(dr.select(same, mi.Vector3f(there.n - here.n), 0))
    return RayDifferential(dp, dd), dn
