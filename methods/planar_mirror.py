"""Planar mirrors: the scene as a camera sees it that is mirrored in a flat mirror's plane, drawn by the rasterizer.

At the pixel at which the eye sees the mirror, the mirrored camera sees what the mirror shows: no texture is looked up, and the
outline of the mirror is that of its pixels. The plane is fitted to the mirror's triangles, and goes with them; no transform is
asked for it. `clip` says how everything between the mirrored eye and the mirror is cut away (`kernels.planes`): "discard" and
"oblique" are exact; "near_plane" and "vertex_scale" are what is often tried first, with their faults.

Highlights are those that the mirrored eye sees, which are those that the reflection point sees. Mirrors are mirrors on both
sides, as everywhere here: an eye behind one is in front of its back, and sees nothing of what lies before it.

With `depth` above 1 mirrors show mirrors: the mirrored camera is mirrored again. Where a picture shows another mirror is known
before that one's picture is drawn, so that nothing is drawn that no pixel shows; pictures are put together deepest first. The
last mirror is black. A cut is never handed on to the next picture.

Doubted: what ends at a mirror, which goes on reflecting; with "near_plane", pixels at which the near plane is not at the
mirror; with "vertex_scale", where what is shown belongs more than two pixels away, or nothing is shown.

Refuses mirrors that are not flat: no one camera sees what they show.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import drjit as dr
import mitsuba as mi
import numpy as np
from pydantic import Field

from benchharness.api import Frame, Knob, Method, Reflection, View
from benchharness.kernels import geometry, normalmap, optics, packets, passage, planes, raster, shown, surroundings
from benchharness.kernels.frozen import frozen
from benchharness.kernels.pixels import WRONG_PX
from benchharness.scene import Scene


@dataclass
class State:
    """What is kept of a scene.

    triangles  object space, and `flipped`: the same, wound the other way
    own        planes of the mirrors, object space
    planes     the same in world space
    numbers    of the mirrors, on the device, and `parts`: those of their parts
    """

    triangles: geometry.Geometry
    flipped: mi.UInt32
    world: geometry.Geometry
    own: list[planes.Plane]
    planes: list[planes.Plane]
    numbers: list[mi.Int32]
    parts: list[mi.UInt32]
    metals: mi.Float
    surroundings: surroundings.Surroundings
    enclosed: tuple[bool, ...]


@dataclass
class Picture:
    """What one mirror shows, a lane per pixel; of no meaning elsewhere.

    L          radiance
    p          the first thing that the ray meets, `hit` whether there is any
    reflector  number of the mirror that this is, -1 for none
    doubt      it may be wrong
    """

    L: mi.Color3f
    p: mi.Point3f
    hit: mi.Bool
    reflector: mi.Int32
    doubt: mi.Bool


@dataclass(frozen=True)
class PlanarMirror(Method):
    """
    clip     how is cut off what lies behind the mirror: "discard", "oblique", "near_plane" or "vertex_scale"
    near_at  the point of the mirror that a near plane goes through: the "farthest" that is seen, so that nothing behind the
             mirror is drawn and what is near to it is lost; or the "nearest", so that nothing is lost and some of what is
             behind it is drawn
    depth    mirrors that a ray is followed over; a reference of `max_depth` d shows d - 1
    cull     mirrors that no pixel shows are not drawn; False draws every sequence of them, which are
             n (1 + (n - 1) + .. + (n - 1)^(depth - 1)) pictures of n mirrors
    """

    clip: planes.Clip = "discard"
    near_at: Literal["farthest", "nearest"] = "farthest"
    depth: Annotated[int, Field(ge=1, le=8)] = 1
    cull: bool = True

    knobs: ClassVar[tuple[Knob, ...]] = (Knob("depth", (1, 2, 3, 4), reference={"max_depth": 5}),)
    family: ClassVar[str] = "mirrored camera"
    paper: ClassVar[str] = "Kilgard 1999; Lengyel 2005"

    def refuses(self, scene: Scene) -> str | None:
        for reflector in scene.reflectors:
            fit = planes.fitted(reflector.mesh)
            if not fit.flat:
                metres = scene.unit * fit.extent
                return (
                    f"reflector {reflector.name} is not flat: up to {fit.height * scene.unit:.3g} m off the plane through it, "
                    f"{fit.height / fit.extent:.2g} of its extent of {metres:.3g} m, and its normals turn from the plane's by "
                    f"up to {np.degrees(fit.turn):.3g} degrees; accepted: up to {planes.FLAT:g} of the extent, "
                    f"{planes.FLAT * metres:.3g} m here, and {np.degrees(planes.FLAT):.2g} degrees"
                )
        return normalmap.refusal(scene.reflectors)

    def prepare(self, scene: Scene) -> State:
        if (reason := self.refuses(scene)) is not None:
            raise ValueError(f"planar_mirror: {reason}")
        triangles, first = geometry.of_scene(scene), len(scene.objects)
        own = planes.uploaded([planes.fitted(reflector.mesh) for reflector in scene.reflectors])
        numbers = [mi.Int32(i) for i in range(len(own))]
        parts = [mi.UInt32(first + i) for i in range(len(own))]
        dr.make_opaque(numbers, parts)
        return State(
            triangles=triangles,
            flipped=_flipped(triangles.faces, triangles.face_count),
            world=triangles,
            own=own,
            planes=own,
            numbers=numbers,
            parts=parts,
            metals=optics.metals_of(scene),
            surroundings=surroundings.of_scene(scene),
            enclosed=scene.enclosed,
        )

    def update(self, state: State, frame: Frame) -> State:
        world = geometry.placed(state.triangles, frame.poses)
        return replace(state, world=world, planes=planes.placed(state.own, frame.poses, state.parts))

    def shade(self, state: State, frame: Frame) -> tuple[Reflection, State]:
        renders, answer = 0, _nothing(frame.view.width * frame.view.height)
        for i in self._seen(state, frame.reflector, None):
            picture, count = self._picture(state, frame.view, i, frame.reflector, self.depth)
            answer, renders = _beside(answer, picture, frame.reflector, state.numbers[i]), renders + count
        distance, found = _reached(answer, frame.p, frame.reflector, state.enclosed)
        counters = {"renders": dr.opaque(mi.UInt32, renders)}
        doubt = answer.doubt if frame.doubts else None
        return Reflection(answer.L, distance, found, counters=counters, doubt=doubt), state

    def _seen(self, state: State, reflector: mi.Int32, besides: int | None) -> list[int]:
        """The mirrors, `besides` aside, that a picture shows; all of them if nothing is culled. Waits for the device."""
        count = len(state.planes)
        pixels = list(_counted(reflector, count)) if self.cull and count > 0 else [1] * count
        return [i for i in range(count) if i != besides and pixels[i] > 0]

    def _picture(self, state: State, view: View, i: int, reflector: mi.Int32, depth: int) -> tuple[Picture, int]:
        """What mirror i shows where `reflector`, as seen by `view`, is i, over `depth` mirrors; how many pictures that took."""
        mirrored = planes.reflected(view, state.planes[i])
        cut = planes.cut(mirrored, state.planes[i], state.world, reflector == state.numbers[i], self.clip, self.near_at)
        odd = (self.depth - depth) % 2 == 0
        world = replace(state.world, faces=state.flipped) if odd else state.world
        visibility = raster.rasterize(
            world.points if cut.points is None else cut.points,
            world.faces,
            world.face_count,
            cut.view,
            limit=cut.limit,
            drawn=_others(world.faces, world.face_count, state.parts[i]),
            cull="back",
            order=cut.order,
        )
        picture = _looked_at(world, visibility, state.surroundings, mirrored, cut, state.parts[0])
        renders = 1
        for j in self._seen(state, picture.reflector, i) if depth > 1 else ():
            deeper, count = self._picture(state, mirrored, j, picture.reflector, depth - 1)
            picture = _through(picture, deeper, mirrored, state.planes[j], state.numbers[j], state.metals)
            renders += count
        return picture, renders


def _nothing(count: int) -> Picture:
    """A picture of `count` pixels that show no mirror."""
    none, zeros = dr.zeros(mi.Bool, count), dr.zeros(mi.Float, count)
    return Picture(mi.Color3f(zeros), mi.Point3f(zeros), none, dr.full(mi.Int32, -1, count), none)


@frozen
def _reached(picture: Picture, p: mi.Point3f, reflector: mi.Int32, enclosed: tuple[bool, ...]) -> tuple[mi.Float, mi.Bool]:
    """How far from p what is shown is, and whether that is an answer."""
    distance = dr.select(picture.hit, dr.norm(picture.p - p), dr.inf)
    return distance, (reflector >= 0) & ~(passage.walled(enclosed, reflector) & ~picture.hit)


@frozen
def _flipped(faces: mi.UInt32, count: int) -> mi.UInt32:
    """Triangles wound the other way."""
    face = dr.gather(mi.Vector4u, faces, dr.arange(mi.UInt32, count))
    return packets.stored(mi.Vector4u(face.x, face.z, face.y, face.w), count)


@frozen
def _others(faces: mi.UInt32, count: int, part: mi.UInt32) -> mi.Bool:
    """Which triangles are not of a part."""
    return geometry.part_of(dr.gather(mi.Vector4u, faces, dr.arange(mi.UInt32, count))) != part


@frozen
def _counted(reflector: mi.Int32, count: int) -> mi.UInt32:
    """How many pixels show each of `count` mirrors."""
    totals = dr.zeros(mi.UInt32, count)
    dr.scatter_reduce(dr.ReduceOp.Add, totals, mi.UInt32(1), mi.UInt32(reflector), reflector >= 0)
    return totals


@frozen
def _looked_at(
    world: geometry.Geometry,
    visibility: mi.UInt32,
    around: surroundings.Surroundings,
    view: View,
    cut: planes.Cut,
    first: mi.UInt32,
) -> Picture:
    """The picture of a mirrored camera, other mirrors black. `first`: the first part that is a mirror."""
    lane = dr.arange(mi.UInt32, view.width * view.height)
    open_ = cut.limit > -dr.inf
    seen = shown.at(world, visibility, around, view, lane, open_, cut.points)
    reflector = dr.select(seen.hit & (seen.part >= first), mi.Int32(seen.part) - mi.Int32(first), -1)
    doubt = (reflector >= 0) | cut.beside
    if cut.points is not None:
        # What is interpolated where vertices were moved belongs elsewhere on the screen.
        p = mi.Vector4f(seen.p.x, seen.p.y, seen.p.z, 1)
        per_depth = dr.rcp(dr.dot(view.w, p))
        row = lane // view.width
        x = dr.dot(view.x, p) * per_depth - (mi.Float(lane - row * view.width) + 0.5)
        y = dr.dot(view.y, p) * per_depth - (mi.Float(row) + 0.5)
        doubt |= ~seen.hit | ~(dr.square(x) + dr.square(y) <= WRONG_PX**2)
    return Picture(seen.value, seen.p, seen.hit, reflector, open_ & doubt)


@frozen
def _beside(one: Picture, other: Picture, reflector: mi.Int32, number: mi.Int32) -> Picture:
    """The other picture where `reflector` is `number`, else the first."""
    own = reflector == number
    return Picture(
        dr.select(own, other.L, one.L),
        dr.select(own, other.p, one.p),
        dr.select(own, other.hit, one.hit),
        dr.select(own, other.reflector, one.reflector),
        dr.select(own, other.doubt, one.doubt),
    )


@frozen
def _through(picture: Picture, deeper: Picture, view: View, plane: planes.Plane, number: mi.Int32, metals: mi.Float) -> Picture:
    """The picture with what a mirror in it shows, dimmed by that mirror's reflectance."""
    own = picture.reflector == number
    d = dr.normalize(raster.ray_through(view, dr.arange(mi.UInt32, view.width * view.height)))
    share = optics.reflectance(metals, mi.UInt32(number), dr.clip(dr.abs(dr.dot(d, plane.normal)), 0, 1), own)
    L = dr.select(own, share * deeper.L, picture.L)
    return replace(picture, L=L, doubt=dr.select(own, deeper.doubt, picture.doubt))
