"""Embree through Mitsuba as a rival: primary rays, the reflection of what they met, and whole frames of one bounce.

The same triangles, camera and baked light as the harness's own frames, in one mesh, so that no ray pays for choosing
between shapes. Everything is recorded once and replayed (`dr.freeze`), as the harness's own kernels are. `coherent` is
Mitsuba's hint that neighbouring rays take similar ways, which Embree answers with packets; off is what `ray_intersect`
does when called without it.
"""

# pyright: reportArgumentType=false, reportOperatorIssue=false
# The stubs of Mitsuba and Dr.Jit know no points and vectors in one expression.

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.api import Frame, View
from benchharness.frame import opaque
from benchharness.kernels import geometry, optics, raster, surroundings
from benchharness.scene import Scene

RAY_EPSILON = 1e-4  # start of a reflected ray above the surface, relative to the size of its coordinates


@dataclass
class World:
    """A scene at one moment, for rays.

    plain, smooth  Mitsuba scenes of one mesh, without and with vertex normals
    triangles      object space; radiance of what is lit, black for mirrors
    attributes     4 floats per vertex: radiance of what is lit, world-space normal of mirrors
    objects        parts from this number on are mirrors
    """

    plain: Any
    smooth: Any
    triangles: geometry.Geometry
    attributes: mi.Float
    surroundings: surroundings.Surroundings
    eta: list
    k: list
    objects: int


def build(scene: Scene, time: float) -> World:
    """The baked scene at `time` seconds."""
    meshes = [part.mesh.transformed(part.pose(time)) for part in scene.parts]
    count = len(scene.objects)
    light = [np.asarray(m.radiance) if i < count else np.zeros_like(m.vertices) for i, m in enumerate(meshes)]
    values = [light[i] if i < count else np.asarray(m.normals) for i, m in enumerate(meshes)]
    here = geometry.upload([(m.vertices, a, m.faces) for m, a in zip(meshes, values, strict=True)])
    parts = zip(scene.parts, light, strict=True)
    triangles = geometry.upload([(part.mesh.vertices, a, part.mesh.faces) for part, a in parts])
    normals = mi.Float(np.concatenate([m.normals for m in meshes]).astype(np.float32).ravel())
    metals = [(r.eta, r.k) if r.eta is not None else None for r in scene.reflectors]
    return World(
        plain=_mitsuba(here),
        smooth=_mitsuba(here, normals),
        triangles=triangles,
        attributes=here.attributes,
        surroundings=surroundings.of_scene(scene),
        eta=[None if metal is None else opaque(mi.Color3f, metal[0]) for metal in metals],
        k=[None if metal is None else opaque(mi.Color3f, metal[1]) for metal in metals],
        objects=count,
    )


def _mitsuba(triangles: geometry.Geometry, normals: mi.Float | None = None) -> Any:
    mesh = mi.Mesh("triangles", triangles.vertex_count, triangles.face_count, has_vertex_normals=normals is not None)
    params = mi.traverse(mesh)
    params["vertex_positions"] = _triples(triangles.points, triangles.vertex_count)
    params["faces"] = _triples(triangles.faces, triangles.face_count)
    if normals is not None:
        params["vertex_normals"] = normals
    params.update()
    return mi.load_dict({"type": "scene", "triangles": mesh})


def _triples(packed: Any, count: int) -> Any:
    """3 values per element, as Mitsuba wants them, of 4 per element."""
    lane = dr.arange(mi.UInt32, 3 * count)
    return dr.gather(type(packed), packed, lane // 3 * 4 + lane % 3)


def move(world: World, poses: mi.Float) -> None:
    """Poses the parts anew (see `Frame.poses`) and has the hierarchy of `plain` built again.

    Mitsuba builds the whole of it, even where what moves is a mesh of its own: it takes as long (tried), and has no refit.
    """
    params = mi.traverse(world.plain)
    points = geometry.posed(world.triangles.points, world.triangles.vertex_count, poses)
    params["triangles.vertex_positions"] = _triples(points, world.triangles.vertex_count)
    params.update()


def _rays(view: View) -> mi.Ray3f:
    """Through the centres of all pixels, row major."""
    return mi.Ray3f(view.eye, dr.normalize(raster.ray_through(view, dr.arange(mi.UInt32, view.width * view.height))))


# Primary rays


@dr.freeze
def interactions(world: World, view: View):
    """What `ray_intersect` returns when called with nothing but the rays, all of it."""
    return world.smooth.ray_intersect(_rays(view))


@dr.freeze
def essentials(world: World, view: View):
    """Coherent rays; hit, point, face and shading normal, triangle and uv of the interaction and nothing else."""
    si = world.smooth.ray_intersect(_rays(view), +mi.RayFlags.All, True)
    return si.is_valid(), si.p, si.n, si.sh_frame.n, si.prim_index, si.uv


def gbuffer(world: World, view: View, like: Frame) -> Frame:
    """The frame `like`, with coherent rays in the rasterizer's place and all that it finds from them."""
    reflector, active, p, n, v, radiance = _gbuffer(world, view)
    pixels = mi.UInt32(dr.compress(active))
    return replace(like, reflector=reflector, active=active, pixels=pixels, p=p, n=n, v=v, radiance=radiance)


@dr.freeze
def _gbuffer(world: World, view: View):
    return _first_hits(world, _rays(view), True)


def _first_hits(world: World, ray: mi.Ray3f, coherent: bool):
    """Reflector number, whether there is one, point, normal, direction to the eye and radiance, as in `Frame`."""
    hit = world.plain.ray_intersect_preliminary(ray, coherent=coherent)
    value, face = _interpolated(world.attributes, world.triangles.faces, hit)
    part = mi.Int32(geometry.part_of(face)) - world.objects
    active = hit.is_valid() & (part >= 0)
    n = dr.normalize(value)
    n = dr.select(active, dr.select(dr.dot(n, ray.d) > 0, -n, n), 0)
    found = hit.is_valid()
    seen = dr.select(found, mi.Color3f(value), surroundings.radiance(world.surroundings, ray.d, ~found))
    p = dr.select(active, ray(hit.t), 0)
    return dr.select(active, part, -1), active, p, mi.Normal3f(n), -ray.d, dr.select(active, 0, seen)


def _interpolated(attributes: mi.Float, faces: mi.UInt32, hit: Any) -> tuple[mi.Vector3f, mi.Vector4u]:
    found = hit.is_valid()
    face = dr.gather(mi.Vector4u, faces, hit.prim_index, found)
    u, w = hit.prim_uv.x, hit.prim_uv.y
    value = raster.interpolate(attributes, face, mi.Vector3f(1 - u - w, u, w), found)
    return mi.Vector3f(value.x, value.y, value.z), face


# Secondary rays


def _mirrored(world: World, p: mi.Point3f, n: mi.Normal3f, v: mi.Vector3f, coherent: bool, active: mi.Bool | bool):
    """Radiance along the reflected rays and their lengths."""
    start = p + mi.Vector3f(n) * (RAY_EPSILON * (1 + dr.max(dr.abs(p))))
    ray = mi.Ray3f(start, optics.reflect(v, n))
    hit = world.plain.ray_intersect_preliminary(ray, coherent=coherent, active=active)
    found = hit.is_valid()
    value, _ = _interpolated(world.triangles.attributes, world.triangles.faces, hit)
    far = surroundings.radiance(world.surroundings, ray.d, active & ~found)
    return dr.select(found, mi.Color3f(value), far), dr.select(found, hit.t + RAY_EPSILON, dr.inf)


@dr.freeze
def reflection(world: World, frame: Frame, coherent: bool):
    """Radiance and distance of every reflector pixel, one lane per pixel: what a method's `shade` answers."""
    p, n, v = (dr.gather(type(a), a, frame.pixels) for a in (frame.p, frame.n, frame.v))
    L, distance = _mirrored(world, p, n, v, coherent, True)
    full = [dr.zeros(mi.Float, frame.view.width * frame.view.height) for _ in range(4)]
    for target, value in zip(full, (L.x, L.y, L.z, distance), strict=True):
        dr.scatter(target, value, frame.pixels)
    return mi.Color3f(*full[:3]), full[3]


# Both


@dr.freeze
def picture(world: World, view: View, coherent: bool) -> mi.Color3f:
    """A whole frame in one kernel: first hits, one bounce where they are mirrors, the mirrors' reflectance."""
    reflector, active, p, n, v, radiance = _first_hits(world, _rays(view), coherent)
    L, _ = _mirrored(world, p, n, v, coherent, active)
    cos_theta = dr.clip(dr.abs(dr.dot(mi.Vector3f(n), v)), 0, 1)
    for i, (eta, k) in enumerate(zip(world.eta, world.k, strict=True)):
        reflectance = mi.Color3f(1) if eta is None else optics.fresnel_conductor(cos_theta, eta, k)
        radiance = dr.select(reflector == i, reflectance * L, radiance)
    return radiance
