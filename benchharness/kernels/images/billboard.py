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
how far the ray moves from one pixel to the next (`RayDifferential.pixels`). With z the largest that the ray reaches within
the bounds:
* A hit is doubted where that is more than two pixels, and where the ray comes from behind: the picture is of the front.
* Beside a hit, something is missed where that is more than two pixels and the picture is not empty where the ray passes by
  within the bounds: as wide a texel as that way is long, around its middle, is covered to a twentieth.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels import packets
from benchharness.kernels.images import atlas
from benchharness.kernels.images.candidates import NONE, Candidates, Ray
from benchharness.kernels.images.impostor import FIELD
from benchharness.kernels.pixels import WRONG_PX

PARALLEL = 1e-6  # a ray whose direction has less than this along a quad's normal misses it
OPAQUE = 0.5  # coverage from which a texel stops a ray
COVERED = 0.05  # coverage from which a texel as wide as a ray's way through the bounds is not empty
SINE = float(np.sin(0.5 * FIELD))  # a camera stands 1 / SINE radii away


@dataclass
class Pictures:
    """Pictures of slots, one after the other.

    texels  premultiplied packets (see `kernels.images.atlas`), mip levels of a slot one after the other, the finest first
    size    texels across the finest level, a power of two
    mip     whether there are others
    first   number of the first slot
    places  for pictures of sizes of their own, packets of each: first texel, texels across, and two that are ignored; `size`
            is then the largest. None where all have `size`
    """

    texels: mi.Float
    size: int
    mip: bool
    first: int = 0
    places: mi.UInt32 | None = None

    @property
    def levels(self) -> int:
        """How many mip levels a slot has, the largest one's."""
        return atlas.levels_of(self.size, self.mip)

    @property
    def texels_per_slot(self) -> int:
        """How many texels all levels of a slot have, all being of one size."""
        return sum((self.size >> level) ** 2 for level in range(self.levels))

    def place(self, slot: mi.UInt32, active: mi.Bool) -> tuple[mi.UInt32, mi.UInt32]:
        """A slot's first texel, and its texels across."""
        if self.places is None:
            return (slot - self.first) * self.texels_per_slot, mi.UInt32(self.size)
        packet = dr.gather(mi.Vector4u, self.places, slot - self.first, active)
        return packet.x, packet.y


def sample(pictures: Pictures, slot: mi.UInt32, x: mi.Float, y: mi.Float, level: mi.Float, active: mi.Bool) -> mi.Vector4f:
    """The packet at (x, y) of a picture, [-1, 1] across: bilinear in the nearest mip level; border repeated.

    level  0 is the finest; ignored for pictures without mip levels

    Between two levels would cost twice the reads, a third of a frame's reflections, for the same error.
    """
    first, size = pictures.place(slot, active)
    if not pictures.mip:
        return _bilinear(pictures, first, size, x, y, active)
    coarsest = dr.log2i(dr.maximum(size // atlas.COARSEST, 1))
    nearest = dr.minimum(mi.UInt32(dr.clip(level + 0.5, 0, pictures.levels - 1)), coarsest)
    return _bilinear(pictures, first + _before(size, nearest), size >> nearest, x, y, active)


def _before(size: mi.UInt32, level: mi.UInt32) -> mi.UInt32:
    """How many texels the levels before `level` have: size² (1 + 1/4 + ...), exact for a power of two."""
    return (4 * size * size - (4 * size * size >> (2 * level))) // 3


def _bilinear(pictures: Pictures, first: mi.UInt32, size: mi.UInt32, x: mi.Float, y: mi.Float, active: mi.Bool) -> mi.Vector4f:
    """The packet at (x, y) of the level that begins at texel `first` and is `size` texels across."""
    width = mi.Float(size)
    column = dr.clip((x + 1) * (0.5 * width) - 0.5, 0, width - 1)
    row = dr.clip((y + 1) * (0.5 * width) - 0.5, 0, width - 1)
    left, top = mi.UInt32(column), mi.UInt32(row)
    right, below = dr.select(left + 1 < size, 1, mi.UInt32(0)), dr.select(top + 1 < size, size, 0)
    base = first + top * size + left
    corners = (base, base + right, base + below, base + below + right)
    return packets.bilinear(pictures.texels, corners, column - mi.Float(left), row - mi.Float(top), active)


@dataclass
class Billboards:
    """All quads of a scene, 16 floats per slot as above, and the slots whose quads each mirror shows."""

    quads: mi.Float
    candidates: Candidates


@dataclass
class Hit:
    """The nearest hit of a ray, and what the search for it says besides.

    t       of the hit; inf for none
    slot    whose picture shows it
    value   the packet there, divided by its coverage
    tests   quads that the ray was tested against
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


def level_of(pictures: Pictures, slot: mi.UInt32, a: mi.Vector4f, b: mi.Vector4f, apart: mi.Float) -> mi.Float:
    """The mip level of a slot at which texels are as long as `apart`, metres; `a`, `b`: second and third packet of its quad.

    Along its longer side: what is drawn out stays sharp, and which side is the first must not matter.
    """
    size = mi.Float(pictures.place(slot, mi.Bool(True))[1])
    per_metre = 0.5 * size * dr.minimum(dr.norm(a.xyz), dr.norm(b.xyz))
    return dr.log2(dr.maximum(apart * per_metre, 1e-9))


@dataclass
class Passage:
    """A ray's way through a part's bounds, from t = `lo` to `hi`; whether there is one; whether the picture is too far off."""

    within: mi.Bool
    lo: mi.Float
    hi: mi.Float
    off: mi.Bool


@dataclass
class Crossing:
    """A ray that crosses the plane of a quad.

    middle, a, b, k  packets of `Billboards.quads`
    t                where it does
    cosine           the ray's direction along the normal
    """

    middle: mi.Vector4f
    a: mi.Vector4f
    b: mi.Vector4f
    k: mi.Vector4f
    ray: Ray
    t: mi.Float
    cosine: mi.Float

    def passage(self) -> Passage:
        """See the module's account of doubt."""
        ray = self.ray
        closest, chord2 = chord(self.middle, self.k, ray)
        half_chord = dr.sqrt(dr.maximum(chord2, 0))
        per = dr.rcp(dr.select(dr.abs(self.cosine) < PARALLEL, PARALLEL, self.cosine))
        one, other = self.t + self.a.w * per, self.t - self.b.w * per
        lo = dr.maximum(dr.maximum(closest - half_chord, dr.minimum(one, other)), 0)
        hi = dr.minimum(closest + half_chord, dr.maximum(one, other))
        height = self.cosine * dr.maximum(dr.abs(lo - self.t), dr.abs(hi - self.t))

        # Towards the camera, from where the ray passes by.
        t = 0.5 * (lo + hi)
        q = mi.Vector3f(ray.o) + t * ray.d - mi.Vector3f(self.middle.xyz)
        w = dr.normalize((self.k.w / SINE + dr.dot(q, self.k.xyz)) * self.k.xyz - q)
        off = ray.differential.pixels(t, height * (w - dr.dot(w, ray.d) * ray.d)) > WRONG_PX
        return Passage((chord2 > 0) & (lo < hi), lo, hi, off)


def chord(middle: mi.Vector4f, k: mi.Vector4f, ray: Ray) -> tuple[mi.Float, mi.Float]:
    """A ray's way through the sphere around a part: t in the middle of it, and the square of half its length.

    middle, k  packets of `Billboards.quads`
    """
    to_middle = mi.Vector3f(middle.xyz) - mi.Vector3f(ray.o)
    closest = dr.dot(to_middle, ray.d)
    return closest, dr.square(k.w) - dr.squared_norm(to_middle) + dr.square(closest)


@dr.syntax
def _missed(pictures: Pictures, slot: mi.UInt32, crossing: Crossing, nearer: mi.Float, active: mi.Bool) -> mi.Float:
    """From which t < `nearer` on a ray that met nothing opaque may meet what its slot shows; inf for nowhere."""
    t = mi.Float(dr.inf)
    if active & (chord(crossing.middle, crossing.k, crossing.ray)[1] > 0):  # most rays miss most spheres
        way, ray = crossing.passage(), crossing.ray
        near = way.within & way.off & (way.lo < nearer)
        q = mi.Vector3f(ray.o) + 0.5 * (way.lo + way.hi) * ray.d - mi.Vector3f(crossing.middle.xyz)
        across = (way.hi - way.lo) * dr.sqrt(dr.maximum(1 - dr.square(crossing.cosine), 0))
        level = level_of(pictures, slot, crossing.a, crossing.b, across)
        there = sample(pictures, slot, dr.dot(q, crossing.a.xyz), dr.dot(q, crossing.b.xyz), level, near)
        t = dr.select(near & (there.w > COVERED), way.lo, t)
    return t


@dr.syntax
def nearest(boards: Billboards, pictures: Pictures, columns: int, ray: Ray, met: Hit, bounded: bool = False) -> Hit:
    """Tests a ray against the billboards in the first `columns` columns of its mirror's candidates.

    met      what the ray has met already: returned with its tests where nothing is nearer
    bounded  the quads stand for parts that are not flat, whose bounds tell what to doubt
    """
    t = mi.Float(met.t)  # of the nearest hit so far
    slot = mi.UInt32(met.slot)  # which shows it
    value = mi.Vector4f(met.value)  # the packet there
    doubt = mi.Bool(met.doubt)  # whether it may be wrong
    missed = mi.Float(met.missed)  # from where on something may be missed
    tests = mi.UInt32(met.tests)  # quads tested
    column = mi.UInt32(0)
    while dr.hint(column < columns, label="billboards of a mirror"):
        candidate = boards.candidates.at(ray.mirror, column)
        listed = candidate != NONE
        candidate = dr.select(listed, candidate, pictures.first)
        middle, a, b, k = (dr.gather(mi.Vector4f, boards.quads, candidate * 4 + i) for i in range(4))
        cosine = dr.dot(ray.d, k.xyz)
        to_middle = mi.Vector3f(middle.xyz) - mi.Vector3f(ray.o)
        distance = dr.dot(to_middle, k.xyz) / dr.select(dr.abs(cosine) < PARALLEL, dr.nan, cosine)
        offset = mi.Vector3f(ray.o) + distance * ray.d - mi.Vector3f(middle.xyz)
        x, y = dr.dot(offset, a.xyz), dr.dot(offset, b.xyz)
        inside = listed & (distance > 0) & (distance < t) & (dr.abs(x) <= 1) & (dr.abs(y) <= 1)
        crossing, passes = Crossing(middle, a, b, k, ray, distance, cosine), mi.Bool(listed)
        if inside:  # most rays miss most quads
            level = level_of(pictures, candidate, a, b, ray.differential.footprint(distance))
            found = sample(pictures, candidate, x, y, level, mi.Bool(True))
            opaque = found.w > OPAQUE
            t, slot = dr.select(opaque, distance, t), dr.select(opaque, candidate, slot)
            value = dr.select(opaque, found * dr.rcp(dr.maximum(found.w, OPAQUE)), value)
            doubt = dr.select(opaque, (cosine > 0) | crossing.passage().off if bounded else mi.Bool(False), doubt)
            passes &= ~opaque
        missed = dr.minimum(missed, _missed(pictures, candidate, crossing, t, passes)) if bounded else missed
        tests += dr.select(listed, mi.UInt32(1), 0)
        column += 1
    return Hit(t, slot, value, tests, doubt, missed)


@dr.syntax
def passed(quads: mi.Float, candidates: Candidates, slots: mi.UInt32 | None, ray: Ray) -> mi.Float:
    """From which t > 0 on a ray may meet one of the mirrors among its mirror's candidates, by their spheres; inf: none.

    slots  of the impostors that are listed; None where slots are
    """
    t, column = mi.Float(dr.inf), mi.UInt32(candidates.objects)
    while dr.hint(column < candidates.columns, label="mirrors that a ray passes"):
        candidate = candidates.at(ray.mirror, column)
        listed = candidate != NONE
        if dr.hint(slots is not None, mode="scalar"):
            candidate = dr.gather(mi.UInt32, slots, candidate, listed)
        middle, k = (dr.gather(mi.Vector4f, quads, candidate * 4 + i, listed) for i in (0, 3))
        closest, chord2 = chord(middle, k, ray)
        start = closest - dr.sqrt(dr.maximum(chord2, 0))
        t = dr.select(listed & (chord2 > 0) & (start > 0), dr.minimum(t, start), t)
        column += 1
    return t
