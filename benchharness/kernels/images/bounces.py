"""The light that reflected rays bring from pictures of the scene, at every pixel of a mirror.

Popescu et al. 2006, 3.1: the nearest impostor that the reflected ray meets, else the environment map. Where that impostor
shows a mirror, the ray is reflected once more about the normal of its texel, and meets the impostors of objects as that
mirror sees them: reflections of second order. Nothing of higher order.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import drjit as dr
import mitsuba as mi

from benchharness.kernels import differentials, optics, selfmet
from benchharness.kernels.differentials import FirstHits
from benchharness.kernels.frozen import frozen
from benchharness.kernels.images import backdrop, billboard, relief
from benchharness.kernels.images.candidates import Ray
from benchharness.kernels.pixels import WRONG_PX
from benchharness.kernels.types import View

LEAST_COVERAGE = 0.05  # a texel at an object's border is brightened by no more than its inverse
FARTHEST = 1e6  # metres: no further is it told how far rays are apart
RAY_EPSILON = 1e-4  # start of a ray above the surface, relative to the size of its coordinates


@dataclass
class ImpostorScene:
    """All that rays can meet.

    planes    billboards of flat parts, and their pictures
    boards    billboards of other parts, which share the table of quads; pictures of those, and of the depth maps
    reliefs   depth maps; None where there are none
    backdrop  what is behind all of them
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
class TraceOptions:
    """How far rays go, and what they say.

    second_bounce  mirrors reflect in mirrors; else they are black
    doubts         whether they say where what is shown may be wrong
    walk           how they look into depth maps
    """

    second_bounce: bool
    doubts: bool = False
    walk: relief.Walk = field(default_factory=relief.Walk)


@dataclass
class Answer:
    """What reflected rays show.

    L         radiance along the reflected ray
    distance  to what it shows
    second    the ray was reflected again
    tests     rays against quads
    work      segments of simplified rows, or texels of depth maps, looked at
    doubt     what is shown may be wrong; never, if `TraceOptions.doubts` is False
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
def reflected(scene: ImpostorScene, view: View, hits: FirstHits, pixel: mi.UInt32, options: TraceOptions) -> Answer:
    """What the mirrors show at some pixels of a picture, one lane each.

    hits   of the whole picture
    pixel  where to look, per lane
    """
    here = hits.at(pixel)
    p, n = here.p, here.n
    d = optics.reflect(dr.normalize(view.eye - p), n)
    mirror = mi.UInt32(dr.maximum(here.reflector, 0))
    differential, bends = differentials.of_reflected(hits, view, pixel, here, d)
    ray = Ray(mirror, _above(p, mi.Vector3f(n)), d, differential)
    met, work = _nearest(scene, options, ray)
    if options.doubts and scene.mirrors is not None:
        box = [dr.gather(mi.Vector4f, scene.mirrors, mirror * 3 + k) for k in range(3)]
        met.missed = dr.minimum(met.missed, selfmet.away(p, n, d, differential.dp, bends, box))

    first = _shown(scene, options, ray, met)
    L, tests, doubt, lost = first.L, met.tests, _doubted(met, first) | first.off, _lost(scene, mirror, first.distance)

    other = dr.gather(mi.Float, scene.boards.quads, met.slot * 16 + 3, ~first.behind)
    again = ~first.behind & (other >= 0)
    if options.second_bounce:
        second = _second_bounce(scene, options, met, ray, mi.UInt32(dr.maximum(other, 0)), again)
        L, tests, work = dr.select(again, second.L, L), tests + second.tests, work + second.work
        doubt |= again & second.doubt
        lost |= again & second.lost
    else:
        L = dr.select(again, 0, L)
        doubt |= again
    return Answer(L, first.distance, again, tests, work, doubt if options.doubts else mi.Bool(False), ~lost)


@dataclass
class Shown:
    """What a ray shows: how far away that is, whether it is behind all impostors, and there too far off."""

    L: mi.Color3f
    distance: mi.Float
    behind: mi.Bool
    off: mi.Bool


@dataclass
class Bounce:
    """What a mirror in a picture sends back; the other fields as in `Answer`, `lost` being what was not found."""

    L: mi.Color3f
    tests: mi.UInt32
    work: mi.UInt32
    doubt: mi.Bool
    lost: mi.Bool


def _lost(scene: ImpostorScene, mirror: mi.UInt32, distance: mi.Float) -> mi.Bool:
    """Whether a ray from a mirror that ends after `distance` has slipped between pictures: infinity is behind walls."""
    if scene.enclosed is None:
        return mi.Bool(False)
    return (distance == dr.inf) & dr.gather(mi.Bool, scene.enclosed, mirror)


def _doubted(met: billboard.Hit, shown: Shown) -> mi.Bool:
    """Whether what `met` says about a ray that shows `shown` may be wrong."""
    return (met.doubt & ~shown.behind) | (met.missed < shown.distance)


@dr.syntax
def _shown(scene: ImpostorScene, options: TraceOptions, ray: Ray, met: billboard.Hit) -> Shown:
    """What a ray shows that has met `met`."""
    L, distance, off = mi.Color3f(met.value.xyz), mi.Float(met.t), mi.Bool(False)
    direction, ground = backdrop.behind(scene.backdrop, ray.o, ray.d)
    behind = ~(met.t < ground) | (met.t == dr.inf)
    if behind:
        L, away = backdrop.look_up(scene.backdrop, ray.mirror, direction, mi.Bool(True))
        distance = dr.select(ground < dr.inf, ground, away)
        if dr.hint(options.doubts, mode="scalar"):
            parallax = backdrop.parallax(scene.backdrop, ray)
            pixels = ray.differential.pixels(dr.minimum(distance, FARTHEST), parallax)
            off = (distance < dr.inf) & (pixels > WRONG_PX)
    return Shown(L, distance, behind, off)


def _nearest(
    scene: ImpostorScene, options: TraceOptions, ray: Ray, *, objects_only: bool = False
) -> tuple[billboard.Hit, mi.UInt32]:
    """The nearest impostor along a ray, and the work of looking in depth maps."""
    met = billboard.none()
    for boards, pictures in ((scene.planes, scene.plane_pictures), (scene.boards, scene.pictures)):
        columns = boards.candidates.objects if objects_only else boards.candidates.columns
        if columns > 0:
            bounded = options.doubts and boards is scene.boards
            met = billboard.nearest(boards, pictures, columns, ray, met, bounded=bounded)
    reliefs = scene.reliefs
    if reliefs is None:
        return met, mi.UInt32(0)
    columns = reliefs.candidates.objects if objects_only else reliefs.candidates.columns
    deep = relief.nearest(reliefs, columns, ray, met.t, options.walk)
    closer = deep.t < dr.inf
    a, b = (dr.gather(mi.Vector4f, scene.boards.quads, deep.slot * 4 + i, closer) for i in (1, 2))
    slot = dr.select(closer, deep.slot, scene.pictures.first)
    level = billboard.level_of(scene.pictures, slot, a, b, ray.differential.footprint(dr.select(closer, deep.t, 0)))
    value = billboard.sample(scene.pictures, slot, deep.x, deep.y, level, closer)
    value *= dr.rcp(dr.maximum(value.w, LEAST_COVERAGE))
    t, slot = dr.select(closer, deep.t, met.t), dr.select(closer, deep.slot, met.slot)
    doubt, missed = dr.select(closer, deep.doubt, met.doubt), dr.minimum(met.missed, deep.missed)
    hit = billboard.Hit(t, slot, dr.select(closer, value, met.value), met.tests, doubt, missed)
    return hit, deep.work


@dr.syntax
def _second_bounce(
    scene: ImpostorScene, options: TraceOptions, met: billboard.Hit, ray: Ray, mirror: mi.UInt32, active: mi.Bool
) -> Bounce:
    """What a mirror in a picture sends back along a ray that met it."""
    L, tests, work, doubt, lost = mi.Color3f(0), mi.UInt32(0), mi.UInt32(0), mi.Bool(False), mi.Bool(False)
    if active:  # few rays
        a, b, k = (dr.normalize(dr.gather(mi.Vector4f, scene.boards.quads, met.slot * 4 + i).xyz) for i in (1, 2, 3))
        n = met.value.x * a + met.value.y * b + met.value.z * k
        n = dr.normalize(dr.select(dr.squared_norm(n) > 1e-12, n, k))
        n = dr.select(dr.dot(n, ray.d) > 0, -n, n)
        out = Ray(mirror, _above(ray.o + met.t * ray.d, n), optics.reflect(-ray.d, mi.Normal3f(n)), ray.differential)
        found, work = _nearest(scene, options, out, objects_only=True)
        shown = _shown(scene, options, out, found)
        L = shown.L * optics.reflectance(scene.metals, mirror, dr.clip(-dr.dot(n, ray.d), 0, 1), mi.Bool(True))
        if dr.hint(options.doubts, mode="scalar"):
            doubt = shown.off | _doubted(found, shown) | (_third_bounce(scene, out) < shown.distance)
        lost = _lost(scene, mirror, shown.distance)
        tests = found.tests
    return Bounce(L, tests, work, doubt, lost)


def _third_bounce(scene: ImpostorScene, ray: Ray) -> mi.Float:
    """From where on a ray may meet another mirror; inf for nowhere."""
    t = mi.Float(dr.inf)
    for boards in (scene.planes, scene.boards):
        if boards.candidates.columns > boards.candidates.objects:
            t = dr.minimum(t, billboard.passed(boards.quads, boards.candidates, None, ray))
    reliefs = scene.reliefs
    if reliefs is not None and reliefs.candidates.columns > reliefs.candidates.objects:
        t = dr.minimum(t, billboard.passed(scene.boards.quads, reliefs.candidates, reliefs.slots, ray))
    return t


def _above(p: mi.Point3f, n: mi.Vector3f) -> mi.Point3f:
    """The start of a ray that leaves a surface at p."""
    return p + n * (RAY_EPSILON * (1 + dr.max(dr.abs(p))))
