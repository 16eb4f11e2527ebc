"""Cube maps looked up where a reflected ray leaves a proxy, and whether they show what the ray meets.

Every map knows how far away is what it shows. Let x be the ray's start seen from the map's centre, d the unit direction that is
looked up and D the distance that the map has there: the surface that is shown is at D d. It is |D d - x| from the reflection
point. Were the proxy the scene, it would lie on the ray. Doubted:

* It lies more than two pixels beside the ray, by what lies between the rays of neighbouring pixels, or behind its start.
* It lies on the ray, and the ray comes there from behind something: of STEPS points of its way, as seen from the map's centre
  spread evenly over the angle, the map shows a surface that is nearer than one of them. Where the surroundings are shown,
  it need not fill the texel, if it is more than two pixels beside the ray's end.
* The mirror itself is likely met before (`kernels.selfmet`).
* In a scene of several mirrors, what is black: in the map the others are, and nothing that is lit.

Where both the direction that is looked up and the ray's own show the surroundings, those of the ray's own are shown.

All is divided by D, so that the surroundings at infinity are a case like the others. Those of one colour are nowhere misplaced.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from benchharness.kernels import cubemap, differentials, selfmet
from benchharness.kernels.differentials import FirstHits, RayDifferential
from benchharness.kernels.frozen import frozen
from benchharness.kernels.images import probe, proxy
from benchharness.kernels.pixels import WRONG_PX
from benchharness.kernels.types import View

STEPS = 16
NEARER = 1.05  # times: texels of walls that are seen at a slant average to so much
COVER = 0.1  # share of a texel that what is before the surroundings has to fill

SLIPS = "something small slips through between the points of the ray that are looked up"
LIMITS = {
    "F-01": SLIPS,
    "F-11, F-23, F-25": "rays that meet the mirror again elsewhere than in a hollow of one radius are not traced",
    "F-17": "no frame is compared with the last",
    "F-18": SLIPS,
    "F-21": "something small at the focus fills the mirror, but few texels of its map",
    "F-25, F-26": "rays that meet the mirror again elsewhere than in a hollow of one radius are not traced",
    "I-03": SLIPS,
    "I-24": SLIPS,
    "I-28": SLIPS,
    "P-04": "a map holds the highlights seen from its place, and not whose surface they lie on",
}
"""What methods that look up such maps cannot know, as in `benchharness.api.Method.limits`."""


@frozen
def looked_up(
    probes: list[probe.Probe],
    proxies: list[proxy.Proxy],
    view: View,
    hits: FirstHits,
    active: mi.Bool,
    *,
    doubts: bool,
    plain: bool,
) -> tuple[mi.Color3f, mi.Float, mi.Bool]:
    """Radiance, distance, and doubt if asked for, from the map of each pixel's reflector and by its proxy.

    plain  the surroundings are the same in all directions
    """
    p, n = hits.p, hits.n
    r, differential, bends = differentials.reflected(hits, view)
    L, distance, doubt = mi.Color3f(0), mi.Float(0), mi.Bool(False)
    for i, (taken, own_proxy) in enumerate(zip(probes, proxies, strict=True)):
        own = active & (hits.reflector == i)
        x = mi.Vector3f(p - taken.place)
        d = proxy.towards(x, r, proxy.reach(own_proxy, p, r, taken.place))
        turn = turned(own_proxy, p, r, d, differential, taken.place)
        value, d = sky_is_far(
            taken.map, cubemap.lookup_mip(taken.map, d, probe.level(taken.map, turn), own), r, d, differential, own
        )
        away = shown_at(x, d, value.w)
        L = dr.select(own, mi.Color3f(value.x, value.y, value.z), L)
        distance = dr.select(own, away, distance)
        if not doubts:
            continue
        doubt |= misplaced(taken.map, x, r, d, value.w, differential, own, plain=plain)
        doubt |= own & (selfmet.away(p, n, r, differential.dp, bends, taken.box, own) < away)
        if len(probes) > 1:
            doubt |= own & (value.w > 0) & (dr.max(value.xyz) <= 0)
    return L, distance, doubt


def turned(
    own: proxy.Proxy, p: mi.Point3f, r: mi.Vector3f, d: mi.Vector3f, differential: RayDifferential, centre: mi.Point3f
) -> mi.Float:
    """By how many radians the direction d that is looked up turns to the next pixel's, the larger of two."""
    turn = mi.Float(0)
    for dp, dd in zip(differential.dp, differential.dd, strict=True):
        q, s = p + dp, r + dd
        there = proxy.towards(mi.Vector3f(q - centre), s, proxy.reach(own, q, s, centre))
        turn = dr.maximum(turn, dr.norm(there - d))
    return turn


def sky_is_far(
    map: cubemap.Pyramid, value: mi.Vector4f, r: mi.Vector3f, d: mi.Vector3f, differential: RayDifferential, active: mi.Bool
) -> tuple[mi.Vector4f, mi.Vector3f]:
    """What is shown, and the direction that it is looked up in: r, where both d, whose `value` this is, and r show the
    surroundings. No proxy is as far away as they are."""
    sky = active & (value.w <= 0)
    far = probe.far(map, r, differential.turn, sky)
    sky &= far.w <= 0
    return dr.select(sky, far, value), dr.select(sky, r, d)


def shown_at(x: mi.Vector3f, d: mi.Vector3f, inverse: mi.Float) -> mi.Float:
    """How far from x is what a map shows along d at 1 / distance `inverse`; inf for the surroundings."""
    near = inverse > 0
    return dr.select(near, dr.norm(d * dr.rcp(dr.select(near, inverse, 1)) - x), dr.inf)


@dr.syntax
def misplaced(
    map: cubemap.Pyramid,
    x: mi.Vector3f,
    r: mi.Vector3f,
    d: mi.Vector3f,
    inverse: mi.Float,
    differential: RayDifferential,
    active: mi.Bool,
    *,
    plain: bool,
) -> mi.Bool:
    """Whether what is shown along d, at 1 / distance `inverse`, is not where the ray from x along r meets something first."""
    along = dr.dot(r, d - x * inverse)
    beside = d - x * inverse - along * r
    steps = RayDifferential([dp * inverse for dp in differential.dp], differential.dd)
    off = (along <= 0) | (steps.pixels(along, beside) > WRONG_PX)
    sky = inverse <= 0
    if dr.hint(plain, mode="scalar"):
        off &= ~sky
        along = dr.select(sky, 1, along)
    off &= active

    # The way is x + a s / (1 - s) r, s in [0, end): even steps of s are nearly even steps of angle.
    a = dr.maximum(dr.norm(x), 1e-6)
    end = along / (a * inverse + along)
    level = dr.log2(dr.maximum(dr.norm(x / a - d) * (0.5 / STEPS) * map.n, 1))
    least, apart = (
        dr.select(sky, COVER, NEARER),
        dr.select(sky, WRONG_PX * differential.turn, -1),
    )
    k, searched = mi.UInt32(1), active & ~off
    while dr.hint(searched & ~off & (k < STEPS), label="look along the way of a reflected ray"):
        s = end * (mi.Float(k) / STEPS)
        q = (1 - s) * x + (s * a) * r
        nearness = cubemap.lookup_mip(map, q, level, searched).w
        length = dr.norm(q)
        off |= (nearness * length > least * (1 - s)) & (dr.norm(q - length * d) > apart * length)
        k += 1
    return off & active
