"""Records over frames: what a method with its parameters costs and is worth in a scene."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from benchharness.tables.columns import GROUP, RESULTS, STATUSES

OVER: dict[str, Callable[[list], Any]] = {"median": statistics.median, "mean": statistics.fmean, "max": max, "sum": sum}


def summary(records: Iterable[Mapping]) -> list[dict]:
    """One row per group of `columns.GROUP`, in order of appearance, with the keys `columns.SUMMARY`.

    A number without meaning (None or NaN) is left out; what no frame has is None.
    """
    groups: dict[tuple, list[Mapping]] = {}
    for record in records:
        groups.setdefault(tuple(record[name] for name in GROUP), []).append(record)
    return [_row(rows) for rows in groups.values()]


def _row(rows: Sequence[Mapping]) -> dict[str, Any]:
    ok = [row for row in rows if row["status"] == "ok"]
    worst = max(rows, key=lambda row: list(STATUSES).index(row["status"]))
    flips = _present(ok, "flip")
    over = {}
    for column in (column for column in RESULTS if column.over):
        values = _present(rows if column.over == "sum" else ok, column.name)
        over[column.name] = OVER[column.over](values) if values else None
    return {
        **{name: worst.get(name) for name in (*GROUP, "status", "reason")},
        "frames": len(rows),
        "frames_ok": len(ok),
        "frames_in_view": sum(pixels > 0 for pixels in _present(rows, "reflector_px")),
        "ok_ratio": len(ok) / len(rows),
        "flip_min": min(flips, default=None),
        "flip_max": max(flips, default=None),
        **over,
    }


def _present(rows: Sequence[Mapping], name: str) -> list:
    """The numbers of a column; NaN is none, as it is not itself."""
    values = (row.get(name) for row in rows)
    return [value for value in values if value is not None and value == value]
