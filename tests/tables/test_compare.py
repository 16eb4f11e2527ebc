"""The verdict of a comparison, one difference at a time, on tables made for it."""

from __future__ import annotations

import math

import pytest

from benchharness.tables import compare, results, times

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
    """Two lists of records -> verdict, through the files."""

    def run(old, new, **options):
        for name, records in (("base", old), ("new", new)):
            results.write_results(tmp_path / name, records)
        return compare.compare(tmp_path / "base", tmp_path / "new", **options)

    return run


@pytest.fixture
def judge_runs(tmp_path):
    """Two lists of runs, each a list of records -> verdict, through the files."""

    def run(old, new, **options):
        for side, tables in (("base", old), ("new", new)):
            for number, records in enumerate(tables):
                results.write_results(tmp_path / side / f"{number + 1:02d}", records)
        return compare.compare(tmp_path / "base", tmp_path / "new", **options)

    return run


def altered(path, column, text):
    """Writes a text into a column of all rows of a run's results.csv, whatever it may be."""
    header, *lines = (path / "results.csv").read_text().splitlines()
    place = header.split(",").index(column)
    cells = [line.split(",") for line in lines]
    for row in cells:
        row[place] = text
    (path / "results.csv").write_text("\n".join([header, *(",".join(row) for row in cells)]) + "\n")


def kinds(verdict) -> set[tuple[str, str]]:
    return {(finding.kind, finding.what) for finding in verdict.findings}


def test_a_table_is_as_good_as_itself(judge):
    verdict = judge(rows(), rows())
    assert verdict.findings == () and verdict.exit_code == 0 and verdict.rows == 3


@pytest.mark.parametrize("environment", ["e1", "e2"])
@pytest.mark.parametrize("gate", compare.GATES, ids=lambda gate: gate.column)
def test_each_gate_lets_its_tolerance_pass_and_fails_just_beyond_it(judge, gate, environment):
    start = GOOD[gate.column]
    allowed = gate.allowed(start, same_machine=environment == GOOD["environment"])
    whole = isinstance(start, int)
    within = start + gate.sign * (math.floor(allowed) if whole else 0.99 * allowed)
    beyond = start + gate.sign * (math.floor(allowed) + 1 if whole else 1.01 * allowed + 1e-9)
    assert judge(rows(), rows(environment=environment, **{gate.column: within})).exit_code == 0
    worse = judge(rows(), rows(environment=environment, **{gate.column: beyond}))
    assert kinds(worse) == {("regression", gate.column)} and worse.exit_code == 1
    if start:
        better = judge(rows(), rows(environment=environment, **{gate.column: 2 * start - beyond}))
        assert kinds(better) == {("improvement", gate.column)} and better.exit_code == 0


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"nonfinite_px": 1, "status": "invalid", "reason": "1 pixels are NaN, infinite or negative"}, 1),
        ({"flip": 0.05 + 0.005 * 0.5}, 1),  # half a percent of the pixels is wrong by half of all that FLIP knows
        ({"flip": 0.05 * 1.01}, 1),
        ({"iterations_mean": 4.0, "iterations_max": 21, "counters": "texel_reads=1300; steps=51"}, 1),
        ({"counters": "texel_reads=1000; steps=51"}, 1),
        ({"status": "refused", "reason": "flat"}, 1),
        ({"status": "crashed", "reason": "SIGABRT"}, 3),
        ({"params": "steps=9"}, 4),
        ({"scene_hash": "s2"}, 4),
        ({"method": "renamed"}, 3),
    ],
    ids=lambda value: str(next(iter(value))) if isinstance(value, dict) else "",
)
def test_each_planted_change_has_its_exit_code(judge, change, code):
    other = rows(method="other")
    assert judge([*rows(), *other], [*rows(**{"method_hash": "m2"} | change), *other]).exit_code == code


def test_more_work_than_the_tolerance_is_a_regression_and_less_an_improvement(judge):
    elsewhere = {"environment": "e2"}
    assert judge(rows(), rows(counters="texel_reads=1010; steps=50", **elsewhere)).findings == ()
    more = judge(rows(), rows(counters="texel_reads=1011; steps=50", **elsewhere))
    assert kinds(more) == {("regression", "counter texel_reads")}
    assert judge(rows(), rows(counters="texel_reads=1001; steps=50")).findings == ()
    assert kinds(judge(rows(), rows(counters="texel_reads=1002; steps=50"))) == {("regression", "counter texel_reads")}
    assert kinds(judge(rows(), rows(counters="texel_reads=900; steps=50"))) == {("improvement", "counter texel_reads")}


@pytest.mark.parametrize("text", ["nan", "inf", "NaN"])
@pytest.mark.parametrize(
    ("column", "before", "cell", "what"),
    [
        ("flip", 0.05, "{}", "flip"),
        ("flip", None, "{}", "flip"),
        ("coverage", 0.99, "{}", "coverage"),
        ("counters", "steps=50", "steps={}", "counter steps"),
        ("counters", "steps=50", "steps=50; more={}", "counter more"),
    ],
)
def test_a_new_number_that_is_none_is_a_regression(tmp_path, text, column, before, cell, what):
    results.write_results(tmp_path / "base", rows(**{column: before}))
    results.write_results(tmp_path / "new", rows(**{column: before}))
    altered(tmp_path / "new", column, cell.format(text))
    verdict = compare.compare(tmp_path / "base", tmp_path / "new")
    assert ("regression", what) in kinds(verdict) and verdict.exit_code == 1
    with pytest.raises(ValueError, match=rf"new.results\.csv: line 2, column '{column}'"):
        compare.compare(tmp_path / "new", tmp_path / "base")
    with pytest.raises(ValueError, match=rf"line 2, column '{column}'"):
        compare.accept(tmp_path / "new", tmp_path / "baselines", "why")


@pytest.mark.parametrize("text", ["steps=many", "steps=True", "steps=None", "steps=-1", "steps", f"steps={10**40}"])
def test_counters_that_are_no_numbers_are_damage_and_said_where(tmp_path, text):
    for side in ("base", "new"):
        results.write_results(tmp_path / side, rows())
    altered(tmp_path / "new", "counters", text)
    with pytest.raises(ValueError, match=r"new.results\.csv: line 2, column 'counters'.*accepted"):
        compare.compare(tmp_path / "base", tmp_path / "new")


def test_a_counter_that_is_gone_is_incomplete_and_a_new_one_a_note(judge):
    gone = judge(rows(), rows(counters="steps=50"))
    assert kinds(gone) == {("incomplete", "counter texel_reads")} and gone.exit_code == 3
    assert kinds(judge(rows(counters="steps=50"), rows())) == {("note", "counter texel_reads")}


def test_an_error_that_is_not_measured_any_more_is_incomplete(judge):
    verdict = judge(rows(), rows(flip=None))
    assert kinds(verdict) == {("incomplete", "flip")} and verdict.exit_code == 3
    assert judge(rows(flip=None), rows()).exit_code == 0


def test_errors_within_the_references_noise_are_not_ranked_but_told_and_work_is_ranked(judge):
    old = rows(reference_noise=0.08, flip=0.02, rmse=0.01)
    hidden = judge(old, rows(reference_noise=0.08, flip=0.07, rmse=0.04))
    assert kinds(hidden) == {("warning", "flip"), ("warning", "rmse")} and hidden.exit_code == 0
    assert "within the reference's noise, 0.08" in hidden.findings[0].text
    assert kinds(judge(rows(reference_noise=0.08, flip=0.07), old)) >= {("note", "flip")}
    assert judge(old, rows(reference_noise=0.08, flip=0.09, rmse=0.01)).exit_code == 1
    worse = judge(old, rows(reference_noise=0.08, flip=0.02, rmse=0.01, iterations_mean=4.0))
    assert kinds(worse) == {("regression", "iterations_mean")}


def test_a_reference_that_is_all_noise_passes_no_changed_picture(judge):
    verdict = judge(rows(reference_noise=1.0), rows(reference_noise=1.0, flip=0.9))
    assert kinds(verdict) == {("not comparable", "flip")} and verdict.exit_code == 4
    assert judge(rows(reference_noise=1.0), rows(reference_noise=1.0)).findings == ()


def test_a_reference_that_became_noisier_is_another_one(judge):
    verdict = judge(rows(reference_noise=0.0), rows(reference_noise=1.0, flip=0.9))
    assert kinds(verdict) == {("not comparable", "reference_noise")} and verdict.exit_code == 4
    assert judge(rows(reference_noise=0.010), rows(reference_noise=0.011)).findings == ()


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


@pytest.mark.parametrize(("after", "code"), [("refused", 1), ("crashed", 3), ("timeout", 3)])
def test_a_status_decides_before_the_settings_of_rows_that_measured_nothing(judge, after, code):
    nothing = dict.fromkeys(compare.SETTINGS, None) | {"reference_spp": 4096, "scene_hash": "s2"}
    verdict = judge(rows(), rows(status=after, reason="why", **nothing))
    assert {what for _, what in kinds(verdict)} == {"status"} and verdict.exit_code == code


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


# Several runs of a side.


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
    assert "\ntimes 1 slow, " in compare.render(failed) and "8 runs against 8" in compare.render(failed)


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
    assert "times unproven: " in compare.render(told)
    gated = judge_runs(*sides, fail_on_time=True)
    assert ("incomplete", "times") in kinds(gated) and gated.exit_code == 3
    assert ("one run against one" in compare.render(gated)) == (runs == 1)
    assert "benchharness rerun" in compare.render(gated)


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
    assert kinds(verdict) == {("warning", "shade_ms")} and "different machines" in compare.render(verdict)
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


# In words.


def test_the_text_says_what_to_type_and_puts_the_frames_of_a_finding_on_one_line(judge, tmp_path):
    new = rows(2, flip=0.07) + [row | {"frame": 2} for row in rows(1, flip=0.09)]
    verdict = judge(rows(), new)
    text = compare.render(verdict)
    assert "REGRESSION" in text and "kitchen lean · secant · steps=8" in text
    assert text.count("flip ") == 1 and "0.05 -> 0.09 (+80 %)" in text and "frame 2, the most of 3: 0-2" in text
    assert "benchharness run CONFIG --only secant" in text
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


def test_what_to_type_names_the_configs_file_and_the_plugins(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "configs").mkdir()
    (tmp_path / "configs" / "quick.toml").touch()
    results.write_results(tmp_path / "base", rows())
    results.write_results(tmp_path / "new", rows(flip=0.4))
    assert "benchharness run configs/quick.toml --only secant" in compare.render(
        compare.compare(tmp_path / "base", tmp_path / "new")
    )
    results.write_command(tmp_path / "new", tmp_path / "other" / "quick.toml", ["/far/mine.py:Mine", str(tmp_path / "a b.py")])
    text = compare.render(compare.compare(tmp_path / "base", tmp_path / "new"))
    assert "benchharness run other/quick.toml --plugin /far/mine.py:Mine --plugin 'a b.py' --only secant" in text
    (tmp_path / "new" / "command.json").write_text("[]")
    with pytest.raises(ValueError, match=r"command\.json: damaged"):
        compare.compare(tmp_path / "base", tmp_path / "new")


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


@pytest.mark.parametrize(
    "other", [dict(config_hash="c2"), dict(scene="cube"), dict(scene="cube", config_hash="c2")], ids=lambda o: "+".join(o)
)
def test_the_baseline_of_another_study_of_the_same_name_is_not_replaced_unasked(tmp_path, other):
    base = tmp_path / "baselines"
    results.write_results(tmp_path / "run", rows())
    results.write_results(tmp_path / "other", rows(**other))
    file = compare.accept(tmp_path / "run", base, "first")
    before = file.read_bytes(), (base / "LOG.md").read_bytes()
    with pytest.raises(ValueError, match=r"quick\.csv is the baseline of another study.*--replace"):
        compare.accept(tmp_path / "other", base, "why")
    assert before == (file.read_bytes(), (base / "LOG.md").read_bytes())
    kept = results.read_results(compare.accept(tmp_path / "other", base, "a new study", replaces=True))
    assert kept == results.read_results(tmp_path / "other")


@pytest.mark.parametrize("status", ["crashed", "timeout"])
def test_a_run_in_which_something_crashed_is_no_baseline(tmp_path, status):
    results.write_results(tmp_path / "run", [*rows(), *rows(1, method="b", status=status, reason="SIGABRT")])
    with pytest.raises(ValueError, match=rf"frame 0 of 'kitchen, b steps=8' is {status}; accepted: a run in which nothing"):
        compare.accept(tmp_path / "run", tmp_path / "baselines", "why")
    assert not (tmp_path / "baselines").exists()


def test_a_baseline_needs_a_reason_and_a_run_of_one_config(tmp_path):
    results.write_results(tmp_path / "run", rows())
    with pytest.raises(ValueError, match="a sentence why"):
        compare.accept(tmp_path / "run", tmp_path / "baselines", " \n")
    assert not (tmp_path / "baselines").exists()
    results.write_results(tmp_path / "two", rows() + rows(config="other"))
    with pytest.raises(ValueError, match="rows of 2 configs"):
        compare.accept(tmp_path / "two", tmp_path / "baselines", "why")
    (tmp_path / "file").touch()
    with pytest.raises(ValueError, match="is a file; accepted: a folder"):
        compare.accept(tmp_path / "run", tmp_path / "file", "why")
