"""What simplified rows of depth maps lose of their samples (Popescu et al. 2006, section 5: the mean relative z error)."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels.images.depthmap import COVERED, Layout, row_at


@dataclass
class Loss:
    """Differences between polylines and samples, over the samples that a polyline spans.

    zgl, zgl_most          mean and greatest |difference| in zgl
    depth, depth_most      mean and greatest |dZ| / Z, with Z the sample's depth in front of the camera
    range, range_most      mean and greatest |dZ| / (zf - zn)
    samples, unspanned     covered samples with a polyline, and without (of dropped spans)
    """

    zgl: float
    zgl_most: float
    depth: float
    depth_most: float
    range: float
    range_most: float
    samples: int
    unspanned: int


def simplification(depth: mi.Float, cameras: mi.Float, rows: mi.Float, layout: Layout) -> Loss:
    """The loss of all rows of all maps. Evaluates and reads back: for tables, not for frames."""
    sums, mosts, samples, unspanned = _losses(depth, cameras, rows, layout)
    dr.eval(sums, mosts, samples, unspanned)
    spanned = int(np.sum(samples, dtype=np.int64))
    zgl, depth_, range_ = (float(np.sum(one, dtype=np.float64)) / max(spanned, 1) for one in sums)
    zgl_most, depth_most, range_most = (float(np.max(one)) for one in mosts)
    return Loss(
        zgl=zgl,
        zgl_most=zgl_most,
        depth=depth_,
        depth_most=depth_most,
        range=range_,
        range_most=range_most,
        samples=spanned,
        unspanned=int(np.sum(unspanned, dtype=np.int64)),
    )


@dr.syntax
def _losses(
    depth: mi.Float, cameras: mi.Float, rows: mi.Float, layout: Layout
) -> tuple[mi.Vector3f, mi.Vector3f, mi.UInt32, mi.UInt32]:
    """Per row: sums and maxima of the three differences, and samples spanned and not."""
    lane = dr.arange(mi.UInt32, layout.row_count)
    row = row_at(depth, layout, lane)
    lens = dr.gather(mi.Vector4f, cameras, 4 * row.map + 3)
    inverse_near, scale = dr.rcp(lens.y), dr.rcp(lens.y) - dr.rcp(lens.z)
    sums, mosts = mi.Vector3f(0), mi.Vector3f(0)  # of |dzgl|, |dZ| / Z and |dZ| / (zf - zn)
    samples, unspanned = mi.UInt32(0), mi.UInt32(0)  # with a polyline and without

    # From -1 to the first point there is none; then point k and the next, until samples pass it.
    start, z_start, is_up = mi.Float(-1), mi.Float(0), mi.Bool(True)
    code = dr.gather(mi.Vector2f, rows, lane * layout.m)
    k, u = mi.UInt32(0), mi.UInt32(0)
    while dr.hint(u < layout.w, label="compare a row with its samples"):
        at = mi.Float(u)
        end = dr.select(code.x < 0, -code.x - 1, code.x)
        if (at > end) & (k + 1 < layout.m):
            start, z_start, is_up = mi.Float(end), mi.Float(code.y), code.x < 0
            k += 1
            code = dr.gather(mi.Vector2f, rows, lane * layout.m + k)
        else:
            zgl = row.sample(u)
            is_spanned = (at == end) | (~is_up & (start <= at) & (at < end))
            covered = zgl < COVERED
            step = dr.select(end > start, end - start, 1)
            line = dr.select(at == end, code.y, dr.fma((at - start) / step, code.y - z_start, z_start))
            Z, Z_line = dr.rcp(inverse_near - zgl * scale), dr.rcp(inverse_near - line * scale)
            dZ = dr.abs(Z_line - Z)
            loss = mi.Vector3f(dr.abs(line - zgl), dZ / Z, dZ / (lens.z - lens.y))
            loss = dr.select(covered & is_spanned, loss, 0)
            sums += loss
            mosts = dr.maximum(mosts, loss)
            samples += dr.select(covered & is_spanned, 1, 0)
            unspanned += dr.select(covered & ~is_spanned, 1, 0)
            u += 1
    return sums, mosts, samples, unspanned
