"""Records: dicts with the keys of results.csv, one per scene, frame, method and parameters. And the raw times behind them.

What has no meaning is None; `params` and `detail` are text, "" where there are none.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchharness.tables import columns, files
from benchharness.tables.columns import KEY, STATUSES
from benchharness.tables.files import shorten
from benchharness.tables.parameters import parse_params
from benchharness.tables.summary import summary

KINDS = columns.kinds(columns.RESULTS)
COLUMNS = list(KINDS)
REQUIRED = COLUMNS[: COLUMNS.index("environment") + 1]
"""Columns without which a results.csv is not one; later ones may be missing in a file and read as None."""
SUMMARY_KINDS = columns.kinds(columns.SUMMARY)
SAMPLE_KINDS = columns.kinds(columns.SAMPLES)


def key(record: Mapping) -> tuple:
    """What a record is about: (scene, detail, frame, method, params)."""
    return tuple(record[name] for name in KEY)


def write(file: Path, records: Iterable[Mapping]) -> None:
    """Records to a CSV file with the columns of results.csv."""
    files.write(file, records, COLUMNS, KINDS)


def write_results(run: Path, records: Sequence[Mapping]) -> None:
    """Writes results.csv and summary.csv of a run folder. Raises ValueError for a status that is none."""
    for record in records:
        if record["status"] not in STATUSES:
            raise ValueError(f"status {record['status']!r} of {key(record)}; accepted: {', '.join(STATUSES)}")
    write(run / "results.csv", records)
    files.write(run / "summary.csv", summary(records), list(SUMMARY_KINDS), SUMMARY_KINDS)


def read_results(path: Path, lenient: Collection[str] = ()) -> list[dict]:
    """Records of a run folder, or of a CSV file with the columns of results.csv.

    lenient  columns that may hold NaN and infinity, as of `files.read`; "counters" among them

    Raises ValueError with file, line and column of what is damaged.
    """
    file = path / "results.csv" if path.is_dir() else path
    records = [_record(row) for row in files.read(file, KINDS, COLUMNS, REQUIRED, lenient)]
    for line, record in enumerate(records, start=2):
        _check(record, f"{file}: line {line}", lenient="counters" in lenient)
    return records


def _record(row: Mapping[str, Any]) -> dict[str, Any]:
    return {name: None if value == "" and name not in ("params", "detail") else value for name, value in row.items()}


def _check(record: Mapping, where: str, *, lenient: bool) -> None:
    """Raises ValueError for a record that does not say what it is about, or whose counters are no numbers."""
    if record["status"] not in STATUSES:
        raise ValueError(f"{where}, column 'status' is {shorten(record['status'] or '')}; accepted: {', '.join(STATUSES)}")
    for name in ("scene", "method"):
        if record[name] is None:
            raise ValueError(f"{where}, column {name!r} is empty; accepted: what the row is about")
    try:
        counters = parse_params(record["counters"])
    except ValueError:
        said = shorten(record["counters"])
        raise ValueError(f"{where}, column 'counters' is {said}; accepted: name=value; name=value") from None
    for name, value in counters.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not files.within(value, lenient=lenient):
            said = shorten(str(value))
            raise ValueError(f"{where}, column 'counters': {name} is {said}; accepted: a number of at least 0")


def write_samples(run: Path, samples: Iterable[Mapping]) -> None:
    """Writes samples.csv of a run folder."""
    files.write(run / "samples.csv", samples, list(SAMPLE_KINDS), SAMPLE_KINDS)


def read_samples(run: Path) -> list[dict]:
    """Every raw time of a run folder; empty where it has no samples.csv."""
    file = run / "samples.csv"
    names = list(SAMPLE_KINDS)
    return [_record(row) for row in files.read(file, SAMPLE_KINDS, names, names)] if file.is_file() else []
