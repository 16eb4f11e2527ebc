"""Embree through Mitsuba as a rival: primary rays, the reflection of what they met, and whole frames of one bounce.

The same triangles, camera and baked light as the harness's own frames, in the hierarchies that `ray_traced` has
(`benchharness.kernels.hierarchy`), so that no ray pays for choosing between shapes and nothing that stands still is built
twice. Everything is recorded once and replayed, as the harness's own kernels are. `coherent` is Mitsuba's hint that
neighbouring rays take similar ways, which Embree answers with packets; off is what `ray_intersect` does when called without
it. No highlights.
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
from benchharness.kernels import geometry, hierarchy, mitsuba_mesh, optics, painting, raster, surroundings
from benchharness.kernels.frozen import frozen
from benchharness.render.frame import opaque
from benchharness.scene import Scene

RAY_EPSILON = 1e-4  # start of a reflected ray above the surface, relative to the size of its coordinates


@dataclass
class World:
    """A scene at one moment, for rays.

    hierarchies  what rays meet
    smooth       Mitsuba scene of one mesh with vertex normals, as at the time that it was built for
    radiance     4 floats per vertex: of what is lit, black for mirrors
    attributes   4 floats per vertex: radiance of what is lit, normal of mirrors in object space
    objects      parts from this number on are mirrors
    paint        what textures and light maps need; None for a scene without
    """

    hierarchies: hierarchy.Hierarchies
    smooth: Any
    radiance: mi.Float
    attributes: mi.Float
    surroundings: surroundings.Surroundings
    eta: list
    k: list
    objects: int
    paint: painting.Paint | None


def build(scene: Scene, time: float, way: hierarchy.Way = hierarchy.BODIES, *, robust: bool = True) -> World:
    """The baked scene at `time` seconds; `way` and `robust` as in `hierarchy`. Raises ValueError for normal maps,
    which its first hits know nothing of."""
    if any(mirror.normal_map is not None for mirror in scene.reflectors):
        raise ValueError(f"scene {scene.name} has normal maps; accepted here: scenes without")
    triangles, seen = geometry.of_scene(scene), geometry.of_scene_seen(scene)
    metals = [(r.eta, r.k) if r.eta is not None else None for r in scene.reflectors]
    return World(
        hierarchies=hierarchy.of_scene(scene, triangles, time, way, robust=robust),
        smooth=_smooth(scene, time, robust=robust),
        radiance=triangles.attributes,
        attributes=seen.attributes,
        surroundings=surroundings.of_scene(scene),
        eta=[None if metal is None else opaque(mi.Color3f, metal[0]) for metal in metals],
        k=[None if metal is None else opaque(mi.Color3f, metal[1]) for metal in metals],
        objects=len(scene.objects),
        paint=triangles.paint,
    )


def _smooth(scene: Scene, time: float, *, robust: bool) -> Any:
    meshes = [part.mesh.transformed(part.pose(time)) for part in scene.parts]
    starts = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    vertices, normals = (np.concatenate([getattr(m, name) for m in meshes]) for name in ("vertices", "normals"))
    faces = np.concatenate([m.faces + start for m, start in zip(meshes, starts, strict=False)])
    return mitsuba_mesh.scene(vertices, faces, normals, robust=robust)


def move(world: World, poses: mi.Float) -> World:
    """With the parts at `poses` (see `Frame.poses`), but for `smooth`."""
    return replace(world, hierarchies=hierarchy.moved(world.hierarchies, poses))


def _rays(view: View) -> mi.Ray3f:
    """Through the centres of all pixels, row major."""
    return mi.Ray3f(view.eye, dr.normalize(raster.ray_through(view, dr.arange(mi.UInt32, view.width * view.height))))


# Primary rays


@frozen
def interactions(world: World, view: View):
    """What `ray_intersect` returns when called with nothing but the rays, all of it."""
    return world.smooth.ray_intersect(_rays(view))


@frozen
def essentials(world: World, view: View):
    """Coherent rays; hit, point, face and shading normal, triangle and uv of the interaction and nothing else."""
    si = world.smooth.ray_intersect(_rays(view), +mi.RayFlags.All, True)
    return si.is_valid(), si.p, si.n, si.sh_frame.n, si.prim_index, si.uv


def gbuffer(world: World, view: View, like: Frame) -> Frame:
    """The frame `like`, with coherent rays in the rasterizer's place and all that it finds from them."""
    reflector, active, p, n, v, radiance = _gbuffer(world, view)
    pixels = mi.UInt32(dr.compress(active))
    return replace(like, reflector=reflector, active=active, pixels=pixels, p=p, n=n, v=v, radiance=radiance)


@frozen
def _gbuffer(world: World, view: View):
    return _first_hits(world, _rays(view), coherent=True)


def _first_hits(world: World, ray: mi.Ray3f, *, coherent: bool):
    """Reflector number, whether there is one, point, normal, direction to the eye and radiance, as in `Frame`."""
    hit = hierarchy.meet(world.hierarchies, ray, coherent=coherent)
    value = _value(world, world.attributes, hit)
    owner = geometry.part_of(hit.face)
    part = mi.Int32(owner) - world.objects
    active = hit.found & (part >= 0)
    n = dr.normalize(geometry.turned_of(value, world.hierarchies.poses, owner, active))
    n = dr.select(active, dr.select(dr.dot(n, ray.d) > 0, -n, n), 0)
    seen = dr.select(hit.found, mi.Color3f(value), surroundings.radiance(world.surroundings, ray.d, ~hit.found))
    p = dr.select(active, ray(hit.t), 0)
    return dr.select(active, part, -1), active, p, mi.Normal3f(n), -ray.d, dr.select(active, 0, seen)


def _value(world: World, values: mi.Float, hit: hierarchy.Meeting) -> mi.Vector3f:
    """Radiance or normal where rays met something."""
    packet = raster.interpolate(values, hit.face, hit.weights, hit.found)
    value = mi.Vector3f(packet.x, packet.y, packet.z)
    if world.paint is None:
        return value
    part = geometry.part_of(hit.face)
    return mi.Vector3f(painting.seen(world.paint, mi.Color3f(value), part, hit.face, hit.weights, hit.found))


# Secondary rays


def _mirrored(world: World, p: mi.Point3f, n: mi.Normal3f, v: mi.Vector3f, active: mi.Bool | bool, *, coherent: bool):
    """Radiance along the reflected rays and their lengths."""
    start = p + mi.Vector3f(n) * (RAY_EPSILON * (1 + dr.max(dr.abs(p))))
    ray = mi.Ray3f(start, optics.reflect(v, n))
    hit = hierarchy.meet(world.hierarchies, ray, active, coherent=coherent)
    value = _value(world, world.radiance, hit)
    far = surroundings.radiance(world.surroundings, ray.d, active & ~hit.found)
    return dr.select(hit.found, mi.Color3f(value), far), dr.select(hit.found, hit.t + RAY_EPSILON, dr.inf)


@frozen
def reflection(world: World, frame: Frame, *, coherent: bool):
    """Radiance and distance of every reflector pixel, one lane per pixel: what a method's `shade` answers."""
    p, n, v = (dr.gather(type(a), a, frame.pixels) for a in (frame.p, frame.n, frame.v))
    L, distance = _mirrored(world, p, n, v, True, coherent=coherent)
    full = [dr.zeros(mi.Float, frame.view.width * frame.view.height) for _ in range(4)]
    for target, value in zip(full, (L.x, L.y, L.z, distance), strict=True):
        dr.scatter(target, value, frame.pixels)
    return mi.Color3f(*full[:3]), full[3]


# Both


@frozen
def picture(world: World, view: View, *, coherent: bool) -> mi.Color3f:
    """A whole frame in one kernel: first hits, one bounce where they are mirrors, the mirrors' reflectance."""
    reflector, active, p, n, v, radiance = _first_hits(world, _rays(view), coherent=coherent)
    L, _ = _mirrored(world, p, n, v, active, coherent=coherent)
    cos_theta = dr.clip(dr.abs(dr.dot(mi.Vector3f(n), v)), 0, 1)
    for i, (eta, k) in enumerate(zip(world.eta, world.k, strict=True)):
        reflectance = mi.Color3f(1) if eta is None else optics.fresnel_conductor(cos_theta, eta, k)
        radiance = dr.select(reflector == i, reflectance * L, radiance)
    return radiance
