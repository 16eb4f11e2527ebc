"""Times of the runs of two sides -> slow, fast, same or ambiguous, for every method and clock.

A run is one observation. The rounds within it share a process, a memory layout and the load of the moment: they say how
steady that process was, and nothing of the next one. So it is the runs of a side that differ, and their differences that a
change has to stand out from.

The number of a run is the logarithm of a frame's quickest round, over the frames its mean, so that frames of unlike cost weigh
the same. Whoever else uses the machine only ever adds to a round, often as much again: two runs of one kernel beside somebody
else may differ ten times as much in their medians. What the unchanged methods of the same frame share, which were timed in
turns with it, is drift of the machine. It is subtracted where the sides differ by it, and where a method's runs are steadier
without it: what hardly follows the drift would only take on its noise. Welch's t-test then compares the sides, and the p of
all tests are adjusted for their number (Benjamini and Hochberg 1995; without any change, the chance of one false alarm among
them is at most ALPHA).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from scipy import stats

CLOCKS = ("prepare", "update", "shade")
FLOOR_MS = 0.1
"""Times below this on both sides are the cost of launching a kernel, and are not compared."""
LEAST_RUNS = 5
"""Runs of each side: fewer prove nothing, as two that happen to be alike look steady."""
ALPHA = 0.01
MARGIN = 0.02
"""Log of a ratio that has to be exceeded, not just differed from: where code and data come to lie in memory costs as much."""
SAME = 0.05
"""Log of the ratio within which the whole 95 % interval lies where two sides are the same."""
STEADIEST = 0.005
"""Standard deviation between runs, of the log, that no machine is better than; fewer runs may look steadier by chance."""
TRIM = 0.1
"""Share of the runs, the farthest out, that do not count where it is asked which of two series is steadier."""
FACTOR = 1.25
"""Ratio from which on a difference is worth saying although it is not proven."""
LEAST_UNCHANGED = 3
"""Methods beside the one that is judged whose median is the machine's drift; of fewer it would be their own noise."""

Table = Mapping[tuple, Mapping[str, Any]]
"""results.key -> record, of one run."""
Rounds = Mapping[tuple, Sequence[float]]
"""(results.key, clock) -> ms of every round of one run."""
Group = tuple[str, str, str, str, str]
"""Scene, detail, method, parameters, clock."""


@dataclass(frozen=True)
class Pace:
    """What became of one clock of one method with its parameters in one scene.

    ratio  new time over base time, without drift; `low` and `high` are its 95 % interval, None where nothing tells
    p      of the test, adjusted for the number of tests
    """

    scene: str
    detail: str
    method: str
    params: str
    clock: str
    verdict: Literal["slow", "fast", "same", "ambiguous", "unproven"]
    ratio: float
    low: float | None = None
    high: float | None = None
    p: float | None = None


@dataclass(frozen=True)
class Times:
    """All paces; why none of them can be proven, if so; and the drift that was subtracted, new over base, by clock."""

    paces: tuple[Pace, ...]
    runs: tuple[int, int]
    unproven: str | None
    drift: dict[str, float]


def judge(base: Sequence[Table], new: Sequence[Table], keys: Iterable[tuple], rounds: Sequence[Rounds] | None = None) -> Times:
    """Compares the times of the rows `keys`, all of which have been measured in all runs of both sides.

    rounds  of every run, those of the base first; where a run lacks them, its medians are compared
    """
    keys = list(keys)
    environments = [{run[key]["environment"] for run in side for key in keys} for side in (base, new)]
    apart = environments[0] != environments[1]
    series = dict(_series(base, new, keys, rounds, calibrated=apart))
    steady = _without_drift(series, _unchanged(base, new, keys), len(base))
    runs = len(base), len(new)
    unproven = _unproven(runs, apart=apart)
    groups: dict[Group, list[np.ndarray]] = {}
    for (scene, detail, _, method, params, clock), values in steady.items():
        groups.setdefault((scene, detail, method, params, clock), []).append(values)
    sides = {group: np.split(np.mean(frames, axis=0), [runs[0]]) for group, frames in groups.items()}
    return Times(tuple(_paces(sides, proves=unproven is None)), runs, unproven, _drift(series, steady, len(base)))


def _unproven(runs: tuple[int, int], *, apart: bool) -> str | None:
    if apart:
        return "the sides were measured on different machines or with different software"
    if min(runs) < LEAST_RUNS:
        counted = "one run against one" if runs == (1, 1) else f"{runs[0]} against {runs[1]} runs"
        return f"{counted}, of which each side needs at least {LEAST_RUNS}, made in turns"
    return None


def _series(
    base: Sequence[Table], new: Sequence[Table], keys: Sequence[tuple], rounds: Sequence[Rounds] | None, *, calibrated: bool
) -> Iterator[tuple[tuple, np.ndarray]]:
    """(scene, detail, frame, method, params, clock) -> log of the times of all runs, those of the base first.

    calibrated  whether times are taken relative to the calibration kernel of their run, as between two machines
    """
    for key in keys:
        records = [run[key] for run in (*base, *new)]
        for clock in CLOCKS:
            times = [record[f"{clock}_ms"] for record in records]
            if rounds is not None and all((*key, clock) in run for run in rounds):
                times = [min(run[*key, clock]) for run in rounds]
            scale = [record["calibration_ms"] for record in records] if calibrated else [1.0] * len(records)
            if not all(times) or not all(scale):
                continue
            sides = times[: len(base)], times[len(base) :]
            if max(float(np.median(side)) for side in sides) >= FLOOR_MS:
                yield (*key, clock), np.log(times) - np.log(scale)


def _unchanged(base: Sequence[Table], new: Sequence[Table], keys: Sequence[tuple]) -> set[tuple]:
    """Keys of rows whose method has the same code in all runs."""
    found = set()
    for key in keys:
        hashes = {run[key]["method_hash"] for run in (*base, *new)}
        if len(hashes) == 1 and None not in hashes:
            found.add(key)
    return found


def _without_drift(series: Mapping[tuple, np.ndarray], unchanged: Collection[tuple], split: int) -> dict[tuple, np.ndarray]:
    """The series less the median of the unchanged methods of the same frame and clock, where that is their drift, too.

    A method is left out of the median that is subtracted from itself, or its own noise would be. `split`: runs of the base.
    """
    groups: dict[tuple, list[tuple]] = {}
    for key in series:
        scene, detail, frame, *_, clock = key
        groups.setdefault((scene, detail, frame, clock), []).append(key)
    steady = dict(series)
    for members in groups.values():
        still = {key: series[key] - series[key].mean() for key in members if key[:-1] in unchanged}
        moved = bool(still) and _apart(np.median(list(still.values()), axis=0), split)
        for key in members:
            others = [values for other, values in still.items() if other != key]
            if len(others) >= LEAST_UNCHANGED:
                drift = np.median(others, axis=0)
                if moved or _spread(series[key] - drift, split) < _spread(series[key], split):
                    steady[key] = series[key] - drift
    return steady


def _apart(drift: np.ndarray, split: int) -> bool:
    """Whether the sides differ by it; of fewer runs than prove anything, always."""
    sides = np.split(drift, [split])
    return min(map(len, sides)) < LEAST_RUNS or _tested(*sides).p < ALPHA


def _spread(values: np.ndarray, split: int) -> float:
    """Variance within the sides, without their outliers."""
    squares = [np.sort((side - np.median(side)) ** 2) for side in np.split(values, [split])]
    return sum(float(side[: len(side) - int(TRIM * len(side))].mean()) for side in squares)


def _drift(series: Mapping[tuple, np.ndarray], steady: Mapping[tuple, np.ndarray], runs: int) -> dict[str, float]:
    """How much slower the machine was for the new side, by clock: the median over rows of what was subtracted."""
    shifts: dict[str, list[float]] = {}
    for key, values in series.items():
        if steady[key] is not values:
            taken = values - steady[key]
            shifts.setdefault(key[-1], []).append(float(taken[runs:].mean() - taken[:runs].mean()))
    return {clock: _ratio(float(np.median(found))) for clock, found in shifts.items()}


def _paces(sides: Mapping[Group, Sequence[np.ndarray]], *, proves: bool) -> Iterator[Pace]:
    if not proves:
        for group, (base, new) in sides.items():
            yield Pace(*group, "unproven", _ratio(new.mean() - base.mean()))
        return
    tests = {group: _tested(base, new) for group, (base, new) in sides.items()}
    adjusted = stats.false_discovery_control([test.p for test in tests.values()]) if tests else []
    for (group, test), p in zip(tests.items(), adjusted, strict=True):
        low, high = test.difference - test.half, test.difference + test.half
        verdict = "ambiguous"
        if p < ALPHA:
            verdict = "slow" if test.difference > 0 else "fast"
        elif low >= -SAME and high <= SAME:
            verdict = "same"
        yield Pace(*group, verdict, _ratio(test.difference), _ratio(low), _ratio(high), float(p))


def _ratio(log: float) -> float:
    """The ratio whose logarithm it is, finite whatever a damaged table made of it."""
    return math.exp(min(float(log), 700.0))


@dataclass(frozen=True)
class _Test:
    """Difference of two sides' means, half its 95 % interval, and p of its being within MARGIN, two-sided."""

    difference: float
    half: float
    p: float


def _tested(base: np.ndarray, new: np.ndarray) -> _Test:
    """Welch's t-test with a margin."""
    spreads = [max(float(side.var(ddof=1)), STEADIEST**2) / len(side) for side in (base, new)]
    error = math.sqrt(sum(spreads))
    dof = sum(spreads) ** 2 / sum(s * s / (len(side) - 1) for s, side in zip(spreads, (base, new), strict=True))
    difference = float(new.mean() - base.mean())
    p = min(1.0, 2.0 * float(stats.t.sf((abs(difference) - MARGIN) / error, dof)))
    return _Test(difference, float(stats.t.ppf(0.975, dof)) * error, p)
