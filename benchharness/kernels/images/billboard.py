"""Pictures with mip levels, and rays that meet billboards: quads that show a picture where it is not transparent.

Popescu, Mei, Dauble and Sacks 2006, 3. A ray looks for the nearest of a mirror's billboards whose picture covers at least
half of the point that it meets; what lies behind a transparent point is seen through it.

Every picture has a number, its slot. `Billboards.quads` holds 16 floats per slot:

    middle of the quad, number of the mirror that it shows (-1 for an object)
    its axis along columns divided by half its width, how far the part stands out before the quad
    its axis along rows divided by half its height, how far it does behind it
    its unit normal, radius of the sphere around the middle that holds the part

The last three numbers, metres, tell what to doubt; they are 0 for what is flat.

Doubt. A ray may meet the part anywhere within these bounds, from t = lo to hi, but the picture is read only where it crosses
the quad. What lies z before the quad is shown |z| sin(angle between the ray and the camera's) from the ray; in pixels, by
how far the ray moves from one pixel to the next (`Spread.pixels`). With z the largest that the ray reaches within the bounds:
* A hit is doubted where that is more than two pixels, and where the ray comes from behind: the picture is of the front.
* Beside a hit, something is missed where that is more than two pixels and the picture is not empty where the ray passes by
  within the bounds: as wide a texel as that way is long, around its middle, is covered to a twentieth.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels.frozen import frozen
from benchharness.kernels.images.impostor import FIELD
from benchharness.kernels.pixels import WRONG_PX

NONE = 0xFFFF_FFFF  # no billboard
PARALLEL = 1e-6  # a ray whose direction has less than this along a quad's normal misses it
OPAQUE = 0.5  # coverage from which a texel stops a ray
COVERED = 0.05  # coverage from which a texel as wide as a ray's way through the bounds is not empty
SINE = float(np.sin(0.5 * FIELD))  # a camera stands 1 / SINE radii away
COARSEST = 4  # texels across the last mip level


@dataclass
class Pictures:
    """Premultiplied packets (see `kernels.impostor`), mip levels of a slot one after the other, finest first, then the next
    slot. `size`: texels across the finest level, a power of two; `mip`: whether there are others; `first`: its first slot."""

    texels: mi.Float
    size: int
    mip: bool
    first: int = 0

    @property
    def levels(self) -> int:
        return (self.size // COARSEST).bit_length() if self.mip else 1

    @property
    def texels_per_slot(self) -> int:
        return sum((self.size >> level) ** 2 for level in range(self.levels))


@frozen
def with_levels(texels: mi.Float, size: int) -> mi.Float:
    """A picture with all its mip levels: each texel of a level is the mean of four of the one before."""
    levels = [texels]
    while size > COARSEST:
        size //= 2
        lane = dr.arange(mi.UInt32, size * size)
        first = 4 * size * (lane // size) + 2 * (lane % size)
        total = sum(dr.gather(mi.Vector4f, levels[-1], first + k) for k in (0, 1, 2 * size, 2 * size + 1))
        coarser = dr.empty(mi.Float, 4 * size * size)
        dr.scatter(coarser, 0.25 * total, lane)
        levels.append(coarser)
    return dr.concat(levels)


def sample(pictures: Pictures, slot: mi.UInt32, x: mi.Float, y: mi.Float, level: mi.Float, active) -> mi.Vector4f:
    """The packet at (x, y) of a picture, [-1, 1] across: bilinear in the nearest mip level; border repeated.

    level  0 is the finest; ignored for pictures without mip levels

    Between two levels would cost twice the reads, a third of a frame's reflections, for the same error.
    """
    first = (slot - pictures.first) * pictures.texels_per_slot
    if not pictures.mip:
        return _bilinear(pictures, first, mi.UInt32(pictures.size), x, y, active)
    nearest = mi.UInt32(dr.clip(level + 0.5, 0, pictures.levels - 1))
    return _bilinear(pictures, first + _before(pictures.size, nearest), mi.UInt32(pictures.size) >> nearest, x, y, active)


def _before(size: int, level: mi.UInt32) -> mi.UInt32:
    """How many texels the levels before `level` have: size² (1 + 1/4 + ...), exact for a power of two."""
    return (4 * size * size - (4 * size * size >> (2 * level))) // 3


def _bilinear(pictures: Pictures, first: mi.UInt32, size: mi.UInt32, x, y, active) -> mi.Vector4f:
    width = mi.Float(size)
    column = dr.clip((x + 1) * (0.5 * width) - 0.5, 0, width - 1)
    row = dr.clip((y + 1) * (0.5 * width) - 0.5, 0, width - 1)
    left, top = mi.UInt32(column), mi.UInt32(row)
    right, below = dr.select(left + 1 < size, 1, mi.UInt32(0)), dr.select(top + 1 < size, size, 0)
    base = first + top * size + left
    corners = (base, base + right, base + below, base + below + right)
    a, b, c, d = (dr.gather(mi.Vector4f, pictures.texels, i, active) for i in corners)
    fx, fy = column - mi.Float(left), row - mi.Float(top)
    return dr.lerp(dr.lerp(a, b, fx), dr.lerp(c, d, fx), fy)


@dataclass
class Billboards:
    """All quads of a scene, and which of them each mirror shows.

    lists    [mirrors, columns]: slots, NONE where a mirror has fewer; the first `objects` columns show objects
    columns  the rest shows other mirrors
    """

    quads: mi.Float
    lists: mi.UInt32
    columns: int
    objects: int


@dataclass
class Spread:
    """How a pixel's ray moves from one pixel to the next, to the right and down: its start, and its unit direction."""

    start: list[mi.Vector3f]
    turn: list[mi.Vector3f]

    def at(self, t: mi.Float) -> mi.Float:
        """Metres between neighbouring rays after t metres, the smaller of the two: what is drawn out stays sharp."""
        return dr.minimum(*(dr.norm(start + t * turn) for start, turn in zip(self.start, self.turn, strict=True)))

    def pixels(self, t: mi.Float, e: mi.Vector3f) -> mi.Float:
        """How many pixels away the ray is that passes e, metres across, beside this one after t metres: least squares.

        Where only one neighbour is known, by that one alone; where none is, inf."""
        u, v = (start + t * turn for start, turn in zip(self.start, self.turn, strict=True))
        uu, uv, vv, ue, ve = dr.dot(u, u), dr.dot(u, v), dr.dot(v, v), dr.dot(u, e), dr.dot(v, e)
        determinant = uu * vv - uv * uv
        both = determinant > 1e-6 * uu * vv
        scale = dr.rcp(dr.select(both, determinant, 1))
        two = dr.sqrt(dr.square((vv * ue - uv * ve) * scale) + dr.square((uu * ve - uv * ue) * scale))
        return dr.select(both, two, dr.norm(e) / dr.sqrt(dr.maximum(uu, vv)))


@dataclass
class Hit:
    """The nearest hit, t = inf for none: slot, and the packet there, divided by its coverage. `tests`: rays against quads.

    doubt   it may be the wrong thing
    missed  from this t on something may be that was missed; inf where that is not known
    """

    t: mi.Float
    slot: mi.UInt32
    value: mi.Vector4f
    tests: mi.UInt32
    doubt: mi.Bool = field(default_factory=lambda: mi.Bool(False))
    missed: mi.Float = field(default_factory=lambda: mi.Float(dr.inf))


def none() -> Hit:
    """Nothing was met, and nothing tested."""
    return Hit(mi.Float(dr.inf), mi.UInt32(NONE), mi.Vector4f(0), mi.UInt32(0))


def level_of(pictures: Pictures, a: mi.Vector4f, b: mi.Vector4f, apart: mi.Float) -> mi.Float:
    """The mip level at which texels are as long as `apart`, metres; `a`, `b`: the second and third packet of the quad.

    Along its longer side: what is drawn out stays sharp, and which side is the first must not matter.
    """
    per_metre = 0.5 * pictures.size * dr.minimum(dr.norm(a.xyz), dr.norm(b.xyz))
    return dr.log2(dr.maximum(apart * per_metre, 1e-9))


@dataclass
class Way:
    """A ray's way through a part's bounds, from t = `lo` to `hi`; whether there is one; whether the picture is too far off."""

    within: mi.Bool
    lo: mi.Float
    hi: mi.Float
    off: mi.Bool


@dataclass
class Quad:
    """Packets of `Billboards.quads`; the ray o + t d, t > `least`; t where it crosses the plane, and d across it."""

    middle: mi.Vector4f
    a: mi.Vector4f
    b: mi.Vector4f
    k: mi.Vector4f
    o: mi.Point3f
    d: mi.Vector3f
    least: mi.Float
    crossing: mi.Float
    along: mi.Float

    def chord(self) -> tuple[mi.Float, mi.Float]:
        """Of the sphere around the part: t amid the ray's way through it, and the square of half its length."""
        to_middle = mi.Vector3f(self.middle.xyz) - mi.Vector3f(self.o)
        closest = dr.dot(to_middle, self.d)
        return closest, dr.square(self.k.w) - dr.squared_norm(to_middle) + dr.square(closest)

    def way(self, spread: Spread) -> Way:
        """See the module's account of doubt."""
        closest, chord2 = self.chord()
        chord = dr.sqrt(dr.maximum(chord2, 0))
        per = dr.rcp(dr.select(dr.abs(self.along) < PARALLEL, PARALLEL, self.along))
        one, other = self.crossing + self.a.w * per, self.crossing - self.b.w * per
        lo = dr.maximum(dr.maximum(closest - chord, dr.minimum(one, other)), self.least)
        hi = dr.minimum(closest + chord, dr.maximum(one, other))
        height = self.along * dr.maximum(dr.abs(lo - self.crossing), dr.abs(hi - self.crossing))

        # Towards the camera, from where the ray passes by.
        t = 0.5 * (lo + hi)
        q = mi.Vector3f(self.o) + t * self.d - mi.Vector3f(self.middle.xyz)
        w = dr.normalize((self.k.w / SINE + dr.dot(q, self.k.xyz)) * self.k.xyz - q)
        off = spread.pixels(t, height * (w - dr.dot(w, self.d) * self.d)) > WRONG_PX
        return Way((chord2 > 0) & (lo < hi), lo, hi, off)


@dr.syntax
def _missed(pictures: Pictures, slot: mi.UInt32, quad: Quad, spread: Spread, nearer: mi.Float, active) -> mi.Float:
    """From which t < `nearer` on a ray that met nothing opaque may meet what its slot shows; inf for nowhere."""
    t = mi.Float(dr.inf)
    if active & (quad.chord()[1] > 0):  # most rays miss most spheres
        way = quad.way(spread)
        near = way.within & way.off & (way.lo < nearer)
        q = mi.Vector3f(quad.o) + 0.5 * (way.lo + way.hi) * quad.d - mi.Vector3f(quad.middle.xyz)
        across = (way.hi - way.lo) * dr.sqrt(dr.maximum(1 - dr.square(quad.along), 0))
        level = level_of(pictures, quad.a, quad.b, across)
        there = sample(pictures, slot, dr.dot(q, quad.a.xyz), dr.dot(q, quad.b.xyz), level, near)
        t = dr.select(near & (there.w > COVERED), way.lo, t)
    return t


@dr.syntax
def nearest(
    boards: Billboards, pictures: Pictures, columns: int, mirror: mi.UInt32, o, d, least, spread: Spread, active, met=None,
    deep: bool = False,
) -> Hit:  # fmt: skip
    """Tests the ray o + t d, t > least, against the billboards in the first `columns` columns of a mirror's list.

    met   what the ray has met already: returned with its tests where nothing is nearer
    deep  they stand for parts that are not flat: doubt
    """
    start = none() if met is None else met
    t, slot, value, tests = mi.Float(start.t), mi.UInt32(start.slot), mi.Vector4f(start.value), mi.UInt32(start.tests)
    doubt, missed = mi.Bool(start.doubt), mi.Float(start.missed)
    column = mi.UInt32(0)
    while dr.hint(active & (column < columns), label="billboards of a mirror"):
        candidate = dr.gather(mi.UInt32, boards.lists, mirror * boards.columns + column)
        listed = candidate != NONE
        candidate = dr.select(listed, candidate, pictures.first)
        middle, a, b, k = (dr.gather(mi.Vector4f, boards.quads, candidate * 4 + i) for i in range(4))
        along = dr.dot(d, k.xyz)
        distance = dr.dot(mi.Vector3f(middle.xyz) - mi.Vector3f(o), k.xyz) / dr.select(dr.abs(along) < PARALLEL, dr.nan, along)
        offset = mi.Vector3f(o) + distance * d - mi.Vector3f(middle.xyz)
        x, y = dr.dot(offset, a.xyz), dr.dot(offset, b.xyz)
        inside = listed & (distance > least) & (distance < t) & (dr.abs(x) <= 1) & (dr.abs(y) <= 1)
        quad, passes = Quad(middle, a, b, k, o, d, least, distance, along), mi.Bool(listed)
        if inside:  # most rays miss most quads
            found = sample(pictures, candidate, x, y, level_of(pictures, a, b, spread.at(distance)), mi.Bool(True))
            opaque = found.w > OPAQUE
            t, slot = dr.select(opaque, distance, t), dr.select(opaque, candidate, slot)
            value = dr.select(opaque, found * dr.rcp(dr.maximum(found.w, OPAQUE)), value)
            doubt = dr.select(opaque, (along > 0) | quad.way(spread).off if deep else mi.Bool(False), doubt)
            passes &= ~opaque
        missed = dr.minimum(missed, _missed(pictures, candidate, quad, spread, t, passes)) if deep else missed
        tests += dr.select(listed, mi.UInt32(1), 0)
        column += 1
    return Hit(t, slot, value, tests, doubt, missed)


@dr.syntax
def passed(boards: Billboards, slots, mirror: mi.UInt32, o, d, active) -> mi.Float:
    """From which t on the ray o + t d, t > 0, may meet one of the mirrors in the mirror's list, by their spheres; inf: none.

    slots  of what the list holds, or None where it holds slots
    """
    t, column = mi.Float(dr.inf), mi.UInt32(boards.objects)
    while dr.hint(active & (column < boards.columns), label="mirrors that a ray passes"):
        candidate = dr.gather(mi.UInt32, boards.lists, mirror * boards.columns + column)
        listed = candidate != NONE
        if dr.hint(slots is not None, mode="scalar"):
            candidate = dr.gather(mi.UInt32, slots, candidate, listed)
        middle, k = (dr.gather(mi.Vector4f, boards.quads, candidate * 4 + i, listed) for i in (0, 3))
        to_middle = mi.Vector3f(middle.xyz) - mi.Vector3f(o)
        closest = dr.dot(to_middle, d)
        chord2 = dr.square(k.w) - dr.squared_norm(to_middle) + dr.square(closest)
        start = closest - dr.sqrt(dr.maximum(chord2, 0))
        t = dr.select(listed & (chord2 > 0) & (start > 0), dr.minimum(t, start), t)
        column += 1
    return t
