"""The verdict of a comparison, one difference at a time, on tables made for it."""

from __future__ import annotations

import math

import pytest
from support.records import GOOD, altered, kinds, rows

from benchharness.tables import baseline, compare, formats, gates, origin, results


def test_a_table_is_as_good_as_itself(judge):
    verdict = judge(rows(), rows())
    assert verdict.findings == () and verdict.exit_code == 0 and verdict.rows == 3


@pytest.mark.parametrize("environment", ["e1", "e2"])
@pytest.mark.parametrize("column", gates.GATED, ids=lambda column: column.name)
def test_each_gate_lets_its_tolerance_pass_and_fails_just_beyond_it(judge, column, environment):
    name, start = column.name, GOOD[column.name]
    allowed = gates.allowed(column.gate, start, same_machine=environment == GOOD["environment"])
    whole = isinstance(start, int)
    within = start + column.sign * (math.floor(allowed) if whole else 0.99 * allowed)
    beyond = start + column.sign * (math.floor(allowed) + 1 if whole else 1.01 * allowed + 1e-9)
    assert judge(rows(), rows(environment=environment, **{name: within})).exit_code == 0
    worse = judge(rows(), rows(environment=environment, **{name: beyond}))
    if column.gate.local and environment != GOOD["environment"]:  # rounding does that too
        assert kinds(worse) == {("note", name)} and worse.exit_code == 0
        return
    assert kinds(worse) == {("regression", name)} and worse.exit_code == 1
    if start:
        better = judge(rows(), rows(environment=environment, **{name: 2 * start - beyond}))
        assert kinds(better) == {("improvement", name)} and better.exit_code == 0


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


def test_what_rounding_moves_is_told_elsewhere_and_judged_here(judge):
    """What two processors made of one commit: a highlight that moved by a pixel, and nothing that is seen."""
    moved = {"rmse": GOOD["rmse"] * 1.14, "relmse": GOOD["relmse"] * 1.51, "iterations_max": GOOD["iterations_max"] + 4}
    elsewhere = judge(rows(), rows(environment="e2", **moved))
    assert elsewhere.exit_code == 0 and kinds(elsewhere) == {("note", name) for name in moved}
    assert judge(rows(), rows(environment="e2", flip=GOOD["flip"] * 1.14, **moved)).exit_code == 1
    assert judge(rows(), rows(**moved)).exit_code == 1


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
        baseline.accept(tmp_path / "new", tmp_path / "baselines", "why")


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


# In words.


def test_the_text_says_what_to_type_and_puts_the_frames_of_a_finding_on_one_line(judge, tmp_path):
    new = rows(2, flip=0.07) + [row | {"frame": 2} for row in rows(1, flip=0.09)]
    verdict = judge(rows(), new)
    text = formats.as_text(verdict)
    assert "REGRESSION" in text and "kitchen lean · secant · steps=8" in text
    assert text.count("flip ") == 1 and "0.05 -> 0.09 (+80 %)" in text and "frame 2, the most of 3: 0-2" in text
    assert "benchharness run CONFIG --only secant" in text
    assert f"benchharness accept {tmp_path / 'new'} --because TEXT" in text
    assert text.endswith("verdict: a regression was found (exit code 1)")


def test_the_text_of_a_fine_verdict_accepts_and_reproduces_nothing(judge):
    text = formats.as_text(judge(rows(), rows()))
    assert "accept" not in text and "reproduce" not in text and text.endswith("verdict: fine (exit code 0)")


def test_a_path_with_a_blank_can_be_pasted(tmp_path):
    results.write_results(tmp_path / "my run", rows(flip=0.4))
    results.write_results(tmp_path / "base", rows())
    text = formats.as_text(compare.compare(tmp_path / "base", tmp_path / "my run"))
    assert f"accept '{tmp_path / 'my run'}'" in text


def test_what_to_type_names_the_configs_file_and_the_plugins(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "configs").mkdir()
    (tmp_path / "configs" / "quick.toml").touch()
    results.write_results(tmp_path / "base", rows())
    results.write_results(tmp_path / "new", rows(flip=0.4))
    assert "benchharness run configs/quick.toml --only secant" in formats.as_text(
        compare.compare(tmp_path / "base", tmp_path / "new")
    )
    origin.write_command(tmp_path / "new", tmp_path / "other" / "quick.toml", ["/far/mine.py:Mine", str(tmp_path / "a b.py")])
    text = formats.as_text(compare.compare(tmp_path / "base", tmp_path / "new"))
    assert "benchharness run other/quick.toml --plugin /far/mine.py:Mine --plugin 'a b.py' --only secant" in text
    (tmp_path / "new" / "command.json").write_text("[]")
    with pytest.raises(ValueError, match=r"command\.json: damaged"):
        compare.compare(tmp_path / "base", tmp_path / "new")


def test_a_row_that_is_there_twice_is_the_users_mistake(judge, tmp_path):
    with pytest.raises(ValueError, match="twice"):
        judge(rows() + rows(), rows())
    with pytest.raises(ValueError, match="No such file"):
        compare.compare(tmp_path / "nowhere", tmp_path / "base")
