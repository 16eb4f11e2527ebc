"""A run becomes the baseline that later ones are compared with, and the log says why."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from benchharness.tables import results
from benchharness.tables.columns import BROKEN, STATUSES
from benchharness.tables.files import shorten, write_atomic
from benchharness.tables.sides import by_key


def accept(run: Path, baselines: Path, because: str, *, replaces: bool = False) -> Path:
    """Makes the results of a run folder the baseline of its config; returns `baselines/<config>.csv`.

    replaces  whether a baseline of another study may be replaced: one with other settings, or with none of its scenes

    Times are kept beside the `calibration_ms` that relates them to another machine's. A run of some of the methods of
    the same config replaces their rows and leaves the others. The reason, with the date, goes to `baselines/LOG.md`.
    Raises ValueError for an empty reason, for a run that is no measure of anything (no rows, rows of more than one config,
    or a row that crashed), and for another study.
    """
    reason = " ".join(because.split())
    if not reason:
        raise ValueError("--because is empty; accepted: a sentence why the new numbers are right")
    if baselines.exists() and not baselines.is_dir():
        raise ValueError(f"--baselines {baselines} is a file; accepted: a folder")
    records = results.read_results(run)
    config = _accepted_config(run, records)
    file = baselines / f"{re.sub(r'[^A-Za-z0-9_.-]', '_', config.removesuffix('.toml'))[:100]}.csv"
    kept = [] if replaces or not file.exists() else _kept(file, run, results.read_results(file), records)
    results.write(file, [*kept, *records])

    log = baselines / "LOG.md"
    text = log.read_text(encoding="utf-8") if log.exists() else "# Why the baselines are what they are\n\n"
    counts = {status: sum(r["status"] == status for r in records) for status in STATUSES}
    said = ", ".join(f"{count} {status}" for status, count in counts.items() if count)
    rows = f"{len(records)} rows: {said}" + (f"; {len(kept)} kept" if kept else "")
    write_atomic(log, f"{text}- {datetime.now(UTC):%Y-%m-%d} `{file.stem}` {reason} ({rows})\n")
    return file


def _accepted_config(run: Path, records: Sequence[dict]) -> str:
    """The config of a run that may become a baseline. Raises ValueError for any other run."""
    configs = {record["config"] or "" for record in records}
    if len(configs) != 1 or "" in configs:
        raise ValueError(f"{run}: rows of {len(configs - {''})} configs; accepted: a run of exactly one")
    by_key(run, records)
    for record in records:
        if record["status"] in BROKEN:
            where = shorten(f"{record['scene']}, {record['method']} {record['params']}".strip())
            raise ValueError(
                f"{run}: frame {record['frame']} of {where} is {record['status']}; accepted: a run in which nothing crashed"
            )
    return Path(configs.pop()).name


def _kept(file: Path, run: Path, before: Sequence[dict], records: Sequence[dict]) -> list[dict]:
    """Rows of the old baseline that stay. Raises ValueError where it belongs to another study."""
    hashes = [{record["config_hash"] for record in rows} for rows in (before, records)]
    scenes = [{(record["scene"], record["detail"]) for record in rows} for rows in (before, records)]
    if before and (hashes[0] != hashes[1] or not scenes[0] & scenes[1]):
        differs = "its settings are others" if hashes[0] != hashes[1] else "they have no scene in common"
        raise ValueError(
            f"{file} is the baseline of another study than {run}: {differs}; accepted: a run of the same study, or "
            "--replace, which drops all rows of the old one"
        )
    replaced = {_unit(record) for record in records}
    return [record for record in before if _unit(record) not in replaced]


def _unit(record: dict) -> tuple:
    """Scene, detail and method: what a run with `--only METHOD` replaces as a whole."""
    return record["scene"], record["detail"], record["method"]
