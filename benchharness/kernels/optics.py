"""Mirror optics in closed form. Directions are unit vectors in world space unless said; w points away from the surface."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels.types import SceneLike


def reflect(w: mi.Vector3f, n: mi.Normal3f) -> mi.Vector3f:
    """Mirror direction of w about the unit normal n: both point away from the surface."""
    return 2 * dr.dot(w, n) * mi.Vector3f(n) - w


def half_vector(p: mi.Point3f, eye: mi.Point3f, vertex: mi.Point3f) -> tuple[mi.Vector3f, mi.Bool]:
    """Unit bisector at p of the directions to the eye and to the vertex.

    Second value: False where p lies between them and no bisector exists; the vector is then (0, 0, 0).
    """
    s = dr.normalize(eye - p) + dr.normalize(vertex - p)
    length = dr.norm(s)
    defined = length >= 1e-6
    return dr.select(defined, s * dr.rcp(dr.maximum(length, 1e-6)), 0), defined


def mirrored(vertex: mi.Point3f, p: mi.Point3f, n: mi.Normal3f) -> mi.Point3f:
    """Mirror image in the plane through p with unit normal n.

    Estalella et al. 2006 print their equation (1) with the opposite sign: R + 2N((V-R).N) - (V-R) turns V half around N
    and leaves it behind the plane.
    """
    return vertex - 2 * dr.dot(vertex - p, n) * mi.Vector3f(n)


def on_ray(vertex: mi.Point3f, p: mi.Point3f, eye: mi.Point3f) -> mi.Point3f:
    """Virtual image on the eye's ray through p, as far behind p as the vertex is away from it."""
    return p + dr.normalize(p - eye) * dr.norm(vertex - p)


def fresnel_conductor(cos_theta: mi.Float, eta: mi.Color3f, k: mi.Color3f) -> mi.Color3f:
    """Unpolarised reflectance of a conductor with index eta + i k in vacuum at incidence cos_theta >= 0.

    Born and Wolf, Principles of Optics, 14.4; exact.
    """
    cos2 = dr.square(cos_theta)
    sin2 = 1 - cos2
    t0 = dr.square(eta) - dr.square(k) - sin2
    a2b2 = dr.sqrt(dr.maximum(dr.square(t0) + 4 * dr.square(eta) * dr.square(k), 0))
    a = dr.sqrt(dr.maximum(0.5 * (a2b2 + t0), 0))
    s = (a2b2 + cos2 - 2 * cos_theta * a) / (a2b2 + cos2 + 2 * cos_theta * a)
    t1, t2 = cos2 * a2b2 + dr.square(sin2), 2 * cos_theta * a * sin2
    return 0.5 * s * (1 + (t1 - t2) / (t1 + t2))


def metals_of(scene: SceneLike) -> mi.Float:
    """What the mirrors of a `benchharness.scene.Scene` are made of, 8 floats each: eta, 1 (0 for an ideal mirror), k, 0."""
    rows = [[0.0] * 8 if r.eta is None or r.k is None else [*r.eta, 1.0, *r.k, 0.0] for r in scene.reflectors]
    return mi.Float(np.array(rows, np.float32).ravel())


def reflectance(metals: mi.Float, mirror: mi.UInt32, cos_theta: mi.Float, active: mi.Bool) -> mi.Color3f:
    """The reflectance of a mirror at incidence cos_theta >= 0; `metals` as `metals_of` has them."""
    eta, k = (dr.gather(mi.Vector4f, metals, mirror * 2 + i, active) for i in (0, 1))
    metal = fresnel_conductor(cos_theta, mi.Color3f(eta.xyz), mi.Color3f(k.xyz))
    return dr.select(eta.w > 0, metal, 1)
