"""Runs one job in worker processes and survives them: a crash costs the entry that it is proven to be of, and nothing else.

Yields the lines of the journal as they come true:

    {"job", "out": entry, "status", "reason", "again"}   the entry gets no more frames of this job
    {"job", "frame", "records", "samples",               a frame is done; complete rows of results.csv and samples.csv, and
     "again", "pictures"}                                checksums of its pictures by name

and what does not belong there:

    {"job", "note"}                                      something the user should read

What proves that a death is an entry's: it died, or threw what nobody caught, while it was in flight, twice in one frame, or
was in flight when the time was over. A worker that died once may have been killed by anybody. Where it dies again outside
any entry, the frame is done in halves of the entries, down to those without which it lives. They, and whatever went wrong
with the scene or the machine, are not held against any entry: the frame has its rows, and is done anew when the run is
taken up (`again`: true, and in a frame the entries of which that holds).
"""

from __future__ import annotations

import json
import os
import subprocess
import time
from collections import deque
from collections.abc import Collection, Generator, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from benchharness import processes
from benchharness.study.config import Job
from benchharness.study.methods import Entry

LAST_WORDS_S = 30.0
"""How long a worker may take to end after it closed its stdout."""
WORDS = {
    "out": {"entry", "status", "reason"},
    "ready": set(),
    "start": {"frame"},
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
class Past:
    """What the journal knows of a job: frames that are done, and entries that are out (-> their row's columns)."""

    done: set[int] = field(default_factory=set)
    out: dict[str, dict] = field(default_factory=dict)


@dataclass
class _Ending:
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


def execute(number: int, job: Job, setting: Setting, past: Past) -> Iterator[dict]:
    """Does what is left of a job; `number` is its place in the run. Workers that fail are followed by another."""
    return _Execution(number, job, setting, past).lines()


def crashed_in(line: dict) -> dict[str, dict]:
    """The entries that are proven to have crashed in a frame: they are out of the frames that follow."""
    rows = {f"{row['method']} {row['params']}".strip(): row for row in line["records"]}
    return {
        key: {"status": row["status"], "reason": row["reason"]}
        for key, row in rows.items()
        if row["status"] == "crashed" and key not in line.get("again", ())
    }


class _Execution:
    """What is left of a job.

    left     frames
    out      entries that get no more frames -> their columns
    again    those of them that are tried again when the run is taken up
    strikes  (frame, entry in flight) of deaths that may have been anybody's
    lost     the last frame is done, and no entry lived through it
    """

    def __init__(self, number: int, job: Job, setting: Setting, past: Past) -> None:
        self.number, self.job, self.setting = number, job, setting
        self.left = [frame for frame in job.frames if frame not in past.done]
        self.out = dict(past.out)
        self.again: set[str] = set()
        self.strikes: set[tuple[int | None, str]] = set()
        self.lost = False
        self.waited = False

    def lines(self) -> Iterator[dict]:
        while self.left:
            entries = self._within(self.job.entries)
            if not entries:
                for frame in list(self.left):
                    yield self._done(frame, [], [], {})
                return
            ending = _Ending()
            for event in _worker(self.number, self.job, self.setting, entries, self.left, ending):
                if event["event"] == "out":
                    yield self._leaves(event["entry"], {"status": event["status"], "reason": event["reason"]})
                elif event["event"] == "waits":
                    yield from self._waits(event["text"])
                else:
                    yield self._done(event["frame"], event["records"], event["samples"], event["pictures"])
                    self.lost = False
            if self.left and ending.reason is not None:
                yield from self._after(ending)

    def _within(self, entries: Sequence[Entry]) -> list[Entry]:
        return [entry for entry in entries if entry.key not in self.out]

    def _after(self, ending: _Ending) -> Iterator[dict]:
        """What a worker's end costs."""
        everyone = [entry.key for entry in self._within(self.job.entries)]
        if ending.status == "timeout":
            for key in [ending.entry] if ending.entry else everyone:
                yield self._leaves(key, ending.columns, again=not ending.entry)
        elif self._first(ending):
            return
        elif ending.entry:
            yield self._leaves(ending.entry, ending.columns)
        elif ending.frame is None or ending.machine or self.lost:
            for key in everyone:
                yield self._leaves(key, ending.columns, again=True)
        else:
            yield from self._in_halves(ending.frame)

    def _first(self, ending: _Ending) -> bool:
        """Whether a worker's death is the first of its kind, so that it may have been anybody's. Waiting in vain is not."""
        strike = ending.frame, ending.entry
        known = strike in self.strikes
        self.strikes.add(strike)
        return not known and ending.status != "timeout"

    def _in_halves(self, frame: int) -> Iterator[dict]:
        """A frame in which workers die outside any entry: done in parts, until those are alone without which they live."""
        entries = self._within(self.job.entries)
        records, samples, pictures, dead = [], [], {}, {}
        parts = deque(_halves(entries))
        while parts:
            part, ending, done = parts.popleft(), _Ending(), False
            for event in _worker(self.number, self.job, self.setting, part, [frame], ending):
                if event["event"] == "out":
                    yield self._leaves(event["entry"], {"status": event["status"], "reason": event["reason"]})
                    continue
                if event["event"] == "waits":
                    yield from self._waits(event["text"])
                    continue
                done = True
                records += event["records"]
                pictures |= event["pictures"]
                samples += [sample for sample in event["samples"] if sample["entry"] or not samples]
            part = [] if done else self._within(part)
            if ending.entry and self._first(ending):
                parts.append(part)
                continue
            if ending.entry or len(part) == 1:
                blamed = ending.entry or part[0].key
                dead[blamed] = ending.columns
                part = [entry for entry in part if entry.key != blamed]
            parts += _halves(part)
        self.lost = not records
        yield self._done(frame, records, samples, pictures, dead)
        if records:
            for key, columns in dead.items():
                yield self._leaves(key, columns, again=True)

    def _leaves(self, key: str, columns: dict, again: bool = False) -> dict:
        """The line that says that an entry gets no more frames."""
        self.out[key] = columns
        if again:
            self.again.add(key)
        return {"job": self.number, "out": key, **columns, "again": again}

    def _waits(self, text: str) -> Iterator[dict]:
        """The note, once per job, that another process is timing."""
        if not self.waited:
            yield {"job": self.number, "note": text}
        self.waited = True

    def _done(
        self,
        frame: int,
        records: list[dict],
        samples: list[dict],
        pictures: dict[str, str],
        dead: dict[str, dict] | None = None,
    ) -> dict:
        """The line of a frame: what the worker measured, completed with the columns that it does not know."""
        self.left.remove(frame)
        dead = dead or {}
        measured = {record["entry"]: record for record in records}
        rows, entries = [], {entry.key: entry for entry in self.job.entries}
        for entry in self.job.entries:
            row = dict(self.out.get(entry.key) or dead.get(entry.key) or measured[entry.key])
            row.pop("entry", None)
            about = {"frame": frame, "method_hash": self.setting.hashes[entry.key], **_about(entry)}
            rows.append({**self.setting.columns, **self.job.facts, **about, **row})
        place = {"scene": self.job.facts["scene"], "detail": self.job.facts["detail"], "frame": frame}
        raw = []
        for sample in samples:
            about = _about(entries[sample["entry"]]) if sample["entry"] else {"method": "", "params": ""}
            raw.append({**place, **about, **{k: v for k, v in sample.items() if k != "entry"}})
        again = [key for key in entries if key in self.again or key in dead]
        line = {"job": self.number, "frame": frame, "records": rows, "samples": raw, "again": again, "pictures": pictures}
        self.out |= crashed_in(line)
        return line


def _halves(entries: list[Entry]) -> list[list[Entry]]:
    """Two; fewer where there are fewer entries."""
    middle = len(entries) // 2
    return [half for half in (entries[:middle], entries[middle:]) if half]


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
        process = processes.start("benchharness.execution.worker", str(job_file), log=stream)
    try:
        failed = yield from _events(process, setting.timeout_s, {entry.key for entry in entries}, set(frames), ending)
        if failed == "":
            failed = f"the worker ended with {_code(process)} before its work was done"
        if failed is not None:
            where = "" if ending.entry else " outside any method"
            quoted = processes.tail(log, start)
            ending.reason = f"{failed}{where}" + (f": {quoted}" if quoted else "") + f" (see {log.name})"
    finally:
        processes.end(process)
        job_file.unlink(missing_ok=True)


def _code(process: subprocess.Popen) -> str:
    try:
        return processes.cause(process.wait(timeout=LAST_WORDS_S))
    except subprocess.TimeoutExpired:
        return "a closed channel"


def _events(
    process: subprocess.Popen, timeout_s: float, entries: set[str], frames: set[int], ending: _Ending
) -> Generator[dict, None, str | None]:
    """Yields "out", "frame" and "waits"; follows the rest. Returns what went wrong, "" for a mere end, None if all is done."""
    assert process.stdout is not None
    lines = processes.Lines(process.stdout)
    deadline: float | None = time.monotonic() + timeout_s
    waits_for = "the preparation of the scene"
    while True:
        try:
            event = lines.next(None if deadline is None else deadline - time.monotonic())
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
    known = known and event.get("entry", "") in entries | {""} and ("frame" not in event or event["frame"] in frames)
    if known and kind == "frame":
        records, samples = event["records"], event["samples"]
        known = all(isinstance(row, dict) and row.get("entry") in entries for row in records)
        known = known and len(records) == len(entries) and all(s.get("entry") in entries | {""} for s in samples)
    if not known:
        raise ValueError(f"the worker said what nobody understands: {json.dumps(event)[:80]}")
