"""One worker as it looks from where it was started: what it says, checked, and how it ended.

What it may say is told in `benchharness.execution.worker`. Plugins can write on its channel too: a line that nobody understands
ends it.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Collection, Generator, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from benchharness import processes
from benchharness.render import making
from benchharness.study.config import Entry, Job

WORDS = {
    "out": {"entry", "status", "reason"},
    "ready": set(),
    "start": {"frame"},
    "makes": {"what", "done", "total", "cheaper"},
    "watch": {"entry"},
    "waits": {"text"},
    "frame": {"frame", "records", "samples", "pictures"},
    "failed": {"reason", "machine"},
    "done": set(),
}
"""What a worker may say, see `benchharness.execution.worker`."""


@dataclass(frozen=True)
class Setting:
    """What all jobs of a run have in common.

    document  the part of the worker's job file that all share: variant, size, reference, seed, rounds, bench
    columns   columns of results.csv that all rows share
    hashes    Entry.key -> method_hash
    folder    run folder: the worker's log and job file go there, its pictures to images/
    """

    document: dict[str, Any]
    columns: dict[str, Any]
    hashes: dict[str, str]
    folder: str
    timeout_s: float


@dataclass
class Ending:
    """How a worker ended.

    entry    in flight, "" for none
    frame    in flight, None before the first
    reason   what it died of; None if it did its work
    status   of the rows that it costs
    machine  whether files or devices were the reason
    """

    entry: str = ""
    frame: int | None = None
    reason: str | None = None
    status: str = "crashed"
    machine: bool = False

    @property
    def columns(self) -> dict[str, Any]:
        return {"status": self.status, "reason": self.reason}


def events(
    number: int, job: Job, setting: Setting, entries: list[Entry], frames: Collection[int], ending: Ending
) -> Iterator[dict]:
    """The "out", "frame", "makes" and "waits" events of one worker; how it ended is left in `ending`."""
    folder = Path(setting.folder)
    job_file, log = folder / f"job-{number}.json", folder / f"worker-{number}.log"
    document = {
        **setting.document,
        "scene": asdict(job.scene),
        "entries": [asdict(entry) for entry in entries],
        "frames": list(frames),
        "images": job.images,
        "out": str(folder / "images"),
        "parent": os.getpid(),
    }
    job_file.write_text(json.dumps(document), encoding="utf-8")
    child = processes.Child("benchharness.execution.worker", str(job_file), log=log)
    try:
        failed = yield from heard(child, setting.timeout_s, {entry.key for entry in entries}, set(frames), ending)
        if failed == "":
            failed = f"the worker ended with {child.cause()} before its work was done"
        if failed is not None:
            where = "" if ending.entry else " outside any method"
            quoted = child.words()
            ending.reason = f"{failed}{where}" + (f": {quoted}" if quoted else "") + f" (see {log.name})"
    finally:
        child.end()
        job_file.unlink(missing_ok=True)


def heard(
    child: processes.Child, timeout_s: float, entries: set[str], frames: set[int], ending: Ending
) -> Generator[dict, None, str | None]:
    """Yields "out", "frame", "makes" and "waits"; follows the rest. Returns what went wrong, "" for a mere end, None if all is
    done. Light and references that get on have time: with each of their parts the clock begins anew."""
    deadline: float | None = time.monotonic() + timeout_s
    waits_for = "the preparation of the scene"
    while True:
        try:
            event = child.next(None if deadline is None else deadline - time.monotonic())
            if event is None:
                return ""
            _check(event, entries, frames)
        except TimeoutError:
            ending.status = "timeout"
            return f"{waits_for} took more than {timeout_s:g} s"
        except ValueError as error:
            return str(error)
        match event["event"]:
            case "done":
                return "the worker said that it had done what it had not" if frames and entries else None
            case "watch":
                ending.entry = event["entry"]
            case "failed":
                ending.machine = bool(event["machine"])
                return event["reason"]
            case "ready":
                deadline = time.monotonic() + timeout_s
                ending.frame = min(frames)
            case "start":
                deadline, waits_for = time.monotonic() + timeout_s, f"frame {event['frame']}"
                ending.frame = event["frame"]
            case "makes":
                if not ending.entry:
                    deadline = time.monotonic() + timeout_s
                yield event
            case "waits":
                deadline = None
                yield event
            case "out":
                entries.discard(event["entry"])
                yield event
            case "frame":
                frames.discard(event["frame"])
                ending.frame = min(frames, default=None)
                yield event


def _check(event: dict, entries: set[str], frames: set[int]) -> None:
    """Raises ValueError for what a worker does not say, such as a plugin that writes on its channel."""
    kind = event.get("event")
    known = kind in WORDS and WORDS[kind] <= set(event)
    if known and kind == "makes":
        making.share_of(event)
    known = known and event.get("entry", "") in entries | {""} and ("frame" not in event or event["frame"] in frames)
    if known and kind == "frame":
        records, samples = event["records"], event["samples"]
        known = all(isinstance(row, dict) and row.get("entry") in entries for row in records)
        known = known and len(records) == len(entries) and all(s.get("entry") in entries | {""} for s in samples)
    if not known:
        raise ValueError(f"the worker said what nobody understands: {json.dumps(event)[:80]}")
