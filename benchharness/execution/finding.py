"""What a check of a method finds: one sentence, and how bad it is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Level = Literal["pass", "warn", "fail"]


@dataclass(frozen=True)
class Finding:
    level: Level
    text: str


def judged(holds: bool, good: str, bad: str, level: Level = "fail") -> Finding:
    """A pass that says `good` where it holds, else `level` with `bad`."""
    return Finding("pass", good) if holds else Finding(level, bad)
