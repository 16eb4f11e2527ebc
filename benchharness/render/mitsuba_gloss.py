"""Gloss in Mitsuba, which has no Blinn-Phong lobe of its own: a BSDF for full transport, a radiance for baked lighting.

Both are written against Mitsuba's interfaces and share nothing with `benchharness.kernels`. `Gloss` has the formula.
"""

# pyright: reportArgumentType=false, reportCallIssue=false, reportAttributeAccessIssue=false, reportOperatorIssue=false
# The type stubs of Mitsuba and Dr.Jit know neither NumPy arguments nor points and vectors in one expression.

from __future__ import annotations

from collections.abc import Sequence

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.scene import Gloss, PointLight


def _lobe(gloss: Gloss, cos_h) -> mi.Color3f:
    scale = (gloss.exponent + 8) / (8 * dr.pi)
    return mi.Color3f(*gloss.specular) * (scale * dr.power(dr.maximum(cos_h, 0), gloss.exponent))


def bsdf(gloss: Gloss, albedo: mi.Texture) -> mi.BSDF:
    """A diffuse surface with gloss, seen from its front.

    Sampled with equal chances by the cosine and by a half vector of density (e + 1) / (2 π) (n·h)^e.
    """

    class Glossy(mi.BSDF):
        def __init__(self) -> None:
            super().__init__(mi.Properties())
            front = mi.BSDFFlags.FrontSide
            self.m_components = [mi.BSDFFlags.DiffuseReflection | front, mi.BSDFFlags.GlossyReflection | front]
            self.m_flags = self.m_components[0] | self.m_components[1]

        def eval_pdf(self, ctx, si, wo, active=True):
            cos_i, cos_o = mi.Frame3f.cos_theta(si.wi), mi.Frame3f.cos_theta(wo)
            h = dr.normalize(si.wi + wo)
            cos_h = mi.Frame3f.cos_theta(h)
            f = albedo.eval(si, active) * dr.inv_pi + _lobe(gloss, cos_h)
            of_half = (gloss.exponent + 1) / (2 * dr.pi) * dr.power(dr.maximum(cos_h, 0), gloss.exponent)
            pdf = 0.5 * (cos_o * dr.inv_pi + of_half / (4 * dr.dot(si.wi, h)))
            active = active & (cos_i > 0) & (cos_o > 0)
            return dr.select(active, f * cos_o, 0), dr.select(active, pdf, 0)

        def eval(self, ctx, si, wo, active=True):
            return self.eval_pdf(ctx, si, wo, active)[0]

        def pdf(self, ctx, si, wo, active=True):
            return self.eval_pdf(ctx, si, wo, active)[1]

        def sample(self, ctx, si, sample1, sample2, active=True):
            cos_h = dr.power(sample2.x, 1 / (gloss.exponent + 1))
            sin_h, (sin_phi, cos_phi) = dr.safe_sqrt(1 - cos_h * cos_h), dr.sincos(2 * dr.pi * sample2.y)
            h = mi.Vector3f(sin_h * cos_phi, sin_h * sin_phi, cos_h)
            diffuse = sample1 < 0.5
            bs = dr.zeros(mi.BSDFSample3f)
            bs.wo = dr.select(diffuse, mi.warp.square_to_cosine_hemisphere(sample2), 2 * dr.dot(si.wi, h) * h - si.wi)
            bs.eta = 1.0
            bs.sampled_component = dr.select(diffuse, mi.UInt32(0), mi.UInt32(1))
            kinds = [mi.UInt32(int(kind)) for kind in (mi.BSDFFlags.DiffuseReflection, mi.BSDFFlags.GlossyReflection)]
            bs.sampled_type = dr.select(diffuse, *kinds)
            value, bs.pdf = self.eval_pdf(ctx, si, bs.wo, active)
            return bs, dr.select(bs.pdf > 0, value / bs.pdf, 0)

        def to_string(self) -> str:
            return f"Glossy[{gloss}]"

    return Glossy()


def radiance(baked: mi.Texture, gloss: Gloss, lights: Sequence[PointLight]) -> mi.Texture:
    """What a mesh that `describe` prepared emits towards whoever looks: baked radiance, and the highlights of the lights."""

    class Shining(mi.Texture):
        def __init__(self) -> None:
            super().__init__(mi.Properties())

        def eval(self, si, active=True):
            L = mi.Color3f(baked.eval(si, active))
            n = dr.normalize(mi.Vector3f(si.shape.eval_attribute_3("vertex_shine_normal", si, active)))
            wo = si.to_world(si.wi)
            for i, light in enumerate(lights):
                to_light = mi.Point3f(*light.position) - si.p
                distance = dr.norm(to_light)
                wi = to_light / distance
                seen = si.shape.eval_attribute_1(f"vertex_visibility_{i}", si, active)
                irradiance = mi.Color3f(*light.intensity) * (seen * dr.dot(n, wi) / (distance * distance))
                front = active & (dr.dot(n, wi) > 0) & (dr.dot(n, wo) > 0)
                L += dr.select(front, _lobe(gloss, dr.dot(n, dr.normalize(wi + wo))) * irradiance, 0)
            return L

        def to_string(self) -> str:
            return f"Shining[{gloss}]"

    return Shining()


def describe(shape: mi.Mesh, normals: np.ndarray, visibility: np.ndarray) -> None:
    """Gives a mesh the attributes that `radiance` reads beside what is baked: normals [V, 3], visibility [V, L]."""
    shape.add_attribute("vertex_shine_normal", 3, np.float32(normals).ravel())
    for i, seen in enumerate(visibility.T):
        shape.add_attribute(f"vertex_visibility_{i}", 1, np.float32(seen).ravel())
