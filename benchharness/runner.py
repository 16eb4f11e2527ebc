"""Jobs -> records: the only loop over scenes, frames and methods, and the run folder that it fills.

A run folder holds `run.json` (what was asked for), `journal.jsonl` (one line per finished frame, on the disk before the
next frame starts), `worker-N.log`, `images/`, and at the end the tables and the report. A run that was killed loses the
frame in flight; `resume` reads the journal and does the rest. Rows come out in the order of the config (scene, frame,
method, parameters), however often it was interrupted.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator
from contextlib import nullcontext
from datetime import datetime
from pathlib import Path
from typing import Any, Protocol

from benchharness import platform, results, supervisor
from benchharness.config import Config, Job

BENCH = "benchharness.measure:Bench"
RUNS = Path("results") / "runs"

FINE, INCOMPLETE = 0, 3
BROKEN = ("crashed", "timeout")


class Incomparable(Exception):
    """A run cannot be taken up, since something changed that its rows depend on. Exit code 4."""


class Listener(Protocol):
    """Who is told how a run goes."""

    def job(self, number: int, job: Job, left: int) -> None:
        """A job begins, with so many frames to do."""

    def frame(self, frame: int, records: list[dict]) -> None:
        """A frame is done."""

    def note(self, text: str) -> None:
        """Something the user should read."""


def run(
    config: Config,
    out: Path | None,
    listener: Listener,
    *,
    resume: bool = False,
    cluster: str | None = None,
    bench: str | None = None,
) -> tuple[int, Path]:
    """Runs a study, or the rest of it; returns the exit code and the run folder.

    out      the run folder; a new one under results/runs/ if None, or, to resume, the newest one of this config there
    cluster  address of a distributed scheduler that jobs are given to; this machine if None
    bench    `module:Class` of what measures, see `worker.Bench`; BENCH if None

    Raises ValueError for a folder that cannot be used, Incomparable where the folder's run was another.
    """
    with platform.alone(listener.note) if cluster is None else nullcontext():
        environment = results.environment(config.run.variant)
        plan = _plan(config, results.environment_hash(environment))
        folder = _taken_up(config, out, plan) if resume else _fresh(config, out, plan)
        journal = Journal(folder / "journal.jsonl")
        pasts = _pasts(config, journal.lines())
        setting = _setting(config, folder, plan["environment"], bench or BENCH)
        (folder / "images").mkdir(exist_ok=True)
        for line in _lines(config, setting, pasts, listener, cluster):
            journal.append(line)
            if "frame" in line:
                listener.frame(line["frame"], line["records"])
            elif line["status"] in BROKEN:
                listener.note(f"{line['status']}: {line['out']}: {line['reason']}")
        records, samples = _tables(journal.lines())
        notes = {"scenes": {job.scene.label: "; ".join(job.notes) for job in config.jobs if job.notes}}
        _write(folder, records, samples, environment | (notes if notes["scenes"] else {}))
    statuses = {record["status"] for record in records}
    complete = not statuses & set(BROKEN) and "ok" in statuses
    return FINE if complete else INCOMPLETE, folder


class Journal:
    """Lines of JSON, each on the disk when `append` returns. A last line that a crash cut short is cut away."""

    def __init__(self, path: Path) -> None:
        self.path = path
        if path.exists():
            os.truncate(path, path.read_bytes().rfind(b"\n") + 1)

    def lines(self) -> list[dict]:
        """All lines. Raises ValueError for one that is damaged."""
        if not self.path.exists():
            return []
        found = []
        for number, line in enumerate(self.path.read_bytes().splitlines(), 1):
            try:
                found.append(json.loads(line))
            except ValueError as error:
                raise ValueError(f"{self.path}: line {number} is damaged ({error}); accepted: a new run") from None
        return found

    def append(self, line: dict) -> None:
        with open(self.path, "ab") as stream:
            stream.write((json.dumps(line) + "\n").encode())
            stream.flush()
            os.fsync(stream.fileno())


def _lines(
    config: Config, setting: supervisor.Setting, pasts: list[supervisor.Past], listener: Listener, cluster: str | None
) -> Iterator[dict]:
    """New lines of the journal: job after job on this machine, or as they come from a cluster."""
    if cluster is not None:
        from benchharness.cluster import execute_on

        yield from execute_on(cluster, config.jobs, setting, pasts)
        return
    for number, (job, past) in enumerate(zip(config.jobs, pasts, strict=True)):
        listener.job(number, job, len(job.frames) - len(past.done))
        for note in job.notes:
            listener.note(f"  {note}")
        yield from supervisor.execute(number, job, setting, past)


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


def _setting(config: Config, folder: Path, environment: str, bench: str) -> supervisor.Setting:
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
        "run": folder.name,
        "config": config.name,
        "variant": run.variant,
        "reference_lighting": reference["lighting"],
        "config_hash": config.config_hash,
        "environment": environment,
    }
    return supervisor.Setting(document, columns, config.method_hashes, str(folder.resolve()), run.timeout_s)


def _pasts(config: Config, lines: Iterable[dict]) -> list[supervisor.Past]:
    """What is done and out. What nobody is to blame for is neither: it is tried again."""
    pasts = [supervisor.Past() for _ in config.jobs]
    for line in lines:
        past = pasts[line["job"]]
        if "frame" not in line:
            if not line.get("again"):
                past.out[line["out"]] = {"status": line["status"], "reason": line["reason"]}
        elif line.get("again"):
            past.done.discard(line["frame"])
        else:
            past.done.add(line["frame"])
            past.out |= supervisor.crashed_in(line)
    return pasts


def _tables(lines: Iterable[dict]) -> tuple[list[dict], list[dict]]:
    """Records and samples of all frames, jobs and frames in their order; of a frame that was done anew, the last ones."""
    found = {(line["job"], line["frame"]): line for line in lines if "frame" in line}
    frames = [found[place] for place in sorted(found)]
    return [r for line in frames for r in line["records"]], [s for line in frames for s in line["samples"]]


def _write(folder: Path, records: list[dict], samples: list[dict], environment: dict) -> None:
    results.write_results(folder, records)
    results.write_samples(folder, samples)
    results.write_environment(folder, environment)
    from benchharness import report

    report.write(folder)


def _fresh(config: Config, out: Path | None, plan: dict) -> Path:
    """A new run folder. Raises ValueError if there is something in it, or it cannot be written."""
    folder = out or RUNS / f"{config.name}-{datetime.now():%Y%m%d-%H%M%S}"
    if (folder / "run.json").exists():
        raise ValueError(f"--out {folder} holds a run; accepted: an empty folder, or --resume to take that run up")
    try:
        if folder.is_dir() and any(folder.iterdir()):
            raise ValueError(f"--out {folder} is not empty and holds no run; accepted: an empty or a new folder")
        folder.mkdir(parents=True, exist_ok=True)
        results.write_atomic(folder / "run.json", json.dumps(plan, indent=2) + "\n")
    except OSError as error:
        raise ValueError(f"--out {folder} cannot be written: {error}; accepted: a folder that can") from None
    return folder


def _taken_up(config: Config, out: Path | None, plan: dict) -> Path:
    """The folder of the run to resume. Raises ValueError if there is none, Incomparable if it was another run."""
    if out is None:
        stamped = RUNS.glob(f"{config.name}-{'[0-9]' * 8}-{'[0-9]' * 6}/run.json")
        earlier = sorted(path.parent for path in stamped)
        if not earlier:
            raise ValueError(f"--resume: there is no run of {config.name} in {RUNS}; accepted: --out with its folder")
        out = earlier[-1]
    file = out / "run.json"
    try:
        before = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ValueError(f"--resume: {out} holds no run ({error}); accepted: a run folder") from None
    changed = [name for name in plan if json.dumps(before.get(name)) != json.dumps(plan[name])]
    if changed:
        details = "; ".join(f"{name}: {_difference(before.get(name), plan[name])}" for name in changed)
        raise Incomparable(f"--resume: the run in {out} was another one ({details}); start a new run")
    return out


def _difference(before: Any, now: Any) -> str:
    """Which keys differ, or both values."""
    if isinstance(before, dict) and isinstance(now, dict):
        names = [name for name in {**before, **now} if before.get(name) != now.get(name)]
        return ", ".join(f"{name!r} changed, is new or is gone" for name in names) or "another order"
    return f"{before} -> {now}"
