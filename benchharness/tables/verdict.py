"""The verdict of a comparison: its findings, and the exit code that follows from them."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchharness.exits import Exit
from benchharness.tables.columns import GROUP

if TYPE_CHECKING:
    from benchharness.tables.times import Times

KINDS = ("regression", "not comparable", "incomplete", "warning", "improvement", "note")
EXITS = {"regression": Exit.REGRESSION, "not comparable": Exit.INCOMPARABLE, "incomplete": Exit.INCOMPLETE}
"""In this order: what is proven worse outweighs what could not be judged."""


@dataclass(frozen=True)
class Finding:
    """One difference. `frame` is None where it is about all frames; `size` orders the frames of one finding."""

    kind: str
    what: str
    text: str
    config: str = ""
    scene: str = ""
    detail: str = ""
    method: str = ""
    params: str = ""
    frame: int | None = None
    size: float = 0.0

    @classmethod
    def about(cls, record: Mapping, kind: str, what: str, text: str, size: float = 0.0, *, frame: bool = True) -> Finding:
        """A finding about the row that a record is of; `frame`: not about all its frames."""
        return cls(kind, what, text, *group(record), frame=record["frame"] if frame else None, size=size)

    @property
    def group(self) -> tuple[str, ...]:
        """What it is about, but for the frame."""
        return self.config, self.scene, self.detail, self.method, self.params


def group(record: Mapping) -> tuple[str, ...]:
    """Config, scene, detail, method and parameters of a record, "" for none."""
    return tuple(record[name] or "" for name in GROUP)


@dataclass(frozen=True)
class Verdict:
    """What a comparison found.

    runs     of the base and of the new side
    groups   (config, scene, detail, method, params) that both sides have; `rows` counts their frames
    times    None where nothing could be compared
    command  what made the new run, see `origin.read_command`
    """

    base: Path
    new: Path
    runs: tuple[int, int]
    groups: tuple[tuple[str, ...], ...]
    rows: int
    findings: tuple[Finding, ...]
    times: Times | None = None
    command: Mapping[str, Any] | None = None

    @property
    def exit_code(self) -> Exit:
        """The exit code that says it; see EXITS for which finding wins."""
        kinds = {finding.kind for finding in self.findings}
        return next((code for kind, code in EXITS.items() if kind in kinds), Exit.FINE)

    @property
    def conclusion(self) -> str:
        return f"verdict: {self.exit_code.says} (exit code {self.exit_code})"

    def reproduce(self, config: str, method: str) -> str:
        """The command that runs what a finding is about; CONFIG stands for a file that is not known here."""
        command = self.command or {"config": _file_of(config), "plugins": []}
        words = [_nearby(command["config"])]
        for plugin in command["plugins"]:
            words += ["--plugin", _nearby(plugin)]
        return shlex.join(["benchharness", "run", *words, *(["--only", method] if method else [])])

    def accept(self) -> str:
        """The command that makes the new side, its first run if it has several, the baseline."""
        run = self.new if self.new.is_dir() else self.new.parent
        if not (run / "results.csv").exists():
            run = min((file.parent for file in run.glob("*/results.csv")), default=run)
        return f"benchharness accept {shlex.quote(str(run))} --because TEXT"


def _file_of(config: str) -> str:
    """The file of a study that is known by its name alone, where it is at its usual place."""
    usual = (Path("configs") / f"{config}.toml", Path(f"{config}.toml"))
    return next((str(file) for file in usual if config and file.is_file()), "CONFIG")


def _nearby(path: str) -> str:
    """`path` relative to the working folder if it lies in it."""
    cwd = f"{Path.cwd()}/"
    return path.removeprefix(cwd)
