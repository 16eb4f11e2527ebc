"""Reflections of second and higher order, where pixels are resolved by their own rays: a ray that meets a mirror goes on.

It leaves along the mirror direction about the mirror's interpolated normal, dimmed by the mirror's reflectance, and only has
to be told which triangles to ask. Estalella et al. 2006 (section 7) sketch a pass for each mirror in each other one, whose
searches run over the reflected picture. Here a cube map around each mirror names triangles, whatever the eye sees: per texel,
the nearest as seen from the mirror's centre, and how near it is. Along the ray, a march through the map's distances
(`images.distancemap`) finds where it passes behind what the centre sees; the four triangles named there are asked in the
scene itself, as is what they lead to over their edges (`meshwalk`). What is met is exact, whatever the map's texels, and may be
a mirror again.

Between the centre and what it sees there is nothing. So a hit that the centre sees is the ray's first, but for what is
thinner than a step of the march. Doubted are hits that it does not see, rays that meet none of what is named, rays from a
mirror that is hollow somewhere, which is not in its own map, and rays that end at the last mirror that they are followed to,
which is black.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels import cubemap, geometry, optics, placement, raster, surroundings
from benchharness.kernels.frozen import frozen
from benchharness.kernels.images import distancemap, probe
from benchharness.kernels.types import SceneLike
from benchharness.kernels.vertices import exact, meshwalk
from benchharness.kernels.vertices.adjacency import NONE
from benchharness.kernels.vertices.meshwalk import Asked, Hit, Ray

ORDERS = 4  # mirrors that a ray is followed over
TEXELS = 64  # per edge of a face of a map
STEPS = 64  # of a march, at most
SECANTS = 4  # after it


@dataclass
class Maps:
    """What is around every mirror; buffers of [mirrors, 6, n + 2, n + 2].

    names     the nearest triangle of the scene, NONE for the surroundings
    nearness  as `distancemap.DistanceMap` has it
    places    from where that is seen, the middles of the mirrors' boxes: packets
    n         texels per edge of a face
    """

    names: mi.UInt32
    nearness: mi.Float
    places: mi.Float
    n: int


@dataclass
class Mirrors:
    """What rays need to go on from mirrors.

    normals  4 floats per vertex of the scene, object space; of no meaning for objects
    metals   as `optics.metals_of` has them
    walled   per mirror, 1 where `benchharness.scene.Scene.enclosed` holds it
    hollow   per mirror, 1 where it may meet itself
    centres  of the mirrors' boxes, object space
    near     what is nearer to a centre than this is not in its map
    maps     where the mirrors were put last; None before
    """

    normals: mi.Float
    metals: mi.Float
    walled: mi.UInt32
    hollow: mi.UInt32
    centres: list[mi.Point3f]
    near: mi.Float
    maps: Maps | None = None


def of_scene(scene: SceneLike, hollow: list[bool]) -> Mirrors:
    """The mirrors of a `benchharness.scene.Scene`, without maps."""
    centres = []
    for reflector in scene.reflectors:
        v = np.asarray((reflector.closed or reflector.mesh).vertices)
        centres.append(mi.Point3f((0.5 * (v.min(axis=0) + v.max(axis=0))).tolist()))
    near = mi.Float(probe.NEAR)
    dr.make_opaque(centres, near)
    walled, bent = (mi.UInt32([int(one) for one in each]) for each in (scene.enclosed, hollow))
    return Mirrors(geometry.of_scene_seen(scene).attributes, optics.metals_of(scene), walled, bent, centres, near)


def placed(mirrors: Mirrors, world: geometry.Geometry, poses: mi.Float, objects: int) -> Mirrors:
    """The mirrors with maps of the scene where `poses` (12 floats per part) puts it; `world` is the scene there, whose first
    `objects` parts are no mirrors. Waits for the device."""
    owners, names, nearness, places = probe.owners(world), [], [], []
    for i, centre in enumerate(mirrors.centres):
        part = dr.opaque(mi.UInt32, objects + i)
        place = placement.point_to_world(placement.pose_of(poses, part), centre)
        named, near = cubemap.named(world, owners != part, place, TEXELS, mirrors.near)
        names.append(named)
        nearness.append(near)
        places += [place.x, place.y, place.z, mi.Float(0)]
    return replace(mirrors, maps=Maps(dr.concat(names), dr.concat(nearness), dr.concat(places), TEXELS))


@dataclass
class Path:
    """Rays that have met a mirror, one lane each.

    number    of the pixel that they are of (`exact.Pixels`)
    ray       the last
    triangle  the mirror's, which it has met
    through   share of the light that the mirrors after the first send back
    doubt     what they show may be wrong
    """

    number: mi.UInt32
    ray: Ray
    triangle: mi.UInt32
    through: mi.Color3f
    doubt: mi.Bool


@dataclass
class Bounce:
    """What rays show that go on from a mirror.

    path    of those that have met a mirror again: the next ray
    again   which these are
    L       radiance at the first mirror; black where a mirror is met
    doubt   as `Path` has it
    found   False where the ray ends at infinity, and cannot
    """

    path: Path
    again: mi.Bool
    L: mi.Color3f
    doubt: mi.Bool
    found: mi.Bool


def followed(
    shows: exact.Shown,
    pixels: exact.Pixels,
    asked: Asked,
    mirrors: Mirrors,
    poses: mi.Float,
    around: surroundings.Surroundings | None,
) -> exact.Shown:
    """What the mirrors' pixels show if mirrors that their rays meet are not black; `exact.Shown.mirror` is then where what such
    a ray shows may be wrong.

    around  what is at infinity; None where that is dark, or no mirror can show it

    Waits for the device once per order, to learn how many rays go on.
    """
    which = dr.compress(shows.mirror & (shows.triangle != NONE))
    if dr.width(which) == 0:
        return shows
    path = _begun(pixels, shows.triangle, which)
    for order in range(2, ORDERS + 1):
        bounce = _gone_on(asked, mirrors, poses, around, path)
        shows = _shown(shows, path.number, bounce)
        which = dr.compress(bounce.again)
        if order == ORDERS or dr.width(which) == 0:
            break
        path = _of(bounce.path, which)
    return shows


@frozen
def _begun(pixels: exact.Pixels, triangle: mi.UInt32, which: mi.UInt32) -> Path:
    """The rays of the pixels `which`, of which `triangle` says what each meets."""
    return Path(mi.UInt32(which), pixels.ray(which), dr.gather(mi.UInt32, triangle, which), mi.Color3f(1), mi.Bool(False))


@frozen
def _of(path: Path, which: mi.UInt32) -> Path:
    """The lanes `which`."""
    p, d, part = (dr.gather(type(a), a, which) for a in (path.ray.p, path.ray.d, path.ray.part))
    number, triangle, through, doubt = (
        dr.gather(type(a), a, which) for a in (path.number, path.triangle, path.through, path.doubt)
    )
    return Path(number, Ray(p, d, part), triangle, through, doubt)


@frozen
@dr.syntax
def _gone_on(asked: Asked, mirrors: Mirrors, poses: mi.Float, around: surroundings.Surroundings | None, path: Path) -> Bounce:
    """What rays show after one more mirror."""
    ray, through = reflected(asked, mirrors, poses, path.ray, path.triangle)
    mirror, through = ray.part - asked.objects, through * path.through
    assert mirrors.maps is not None
    map, of = _seen_from(mirrors.maps, mirror, ray)
    end = distancemap.march(map, of, STEPS, SECANTS, path.triangle != NONE)
    hit, named = _asked(asked, mirrors.maps.names, map, distancemap.direction(of, end.spot), ray)

    met, walled = hit.triangle != NONE, dr.gather(mi.UInt32, mirrors.walled, mirror) == 1
    found = met | (walled & (named != NONE))
    L, t, again = mi.Color3f(0), mi.Float(0), mi.Bool(False)
    if found:
        passed = meshwalk.passed_by(asked.world, ray, dr.select(met, hit.triangle, named))
        L, t = geometry.radiance(asked.world, passed.face, passed.weights, ray.p, found), dr.maximum(passed.t, 0)
        again = met & (geometry.part_of(passed.face) >= asked.objects)
    if dr.hint(around is not None, mode="scalar"):
        sky = ~found & ~walled
        L = dr.select(sky, surroundings.radiance(around, ray.d, sky), L)

    # Where along the ray the hit lies, told as `distancemap` does, and whether the centre sees less far there.
    s = of.a * dr.rcp(of.a + t)
    behind = met & (distancemap.at(map, of, 1 - s, s, met).f > distancemap.TOUCHING * s)
    lost = ~met & (named != NONE)
    doubt = path.doubt | behind | lost | (dr.gather(mi.UInt32, mirrors.hollow, mirror) == 1)
    return Bounce(Path(path.number, ray, hit.triangle, through, doubt), again, through * L, doubt, found | ~walled)


def reflected(asked: Asked, mirrors: Mirrors, poses: mi.Float, ray: Ray, triangle: mi.UInt32) -> tuple[Ray, mi.Color3f]:
    """The ray that goes on from a mirror's triangle which a ray has met, and the mirror's reflectance there."""
    met = meshwalk.passed_by(asked.world, ray, triangle)
    part, v = geometry.part_of(met.face), -ray.d
    n = raster.interpolate(mirrors.normals, met.face, met.weights, mi.Bool(True)).xyz
    n = dr.normalize(geometry.turned_of(n, poses, part, mi.Bool(True)))
    n = mi.Normal3f(dr.select(dr.dot(n, v) < 0, -n, n))
    through = optics.reflectance(mirrors.metals, part - asked.objects, dr.clip(dr.dot(n, v), 0, 1), mi.Bool(True))
    return Ray(mi.Point3f(ray.p + met.t * ray.d), mi.Vector3f(optics.reflect(v, n)), part), through


def _seen_from(maps: Maps, mirror: mi.UInt32, ray: Ray) -> tuple[distancemap.DistanceMap, distancemap.Ray]:
    """The map of each lane's mirror, and the ray as told from its centre."""
    place = dr.gather(mi.Vector4f, maps.places, mirror)
    first = mirror * cubemap.texels_of(maps.n)
    x = mi.Vector3f(ray.p) - place.xyz
    return distancemap.DistanceMap(maps.nearness, maps.n, first), distancemap.ray(x, ray.d)


def _asked(asked: Asked, names: mi.UInt32, map: distancemap.DistanceMap, d: mi.Vector3f, ray: Ray) -> tuple[Hit, mi.UInt32]:
    """What a ray meets of what the map names around direction d, and the name nearest to that."""
    texels, fx, fy = distancemap.around(map, d)

    def named(k: mi.UInt32) -> tuple[mi.UInt32, mi.Float]:
        texel = mi.UInt32(texels[0])
        for number, other in enumerate(texels[1:], 1):
            texel = dr.select(k == number, other, texel)
        return dr.gather(mi.UInt32, names, texel), mi.Float(0)

    nearest, _ = named(dr.select(fx < 0.5, mi.UInt32(0), 1) + dr.select(fy < 0.5, mi.UInt32(0), 2))
    return meshwalk.asks(asked, ray, Hit(mi.UInt32(NONE), mi.Float(dr.inf)), named, len(texels)), nearest


@frozen
def _shown(shows: exact.Shown, number: mi.UInt32, bounce: Bounce) -> exact.Shown:
    """What pixels show, `number` of them what `bounce` says."""
    L = [mi.Float(one) for one in (shows.L.x, shows.L.y, shows.L.z)]
    for target, value in zip(L, (bounce.L.x, bounce.L.y, bounce.L.z), strict=True):
        dr.scatter(target, value, number)
    found, mirror = mi.Bool(shows.found), mi.Bool(shows.mirror)
    dr.scatter(found, bounce.found, number)
    dr.scatter(mirror, bounce.doubt | bounce.again, number)
    return replace(shows, L=mi.Color3f(*L), found=found, mirror=mirror)
