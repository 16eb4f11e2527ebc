"""A column is one entry of one table: all else follows from it."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from benchharness.study import listing
from benchharness.tables import columns, results

PACKAGE = Path(__file__).resolve().parents[2] / "benchharness"
BASELINES = PACKAGE.parent / "results" / "baselines"

ENTRY = """    _error("warmth", "Warmth", "How much too warm it is.", Gate(0.5, 0.0, "A half is not felt."), unit="mired"),
)
\"\"\"The columns of results.csv, in order"""

USE = """
import sys
from pathlib import Path
from benchharness import report
from benchharness.report import columns as page
from benchharness.study import listing
from benchharness.tables import baseline, compare, results

def rows(warmths):
    about = dict(config="quick", scene="kitchen", detail="lean", method="search", params="", status="ok", config_hash="c")
    about |= dict(frame_ms=9.0, flip=0.1, reflector_px=5)
    return [dict.fromkeys(results.COLUMNS) | about | {"frame": i, "warmth": w} for i, w in enumerate(warmths)]

out = Path(sys.argv[1])
results.write_results(out / "base", rows([1.0, 2.0]))
for name, warmths in (("same", [1.5, 1.5]), ("worse", [1.0, 2.6]), ("gone", [1.0, None])):
    results.write_results(out / name, rows(warmths))
    verdict = compare.compare(out / "base", out / name)
    print("compare", name, [(f.kind, f.what, f.frame) for f in verdict.findings])
print("read", [row["warmth"] for row in results.read_results(out / "base")])
print("file", (out / "base" / "results.csv").read_text().splitlines()[0].rpartition(",")[2])
summary = [line.split(",") for line in (out / "base" / "summary.csv").read_text().splitlines()]
print("summary", summary[1][summary[0].index("warmth")])
text = report.write(out / "base").read_text(encoding="utf-8")
print("page", "How much too warm it is." in text, ">Warmth</th>" in text)
print("docs", [line for line in page.markdown().splitlines() if "warmth" in line])
print("list", [line for line in listing.metrics() if "warmth" in line])
try:
    results.write_results(out / "bad", rows(["very"]))
except ValueError as error:
    print("kind", error)
"""


def test_a_new_column_is_one_entry(tmp_path):
    """The package is copied and one entry written into its table of columns: every reader and writer knows it."""
    shutil.copytree(PACKAGE, tmp_path / "benchharness", ignore=shutil.ignore_patterns("__pycache__"))
    table = tmp_path / "benchharness" / "tables" / "columns.py"
    before = table.read_text()
    assert before.count(')\n"""The columns of results.csv, in order') == 1
    table.write_text(before.replace(')\n"""The columns of results.csv, in order', ENTRY))
    done = subprocess.run(
        [sys.executable, "-P", "-c", USE, str(tmp_path / "runs")],
        env={"PYTHONPATH": str(tmp_path), "HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        "compare same []",
        "compare worse [('regression', 'warmth', 1)]",
        "compare gone [('incomplete', 'warmth', 1)]",
        "read [1.0, 2.0]",
        "file warmth",
        "summary 1.5",
        "page True True",
        "docs ['| `warmth` | Warmth | mired | less | mean | How much too warm it is. |', "
        "'| `warmth` | 0.5 | A half is not felt. |']",
        "list ['warmth  (mired; less is better; the same within 0.5)  How much too warm it is.']",
        "kind column 'warmth' is 'very'; accepted: a number",
    ]


def test_the_first_columns_are_those_that_are_promised():
    """docs/columns.md follows the table; the table follows what files of others already have."""
    promised = (
        "run config scene detail frame method params variant status reason vertices triangles reflectors reflector_px "
        "prepare_ms update_ms shade_ms shade_ms_lo shade_ms_hi kernel_ms first_ms gbuffer_ms frame_ms "
        "rmse relmse flip flip_p95 coverage nonfinite_px distance_err residual_px converged_ratio wrong_ratio iterations_mean "
        "iterations_max temporal_diff jitter_px reference_lighting reference_spp reference_noise config_hash method_hash "
        "scene_hash environment"
    ).split()
    assert promised == results.REQUIRED


@pytest.mark.parametrize("baseline", sorted(BASELINES.glob("*.csv")), ids=lambda path: path.stem)
def test_a_baseline_is_written_as_it_was_read(baseline, tmp_path):
    results.write(tmp_path / "again.csv", results.read_results(baseline))
    again, kept = (path.read_text().splitlines() for path in (tmp_path / "again.csv", baseline))
    # Columns that came later are empty at the end of every row.
    later = len(again[0].split(",")) - len(kept[0].split(","))
    assert again[0].split(",")[: len(kept[0].split(","))] == kept[0].split(",")
    assert again[1:] == [line + "," * later for line in kept[1:]]


def test_every_column_says_something_and_every_gate_why():
    every = (*columns.RESULTS, *columns.SUMMARY, *columns.SAMPLES)
    assert all(column.says.endswith((".", "...")) for column in every)
    assert all(column.gate.because.endswith(".") and column.better for column in every if column.gate)
    for table in (columns.RESULTS, columns.SUMMARY, columns.SAMPLES):
        assert len(columns.kinds(table)) == len(table)


def test_the_list_of_metrics_has_all_that_is_judged():
    listed = {line.partition(" ")[0] for line in listing.metrics()}
    assert {column.name for column in columns.RESULTS if column.gate} <= listed
