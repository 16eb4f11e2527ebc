"""Tables as CSV files, and files that are whole or not there.

A cell is a text as it is, a finite number, or empty: a number without meaning (None, NaN or infinite here) is never 0. Floats
are written by `repr`, so that what is read is bit for bit what was written. Lines are taken apart by `csv` and not by pandas,
which fills a line that is too short, and to which "no number" and "not a number" are one.
"""

from __future__ import annotations

import csv
import io
import math
import os
import tempfile
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchharness.tables.columns import Kind

LARGEST = 2**63 - 1
"""The largest integer that is read."""


def write_atomic(path: Path, text: str) -> None:
    """Writes beside the place and renames: a crash leaves the old file or the new one, never half of one."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        os.unlink(temporary)
        raise


def write(path: Path, rows: Iterable[Mapping], columns: Sequence[str], kinds: Mapping[str, Kind] | None = None) -> None:
    """Writes rows as a table, atomically. What a row lacks is empty; the line ends of a text become blanks.

    kinds  of the columns that hold nothing else; what is in others is a text or a number by its own type

    Raises ValueError for a key that is no column, and for what is not of its column's kind.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for number, row in enumerate(rows):
        if unknown := [name for name in row if name not in columns]:
            raise ValueError(f"{path.name}: row {number} has {unknown[0]!r}; accepted: {', '.join(columns)}")
        writer.writerow([_cell(name, row.get(name), (kinds or {}).get(name)) for name in columns])
    write_atomic(path, text.getvalue())


def _cell(column: str, value: Any, kind: Kind | None) -> str:
    if hasattr(value, "item"):
        value = value.item()
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    if kind == "text" or (kind is None and isinstance(value, str)):
        return str(value).replace("\r", "").replace("\n", " ")
    if kind is not None and (isinstance(value, str | bool) or (kind == "integer" and value != int(value))):
        raise ValueError(f"column {column!r} is {value!r}; accepted: {_said(kind)}")
    return str(int(value)) if kind == "integer" else repr(value)


def _said(kind: Kind) -> str:
    return "an integer" if kind == "integer" else "a number"


def read(
    path: Path,
    kinds: Mapping[str, Kind],
    columns: Sequence[str] | None = None,
    required: Sequence[str] = (),
    lenient: Collection[str] = (),
    least: float = 0.0,
) -> list[dict[str, Any]]:
    """The rows of a table. An empty cell is None in a column of numbers, "" in one of text.

    kinds     of the columns; those that it lacks are text
    columns   the keys of the rows: what the file lacks of them is empty, what else it has is left out. None: those of the file
    lenient   columns in which NaN and infinity are read as they are; refused in all others
    least     of all numbers

    Raises ValueError where the file is missing, is no CSV, lacks a required column or names one twice, or holds something
    else in place of a number of at least `least`: with line and column.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            lines = list(csv.reader(file, strict=True))
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror or error}; accepted: a run folder or its CSV file") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path}: not a table ({error}); accepted: a CSV file in UTF-8") from None
    header = lines[0] if lines else []
    if missing := [name for name in required if name not in header]:
        raise ValueError(f"{path}: missing columns: {', '.join(missing)}; accepted: at least {', '.join(required)}")
    columns = header if columns is None else columns
    if twice := [name for name in columns if header.count(name) > 1]:
        raise ValueError(f"{path}: column {twice[0]!r} is there twice; accepted: every column once")
    empty = {name: "" if kinds.get(name, "text") == "text" else None for name in columns}
    rows = []
    for line, cells in enumerate(lines[1:], start=2):
        if len(cells) != len(header):
            raise ValueError(f"{path}: line {line} has {len(cells)} cells; accepted: {len(header)}, as in the header")
        row: dict[str, Any] = dict(empty)
        for name, cell in zip(header, cells, strict=True):
            if cell and name in empty:
                kind = kinds.get(name, "text")
                row[name] = cell if kind == "text" else _number(cell, kind, least, lenient=name in lenient)
                if row[name] is None:
                    accepted = f"{_said(kind)} of at least {least:g}, or empty"
                    raise ValueError(f"{path}: line {line}, column {name!r} is {shorten(cell)}; accepted: {accepted}")
        rows.append(row)
    return rows


def _number(cell: str, kind: Kind, least: float, *, lenient: bool) -> int | float | None:
    """The number that a cell says; None for what says none."""
    try:
        value = float(cell)
        value = int(cell) if kind == "integer" and math.isfinite(value) else value
    except ValueError:
        return None
    return value if "_" not in cell and within(value, least, lenient=lenient) else None


def within(value: int | float, least: float = 0.0, *, lenient: bool = False) -> bool:
    """Whether a number may be in a table: not less than `least` and not too large; `lenient`: or one that is not finite."""
    if isinstance(value, int):
        return least <= value <= LARGEST
    return value >= least if math.isfinite(value) else lenient


def shorten(text: str) -> str:
    """`text` in quotes, cut where it is long: what a message quotes of a file."""
    return repr(text if len(text) <= 60 else text[:57] + "...")
