"""docs/columns.md: the columns of a run's tables in words, for `python -m benchharness.report.columns`."""

from __future__ import annotations

from collections.abc import Iterable

from benchharness.tables.claims import VERDICTS
from benchharness.tables.columns import CLAIMS, RESULTS, SAMPLES, STATUSES, SUMMARY, Column

HEAD = """# Columns

A cell without meaning is empty; it is not 0. Of several frames, `summary.csv` and the report show what stands under "over
frames": of the frames that are ok, but for a sum, which is of all.
"""


def markdown() -> str:
    """The page, from the table in `benchharness/tables/columns.py`."""
    known = {column.name for column in RESULTS}
    parts = [
        HEAD,
        "## results.csv\n\nA row per scene, frame, method and parameters.\n",
        _explained(RESULTS),
        '## summary.csv\n\nA row per method and parameters in a scene. Beside what has a place under "over frames":\n',
        _explained(column for column in SUMMARY if column.name not in known),
        "## samples.csv\n\nA row for every time that was taken. Beside what it is about:\n",
        _explained(column for column in SAMPLES if column.name not in known),
        "## claims.csv\n\nA row per claim of a paper, by `benchharness claims` ([claims.md](claims.md)).\n",
        _table(("column", "what it says"), ((f"`{c.name}`", c.says) for c in CLAIMS)),
        _table(("verdict", ""), ((f"`{name}`", meaning) for name, meaning in VERDICTS.items())),
        "## status\n",
        _table(("status", ""), ((f"`{name}`", meaning) for name, meaning in STATUSES.items())),
        "## What `compare` holds for the same\n\nOn another machine; a tenth of it in the same environment.\n",
        _table(("column", "within", "since"), _gates()),
    ]
    return "\n".join(parts)


def _explained(columns: Iterable[Column]) -> str:
    rows = ((f"`{c.name}`", c.title, c.unit, c.better, c.over, c.says) for c in columns)
    return _table(("column", "in the report", "unit", "better", "over frames", "what it says"), rows)


def _gates() -> Iterable[tuple[str, str, str]]:
    for column in RESULTS:
        if gate := column.gate:
            yield f"`{column.name}`", str(gate), gate.because


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = (f"| {' | '.join(cell.replace('|', '&#124;') for cell in row)} |" for row in rows)
    return "\n".join([f"| {' | '.join(head)} |", "|---" * len(head) + "|", *lines, ""])


if __name__ == "__main__":
    print(markdown(), end="")
