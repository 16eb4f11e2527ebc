"""The tables of Popescu et al. 2006, section 5, beside ours: reflected rays that meet billboards and depth maps.

    construction  time to simplify the rows of a depth map, against rotations n and points m
    z error       what the rows lose, against m
    memory        of the rows
    walk          how far rays walk over texels, and over simplified rows
    edges         against the angular increment; with a strip of pictures
    points        time to shade against m
    rays          reflected rays per second, of depth maps and of Embree
    reflectors    whole frames of billboards against the number of mirrors
    size          likewise against the size of the picture

Pictures are taken before anything is timed, like the paper's: nothing moves but the eye. Depth maps are of the first scene at
the frame in which its mirror is largest; billboards of the others in the middle of their animation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np

from benchharness.api import Method
from benchharness.measure import timing
from benchharness.measure.rounds import KERNEL_ROUNDS
from benchharness.scene import Scene, refined
from benchharness.speed import depthmaps, edges, popescu
from benchharness.speed.popescu import Settings, Timed, fps, row
from benchharness.speed.stage import Stage, Work, answer
from benchharness.study import plugins

POINTS, RAYS, REFLECTORS, SIZE = "points", "rays", "reflectors", "size"
DEPTH_MAPS, BILLBOARDS, TRACED = "depth_impostor", "billboard_impostor", "ray_traced"
FRAME, SHADE = "frame", "shade"


@dataclass
class Scenes:
    """Baked scenes, not refined: `maps` has one mirror and an object beside it; `spheres` are by the number of mirrors; `pots`
    has the four mirrors of the second table."""

    maps: Scene
    spheres: Mapping[int, Scene]
    pots: Scene


@dataclass
class Found:
    """Rows of impostors.csv and impostors-samples.csv, and the strip of edges."""

    rows: list[dict[str, Any]]
    samples: list[dict[str, Any]]
    panels: list[edges.Panel]


def study(scenes: Scenes, size: tuple[int, int], rounds: int, say: Callable[[str], None], settings: Settings) -> Found:
    """All tables. `size` is the picture's, but for the table of sizes."""
    scene = refined(scenes.maps)
    say("the frame with the largest mirror")
    stage = Stage(scene, size, popescu.largest(scene, size))
    rows, samples = depthmaps.study(stage, settings, rounds, say)
    edge_rows, panels = edges.study(stage, settings, say)
    rows += edge_rows
    for timed in (_depth_maps(stage, settings), _billboards(scenes, size, settings)):
        more, times = popescu.measured(timed, rounds, say)
        rows, samples = rows + more, samples + times
    rows += _kernels(stage, settings)
    order = list(dict.fromkeys(r["table"] for r in rows))
    return Found(sorted(rows, key=lambda r: order.index(r["table"])), samples, panels)


def _kind(name: str, **params: Any) -> Method:
    return plugins.find("method", name, "speed").target(**params)


def _shade(stage: Stage, kind: Method) -> Work:
    state, frame = stage.warmed(kind), stage.frame
    return lambda: answer(kind.shade(state, frame))


def _frame(stage: Stage, kind: Method) -> Work:
    """G-buffer, reflections and composite."""
    state, renderer, index, view = stage.warmed(kind), stage.renderer, stage.frame.index, stage.frame.view

    def work() -> Any:
        frame = renderer.draw(index, view)
        reflection, after = kind.shade(state, frame)
        return renderer.compose(frame, reflection.L), after

    return work


def _depth_maps(stage: Stage, settings: Settings) -> list[Timed]:
    """Tables of points and of rays: in the same rounds."""
    n, count = settings.rate[0], dr.width(stage.frame.pixels)
    where = f"frame {stage.frame.index}, {count} reflector pixels"
    timed = []
    for m in settings.shade:
        work = _shade(stage, _kind(DEPTH_MAPS, resolution=settings.texels, rotations=n, points=m))
        paper = popescu.FPS_BY_POINTS.get(m)
        timed.append(
            Timed(
                POINTS,
                f"m = {m}",
                SHADE,
                work,
                "ms",
                None if paper is None else 1e3 / paper,
                f"{where}; paper: whole frames",
            )
        )
    if count == 0:
        return timed

    def rate(ms: float) -> float:
        return 1e-3 * count / ms

    for name, kind in _rivals(settings).items():
        timed.append(Timed(RAYS, name, SHADE, _shade(stage, kind), "million/s", None, where, rate))
        paper = popescu.MRAYS if name.endswith("m = 16") else None
        timed.append(Timed(RAYS, name, FRAME, _frame(stage, kind), "million/s", paper, where, rate))
    return timed


def _rivals(settings: Settings) -> dict[str, Method]:
    n, m = settings.rate
    return {
        f"{DEPTH_MAPS}, m = {m}": _kind(DEPTH_MAPS, resolution=settings.texels, rotations=n, points=m),
        f"{DEPTH_MAPS}, every texel": _kind(DEPTH_MAPS, resolution=settings.texels, intersector="march"),
        TRACED: _kind(TRACED),
    }


def _kernels(stage: Stage, settings: Settings) -> list[dict[str, Any]]:
    """The table of rays by the time that kernels run, without what leads up to them."""
    count, rows = dr.width(stage.frame.pixels), []
    if count == 0:
        return rows
    for name, kind in _rivals(settings).items():
        work = _shade(stage, kind)
        timing.warm_up(work)
        ms = float(np.median([timing.kernel_ms(timing.kernels_of(work)) for _ in range(KERNEL_ROUNDS)]))
        note = f"{ms:.3f} ms, median of {KERNEL_ROUNDS}"
        rows.append(row(RAYS, name, "shade, kernels alone", 1e-3 * count / ms, "million/s", note=note))
    return rows


def _billboards(scenes: Scenes, size: tuple[int, int], settings: Settings) -> list[Timed]:
    """Tables of reflectors and of size."""
    cases = [(REFLECTORS, str(n), scenes.spheres[n], size, popescu.FPS_BY_REFLECTORS.get(n)) for n in settings.reflectors]
    cases += [(SIZE, f"{w}x{h}", scenes.pots, (w, h), popescu.FPS_BY_SIZE.get((w, h))) for w, h in settings.sizes]
    timed, kind = [], _kind(BILLBOARDS)
    for table, setting, scene, pixels, paper in cases:
        stage = Stage(refined(scene), pixels, scene.frames // 2)
        note = f"{scene.name}, {dr.width(stage.frame.pixels)} reflector pixels"
        timed.append(Timed(table, setting, FRAME, _frame(stage, kind), "fps", paper, note, fps))
        timed.append(Timed(table, setting, SHADE, _shade(stage, kind), "ms", None, note))
    return timed


def chart(rows: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Frames per second of billboards, ours and the paper's, against mirrors and pixels, as PNG."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4.2), dpi=130, layout="constrained")
    for axes, table, label in zip(figure.subplots(1, 2), (REFLECTORS, SIZE), ("mirrors", "million pixels"), strict=True):
        frames, shades = ([r for r in rows if (r["table"], r["quantity"]) == (table, q)] for q in (FRAME, SHADE))
        paper = [r for r in frames if "paper" in r]
        x = {r["setting"]: _across(table, r["setting"]) for r in frames}
        at = [x[r["setting"]] for r in frames]
        axes.plot(at, [r["ours"] for r in frames], "o-", color="#0072B2", label="whole frame")
        low, high = ([r[end] for r in frames] for end in ("ours_lo", "ours_hi"))
        axes.fill_between(at, low, high, color="#0072B2", alpha=0.2, lw=0)
        at = [x[r["setting"]] for r in shades]
        axes.plot(at, [fps(r["ours"]) for r in shades], "o--", ms=4, color="#56B4E9", label="shade alone")
        at = [x[r["setting"]] for r in paper]
        axes.plot(at, [r["paper"] for r in paper], "s-", color="#D55E00", label="Popescu et al. 2006")
        axes.set(xlabel=label, ylabel="frames per second", yscale="log", title=f"billboards against {table}")
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter("{x:g}")
        axes.tick_params(axis="y", which="minor", labelsize=7)
        if table == REFLECTORS:
            axes.set(xticks=list(x.values()))
        axes.grid(alpha=0.25, which="both")
        axes.legend(fontsize=8, frameon=False)
    figure.savefig(path)


def _across(table: str, setting: str) -> float:
    """Mirrors, or million pixels, of a row."""
    return float(setting) if table == REFLECTORS else 1e-6 * float(np.prod([int(side) for side in setting.split("x")]))
