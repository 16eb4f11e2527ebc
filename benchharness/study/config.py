"""A study: TOML -> validated config -> list of jobs, one per configuration of a scene.

    [run]              how to run: variant, size, frames, rounds (`benchharness.study.run`)
    [scenes.NAME]      what to render (`benchharness.study.scenes`)
    [reference]        what errors are measured against (see `reference.ReferenceOptions`)
    [methods.NAME]     with what (`benchharness.study.methods`)

A list sweeps: every combination is a row of its own. Whatever is wrong is a ValueError that names file, key, value and
what would be accepted, before any work is done. Methods and scenes are asked in a process of their own
(`benchharness.study.loading`, through `benchharness.study.apart`): what is here of them is what they said, as plain data.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from benchharness.study import document, identity, methods, params, plugins, scenes
from benchharness.study.apart import Apart
from benchharness.study.methods import Entry
from benchharness.study.run import Run, run_of
from benchharness.study.scenes import SceneSpec

MOST_SCENES = 256
"""Configurations of scenes in a study; each is built before the first is rendered."""
SAID_EVERY_S = 5.0


@dataclass(frozen=True)
class Job:
    """All frames and all methods of one configuration of a scene.

    frames  ascending
    images  those of them whose pictures are kept
    facts   columns of the table that the scene alone determines
    notes   sentences about what was wrong with the scene, and mended
    """

    scene: SceneSpec
    frames: list[int]
    images: list[int]
    facts: dict[str, Any]
    entries: list[Entry]
    notes: list[str]


@dataclass(frozen=True)
class Config:
    """A validated study. `reference`: the fields of `reference.ReferenceOptions`. `method_hashes` is by `Entry.key`."""

    name: str
    path: Path
    run: Run
    reference: dict[str, Any]
    jobs: list[Job]
    entries: list[Entry]
    config_hash: str
    method_hashes: dict[str, str] = field(default_factory=dict)


def load(
    path: Path, extra: Sequence[str] = (), only: Sequence[str] = (), tell: Callable[[str], None] = lambda text: None
) -> Config:
    """Reads and validates a config.

    extra  methods to add with their default parameters: `file.py` or `file.py:Name`, relative to the working folder
    only   names of the methods to keep; all if empty
    tell   hears how far it is, where that takes long

    Raises ValueError for what is wrong in the config, platform.EnvironmentBroken where the variant cannot be used.
    """
    tables = document.read(path)
    run = run_of(tables.get("run", {}), f"{path}: [run]")
    section, extra = _only(tables.get("methods", {}), extra, only)
    with Apart(run.variant) as apart:
        where, asked = f"{path}: [reference]", tables.get("reference", {})
        params.check_plain(asked, where)
        reference = apart.call("benchharness.study.loading:reference", where, table=asked, where=where)
        given = methods.distinct([*methods.entries(section, path, apart), *(methods.plugged_in(spec, apart) for spec in extra)])
        if not given:
            raise ValueError(f"{path}: there is no method to run; accepted: at least one [methods.NAME] or --plugin FILE")
        if len(given) > params.MOST_POINTS:
            most = f"{params.MOST_POINTS:,}"
            raise ValueError(f"{path}: there are {len(given):,} methods with parameters; accepted: at most {most}")
        specs = list(scenes.specs(tables.get("scenes", {}), path, apart))
        if len(specs) > MOST_SCENES:
            raise ValueError(f"{path}: there are {len(specs):,} configurations of scenes; accepted: at most {MOST_SCENES}")
        jobs = [_job(spec, run, given, path, apart) for spec in _slowly(specs, tell)]
    if not jobs:
        raise ValueError(f"{path}: there is no scene; accepted: at least one [scenes.NAME]")
    places = Counter((job.facts["scene"], job.facts["detail"]) for job in jobs)
    for place, count in places.items():
        if count > 1:
            raise ValueError(
                f"{path}: two configurations are called scene {place[0]!r}, detail {place[1]!r}; accepted: a builder "
                "that hands its `detail` on to the Scene"
            )
    determines = {k: v for k, v in asdict(run).items() if k in ("variant", "size", "frames", "seed")}
    config_hash = identity.of_options({"run": determines, "reference": reference})
    method_hashes = {entry.key: entry.method_hash for entry in given}
    return Config(path.stem, path.resolve(), run, reference, jobs, given, config_hash, method_hashes)


def _slowly(specs: Sequence[SceneSpec], tell: Callable[[str], None]) -> Iterator[SceneSpec]:
    """The scenes, with a word about how many are built every SAID_EVERY_S."""
    said = time.monotonic()
    for number, spec in enumerate(specs):
        if time.monotonic() - said > SAID_EVERY_S:
            tell(f"scene {spec.label}: building {number + 1} of {len(specs)}")
            said = time.monotonic()
        yield spec


def _only(section: Mapping[str, Any], extra: Sequence[str], only: Sequence[str]) -> tuple[dict[str, Any], list[str]]:
    """The tables and files of the methods to keep, before anything of the others is imported. Raises ValueError for a name
    that there is not."""
    named = {spec: plugins.name_of(spec) for spec in extra}
    names = list(dict.fromkeys([*section, *named.values()]))
    for name in only:
        if name not in names:
            raise ValueError(f"--only: method {plugins.unknown(name, names)}")
    kept = set(only or names)
    return {k: v for k, v in section.items() if k in kept}, [spec for spec, name in named.items() if name in kept]


def _job(spec: SceneSpec, run: Run, entries: list[Entry], path: Path, apart: Apart) -> Job:
    """Has the scene built once, to see that it can be rendered as asked, and keeps what the table says about it."""
    arguments = {"spec": asdict(spec), "run": asdict(run), "path": str(path)}
    said = apart.call("benchharness.study.scenes:examined", spec.where, timeout_s=run.timeout_s, **arguments)
    return Job(spec, said["frames"], said["images"], said["facts"], entries, said["notes"])
