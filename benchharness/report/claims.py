"""Claims of papers and the committed tables -> a page, `claims.csv` beside it, and a summary in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchharness.report.overtime import rendered
from benchharness.tables import claims
from benchharness.tables.files import write_atomic

PAGE = "claims.html"


@dataclass(frozen=True)
class Outcome:
    """The page, what there is to say about it, and the exit code."""

    page: Path
    lines: Sequence[str]
    code: int


def write(page: Path, tables: Path) -> Outcome:
    """Writes `page` and claims.csv beside it. `tables` is the folder that queries read.

    Raises ValueError for tables that are missing or lack what a claim asks for.
    """
    rows = claims.records(claims.load(), tables)
    found, wrong = claims.counts(rows), claims.contradicted(rows)
    sources = {name: [row for row in rows if row["source"] == name] for name in found}
    text = rendered(
        "claims.html.jinja", sources=sources, counts=found, total=total(found), wrong=wrong, meanings=claims.VERDICTS
    )
    write_atomic(page, text)
    claims.write(page.with_name(claims.TABLE), rows)
    return Outcome(page, summary(found, wrong), claims.exit_code(rows))


def total(counts: Mapping[str, Mapping[str, int]]) -> dict[str, int]:
    """Verdict -> how many, of all sources."""
    return {verdict: sum(own[verdict] for own in counts.values()) for verdict in claims.VERDICTS}


def summary(counts: Mapping[str, Mapping[str, int]], wrong: Sequence[Mapping[str, Any]]) -> list[str]:
    """A line per source, one of all, and one per verdict that a table contradicts."""
    told = {**counts, "all": total(counts)}
    lines = [f"{name}: {', '.join(f'{count} {verdict}' for verdict, count in own.items())}" for name, own in told.items()]
    return lines + [
        f"contradicted: {row['id']} is called {row['verdict']}, but {row['shown']} has {row['found']}, of what should be "
        f"{row['expected']}"
        for row in wrong
    ]
