"""Cube maps taken from the middles of mirrors, of everything but the mirror itself."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels import cubemap, geometry, surroundings
from benchharness.kernels.types import SceneLike

NEAR = 1e-3  # metres; what is nearer to the middle than this is inside the mirror


@dataclass
class Middles:
    """What is known of the mirrors before they are placed.

    centres  middles of their bounding boxes, in object space
    halves   half of the boxes' sizes
    near     NEAR on the device
    first    number of the first mirror's part
    """

    geometry: geometry.Geometry
    centres: list[mi.Point3f]
    halves: list[mi.Vector3f]
    around: surroundings.Surroundings
    near: mi.Float
    first: int


@dataclass
class CentreMap:
    """A mirror's map, where it was taken, and the mirror's box: rows that take a point of the world to [-1, 1] across it."""

    map: cubemap.Pyramid
    place: mi.Point3f
    box: list[mi.Vector4f]


def of_scene(scene: SceneLike) -> Middles:
    """The middles of a scene's mirrors."""
    centres, halves = [], []
    for r in scene.reflectors:
        v = (r.closed or r.mesh).vertices
        centres.append(mi.Point3f((0.5 * (v.min(axis=0) + v.max(axis=0))).tolist()))
        halves.append(mi.Vector3f(np.maximum(0.5 * np.ptp(v, axis=0), NEAR).tolist()))
    near = mi.Float(NEAR)
    dr.make_opaque(near, centres, halves)
    return Middles(geometry.of_scene(scene), centres, halves, surroundings.of_scene(scene), near, len(scene.objects))


def taken(middles: Middles, poses: mi.Float, resolution: int, mip: bool) -> list[CentreMap]:
    """The maps of all mirrors where `poses` puts everything. poses: 12 floats per part, as `benchharness.api.Frame` has them.

    resolution  texels per edge of a face, a power of two; 0 for the places and boxes alone, without maps
    mip         with all coarser levels; else the finest alone
    """
    if resolution == 0:
        parts = [dr.opaque(mi.UInt32, middles.first + i) for i in range(len(middles.centres))]
        boxes = [_placed(poses, *of) for of in zip(parts, middles.centres, middles.halves, strict=True)]
        return [CentreMap(cubemap.Pyramid(mi.Float(0), mi.UInt32(0), 0, 0), place, box) for place, box in boxes]
    world = geometry.placed(middles.geometry, poses)
    maps = []
    for i, (centre, half) in enumerate(zip(middles.centres, middles.halves, strict=True)):
        part = dr.opaque(mi.UInt32, middles.first + i)
        place, box = _placed(poses, part, centre, half)
        owner = geometry.part_of(dr.gather(mi.Vector4u, world.faces, dr.arange(mi.UInt32, world.face_count)))
        levels = [cubemap.capture(world, owner != part, place, resolution, middles.near, middles.around)]
        for n in cubemap.levels_of(resolution)[:-1] if mip else ():
            levels.append(cubemap.coarser(levels[-1], n))
        maps.append(CentreMap(cubemap.pyramid(levels, resolution), place, box))
    return maps


def far(map: cubemap.Pyramid, r: mi.Vector3f, turn: mi.Float, active: mi.Bool) -> mi.Vector4f:
    """Radiance and 1 / distance in direction r, as if all were infinitely far. turn: of r, from one pixel to the next."""
    level = dr.log2(dr.maximum(turn * (0.5 * map.n), 1)) if map.count > 1 else mi.Float(0)
    return cubemap.lookup_mip(map, r, level, active)


def _placed(poses: mi.Float, part: mi.UInt32, centre: mi.Point3f, half: mi.Vector3f) -> tuple[mi.Point3f, list[mi.Vector4f]]:
    """Where a part's middle is in the world, and the rows of its box."""
    rows = [dr.gather(mi.Vector4f, poses, part * 3 + k) for k in range(3)]
    q = mi.Vector4f(centre.x, centre.y, centre.z, 1)
    place = mi.Point3f(*(dr.dot(row, q) for row in rows))
    axes = [mi.Vector3f(rows[0][j], rows[1][j], rows[2][j]) / half[j] for j in range(3)]
    return place, [mi.Vector4f(axis.x, axis.y, axis.z, -dr.dot(axis, mi.Vector3f(place))) for axis in axes]
