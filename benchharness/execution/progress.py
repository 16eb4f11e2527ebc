"""How a run tells how far it is: bars in a terminal, lines elsewhere."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from benchharness.study.config import Job

ANSWERED = 0.98  # share of the mirror's pixels; what answers fewer is mentioned


class Bars:
    """A bar per scene configuration, in frames."""

    def __init__(self, console: Console, progress: Progress) -> None:
        self._console, self._progress, self._task = console, progress, None

    def job(self, number: int, job: Job, left: int) -> None:
        done = len(job.frames) - left
        self._task = self._progress.add_task(_title(job), total=len(job.frames), completed=done)

    def frame(self, frame: int, records: list[dict]) -> None:
        if self._task is not None:
            self._progress.advance(self._task)
        for text in remarks(records):
            self.note(f"  frame {frame}: {text}")

    def note(self, text: str) -> None:
        self._console.print(text, markup=False, highlight=False)


class Lines:
    """A line per frame; nothing is drawn over."""

    def __init__(self, console: Console) -> None:
        self._console = console

    def job(self, number: int, job: Job, left: int) -> None:
        self.note(f"{_title(job)}: {left} of {len(job.frames)} frames, {len(job.entries)} methods with parameters")

    def frame(self, frame: int, records: list[dict]) -> None:
        counts = Counter(record["status"] for record in records)
        self.note(f"  frame {frame}: " + ", ".join(f"{count} {status}" for status, count in counts.items()))
        for text in remarks(records):
            self.note(f"    {text}")

    def note(self, text: str) -> None:
        self._console.print(text, markup=False, highlight=False, soft_wrap=True)


def remarks(records: list[dict]) -> list[str]:
    """What the user should know of a frame's rows beside their status: what nobody should rely on, and why."""
    found: dict[str, list[str]] = {}
    for record in records:
        coverage, reason = record.get("coverage"), None
        if record["status"] == "invalid":
            reason = f"not ranked: {record['reason']}"
        elif record["status"] == "ok" and record.get("reflector_px") == 0:
            reason = "no mirror in view: times, and no errors"
        elif record["status"] == "ok" and coverage is not None and coverage < ANSWERED:
            reason = f"no answer in {1 - coverage:.0%} of the mirror, shown as it is"
        if reason is not None:
            found.setdefault(reason, []).append(f"{record['method']} {record['params']}".strip())
    return [f"{reason} ({', '.join(who) if len(who) < len(records) else 'all'})" for reason, who in found.items()]


@contextmanager
def listener(console: Console) -> Iterator[Bars | Lines]:
    """The one that fits the console."""
    if not console.is_terminal:
        yield Lines(console)
        return
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    with Progress(*columns, console=console) as progress:
        yield Bars(console, progress)


def _title(job: Job) -> str:
    return f"{job.facts['scene']} ({job.facts['detail']})"
