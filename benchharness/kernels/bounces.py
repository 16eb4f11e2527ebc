"""The light that reflected rays bring from pictures of the scene, at every pixel of a mirror.

Popescu et al. 2006, 3.1: the nearest impostor that the reflected ray meets, else the environment map. Where that impostor
shows a mirror, the ray is reflected once more about the normal of its texel, and meets the impostors of objects as that
mirror sees them: reflections of second order. Nothing of higher order.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels import backdrop, billboard, optics
from benchharness.kernels.frozen import frozen

RAY_EPSILON = 1e-4  # start of a ray above the surface, relative to the size of its coordinates


@dataclass
class Cast:
    """All that rays can meet. `metals`: as `optics.metals_of` has them."""

    boards: billboard.Billboards
    pictures: billboard.Pictures
    backdrop: backdrop.Backdrop
    metals: mi.Float


@dataclass
class Answer:
    """
    L         radiance along the reflected ray
    distance  to what it shows
    second    the ray was reflected again
    tests     rays against quads
    """

    L: mi.Color3f
    distance: mi.Float
    second: mi.Bool
    tests: mi.UInt32


@frozen
def reflected(cast: Cast, view, frame: list, pixel: mi.UInt32, second: bool, spread: bool) -> Answer:
    """
    frame   p, n, reflector of all pixels of the picture
    pixel   where to look, per lane
    second  mirrors reflect in mirrors; else they are black
    spread  follow how rays part, for the mip levels
    """
    p, n, mirror = (dr.gather(type(a), a, pixel) for a in frame)
    eye = view.eye
    d = optics.reflect(dr.normalize(eye - p), n)
    o = _above(p, mi.Vector3f(n))
    number = mi.UInt32(dr.maximum(mirror, 0))
    apart = _spread(frame, view, pixel, p, n, d, mirror) if spread else _no_spread()
    met = billboard.nearest(cast.boards, cast.pictures, cast.boards.columns, number, o, d, mi.Float(0), apart, mi.Bool(True))
    tests = met.tests

    direction, ground = backdrop.behind(cast.backdrop, o, d)
    open_ = ~(met.t < ground) | (met.t == dr.inf)
    L, distance = backdrop.look_up(cast.backdrop, number, direction, open_)
    hit = ~open_
    L = dr.select(hit, mi.Color3f(met.value.xyz), L)
    distance = dr.select(hit, met.t, dr.select(dr.isfinite(ground), ground, distance))

    other = dr.gather(mi.Float, cast.boards.quads, met.slot * 16 + 3, hit)
    again = hit & (other >= 0)
    if second:
        L2, more = _again(cast, met, o, d, mi.UInt32(dr.maximum(other, 0)), apart, again)
        L, tests = dr.select(again, L2, L), tests + more
    else:
        L = dr.select(again, 0, L)
    return Answer(L, distance, again, tests)


def _again(cast: Cast, met, o, d, mirror: mi.UInt32, apart: billboard.Spread, active) -> tuple[mi.Color3f, mi.UInt32]:
    """What a mirror in a picture sends back along a ray that met it, and how many quads were tested."""
    a, b, k = (dr.normalize(dr.gather(mi.Vector4f, cast.boards.quads, met.slot * 4 + i, active).xyz) for i in (1, 2, 3))
    n = met.value.x * a + met.value.y * b + met.value.z * k
    n = dr.normalize(dr.select(active & (dr.squared_norm(n) > 1e-12), n, k))
    n = dr.select(dr.dot(n, d) > 0, -n, n)
    p = o + dr.select(active, met.t, 0) * d
    out = optics.reflect(-d, mi.Normal3f(n))
    start = _above(p, n)
    found = billboard.nearest(cast.boards, cast.pictures, cast.boards.objects, mirror, start, out, mi.Float(0), apart, active)
    direction, ground = backdrop.behind(cast.backdrop, start, out)
    open_ = active & (~(found.t < ground) | (found.t == dr.inf))
    far, _ = backdrop.look_up(cast.backdrop, mirror, direction, open_)
    L = dr.select(open_, far, mi.Color3f(found.value.xyz))
    return L * optics.reflectance(cast.metals, mirror, dr.clip(-dr.dot(n, d), 0, 1), active), found.tests


def _above(p: mi.Point3f, n: mi.Vector3f) -> mi.Point3f:
    return p + n * (RAY_EPSILON * (1 + dr.max(dr.abs(p))))


def _no_spread() -> billboard.Spread:
    return billboard.Spread([mi.Vector3f(0), mi.Vector3f(0)], [mi.Vector3f(0), mi.Vector3f(0)])


def _spread(frame: list, view, pixel: mi.UInt32, p, n, d, mirror) -> billboard.Spread:
    """From the rays of the pixels to the right and below (to the left and above at the picture's end); 0 across borders."""
    width, height = view.width, view.height
    row = pixel // width
    column = pixel - row * width
    eye, starts, turns = view.eye, [], []
    for there in (
        dr.select(column == width - 1, pixel - 1, pixel + 1),
        dr.select(row == height - 1, pixel - width, pixel + width),
    ):
        q, m, other = (dr.gather(type(a), a, dr.minimum(there, width * height - 1)) for a in frame)
        same = other == mirror
        turned = optics.reflect(dr.normalize(eye - q), m) - d
        starts.append(dr.select(same, mi.Vector3f(q - p), 0))
        turns.append(dr.select(same, turned, 0))
    return billboard.Spread(starts, turns)
