"""Our light maps in Mitsuba: what a mesh sends where it has a grid of samples, by the number of a triangle and a place in it.

Written against Mitsuba's interfaces; shares nothing with `benchharness.kernels`, which goes by what vertices carry.
`benchharness.modelling.lightmap` says which samples a sheet has where.
"""

# pyright: reportArgumentType=false, reportCallIssue=false, reportAttributeAccessIssue=false, reportOperatorIssue=false
# The type stubs of Mitsuba and Dr.Jit know neither NumPy arguments nor points and vectors in one expression.

from __future__ import annotations

from collections.abc import Sequence

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.scene import Mesh

HEXAGON = ((0, 0), (1, 0), (0, 1), (1, 1))
"""The samples of a square of a sheet, right and down from its first: the three around a point have weight, the fourth none."""


def mapped(base: mi.Texture, meshes: Sequence[Mesh]) -> mi.Texture:
    """What the light maps of meshes that are one shape have, in their order; `base` where there is none. The shape must have no
    uv: a place in a triangle is taken from Mitsuba's, which are barycentric then."""
    if all(mesh.light is None for mesh in meshes):
        return base
    corners, firsts, across, start, samples = [], [], [], 0, []
    for mesh in meshes:
        there, width = np.full((len(mesh.faces), 3, 2), -1.0), 0
        if mesh.light is not None and mesh.light_at is not None:
            there, width = mesh.light_at[mesh.faces], mesh.light.samples.shape[1]
            samples.append(mesh.light.samples.reshape(-1, 3))
        corners.append(there)
        firsts.append(np.full(len(mesh.faces), start))
        across.append(np.full(len(mesh.faces), width))
        start += 0 if mesh.light is None else len(samples[-1])
    at = [[mi.Float(np.float32(np.concatenate(corners)[:, corner, axis])) for axis in (0, 1)] for corner in range(3)]
    first, row_length = (mi.Int32(np.concatenate(of_faces).astype(np.int32)) for of_faces in (firsts, across))
    channels = [mi.Float(np.concatenate(samples)[:, channel].ravel()) for channel in range(3)]

    class Mapped(mi.Texture):
        def __init__(self) -> None:
            super().__init__(mi.Properties())

        def eval(self, si, active=True):
            u, v = si.uv.x, si.uv.y
            shares = (1 - u - v, u, v)
            x, y = (
                sum(dr.gather(mi.Float, at[corner][axis], si.prim_index, active) * shares[corner] for corner in range(3))
                for axis in (0, 1)
            )
            has_grid = active & (x >= 0)
            begins, length = (dr.gather(mi.Int32, of_faces, si.prim_index, has_grid) for of_faces in (first, row_length))
            column, row = mi.Int32(dr.floor(x)), mi.Int32(dr.floor(y))
            value = mi.Color3f(0)
            for right, down in HEXAGON:
                # Linear on the triangles of the sheet: 1 at its sample, 0 at the six around it.
                dx, dy = x - column - right, y - row - down
                weight = dr.maximum(1 - dr.maximum(dr.maximum(dr.abs(dx), dr.abs(dy)), dr.abs(dx + dy)), 0)
                sample = mi.UInt32(begins + (row + down) * length + column + right)
                value += mi.Color3f(*(dr.gather(mi.Float, c, sample, has_grid) for c in channels)) * weight
            return dr.select(has_grid, value, base.eval(si, active))

        def to_string(self) -> str:
            return f"Mapped[{base}, {start} samples]"

    return Mapped()
