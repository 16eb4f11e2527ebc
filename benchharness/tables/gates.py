"""Numbers of two rows that were measured under the same conditions -> which are worse, and which better.

The tolerances are the columns', see `columns.Gate`. They are for another machine: in the same environment runs repeat bit for
bit, and SAME_MACHINE of them do.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace

from benchharness.tables.columns import RESULTS, Column, Gate
from benchharness.tables.parameters import parse_params
from benchharness.tables.verdict import Finding

SAME_MACHINE = 0.1
"""Share of the tolerances: what a harmless change in the order of operations may move."""
GATED = tuple(column for column in RESULTS if column.gate)
WORK = Gate(0.0, 0.01, "Work is counted; a hundredth is for searches that stop one step apart on another CPU.")
"""The gate of every counter in the column `counters`."""
LENIENT = (*(column.name for column in GATED), "counters")
"""Columns that may hold what is no number in a new run: that is a regression, not a damaged file."""
NOISIEST = 0.1
"""FLIP; a reference with more noise than this cannot judge a picture that changed, where it hides the change."""


def allowed(gate: Gate, base: float, *, same_machine: bool = False) -> float:
    """How much worse than `base` is not worth a word."""
    return (SAME_MACHINE if same_machine else 1.0) * (gate.absolute + gate.relative * abs(base))


def judged(old: Mapping, new: Mapping) -> Iterator[Finding]:
    """What is to be said of the errors and the work of two records."""
    noise = max(old["reference_noise"] or 0.0, new["reference_noise"] or 0.0)
    flips = old["flip"], new["flip"]
    hidden = None not in flips and all(flip <= noise for flip in flips)
    for column in GATED:
        for finding in _gated(column, old, new, old[column.name], new[column.name]):
            yield _unranked(finding, noise) if column.image and hidden else finding
    before, after = (parse_params(record["counters"]) for record in (old, new))
    for name, value in before.items():
        yield from _gated(_counter(name), old, new, value, after.get(name))
    for name in after.keys() - before.keys() if before else ():
        yield from _gated(_counter(name), old, new, None, after[name])
        yield Finding.about(new, "note", f"counter {name}", "is counted now", frame=False)


def _counter(name: str) -> Column:
    return Column(f"counter {name}", "number", "", better="less", gate=WORK)


def _unranked(finding: Finding, noise: float) -> Finding:
    """A change of the picture that the reference's noise hides: which side is nearer to the truth is not known."""
    if finding.kind not in ("regression", "improvement"):
        return finding
    kind = "not comparable" if noise > NOISIEST else "warning" if finding.kind == "regression" else "note"
    return replace(finding, kind=kind, text=f"{finding.text}; both are within the reference's noise, {_number(noise)}")


def _gated(column: Column, old_row: Mapping, new_row: Mapping, old, new) -> Iterator[Finding]:
    assert column.gate is not None
    if new is not None and not math.isfinite(new):
        text = f"{'nothing' if old is None else _number(old)} -> {_number(new)}, which is no number"
        yield Finding.about(new_row, "regression", column.name, text, size=math.inf)
    elif old is not None and new is None:
        yield Finding.about(new_row, "incomplete", column.name, f"was {_number(old)}, is not measured any more")
    elif old is not None and new is not None:
        here = old_row["environment"] == new_row["environment"] is not None
        same = allowed(column.gate, old, same_machine=here)
        worse = column.sign * (new - old)
        if abs(worse) > same:
            text = f"{_number(old)} -> {_number(new)}{_share(old, new)}, within {_number(same)} is the same"
            kind = "regression" if worse > 0 else "improvement"
            if column.gate.local and not here:
                kind, text = "note", f"{text}; in another environment rounding does that too"
            yield Finding.about(new_row, kind, column.name, text, size=abs(worse))


def _number(value: float) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _share(old: float, new: float) -> str:
    return f" ({100.0 * (new - old) / abs(old):+.0f} %)" if old else ""
