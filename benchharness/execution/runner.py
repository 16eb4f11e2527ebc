"""Jobs -> records: the only loop over scenes, frames and methods, and what it leaves in the run's folder.

Besides what every run leaves (`benchharness.execution.folder`) that is `worker-N.log`, and at the end the tables. A run
that was killed loses the frame in flight; `resume` reads the journal and does the rest. Rows come out in the order of the
config (scene, frame, method, parameters), however often it was interrupted.

Lines of the journal are what `benchharness.execution.supervisor` yields.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from benchharness import platform
from benchharness.execution import attempt, estimate, folder, supervisor
from benchharness.execution.folder import Journal
from benchharness.exits import Exit
from benchharness.render.making import Share
from benchharness.study.config import Config, Job
from benchharness.tables import origin, results
from benchharness.tables.columns import BROKEN

BENCH = "benchharness.measure.bench:Bench"


class Listener(Protocol):
    """Who is told how a run goes."""

    def job(self, number: int, job: Job, left: int) -> None:
        """A job begins, with so many frames to do."""

    def frame(self, frame: int, records: list[dict]) -> None:
        """A frame is done."""

    def making(self, share: Share) -> None:
        """Light or a reference gets on."""

    def note(self, text: str) -> None:
        """Something the user should read."""


def run(
    config: Config,
    out: Path | None,
    listener: Listener,
    *,
    resume: bool = False,
    yes: bool = False,
    cluster: str | None = None,
    bench: str | None = None,
) -> tuple[Exit, Path]:
    """Runs a study, or the rest of it; returns the exit code and the run folder.

    out      the run folder; a new one under results/runs/ if None, or, to resume, the newest one of this config there
    yes      begin, however long it may take
    cluster  address of a distributed scheduler that jobs are given to; this machine if None
    bench    `module:Class` of what measures, see `worker.Bench`; BENCH if None

    Raises ValueError for a folder that cannot be used and, unless `yes`, for a run that takes too long; Incomparable where
    the folder's run was another.
    """
    environment = origin.environment(config.run.variant)
    plan = _plan(config, origin.environment_hash(environment))
    with ExitStack() as held:
        client = None
        if cluster is not None:
            from benchharness.execution.cluster import connected

            client = held.enter_context(connected(cluster, listener.note))
        else:
            platform.see_machine_lock()
        if not resume:
            estimate.agreed(*estimate.of_run(config, [len(job.frames) for job in config.jobs]), listener.note, yes=yes)
        place = held.enter_context(folder.opened(config.name, out, plan, resume=resume))
        journal = Journal(place / folder.JOURNAL)
        lines = _checked(config, journal)
        tasks = [*_again(config, lines, place / folder.IMAGES, listener), *_tasks(config, _pasts(config, lines))]
        if resume:
            left = [sum(task.left for task in tasks if task.number == n) for n in range(len(config.jobs))]
            estimate.agreed(*estimate.of_run(config, left), listener.note, yes=yes)
        setting = _setting(config, place, plan["environment"], bench or BENCH)
        for line in _lines(tasks, setting, listener, client):
            if "note" in line:
                listener.note(line["note"])
                continue
            if "makes" in line:
                listener.making(line["makes"])
                continue
            journal.append(line)
            if "frame" in line:
                listener.frame(line["frame"], line["records"])
            elif line["status"] in BROKEN:
                listener.note(f"{line['status']}: {line['out']}: {line['reason']}")
        records, samples = _tables(journal.lines())
        notes = {"scenes": {job.scene.label: "; ".join(job.notes) for job in config.jobs if job.notes}}
        _write(place, records, samples, environment | (notes if notes["scenes"] else {}))
    asked = sum(len(job.frames) * len(job.entries) for job in config.jobs)
    return exit_code([record["status"] for record in records], asked), place


def exit_code(statuses: Sequence[str], asked: int) -> Exit:
    """Fine where there is an answer in each of the rows `asked` for, or a refusal, and at least one answer."""
    broken = {*BROKEN, "invalid"} & set(statuses)
    return Exit.FINE if len(statuses) == asked and "ok" in statuses and not broken else Exit.INCOMPLETE


class _Record(BaseModel):
    model_config = ConfigDict(extra="allow")
    method: str
    params: str
    status: Literal["ok", "refused", "invalid", "timeout", "crashed"]


class _FrameLine(BaseModel):
    job: Annotated[int, Field(ge=0)]
    frame: int
    records: list[_Record]
    samples: list[dict[str, Any]]
    pictures: dict[str, str] = {}
    again: list[str] = []


class _OutLine(BaseModel):
    job: Annotated[int, Field(ge=0)]
    out: str
    status: Literal["refused", "invalid", "timeout", "crashed"]
    reason: str
    again: bool = False


_LINE = TypeAdapter(_FrameLine | _OutLine)


def _checked(config: Config, journal: Journal) -> list[dict]:
    """The lines of a run's journal. Raises ValueError for one that is not of this run."""
    lines = journal.lines()
    for number, line in enumerate(lines, 1):
        try:
            found = _LINE.validate_python(line, strict=True)
        except ValidationError as error:
            first = error.errors()[0]
            journal.refuse(number, f"{'.'.join(map(str, first['loc']))}: {first['msg']}")
        if found.job >= len(config.jobs):
            journal.refuse(number, f"job is {found.job}, of {len(config.jobs)}")
        job = config.jobs[found.job]
        if isinstance(found, _OutLine):
            if found.out not in {entry.key for entry in job.entries}:
                journal.refuse(number, f"out is {found.out!r}, which is no method of this run")
        elif found.frame not in job.frames:
            journal.refuse(number, f"frame is {found.frame}, of {job.frames}")
        elif [(r.method, r.params) for r in found.records] != [(e.method, e.params_text) for e in job.entries]:
            journal.refuse(number, "the rows are not those of this run")
    return lines


@dataclass(frozen=True)
class Task:
    """What is left of a job, `number` in the run, or a part of it."""

    number: int
    job: Job
    past: supervisor.Past

    @property
    def left(self) -> int:
        """How many frames."""
        return len({*self.job.frames} - self.past.done)


def _tasks(config: Config, pasts: Iterable[supervisor.Past]) -> list[Task]:
    return [Task(number, job, past) for number, (job, past) in enumerate(zip(config.jobs, pasts, strict=True))]


def _again(config: Config, lines: Iterable[dict], images: Path, listener: Listener) -> list[Task]:
    """Frames whose pictures are not what they were, and those that lost entries which nobody is to blame for: once more, with
    the entries that had an answer there, or may have one."""
    found: dict[tuple[int, str], tuple[set[int], dict[str, dict]]] = {}
    for (number, frame), line in _last(lines).items():
        job, again = config.jobs[number], line.get("again", [])
        lost = folder.lost(images, line.get("pictures", {}))
        if lost:
            named = f"{job.facts['scene']}, frame {frame}"
            listener.note(f"{named}: done again, since pictures are gone or changed: {', '.join(lost[:3])}")
        if lost or again:
            out = {
                entry.key: {"status": record["status"], "reason": record["reason"]}
                for entry, record in zip(job.entries, line["records"], strict=True)
                if record["status"] in (*BROKEN, "refused") and entry.key not in again
            }
            found.setdefault((number, json.dumps(out)), (set(), out))[0].add(frame)
    return [
        Task(number, config.jobs[number], supervisor.Past({*config.jobs[number].frames} - frames, out))
        for (number, _), (frames, out) in found.items()
    ]


def _last(lines: Iterable[dict]) -> dict[tuple[int, int], dict]:
    """Job and frame -> the line of that frame, the last one if it was done again; jobs and frames in their order."""
    found = {(line["job"], line["frame"]): line for line in lines if "frame" in line}
    return {place: found[place] for place in sorted(found)}


def _lines(tasks: Sequence[Task], setting: attempt.Setting, listener: Listener, client: Any) -> Iterator[dict]:
    """New lines of the journal: task after task on this machine, or as they come from a cluster."""
    if client is not None:
        from benchharness.execution.cluster import execute_on

        yield from execute_on(client, setting, [(task.number, task.job, task.past) for task in tasks])
        return
    for task in tasks:
        listener.job(task.number, task.job, task.left)
        for note in task.job.notes:
            listener.note(f"  {note}")
        yield from supervisor.execute(task.number, task.job, setting, task.past)


def _plan(config: Config, environment: str) -> dict[str, Any]:
    """What the rows depend on; a run is taken up only with the same."""
    return {
        "config": config.name,
        "config_hash": config.config_hash,
        "scenes": {job.facts["scene"] + " " + job.facts["detail"]: job.facts["scene_hash"] for job in config.jobs},
        "frames": [job.frames for job in config.jobs],
        "methods": config.method_hashes,
        "environment": environment,
    }


def _setting(config: Config, place: Path, environment: str, bench: str) -> attempt.Setting:
    run, reference = config.run, config.reference
    document = {
        "variant": run.variant,
        "size": run.size,
        "reference": reference,
        "seed": run.seed,
        "rounds": (run.min_rounds, run.max_rounds),
        "bench": bench,
    }
    columns = {
        "run": place.name,
        "config": config.name,
        "variant": run.variant,
        "reference_lighting": reference["lighting"],
        "config_hash": config.config_hash,
        "environment": environment,
    }
    return attempt.Setting(document, columns, config.method_hashes, str(place.resolve()), run.timeout_s)


def _pasts(config: Config, lines: Iterable[dict]) -> list[supervisor.Past]:
    """What is done and out. What nobody is to blame for is not out: it is tried again, see `_again`."""
    pasts = [supervisor.Past() for _ in config.jobs]
    for line in lines:
        past = pasts[line["job"]]
        if "frame" in line:
            past.done.add(line["frame"])
            past.out |= supervisor.crashed_in(line)
        elif not line.get("again"):
            past.out[line["out"]] = {"status": line["status"], "reason": line["reason"]}
    return pasts


def _tables(lines: Iterable[dict]) -> tuple[list[dict], list[dict]]:
    """Records and samples of all frames, jobs and frames in their order."""
    frames = _last(lines).values()
    return [r for line in frames for r in line["records"]], [s for line in frames for s in line["samples"]]


def _write(place: Path, records: list[dict], samples: list[dict], environment: dict) -> None:
    results.write_results(place, records)
    results.write_samples(place, samples)
    origin.write_environment(place, environment)
