"""The numbers of Popescu et al. 2006, section 5, and rows that put ours beside them.

The paper's times are of a 3.4 GHz Pentium 4 and a Quadro FX 3400, its frames whole; its scenes are not ours, but like them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchharness.kernels.images import imagewise, relief, roles
from benchharness.kernels.images.capture import CaptureOptions
from benchharness.measure import timing
from benchharness.speed.stage import Stage, Work, interleaved

COLUMNS = "table setting quantity ours ours_lo ours_hi unit paper note".split()
"""Of impostors.csv; the interval is empty for what was not timed, `paper` where the paper has no number."""
SAMPLE_COLUMNS = "table setting quantity round ms".split()

CONSTRUCTION_MS = {(60, 8): 210, (60, 16): 300, (60, 32): 480, (60, 64): 980, (18, 8): 70}
"""By rotations n and points m."""
Z_ERROR = {8: 1.43, 10: 0.9, 12: 0.7, 14: 0.5, 16: 0.4}
"""Mean relative z error in percent, by m; relative to what, the paper does not say."""
ROWS_BYTES = {(60, 256, 8): 983_040}
"""By n, texels across and m."""
FPS_BY_POINTS = {6: 25, 8: 20, 12: 17, 16: 16}
FPS_BY_REFLECTORS = {1: 166, 2: 125, 3: 77, 4: 66, 5: 46, 6: 37, 7: 25, 8: 17, 9: 11}
FPS_BY_SIZE = {(640, 480): 46, (800, 600): 36, (960, 720): 31, (1120, 840): 25, (1280, 960): 11}
"""With four reflectors."""
ROTATIONS_SHOWN = (9, 18, 60, 90)
"""Of figure 14: angular increments of 20, 10, 3 and 2 degrees."""
IMAGE_TEXELS, TEXELS_READ = 91, 63
"""Mean length of a ray's image in the depth map, and of it what is walked before a hit, without simplified rows."""
MRAYS = 1.4
"""Million reflected rays per second in whole frames, m = 16."""


@dataclass(frozen=True)
class Settings:
    """What is measured.

    texels        across a depth map
    construction  pairs of n and m, for the time that simplified rows take to build
    errors        m, for their error
    memory        n and m, for their size
    shade         m, for the time to shade
    rotations     n, for the edges
    walk          m, for segments tested
    rate          n and m, for reflected rays per second; m also for the edges
    reflectors    how many, for the time of a frame; of `sizes` another
    """

    texels: int = 256
    construction: Sequence[tuple[int, int]] = tuple(CONSTRUCTION_MS)
    errors: Sequence[int] = tuple(Z_ERROR)
    memory: tuple[int, int] = (60, 8)
    shade: Sequence[int] = tuple(FPS_BY_POINTS)
    rotations: Sequence[int] = ROTATIONS_SHOWN
    walk: Sequence[int] = (8, 16)
    rate: tuple[int, int] = (60, 16)
    reflectors: Sequence[int] = tuple(FPS_BY_REFLECTORS)
    sizes: Sequence[tuple[int, int]] = tuple(FPS_BY_SIZE)


def row(
    table: str, setting: str, quantity: str, ours: float, unit: str, paper: float | None = None, note: str = ""
) -> dict[str, Any]:
    """A row of impostors.csv."""
    made = {"table": table, "setting": setting, "quantity": quantity, "ours": ours, "unit": unit, "note": note}
    return made if paper is None else {**made, "paper": paper}


def fps(ms: float) -> float:
    return 1e3 / ms


@dataclass(frozen=True)
class Timed:
    """A row whose number is a time, or is made of one by `convert` (from ms)."""

    table: str
    setting: str
    quantity: str
    work: Work
    unit: str = "ms"
    paper: float | None = None
    note: str = ""
    convert: Callable[[float], float] = float

    @property
    def key(self) -> tuple[str, str, str]:
        return self.table, self.setting, self.quantity


def measured(
    timed: Sequence[Timed], rounds: int, say: Callable[[str], None]
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Rows of impostors.csv and of impostors-samples.csv: medians over interleaved rounds of all of `timed`."""
    what = ", ".join(dict.fromkeys(one.table for one in timed))
    times, cold = interleaved({one.key: one.work for one in timed}, rounds, lambda n: say(f"{what}: round {n} of {rounds}"))
    rows, samples = [], []
    for one in timed:
        notes = [one.note] * bool(one.note) + ["compiled in every round"] * (one.key in cold)
        median, low, high = timing.median_interval([one.convert(ms) for ms in times[one.key]])
        made = row(*one.key, median, one.unit, one.paper, "; ".join(notes))
        rows.append({**made, "ours_lo": low, "ours_hi": high})
        samples += [dict(zip(SAMPLE_COLUMNS, (*one.key, i, ms), strict=True)) for i, ms in enumerate(times[one.key])]
    return rows, samples


def reliefs(stage: Stage, texels: int, rotations: int, points: int) -> relief.Reliefs:
    """The depth maps of a stage's frame as its mirrors see them, one per object and mirror; points 0: without rows.

    Raises ValueError for a scene that has none: all of it flat, or around its mirrors.
    """
    planned = roles.plan(stage.scene, maps=1, mirrors=False)
    options = CaptureOptions(
        size=texels, planes=8, mip=False, resolution=4, turn=0.0, walls=0.0, rotations=rotations, points=points
    )
    state = imagewise.updated(imagewise.begun(stage.scene, planned), stage.frame.poses, options)
    found = None if state.impostors is None else state.impostors.reliefs
    if found is None:
        raise ValueError(f"scene {stage.scene.name}: no depth map; accepted: scenes with an object that has a volume")
    return found


def largest(scene: Any, size: tuple[int, int]) -> int:
    """The frame in which mirrors cover most pixels; the first of equals."""
    from benchharness.render.frame import FrameRenderer

    renderer = FrameRenderer(scene, *size)
    return int(np.argmax([len(renderer.render(i).pixels) for i in range(scene.frames)]))
