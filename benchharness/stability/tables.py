"""The suite's tables: CSV, text as it is, an empty cell where a number has no meaning."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from benchharness.tables import results


def write(path: Path, rows: Iterable[Mapping], columns: Sequence[str]) -> None:
    """Raises ValueError for a key that is no column."""
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    results.write_atomic(path, text.getvalue())


def read(path: Path) -> list[dict[str, str]]:
    """The rows of a table; with what a method is called on the command line and on the page as `label`.

    Raises ValueError where there is no table, or it has no rows.
    """
    if not path.is_file():
        raise ValueError(f"{path}: there is no such file; accepted: a folder of the stability suite")
    with open(path, newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    if not rows:
        raise ValueError(f"{path}: no rows; accepted: the results of the stability suite")
    return [{**row, "label": f"{row['method']} {row['setting']}".strip()} for row in rows]
