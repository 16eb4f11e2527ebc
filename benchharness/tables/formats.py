"""A verdict in words, and for machines: text, JSON, JUnit's XML and Markdown."""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

from benchharness.tables.verdict import EXITS, KINDS, Finding, Verdict

if TYPE_CHECKING:
    from benchharness.tables.times import Times


def as_text(verdict: Verdict) -> str:
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
    if kind in EXITS:
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


def as_json(verdict: Verdict) -> str:
    """One object: the verdict, its findings, and every pace; a number without meaning is null."""
    findings = [
        {**asdict(finding), "reproduce": verdict.reproduce(finding.config, finding.method)} for finding in verdict.findings
    ]
    document = {
        "verdict": verdict.exit_code.says,
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
            tag = "failure" if kind == "regression" else "error" if kind in EXITS else "system-out"
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
    lines = [f"### benchharness: {verdict.exit_code.says}", ""]
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
        for kind in EXITS
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
    "text": as_text,
    "json": as_json,
    "junit": as_junit,
    "markdown": as_markdown,
}
