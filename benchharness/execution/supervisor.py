"""Runs one job in worker processes and survives them: a crash costs the entry that it is proven to be of, and nothing else.

Yields the lines of the journal as they come true:

    {"job", "out": entry, "status", "reason", "again"}   the entry gets no more frames of this job
    {"job", "frame", "records", "samples",               a frame is done; complete rows of results.csv and samples.csv, and
     "again", "pictures"}                                checksums of its pictures by name

and what does not belong there:

    {"job", "note"}                                      something the user should read
    {"job", "makes"}                                     how far light or a reference is, a `making.Share`

What proves that a death is an entry's: it died, or threw what nobody caught, while it was in flight, twice in one frame, or
was in flight when the time was over. A worker that died once may have been killed by anybody. Where it dies again outside
any entry, the frame is done in halves of the entries, down to those without which it lives. They, and whatever went wrong
with the scene or the machine, are not held against any entry: the frame has its rows, and is done anew when the run is
taken up (`again`: true, and in a frame the entries of which that holds).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from benchharness.execution import attempt
from benchharness.execution.attempt import Ending, Setting
from benchharness.render import making
from benchharness.study.config import Job
from benchharness.study.methods import Entry


@dataclass
class Past:
    """What the journal knows of a job: frames that are done, and entries that are out (-> their row's columns)."""

    done: set[int] = field(default_factory=set)
    out: dict[str, dict] = field(default_factory=dict)


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
            ending = Ending()
            for event in attempt.events(self.number, self.job, self.setting, entries, self.left, ending):
                if event["event"] == "out":
                    yield self._leaves(event["entry"], {"status": event["status"], "reason": event["reason"]})
                elif event["event"] in ("makes", "waits"):
                    yield from self._beside(event)
                else:
                    yield self._done(event["frame"], event["records"], event["samples"], event["pictures"])
                    self.lost = False
            if self.left and ending.reason is not None:
                yield from self._after(ending)

    def _within(self, entries: Sequence[Entry]) -> list[Entry]:
        return [entry for entry in entries if entry.key not in self.out]

    def _after(self, ending: Ending) -> Iterator[dict]:
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

    def _first(self, ending: Ending) -> bool:
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
            part, ending, done = parts.popleft(), Ending(), False
            for event in attempt.events(self.number, self.job, self.setting, part, [frame], ending):
                if event["event"] == "out":
                    yield self._leaves(event["entry"], {"status": event["status"], "reason": event["reason"]})
                    continue
                if event["event"] in ("makes", "waits"):
                    yield from self._beside(event)
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

    def _leaves(self, key: str, columns: dict, *, again: bool = False) -> dict:
        """The line that says that an entry gets no more frames."""
        self.out[key] = columns
        if again:
            self.again.add(key)
        return {"job": self.number, "out": key, **columns, "again": again}

    def _beside(self, event: dict) -> Iterator[dict]:
        """What is not for the journal: how far something is; and the note, once per job, that another process is timing."""
        if event["event"] == "makes":
            yield {"job": self.number, "makes": making.share_of(event)}
        elif not self.waited:
            self.waited = True
            yield {"job": self.number, "note": event["text"]}

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
            about = {"frame": frame, "family": entry.family, "method_hash": self.setting.hashes[entry.key], **_about(entry)}
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
