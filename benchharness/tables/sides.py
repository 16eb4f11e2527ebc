"""One side of a comparison: a run, or the runs in a folder, as tables of records by what they are about."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchharness.tables import results
from benchharness.tables.columns import KEY
from benchharness.tables.files import shorten
from benchharness.tables.times import Rounds

Table = dict[tuple, dict]
"""results.key -> record, of one run."""


@dataclass(frozen=True)
class Side:
    """The runs of one side: their folders or files, and their tables."""

    runs: list[Path]
    tables: list[Table]

    @property
    def records(self) -> list[dict]:
        return [record for table in self.tables for record in table.values()]

    @property
    def names(self) -> list[str]:
        return [run.name for run in self.runs]


def read(path: Path, lenient: Sequence[str] = ()) -> Side:
    """The run folder or CSV file `path`, or the run folders in it.

    lenient  columns that may hold what is no number, as of `files.read`

    Raises ValueError for a run that is not finished, a damaged file, and a row that is there twice.
    """
    runs = _runs(path)
    return Side(runs, [by_key(run, results.read_results(run, lenient)) for run in runs])


def _runs(path: Path) -> list[Path]:
    if not path.is_dir() or (path / "results.csv").exists():
        return [path]
    runs = sorted(p for p in path.iterdir() if (p / "results.csv").exists() or (p / "run.json").exists())
    for run in runs:
        if not (run / "results.csv").exists():
            raise ValueError(f"{run} holds a run that was not finished; accepted: finished runs, see `--resume`")
    return runs or [path]


def by_key(path: Path, records: Iterable[dict]) -> Table:
    """Records by what they are about. Raises ValueError, which names `path`, for a row that is there twice."""
    rows: Table = {}
    for record in records:
        if results.key(record) in rows:
            said = shorten(str(results.key(record)))
            raise ValueError(f"{path}: {said} is there twice; accepted: one row per {', '.join(KEY)}")
        rows[results.key(record)] = record
    return rows


def rounds(runs: Iterable[Path]) -> list[Rounds] | None:
    """The rounds of all runs, see `times.judge`; None where one of them is a table alone."""
    folders = list(runs)
    if not all((folder / "samples.csv").is_file() for folder in folders):
        return None
    found: list[dict[tuple, list[float]]] = []
    for folder in folders:
        found.append({})
        for sample in results.read_samples(folder):
            found[-1].setdefault((*results.key(sample), sample["clock"]), []).append(sample["ms"])
    return list(found)
