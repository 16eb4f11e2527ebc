"""The verdict of a comparison: findings, the exit code that follows from them, and both in words."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path

KINDS = ("regression", "not comparable", "incomplete", "warning", "improvement", "note")
EXIT_CODES = {"regression": 1, "not comparable": 4, "incomplete": 3}
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


@dataclass(frozen=True)
class Verdict:
    base: Path
    new: Path
    rows: int
    findings: tuple[Finding, ...]

    @property
    def exit_code(self) -> int:
        """0 fine, 1 a regression, 3 incomplete, 4 not comparable (see EXIT_CODES for which wins)."""
        kinds = {finding.kind for finding in self.findings}
        return next((code for kind, code in EXIT_CODES.items() if kind in kinds), 0)


def render(verdict: Verdict) -> str:
    """The verdict as text: what is worse first, the frames of one finding on one line, and what to type next."""
    lines = [f"base  {verdict.base}", f"new   {verdict.new}", f"rows  {verdict.rows} in both"]
    for kind in KINDS:
        groups: dict[tuple, list[Finding]] = {}
        for finding in verdict.findings:
            if finding.kind == kind:
                where = (finding.config, finding.scene, finding.detail, finding.method, finding.params)
                groups.setdefault(where, []).append(finding)
        if groups:
            lines += ["", f"{kind.upper()}"]
        for group, findings in groups.items():
            lines += _rendered(kind, group, findings, verdict.new)
    said = {0: "fine", 1: "a regression was found", 3: "incomplete", 4: "the two sides cannot be compared"}
    return "\n".join([*lines, "", f"verdict: {said[verdict.exit_code]} (exit code {verdict.exit_code})"])


def _rendered(kind: str, group: tuple, findings: list[Finding], new: Path) -> list[str]:
    config, scene, detail, method, params = group
    about = " · ".join(part for part in (f"{scene} {detail}".strip(), method, params) if part)
    lines = [f"  {about}"] if about else []
    columns: dict[str, list[Finding]] = {}
    for finding in findings:
        columns.setdefault(finding.what, []).append(finding)
    for what, rows in columns.items():
        worst = max(rows, key=lambda finding: finding.size)
        frames = sorted({row.frame for row in rows if row.frame is not None})
        at = f"  [frame {_ranges(frames)}]" if frames else ""
        if len(frames) > 1 and worst.size:
            at = f"  [frame {worst.frame}, the most of {len(frames)}: {_ranges(frames)}]"
        lines.append(f"    {what:<16} {worst.text}{at}")
    if kind in EXIT_CODES:
        only = f" --only {shlex.quote(method)}" if method else ""
        lines.append(f"    to reproduce     benchharness run {shlex.quote(config)}{only}")
    if kind in ("regression", "not comparable"):
        run = new if new.is_dir() else new.parent
        lines.append(f"    to accept        benchharness accept {shlex.quote(str(run))} --because TEXT")
    return lines


def _ranges(frames: list[int]) -> str:
    """[0, 1, 2, 5] -> "0-2, 5"."""
    parts: list[list[int]] = []
    for frame in frames:
        if parts and frame == parts[-1][1] + 1:
            parts[-1][1] = frame
        else:
            parts.append([frame, frame])
    return ", ".join(f"{first}-{last}" if last > first else str(first) for first, last in parts)
