"""The verdict of a comparison: findings, the exit code that follows from them, and both in words and for machines."""

from __future__ import annotations

import json
import math
import re
import shlex
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from benchharness.tables.times import Times

KINDS = ("regression", "not comparable", "incomplete", "warning", "improvement", "note")
EXIT_CODES = {"regression": 1, "not comparable": 4, "incomplete": 3}
"""In this order: what is proven worse outweighs what could not be judged."""
SAID = {0: "fine", 1: "a regression was found", 3: "incomplete", 4: "the two sides cannot be compared"}


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

    @property
    def group(self) -> tuple[str, ...]:
        """What it is about, but for the frame."""
        return self.config, self.scene, self.detail, self.method, self.params


@dataclass(frozen=True)
class Verdict:
    """What a comparison found.

    runs     of the base and of the new side
    groups   (config, scene, detail, method, params) that both sides have; `rows` counts their frames
    times    None where nothing could be compared
    command  what made the new run, see `results.read_command`
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
    def exit_code(self) -> int:
        """0 fine, 1 a regression, 3 incomplete, 4 not comparable (see EXIT_CODES for which wins)."""
        kinds = {finding.kind for finding in self.findings}
        return next((code for kind, code in EXIT_CODES.items() if kind in kinds), 0)

    @property
    def conclusion(self) -> str:
        return f"verdict: {SAID[self.exit_code]} (exit code {self.exit_code})"

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


# In words


def render(verdict: Verdict) -> str:
    """The verdict as text: what is worse first, the frames of one finding on one line, and what to type next."""
    lines = [f"base  {verdict.base}", f"new   {verdict.new}", f"rows  {verdict.rows} in both"]
    if verdict.times is not None and verdict.times.paces:
        lines.append(f"times {_paced(verdict.times)}")
    for kind in KINDS:
        groups = _grouped(verdict, kind)
        if groups:
            lines += ["", f"{kind.upper()}"]
        for group, findings in groups.items():
            about = _named(group)
            lines += [f"  {about}"] if about else []
            lines += [f"    {what:<16} {text}" for what, text in _merged(findings)]
            lines += [f"    {word:<16} {command}" for word, command in _next(verdict, kind, group)]
    return "\n".join([*lines, "", verdict.conclusion])


def _paced(times: Times) -> str:
    if times.unproven:
        return f"unproven: {times.unproven}"
    counts = Counter(pace.verdict for pace in times.paces)
    said = ", ".join(f"{counts[verdict]} {verdict}" for verdict in ("slow", "fast", "same", "ambiguous") if counts[verdict])
    drift = ", ".join(f"{clock} {100 * (ratio - 1):+.1f} %" for clock, ratio in times.drift.items())
    runs = f"{times.runs[0]} runs against {times.runs[1]}"
    return f"{said}, of {runs}" + (f"; subtracted as drift of the machine: {drift}" if drift else "")


def _grouped(verdict: Verdict, kind: str) -> dict[tuple, list[Finding]]:
    groups: dict[tuple, list[Finding]] = {}
    for finding in verdict.findings:
        if finding.kind == kind:
            groups.setdefault(finding.group, []).append(finding)
    return groups


def _named(group: tuple) -> str:
    _, scene, detail, method, params = group
    return " · ".join(part for part in (f"{scene} {detail}".strip(), method, params) if part)


def _merged(findings: list[Finding]) -> Iterator[tuple[str, str]]:
    """What differs, and the text of its worst frame with the numbers of all of them."""
    columns: dict[str, list[Finding]] = {}
    for finding in findings:
        columns.setdefault(finding.what, []).append(finding)
    for what, rows in columns.items():
        worst = max(rows, key=lambda finding: finding.size)
        frames = sorted({row.frame for row in rows if row.frame is not None})
        at = f"  [frame {_ranges(frames)}]" if frames else ""
        if len(frames) > 1 and worst.size:
            at = f"  [frame {worst.frame}, the most of {len(frames)}: {_ranges(frames)}]"
        yield what, worst.text + at


def _next(verdict: Verdict, kind: str, group: tuple) -> Iterator[tuple[str, str]]:
    """What to type next, and what for."""
    config, _, _, method, _ = group
    if kind in EXIT_CODES:
        yield "to reproduce", verdict.reproduce(config, method)
    if kind in ("regression", "not comparable"):
        yield "to accept", verdict.accept()


def _ranges(frames: list[int]) -> str:
    """[0, 1, 2, 5] -> "0-2, 5"."""
    parts: list[list[int]] = []
    for frame in frames:
        if parts and frame == parts[-1][1] + 1:
            parts[-1][1] = frame
        else:
            parts.append([frame, frame])
    return ", ".join(f"{first}-{last}" if last > first else str(first) for first, last in parts)


# For machines


def as_json(verdict: Verdict) -> str:
    """One object: the verdict, its findings, and every pace; a number without meaning is null."""
    findings = [
        {**asdict(finding), "reproduce": verdict.reproduce(finding.config, finding.method)} for finding in verdict.findings
    ]
    document = {
        "verdict": SAID[verdict.exit_code],
        "exit_code": verdict.exit_code,
        "base": str(verdict.base),
        "new": str(verdict.new),
        "runs": verdict.runs,
        "rows": verdict.rows,
        "accept": verdict.accept(),
        "findings": findings,
        "times": None if verdict.times is None else asdict(verdict.times),
    }
    return json.dumps(_plain(document), indent=2, ensure_ascii=False, allow_nan=False)


def _plain(value: Any) -> Any:
    """`value` with None for every float that is not finite."""
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def as_junit(verdict: Verdict) -> str:
    """A test case per method with its parameters in a scene: failed by a regression, in error by what cannot be judged."""
    cases = {group: {} for group in [*verdict.groups, *(finding.group for finding in verdict.findings)]}
    for kind in KINDS:
        for group, findings in _grouped(verdict, kind).items():
            cases[group][kind] = findings
    suite = ElementTree.Element("testsuite", name=_xml(f"benchharness compare {verdict.base} {verdict.new}"))
    counts = Counter()
    for group, kinds in cases.items():
        case = ElementTree.SubElement(suite, "testcase", classname=_xml(group[0] or "study"), name=_xml(_named(group) or "all"))
        counts.update(tests=1)
        for kind, findings in kinds.items():
            told = [f"{what}: {text}" for what, text in _merged(findings)]
            told += [f"{word}: {command}" for word, command in _next(verdict, kind, group)]
            tag = "failure" if kind == "regression" else "error" if kind in EXIT_CODES else "system-out"
            counts.update({f"{tag}s": 1})
            attributes = {} if tag == "system-out" else {"message": _xml(told[0]), "type": kind}
            ElementTree.SubElement(case, tag, attributes).text = _xml("\n".join([kind, *told]))
    for name in ("tests", "failures", "errors"):
        suite.set(name, str(counts[name]))
    ElementTree.indent(suite)
    return ElementTree.tostring(suite, encoding="unicode", xml_declaration=True)


def _xml(text: str) -> str:
    """`text` without the characters that XML 1.0 cannot hold."""
    return re.sub("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "\ufffd", text)


def as_markdown(verdict: Verdict) -> str:
    """The verdict as a heading and a table, as for a comment or a job's summary."""
    lines = [f"### benchharness: {SAID[verdict.exit_code]}", ""]
    lines += [f"{verdict.rows} rows of `{verdict.base}` (base) and `{verdict.new}` (new).", ""]
    if verdict.times is not None and verdict.times.paces:
        lines += [f"Times: {_cell(_paced(verdict.times))}.", ""]
    rows = [
        f"| {kind} | {_cell(_named(group))} | {_cell(what)} | {_cell(text)} |"
        for kind in KINDS
        for group, findings in _grouped(verdict, kind).items()
        for what, text in _merged(findings)
    ]
    if rows:
        lines += ["| | method | what | base -> new |", "|---|---|---|---|", *rows, ""]
    commands = [
        f"{command}  # {word}"
        for kind in EXIT_CODES
        for group in _grouped(verdict, kind)
        for word, command in _next(verdict, kind, group)
    ]
    if commands:
        lines += ["```sh", *dict.fromkeys(commands), "```", ""]
    return "\n".join(lines)


def _cell(text: str) -> str:
    """`text` as it is in a cell of a table."""
    return re.sub(r"([\\`*_{}\[\]<>#|~])", r"\\\1", " ".join(text.split()))


FORMATS: dict[str, Callable[[Verdict], str]] = {
    "text": render,
    "json": as_json,
    "junit": as_junit,
    "markdown": as_markdown,
}
