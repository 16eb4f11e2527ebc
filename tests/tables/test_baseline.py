"""A run that is accepted is what later ones are compared with, and nothing is lost unasked."""

from __future__ import annotations

import pytest
from support.records import rows

from benchharness.tables import baseline, compare, results


def test_an_accepted_run_is_a_baseline_that_it_passes(tmp_path):
    both = rows(config="configs/quick.toml") + rows(config="configs/quick.toml", method="b", status="refused")
    results.write_results(tmp_path / "run", both)
    file = baseline.accept(tmp_path / "run", tmp_path / "baselines", " first\nnumbers ")
    assert file == tmp_path / "baselines" / "quick.csv"
    verdict = compare.compare(file, tmp_path / "run")
    assert verdict.exit_code == 0 and verdict.rows == 6
    (entry,) = [line for line in (tmp_path / "baselines" / "LOG.md").read_text().splitlines() if line.startswith("- ")]
    assert "`quick` first numbers (6 rows: 3 ok, 3 refused)" in entry


def test_an_accepted_part_of_a_run_leaves_the_other_methods_rows(tmp_path):
    base = tmp_path / "baselines"
    results.write_results(tmp_path / "all", rows() + rows(method="b"))
    results.write_results(tmp_path / "part", rows(2, method="b", flip=0.01))
    baseline.accept(tmp_path / "all", base, "all")
    file = baseline.accept(tmp_path / "part", base, "better")
    kept = {(r["method"], r["frame"], r["flip"]) for r in results.read_results(file)}
    assert kept == {("secant", f, 0.05) for f in range(3)} | {("b", 0, 0.01), ("b", 1, 0.01)}
    assert (base / "LOG.md").read_text().count("\n- ") == 2


@pytest.mark.parametrize(
    "other", [dict(config_hash="c2"), dict(scene="cube"), dict(scene="cube", config_hash="c2")], ids=lambda o: "+".join(o)
)
def test_the_baseline_of_another_study_of_the_same_name_is_not_replaced_unasked(tmp_path, other):
    base = tmp_path / "baselines"
    results.write_results(tmp_path / "run", rows())
    results.write_results(tmp_path / "other", rows(**other))
    file = baseline.accept(tmp_path / "run", base, "first")
    before = file.read_bytes(), (base / "LOG.md").read_bytes()
    with pytest.raises(ValueError, match=r"quick\.csv is the baseline of another study.*--replace"):
        baseline.accept(tmp_path / "other", base, "why")
    assert before == (file.read_bytes(), (base / "LOG.md").read_bytes())
    kept = results.read_results(baseline.accept(tmp_path / "other", base, "a new study", replaces=True))
    assert kept == results.read_results(tmp_path / "other")


@pytest.mark.parametrize("status", ["crashed", "timeout"])
def test_a_run_in_which_something_crashed_is_no_baseline(tmp_path, status):
    results.write_results(tmp_path / "run", [*rows(), *rows(1, method="b", status=status, reason="SIGABRT")])
    with pytest.raises(ValueError, match=rf"frame 0 of 'kitchen, b steps=8' is {status}; accepted: a run in which nothing"):
        baseline.accept(tmp_path / "run", tmp_path / "baselines", "why")
    assert not (tmp_path / "baselines").exists()


def test_a_baseline_needs_a_reason_and_a_run_of_one_config(tmp_path):
    results.write_results(tmp_path / "run", rows())
    with pytest.raises(ValueError, match="a sentence why"):
        baseline.accept(tmp_path / "run", tmp_path / "baselines", " \n")
    assert not (tmp_path / "baselines").exists()
    results.write_results(tmp_path / "two", rows() + rows(config="other"))
    with pytest.raises(ValueError, match="rows of 2 configs"):
        baseline.accept(tmp_path / "two", tmp_path / "baselines", "why")
    (tmp_path / "file").touch()
    with pytest.raises(ValueError, match="is a file; accepted: a folder"):
        baseline.accept(tmp_path / "run", tmp_path / "file", "why")
