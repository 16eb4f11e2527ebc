"""What the gate on times is worth on this machine: false alarms of unchanged code, and a kernel that is a tenth slower.

    python tests/support/gate_power.py [--runs 10] [--load 0] [--folder DIR] [--unchanged]

makes so many runs of the kitchen, small, on three sides in turns (the same code twice, and once with a kernel that does a
tenth more work; not that with `--unchanged`) while `--load` other processes keep the cores busy. Then it compares them as
they were made, and in random parts: 20 of unchanged code, 10 of the slower kernel. Runs that are in the folder already are
not made again.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchharness.execution import rerun
from benchharness.tables import compare, formats, results, sides, times

STUDY = """
[run]
size = [160, 120]
frames = [50]
max_rounds = 15
images = []

[scenes.kitchen]

[methods.ray_traced]
bounces = [1, 2]

[methods.environment_map]
resolution = [64, 128]

[methods.mine]
source = "mine.py"
"""

METHOD = '''
from dataclasses import dataclass
from typing import ClassVar

import drjit as dr
import mitsuba as mi

from benchharness.api import Method, Reflection

STEPS = {steps}


@dataclass(frozen=True)
class Mine(Method):
    """Light from above, and work that takes as long as its steps."""

    paper: ClassVar[str] = "none"

    def prepare(self, scene):
        return dr.opaque(mi.Float, 0.999)

    def shade(self, state, frame):
        wo = 2.0 * dr.dot(frame.v, frame.n) * frame.n - frame.v
        x, step = mi.Float(wo.z), mi.UInt32(0)
        while dr.hint(step < STEPS, label="work"):
            x = dr.fma(x, state, 0.001)
            step += 1
        return Reflection(mi.Color3f(dr.abs(wo.z) + 1e-12 * x), dr.full(mi.Float, 10.0, dr.width(x)), found=frame.active), state
'''
METHOD = METHOD.replace("def shade", "@dr.syntax\n    def shade")

SIDES = {"base": 400, "again": 400, "slower": 447}
"""Steps of the kernel; launching it costs a sixth of the time, so that 447 take a tenth longer than 400."""
FALSE_ALARMS, TRIES = 20, 10


@contextmanager
def load(processes: int) -> Iterator[None]:
    """Keeps cores busy."""
    busy = [multiprocessing.get_context("spawn").Process(target=spin, daemon=True) for _ in range(processes)]
    for process in busy:
        process.start()
    try:
        yield
    finally:
        for process in busy:
            process.kill()
            process.join()


def spin() -> None:
    while True:
        pass


def make(folder: Path, runs: int, sides: Sequence[str] = tuple(SIDES)) -> None:
    """Runs of the sides, in turns."""
    for name in sides:
        steps = SIDES[name]
        (folder / name).mkdir(parents=True, exist_ok=True)
        (folder / name / "study.toml").write_text(STUDY)
        (folder / name / "mine.py").write_text(METHOD.format(steps=steps))
    places = {name: replace(rerun.here(), folder=folder / name) for name in sides}
    for number in range(runs + 1):  # the first one fills the caches
        first = number % len(sides)
        for name in (*sides[first:], *sides[:first]):
            place = folder / "warm-up" / name if number == 0 else folder / "runs" / name / f"{number:02d}"
            rerun.run_once(places[name], ["study.toml"], place, lambda text: None)


Run = tuple[times.Table, times.Rounds]


def read(folder: Path) -> dict[str, list[Run]]:
    """The runs of every side. Raises ValueError where a row was not measured."""
    runs = {name: sorted((folder / "runs" / name).glob("*/results.csv")) for name in SIDES}
    tables = {name: [{results.key(r): r for r in results.read_results(file)} for file in files] for name, files in runs.items()}
    for record in (record for side in tables.values() for table in side for record in table.values()):
        if record["status"] != "ok":
            raise ValueError(f"{folder}: {record['method']} is {record['status']}: {record['reason']}; accepted: ok")
    return {name: list(zip(tables[name], sides.rounds([file.parent for file in runs[name]]), strict=True)) for name in SIDES}


@dataclass(frozen=True)
class Power:
    """How often something was called slower: by unchanged code, by the slower kernel, and beside the slower kernel."""

    runs: int
    false: int
    found: int | None
    beside: int | None

    def __str__(self) -> str:
        text = f"{self.runs:2d} runs of each side: {self.false} of {FALSE_ALARMS} comparisons of unchanged code alarm"
        if self.found is None:
            return text
        return f"{text}; the slower kernel is found in {self.found} of {TRIES}, something else beside it in {self.beside}"


def slow(base: Sequence[Run], new: Sequence[Run]) -> set[str]:
    """Methods that are called slower."""
    (old, before), (young, after) = (zip(*side, strict=True) for side in (base, new))
    return {pace.method for pace in times.judge(old, young, list(old[0]), [*before, *after]).paces if pace.verdict == "slow"}


def power(tables: dict[str, list[Run]], runs: int) -> Power:
    """Of random parts of the runs, so many on each side."""
    rng = np.random.default_rng(runs)
    same = [*tables["base"], *tables["again"]]
    alarms, found = [], []
    for _ in range(FALSE_ALARMS):
        chosen = rng.permutation(len(same))[: 2 * runs]
        alarms.append(slow([same[i] for i in chosen[:runs]], [same[i] for i in chosen[runs:]]))
    for _ in range(TRIES if tables["slower"] else 0):
        parts = [[side[i] for i in rng.permutation(len(side))[:runs]] for side in (same, tables["slower"])]
        found.append(slow(*parts))
    if not found:
        return Power(runs, sum(map(bool, alarms)), None, None)
    return Power(runs, sum(map(bool, alarms)), sum("mine" in f for f in found), sum(bool(f - {"mine"}) for f in found))


def spreads(runs: dict[str, list[Run]]) -> dict[str, tuple[float, float]]:
    """Standard deviation, of the log, between runs of unchanged code: with and without drift, the median over methods."""
    sides = [[table for table, _ in runs[name]] for name in ("base", "again")]
    rounds = [taken for name in ("base", "again") for _, taken in runs[name]]
    keys = list(sides[0][0])
    raw = dict(times._series(*sides, keys, rounds, calibrated=False))
    steady = times._without_drift(raw, times._unchanged(*sides, keys), len(sides[0]))
    found: dict[str, list[tuple[float, float]]] = {}
    for key, values in raw.items():
        found.setdefault(key[-1], []).append((float(values.std(ddof=1)), float(steady[key].std(ddof=1))))
    return {clock: tuple(np.median(pairs, axis=0).tolist()) for clock, pairs in found.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--load", type=int, default=0)
    parser.add_argument("--folder", type=Path, default=None)
    parser.add_argument("--unchanged", action="store_true")
    asked = parser.parse_args()
    folder = asked.folder or Path(tempfile.mkdtemp(prefix="gate-"))
    start = time.monotonic()
    with load(asked.load):
        make(folder, asked.runs, tuple(SIDES)[: 2 if asked.unchanged else 3])
    print(f"{folder}: {time.monotonic() - start:.0f} s; load now {os.getloadavg()[0]:.1f}")
    for clock, (raw, steady) in spreads(read(folder)).items():
        print(f"{clock}: a method varies between runs by {100 * raw:.1f} %, beside the drift by {100 * steady:.1f} %")
    for new in ("again",) if asked.unchanged else ("again", "slower"):
        print(formats.as_text(compare.compare(folder / "runs" / "base", folder / "runs" / new, fail_on_time=True)))
    tables = read(folder)
    for runs in sorted({times.LEAST_RUNS, 8, asked.runs}):
        if times.LEAST_RUNS <= runs <= asked.runs:
            print(power(tables, runs))


if __name__ == "__main__":
    main()
