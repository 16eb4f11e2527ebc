"""How a run tells how far it is: bars in a terminal, lines elsewhere. Both say how long light and references will take yet, and
with which key they would be quicker."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

from benchharness.render.making import SELDOM_S, Pace, Share, Teller
from benchharness.study.config import Job
from benchharness.tables.remarks import remarks


class Bars:
    """A bar per scene configuration, in frames, and below it one of what is being made for it."""

    def __init__(self, console: Console, progress: Progress) -> None:
        self._console, self._progress, self._task = console, progress, None
        self._made: TaskID | None = None
        self._pace = Pace()
        self._advised: set[str] = set()

    def job(self, number: int, job: Job, left: int) -> None:
        self._made_no_more()
        done = len(job.frames) - left
        self._task = self._progress.add_task(escape(_title(job)), total=len(job.frames), completed=done)

    def frame(self, frame: int, records: list[dict]) -> None:
        if self._task is not None:
            self._progress.advance(self._task)
        for text in remarks(records):
            self.note(f"  frame {frame}: {text}")

    def making(self, share: Share) -> None:
        going = self._pace.hear(share)
        if self._made is None:
            self._made = self._progress.add_task("", total=share.total)
        self._progress.update(self._made, description=escape(f"  {going.text}"), completed=share.done, total=share.total)
        if going.advice and going.advice not in self._advised:
            self._advised.add(going.advice)
            self.note(f"  {going.text}; {going.advice}")
        if going.ends:
            self._made_no_more()

    def _made_no_more(self) -> None:
        if self._made is not None:
            self._progress.remove_task(self._made)
        self._made = None

    def note(self, text: str) -> None:
        self._console.print(text, markup=False, highlight=False)


class Lines:
    """A line per frame, and seldom ones of what is being made; nothing is drawn over."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._teller = Teller(lambda text: self.note(f"  {text}"), SELDOM_S)

    def job(self, number: int, job: Job, left: int) -> None:
        self.note(f"{_title(job)}: {left} of {len(job.frames)} frames, {len(job.entries)} methods with parameters")

    def frame(self, frame: int, records: list[dict]) -> None:
        counts = Counter(record["status"] for record in records)
        self.note(f"  frame {frame}: " + ", ".join(f"{count} {status}" for status, count in counts.items()))
        for text in remarks(records):
            self.note(f"    {text}")

    def making(self, share: Share) -> None:
        self._teller(share)

    def note(self, text: str) -> None:
        self._console.print(text, markup=False, highlight=False, soft_wrap=True)


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
