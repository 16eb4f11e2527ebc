"""What is timed against what: our stages and their rivals on one frame.

Rivals draw the same triangles with the same camera and light, and are recorded and replayed (`dr.freeze`) as ours are.
Where Embree's time depends on how it is asked, all ways are there: watertight, as Mitsuba asks by default, at its best. A note
says how far the two sides' pictures agree.

gbuffer          the first hit of every pixel
raster           the same, against an OpenGL rasterizer on the processor
frame            a whole picture of a still scene: first hits, reflection, composite
shade            the reflection alone, first hits given
moving           the same where things moved: what has to be renewed, then the reflection
environment_map  its reflection alone, for orientation

frame, shade and moving are there for each of the methods that move vertices: `frame secant_triangle`, ...
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchharness.api import Method
from benchharness.kernels import hierarchy
from benchharness.measure import host, metrics
from benchharness.scene import Scene
from benchharness.speed import embree, llvmpipe
from benchharness.speed.stage import Stage, Work, answer, interleaved, method, ratio_interval

OURS = "ours"
VERTEX_METHODS = ("image_space_search", "secant_triangle", "newton")
CLOSE_M = 1e-3  # two first hits nearer than this are the same


@dataclass(frozen=True)
class Rival:
    """`work` is None where it cannot be done here; `note` then says why."""

    name: str
    work: Work | None
    note: str


@dataclass(frozen=True)
class Comparison:
    name: str
    ours: Work
    rivals: list[Rival]


def comparisons(
    still: Scene, moving: Scene, size: tuple[int, int], index: int, gl: llvmpipe.Llvmpipe | str
) -> list[Comparison]:
    """All comparisons on frame `index`. Both scenes are baked; in `moving` something moves just before that frame.

    gl   llvmpipe with that frame of `still`, or why there is none
    """
    stage, moved = Stage(still, size, index), Stage(moving, size, index)
    world = embree.build(still, stage.frame.time)
    fast = embree.build(still, stage.frame.time, robust=False)
    bodies, anew = (embree.build(moving, moved.frame.time, way) for way in (hierarchy.BODIES, hierarchy.ANEW))
    return [
        _gbuffer(stage, world),
        _raster(stage, gl),
        *(_frame(name, stage, world) for name in VERTEX_METHODS),
        *(_shade(f"shade {name}", name, stage, world, fast) for name in VERTEX_METHODS),
        *(_moving(name, moved, bodies, anew) for name in VERTEX_METHODS),
        _shade("environment_map", "environment_map", stage, world, fast),
    ]


# The comparisons


def _gbuffer(stage: Stage, world: embree.World) -> Comparison:
    renderer, frame, view = stage.renderer, stage.frame, stage.frame.view
    rivals = [
        (
            "Embree, default call",
            lambda: embree.interactions(world, view),
            lambda si: si.p,
            "the whole surface interaction evaluated",
        ),
        (
            "Embree, coherent",
            lambda: embree.essentials(world, view),
            lambda found: found[1],
            "point, normals, triangle and uv evaluated",
        ),
        (
            "Embree, coherent, our G-buffer",
            lambda: embree.gbuffer(world, view, frame),
            lambda found: found.p,
            "preliminary hits; what our G-buffer holds and nothing else",
        ),
    ]
    return Comparison(
        "gbuffer",
        lambda: renderer.draw(frame.index, view),
        [Rival(name, work, f"{note}; {_same_points(stage, point(work()))}") for name, work, point, note in rivals],
    )


def _raster(stage: Stage, gl: llvmpipe.Llvmpipe | str) -> Comparison:
    renderer, index, view = stage.renderer, stage.frame.index, stage.frame.view

    def ours() -> tuple:
        frame = renderer.draw(index, view)
        return frame.reflector, frame.p, frame.n, frame.radiance

    rivals = []
    for count in llvmpipe.TARGETS:
        name = f"llvmpipe, {count} targets"
        if isinstance(gl, str):
            rivals.append(Rival(name, None, gl))
        else:
            gl.draw(count)
            part, p, *_ = gl.read(count)
            mirror = part >= len(stage.scene.objects)
            same = np.mean(mirror == np.array(stage.frame.active))
            note = f"float32 x 4 and depth; mirror or not: the same at {same:.3%} of all pixels; {_same_points(stage, p.T)}"
            rivals.append(Rival(name, lambda count=count: gl.draw(count), note))
    return Comparison("raster", ours, rivals)


def _frame(name: str, stage: Stage, world: embree.World) -> Comparison:
    renderer, index, view = stage.renderer, stage.frame.index, stage.frame.view
    mine, traced = method(name), method("ray_traced")
    state, traced_state = stage.warmed(mine), stage.warmed(traced)

    def ours() -> tuple:
        frame = renderer.draw(index, view)
        reflection, after = mine.shade(state, frame)
        return renderer.compose(frame, reflection.L), after

    def staged() -> Any:
        frame = embree.gbuffer(world, view, stage.frame)
        return renderer.compose(frame, traced.shade(traced_state, frame)[0].L)

    drawn = ours()[0]
    rivals = [
        ("one bounce, default calls", lambda: embree.picture(world, view, coherent=False), "Embree; all in one kernel"),
        ("one bounce, coherent", lambda: embree.picture(world, view, coherent=True), f"Embree; all in one kernel; {_LOSES}"),
        ("one bounce, in stages", staged, "Embree; coherent first hits, ray_traced, composite"),
    ]
    return Comparison(
        f"frame {name}",
        ours,
        [Rival(rival, work, f"{note}; {_difference(stage, drawn, work())}") for rival, work, note in rivals],
    )


def _shade(name: str, ours: str, stage: Stage, world: embree.World, fast: embree.World) -> Comparison:
    mine, traced = method(ours), method("ray_traced")
    frame, state, traced_state = stage.frame, stage.warmed(mine), stage.warmed(traced)
    shown = mine.shade(state, frame)[0].L
    rivals = {
        _DEFAULT: lambda: embree.reflection(world, frame, coherent=False),
        _FAST: lambda: embree.reflection(fast, frame, coherent=False),
        _COHERENT: lambda: embree.reflection(world, frame, coherent=True),
        "ray_traced": lambda: answer(traced.shade(traced_state, frame)),
    }
    return Comparison(name, lambda: answer(mine.shade(state, frame)), _differences(stage, shown, rivals))


def _moving(name: str, stage: Stage, bodies: embree.World, anew: embree.World) -> Comparison:
    own, traced = method(name), method("ray_traced")
    frame, state, traced_state = stage.frame, stage.warmed(own), stage.warmed(traced)

    def renewed(mine: Method, before: Any) -> tuple:
        return answer(mine.shade(mine.update(before, frame), frame))

    def recorded(world: embree.World) -> tuple:
        return embree.reflection(embree.move(world, frame.poses), frame, coherent=False)

    shown = renewed(own, state)[0]
    rivals = {
        _DEFAULT: lambda: recorded(bodies),
        _ANEW: lambda: recorded(anew),
        "ray_traced": lambda: renewed(traced, traced_state),
    }
    return Comparison(f"moving {name}", lambda: renewed(own, state), _differences(stage, shown, rivals))


_DEFAULT, _COHERENT = "ray_traced, recorded", "ray_traced, coherent"
_FAST, _ANEW = "ray_traced, not robust", "ray_traced, built anew"
_LOSES = "Embree's traversal of coherent rays misses some of what rays that part from a curved mirror meet"
_HOW = {
    _DEFAULT: "the same rays without highlights and counters",
    _FAST: "Embree's default, in which rays may slip through edges",
    _ANEW: "one hierarchy over everything, built again, as shapes that change would need",
    _COHERENT: _LOSES,
    "ray_traced": "as the method traces them",
}


def _same_points(stage: Stage, p: Any) -> str:
    off = np.linalg.norm(np.array(p) - np.array(stage.frame.p), axis=0)[np.array(stage.frame.active)]
    return f"{np.mean(off < CLOSE_M):.3%} of the mirror's points are ours" if len(off) else "no mirror in view"


def _difference(stage: Stage, ours: Any, other: Any) -> str:
    """How far two pictures are apart inside the mirror."""
    mask = host.plane(stage.frame.active, stage.frame)
    pictures = host.image(ours, stage.frame), host.image(other, stage.frame)
    flip = metrics.flip_map(*pictures, mask, ppd=stage.scene.ppd, exposure=stage.scene.exposure)[mask]
    return f"FLIP to ours {flip.mean():.4f}" if mask.any() else "no mirror in view"


def _differences(stage: Stage, ours: Any, others: dict[str, Work]) -> list[Rival]:
    """Rivals whose works return radiance first, each beside what ours returned."""
    shown = stage.renderer.compose(stage.frame, ours)
    rivals = []
    for name, work in others.items():
        apart = _difference(stage, shown, stage.renderer.compose(stage.frame, work()[0]))
        rivals.append(Rival(name, work, f"{_HOW[name]}; {apart}"))
    return rivals


def run(
    compared: Sequence[Comparison], rounds: int, watch: Callable[[int], None]
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Rows of speed.csv and of samples.csv."""
    works = {(c.name, OURS): c.ours for c in compared}
    works |= {(c.name, r.name): r.work for c in compared for r in c.rivals if r.work is not None}
    times, cold = interleaved(works, rounds, watch)
    rows = []
    for comparison in compared:
        ours = times[comparison.name, OURS]
        for rival in comparison.rivals:
            key = (comparison.name, rival.name)
            row: dict[str, Any] = {"name": comparison.name, "ours_ms": np.median(ours), "rival": rival.name}
            if rival.work is not None:
                ratio, low, high = ratio_interval(times[key], ours)
                row |= {"rival_ms": np.median(times[key]), "ratio": ratio, "ratio_lo": low, "ratio_hi": high}
            late = [side for side, k in ((OURS, (comparison.name, OURS)), ("rival", key)) if k in cold]
            row["note"] = "; ".join([rival.note, *(f"{side} compiled in every call" for side in late)])
            rows.append(row)
    samples = [
        {"name": name, "side": side, "round": i, "ms": ms} for (name, side), all_ in times.items() for i, ms in enumerate(all_)
    ]
    return rows, samples
