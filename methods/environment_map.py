"""Environment map: the scene as seen from the reflector's centre, looked up by direction alone (Blinn and Newell 1976).

A cube map per reflector, captured in `update` by rasterizing everything but the reflector itself. Each pixel looks up the
mirror direction of its own ray as if all surroundings were infinitely far away.

Assumes distant surroundings. What is near is shown in the wrong place: the parallax between the reflector's centre and
the reflection point is ignored, and contact between an object and its image is lost. Highlights are those that the
reflector's centre sees. With `mip`, the level is chosen from
how far the direction turns from one pixel to the next, so that a strongly curved mirror does not alias.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import drjit as dr
import mitsuba as mi
from pydantic import Field

from benchharness.api import Frame, Method, Reflection
from benchharness.kernels import cubemap, geometry, optics, surroundings
from benchharness.kernels.frozen import frozen
from benchharness.scene import Scene

NEAR = 1e-3  # metres; what is nearer to the reflector's centre than this is inside the reflector


@dataclass
class State:
    """`centres`: middle of each reflector's bounding box, object space; `maps`: per reflector."""

    geometry: geometry.Geometry
    centres: list[mi.Point3f]
    surroundings: surroundings.Surroundings
    near: mi.Float
    maps: list[cubemap.Pyramid]


@dataclass(frozen=True)
class EnvironmentMap(Method):
    """
    resolution  texels per edge of a cube face, a power of two
    mip         trilinear lookup in a mip pyramid; else bilinear in the finest level
    """

    resolution: Annotated[int, Field(ge=4, le=4096)] = 256
    mip: bool = True

    paper: ClassVar[str] = "Blinn and Newell 1976; Greene 1986"

    def __post_init__(self) -> None:
        if self.resolution & (self.resolution - 1):
            raise ValueError(f"environment_map: resolution is {self.resolution}; accepted: a power of two, such as 256")

    def prepare(self, scene: Scene) -> State:
        centres = []
        for r in scene.reflectors:
            v = (r.closed or r.mesh).vertices
            centres.append(mi.Point3f((0.5 * (v.min(axis=0) + v.max(axis=0))).tolist()))
        near = mi.Float(NEAR)
        dr.make_opaque(near, centres)
        return State(geometry.of_scene(scene), centres, surroundings.of_scene(scene), near, [])

    def update(self, state: State, frame: Frame) -> State:
        first = len(frame.poses) // 12 - len(state.centres)
        world = geometry.placed(state.geometry, frame.poses)
        maps = []
        for i, centre in enumerate(state.centres):
            part = dr.opaque(mi.UInt32, first + i)
            finest = _capture(world, frame.poses, part, centre, state.near, state.surroundings, self.resolution)
            levels = [finest]
            for n in cubemap.levels_of(self.resolution)[:-1] if self.mip else ():
                levels.append(cubemap.coarser(levels[-1], n))
            maps.append(cubemap.pyramid(levels))
        return replace(state, maps=maps)

    def shade(self, state: State, frame: Frame) -> tuple[Reflection, State]:
        L, distance = _look_up(
            state.maps, frame.view, frame.p, frame.n, frame.reflector, frame.active, self.resolution, self.mip
        )
        return Reflection(L, distance, mi.Bool(frame.active)), state


def _capture(triangles: geometry.Geometry, poses, part, centre, near, around, resolution: int) -> mi.Float:
    """The finest level of one reflector's map: everything but part number `part`, around `centre` of that part."""
    q = mi.Vector4f(centre.x, centre.y, centre.z, 1)
    world = mi.Point3f(*(dr.dot(dr.gather(mi.Vector4f, poses, part * 3 + k), q) for k in range(3)))
    owner = geometry.part_of(dr.gather(mi.Vector4u, triangles.faces, dr.arange(mi.UInt32, triangles.face_count)))
    return cubemap.capture(triangles, owner != part, world, resolution, near, around)


@frozen
def _look_up(maps: list, view, p, n, reflector, active, resolution: int, mip: bool):
    """Radiance and distance at every pixel, from the map of the reflector seen there."""
    eye = view.eye
    r = optics.reflect(dr.normalize(eye - p), n)
    level = _footprint(eye, p, n, reflector, r, view, resolution) if mip else mi.Float(0)
    value = mi.Vector4f(0)
    count = len(cubemap.levels_of(resolution)) if mip else 1
    for i, pyramid in enumerate(maps):
        own = active & (reflector == i)
        value = dr.select(own, cubemap.lookup_mip(pyramid, resolution, count, r, level, own), value)
    distance = dr.select(active & (value.w <= 0), dr.inf, dr.rcp(dr.select(active, value.w, 1)))
    return mi.Color3f(value.x, value.y, value.z), dr.select(active, distance, 0)


def _footprint(eye, p, n, reflector, r, view, resolution: int) -> mi.Float:
    """Mip level at which one texel is as wide as the turn of r from this pixel to its right and lower neighbours."""
    lane = dr.arange(mi.UInt32, view.width * view.height)
    column = lane % view.width
    last_column, last_row = column == view.width - 1, lane >= view.width * (view.height - 1)
    turn = mi.Float(0)
    # At the picture's end, the neighbour on the other side.
    for there in (dr.select(last_column, lane - 1, lane + 1), dr.select(last_row, lane - view.width, lane + view.width)):
        there = dr.minimum(there, view.width * view.height - 1)
        q, m = dr.gather(mi.Point3f, p, there), dr.gather(mi.Normal3f, n, there)
        same = dr.gather(mi.Int32, reflector, there) == reflector
        turned = dr.norm(optics.reflect(dr.normalize(eye - q), m) - r)
        turn = dr.select(same, dr.maximum(turn, turned), turn)
    return dr.maximum(dr.log2(dr.maximum(turn * (0.5 * resolution), 1)), 0)
