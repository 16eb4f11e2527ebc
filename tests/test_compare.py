"""The verdict of a comparison, one difference at a time, on tables made for it."""

from __future__ import annotations

import math

import pytest

from benchharness import compare, results

GOOD = dict(
    run="r", config="quick", scene="kitchen", detail="lean", method="secant", params="steps=8", status="ok",
    reflector_px=9000, prepare_ms=50.0, shade_ms=4.0, kernel_ms=3.0, frame_ms=9.0, rmse=0.02, relmse=0.01, flip=0.05,
    flip_p95=0.2, coverage=0.99, nonfinite_px=0, distance_err=0.01, residual_px=0.3, converged_ratio=0.97,
    wrong_ratio=0.01, iterations_mean=3.0, iterations_max=20, temporal_diff=0.004, jitter_px=0.2,
    reference_lighting="baked", reference_spp=64, reference_noise=0.0, config_hash="c1", method_hash="m1",
    scene_hash="s1", environment="e1", calibration_ms=10.0, ppd=67.0, counters="texel_reads=1000; steps=50",
)  # fmt: skip


def rows(frames: int = 3, **change) -> list[dict]:
    return [dict.fromkeys(results.COLUMNS) | GOOD | {"frame": frame} | change for frame in range(frames)]


@pytest.fixture
def judge(tmp_path):
    """Two lists of records (and of samples) -> verdict, through the files."""

    def run(old, new, old_samples=(), new_samples=(), **options):
        for name, records, samples in (("base", old, old_samples), ("new", new, new_samples)):
            results.write_results(tmp_path / name, records)
            if samples:
                results.write_samples(tmp_path / name, samples)
        return compare.compare(tmp_path / "base", tmp_path / "new", **options)

    return run


def kinds(verdict) -> set[tuple[str, str]]:
    return {(finding.kind, finding.what) for finding in verdict.findings}


def test_a_table_is_as_good_as_itself(judge):
    verdict = judge(rows(), rows())
    assert verdict.findings == () and verdict.exit_code == 0 and verdict.rows == 3


@pytest.mark.parametrize("gate", compare.GATES, ids=lambda gate: gate.column)
def test_each_gate_lets_its_tolerance_pass_and_fails_just_beyond_it(judge, gate):
    start = GOOD[gate.column]
    allowed = gate.absolute + gate.relative * start
    whole = isinstance(start, int)
    within = start + gate.sign * (math.floor(allowed) if whole else 0.99 * allowed)
    beyond = start + gate.sign * (math.floor(allowed) + 1 if whole else 1.01 * allowed + 1e-9)
    assert judge(rows(), rows(**{gate.column: within})).exit_code == 0
    worse = judge(rows(), rows(**{gate.column: beyond}))
    assert kinds(worse) == {("regression", gate.column)} and worse.exit_code == 1
    if start:
        better = judge(rows(), rows(**{gate.column: 2 * start - beyond}))
        assert kinds(better) == {("improvement", gate.column)} and better.exit_code == 0


def test_more_work_than_a_hundredth_is_a_regression_and_less_an_improvement(judge):
    assert judge(rows(), rows(counters="texel_reads=1010; steps=50")).findings == ()
    assert kinds(judge(rows(), rows(counters="texel_reads=1011; steps=50"))) == {("regression", "counter texel_reads")}
    assert kinds(judge(rows(), rows(counters="texel_reads=900; steps=50"))) == {("improvement", "counter texel_reads")}


def test_a_counter_that_is_gone_is_incomplete_and_a_new_one_a_note(judge):
    gone = judge(rows(), rows(counters="steps=50"))
    assert kinds(gone) == {("incomplete", "counter texel_reads")} and gone.exit_code == 3
    assert kinds(judge(rows(counters="steps=50"), rows())) == {("note", "counter texel_reads")}


def test_an_error_that_is_not_measured_any_more_is_incomplete(judge):
    verdict = judge(rows(), rows(flip=None))
    assert kinds(verdict) == {("incomplete", "flip")} and verdict.exit_code == 3
    assert judge(rows(flip=None), rows()).exit_code == 0


def test_errors_within_the_references_noise_are_not_ranked_but_work_is(judge):
    old = rows(reference_noise=0.08, flip=0.02, rmse=0.01)
    new = rows(reference_noise=0.08, flip=0.07, rmse=0.04)
    assert judge(old, new).findings == ()
    assert judge(old, rows(reference_noise=0.08, flip=0.09, rmse=0.01)).exit_code == 1
    worse = rows(reference_noise=0.08, flip=0.07, rmse=0.04, iterations_mean=4.0)
    assert kinds(judge(old, worse)) == {("regression", "iterations_mean")}


@pytest.mark.parametrize(
    ("before", "after", "kind", "code"),
    [
        ("ok", "refused", "regression", 1),
        ("ok", "invalid", "regression", 1),
        ("ok", "crashed", "incomplete", 3),
        ("ok", "timeout", "incomplete", 3),
        ("refused", "ok", "improvement", 0),
        ("crashed", "ok", "improvement", 0),
        ("invalid", "refused", "improvement", 0),
        ("crashed", "crashed", "note", 0),
        ("refused", "refused", "note", 0),
    ],
)
def test_a_status_decides_before_any_number(judge, before, after, kind, code):
    verdict = judge(rows(status=before), rows(status=after, reason="why", flip=9.0))
    assert kinds(verdict) == {(kind, "status")} and verdict.exit_code == code
    if before != after:
        assert verdict.findings[0].text == f"was {before}, is {after}: why"


def test_missing_rows_are_incomplete_and_new_ones_a_note(judge):
    verdict = judge(rows(3), rows(2))
    assert kinds(verdict) == {("incomplete", "missing")} and verdict.exit_code == 3
    assert verdict.findings[0].frame == 2
    assert kinds(judge(rows(2), rows(3))) == {("note", "new row")}
    assert judge(rows(), [*rows(), *rows(method="new", status="crashed")]).exit_code == 3
    assert judge(rows(), []).exit_code == 3


def test_another_config_is_not_comparable_and_nothing_else_is_said(judge):
    verdict = judge(rows(), rows(config_hash="c2", flip=0.9))
    assert kinds(verdict) == {("not comparable", "config_hash")} and verdict.exit_code == 4
    assert "c1" in verdict.findings[0].text and "c2" in verdict.findings[0].text


@pytest.mark.parametrize(
    "change",
    [dict(scene_hash="s2"), dict(reference_lighting="transport"), dict(reference_spp=1), dict(ppd=30.0)],
    ids=lambda change: next(iter(change)),
)
def test_rows_under_other_conditions_are_not_compared(judge, change):
    verdict = judge(rows(), rows(flip=0.9, **change))
    assert kinds(verdict) == {("not comparable", *change)} and verdict.exit_code == 4


def test_a_changed_scene_does_not_hide_a_regression_in_another(judge):
    old = rows() + rows(scene="cube")
    verdict = judge(old, rows(scene_hash="s2") + rows(scene="cube", flip=0.4))
    assert kinds(verdict) == {("not comparable", "scene_hash"), ("regression", "flip")} and verdict.exit_code == 1


def test_a_side_that_does_not_say_its_settings_is_compared(judge):
    assert judge(rows(ppd=None), rows()).findings == ()


def test_changed_parameters_of_a_method_are_not_comparable_but_a_lost_one_is_incomplete(judge):
    verdict = judge(rows(), rows(params="steps=9"))
    assert ("not comparable", "params") in kinds(verdict) and verdict.exit_code == 4
    assert "steps=8" in verdict.findings[0].text and "steps=9" in verdict.findings[0].text
    assert judge(rows() + rows(params="steps=9"), rows()).exit_code == 3


def test_no_common_row_is_not_comparable(judge):
    assert judge(rows(scene="cube"), rows()).exit_code == 4
    assert judge([], rows()).exit_code == 4


def test_changed_code_is_told_and_compared(judge):
    verdict = judge(rows(), rows(method_hash="m2", flip=0.5))
    assert kinds(verdict) == {("note", "method_hash"), ("regression", "flip")}


def test_another_mask_is_a_warning(judge):
    verdict = judge(rows(), rows(reflector_px=8000))
    assert kinds(verdict) == {("warning", "reflector_px")} and verdict.exit_code == 0


def samples(times, frames: int = 3, clock: str = "shade") -> list[dict]:
    where = {name: GOOD[name] for name in ("scene", "detail", "method", "params")}
    return [where | dict(frame=f, clock=clock, round=r, ms=ms) for f in range(frames) for r, ms in enumerate(times)]


SLOW = [6.0, 6.1, 6.2, 5.9]
FAST = [4.0, 4.1, 3.9, 4.05]


def test_a_slower_time_warns_and_is_proven_by_its_samples(judge):
    verdict = judge(rows(), rows(shade_ms=6.0), samples(FAST), samples(SLOW))
    assert kinds(verdict) == {("warning", "shade_ms")} and verdict.exit_code == 0
    assert verdict.findings[0].text.startswith("1.50 times the base")


def test_a_slower_time_that_its_samples_do_not_prove_is_marked(judge):
    mixed = [3.0, 9.0, 4.0, 6.0], [4.0, 3.0, 9.0, 6.1]
    for options in ({}, {"fail_on_time": True}):
        verdict = judge(rows(), rows(shade_ms=6.0), samples(mixed[0]), samples(mixed[1]), **options)
        assert kinds(verdict) == {("warning", "shade_ms")} and verdict.exit_code == 0
        assert verdict.findings[0].text.startswith("~ 1.50 times")


def test_a_slower_time_fails_only_if_asked_to(judge):
    proven = samples(FAST), samples(SLOW)
    assert judge(rows(), rows(shade_ms=6.0), *proven, fail_on_time=True).exit_code == 1


def test_without_samples_the_factor_alone_decides_and_says_so(judge):
    verdict = judge(rows(), rows(shade_ms=6.0))
    text = verdict.findings[0].text
    assert verdict.exit_code == 0 and text.startswith("~ 1.50") and "no raw samples" in text
    assert judge(rows(), rows(shade_ms=6.0), fail_on_time=True).exit_code == 1


def test_times_are_relative_to_the_calibration_kernel(judge):
    # A machine half as fast: 8 ms there are 4 ms here.
    slower_machine = dict(calibration_ms=20.0, prepare_ms=100.0, shade_ms=8.0, kernel_ms=6.0)
    assert judge(rows(), rows(**slower_machine)).findings == ()
    assert kinds(judge(rows(), rows(calibration_ms=20.0))) == {
        ("note", "prepare_ms"), ("note", "shade_ms"), ("note", "kernel_ms")}  # fmt: skip
    assert kinds(judge(rows(), rows(calibration_ms=None))) == {("note", "times")}


def test_samples_are_relative_to_the_calibration_kernel_too(judge):
    # The same 6 ms on a machine that is 1.5 times as fast: slower, and proven although the raw times are the same.
    old = rows(calibration_ms=15.0, prepare_ms=75.0, shade_ms=6.0, kernel_ms=4.5)
    verdict = judge(old, rows(shade_ms=6.0), samples(SLOW), samples(SLOW))
    assert kinds(verdict) == {("warning", "shade_ms")} and verdict.findings[0].text.startswith("1.50 times")


def test_the_factor_is_the_limit_and_frames_weigh_the_same(judge):
    assert judge(rows(), rows(shade_ms=4.9)).findings == ()
    assert kinds(judge(rows(), rows(shade_ms=4.9), factor=1.2)) == {("warning", "shade_ms")}
    one_slow_frame = rows(2) + [row | {"frame": 2} for row in rows(1, shade_ms=400.0)]
    assert judge(rows(), one_slow_frame).findings == ()
    with pytest.raises(ValueError, match="above 1"):
        judge(rows(), rows(), factor=1.0)


def test_times_of_a_launch_are_not_compared(judge):
    assert judge(rows(shade_ms=0.02), rows(shade_ms=0.09)).findings == ()


def test_identical_samples_prove_nothing(judge):
    verdict = judge(rows(), rows(shade_ms=6.0), samples([5.0] * 4), samples([5.0] * 4))
    assert verdict.findings[0].text.startswith("~")


def test_a_proven_gain_in_time_is_an_improvement(judge):
    verdict = judge(rows(shade_ms=6.0), rows(), samples(SLOW), samples(FAST))
    assert kinds(verdict) == {("improvement", "shade_ms")}


def test_the_text_says_what_to_type_and_puts_the_frames_of_a_finding_on_one_line(judge, tmp_path):
    new = rows(2, flip=0.07) + [row | {"frame": 2} for row in rows(1, flip=0.09)]
    verdict = judge(rows(), new)
    text = compare.render(verdict)
    assert "REGRESSION" in text and "kitchen lean · secant · steps=8" in text
    assert text.count("flip ") == 1 and "0.05 -> 0.09 (+80 %)" in text and "frame 2, the most of 3: 0-2" in text
    assert "benchharness run quick --only secant" in text
    assert f"benchharness accept {tmp_path / 'new'} --because TEXT" in text
    assert text.endswith("verdict: a regression was found (exit code 1)")


def test_the_text_of_a_fine_verdict_accepts_and_reproduces_nothing(judge):
    text = compare.render(judge(rows(), rows()))
    assert "accept" not in text and "reproduce" not in text and text.endswith("verdict: fine (exit code 0)")


def test_a_path_with_a_blank_can_be_pasted(tmp_path):
    results.write_results(tmp_path / "my run", rows(flip=0.4))
    results.write_results(tmp_path / "base", rows())
    text = compare.render(compare.compare(tmp_path / "base", tmp_path / "my run"))
    assert f"accept '{tmp_path / 'my run'}'" in text


def test_a_row_that_is_there_twice_is_the_users_mistake(judge, tmp_path):
    with pytest.raises(ValueError, match="twice"):
        judge(rows() + rows(), rows())
    with pytest.raises(ValueError, match="No such file"):
        compare.compare(tmp_path / "nowhere", tmp_path / "base")


def test_an_accepted_run_is_a_baseline_that_it_passes(tmp_path):
    both = rows(config="configs/quick.toml") + rows(config="configs/quick.toml", method="b", status="refused")
    results.write_results(tmp_path / "run", both)
    file = compare.accept(tmp_path / "run", tmp_path / "baselines", " first\nnumbers ")
    assert file == tmp_path / "baselines" / "quick.csv"
    verdict = compare.compare(file, tmp_path / "run")
    assert verdict.exit_code == 0 and verdict.rows == 6
    (entry,) = [line for line in (tmp_path / "baselines" / "LOG.md").read_text().splitlines() if line.startswith("- ")]
    assert "`quick` first numbers (6 rows: 3 ok, 3 refused)" in entry


def test_an_accepted_part_of_a_run_leaves_the_other_methods_rows(tmp_path):
    base = tmp_path / "baselines"
    results.write_results(tmp_path / "all", rows() + rows(method="b"))
    results.write_results(tmp_path / "part", rows(2, method="b", flip=0.01))
    compare.accept(tmp_path / "all", base, "all")
    file = compare.accept(tmp_path / "part", base, "better")
    kept = {(r["method"], r["frame"], r["flip"]) for r in results.read_results(file)}
    assert kept == {("secant", f, 0.05) for f in range(3)} | {("b", 0, 0.01), ("b", 1, 0.01)}
    assert (base / "LOG.md").read_text().count("\n- ") == 2
    results.write_results(tmp_path / "other", rows(method="b", config_hash="c2"))
    assert len(results.read_results(compare.accept(tmp_path / "other", base, "new config"))) == 3


def test_a_baseline_needs_a_reason_and_a_run_of_one_config(tmp_path):
    results.write_results(tmp_path / "run", rows())
    with pytest.raises(ValueError, match="a sentence why"):
        compare.accept(tmp_path / "run", tmp_path / "baselines", " \n")
    assert not (tmp_path / "baselines").exists()
    results.write_results(tmp_path / "two", rows() + rows(config="other"))
    with pytest.raises(ValueError, match="rows of 2 configs"):
        compare.accept(tmp_path / "two", tmp_path / "baselines", "why")
