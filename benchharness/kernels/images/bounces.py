"""The light that reflected rays bring from pictures of the scene, at every pixel of a mirror.

Popescu et al. 2006, 3.1: the nearest impostor that the reflected ray meets, else the environment map. Where that impostor
shows a mirror, the ray is reflected once more about the normal of its texel, and meets the impostors of objects as that
mirror sees them: reflections of second order. Nothing of higher order.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels import optics, selfmet
from benchharness.kernels.frozen import frozen
from benchharness.kernels.images import backdrop, billboard, relief
from benchharness.kernels.pixels import WRONG_PX

LEAST_COVERAGE = 0.05  # a texel at an object's border is brightened by no more than its inverse
FARTHEST = 1e6  # metres: no further is it told how far rays are apart
RAY_EPSILON = 1e-4  # start of a ray above the surface, relative to the size of its coordinates


@dataclass
class Cast:
    """All that rays can meet.

    planes    billboards of flat parts, and their pictures
    boards    billboards of other parts, which share the table of quads; pictures of those, and of the depth maps
    metals    as `optics.metals_of` has them
    mirrors   12 floats per mirror: rows that take a point of the world to [-1, 1] across its box; None where mirrors are among
              what their own rays meet
    enclosed  per mirror, whether `benchharness.scene.Scene.enclosed` holds it: what ends at infinity was lost; None if none is
    """

    planes: billboard.Billboards
    plane_pictures: billboard.Pictures
    boards: billboard.Billboards
    pictures: billboard.Pictures
    reliefs: relief.Reliefs | None
    backdrop: backdrop.Backdrop
    metals: mi.Float
    mirrors: mi.Float | None
    enclosed: mi.Bool | None


@dataclass
class Manner:
    """How rays look.

    second  mirrors reflect in mirrors; else they are black
    doubts  whether they say where what is shown may be wrong
    jump, anchor  see `relief.nearest`
    """

    second: bool
    doubts: bool = False
    jump: float = 0.0
    anchor: str = "mid"


@dataclass
class Answer:
    """
    L         radiance along the reflected ray
    distance  to what it shows
    second    the ray was reflected again
    tests     rays against quads
    work      segments of simplified rows, or texels of depth maps, looked at
    doubt     what is shown may be wrong; never, if `Manner.doubts` is False
    found     False where the ray, or the one that goes on from it, ends at infinity and cannot
    """

    L: mi.Color3f
    distance: mi.Float
    second: mi.Bool
    tests: mi.UInt32
    work: mi.UInt32
    doubt: mi.Bool
    found: mi.Bool


@frozen
def reflected(cast: Cast, view, frame: list, pixel: mi.UInt32, manner: Manner) -> Answer:
    """
    frame   p, n, reflector of all pixels of the picture
    pixel   where to look, per lane
    """
    p, n, mirror = (dr.gather(type(a), a, pixel) for a in frame)
    d = optics.reflect(dr.normalize(view.eye - p), n)
    o = _above(p, mi.Vector3f(n))
    number = mi.UInt32(dr.maximum(mirror, 0))
    apart, bends = _spread(frame, view, pixel, p, n, d, mirror)
    met, work = _nearest(cast, manner, False, number, o, d, apart, mi.Bool(True))
    if manner.doubts and cast.mirrors is not None:
        box = [dr.gather(mi.Vector4f, cast.mirrors, number * 3 + k) for k in range(3)]
        met.missed = dr.minimum(met.missed, selfmet.away(p, n, d, apart.start, bends, box))

    L, distance, far, off = _shown(cast, manner, number, o, d, met, apart, mi.Bool(True))
    lost = _lost(cast, number, distance, mi.Bool(True))

    other = dr.gather(mi.Float, cast.boards.quads, met.slot * 16 + 3, ~far)
    again = ~far & (other >= 0)
    tests, doubt = met.tests, _doubted(met, distance, far) | off
    if manner.second:
        L2, more, further, beyond, gone = _again(cast, manner, met, o, d, mi.UInt32(dr.maximum(other, 0)), apart, again)
        L, tests, work = dr.select(again, L2, L), tests + more, work + further
        doubt |= again & beyond
        lost |= again & gone
    else:
        L = dr.select(again, 0, L)
        doubt |= again
    return Answer(L, distance, again, tests, work, doubt if manner.doubts else mi.Bool(False), ~lost)


def _lost(cast: Cast, mirror: mi.UInt32, distance: mi.Float, active) -> mi.Bool:
    """Whether a ray from a mirror that ends after `distance` has slipped between pictures: infinity is behind walls."""
    if cast.enclosed is None:
        return mi.Bool(False)
    return (distance == dr.inf) & dr.gather(mi.Bool, cast.enclosed, mirror, active)


def _doubted(met: billboard.Hit, distance: mi.Float, far: mi.Bool) -> mi.Bool:
    """Whether what `met` says about a ray that ends after `distance`, behind all impostors where `far`, may be wrong."""
    return (met.doubt & ~far) | (met.missed < distance)


@dr.syntax
def _shown(cast: Cast, manner: Manner, mirror: mi.UInt32, o, d, met: billboard.Hit, apart: billboard.Spread, active):
    """What a ray shows that has met `met`; how far away that is; whether it is behind all impostors, and there too far off."""
    L, distance, off = mi.Color3f(met.value.xyz), mi.Float(met.t), mi.Bool(False)
    direction, ground = backdrop.behind(cast.backdrop, o, d)
    far = active & (~(met.t < ground) | (met.t == dr.inf))
    if far:
        L, away = backdrop.look_up(cast.backdrop, mirror, direction, mi.Bool(True))
        distance = dr.select(ground < dr.inf, ground, away)
        if dr.hint(manner.doubts, mode="scalar"):
            beside = backdrop.beside(cast.backdrop, mirror, o, d, mi.Bool(True))
            off = (distance < dr.inf) & (apart.pixels(dr.minimum(distance, FARTHEST), beside) > WRONG_PX)
    return L, distance, far, off


def _nearest(cast: Cast, manner: Manner, objects: bool, mirror, o, d, apart, active) -> tuple[billboard.Hit, mi.UInt32]:
    """The nearest impostor along a ray from a mirror, of objects only or of all; and the work of looking in depth maps."""
    met = billboard.none()
    for boards, pictures in ((cast.planes, cast.plane_pictures), (cast.boards, cast.pictures)):
        columns = boards.objects if objects else boards.columns
        if columns > 0:
            deep = manner.doubts and boards is cast.boards
            met = billboard.nearest(boards, pictures, columns, mirror, o, d, mi.Float(0), apart, active, met, deep)
    reliefs = cast.reliefs
    if reliefs is None:
        return met, mi.UInt32(0)
    columns = reliefs.objects if objects else reliefs.columns
    deep = relief.nearest(reliefs, columns, mirror, o, d, met.t, manner.jump, manner.anchor, active)
    closer = active & (deep.t < dr.inf)
    a, b = (dr.gather(mi.Vector4f, cast.boards.quads, deep.slot * 4 + i, closer) for i in (1, 2))
    level = billboard.level_of(cast.pictures, a, b, apart.at(dr.select(closer, deep.t, 0)))
    value = billboard.sample(cast.pictures, deep.slot, deep.x, deep.y, level, closer)
    value *= dr.rcp(dr.maximum(value.w, LEAST_COVERAGE))
    t, slot = dr.select(closer, deep.t, met.t), dr.select(closer, deep.slot, met.slot)
    doubt, missed = dr.select(closer, deep.doubt, met.doubt), dr.minimum(met.missed, deep.missed)
    hit = billboard.Hit(t, slot, dr.select(closer, value, met.value), met.tests, doubt, missed)
    return hit, deep.work


@dr.syntax
def _again(cast: Cast, manner: Manner, met: billboard.Hit, o, d, mirror: mi.UInt32, apart, active):
    """What a mirror in a picture sends back along a ray that met it; quads tested, work in depth maps, doubt, and whether the
    ray was lost."""
    L, tests, work, doubt, lost = mi.Color3f(0), mi.UInt32(0), mi.UInt32(0), mi.Bool(False), mi.Bool(False)
    if active:  # few rays
        a, b, k = (dr.normalize(dr.gather(mi.Vector4f, cast.boards.quads, met.slot * 4 + i).xyz) for i in (1, 2, 3))
        n = met.value.x * a + met.value.y * b + met.value.z * k
        n = dr.normalize(dr.select(dr.squared_norm(n) > 1e-12, n, k))
        n = dr.select(dr.dot(n, d) > 0, -n, n)
        out = optics.reflect(-d, mi.Normal3f(n))
        start = _above(o + met.t * d, n)
        found, work = _nearest(cast, manner, True, mirror, start, out, apart, mi.Bool(True))
        L, distance, far, off = _shown(cast, manner, mirror, start, out, found, apart, mi.Bool(True))
        if dr.hint(manner.doubts, mode="scalar"):
            doubt = off | _doubted(found, distance, far) | (_third(cast, mirror, start, out) < distance)
        lost = _lost(cast, mirror, distance, mi.Bool(True))
        L *= optics.reflectance(cast.metals, mirror, dr.clip(-dr.dot(n, d), 0, 1), mi.Bool(True))
        tests = found.tests
    return L, tests, work, doubt, lost


def _third(cast: Cast, mirror: mi.UInt32, o, d) -> mi.Float:
    """From where on a ray from a mirror may meet another one; inf for nowhere."""
    t = mi.Float(dr.inf)
    for boards in (cast.planes, cast.boards):
        if boards.columns > boards.objects:
            t = dr.minimum(t, billboard.passed(boards, None, mirror, o, d, mi.Bool(True)))
    reliefs = cast.reliefs
    if reliefs is not None and reliefs.columns > reliefs.objects:
        boards = billboard.Billboards(cast.boards.quads, reliefs.lists, reliefs.columns, reliefs.objects)
        t = dr.minimum(t, billboard.passed(boards, reliefs.slots, mirror, o, d, mi.Bool(True)))
    return t


def _above(p: mi.Point3f, n: mi.Vector3f) -> mi.Point3f:
    return p + n * (RAY_EPSILON * (1 + dr.max(dr.abs(p))))


def _spread(frame: list, view, pixel: mi.UInt32, p, n, d, mirror) -> tuple[billboard.Spread, list]:
    """From the rays of the pixels to the right and below (to the left and above at the picture's end); 0 across borders.
    And how the normal turns to those."""
    width, height = view.width, view.height
    row = pixel // width
    column = pixel - row * width
    eye, starts, turns, bends = view.eye, [], [], []
    for there in (
        dr.select(column == width - 1, pixel - 1, pixel + 1),
        dr.select(row == height - 1, pixel - width, pixel + width),
    ):
        q, m, other = (dr.gather(type(a), a, dr.minimum(there, width * height - 1)) for a in frame)
        same = other == mirror
        turned = optics.reflect(dr.normalize(eye - q), m) - d
        starts.append(dr.select(same, mi.Vector3f(q - p), 0))
        turns.append(dr.select(same, turned, 0))
        bends.append(dr.select(same, mi.Vector3f(m - n), 0))
    return billboard.Spread(starts, turns), bends
