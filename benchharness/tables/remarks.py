"""What the rows of a scene say beside their status: what is not ranked, unanswered, or wrong and called right."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

ANSWERED = 0.98  # share of the mirror's pixels; what answers fewer is mentioned
WRONG = 0.01  # share of reflection points that a search calls right and are not; of convex mirrors it is 0


def remarks(rows: Sequence[Mapping[str, Any]], named: Callable[[Mapping[str, Any]], str] | None = None) -> list[str]:
    """What nobody should rely on, and why; with the rows of which it holds, by name: that of the method and its parameters."""
    found: dict[str, list[str]] = {}
    for row in rows:
        for reason in _reasons(row):
            name = named(row) if named is not None else f"{row['method']} {row['params']}".strip()
            found.setdefault(reason, []).append(name)
    return [f"{reason} ({', '.join(who) if len(who) < len(rows) else 'all'})" for reason, who in found.items()]


def _reasons(row: Mapping[str, Any]) -> Iterator[str]:
    if row["status"] == "invalid":
        yield f"not ranked: {row['reason']}"
    if row["status"] != "ok":
        return
    if row.get("reflector_px") == 0:
        yield "no mirror in view: times, and no errors"
        return
    coverage, wrong = row.get("coverage"), row.get("wrong_ratio")
    if coverage is not None and coverage < ANSWERED:
        yield f"no answer in {1 - coverage:.0%} of the mirror, shown as it is"
    if wrong is not None and wrong > WRONG:
        yield f"{wrong:.0%} of the reflection points that are called right are more than 2 pixels off"
