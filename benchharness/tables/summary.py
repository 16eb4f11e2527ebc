"""Records over frames: what a method with its parameters costs and is worth in a scene."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

from benchharness.tables.columns import GROUP, RESULTS, STATUSES

if TYPE_CHECKING:
    import pandas as pd

OVER: dict[str, Callable[[list], Any]] = {"median": statistics.median, "mean": statistics.fmean, "max": max, "sum": sum}


def summary(records: Iterable[Mapping]) -> list[dict]:
    """One row per group of `columns.GROUP`, in order of appearance, with the keys `columns.SUMMARY`."""
    import pandas as pd  # here, as most who read or write a table need none of it

    # As objects, so that None stays None and an integer one beside it.
    frame = pd.DataFrame(list(records), columns=[column.name for column in RESULTS], dtype=object)
    return [_row(rows) for _, rows in frame.groupby(list(GROUP), sort=False, dropna=False)]


def _row(rows: pd.DataFrame) -> dict[str, Any]:
    ok = rows[rows["status"] == "ok"]
    worst = rows.iloc[rows["status"].map(list(STATUSES).index).argmax()]
    flips = _present(ok["flip"])
    over = {}
    for column in (column for column in RESULTS if column.over):
        values = _present((rows if column.over == "sum" else ok)[column.name])
        over[column.name] = OVER[column.over](values) if values else None
    return {
        **{name: worst[name] for name in (*GROUP, "status", "reason")},
        "frames": len(rows),
        "frames_ok": len(ok),
        "frames_in_view": sum(pixels > 0 for pixels in _present(rows["reflector_px"])),
        "ok_ratio": len(ok) / len(rows),
        "flip_min": min(flips, default=None),
        "flip_max": max(flips, default=None),
        **over,
    }


def _present(values: pd.Series) -> list:
    """The numbers of a column, without those that have no meaning."""
    return values.dropna().tolist()
