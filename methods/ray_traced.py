"""Exact mirror bounces, traced with Embree through Mitsuba: the floor that the other methods can reach.

Every reflector pixel sends one ray along its mirror direction, from the rasterized hit and about the interpolated normal,
into a bounding volume hierarchy over the scene, and shows the baked radiance of what it hits, or the surroundings. Other
mirrors, and the mirror itself, are hit and black: one bounce. With more `bounces` the ray goes on from there, about that
mirror's interpolated normal, turned by its normal map if it has one, and dimmed by its reflectance; the last mirror is black.
`distance` is the first ray's.

Doubted: rays that end at a mirror, which goes on reflecting.

Assumes rigid motion; wrong only at grazing pixels whose interpolated normal sends the ray below their own facet. What moves
costs nothing but a hierarchy of its own, which rays are taken into (`benchharness.kernels.hierarchy`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import drjit as dr
import mitsuba as mi
from pydantic import Field

from benchharness.api import Frame, Knob, Method, Reflection, View
from benchharness.kernels import (
    geometry,
    hierarchy,
    lighting,
    normalmap,
    optics,
    painting,
    passage,
    pixels,
    raster,
    surroundings,
)
from benchharness.kernels.frozen import frozen
from benchharness.scene import Scene

RAY_EPSILON = 1e-4  # start of the ray above the surface, relative to the size of its coordinates


@dataclass
class Mirrors:
    """What a ray needs to go on from a mirror.

    normals  4 floats per vertex, object space; of no meaning for objects
    metals   as `optics.metals_of` has them
    normal_maps  None for a scene without
    """

    normals: mi.Float
    metals: mi.Float
    normal_maps: painting.Paint | None


@dataclass
class State:
    """What rays meet and what that sends.

    triangles  object space
    world      the same in world space where highlights or normal maps need it, else `triangles`
    mirrors    for more than one bounce; else None
    objects    number of the first part that is a mirror
    enclosed   what `Scene.enclosed` says
    """

    hierarchies: hierarchy.Hierarchies
    triangles: geometry.Geometry
    world: geometry.Geometry
    surroundings: surroundings.Surroundings
    mirrors: Mirrors | None
    objects: mi.UInt32
    enclosed: tuple[bool, ...]


@dataclass(frozen=True)
class RayTraced(Method):
    """
    bounces      mirrors that a ray is followed over; a reference of `max_depth` d shows d - 1
    robust       no ray slips through the edge between two triangles; False: as Embree does by default, which is faster
    hierarchies  "bodies": one for all that stands still, and for each rigid body that moves one that goes with it;
                 "anew": one for everything, built again when anything moved, as shapes that change would need
    """

    bounces: Annotated[int, Field(ge=1, le=8)] = 1
    robust: bool = True
    hierarchies: hierarchy.Way = hierarchy.BODIES

    knobs: ClassVar[tuple[Knob, ...]] = (Knob("bounces", (1, 2, 3, 4), reference={"max_depth": 5}),)
    family: ClassVar[str] = "traced rays"
    paper: ClassVar[str] = "Embree (Wald et al. 2014)"

    def prepare(self, scene: Scene) -> State:
        triangles = geometry.of_scene(scene)
        trees = hierarchy.of_scene(scene, triangles, 0.0, self.hierarchies, robust=self.robust)
        mirrors = None
        if self.bounces > 1:
            seen = geometry.of_scene_seen(scene)
            mirrors = Mirrors(seen.attributes, optics.metals_of(scene), seen.normal_maps)
        objects = dr.opaque(mi.UInt32, len(scene.objects))
        world = _placed(triangles, mirrors, trees.poses)
        return State(trees, triangles, world, surroundings.of_scene(scene), mirrors, objects, scene.enclosed)

    def update(self, state: State, frame: Frame) -> State:
        trees = hierarchy.moved(state.hierarchies, frame.poses)
        return replace(state, hierarchies=trees, world=_placed(state.triangles, state.mirrors, frame.poses))

    def shade(self, state: State, frame: Frame) -> tuple[Reflection, State]:
        lane = frame.pixels
        if dr.width(lane) == 0:  # no mirror in view
            empty = dr.zeros(mi.Float, dr.width(frame.active))
            nothing = Reflection(mi.Color3f(empty), empty, mi.Bool(frame.active), counters={"rays": mi.UInt32(frame.active)})
            return nothing, state
        seen = Seen(frame.p, frame.n, frame.v, frame.active)
        L, distance, doubt, rays = _traced(state, seen, lane, frame.view, self.bounces)
        found = frame.active & ~(passage.walled(state.enclosed, frame.reflector) & (distance == dr.inf))
        return Reflection(L, distance, found, counters={"rays": rays}, doubt=doubt if frame.doubts else None), state


@dataclass
class Seen:
    """The first hit of every pixel, as `Frame` has it."""

    p: mi.Point3f
    n: mi.Normal3f
    v: mi.Vector3f
    active: mi.Bool


@frozen
def _traced(
    state: State, seen: Seen, lane: mi.UInt32, view: View, bounces: int
) -> tuple[mi.Color3f, mi.Float, mi.Bool, mi.UInt32]:
    """Radiance, distance, whether the last ray ends at a mirror, and the number of rays, of all pixels from those of `lane`."""
    p, n, v = (dr.gather(type(a), a, lane) for a in (seen.p, seen.n, seen.v))
    ray = _from(p, n, optics.reflect(v, n))
    hit = hierarchy.meet(state.hierarchies, ray)
    L = _arriving(state, hit, p, ray.d, mi.Bool(True))
    distance = dr.select(hit.found, hit.t + RAY_EPSILON, dr.inf)
    ends, rays = _at_mirror(state, hit), mi.UInt32(seen.active)
    if state.mirrors is not None:
        further, count, ends = _further(state, state.mirrors, ray, hit, ends, bounces)
        L += further
        dr.scatter_add(rays, count, lane)
    x, y, z, length, doubt = pixels.spread([L.x, L.y, L.z, distance, ends], lane, view)
    return mi.Color3f(x, y, z), length, doubt, rays


def _further(
    state: State, mirrors: Mirrors, ray: mi.Ray3f, hit: hierarchy.Meeting, active: mi.Bool, bounces: int
) -> tuple[mi.Color3f, mi.UInt32, mi.Bool]:
    """What a first reflected ray shows over further mirrors, how many rays that took, and where the last ends at a mirror.

    active  where the first ray ends at one
    """
    L, through, count = mi.Color3f(0), mi.Color3f(1), mi.UInt32(0)
    for _ in range(bounces - 1):
        part = geometry.part_of(hit.face)
        p, v = ray(hit.t), -ray.d
        n = raster.interpolate(mirrors.normals, hit.face, hit.weights, active).xyz
        n = dr.normalize(geometry.turned_of(n, state.hierarchies.poses, part, active))
        if mirrors.normal_maps is not None:
            spot = lighting.Spot(state.world.points, hit.face, part, hit.weights)
            n = normalmap.turned(mirrors.normal_maps, spot, n, v, active)
        n = dr.select(dr.dot(n, v) < 0, -n, n)
        through *= optics.reflectance(mirrors.metals, part - state.objects, dr.clip(dr.dot(n, v), 0, 1), active)
        ray = _from(p, n, optics.reflect(v, n))
        hit = hierarchy.meet(state.hierarchies, ray, active)
        L += dr.select(active, through * _arriving(state, hit, p, ray.d, active), 0)
        count += dr.select(active, mi.UInt32(1), 0)
        active &= _at_mirror(state, hit)
    return L, count, active


def _from(p: mi.Point3f, n: mi.Vector3f | mi.Normal3f, d: mi.Vector3f) -> mi.Ray3f:
    """The ray along d from just above a surface at p."""
    return mi.Ray3f(p + mi.Vector3f(n) * (RAY_EPSILON * (1 + dr.max(dr.abs(p)))), d)


def _arriving(state: State, hit: hierarchy.Meeting, p: mi.Point3f, d: mi.Vector3f, active: mi.Bool) -> mi.Color3f:
    """Radiance at p from direction d, where `hit` is; black where that is a mirror."""
    L = geometry.radiance(state.world, hit.face, hit.weights, p, hit.found)
    return dr.select(hit.found, L, surroundings.radiance(state.surroundings, d, active & ~hit.found))


def _at_mirror(state: State, hit: hierarchy.Meeting) -> mi.Bool:
    """Where a ray has met a mirror."""
    return hit.found & (geometry.part_of(hit.face) >= state.objects)


def _placed(triangles: geometry.Geometry, mirrors: Mirrors | None, poses: mi.Float) -> geometry.Geometry:
    """In world space where anything but the hierarchies needs it."""
    mapped = mirrors is not None and mirrors.normal_maps is not None
    return triangles if triangles.shine is None and not mapped else geometry.placed(triangles, poses)
