"""Damaged CSVs: whatever became of a file, `compare` and `accept` answer, or say where it is damaged; nothing else."""

from __future__ import annotations

import random

import pytest
from support.tiers import complete, exhaustive

from benchharness import report
from benchharness.tables import baseline, compare, formats, results

CELLS = [
    "",
    "nan",
    "inf",
    "-1",
    "1e999",
    "1_0",
    "0x1",
    "True",
    "None",
    "ok",
    "crashed",
    "a=b",
    "steps=nan",
    "steps=many",
    "; ",
    "1e308",
    "1e-308",
    "9" * 400,
    "9" * 5000,
    "é\u2028",
    "\x00",
    "\x1b[31m",
    '"',
    '""',
    ",",
    "\n",
    "2.5",
    "١",
    " 3 ",
    "=1+1",
    "a" * 140_000,
]


def table() -> str:
    values = {"config": "quick", "scene": "kitchen", "status": "ok", "counters": "steps=50", "config_hash": "c"}
    rows = []
    for method in ("a", "b"):
        for frame in range(3):
            row = {name: 1 if kind == "integer" else 0.5 for name, kind in results.KINDS.items() if kind != "text"}
            rows.append(",".join(str((values | row | {"method": method, "frame": frame}).get(c, "")) for c in results.COLUMNS))
    return "\n".join([",".join(results.COLUMNS), *rows]) + "\n"


def damaged(rng: random.Random, text: str) -> bytes:
    """One to three things that happen to files: cells, lines, columns, bytes, an end too early."""
    for _ in range(rng.randint(1, 3)):
        lines = text.split("\n")
        line = rng.randrange(len(lines))
        cells = lines[line].split(",")
        place = rng.randrange(len(cells))
        match rng.randrange(8):
            case 0 | 1 | 2:
                cells[place] = rng.choice(CELLS)
            case 3:
                del cells[place]
            case 4:
                cells.insert(place, rng.choice(CELLS))
            case 5:
                lines.insert(line, lines[rng.randrange(len(lines))])
            case 6:
                del lines[line]
            case 7:
                lines[line:] = [lines[line][: rng.randrange(len(lines[line]) + 1)]]
        if line < len(lines) and len(cells) > 0:
            lines[line] = ",".join(cells) if rng.random() < 0.9 else lines[line]
        text = "\n".join(lines)
    raw = bytearray(text.encode())
    if raw and rng.random() < 0.1:
        raw[rng.randrange(len(raw))] = rng.randrange(256)
    return bytes(raw)


def answered(tmp_path, seed: int, reported: bool = False) -> str:
    """What became of one damaged table: "compared" or "refused". Anything but a ValueError is a failure."""
    rng = random.Random(seed)
    good, bad = tmp_path / "good", tmp_path / "bad"
    for folder in (good, bad):
        folder.mkdir(exist_ok=True)
    (good / "results.csv").write_text(table())
    (bad / "results.csv").write_bytes(damaged(rng, table()))
    said = "compared"
    for base, new in ((good, bad), (bad, good), (bad, bad)):
        try:
            verdict = compare.compare(base, new, fail_on_time=True)
            assert verdict.exit_code in (0, 1, 3, 4)
            for form in formats.FORMATS.values():
                assert form(verdict)
        except ValueError as error:
            assert str(bad) in str(error) and len(str(error)) < 2000, error
            said = "refused"
    actions = [lambda: baseline.accept(bad, tmp_path / "baselines", "why", replaces=True)]
    if reported:
        actions.append(lambda: report.write(bad))
    for action in actions:
        try:
            action()
        except ValueError as error:
            assert str(bad) in str(error), error
    return said


def test_damaged_tables_are_compared_or_refused_with_the_place(tmp_path):
    said = [answered(tmp_path, seed) for seed in range(150)]
    assert said.count("refused") > 50 and said.count("compared") > 20


@exhaustive
@pytest.mark.parametrize("first", [1000, *(pytest.param(seed, marks=complete) for seed in (2000, 3000))])
def test_many_damaged_tables_are_compared_accepted_and_reported_or_refused(tmp_path, first):
    """Two thousand more of the same kind are for all of the tests."""
    for seed in range(first, first + 1000):
        answered(tmp_path, seed)
    for seed in range(5 * first, 5 * first + 33):
        answered(tmp_path, seed, reported=True)


def test_the_undamaged_table_is_as_good_as_itself(tmp_path):
    (tmp_path / "results.csv").write_text(table())
    assert compare.compare(tmp_path, tmp_path).findings == ()
