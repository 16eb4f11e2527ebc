"""Our normal maps in Mitsuba: a mirror whose shading frame is turned point by point.

Mitsuba's own `normalmap` is black where a ray would go below the surface, flips normals that are turned away, and has its
bitangent to the left of the tangent however v runs. The tangents here are Mitsuba's, from a mesh with texture coordinates; all
else is written against its interfaces, and shares nothing with `benchharness.kernels`. `benchharness.modelling.normalmap` says
what is meant.
"""

# pyright: reportArgumentType=false, reportCallIssue=false, reportAttributeAccessIssue=false, reportOperatorIssue=false
# The type stubs of Mitsuba and Dr.Jit know neither NumPy arguments nor points and vectors in one expression.

from __future__ import annotations

from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.modelling import normalmap
from benchharness.render import mitsuba_texture
from benchharness.scene import Mesh, Texture

UNTURNED = "face_without_tangent"
SOURCES = (__file__, mitsuba_texture.__file__, normalmap.__file__)


def bsdf(mirror: mi.BSDF, mesh: Mesh, map: Texture) -> mi.BSDF:
    """A smooth mirror, on both sides, with a normal map; the shape of `mesh` has uv, and what `describe` gives it."""
    white = mi.load_dict({"type": "srgb", "color": mi.ScalarColor3f(1.0), "unbounded": True})
    picture = mitsuba_texture.coloured(white, [_carrying(mesh, map)])

    class Turned(mi.BSDF):
        def __init__(self) -> None:
            super().__init__(mi.Properties())
            sides = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
            self.m_components = [mi.BSDFFlags.DeltaReflection | sides]
            self.m_flags = self.m_components[0]

        def sample(self, ctx, si, sample1, sample2, active=True):
            turned = mi.SurfaceInteraction3f(si)
            turned.sh_frame = mi.Frame3f(_normal(picture, si, active))
            turned.wi = turned.to_local(si.to_world(si.wi))
            bs, weight = mirror.sample(ctx, turned, sample1, sample2, active)
            bs.wo = si.to_local(turned.to_world(bs.wo))
            return bs, weight

        def eval(self, ctx, si, wo, active=True):
            return mi.Color3f(0)

        def pdf(self, ctx, si, wo, active=True):
            return mi.Float(0)

        def eval_pdf(self, ctx, si, wo, active=True):
            return mi.Color3f(0), mi.Float(0)

        def to_string(self) -> str:
            return f"Turned[{mirror}]"

    return Turned()


def describe(shape: mi.Mesh, mesh: Mesh, map: Texture) -> None:
    """Gives the shape of a mirror's mesh what `bsdf` reads beside texture coordinates."""
    assert mesh.uv is not None
    mitsuba_texture.describe(shape, [_carrying(mesh, map)])
    shape.add_attribute(UNTURNED, 1, np.float32(normalmap.without_tangent(mesh.uv, mesh.faces)))


def reflected(si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Vector3f:
    """The direction in which mirrors send on the ray that met them; of no meaning for other surfaces."""
    bs, _ = si.bsdf().sample(mi.BSDFContext(), si, mi.Float(0.5), mi.Point2f(0.5), active)
    return si.to_world(bs.wo)


def _carrying(mesh: Mesh, map: Texture) -> Mesh:
    return replace(mesh, texture=map, emission=(0.0, 0.0, 0.0))


def _normal(picture: mi.Texture, si: mi.SurfaceInteraction3f, active) -> mi.Normal3f:
    """What the ray that met a surface is reflected about, on the side that it came from."""
    n, wi = mi.Vector3f(si.sh_frame.n), si.to_world(si.wi)
    s = dr.normalize(dr.fma(n, -dr.dot(n, si.dp_du), si.dp_du))
    t = dr.cross(n, s) * dr.sign(dr.dot(dr.cross(n, s), si.dp_dv))
    value = picture.eval(si, active)
    m = dr.normalize(mi.Vector3f(value.x, value.y, value.z) - 0.5)
    plain = si.shape.eval_attribute_1(UNTURNED, si, active) > 0.5
    N = dr.select(plain, n, m.x * s + m.y * t + m.z * n)
    wo = 2 * dr.dot(N, wi) * N - wi
    # What would leave on the other side of the triangle than that from which wi comes.
    g, wi_g = mi.Vector3f(si.n), dr.dot(si.n, wi)
    height = dr.mulsign(dr.dot(g, wo), wi_g)
    raised = wo - 2 * dr.dot(g, wo) * g
    facing = dr.select(dr.dot(N, wi) < 0, -N, N)
    return mi.Normal3f(dr.select((height < 0) & ~plain, dr.normalize(wi + raised), facing))
