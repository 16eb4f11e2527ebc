"""`benchharness needs`: every knob of every method in every scene of a config, and the tables of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from benchharness import platform
from benchharness.needs import cases, measuring
from benchharness.render.ready import lit
from benchharness.render.reference import ReferenceOptions
from benchharness.scene import Scene
from benchharness.study import plugins
from benchharness.study.config import Config, Job
from benchharness.tables import files, origin
from benchharness.tables.needs import KNEE_KINDS, KNEES, NEEDS, NEEDS_SAMPLES, SAMPLE_KINDS, SAMPLES

EDGED = ("newton", "ray_traced", "environment_map")  # methods for which the scene's own edges are a knob, where they are there
LIT = "ray_traced"  # the method that shows what the light's noise is


def run(config: Config, wanted: Sequence[str], out: Path, console: Console) -> None:
    """Measures, and writes the tables after every knob. `wanted`: scenes, all if empty.

    Raises ValueError for a scene that the config has not, and for a folder in use.
    """
    jobs = {job.scene.label: job for job in config.jobs}
    for name in wanted:
        if name not in jobs:
            raise ValueError(f"needs: scene {plugins.unknown(name, jobs)}")
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise ValueError(f"--out {out} is in use; accepted: an empty or a new folder")
    platform.use_variant(config.run.variant)
    import drjit as dr

    dr.set_log_level(dr.LogLevel.Error)  # kernels are recorded for every model, more often than Dr.Jit finds natural
    out.mkdir(parents=True, exist_ok=True)
    origin.write_environment(out, {**origin.environment(config.run.variant), "config": config.name})
    rows: list[dict] = []
    knees: list[dict] = []
    with platform.alone(console.print), console.status("") as status:
        for name in wanted or jobs:
            for turn_rows, knee in _scene(jobs[name], config, status.update):
                rows += turn_rows
                knees += [] if knee is None else [knee]
                files.write(out / NEEDS_SAMPLES, rows, SAMPLES, SAMPLE_KINDS)
                files.write(out / NEEDS, knees, KNEES, KNEE_KINDS)


def _scene(job: Job, config: Config, say: Callable[[str], None]):
    """The rows and the knee of every knob in a scene."""
    options, label = ReferenceOptions(**config.reference), job.scene.label
    say(f"{label}: building")
    asked = lit(job.scene.build(), options.bake_spp, config.run.seed)
    scene, split = replace(asked, h_max=None), cases.short_edged(asked)
    bench = measuring.Bench(
        scene, measuring.Setting((config.run.size[0], config.run.size[1]), job.frames, options, config.run.seed)
    )
    for turn in _turns(job, scene, split, config.run.seed):
        yield measuring.turned(bench, label, turn, say)


def _turns(job: Job, scene: Scene, split: Scene, seed: int):
    """The knobs of the methods, then those of the scene."""
    given = {entry.method: entry for entry in job.entries}
    for entry in given.values():
        yield from cases.of_method(entry, scene, split)
    for name in EDGED:
        if name in given:
            yield cases.of_edges(name, given[name].build(), scene)
    if LIT in given:
        yield cases.of_light(LIT, given[LIT].build(), scene, seed)
