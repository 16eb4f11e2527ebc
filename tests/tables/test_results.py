"""Records survive their CSV bit for bit, file names are safe and unique, and summaries say what they left out."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from benchharness.tables import files, naming, origin, parameters, results, summary


def record(**values) -> dict:
    base = dict.fromkeys(results.COLUMNS)
    base.update(run="r", config="quick", scene="kitchen", detail="lean", frame=0, method="m", params="", status="ok")
    base.update(values)
    return base


def test_parameters_come_back_from_their_text():
    values = {"steps": 8, "h_max": 0.1, "tiny": 1e-17, "rule": "on_ray", "cold": True, "cap": None, "bound": math.inf}
    text = parameters.params_text(values)
    assert text == "steps=8; h_max=0.1; tiny=1e-17; rule=on_ray; cold=True; cap=None; bound=inf"
    assert parameters.parse_params(text) == values
    assert [type(v) for v in parameters.parse_params(text).values()] == [type(v) for v in values.values()]


def test_parameters_of_numpy_are_written_like_pythons():
    assert parameters.params_text({"a": np.float64(0.5), "b": np.int32(3)}) == "a=0.5; b=3"


def test_no_parameters_are_an_empty_text_and_back():
    assert parameters.params_text({}) == "" and parameters.parse_params("") == {} and parameters.parse_params(None) == {}


@pytest.mark.parametrize("bad", [{"a": "x; y"}, {"a b": 1}, {"a": " x"}, {"a": "x\ny"}])
def test_parameters_that_would_not_come_back_are_refused(bad):
    with pytest.raises(ValueError, match="accepted"):
        parameters.params_text(bad)


@pytest.mark.parametrize("bad", ["steps", "steps=1;more=2; 3=4", "=1"])
def test_text_that_is_no_parameter_list_is_refused(bad):
    with pytest.raises(ValueError, match="name=value"):
        parameters.parse_params(bad)


def test_records_come_back_bit_for_bit_and_integers_stay_integers(tmp_path):
    third = 1.0 / 3.0
    one = record(frame=3, flip=third, rmse=np.float32(0.1), vertices=np.int64(7), iterations_max=12.0)
    one["distance_err"] = 1e308
    results.write_results(tmp_path, [one, record(flip=math.nan, status="refused", reason='no,\n "closed" proxy')])
    first, second = results.read_results(tmp_path)
    assert first["flip"] == third and first["rmse"] == float(np.float32(0.1)) and first["distance_err"] == 1e308
    assert (first["frame"], first["vertices"], first["iterations_max"]) == (3, 7, 12)
    assert all(type(first[name]) is int for name in ("frame", "vertices", "iterations_max"))
    assert second["flip"] is None and second["reason"] == 'no,  "closed" proxy' and second["params"] == ""
    assert results.read_results(tmp_path / "results.csv") == [first, second]


def test_what_has_no_meaning_is_an_empty_cell_and_not_zero(tmp_path):
    results.write_results(tmp_path, [record(coverage=0.0)])
    header, row = (tmp_path / "results.csv").read_text().splitlines()
    cells = dict(zip(header.split(","), row.split(","), strict=True))
    assert cells["coverage"] == "0.0" and cells["flip"] == "" and cells["residual_px"] == ""
    results.write_results(tmp_path, [record(flip=math.nan, distance_err=math.inf, rmse=np.float32(np.inf))])
    (row,) = results.read_results(tmp_path)
    assert (row["flip"], row["distance_err"], row["rmse"]) == (None, None, None)
    assert header.split(",") == results.COLUMNS


def test_a_method_named_like_a_missing_number_keeps_its_name(tmp_path):
    results.write_results(tmp_path, [record(method="NA", scene="null", variant="nan")])
    (row,) = results.read_results(tmp_path)
    assert (row["method"], row["scene"], row["variant"]) == ("NA", "null", "nan")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"vertices": 1.5}, "vertices.*an integer"),
        ({"flip": "high"}, "flip.*a number"),
        ({"status": "fine"}, "status 'fine'.*refused"),
        ({"flpi": 0.1}, "flpi"),
    ],
)
def test_a_record_that_is_wrong_is_not_written(tmp_path, change, message):
    with pytest.raises(ValueError, match=message):
        results.write_results(tmp_path, [record() | change])
    assert not (tmp_path / "results.csv").exists()


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    results.write_results(tmp_path, [record(flip=0.5)])
    monkeypatch.setattr(files.os, "replace", lambda *_: (_ for _ in ()).throw(OSError("disk")))
    with pytest.raises(OSError, match="disk"):
        results.write_results(tmp_path, [record(flip=0.7)])
    assert results.read_results(tmp_path)[0]["flip"] == 0.5
    assert sorted(p.name for p in tmp_path.iterdir()) == ["results.csv", "summary.csv"]


def good_csv() -> str:
    about = {"scene": "s", "frame": "0", "method": "m", "status": "ok"}
    return ",".join(results.REQUIRED) + "\n" + ",".join(about.get(c, "") for c in results.REQUIRED) + "\n"


def test_a_file_with_the_required_columns_only_is_read(tmp_path):
    file = tmp_path / "old.csv"
    file.write_text(good_csv())
    (row,) = results.read_results(file)
    assert list(row) == results.COLUMNS and row["calibration_ms"] is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "No such file"),
        ("", "missing columns: run,"),
        ("\xff", "not a table"),
        (good_csv().replace("flip,", ""), "missing columns: flip;"),
        (good_csv() + "a,b\n", "line 3 has 2 cells"),
        (good_csv().rstrip("\n") + ",1\n", "line 2 has 45 cells"),
        (good_csv().replace(",ok,", ",good,"), "line 2, column 'status' is 'good'"),
        (good_csv().replace(",ok,,", ",ok,,many"), "line 2, column 'vertices' is 'many'"),
        (good_csv().replace(",ok,,", ",ok,,-1"), "line 2, column 'vertices' is '-1'; accepted: an integer of at least 0"),
        (good_csv().replace(",ok,,", ",ok,,1_0"), "line 2, column 'vertices' is '1_0'"),
        (good_csv().replace(",ok,,", ",ok,,1.5"), "line 2, column 'vertices' is '1.5'"),
        (good_csv().replace(",ok,,", ",ok,," + "9" * 400), "line 2, column 'vertices' is '9999.*[.]{3}'"),
        (good_csv().replace("\n,,s,,0,m", "\n,,,,0,m"), "line 2, column 'scene' is empty"),
        (good_csv().replace(",,0,m,", ",,0,,"), "line 2, column 'method' is empty"),
        (good_csv().replace("rmse,", "flip,", 1).replace("flip_p95", "rmse", 1), "missing columns: flip_p95"),
        (good_csv().replace("environment", "environment,flip").replace("\n,", "\n,,"), "column 'flip' is there twice"),
    ],
)
def test_a_malformed_file_is_the_users_mistake_and_says_where(tmp_path, text, message):
    file = tmp_path / "results.csv"
    if text is not None:
        file.write_text(text, encoding="latin-1")
    with pytest.raises(ValueError, match=message) as caught:
        results.read_results(file)
    assert str(file) in str(caught.value)


@pytest.mark.parametrize("text", ["nan", "inf", "-inf", "1e999", "-0.5", "0x10"])
def test_a_number_is_finite_and_not_negative_but_where_a_reader_asks_for_more(tmp_path, text):
    results.write_results(tmp_path, [record(flip=0.125)])
    table = tmp_path / "results.csv"
    table.write_text(table.read_text().replace("0.125", text))
    with pytest.raises(ValueError, match=r"line 2, column 'flip' is.*accepted: a number of at least 0, or empty"):
        results.read_results(tmp_path)
    with pytest.raises(ValueError, match="column 'flip'"):
        results.read_results(tmp_path, ("rmse",))
    if text in ("nan", "inf", "1e999"):
        (row,) = results.read_results(tmp_path, ("flip",))
        assert not math.isfinite(row["flip"])


def test_the_command_of_a_run_is_kept(tmp_path):
    assert origin.read_command(tmp_path) is None
    origin.write_command(tmp_path, tmp_path / "a.toml", ["/x.py:X"])
    assert origin.read_command(tmp_path) == {"config": str(tmp_path / "a.toml"), "plugins": ["/x.py:X"]}


def test_a_summary_takes_medians_of_times_means_of_errors_and_counts_what_it_left_out():
    rows = [
        record(frame=0, shade_ms=1.0, flip=0.1, iterations_max=4, reflector_px=10, nonfinite_px=0),
        record(frame=1, shade_ms=9.0, flip=0.2, iterations_max=9, reflector_px=0, nonfinite_px=0),
        record(frame=2, shade_ms=2.0, flip=0.6, iterations_max=5, reflector_px=10, temporal_diff=0.5),
        record(frame=3, shade_ms=99.0, flip=9.0, status="invalid", reason="NaN", nonfinite_px=7, reflector_px=10),
        record(method="other", status="refused", reason="no proxy", frame=None),
    ]
    one, other = summary.summary(rows)
    assert one["shade_ms"] == 2.0 and one["flip"] == pytest.approx(0.3) and one["iterations_max"] == 9
    assert (one["flip_min"], one["flip_max"]) == (0.1, 0.6)
    assert one["temporal_diff"] == 0.5 and one["jitter_px"] is None
    assert (one["frames"], one["frames_ok"], one["frames_in_view"], one["ok_ratio"]) == (4, 3, 3, 0.75)
    assert (one["status"], one["reason"], one["nonfinite_px"]) == ("invalid", "NaN", 7)
    assert (other["status"], other["reason"], other["flip"], other["frames_ok"]) == ("refused", "no proxy", None, 0)


def test_what_a_row_does_not_say_is_empty_in_the_summary():
    (one,) = summary.summary([{name: value for name, value in record(flip=0.5).items() if value is not None}])
    assert (one["reason"], one["flip"], one["rmse"]) == (None, 0.5, None)


def test_summary_and_samples_are_files_of_the_run(tmp_path):
    results.write_results(tmp_path, [record(shade_ms=3.0)])
    header, row = (tmp_path / "summary.csv").read_text().splitlines()
    assert header.split(",") == list(results.SUMMARY_KINDS)
    assert dict(zip(header.split(","), row.split(","), strict=True))["shade_ms"] == "3.0"
    sample = dict(scene="s", detail="", frame=0, method="m", params="a=1", clock="shade", round=2, ms=0.1)
    results.write_samples(tmp_path, [sample])
    assert results.read_samples(tmp_path) == [sample]
    assert results.read_samples(tmp_path / "nowhere") == []


def test_image_names_are_safe_and_differ_where_the_pictures_do():
    cases = [
        ("kitchen", "lean", 3, "reference"),
        ("kitchen", "lean", 3, "image", "m", ""),
        ("kitchen", "lean", 3, "error", "m", ""),
        ("kitchen", "lean", 3, "image", "m", "steps=8"),
        ("kitchen", "lean", 3, "image", "m", "steps=16"),
        ("kitchen", "lean", 4, "image", "m", "steps=16"),
        ("kitchen[bowl=torus]", "lean", 3, "reference"),
        ("kitchen(bowl=torus)", "lean", 3, "reference"),
        ("../../etc", "", 3, "reference"),
        ("küche/бол", "paper", 3, "reference"),
    ]
    names = [naming.image_name(*case) for case in cases]
    assert len(set(names)) == len(names)
    assert all(re.fullmatch(r"[A-Za-z0-9_-]+\.png", name) for name in names)
    assert names[0] == "kitchen-lean-0003-reference.png"
    assert re.fullmatch(r"kitchen-lean-0003-image-m-[0-9a-f]{8}\.png", names[3])


@pytest.mark.parametrize("bad", [("s", "", 0, "flip"), ("s", "", 0, "image"), ("s", "", 0, "reference", "m")])
def test_image_names_of_no_known_kind_are_refused(bad):
    with pytest.raises(ValueError, match="accepted"):
        naming.image_name(*bad)


def test_the_environment_says_where_a_run_came_from_and_hashes_what_times_depend_on(tmp_path):
    here = origin.environment("llvm_ad_rgb")
    assert here["packages"]["numpy"] == np.__version__ and here["cores"] >= 1 and here["variant"] == "llvm_ad_rgb"
    same = here | {"time": "later", "commit": "other", "dirty": None}
    assert origin.environment_hash(same) == origin.environment_hash(here)
    for change in ({"cpu": "another"}, {"variant": "cuda_ad_rgb"}, {"packages": here["packages"] | {"drjit": "0"}}):
        assert origin.environment_hash(here | change) != origin.environment_hash(here)
    origin.write_environment(tmp_path, here)
    assert origin.read_environment(tmp_path) == here
    (tmp_path / "environment.json").write_text("[1")
    with pytest.raises(ValueError, match=r"environment\.json: not JSON"):
        origin.read_environment(tmp_path)
