"""Exact pixels from straight images: the ray that a pixel reflects asks the few triangles that its surroundings name.

Images of edges are bent and virtual triangles are straight, so what the raster pass finds at a pixel is near what the pixel
shows and not quite it. Here it only names whom to ask: the triangle whose image covers the pixel. The ray that the pixel
reflects is intersected with that triangle where it lies in the scene. If it passes beside it, it goes over that edge to the
next triangle of the mesh, and so on (`meshwalk`). Of all that a ray meets, the nearest is shown, with exact
weights, distance and highlight. There are four passes, the later ones for few pixels:

1. Every pixel asks the triangle that it names.
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
from benchharness.kernels import pixels as spreading
from benchharness.kernels.frozen import frozen
from benchharness.kernels.types import Frame, View
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
    """The mirrors' pixels, and the rays that they reflect, one lane per pixel of the frame.

    lanes          those of the mirrors' pixels
    active         which they are
    named          the scene's triangle whose image covers a pixel, NONE for none
    p, d           packets: start and number of the mirror, unit direction; defined at the mirrors' pixels
    width, height  of the frame
    """

    lanes: mi.UInt32
    active: mi.Bool
    named: mi.UInt32
    p: mi.Float
    d: mi.Float
    width: int
    height: int

    def beside(self, lane: mi.UInt32, x: mi.Int32 | int, y: mi.Int32 | int) -> tuple[mi.UInt32, mi.Bool]:
        """The lane of the pixel x columns and y rows away, and whether it is in the frame."""
        return _beside(lane, x, y, self.width, self.height)


def _beside(lane: mi.UInt32, x: mi.Int32 | int, y: mi.Int32 | int, width: int, height: int) -> tuple[mi.UInt32, mi.Bool]:
    """`Pixels.beside`, for a picture of that size."""
    row = mi.Int32(lane // width)
    column = mi.Int32(lane) - row * width + x
    row += y
    return mi.UInt32(row * width + column), (column >= 0) & (row >= 0) & (column < width) & (row < height)


@dataclass
class Shown:
    """What the mirrors' pixels show, one lane per pixel of the frame, of no meaning at others.

    L, distance  radiance, and length of the ray
    found        there is an answer
    unmet        the ray meets nothing, although it should or a triangle is named
    mirror       it meets a mirror
    astray       it sees another piece than its pixel names
    """

    L: mi.Color3f
    distance: mi.Float
    found: mi.Bool
    unmet: mi.Bool
    mirror: mi.Bool
    astray: mi.Bool


def shown(asked: Asked, frame: Frame, named: mi.UInt32, walled: mi.Bool) -> Shown:
    """What the mirrors' pixels show.

    named   as `Pixels` has it
    walled  where a ray always meets something. One that meets no candidate is taken to show a point of the triangle that its
            pixel names, near where it passes; elsewhere it has no answer

    Waits for the device three times, to learn how many pixels the later passes have.
    """
    view, lanes = frame.view, frame.pixels
    seen = _Seen(frame.p, frame.n, frame.v, frame.reflector, frame.active)
    pixels, hits, pieces, at_border = _first(asked, seen, lanes, named, (view.width, view.height))
    border = dr.compress(at_border)
    if dr.width(border) > 0:
        hits = _asked_around(asked, pixels, hits, dr.gather(mi.UInt32, lanes, border))
    wrong = dr.compress(_is_wrong(asked, pixels, hits, pieces))
    if dr.width(wrong) > 0:
        number = dr.arange(mi.UInt32, PLACES * dr.width(wrong))
        hits.triangle = _asked_for(asked, pixels, hits, dr.gather(mi.UInt32, lanes, wrong), number)
    lost = dr.compress(_is_lost(pixels, hits.triangle, walled))
    if dr.width(lost) > 0:
        hits.triangle = _asked_afar(asked, pixels, hits.triangle, dr.gather(mi.UInt32, lanes, lost))
    return _shown(asked, pixels, hits.triangle, walled, view)


@dataclass
class _Seen:
    """The first hits of a frame, as `types.Frame` has them."""

    p: mi.Point3f
    n: mi.Normal3f
    v: mi.Vector3f
    reflector: mi.Int32
    active: mi.Bool


@frozen
def _first(
    asked: Asked, seen: _Seen, lanes: mi.UInt32, named: mi.UInt32, size: tuple[int, int]
) -> tuple[Pixels, Hit, mi.UInt32, mi.Bool]:
    """The rays; what each meets from the triangle that its pixel names; the pieces that are named; and per mirror's pixel
    whether one around it names a piece that it does not see, or sees something much nearer."""
    count = size[0] * size[1]
    p, n, v = (dr.gather(type(a), a, lanes) for a in (seen.p, seen.n, seen.v))
    part = asked.objects + mi.UInt32(dr.gather(mi.Int32, seen.reflector, lanes))
    d = optics.reflect(v, n)
    rays = [dr.empty(mi.Float, 4 * count) for _ in range(2)]
    for buffer, value in zip(rays, (mi.Vector4f(p.x, p.y, p.z, mi.Float(part)), mi.Vector4f(d.x, d.y, d.z, 0)), strict=True):
        dr.scatter(buffer, value, lanes)
    start = dr.gather(mi.UInt32, named, lanes)
    hit = meshwalk.walked(asked, Ray(p, d, part), start, Hit(mi.UInt32(NONE), mi.Float(dr.inf)), start != NONE)
    hits = Hit(dr.full(mi.UInt32, NONE, count), dr.full(mi.Float, dr.inf, count))
    pieces = dr.full(mi.UInt32, NONE, count)
    for buffer, value in ((hits.triangle, hit.triangle), (hits.t, hit.t), (pieces, meshwalk.piece(asked, start))):
        dr.scatter(buffer, value, lanes)
    pixels = Pixels(lanes, seen.active, named, *rays, *size)
    dr.eval(pixels, hits, pieces)

    sees, t = meshwalk.piece(asked, dr.gather(mi.UInt32, hits.triangle, lanes)), dr.gather(mi.Float, hits.t, lanes)
    differs = mi.Bool(False)
    for x, y in AROUND:
        lane, inside = pixels.beside(lanes, x, y)
        there = dr.gather(mi.UInt32, pieces, lane, inside)
        differs |= inside & (there != NONE) & ((there != sees) | (dr.gather(mi.Float, hits.t, lane, inside) < JUMP * t))
    return pixels, hits, pieces, differs


def _ray(pixels: Pixels, lane: mi.UInt32, active: mi.Bool) -> Ray:
    """The ray of a pixel."""
    p, d = (dr.gather(mi.Vector4f, buffer, lane, active) for buffer in (pixels.p, pixels.d))
    return Ray(mi.Point3f(p.x, p.y, p.z), mi.Vector3f(d.x, d.y, d.z), mi.UInt32(p.w))


@frozen
def _asked_around(asked: Asked, pixels: Pixels, hits: Hit, lanes: mi.UInt32) -> Hit:
    """Hits, for which the pixels `lanes` have asked what the eight around them name: other pieces than they see, or what is
    much nearer."""
    ray = _ray(pixels, lanes, mi.Bool(True))
    best = Hit(dr.gather(mi.UInt32, hits.triangle, lanes), dr.gather(mi.Float, hits.t, lanes))

    def named(k: mi.UInt32) -> tuple[mi.UInt32, mi.Float]:
        lane, inside = pixels.beside(lanes, *_around(k))
        there = dr.select(inside, dr.gather(mi.UInt32, pixels.named, lane, inside), NONE)
        return there, dr.select(inside, dr.gather(mi.Float, hits.t, lane, inside), dr.inf)

    best = meshwalk.asks(asked, ray, best, named, len(AROUND))
    found = Hit(mi.UInt32(hits.triangle), mi.Float(hits.t))
    dr.scatter(found.triangle, best.triangle, lanes)
    dr.scatter(found.t, best.t, lanes)
    return found


def _around(k: mi.UInt32) -> tuple[mi.Int32, mi.Int32]:
    """Number k of AROUND."""
    place = dr.select(k < len(AROUND) // 2, k, k + 1)
    return mi.Int32(place % 3) - 1, mi.Int32(place // 3) - 1


@frozen
def _is_wrong(asked: Asked, pixels: Pixels, hits: Hit, pieces: mi.UInt32) -> mi.Bool:
    """Per mirror's pixel, whether it sees another piece than it names."""
    sees = meshwalk.piece(asked, dr.gather(mi.UInt32, hits.triangle, pixels.lanes))
    return sees != dr.gather(mi.UInt32, pieces, pixels.lanes)


@frozen
def _asked_for(asked: Asked, pixels: Pixels, hits: Hit, lanes: mi.UInt32, number: mi.UInt32) -> mi.UInt32:
    """What rays meet, after those around the pixels `lanes` have asked for what these name and see; `number` counts PLACES for
    each."""
    centre = dr.gather(mi.UInt32, lanes, number // PLACES)
    place = number % PLACES
    x, y = _around(place % len(AROUND))
    reach = mi.Int32(REACH[0])
    for k in range(1, len(REACH)):
        reach = dr.select(place // len(AROUND) == k, REACH[k], reach)
    lane, inside = pixels.beside(centre, reach * x, reach * y)
    inside &= dr.gather(mi.Bool, pixels.active, lane, inside)
    ray = _ray(pixels, lane, inside)
    t = dr.gather(mi.Float, hits.t, lane, inside)
    best = Hit(dr.gather(mi.UInt32, hits.triangle, lane, inside), mi.Float(t))
    about = [dr.select(inside, dr.gather(mi.UInt32, names, centre, inside), NONE) for names in (pixels.named, hits.triangle)]
    near = dr.gather(mi.Float, hits.t, centre, inside)
    best = meshwalk.asks(asked, ray, best, lambda k: (dr.select(k == 0, *about), near), len(about))
    keys = dr.empty(mi.UInt64, pixels.width * pixels.height)
    here = Hit(dr.gather(mi.UInt32, hits.triangle, pixels.lanes), dr.gather(mi.Float, hits.t, pixels.lanes))
    dr.scatter(keys, _key(here), pixels.lanes)
    dr.eval(keys)
    nearer = inside & (best.t < t)
    dr.scatter_reduce(dr.ReduceOp.Min, keys, _key(best), lane, nearer)
    triangles = dr.full(mi.UInt32, NONE, pixels.width * pixels.height)
    dr.scatter(triangles, mi.UInt32(dr.gather(mi.UInt64, keys, pixels.lanes) & NONE), pixels.lanes)
    return triangles


@frozen
def _is_lost(pixels: Pixels, triangles: mi.UInt32, walled: mi.Bool) -> mi.Bool:
    """Per mirror's pixel, whether its ray meets nothing although it should, or a triangle is named."""
    should = dr.gather(mi.Bool, walled, pixels.lanes) | (dr.gather(mi.UInt32, pixels.named, pixels.lanes) != NONE)
    return should & (dr.gather(mi.UInt32, triangles, pixels.lanes) == NONE)


@frozen
@dr.syntax
def _asked_afar(asked: Asked, pixels: Pixels, triangles: mi.UInt32, lanes: mi.UInt32) -> mi.UInt32:
    """What rays meet, after the pixels `lanes` have asked what the nearest see that see anything, in eight directions."""
    ray = _ray(pixels, lanes, mi.Bool(True))
    best, k, last = Hit(mi.UInt32(NONE), mi.Float(dr.inf)), mi.UInt32(0), mi.UInt32(NONE)
    while dr.hint(k < len(AROUND), label="look in eight directions"):
        x, y = _around(k)
        far, candidate = mi.Int32(1), mi.UInt32(NONE)
        while dr.hint((candidate == NONE) & (far <= FARTHEST), label="look for a pixel that sees anything"):
            lane, inside = pixels.beside(lanes, far * x, far * y)
            inside &= dr.gather(mi.Bool, pixels.active, lane, inside)
            candidate = dr.select(inside, dr.gather(mi.UInt32, triangles, lane, inside), NONE)
            far += 1 + far // 4
        if (candidate != NONE) & (candidate != last):
            best = meshwalk.walked(asked, ray, candidate, best, mi.Bool(True), FAR_STEPS)
            last = mi.UInt32(candidate)
        k += 1
    found = mi.UInt32(triangles)
    dr.scatter(found, best.triangle, lanes)
    return found


def _key(hit: Hit) -> mi.UInt64:
    """A number that is smaller for what is nearer, and for the lower number of what is as near."""
    return (mi.UInt64(dr.reinterpret_array(mi.UInt32, hit.t)) << 32) | mi.UInt64(hit.triangle)


@frozen
@dr.syntax
def _shown(asked: Asked, pixels: Pixels, triangles: mi.UInt32, walled: mi.Bool, view: View) -> Shown:
    """What the triangles that rays meet show, spread over the frame."""
    lanes = pixels.lanes
    triangle, named = dr.gather(mi.UInt32, triangles, lanes), dr.gather(mi.UInt32, pixels.named, lanes)
    met, within = triangle != NONE, dr.gather(mi.Bool, walled, lanes)
    found = met | (within & (named != NONE))
    L, t, mirror = mi.Color3f(0), mi.Float(0), mi.Bool(False)
    if found:
        ray = _ray(pixels, lanes, found)
        passed = meshwalk.passed_by(asked.world, ray, dr.select(met, triangle, named))
        L, t = geometry.radiance(asked.world, passed.face, passed.weights, ray.p, found), dr.maximum(passed.t, 0)
        found &= met | (passed.t > 0)
        mirror = found & (geometry.part_of(passed.face) >= asked.objects)
    unmet = ~met & (within | (named != NONE))
    astray = meshwalk.piece(asked, triangle) != meshwalk.piece(asked, named)
    x, y, z, *others = spreading.spread([L.x, L.y, L.z, t, found, unmet, mirror, astray], lanes, view)
    return Shown(mi.Color3f(x, y, z), *others)


@frozen
def doubted(shows: Shown, active: mi.Bool, view: View) -> mi.Bool:
    """Where rays may have missed something: where they met nothing, or a mirror, whose light is not known, and where images are
    off, at that pixel or at one that touches it. `active`: the mirrors' pixels."""
    lane = dr.arange(mi.UInt32, view.width * view.height)
    doubt = shows.unmet | shows.mirror | shows.astray
    for x, y in AROUND:
        there, inside = _beside(lane, x, y, view.width, view.height)
        doubt |= dr.gather(mi.Bool, shows.astray, there, inside & dr.gather(mi.Bool, active, there, inside))
    return active & doubt
