"""Exact mirror bounces, traced with Embree through Mitsuba: the floor that the other methods can reach.

Every reflector pixel sends one ray along its mirror direction, from the rasterized hit and about the interpolated normal,
into a bounding volume hierarchy over the scene, and shows the baked radiance of what it hits, or the surroundings. Other
mirrors, and the mirror itself, are hit and black: one bounce. With more `bounces` the ray goes on from there, about that
mirror's interpolated normal and dimmed by its reflectance; the last mirror is black. `distance` is the first ray's.

Doubted: rays that end at a mirror, which goes on reflecting.

Assumes nothing; wrong only at grazing pixels whose interpolated normal sends the ray below their own facet. Costs a new
hierarchy whenever something moved.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import drjit as dr
import mitsuba as mi
import numpy as np
from pydantic import Field

from benchharness.api import Frame, Method, Reflection
from benchharness.kernels import geometry, optics, passage, pixels, raster, surroundings
from benchharness.scene import Scene

RAY_EPSILON = 1e-4  # start of the ray above the surface, relative to the size of its coordinates


@dataclass
class Mirrors:
    """What a ray needs to go on from a mirror.

    normals  4 floats per vertex, object space; of no meaning for objects
    turned   the same in world space
    metals   as `optics.metals_of` has them
    """

    normals: mi.Float
    turned: mi.Float
    metals: mi.Float


@dataclass
class State:
    """The scene's triangles as one Mitsuba mesh in a hierarchy, and in object and world space for what is hit; `mirrors`
    only for more than one bounce. Parts from `objects` on are mirrors; `enclosed`: what `Scene.enclosed` says."""

    scene: Any
    geometry: geometry.Geometry
    world: geometry.Geometry
    surroundings: surroundings.Surroundings
    mirrors: Mirrors | None
    objects: mi.UInt32
    enclosed: tuple[bool, ...]


@dataclass(frozen=True)
class RayTraced(Method):
    """
    bounces  mirrors that a ray is followed over; a reference of `max_depth` d shows d - 1
    """

    bounces: Annotated[int, Field(ge=1, le=8)] = 1

    paper: ClassVar[str] = "Embree (Wald et al. 2014)"

    def prepare(self, scene: Scene) -> State:
        triangles = geometry.of_scene(scene)
        mesh = mi.Mesh("triangles", triangles.vertex_count, triangles.face_count)
        params = mi.traverse(mesh)
        params["faces"] = _triples(triangles.faces, triangles.face_count)
        poses = mi.Float(scene.poses(0.0).astype(np.float32).ravel())
        world = geometry.placed(triangles, poses)
        params["vertex_positions"] = _triples(world.points, triangles.vertex_count)
        params.update()
        mirrors = _turned(_mirrors(scene), triangles, poses) if self.bounces > 1 else None
        traced = mi.load_dict({"type": "scene", "triangles": mesh})
        objects = dr.opaque(mi.UInt32, len(scene.objects))
        return State(traced, triangles, world, surroundings.of_scene(scene), mirrors, objects, scene.enclosed)

    def update(self, state: State, frame: Frame) -> State:
        params = mi.traverse(state.scene)
        world = geometry.placed(state.geometry, frame.poses)
        params["triangles.vertex_positions"] = _triples(world.points, world.vertex_count)
        params.update()
        mirrors = None if state.mirrors is None else _turned(state.mirrors, state.geometry, frame.poses)
        return replace(state, world=world, mirrors=mirrors)

    def shade(self, state: State, frame: Frame) -> tuple[Reflection, State]:
        lane = frame.pixels
        rays = mi.UInt32(frame.active)
        if dr.width(lane) == 0:  # no mirror in view
            empty = dr.zeros(mi.Float, dr.width(frame.active))
            nothing = Reflection(mi.Color3f(empty), empty, mi.Bool(frame.active), counters={"rays": rays})
            return nothing, state
        p, n, v = (dr.gather(type(a), a, lane) for a in (frame.p, frame.n, frame.v))
        r = optics.reflect(v, n)
        ray = _from(p, n, r)
        # Embree's traversal for coherent rays misses what rays parting from a curved mirror meet.
        hit = state.scene.ray_intersect_preliminary(ray, coherent=False)
        L, face, weights = _arriving(state, hit, p, r, True)
        distance = dr.select(hit.is_valid(), hit.t + RAY_EPSILON, dr.inf)
        ends = hit.is_valid() & (geometry.part_of(face) >= state.objects)
        if state.mirrors is not None:
            further, count, ends = self._further(state, state.mirrors, ray, hit, face, weights, ends)
            L += further
            dr.scatter_add(rays, count, lane)
        x, y, z, length, doubt = pixels.spread([L.x, L.y, L.z, distance, ends], frame)
        leaks = passage.walled(state.enclosed, frame.reflector) & (length == dr.inf)
        return Reflection(
            mi.Color3f(x, y, z), length, frame.active & ~leaks, counters={"rays": rays}, doubt=doubt if frame.doubts else None
        ), state

    def _further(self, state: State, mirrors: Mirrors, ray, hit, face, weights, active):
        """What a first reflected ray shows over further mirrors, how many rays that took, and where the last ends at a mirror.

        active  where the first ray ends at one
        """
        L, through, count = mi.Color3f(0), mi.Color3f(1), mi.UInt32(0)
        for _ in range(self.bounces - 1):
            part = geometry.part_of(face)
            p, v = ray(hit.t), -ray.d
            n = dr.normalize(raster.interpolate(mirrors.turned, face, weights, active).xyz)
            n = dr.select(dr.dot(n, v) < 0, -n, n)
            through *= optics.reflectance(mirrors.metals, part - state.objects, dr.clip(dr.dot(n, v), 0, 1), active)
            ray = _from(p, n, optics.reflect(v, n))
            hit = state.scene.ray_intersect_preliminary(ray, active=active)
            arriving, face, weights = _arriving(state, hit, p, ray.d, active)
            L += dr.select(active, through * arriving, 0)
            count += dr.select(active, mi.UInt32(1), 0)
            active &= hit.is_valid() & (geometry.part_of(face) >= state.objects)
        return L, count, active


def _from(p: mi.Point3f, n, d: mi.Vector3f) -> mi.Ray3f:
    """The ray along d from just above a surface at p."""
    return mi.Ray3f(p + mi.Vector3f(n) * (RAY_EPSILON * (1 + dr.max(dr.abs(p)))), d)


def _arriving(state: State, hit, p: mi.Point3f, d: mi.Vector3f, active) -> tuple[mi.Color3f, mi.Vector4u, mi.Vector3f]:
    """Radiance at p from direction d, black where that is a mirror; the triangle that was hit, and where on it."""
    found = hit.is_valid()
    face = dr.gather(mi.Vector4u, state.geometry.faces, hit.prim_index, found)
    u, w = hit.prim_uv.x, hit.prim_uv.y
    weights = mi.Vector3f(1 - u - w, u, w)
    L = geometry.radiance(state.world, face, weights, p, found)
    return dr.select(found, L, surroundings.radiance(state.surroundings, d, active & ~found)), face, weights


def _mirrors(scene: Scene) -> Mirrors:
    normals = geometry.of_scene_seen(scene).attributes
    return Mirrors(normals, normals, optics.metals_of(scene))


def _turned(mirrors: Mirrors, triangles: geometry.Geometry, poses: mi.Float) -> Mirrors:
    """With the normals as the parts stand."""
    return replace(mirrors, turned=geometry.turned(triangles.points, mirrors.normals, triangles.vertex_count, poses))


def _triples(packed, count: int):
    """3 values per element, as Mitsuba wants them, of 4 per element."""
    lane = dr.arange(mi.UInt32, 3 * count)
    return dr.gather(type(packed), packed, lane // 3 * 4 + lane % 3)
