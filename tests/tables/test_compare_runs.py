"""Several runs of a side: what their times prove, and what only one of them does."""

from __future__ import annotations

import math

import pytest
from support.records import kinds, rows

from benchharness.tables import compare, formats, times


def paced(ms: float, run: int, **change) -> list[dict]:
    """A run of five unchanged methods and one that takes `ms`; a hundredth up and down from run to run."""
    shade = lambda ms, number: ms * (1.0 + 0.01 * math.sin(7.0 * run + 3.0 * number))  # noqa: E731
    still = [row for n in range(5) for row in rows(method=f"still{n}", shade_ms=shade(3.0, n))]
    return still + rows(shade_ms=shade(ms, 9), **change)


def test_a_method_that_is_slower_in_all_runs_fails_if_asked_to(judge_runs):
    base, new = ([paced(ms, run + 100 * ms, method_hash=h) for run in range(8)] for ms, h in ((4.0, "m1"), (4.4, "m2")))
    told = judge_runs(base, new)
    assert {kind for kind in kinds(told) if kind[0] != "note"} == {("warning", "shade_ms")} and told.exit_code == 0
    failed = judge_runs(base, new, fail_on_time=True)
    (finding,) = [finding for finding in failed.findings if finding.kind == "regression"]
    assert (finding.method, finding.what, failed.exit_code) == ("secant", "shade_ms", 1)
    assert finding.text.startswith("1.10 times the base (1.") and "p = " in finding.text
    back = judge_runs(new, base, fail_on_time=True)
    assert ("improvement", "shade_ms") in kinds(back) and back.exit_code == 0
    assert "\ntimes 1 slow, " in formats.as_text(failed) and "8 runs against 8" in formats.as_text(failed)


def test_runs_of_the_same_speed_pass(judge_runs):
    verdict = judge_runs([paced(4.0, run) for run in range(8)], [paced(4.0, run + 50) for run in range(8)], fail_on_time=True)
    assert verdict.findings == () and verdict.exit_code == 0
    assert verdict.times is not None and {pace.verdict for pace in verdict.times.paces} == {"same"}


@pytest.mark.parametrize("runs", [1, times.LEAST_RUNS - 1])
def test_too_few_runs_prove_nothing_and_the_gate_says_so(judge_runs, runs):
    sides = [paced(4.0, run) for run in range(runs)], [paced(6.0, run + 9) for run in range(runs)]
    told = judge_runs(*sides)
    assert kinds(told) == {("warning", "shade_ms")} and told.exit_code == 0
    assert told.findings[0].text.startswith("~ 1.5") and "unproven" in told.findings[0].text
    assert "times unproven: " in formats.as_text(told)
    gated = judge_runs(*sides, fail_on_time=True)
    assert ("incomplete", "times") in kinds(gated) and gated.exit_code == 3
    assert ("one run against one" in formats.as_text(gated)) == (runs == 1)
    assert "benchharness rerun" in formats.as_text(gated)


def test_a_gate_on_times_without_times_is_incomplete(judge):
    untimed = dict.fromkeys(("prepare_ms", "update_ms", "shade_ms"))
    verdict = judge(rows(**untimed), rows(**untimed), fail_on_time=True)
    assert verdict.exit_code == 3 and "no row has times" in verdict.findings[0].text
    assert judge(rows(**untimed), rows(**untimed)).findings == ()


def test_a_single_slow_preparation_never_fails(judge):
    verdict = judge(rows(), rows(prepare_ms=500.0), fail_on_time=True)
    assert ("warning", "prepare_ms") in kinds(verdict) and "regression" not in {kind for kind, _ in kinds(verdict)}


def test_times_of_two_machines_are_relative_to_the_calibration_kernel_and_prove_nothing(judge):
    # A machine half as fast: 8 ms there are 4 ms here.
    slower_machine = dict(environment="e2", calibration_ms=20.0, prepare_ms=100.0, shade_ms=8.0, kernel_ms=6.0)
    assert judge(rows(), rows(**slower_machine)).findings == ()
    verdict = judge(rows(), rows(**slower_machine | {"shade_ms": 12.0}))
    assert kinds(verdict) == {("warning", "shade_ms")} and "different machines" in formats.as_text(verdict)
    assert judge(rows(), rows(environment="e2", calibration_ms=None, shade_ms=9.0)).findings == ()


def test_the_calibration_kernel_is_not_asked_on_one_machine(judge):
    assert judge(rows(), rows(calibration_ms=20.0)).findings == ()


def test_what_only_one_of_the_new_runs_does_is_not_lost(judge_runs):
    verdict = judge_runs([rows()], [rows(), rows(), rows(status="crashed", reason="SIGABRT"), rows(status="crashed")])
    assert kinds(verdict) == {("incomplete", "status")} and verdict.exit_code == 3
    assert len(verdict.findings) == 3 and "(in run 03)" in verdict.findings[0].text
    assert judge_runs([rows()] * 2, [rows(), rows(flip=0.3)] * 2).exit_code == 1


def test_runs_of_the_base_that_differ_are_a_warning(judge_runs):
    verdict = judge_runs([rows(), rows(flip=0.3)], [rows()])
    assert kinds(verdict) == {("warning", "flip")} and verdict.exit_code == 0
    assert verdict.findings[0].text.startswith("the base's run 02 differs from its run 01")


def test_a_run_that_was_not_finished_is_refused(judge_runs, tmp_path):
    judge_runs([rows()], [rows()])
    (tmp_path / "new" / "02").mkdir()
    (tmp_path / "new" / "02" / "run.json").write_text("{}")
    with pytest.raises(ValueError, match="02 holds a run that was not finished"):
        compare.compare(tmp_path / "base", tmp_path / "new")
