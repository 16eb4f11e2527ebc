"""One exact mirror bounce, traced with Embree through Mitsuba: the floor that the other methods can reach.

Every reflector pixel sends one ray along its mirror direction, from the rasterized hit and about the interpolated normal,
into a bounding volume hierarchy over the scene, and shows the baked radiance of what it hits. Other mirrors, and the
mirror itself, are hit and black: one bounce.

Assumes nothing; wrong only at grazing pixels whose interpolated normal sends the ray below their own facet. Costs a new
hierarchy whenever something moved.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.api import Frame, Method, Reflection
from benchharness.kernels import geometry, optics
from benchharness.scene import Scene

RAY_EPSILON = 1e-4  # start of the ray above the surface, relative to the size of its coordinates


@dataclass
class State:
    """The scene's triangles as one Mitsuba mesh in a hierarchy, and in object and world space for what is hit."""

    scene: Any
    geometry: geometry.Geometry
    world: geometry.Geometry
    background: mi.Color3f


@dataclass(frozen=True)
class RayTraced(Method):
    paper: ClassVar[str] = "Embree (Wald et al. 2014)"

    def prepare(self, scene: Scene) -> State:
        triangles = geometry.of_scene(scene)
        mesh = mi.Mesh("triangles", triangles.vertex_count, triangles.face_count)
        params = mi.traverse(mesh)
        params["faces"] = _triples(triangles.faces, triangles.face_count)
        world = geometry.placed(triangles, mi.Float(scene.poses(0.0).astype(np.float32).ravel()))
        params["vertex_positions"] = _triples(world.points, triangles.vertex_count)
        params.update()
        background = mi.Color3f(scene.background)
        dr.make_opaque(background)
        return State(mi.load_dict({"type": "scene", "triangles": mesh}), triangles, world, background)

    def update(self, state: State, frame: Frame) -> State:
        params = mi.traverse(state.scene)
        world = geometry.placed(state.geometry, frame.poses)
        params["triangles.vertex_positions"] = _triples(world.points, world.vertex_count)
        params.update()
        return replace(state, world=world)

    def shade(self, state: State, frame: Frame) -> tuple[Reflection, State]:
        lane = frame.pixels
        if dr.width(lane) == 0:  # no mirror in view
            return _spread(mi.Color3f(0), mi.Float(0), lane, frame), state
        p, n, v = (dr.gather(type(a), a, lane) for a in (frame.p, frame.n, frame.v))
        r = optics.reflect(v, n)
        start = p + mi.Vector3f(n) * (RAY_EPSILON * (1 + dr.max(dr.abs(p))))
        hit = state.scene.ray_intersect_preliminary(mi.Ray3f(start, r), coherent=True)
        found = hit.is_valid()
        face = dr.gather(mi.Vector4u, state.geometry.faces, hit.prim_index, found)
        u, w = hit.prim_uv.x, hit.prim_uv.y
        L = geometry.radiance(state.world, face, mi.Vector3f(1 - u - w, u, w), p, found)
        L = dr.select(found, L, state.background)
        distance = dr.select(found, hit.t + RAY_EPSILON, dr.inf)
        return _spread(L, distance, lane, frame), state


def _triples(packed, count: int):
    """3 values per element, as Mitsuba wants them, of 4 per element."""
    lane = dr.arange(mi.UInt32, 3 * count)
    return dr.gather(type(packed), packed, lane // 3 * 4 + lane % 3)


def _spread(L: mi.Color3f, distance: mi.Float, lane: mi.UInt32, frame: Frame) -> Reflection:
    """One lane per pixel out of one per reflector pixel."""
    count = frame.view.width * frame.view.height
    full = [dr.zeros(mi.Float, count) for _ in range(4)]
    for target, value in zip(full, (L.x, L.y, L.z, distance), strict=True):
        if dr.width(lane) > 0:
            dr.scatter(target, value, lane)
    return Reflection(mi.Color3f(*full[:3]), full[3], mi.Bool(frame.active), counters={"rays": mi.UInt32(frame.active)})
