"""Highlights: what glossy surfaces send from point lights to whoever looks, on top of their baked radiance.

A surface point V with unit normal n sends towards a viewer

    L = sum over lights of f(wi, wo) max(0, n·wi) v I / |light - V|²,    f = k_s (e + 8) / (8 π) max(0, n·h)^e

wi, wo are the unit directions from V to the light and to the viewer, h is halfway between them, v the baked visibility
of the light, I its intensity; nothing where n·wo <= 0. The viewer is the eye for what is seen directly and the reflection
point for what is seen in a mirror (Roger and Holzschuch 2006, 3.3.5): the highlight in a mirror is not the one that the
eye sees. `Scene.lights` and `Object.gloss` are what it is made from.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels import packets, raster
from benchharness.kernels.types import SceneLike

NEAREST = 1e-6  # metres; a light is never nearer to a surface than this


@dataclass
class Light:
    """A point light: position in metres, intensity in W/sr."""

    position: mi.Point3f
    intensity: mi.Color3f


@dataclass
class Shine:
    """What highlights need, beside points and triangles.

    normals     4 floats per vertex: unit normal, free; in the space of the points they come with
    visibility  4 floats per vertex: share of each light that is seen
    gloss       4 floats per part: k_s (e + 8) / (8 π) as RGB, and e; black for what has no gloss
    lights      at most 4
    """

    normals: mi.Float
    visibility: mi.Float
    gloss: mi.Float
    lights: list[Light]


def shine_of(scene: SceneLike) -> Shine | None:
    """What the highlights of a scene need, object space; None where it has none.

    Raises ValueError for a glossy object without visibility of the scene's lights: it has not been baked.
    """
    if not scene.glossy:
        return None
    normals, visibility, gloss = [], [], []
    for part in scene.parts:
        mesh, look = part.mesh, getattr(part, "gloss", None)  # a mirror has none
        shares = np.zeros((len(mesh.vertices), 4))
        numbers = [0.0, 0.0, 0.0, 1.0]  # an exponent of 1, as 0 to the power of 0 is not a number here
        if look is not None:
            shares[:, : len(scene.lights)] = part.seen(len(scene.lights))
            numbers = [*(np.asarray(look.specular) * (look.exponent + 8) / (8 * np.pi)), look.exponent]
        normals.append(packets.of_rows(mesh.normals))
        visibility.append(shares)
        gloss.append(np.array([numbers]))
    lights = [Light(mi.Point3f(*light.position), mi.Color3f(*light.intensity)) for light in scene.lights]
    dr.make_opaque(lights)
    return Shine(*(mi.Float(np.concatenate(a).astype(np.float32).ravel()) for a in (normals, visibility, gloss)), lights)


def highlight(
    lights: list[Light], V: mi.Point3f, n: mi.Vector3f, wo: mi.Vector3f, visible: mi.Vector4f, gloss: mi.Vector4f
) -> mi.Color3f:
    """Radiance of the highlights of all lights at V towards wo; `visible` as in `Shine`, `gloss` of the part."""
    total = mi.Color3f(0)
    for i, light in enumerate(lights):
        to_light = light.position - V
        distance2 = dr.maximum(dr.squared_norm(to_light), NEAREST**2)
        wi = to_light * dr.rsqrt(distance2)
        h = dr.normalize(wi + wo)
        cos_i = dr.dot(n, wi)
        lobe = dr.power(dr.maximum(dr.dot(n, h), 0), gloss.w) * cos_i * visible[i] * dr.rcp(distance2)
        total += dr.select((cos_i > 0) & (dr.dot(n, wo) > 0), mi.Color3f(gloss.xyz) * lobe * light.intensity, 0)
    return total


@dataclass
class Spot:
    """Points on triangles.

    points         packets of the vertices, in world space
    face, weights  as in `raster.interpolate`
    part           of each triangle
    """

    points: mi.Float
    face: mi.Vector4u
    part: mi.UInt32
    weights: mi.Vector3f


def seen_from(viewer: mi.Point3f, shine: Shine, spot: Spot, active: mi.Bool) -> mi.Color3f:
    """Radiance of the highlights towards `viewer`; 0 where not active. The normals of `shine` are in world space."""
    face, weights = spot.face, spot.weights
    gloss = dr.gather(mi.Vector4f, shine.gloss, spot.part, active)
    glossy = active & (dr.max(gloss.xyz) > 0)
    V = mi.Point3f(raster.interpolate(spot.points, face, weights, glossy).xyz)
    n = dr.normalize(raster.interpolate(shine.normals, face, weights, glossy).xyz)
    visible = raster.interpolate(shine.visibility, face, weights, glossy)
    L = highlight(shine.lights, V, n, dr.normalize(viewer - V), visible, gloss)
    return dr.select(glossy, L, 0)
