"""Cube maps of the scene around every mirror: where they are taken, their mip levels, and which level a pixel asks.

A mirror's map belongs to the middle of its bounding box, and shows everything but the mirror itself (Blinn and Newell 1976;
Greene 1986). Whoever looks it up says in which direction.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels import cubemap, geometry, surroundings
from benchharness.kernels.types import SceneLike

NEAR = 1e-3  # units; what is nearer to a map's centre than this is inside the reflector


@dataclass
class Probe:
    """A reflector's environment map, where it was taken, and the reflector's box, as `selfmet.away` has it."""

    map: cubemap.Pyramid
    place: mi.Point3f
    box: list[mi.Vector4f]


@dataclass
class State:
    """What is kept of a scene.

    centres   middles of the reflectors' bounding boxes, in object space
    halves    half of the boxes' sizes
    near      NEAR on the device
    probes    per reflector, in world space
    enclosed  what `Scene.enclosed` says
    """

    geometry: geometry.Geometry
    centres: list[mi.Point3f]
    halves: list[mi.Vector3f]
    surroundings: surroundings.Surroundings
    near: mi.Float
    probes: list[Probe]
    enclosed: tuple[bool, ...]


def begun(scene: SceneLike) -> State:
    """The state of a scene of which no map has been taken."""
    centres, halves = [], []
    for r in scene.reflectors:
        v = (r.closed or r.mesh).vertices
        centres.append(mi.Point3f((0.5 * (v.min(axis=0) + v.max(axis=0))).tolist()))
        halves.append(mi.Vector3f(np.maximum(0.5 * np.ptp(v, axis=0), NEAR).tolist()))
    near = mi.Float(NEAR)
    dr.make_opaque(near, centres, halves)
    return State(geometry.of_scene(scene), centres, halves, surroundings.of_scene(scene), near, [], tuple(scene.enclosed))


def updated(state: State, poses: mi.Float, resolution: int, *, mip: bool) -> State:
    """The maps of all reflectors where `poses` puts them, `resolution` texels per edge of a face."""
    return taken(state, poses, resolution, [None] * len(state.centres), mip=mip)


def taken(
    state: State,
    poses: mi.Float,
    resolution: int,
    beyond: Sequence[mi.Float | None],
    again: Sequence[bool] | None = None,
    *,
    mip: bool,
) -> State:
    """The maps of all reflectors, or of those that are to be taken again, the others as they were.

    beyond  per reflector, as `cubemap.capture` has it
    """
    world, probes = geometry.placed(state.geometry, poses), []
    for i, (part, place, box) in enumerate(_boxes(state, poses)):
        if again is not None and not again[i]:
            probes.append(Probe(state.probes[i].map, place, box))
            continue
        drawn = owners(world) != part
        texels = cubemap.capture(world, drawn, place, resolution, state.near, state.surroundings, beyond[i])
        probes.append(Probe(pyramid(texels, resolution, mip=mip), place, box))
    return replace(state, probes=probes)


def without_maps(state: State, poses: mi.Float) -> State:
    """The places and boxes of all reflectors alone."""
    none = cubemap.Pyramid(mi.Float(0), mi.UInt32(0), 0, 0)
    return replace(state, probes=[Probe(none, place, box) for _, place, box in _boxes(state, poses)])


def _boxes(state: State, poses: mi.Float) -> Iterator[tuple[mi.UInt32, mi.Point3f, list[mi.Vector4f]]]:
    """The part of every reflector, and what `placed` says of it."""
    first = dr.width(poses) // 12 - len(state.centres)
    for i, (centre, half) in enumerate(zip(state.centres, state.halves, strict=True)):
        part = dr.opaque(mi.UInt32, first + i)
        yield part, *placed(poses, part, centre, half)


def placed(poses: mi.Float, part: mi.UInt32, centre: mi.Point3f, half: mi.Vector3f) -> tuple[mi.Point3f, list[mi.Vector4f]]:
    """Where a part's centre is in the world, and the rows that take a point of the world to [-1, 1] across its box."""
    rows = [dr.gather(mi.Vector4f, poses, part * 3 + k) for k in range(3)]
    q = mi.Vector4f(centre.x, centre.y, centre.z, 1)
    place = mi.Point3f(*(dr.dot(row, q) for row in rows))
    axes = [mi.Vector3f(rows[0][j], rows[1][j], rows[2][j]) / half[j] for j in range(3)]
    return place, [mi.Vector4f(axis.x, axis.y, axis.z, -dr.dot(axis, mi.Vector3f(place))) for axis in axes]


def owners(triangles: geometry.Geometry) -> mi.UInt32:
    """The part of every triangle."""
    return geometry.part_of(dr.gather(mi.Vector4u, triangles.faces, dr.arange(mi.UInt32, triangles.face_count)))


def pyramid(texels: mi.Float, resolution: int, *, mip: bool) -> cubemap.Pyramid:
    """A map out of its finest level, with the coarser ones if `mip`."""
    levels = [texels]
    for n in cubemap.levels_of(resolution)[:-1] if mip else ():
        levels.append(cubemap.coarser(levels[-1], n))
    return cubemap.pyramid(levels, resolution)


def level(map: cubemap.Pyramid, turn: mi.Float) -> mi.Float:
    """The level whose texels are as wide as the turn, in radians, of what is looked up from one pixel to the next."""
    if map.count == 1:
        return mi.Float(0)
    return dr.maximum(dr.log2(dr.maximum(turn * (0.5 * map.n), 1)), 0)


def far(map: cubemap.Pyramid, r: mi.Vector3f, turn: mi.Float, active: mi.Bool) -> mi.Vector4f:
    """Radiance and 1 / distance in direction r, as if all were infinitely far. turn: of r, from one pixel to the next."""
    return cubemap.lookup_mip(map, r, level(map, turn), active)
