"""Environment map: the scene as seen from the reflector's centre, looked up by direction alone (Blinn and Newell 1976).

A cube map per reflector, captured in `update` by rasterizing everything but the reflector itself. Each pixel looks up the
mirror direction of its own ray as if all surroundings were infinitely far away.

Assumes distant surroundings. What is near is shown in the wrong place: the parallax between the reflector's centre and
the reflection point is ignored, and contact between an object and its image is lost. Highlights are those that the
reflector's centre sees. With `mip`, the level is chosen from how far the direction turns from one pixel to the next, so
that a strongly curved mirror does not alias.

Doubted: let x be the reflection point seen from the centre, r the mirror direction, and a the turn of r from this pixel to
the next. The centre sees the points x + t r of the ray by angles |x - (x·r) r| / |x + t r| away from r.
* What is shown at a distance D from the centre is about |x - (x·r) r| / (D a) pixels from its place: more than two are doubted.
* What should be shown lies on the ray. With `mip`, four of its points are looked up, in the level whose texels are as wide
  as the gaps between them. Where one is more than two pixels from r and the map shows a surface nearer to the centre
  than it, the ray has met something that is not shown.
* In a scene of several mirrors, what is black: in the map the others are, and nothing that is lit.
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

OFF_PX = 2.0  # on the screen; what is shown further off than this is doubted
WAY = (0.4, 1.0, 2.5, 6.25)  # where a ray's way is looked at, in distances of its start from the centre
SPAN = 0.6  # of the angle between a point of the way and the way's end: so far is the next point, 1 - 1 / 2.5
COVER = 0.25  # share of a texel that what is near has to fill
NEAR = 1e-3  # metres; what is nearer to the reflector's centre than this is inside the reflector


@dataclass
class State:
    """Per reflector: `centres`, the middle of its bounding box in object space; `places`, the same in the world; `maps`."""

    geometry: geometry.Geometry
    centres: list[mi.Point3f]
    surroundings: surroundings.Surroundings
    near: mi.Float
    maps: list[cubemap.Pyramid]
    places: list[mi.Point3f]


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
        return State(geometry.of_scene(scene), centres, surroundings.of_scene(scene), near, [], [])

    def update(self, state: State, frame: Frame) -> State:
        first = len(frame.poses) // 12 - len(state.centres)
        world = geometry.placed(state.geometry, frame.poses)
        maps, places = [], []
        for i, centre in enumerate(state.centres):
            part = dr.opaque(mi.UInt32, first + i)
            finest, place = _capture(world, frame.poses, part, centre, state.near, state.surroundings, self.resolution)
            levels = [finest]
            for n in cubemap.levels_of(self.resolution)[:-1] if self.mip else ():
                levels.append(cubemap.coarser(levels[-1], n))
            maps.append(cubemap.pyramid(levels))
            places.append(place)
        return replace(state, maps=maps, places=places)

    def shade(self, state: State, frame: Frame) -> tuple[Reflection, State]:
        pixels = [frame.p, frame.n, frame.reflector, frame.active]
        L, distance, doubt = _look_up(state.maps, state.places, frame.view, pixels, self.resolution, self.mip)
        return Reflection(L, distance, mi.Bool(frame.active), doubt=doubt), state


def _capture(triangles: geometry.Geometry, poses, part, centre, near, around, resolution: int) -> tuple[mi.Float, mi.Point3f]:
    """The finest level of one reflector's map: everything but part number `part`, around `centre` of it; the centre's place."""
    q = mi.Vector4f(centre.x, centre.y, centre.z, 1)
    world = mi.Point3f(*(dr.dot(dr.gather(mi.Vector4f, poses, part * 3 + k), q) for k in range(3)))
    owner = geometry.part_of(dr.gather(mi.Vector4u, triangles.faces, dr.arange(mi.UInt32, triangles.face_count)))
    return cubemap.capture(triangles, owner != part, world, resolution, near, around), world


@frozen
def _look_up(maps: list, places: list, view, pixels: list, resolution: int, mip: bool):
    """Radiance, distance and doubt of every pixel, from the map of its reflector. `pixels`: p, n, reflector, active."""
    p, n, reflector, active = pixels
    eye = view.eye
    r = optics.reflect(dr.normalize(eye - p), n)
    turn = _turn(eye, p, n, reflector, r, view)
    level = dr.maximum(dr.log2(dr.maximum(turn * (0.5 * resolution), 1)), 0) if mip else mi.Float(0)
    value, doubt = mi.Vector4f(0), mi.Bool(False)
    count = len(cubemap.levels_of(resolution)) if mip else 1
    for i, (pyramid, place) in enumerate(zip(maps, places, strict=True)):
        own = active & (reflector == i)
        value = dr.select(own, cubemap.lookup_mip(pyramid, resolution, count, r, level, own), value)
        doubt |= own & _misplaced(pyramid, resolution, count, mi.Vector3f(p - place), r, value.w, OFF_PX * turn, own)
    if len(maps) > 1:
        doubt |= active & (value.w > 0) & (dr.max(value.xyz) <= 0)
    distance = dr.select(active & (value.w <= 0), dr.inf, dr.rcp(dr.select(active, value.w, 1)))
    return mi.Color3f(value.x, value.y, value.z), dr.select(active, distance, 0), doubt


def _misplaced(pyramid, resolution: int, count: int, x, r, inverse, angle, active) -> mi.Bool:
    """Whether what is shown along r, at 1 / distance `inverse`, belongs more than `angle` away, or something else does there.

    x  start of the ray, from the map's centre
    """
    across = dr.norm(x - dr.dot(x, r) * r)
    off = across * inverse > angle
    for t in WAY if count > 1 else ():
        q = x + t * dr.norm(x) * r
        away = dr.norm(q)
        level = dr.log2(dr.maximum(across / away * (0.5 * SPAN * resolution), 1))
        nearness = cubemap.texel(pyramid, resolution, count, q, level, active).w
        off |= (across > angle * away) & (nearness * away > COVER)
    return off


def _turn(eye, p, n, reflector, r, view) -> mi.Float:
    """How far r turns from this pixel to its right or its lower neighbour, radians, the larger; 0 where both show something
    else."""
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
    return turn
