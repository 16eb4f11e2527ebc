"""One exact mirror bounce, traced with Embree through Mitsuba: the floor that the other methods can reach.

Every reflector pixel sends one ray along its mirror direction, from the rasterized hit and about the interpolated normal,
into a bounding volume hierarchy over the scene, and shows the baked radiance of what it hits. Other mirrors, and the
mirror itself, are hit and black: one bounce.

Assumes nothing; wrong only at grazing pixels whose interpolated normal sends the ray below their own facet. Costs a new
hierarchy whenever something moved.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.api import Frame, Method, Reflection
from benchharness.kernels import geometry, optics, raster
from benchharness.scene import Scene

RAY_EPSILON = 1e-4  # start of the ray above the surface, relative to the size of its coordinates


@dataclass
class State:
    """The scene's triangles as one Mitsuba mesh in a hierarchy, and their radiance for the hits."""

    scene: Any
    geometry: geometry.Geometry
    background: mi.Color3f


@dataclass(frozen=True)
class RayTraced(Method):
    paper: ClassVar[str] = "Embree (Wald et al. 2014)"

    def prepare(self, scene: Scene) -> State:
        lit = [(o.mesh.vertices, o.mesh.radiance, o.mesh.faces) for o in scene.objects]
        black = [(r.mesh.vertices, np.zeros_like(r.mesh.vertices), r.mesh.faces) for r in scene.reflectors]
        triangles = geometry.upload(lit + black)
        mesh = mi.Mesh("triangles", triangles.vertex_count, triangles.face_count)
        params = mi.traverse(mesh)
        params["faces"] = _triples(triangles.faces, triangles.face_count)
        poses = mi.Float(scene.poses(0.0).astype(np.float32).ravel())
        params["vertex_positions"] = _triples(_world(triangles, poses), triangles.vertex_count)
        params.update()
        background = mi.Color3f(scene.background)
        dr.make_opaque(background)
        return State(mi.load_dict({"type": "scene", "triangles": mesh}), triangles, background)

    def update(self, state: State, frame: Frame) -> State:
        params = mi.traverse(state.scene)
        world = _world(state.geometry, frame.poses)
        params["triangles.vertex_positions"] = _triples(world, state.geometry.vertex_count)
        params.update()
        return state

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
        value = raster.interpolate(state.geometry.attributes, face, mi.Vector3f(1 - u - w, u, w), found)
        L = dr.select(found, mi.Color3f(value.x, value.y, value.z), state.background)
        distance = dr.select(found, hit.t + RAY_EPSILON, dr.inf)
        return _spread(L, distance, lane, frame), state


def _world(triangles: geometry.Geometry, poses: mi.Float) -> mi.Float:
    return geometry.posed(triangles.points, triangles.vertex_count, poses)


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
