"""Exact pixels from straight images: the ray that a pixel reflects asks the few triangles that its surroundings name.

Images of edges are bent and virtual triangles are straight, so what the raster pass finds at a pixel is near what the pixel
shows and not quite it. Here it only names whom to ask: the triangle whose image covers the pixel. The ray that the pixel
reflects is intersected with that triangle where it lies in the scene. If it passes beside it, it goes over that edge to the
next triangle of the mesh, and so on (`meshwalk`). Of all that a ray meets, the nearest is shown, with exact
weights, distance and highlight. There are four passes, the later ones for few pixels:

1. Every pixel asks the triangle that it names, and a small one whose image lies in it and may cover no pixel (`slivers`).
2. Where one of the eight pixels around names another *piece* of the scene than the pixel sees (a piece is all triangles that
   hang together), or sees the same one much nearer, and where nothing was met, what those eight name is asked.
3. Where a pixel now sees another piece than it names, its image is off by some pixels. The rays of 32 pixels around it, up to
   eight pixels away, ask what it names and what it sees.
4. A ray that still meets nothing, although it should or its pixel names something, asks in eight directions what some pixel
   there sees. So far from any image is the rim of a convex mirror in a room of few triangles.

What shares an edge is worked out once; nothing has to be built again when things move. What no pixel near by names is not
asked: something thin, whose image is farther off than it is wide, may be missing. The ray then meets something farther away,
or nothing. So may a part of a piece that hides another part of it, unless a pixel beside sees it.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels import geometry, optics
from benchharness.kernels.frozen import frozen
from benchharness.kernels.types import Frame
from benchharness.kernels.vertices import meshwalk
from benchharness.kernels.vertices.adjacency import NONE
from benchharness.kernels.vertices.meshwalk import JUMP, Asked, Hit, Ray

FAR_STEPS = 128  # triangles that a ray asks from one candidate on in the fourth pass
REACH = (1, 2, 4, 8)  # pixels: how far around those that are wrong others are asked for, in eight directions
FARTHEST = 128  # pixels, in which the fourth pass looks for one that sees anything
AROUND = tuple((x, y) for y in (-1, 0, 1) for x in (-1, 0, 1) if (x, y) != (0, 0))  # columns and rows to what touches a pixel
PLACES = len(REACH) * len(AROUND)


@dataclass
class Pixels:
    """The mirrors' pixels, and the rays that they reflect: one lane each, in the order of `types.Frame.pixels`.

    lanes          their pixels in the frame
    number         per pixel of the frame, which of the mirrors' it is, NONE for others
    named          the scene's triangle whose image covers it, NONE for none
    rays           that they reflect
    width, height  of the frame
    """

    lanes: mi.UInt32
    number: mi.UInt32
    named: mi.UInt32
    rays: Ray
    width: int
    height: int

    def beside(self, which: mi.UInt32, x: mi.Int32 | int, y: mi.Int32 | int, active: mi.Bool | bool = True) -> mi.UInt32:
        """The mirrors' pixel that is x columns to the right of number `which` and y rows below, NONE where there is none."""
        lane = mi.Int32(dr.gather(mi.UInt32, self.lanes, which, active))
        row = lane // self.width
        column = lane - row * self.width + x
        row += y
        inside = active & (column >= 0) & (row >= 0) & (column < self.width) & (row < self.height)
        return dr.select(inside, dr.gather(mi.UInt32, self.number, mi.UInt32(row * self.width + column), inside), NONE)

    def ray(self, which: mi.UInt32, active: mi.Bool | bool = True) -> Ray:
        """The ray of a pixel."""
        return Ray(*(dr.gather(type(a), a, which, active) for a in (self.rays.p, self.rays.d, self.rays.part)))


@dataclass
class Named:
    """What each of the mirrors' pixels names, triangles of the scene, NONE for none: the one whose image covers it, and a small
    one whose image is in it (`slivers`)."""

    covering: mi.UInt32
    small: mi.UInt32


@dataclass
class Shown:
    """What the mirrors' pixels show, one lane each.

    L, distance  radiance, and length of the ray
    found        there is an answer
    unmet        the ray meets nothing, although it should or a triangle is named
    mirror       it meets a mirror
    astray       it sees another piece than its pixel names
    triangle     that the ray meets, NONE for none
    """

    L: mi.Color3f
    distance: mi.Float
    found: mi.Bool
    unmet: mi.Bool
    mirror: mi.Bool
    astray: mi.Bool
    triangle: mi.UInt32


@frozen
def numbers(lanes: mi.UInt32, count: int) -> mi.UInt32:
    """`Pixels.number` of a frame of `count` pixels."""
    number = dr.full(mi.UInt32, NONE, count)
    dr.scatter(number, dr.arange(mi.UInt32, dr.width(lanes)), lanes)
    return number


def shown(asked: Asked, frame: Frame, number: mi.UInt32, named: Named, walled: mi.Bool) -> tuple[Shown, Pixels]:
    """What the mirrors' pixels show, at least one, and what of them was asked.

    number  as `numbers` has it
    walled  per pixel of the frame, where a ray always meets something. One that meets no candidate is taken to show a point of
            the triangle that its pixel names, near where it passes; elsewhere it has no answer

    Waits for the device three times, to learn how many pixels the later passes have.
    """
    view, lanes = frame.view, frame.pixels
    seen = _Seen(frame.p, frame.n, frame.v, frame.reflector)
    pixels, hits, differs = _first(asked, seen, lanes, number, named, (view.width, view.height))
    border = dr.compress(differs)
    if dr.width(border) > 0:
        hits = _asked_around(asked, pixels, hits, border)
    wrong = dr.compress(_is_wrong(asked, pixels, hits))
    if dr.width(wrong) > 0:
        places = dr.arange(mi.UInt32, PLACES * dr.width(wrong))
        hits = _of_keys(_asked_for(asked, pixels, hits, _keys(hits), wrong, places))
    lost = dr.compress(_is_lost(pixels, hits, walled))
    if dr.width(lost) > 0:
        hits = _asked_afar(asked, pixels, hits, lost)
    return _shown(asked, pixels, hits.triangle, walled), pixels


@dataclass
class _Seen:
    """The first hits of a frame, as `types.Frame` has them."""

    p: mi.Point3f
    n: mi.Normal3f
    v: mi.Vector3f
    reflector: mi.Int32


@frozen
def _first(
    asked: Asked, seen: _Seen, lanes: mi.UInt32, number: mi.UInt32, named: Named, size: tuple[int, int]
) -> tuple[Pixels, Hit, mi.Bool]:
    """The rays; what each meets from the triangles that its pixel names; and whether a pixel around names a piece that it does
    not see, or sees something much nearer."""
    p, n, v = (dr.gather(type(a), a, lanes) for a in (seen.p, seen.n, seen.v))
    part = asked.objects + mi.UInt32(dr.gather(mi.Int32, seen.reflector, lanes))
    ray = Ray(mi.Point3f(p), mi.Vector3f(optics.reflect(v, n)), part)
    hit = meshwalk.walked(asked, ray, named.covering, Hit(mi.UInt32(NONE), mi.Float(dr.inf)), named.covering != NONE)
    other = (named.small != NONE) & (meshwalk.piece(asked, named.small) != meshwalk.piece(asked, hit.triangle))
    hit = meshwalk.walked(asked, ray, named.small, hit, other)
    pieces = meshwalk.piece(asked, named.covering)
    pixels = Pixels(lanes, number, named.covering, ray, *size)
    dr.eval(pixels, hit, pieces)

    which, sees, differs = dr.arange(mi.UInt32, dr.width(lanes)), meshwalk.piece(asked, hit.triangle), mi.Bool(False)
    for x, y in AROUND:
        other = pixels.beside(which, x, y)
        inside = other != NONE
        there = dr.gather(mi.UInt32, pieces, other, inside)
        differs |= inside & (there != NONE) & ((there != sees) | (dr.gather(mi.Float, hit.t, other, inside) < JUMP * hit.t))
    return pixels, hit, differs


@frozen
def _asked_around(asked: Asked, pixels: Pixels, hits: Hit, which: mi.UInt32) -> Hit:
    """Hits, for which the pixels `which` have asked what the eight around them name: other pieces than they see, or what is
    much nearer."""
    best = Hit(dr.gather(mi.UInt32, hits.triangle, which), dr.gather(mi.Float, hits.t, which))

    def named(k: mi.UInt32) -> tuple[mi.UInt32, mi.Float]:
        other = pixels.beside(which, *_around(k))
        inside = other != NONE
        there = dr.select(inside, dr.gather(mi.UInt32, pixels.named, other, inside), NONE)
        return there, dr.select(inside, dr.gather(mi.Float, hits.t, other, inside), dr.inf)

    best = meshwalk.asks(asked, pixels.ray(which), best, named, len(AROUND))
    found = Hit(mi.UInt32(hits.triangle), mi.Float(hits.t))
    dr.scatter(found.triangle, best.triangle, which)
    dr.scatter(found.t, best.t, which)
    return found


def _around(k: mi.UInt32) -> tuple[mi.Int32, mi.Int32]:
    """Number k of AROUND."""
    place = dr.select(k < len(AROUND) // 2, k, k + 1)
    return mi.Int32(place % 3) - 1, mi.Int32(place // 3) - 1


@frozen
def _is_wrong(asked: Asked, pixels: Pixels, hits: Hit) -> mi.Bool:
    """Whether a pixel sees another piece than it names."""
    return meshwalk.piece(asked, hits.triangle) != meshwalk.piece(asked, pixels.named)


@frozen
def _asked_for(asked: Asked, pixels: Pixels, hits: Hit, keys: mi.UInt64, centres: mi.UInt32, number: mi.UInt32) -> mi.UInt64:
    """Hits, after the pixels around `centres` have asked for what these name and see; `number` counts PLACES for each."""
    centre, place = dr.gather(mi.UInt32, centres, number // PLACES), number % PLACES
    x, y = _around(place % len(AROUND))
    reach = mi.Int32(REACH[0])
    for k in range(1, len(REACH)):
        reach = dr.select(place // len(AROUND) == k, REACH[k], reach)
    other = pixels.beside(centre, reach * x, reach * y)
    inside = other != NONE
    t = dr.gather(mi.Float, hits.t, other, inside)
    best = Hit(dr.gather(mi.UInt32, hits.triangle, other, inside), mi.Float(t))
    about = [dr.select(inside, dr.gather(mi.UInt32, names, centre, inside), NONE) for names in (pixels.named, hits.triangle)]
    near = dr.gather(mi.Float, hits.t, centre, inside)
    best = meshwalk.asks(asked, pixels.ray(other, inside), best, lambda k: (dr.select(k == 0, *about), near), len(about))
    # Not on copies of the keys that are put together afterwards: of as many as there are, a recording would not know.
    dr.scatter_reduce(dr.ReduceOp.Min, keys, _key(best), other, inside & (best.t < t), dr.ReduceMode.Direct)
    return keys


@frozen
def _keys(hits: Hit) -> mi.UInt64:
    """`_key` of all hits."""
    return _key(hits)


@frozen
def _of_keys(keys: mi.UInt64) -> Hit:
    """What was nearest, from its key."""
    return Hit(mi.UInt32(keys & NONE), dr.reinterpret_array(mi.Float, mi.UInt32(keys >> 32)))


@frozen
def _is_lost(pixels: Pixels, hits: Hit, walled: mi.Bool) -> mi.Bool:
    """Whether the ray of a pixel meets nothing, although it should: it always does, or its pixel names something."""
    should = dr.gather(mi.Bool, walled, pixels.lanes) | (pixels.named != NONE)
    return should & (hits.triangle == NONE)


@frozen
@dr.syntax
def _asked_afar(asked: Asked, pixels: Pixels, hits: Hit, which: mi.UInt32) -> Hit:
    """Hits, after the pixels `which` have asked what the nearest see that see anything, in eight directions."""
    ray = pixels.ray(which)
    best, k, last = Hit(mi.UInt32(NONE), mi.Float(dr.inf)), mi.UInt32(0), mi.UInt32(NONE)
    while dr.hint(k < len(AROUND), label="look in eight directions"):
        x, y = _around(k)
        far, candidate = mi.Int32(1), mi.UInt32(NONE)
        while dr.hint((candidate == NONE) & (far <= FARTHEST), label="look for a pixel that sees anything"):
            other = pixels.beside(which, far * x, far * y)
            inside = other != NONE
            candidate = dr.select(inside, dr.gather(mi.UInt32, hits.triangle, other, inside), NONE)
            far += 1 + far // 4
        if (candidate != NONE) & (candidate != last):
            best = meshwalk.walked(asked, ray, candidate, best, mi.Bool(True), FAR_STEPS)
            last = mi.UInt32(candidate)
        k += 1
    found = Hit(mi.UInt32(hits.triangle), mi.Float(hits.t))
    dr.scatter(found.triangle, best.triangle, which)
    dr.scatter(found.t, best.t, which)
    return found


def _key(hit: Hit) -> mi.UInt64:
    """A number that is smaller for what is nearer, and for the lower number of what is as near."""
    return (mi.UInt64(dr.reinterpret_array(mi.UInt32, hit.t)) << 32) | mi.UInt64(hit.triangle)


@frozen
@dr.syntax
def _shown(asked: Asked, pixels: Pixels, triangle: mi.UInt32, walled: mi.Bool) -> Shown:
    """What the triangles that rays meet show."""
    named = pixels.named
    met, within = triangle != NONE, dr.gather(mi.Bool, walled, pixels.lanes)
    found = met | (within & (named != NONE))
    L, t, mirror = mi.Color3f(0), mi.Float(0), mi.Bool(False)
    if found:
        ray = pixels.rays
        passed = meshwalk.passed_by(asked.world, ray, dr.select(met, triangle, named))
        L, t = geometry.radiance(asked.world, passed.face, passed.weights, ray.p, found), dr.maximum(passed.t, 0)
        found &= met | (passed.t > 0)
        mirror = found & (geometry.part_of(passed.face) >= asked.objects)
    unmet = ~met & (within | (named != NONE))
    astray = meshwalk.piece(asked, triangle) != meshwalk.piece(asked, named)
    return Shown(L, t, found, unmet, mirror, astray, triangle)


@frozen
def doubted(shows: Shown, pixels: Pixels) -> mi.Bool:
    """Where rays may have missed something, per pixel of the frame: where they met nothing, or a mirror, whose light is not
    known, and where images are off, at that pixel or at one that touches it."""
    which = dr.arange(mi.UInt32, dr.width(pixels.lanes))
    doubt = shows.unmet | shows.mirror | shows.astray
    for x, y in AROUND:
        other = pixels.beside(which, x, y)
        doubt |= dr.gather(mi.Bool, shows.astray, other, other != NONE)
    full = dr.zeros(mi.Bool, pixels.width * pixels.height)
    dr.scatter(full, doubt, pixels.lanes)
    return full
