"""`benchharness needs`: every knob of every method in every scene of a config, and the tables of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from benchharness import platform
from benchharness.needs import cases, measuring, objects
from benchharness.render import making
from benchharness.render.ready import lit
from benchharness.render.reference import ReferenceOptions
from benchharness.scene import Scene
from benchharness.study import params, plugins
from benchharness.study.config import Config, Job
from benchharness.study.methods import Entry
from benchharness.tables import files, origin
from benchharness.tables.needs import (
    KNEE_KINDS,
    KNEES,
    NEEDS,
    NEEDS_OBJECTS,
    NEEDS_SAMPLES,
    OBJECT_KINDS,
    OBJECTS,
    SAMPLE_KINDS,
    SAMPLES,
)

EDGED = ("newton", "ray_traced", "environment_map")  # methods for which the scene's own edges are a knob, where they are there
LIT = "ray_traced"  # the method that shows what the light's noise is


def run(config: Config, wanted: Sequence[str], out: Path, console: Console) -> None:
    """Measures, and writes the tables after every knob and every object. `wanted`: scenes, all if empty. The machine's lock is
    held while frames are timed.

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
    platform.see_machine_lock()
    out.mkdir(parents=True, exist_ok=True)
    origin.write_environment(out, {**origin.environment(config.run.variant), "config": config.name})
    tables: dict[str, list[dict]] = {NEEDS_SAMPLES: [], NEEDS: [], NEEDS_OBJECTS: []}
    columns = {
        NEEDS_SAMPLES: (SAMPLES, SAMPLE_KINDS),
        NEEDS: (KNEES, KNEE_KINDS),
        NEEDS_OBJECTS: (OBJECTS, OBJECT_KINDS),
    }
    for table in tables:
        files.write(out / table, [], *columns[table])
    keys = {f"[reference] {name} = {value}" for name, value in config.reference.items()}
    keys.add(f"[run] size = {list(config.run.size)}")
    with console.status("") as status, making.told(making.teller(console, status, keys)):
        for name in wanted or jobs:
            for table, rows in _scene(jobs[name], config, status.update, console.print):
                tables[table] += rows
                files.write(out / table, tables[table], *columns[table])


def _scene(
    job: Job, config: Config, say: Callable[[str], None], waits: Callable[[str], None]
) -> Iterator[tuple[str, list[dict]]]:
    """New rows of tables: of every knob in a scene, then of every object."""
    options, label = ReferenceOptions(**config.reference), job.scene.label
    say(f"{label}: building")
    asked = lit(job.scene.build(), options.bake_spp, config.run.seed)
    scene, split = replace(asked, h_max=None), cases.short_edged(asked)
    setting = measuring.Setting((config.run.size[0], config.run.size[1]), job.frames, options, config.run.seed)
    bench = measuring.Bench(scene, setting, waits)
    for turn in _turns(job, scene, split, config.run.seed):
        samples, knee = measuring.turned(bench, label, turn, say)
        yield NEEDS_SAMPLES, samples
        if knee is not None:
            yield NEEDS, [knee]
    methods = {_named(entry): entry.build() for entry in job.entries}
    for row in objects.studied(bench, label, methods, say):
        yield NEEDS_OBJECTS, [row]


def _named(entry: Entry) -> str:
    """Method and what is set of it."""
    return f"{entry.method} {params.canonical(entry.set_by_hand)}".strip()


def _turns(job: Job, scene: Scene, split: Scene, seed: int):
    """The knobs of the methods, then those of the scene."""
    given = {entry.method: entry for entry in job.entries}
    for entry in given.values():
        yield from cases.of_method(entry, scene, split)
    for name in EDGED:
        if name in given:
            yield cases.of_edges(given[name], scene)
    if LIT in given:
        yield cases.of_light(LIT, given[LIT].build(), scene, seed)
