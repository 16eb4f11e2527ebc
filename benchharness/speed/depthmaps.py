"""What simplified depth maps cost, lose and save: construction, z error, memory, and how far rays walk over them.

All of it on one depth map: the first that the frame's mirrors show, taken from where the mirror is.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.api import Frame
from benchharness.kernels import optics
from benchharness.kernels.frozen import frozen
from benchharness.kernels.images import bounces, deptherror, depthray, depthrows
from benchharness.kernels.images.depthmap import Layout
from benchharness.speed import popescu
from benchharness.speed.popescu import Settings, Timed, row
from benchharness.speed.stage import Stage

CONSTRUCTION, Z_ERROR, MEMORY, WALK = "construction", "z error", "memory", "walk"


def rays(frame: Frame, pixels: mi.UInt32) -> tuple[mi.Point3f, mi.Vector3f]:
    """Starts and unit directions of the rays that mirrors reflect at `pixels`."""
    p, n, v = (dr.gather(type(a), a, pixels) for a in (frame.p, frame.n, frame.v))
    n = mi.Normal3f(n)
    above = mi.Vector3f(n) * (bounces.RAY_EPSILON * (1 + dr.max(dr.abs(p))))
    return mi.Point3f(p + above), optics.reflect(mi.Vector3f(v), n)


def study(
    stage: Stage, settings: Settings, rounds: int, say: Callable[[str], None]
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Rows of impostors.csv and of impostors-samples.csv."""
    w = settings.texels
    shown = popescu.reliefs(stage, w, 1, 0)
    depth = dr.gather(mi.Float, shown.depth, dr.arange(mi.UInt32, w * w))
    cameras = dr.gather(mi.Float, shown.cameras, dr.arange(mi.UInt32, 16))
    dr.eval(depth, cameras)
    rows, samples = _construction(depth, settings, rounds, say)
    say(f"{Z_ERROR}, {MEMORY}, {WALK}")
    rows += [*_losses(depth, cameras, settings), _memory(depth, settings)]
    return rows + _walk(stage, depth, cameras, settings), samples


def _construction(depth: mi.Float, settings: Settings, rounds: int, say: Callable[[str], None]):
    timed = []
    for n, m in settings.construction:
        note = f"{settings.texels} x {settings.texels} texels"
        timed.append(
            Timed(
                CONSTRUCTION,
                f"n = {n}, m = {m}",
                "time",
                lambda n=n, m=m: _built(depth, settings.texels, n, m),
                "ms",
                popescu.CONSTRUCTION_MS.get((n, m)),
                note,
            )
        )
    return popescu.measured(timed, rounds, say)


@frozen
def _built(depth: mi.Float, w: int, n: int, m: int) -> mi.Float:
    """The simplified rows of one depth map."""
    return depthrows.build(depth, Layout(1, w, n, m))[0]


def _losses(depth: mi.Float, cameras: mi.Float, settings: Settings) -> list[dict[str, Any]]:
    n, rows = settings.rate[0], []
    for m in settings.errors:
        layout = Layout(1, settings.texels, n, m)
        loss = deptherror.simplification(depth, cameras, _built(depth, settings.texels, n, m), layout)
        paper, note = popescu.Z_ERROR.get(m), f"n = {n}; {loss.unspanned} of {loss.samples + loss.unspanned} samples dropped"
        rows.append(row(Z_ERROR, f"m = {m}", "mean |dz| / z", 1e2 * loss.depth, "%", paper, note))
        rows.append(row(Z_ERROR, f"m = {m}", "mean |dz| / (far - near)", 1e2 * loss.range, "%", paper, note))
    return rows


def _memory(depth: mi.Float, settings: Settings) -> dict[str, Any]:
    n, m = settings.memory
    rows = _built(depth, settings.texels, n, m)
    paper = popescu.ROWS_BYTES.get((n, settings.texels, m))
    return row(MEMORY, f"n = {n}, {settings.texels} texels, m = {m}", "rows", np.array(rows).nbytes, "bytes", paper)


def _walk(stage: Stage, depth: mi.Float, cameras: mi.Float, settings: Settings) -> list[dict[str, Any]]:
    """Rays of the first mirror: texels read one after the other, and segments of simplified rows tested."""
    frame, w = stage.frame, settings.texels
    mirror = np.array(dr.gather(mi.Int32, frame.reflector, frame.pixels))
    pixels = mi.UInt32(np.array(frame.pixels)[mirror == 0])
    if dr.width(pixels) == 0:
        return []
    segment = depthray.project(cameras, w, dr.zeros(mi.UInt32, dr.width(pixels)), *rays(frame, pixels))
    length, seen = np.hypot(*np.array(segment.b - segment.a)[:2]), np.array(segment.active)

    def means(setting: str, what: str, values: np.ndarray, hit: np.ndarray, paper: float, note: str):
        for name, of, number in (("that hit", hit & seen, paper), ("that the map sees", seen, None)):
            if of.any():
                yield row(WALK, setting, f"{what}, of rays {name}", float(values[of].mean()), "per ray", number, note)

    walked = depthray.meet_texels(segment, depth, w)
    hit, reads = np.array(walked.found), np.array(walked.work)
    note = f"{int((hit & seen).sum())} rays hit, {int(seen.sum())} seen, {len(seen)} reflected"
    rows = list(means("every texel", "texels of the image", length, hit, popescu.IMAGE_TEXELS, note))
    rows += means("every texel", "texels read", reads, hit, popescu.TEXELS_READ, "")
    for m in settings.walk:
        layout = Layout(1, w, settings.rate[0], m)
        met = depthray.meet_rows(segment, _built(depth, w, settings.rate[0], m), layout)
        rows += means(f"m = {m}", "segments tested", np.array(met.work), np.array(met.found), m - 1, "paper: at most")
    return rows
