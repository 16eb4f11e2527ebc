"""Runs one job in worker processes and survives them: a crash costs the entry in flight, and nothing else.

Yields the lines of the journal as they come true:

    {"job", "out": entry, "status", "reason"}            the entry gets no more frames of this job
    {"job", "frame", "records", "samples", "pictures"}   a frame is done; complete rows of results.csv and samples.csv

and what does not belong there:

    {"job", "note"}                                      something the user should read
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Collection, Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from benchharness.config import Entry, Job

LAST_WORDS_S = 30.0
"""How long a worker may take to end after it closed its stdout."""
TAIL = 400
"""Characters of the log that a row's reason quotes at most."""


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
class Past:
    """What the journal knows of a job: frames that are done, and entries that are out (-> their row's columns)."""

    done: set[int] = field(default_factory=set)
    out: dict[str, dict] = field(default_factory=dict)


@dataclass
class _Ending:
    """How a worker ended: `entry` in flight ("" for none) and what it died of; no `reason` if it did its work."""

    entry: str = ""
    status: str = "crashed"
    reason: str | None = None


def execute(number: int, job: Job, setting: Setting, past: Past) -> Iterator[dict]:
    """Does what is left of a job; `number` is its place in the run. Workers that fail are followed by another."""
    left = [frame for frame in job.frames if frame not in past.done]
    out = dict(past.out)
    waited = False
    while left:
        entries = [entry for entry in job.entries if entry.key not in out]
        ending = _Ending()
        if entries:
            for event in _worker(number, job, setting, entries, left, ending):
                if event["event"] == "out":
                    out[event["entry"]] = {"status": event["status"], "reason": event["reason"]}
                    yield {"job": number, "out": event["entry"], **out[event["entry"]]}
                elif event["event"] == "waits":
                    if not waited:
                        yield {"job": number, "note": event["text"]}
                    waited = True
                else:
                    left.remove(event["frame"])
                    line = _frame_line(number, job, setting, event, out)
                    out |= crashed_in(line)
                    yield line
        else:
            for frame in left:
                yield _frame_line(number, job, setting, {"frame": frame, "records": [], "samples": []}, out)
            return
        if ending.reason is None and any(entry.key not in out for entry in entries):
            ending.reason = "the worker ended before its work was done"
        if left and ending.reason is not None:
            blamed = [ending.entry] if ending.entry else [entry.key for entry in entries if entry.key not in out]
            for entry in blamed:
                out[entry] = {"status": ending.status, "reason": ending.reason}
                yield {"job": number, "out": entry, **out[entry]}


def _frame_line(number: int, job: Job, setting: Setting, event: dict, out: dict[str, dict]) -> dict:
    """Completes what the worker measured of a frame with the columns that it does not know."""
    measured = {record["entry"]: record for record in event["records"]}
    rows, entries = [], {entry.key: entry for entry in job.entries}
    for entry in job.entries:
        row = dict(out.get(entry.key) or measured[entry.key])
        row.pop("entry", None)
        about = {"frame": event["frame"], "method_hash": setting.hashes[entry.key], **_about(entry)}
        rows.append({**setting.columns, **job.facts, **about, **row})
    samples = []
    for sample in event["samples"]:
        about = _about(entries[sample["entry"]]) if sample["entry"] else {"method": "", "params": ""}
        place = {"scene": job.facts["scene"], "detail": job.facts["detail"], "frame": event["frame"]}
        samples.append({**place, **about, **{k: v for k, v in sample.items() if k != "entry"}})
    pictures = event.get("pictures", {})
    return {"job": number, "frame": event["frame"], "records": rows, "samples": samples, "pictures": pictures}


def crashed_in(line: dict) -> dict[str, dict]:
    """The entries that crashed in a frame, with an exception: they are out of the frames that follow."""
    return {
        f"{row['method']} {row['params']}".strip(): {"status": row["status"], "reason": row["reason"]}
        for row in line["records"]
        if row["status"] == "crashed"
    }


def _about(entry: Entry) -> dict[str, str]:
    return {"method": entry.method, "params": entry.params_text}


def _worker(
    number: int, job: Job, setting: Setting, entries: list[Entry], frames: Collection[int], ending: _Ending
) -> Iterator[dict]:
    """The "out", "frame" and "waits" events of one worker; how it ended is left in `ending`."""
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
    with open(log, "ab") as stream:
        start = stream.tell()
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "benchharness.worker", str(job_file)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=stream,
            env=surroundings(),
            start_new_session=True,
        )
    try:
        failed = yield from _events(process, setting.timeout_s, ending)
        if failed is None and process.wait(timeout=LAST_WORDS_S) != 0:
            failed = f"the worker ended with {cause(process.returncode)}"
        if failed is not None:
            where = "" if ending.entry else " outside any method"
            quoted = _tail(log, start)
            ending.reason = f"{failed}{where}" + (f": {quoted}" if quoted else "") + f" (see {log.name})"
    except subprocess.TimeoutExpired:
        ending.reason = "the worker closed its stdout and went on"
    finally:
        process.kill()
        process.wait()
        for stream in (process.stdin, process.stdout):
            assert stream is not None
            with contextlib.suppress(BrokenPipeError):
                stream.close()
        job_file.unlink(missing_ok=True)


def _events(process: subprocess.Popen, timeout_s: float, ending: _Ending) -> Iterator[dict]:
    """Yields "out", "frame" and "waits"; follows the rest. Returns what went wrong, None if stdout just ended."""
    lines: queue.SimpleQueue[bytes] = queue.SimpleQueue()

    def read() -> None:
        assert process.stdout is not None
        for line in process.stdout:
            lines.put(line)
        lines.put(b"")

    reader = threading.Thread(target=read, daemon=True)
    reader.start()
    deadline: float | None = time.monotonic() + timeout_s
    waits_for = "the preparation of the scene"
    while True:
        try:
            line = lines.get(timeout=None if deadline is None else max(0.0, deadline - time.monotonic()))
        except queue.Empty:
            ending.status = "timeout"
            process.kill()
            reader.join()
            return f"{waits_for} took more than {timeout_s:g} s"
        if not line.endswith(b"\n"):  # the end, or half a line of a worker that was killed
            return None
        event = json.loads(line)
        match event["event"]:
            case "watch":
                ending.entry = event["entry"]
            case "failed":
                return event["reason"]
            case "ready" | "start":
                deadline = time.monotonic() + timeout_s
                waits_for = f"frame {event['frame']}" if "frame" in event else waits_for
            case "waits":
                deadline = None
                yield event
            case _:
                yield event


def surroundings() -> dict[str, str]:
    """The environment of a child that imports what we import."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join(entry or os.getcwd() for entry in sys.path)}


def cause(code: int) -> str:
    """SIGABRT, or an exit code."""
    if code >= 0:
        return f"exit code {code}"
    try:
        return signal.Signals(-code).name
    except ValueError:
        return f"signal {-code}"


def _tail(log: Path, start: int) -> str:
    """The last lines that the worker logged, in one; Python's account of a native crash only if there are no others."""
    with open(log, "rb") as stream:
        stream.seek(start)
        text = stream.read().decode(errors="replace")
    said, _, stack = text.partition("Fatal Python error")
    lines = [line.strip() for line in (said.strip() or stack).splitlines() if line.strip()]
    return " | ".join(lines[-3:])[-TAIL:]
