"""What a vertex costs and what it is worth: all methods on ever finer subdivisions of one scene.

Methods that move vertices take time that grows with them; their pictures draw the image of every edge straight, so their
error falls with them. Subdivision interpolates positions and baked light linearly: the scene, and with it the reference,
stays the same. The frame without reflections (G-buffer and composite) grows with the vertices, too: it is a row by the
name of UNREFLECTED, and part of every method's frame.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchharness.api import Method
from benchharness.measure import contract, host, metrics, timing
from benchharness.render import reference
from benchharness.scene import Scene, refined
from benchharness.speed.stage import Stage, Work, answer, interleaved, method
from benchharness.study import plugins
from benchharness.tables.speed import UNREFLECTED

TARGETS = (5_000, 10_000, 15_000, 25_000, 50_000, 100_000, 200_000, 500_000)
"""Vertices to subdivide to; a target below what a scene has as it was built is that scene as it was built."""
WAYS: dict[str, tuple[str, dict[str, Any]]] = {
    "newton, rays": ("newton", {"resolve": "ray"}),
    "newton, rays, levels": ("newton", {"resolve": "ray", "lod_px": 1.0}),
}
"""Further rows, beside all methods with their defaults: method and parameters."""
CLOSE = 0.05  # relative; a subdivision this near to its target will do
TRIES = 12

COLUMNS = "detail method vertices triangles h_max_m shade_ms shade_ms_lo shade_ms_hi frame_ms flip coverage".split()
"""In the row UNREFLECTED, shade_ms is the time of the G-buffer and the composite; frame_ms of others is theirs and that."""
FIT_COLUMNS = "detail method ms_per_1000_vertices intercept_ms r2 exponent points".split()
"""The line through frame_ms against vertices; and p of the power n^p of vertices that shade_ms follows, in logarithms."""
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
    found = Found([], [], [])
    for detail, base in bases.items():
        # So that rounds are interleaved, all states are alive at once; those of impostors hold 0.7 GB of maps for every
        # tessellation, so that there is room for one detail.
        rows, works = _cases(detail, base, size, index, say, targets)
        times, _ = interleaved(works, rounds, lambda done, detail=detail: say(f"{detail}: round {done} of {rounds}"))
        for row in rows:
            row["shade_ms"], row["shade_ms_lo"], row["shade_ms_hi"] = timing.median_interval(
                times[row["method"], row["vertices"]]
            )
        plain = {row["vertices"]: row["shade_ms"] for row in rows if row["method"] == UNREFLECTED}
        for row in rows:
            row["frame_ms"] = plain[row["vertices"]] + (row["shade_ms"] if row["method"] != UNREFLECTED else 0)
        found.rows += rows
        for name in dict.fromkeys(row["method"] for row in rows):
            found.fits.append({"detail": detail, "method": name, **fit([r for r in rows if r["method"] == name])})
        for (name, vertices), all_ in times.items():
            found.samples += [
                dict[str, Any](zip(SAMPLE_COLUMNS, (detail, name, vertices, i, ms), strict=True)) for i, ms in enumerate(all_)
            ]
    return found


def _cases(
    detail: str, base: Scene, size: tuple[int, int], index: int, say: Callable[[str], None], targets: Sequence[int]
) -> tuple[list[dict[str, Any]], dict[tuple[str, int], Work]]:
    """Rows without times, and what is to be timed, by method and vertices."""
    kinds = {name: method(name) for name, plugin in plugins.discover("method").items() if plugin.error is None}
    kinds |= {name: method(of, **params) for name, (of, params) in WAYS.items() if of in kinds}
    rows: list[dict[str, Any]] = []
    works: dict[tuple[str, int], Work] = {}
    truth = reference.render(base, base.time(index), size)
    for scene in tessellations(base, targets):
        seen = {"detail": detail, "vertices": scene.vertices, "triangles": scene.triangles}
        seen["h_max_m"] = scene.source.get("split_at")
        stage = Stage(replace(scene, h_max=None), size, index)
        rows.append({**seen, "method": UNREFLECTED})
        works[UNREFLECTED, scene.vertices] = _unreflected(stage)
        for name, kind in kinds.items():
            say(f"{detail}: {name} at {scene.vertices} vertices")
            if contract.refusal(kind, stage.scene) is None:
                errors, works[name, scene.vertices] = case(kind, stage, truth)
                rows.append({**seen, "method": name, **errors})
    return rows, works


def _unreflected(stage: Stage):
    """A frame whose mirrors are black."""
    renderer, index, view = stage.renderer, stage.frame.index, stage.frame.view

    def work():
        frame = renderer.draw(index, view)
        return renderer.compose(frame, frame.radiance)

    return work


def case(kind: Method, stage: Stage, truth: reference.Reference):
    """What a method's picture is worth, and what is to be timed."""
    scene = stage.scene
    state = stage.warmed(kind)
    answered = kind.shade(state, stage.frame)[0]
    said = host.answer(stage.frame, answered)
    image, mask = host.image(stage.renderer.compose(stage.frame, answered.L), stage.frame), truth.mask & said.mirror
    errors = metrics.evaluate(image, truth.image, mask, ppd=scene.ppd, exposure=scene.exposure, found=said.found)
    return {k: errors[k] for k in ("flip", "coverage")}, lambda: answer(kind.shade(state, stage.frame))


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
    """Least squares through (vertices, frame_ms), and through the logarithms of vertices and shade_ms; all empty for fewer than
    two numbers of vertices."""
    n, ms = np.array([r["vertices"] for r in rows], float), np.array([r["frame_ms"] for r in rows], float)
    if len(set(n)) < 2:
        return {"points": len(n)}
    slope, intercept = np.polyfit(n, ms, 1)
    rest, spread = np.sum((ms - slope * n - intercept) ** 2), np.sum((ms - ms.mean()) ** 2)
    r2 = 1.0 - rest / spread if spread > 0 else 1.0
    exponent = float(np.polyfit(np.log(n), np.log([r["shade_ms"] for r in rows]), 1)[0])
    return {"ms_per_1000_vertices": 1e3 * slope, "intercept_ms": intercept, "r2": r2, "exponent": exponent, "points": len(n)}
