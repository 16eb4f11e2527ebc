"""What a vertex costs and what it is worth: the image-space search on ever finer subdivisions of one scene.

The search works on vertices, so its time grows with them; its picture draws the image of every edge straight, so its error
falls with them. Subdivision interpolates positions and baked light linearly: the scene, and with it the reference, stays
the same. Methods that do not depend on the tessellation stand beside it as levels.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchharness import metrics, reference, timing
from benchharness.scene import Scene, refined
from benchharness.speed.stage import Stage, answer, interleaved, method

SEARCH = "image_space_search"
LEVELS = ("environment_map", "ray_traced")
TARGETS = (5_000, 10_000, 15_000, 25_000, 50_000, 100_000, 200_000)
"""Vertices to subdivide to; a target below what a scene has as it was built is that scene as it was built."""
CLOSE = 0.05  # relative; a subdivision this near to its target will do
TRIES = 12

COLUMNS = "detail method vertices triangles h_max_m shade_ms shade_ms_lo shade_ms_hi flip coverage".split()
FIT_COLUMNS = "detail ms_per_1000_vertices intercept_ms r2 points".split()
SAMPLE_COLUMNS = "detail method vertices round ms".split()


@dataclass
class Found:
    """Rows of the three tables, see COLUMNS, FIT_COLUMNS and SAMPLE_COLUMNS."""

    rows: list[dict[str, Any]]
    fits: list[dict[str, Any]]
    samples: list[dict[str, Any]]


def study(
    bases: Mapping[str, Scene],
    size: tuple[int, int],
    index: int,
    rounds: int,
    say: Callable[[str], None],
    targets: Sequence[int] = TARGETS,
) -> Found:
    """Times and errors of frame `index`. `bases`: detail -> baked scene, not refined."""
    rows, works = [], {}
    for detail, base in bases.items():
        truth = reference.render(base, base.time(index), size)
        for name, scene in (*((SEARCH, s) for s in tessellations(base, targets)), *((level, base) for level in LEVELS)):
            say(f"{detail}: {name} at {scene.vertices} vertices")
            row, work = _case(name, replace(scene, h_max=None), size, index, truth)
            row |= {"detail": detail, "h_max_m": scene.source.get("split_at")}
            rows.append(row)
            works[detail, name, scene.vertices] = work
    times, _ = interleaved(works, rounds, lambda done: say(f"round {done} of {rounds}"))
    for row in rows:
        samples = times[row["detail"], row["method"], row["vertices"]]
        row["shade_ms"], row["shade_ms_lo"], row["shade_ms_hi"] = timing.median_interval(samples)
    return Found(
        rows,
        [{"detail": detail, **fit([r for r in rows if (r["detail"], r["method"]) == (detail, SEARCH)])} for detail in bases],
        [dict(zip(SAMPLE_COLUMNS, (*key, i, ms), strict=True)) for key, all_ in times.items() for i, ms in enumerate(all_)],
    )


def _case(name: str, scene: Scene, size: tuple[int, int], index: int, truth: reference.Reference):
    """What is known of a case before it is timed, and what is to be timed."""
    stage, kind = Stage(scene, size, index), method(name)
    state = stage.warmed(kind)
    answered = kind.shade(state, stage.frame)[0]
    mask = truth.mask & np.array(stage.frame.active).reshape(truth.mask.shape)
    found = np.broadcast_to(np.array(answered.found), mask.size).reshape(mask.shape)
    image = stage.pixels(stage.renderer.compose(stage.frame, answered.L))
    errors = metrics.evaluate(image, truth.image, mask, ppd=scene.ppd, exposure=scene.exposure, found=found)
    row = {"method": name, "vertices": scene.vertices, "triangles": scene.triangles}
    row |= {"flip": errors["flip"], "coverage": errors["coverage"]}
    return row, lambda: answer(kind.shade(state, stage.frame))


def tessellations(base: Scene, targets: Sequence[int]) -> list[Scene]:
    """The scene subdivided to about so many vertices, coarsest first; what comes out the same comes out once.

    `source["split_at"]` says at which length edges were split, in metres; None: as it was built.
    """
    found: dict[int, Scene] = {}
    for target in sorted(targets):
        scene = _split(base, _length_for(base, target)) if target > base.vertices else _split(base, None)
        found.setdefault(scene.vertices, scene)
    return list(found.values())


def _split(base: Scene, h_max: float | None) -> Scene:
    scene = refined(replace(base, h_max=h_max))
    return replace(scene, source={**base.source, "split_at": h_max})


def _length_for(base: Scene, target: int) -> float:
    """Edge length in metres at which the subdivided scene has about `target` vertices, more than `base` has."""
    long = max(float(np.linalg.norm(np.ptp(o.mesh.vertices, axis=0))) for o in base.objects)
    short = 0.5 * long
    while (count := _split(base, short).vertices) < target:
        long, short = short, 0.5 * short

    # Between the two: bisection of the logarithm.
    best, off = short, abs(np.log(count / target))
    for _ in range(TRIES):
        if off < CLOSE:
            break
        middle = float(np.sqrt(short * long))
        count = _split(base, middle).vertices
        if abs(np.log(count / target)) < off:
            best, off = middle, abs(np.log(count / target))
        short, long = (middle, long) if count > target else (short, middle)
    return best


def fit(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Least squares through (vertices, shade_ms); all empty for fewer than two numbers of vertices."""
    n, ms = np.array([r["vertices"] for r in rows], float), np.array([r["shade_ms"] for r in rows], float)
    if len(set(n)) < 2:
        return {"points": len(n)}
    slope, intercept = np.polyfit(n, ms, 1)
    rest, spread = np.sum((ms - slope * n - intercept) ** 2), np.sum((ms - ms.mean()) ** 2)
    r2 = 1.0 - rest / spread if spread > 0 else 1.0
    return {"ms_per_1000_vertices": 1e3 * slope, "intercept_ms": intercept, "r2": r2, "points": len(n)}


def chart(found: Found, path: Path) -> None:
    """Time and error of the search against vertices, as PNG; a colour per detail, a level per other method."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4), dpi=130, layout="constrained")
    time, error = figure.subplots(1, 2)
    fits = {f["detail"]: f for f in found.fits}
    for colour, detail in zip(("#0072B2", "#D55E00", "#009E73"), fits, strict=False):
        rows = [r for r in found.rows if (r["detail"], r["method"]) == (detail, SEARCH)]
        n = np.array([r["vertices"] for r in rows], float)
        ms, low, high = (np.array([r[name] for r in rows]) for name in ("shade_ms", "shade_ms_lo", "shade_ms_hi"))
        time.errorbar(n / 1e3, ms, (ms - low, high - ms), fmt="o", ms=4, color=colour, capsize=2, label=f"{SEARCH}, {detail}")
        if "r2" in fits[detail]:
            slope, start = fits[detail]["ms_per_1000_vertices"], fits[detail]["intercept_ms"]
            label = f"{start:.1f} ms + {slope:.3f} ms per 1000 vertices"
            time.plot([0, n.max() / 1e3], [start, start + slope * n.max() / 1e3], lw=1, color=colour, label=label)
        error.plot(n, [r["flip"] for r in rows], "o-", ms=4, lw=1, color=colour, label=f"{SEARCH}, {detail}")
        for row in (r for r in found.rows if r["detail"] == detail and r["method"] in LEVELS):
            error.axhline(row["flip"], ls="--", lw=1, color=colour)
    error.set(xlabel="vertices", ylabel="FLIP in the mirror (lower is better)", title="Error left by the tessellation")
    error.set(xscale="log", yscale="log")
    for name in LEVELS:
        level = max(r["flip"] for r in found.rows if r["method"] == name)
        where = error.get_yaxis_transform()
        error.annotate(name, (0.98, level), (0, 2), xycoords=where, textcoords="offset points", ha="right", fontsize=7)
    error.margins(y=0.1)
    time.set(xlabel="thousand vertices", ylabel="shade_ms", title="Cost of a vertex", xlim=(0, None), ylim=(0, None))
    time.legend(fontsize=7, frameon=False)
    error.legend(fontsize=7, frameon=False, loc="center left", bbox_to_anchor=(0.0, 0.3))
    for axes in (time, error):
        axes.grid(alpha=0.25)
    figure.savefig(path)
