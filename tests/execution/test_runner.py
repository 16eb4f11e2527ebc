"""Runs: rows and their order, crashes, timeouts, refusals, and runs that are killed and taken up again."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import mitsuba as mi  # noqa: F401  (so that the variant is set)
import pytest
from support import study
from support.damage import damaged
from support.ear import Ear

from benchharness import processes
from benchharness.execution import attempt, runner
from benchharness.study import config
from benchharness.tables import columns, origin, results

pytestmark = pytest.mark.usefixtures("plugins_here")


@pytest.fixture(autouse=True)
def tables_only(monkeypatch):
    """The report is somebody else's; `_write` is watched for being called with what the tables say."""
    from benchharness import report

    monkeypatch.setattr(report, "write", lambda folder: folder / "report.html", raising=False)


def run(path: Path, out: Path, bench: str = "support.study:Bench", **options):
    ear = Ear()
    code, folder = runner.run(config.load(path), out, ear, bench=bench, **options)
    assert folder == out
    return code, results.read_results(out), ear


def told(rows):
    """What of the rows has to be the same however the run went."""
    return [{k: v for k, v in row.items() if k != "run"} for row in rows]


def test_a_run_has_a_row_per_frame_and_entry_in_the_order_of_the_config(tmp_path):
    path = study.write(tmp_path, '["b", "a"]', run="images = [2]")
    code, rows, ear = run(path, tmp_path / "out")
    assert code == 0
    order = [(row["frame"], row["params"]) for row in rows]
    assert order == [(f, f"behaviour={b}; size=1") for f in (0, 2, 4) for b in ("b", "a")]
    first = rows[0]
    assert (first["run"], first["config"], first["scene"], first["detail"]) == ("out", "study", "place", "lean")
    assert (first["method"], first["status"], first["variant"]) == ("actor", "ok", "llvm_ad_rgb")
    assert (first["vertices"], first["triangles"], first["reflectors"]) == (8, 8, 1)
    assert (first["reference_lighting"], len({row["config_hash"] for row in rows})) == ("baked", 1)
    assert all(first[name] for name in ("config_hash", "method_hash", "scene_hash", "environment"))
    assert [p.name for p in (tmp_path / "out" / "images").iterdir()] == ["2.png"]
    assert ear.frames == [3, 0, 2, 4]
    samples = results.read_samples(tmp_path / "out")
    assert len(samples) == 3 * (1 + 2)
    assert {(s["method"] or "", s["clock"]) for s in samples} == {("", "gbuffer"), ("actor", "shade")}
    assert (tmp_path / "out" / "summary.csv").is_file()
    assert (tmp_path / "out" / "environment.json").is_file()


@pytest.mark.exhaustive
def test_whatever_one_method_does_the_others_complete_and_every_row_says_why(tmp_path):
    behaviours = '["first", "aborts 2", "raises 2", "leaves 4", "refuses", "chokes", "sleeps 4", "last"]'
    path = study.write(tmp_path, behaviours, run="timeout_s = 15.0")
    code, rows, ear = run(path, tmp_path / "out")
    assert code == 3
    status = {}
    for row in rows:
        status.setdefault(row["params"].removeprefix("behaviour=").removesuffix("; size=1"), []).append(row["status"])
    assert status == {
        "first": ["ok"] * 3,
        "aborts 2": ["ok", "crashed", "crashed"],
        "raises 2": ["ok", "crashed", "crashed"],
        "leaves 4": ["ok", "ok", "crashed"],
        "refuses": ["refused"] * 3,
        "chokes": ["crashed"] * 3,
        "sleeps 4": ["ok", "ok", "timeout"],
        "last": ["ok"] * 3,
    }
    reasons = {row["params"].split(";")[0]: row["reason"] for row in rows if row["status"] != "ok"}
    assert "SIGABRT" in reasons["behaviour=aborts 2"]
    assert "LLVM ERROR: out of luck" in reasons["behaviour=aborts 2"]
    assert reasons["behaviour=raises 2"] == "RuntimeError: no such root"
    assert reasons["behaviour=refuses"] == "there is no room for it"
    assert "KeyError: 'refusing'" in reasons["behaviour=chokes"]
    assert "frame 4 took more than 15 s" in reasons["behaviour=sleeps 4"]
    assert any(note.startswith("crashed: actor behaviour=aborts 2") for note in ear.notes)
    # Nothing is left to do, nothing is tried again, and the answer is the same.
    again, same, _ = run(path, tmp_path / "out", resume=True)
    assert (again, same) == (3, rows)
    # Without its last frame, what crashed in an earlier one stays out: "aborts 2" and "raises 2" would do frame 4 well.
    journal = tmp_path / "out" / "journal.jsonl"
    lines = journal.read_bytes().splitlines(keepends=True)
    assert json.loads(lines[-1])["frame"] == 4
    journal.write_bytes(b"".join(lines[:-1]))
    again, same, _ = run(path, tmp_path / "out", resume=True)
    assert (again, told(same)) == (3, told(rows))


REFUSALS = """
        if self.behaviour == "counts": return 7
        if self.behaviour == "talks": return "no " * 500_000
        if self.behaviour == "quits": raise SystemExit(0)
        return None"""


def test_what_refuses_that_is_no_sentence_is_that_methods_crash(tmp_path, monkeypatch):
    monkeypatch.setattr(study, "METHOD", study.METHOD.replace("\n        return None\n", REFUSALS + "\n", 1))
    path = study.write(tmp_path, '["counts", "talks", "quits", "last"]')
    code, rows, _ = run(path, tmp_path / "out")
    found = {row["params"].split("=")[1].split(";")[0]: (row["status"], row["reason"] or "") for row in rows}
    assert code == 3
    assert found["counts"] == ("crashed", "refuses: TypeError: refuses returns int; accepted: a sentence, or None")
    assert found["quits"] == ("crashed", "refuses: SystemExit: 0")
    assert found["talks"][0] == "refused" and len(found["talks"][1]) < 1100
    assert found["last"] == ("ok", "")


UNMADE = """
    def __post_init__(self):
        home = getattr(sys.modules["__main__"].__spec__, "name", "")
        if self.behaviour == "unmade" and "worker" in home: raise OSError("no such table")

    def refuses(self, scene):"""


def test_a_method_that_a_worker_cannot_make_costs_its_own_rows_and_no_worker(tmp_path, monkeypatch):
    monkeypatch.setattr(study, "METHOD", study.METHOD.replace("\n    def refuses(self, scene):", UNMADE, 1))
    code, rows, _ = run(study.write(tmp_path, '["first", "unmade", "last"]'), tmp_path / "out")
    found = {row["params"].split("=")[1].split(";")[0]: (row["status"], row["reason"] or "") for row in rows}
    assert code == 3
    assert found["unmade"] == ("crashed", "it cannot be made: OSError: no such table")
    assert found["first"] == found["last"] == ("ok", "")
    assert (tmp_path / "out" / "worker-0.log").read_text().count("OSError: no such table") == 1


@pytest.mark.exhaustive
def test_a_scene_that_cannot_be_prepared_is_rows_too_which_are_tried_again(tmp_path):
    path = study.write(tmp_path, '["a"]')
    code, rows, _ = run(path, tmp_path / "out", "support.study:Failing")
    assert code == 3
    assert [row["status"] for row in rows] == ["crashed"] * 3
    assert "RuntimeError: no light outside any method" in rows[0]["reason"]
    code, rows, _ = run(path, tmp_path / "out", resume=True)
    assert (code, [row["status"] for row in rows]) == (0, ["ok"] * 3)


def test_a_run_in_which_nothing_ran_is_incomplete(tmp_path):
    code, rows, _ = run(study.write(tmp_path, '["refuses"]'), tmp_path / "out")
    assert (code, {row["status"] for row in rows}) == (3, {"refused"})


RUN = """
import sys
from pathlib import Path
from benchharness.study import config
from benchharness import report
from benchharness.execution import runner
from support.ear import Ear
report.write = lambda folder: folder
runner.run(config.load(Path(sys.argv[1])), Path(sys.argv[2]), Ear(), bench="support.study:Bench")
"""


@pytest.mark.exhaustive
def test_a_killed_run_takes_its_worker_along_and_resumes_to_the_rows_of_an_undisturbed_one(tmp_path, request):
    path, out = study.write(tmp_path, '["a", "sleeps 4"]'), tmp_path / "out"
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen([sys.executable, "-c", RUN, str(path), str(out)], env=env)
    request.addfinalizer(process.kill)
    journal = out / "journal.jsonl"
    deadline = time.monotonic() + 60
    while not (journal.exists() and len(journal.read_bytes().splitlines()) == 2):
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.05)
    worker = int(subprocess.check_output(["pgrep", "-P", str(process.pid)]))
    process.send_signal(signal.SIGKILL)
    process.wait()
    while Path(f"/proc/{worker}").exists() and "\nState:\tZ" not in Path(f"/proc/{worker}/status").read_text():
        assert time.monotonic() < deadline, "the worker outlived its parent"
        time.sleep(0.05)
    with open(journal, "ab") as stream:  # what a kill in the middle of a write leaves
        stream.write(b'{"job": 0, "frame": 4, "rec')

    # The method is mended by letting it sleep no longer; the hash of its file is what it was in `undisturbed`.
    plan = json.loads((out / "run.json").read_text())
    (tmp_path / "actor.py").write_text(study.METHOD.replace("time.sleep(600)", "time.sleep(0)"))
    with pytest.raises(runner.folder.Incomparable, match="methods: 'actor behaviour=a; size=1' changed"):
        run(path, out, resume=True)
    mended = config.load(path)
    (out / "run.json").write_text(json.dumps({**plan, "methods": mended.method_hashes}))
    lines = [json.loads(line) for line in journal.read_bytes().splitlines()[:-1]]
    for line in lines:
        del line["sum"]
        for row in line["records"]:
            row["method_hash"] = mended.method_hashes[f"actor {row['params']}"]
    journal.write_text("".join(json.dumps(line) + "\n" for line in lines) + '{"job": 0, "frame": 4, "rec')

    code, rows, ear = run(path, out, resume=True)
    assert (code, ear.frames) == (0, [1, 4])
    _, undisturbed, _ = run(path, tmp_path / "whole")
    assert told(rows) == told(undisturbed)


def test_a_folder_that_is_in_use_or_cannot_be_written_is_refused_before_any_work(tmp_path):
    path = study.write(tmp_path, '["a"]')
    study_ = config.load(path)
    (tmp_path / "foreign").mkdir()
    (tmp_path / "foreign" / "thesis.tex").touch()
    (tmp_path / "file").touch()
    for name, reason in [
        ("foreign", "is not empty and holds no run"),
        ("file", "cannot be written"),
        ("file/below", "cannot be written"),
    ]:
        with pytest.raises(ValueError, match=reason):
            runner.run(study_, tmp_path / name, Ear(), bench="support.study:Bench")
    (tmp_path / "used").mkdir()
    (tmp_path / "used" / "run.json").write_text("{}")
    with pytest.raises(ValueError, match="holds a run; accepted: an empty folder, or --resume"):
        runner.run(study_, tmp_path / "used", Ear(), bench="support.study:Bench")
    with pytest.raises(ValueError, match="holds no run"):
        runner.run(study_, tmp_path / "foreign", Ear(), resume=True, bench="support.study:Bench")
    with pytest.raises(runner.folder.Incomparable, match="config_hash"):
        runner.run(study_, tmp_path / "used", Ear(), resume=True, bench="support.study:Bench")
    assert not (tmp_path / "benches").exists()


@pytest.mark.exhaustive
def test_without_a_folder_the_newest_run_of_the_config_is_resumed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    study_ = config.load(study.write(tmp_path, '["refuses"]'))
    with pytest.raises(ValueError, match="there is no run of study in"):
        runner.run(study_, None, Ear(), resume=True, bench="support.study:Bench")
    _, folder = runner.run(study_, None, Ear(), bench="support.study:Bench")
    older = folder.parent / "study-20200101-000000"
    older.mkdir()
    (older / "run.json").write_text("{}")
    assert runner.run(study_, None, Ear(), resume=True, bench="support.study:Bench")[1] == folder


def test_a_cut_line_of_the_journal_is_dropped_and_a_damaged_one_refused(tmp_path):
    path = tmp_path / "journal.jsonl"
    path.write_text('{"job": 0}\n{"job": 1}\n{"jo')
    journal = runner.Journal(path)
    journal.append({"job": 2})
    assert journal.lines() == [{"job": 0}, {"job": 1}, {"job": 2}]
    path.write_text('{"job": 0}\n{"jo\n{"job": 2}\n')
    with pytest.raises(ValueError, match="line 2 is damaged"):
        runner.Journal(path).lines()


def test_what_was_not_measured_is_empty(tmp_path):
    _, rows, _ = run(study.write(tmp_path, '["a", "refuses", "chokes", "aborts 0"]'), tmp_path / "out")
    names = [column.name for column in columns.RESULTS if column.over not in ("", "sum")]
    names += ["nonfinite_px", "reference_spp", "counters"]
    for row in rows:
        if row["status"] != "ok":
            assert {name: row[name] for name in names if row[name] is not None} == {}, row["status"]


def test_a_folder_is_not_filled_by_two_at_once(tmp_path):
    """Somebody else takes the run up while it is under way."""
    path = study.write(tmp_path, '["a"]')
    tried = []

    class Meddler(Ear):
        def frame(self, frame, records):
            with pytest.raises(ValueError, match="is being filled by another process"):
                runner.run(config.load(path), tmp_path / "out", Ear(), resume=True, bench="support.study:Bench")
            tried.append(frame)

    runner.run(config.load(path), tmp_path / "out", Meddler(), bench="support.study:Bench")
    assert tried == [0, 2, 4]
    assert len(results.read_results(tmp_path / "out")) == 3


@pytest.mark.exhaustive
def test_pictures_that_are_gone_or_changed_are_made_again_with_their_frame_and_no_other(tmp_path):
    path, out = study.write(tmp_path, '["a", "aborts 4"]'), tmp_path / "out"
    _, rows, _ = run(path, out)
    (out / "images" / "0.png").unlink()
    (out / "images" / "2.png").write_text("half of a picture")
    (out / "images" / "stranger.png").touch()
    code, again, ear = run(path, out, resume=True)
    assert (code, told(again)) == (3, told(rows))
    assert ear.frames == [2, 0, 2, 0]
    assert [note for note in ear.notes if "0.png" in note] == [
        "place, frame 0: done again, since pictures are gone or changed: 0.png"
    ]
    assert sorted(p.name for p in (out / "images").iterdir()) == ["0.png", "2.png", "4.png", "stranger.png"]
    _, same, ear = run(path, out, resume=True)
    assert (told(same), ear.frames) == (told(rows), [0])


def test_a_run_in_which_every_picture_is_nan_is_incomplete(tmp_path):
    code, rows, _ = run(study.write(tmp_path, '["a"]'), tmp_path / "out", "support.study:Nothing")
    assert (code, {row["status"] for row in rows}) == (3, {"invalid"})


@pytest.mark.parametrize(
    ("statuses", "asked", "code"),
    [
        (["ok", "ok"], 2, 0),
        (["ok", "refused"], 2, 0),
        (["refused"], 1, 3),
        (["ok", "invalid"], 2, 3),
        (["ok", "crashed"], 2, 3),
        (["ok", "timeout"], 2, 3),
        (["ok"], 2, 3),
        ([], 0, 3),
    ],
)
def test_zero_says_that_every_row_is_there_and_has_an_answer_or_a_refusal(statuses, asked, code):
    assert runner.exit_code(statuses, asked) == code


def test_what_takes_too_long_is_not_begun_unasked_and_leaves_no_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(runner.estimate, "TOO_LONG_S", 1.0)
    path = study.write(tmp_path, '["a", "refuses"]')
    with pytest.raises(ValueError, match=r"6 rows \(1 scenes, 3 frames, 2 methods.*\) take about .* s; accepted: .*--yes"):
        run(path, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    code, _, ear = run(path, tmp_path / "out", yes=True)
    assert (code, ear.notes[0].startswith("6 rows (1 scenes, 3 frames, 2 methods with parameters): about ")) == (0, True)
    _, _, ear = run(path, tmp_path / "out", resume=True)
    assert ear.notes[0].startswith("0 rows")


@pytest.mark.parametrize(
    "line",
    [
        {},
        {"job": 0},
        {"job": 1, "frame": 0, "records": [], "samples": []},
        {"job": -1, "out": "actor behaviour=a; size=1", "status": "crashed", "reason": "x"},
        {"job": "0", "out": "actor behaviour=a; size=1", "status": "crashed", "reason": "x"},
        {"job": 0, "out": "nobody", "status": "crashed", "reason": "x"},
        {"job": 0, "out": "actor behaviour=a; size=1", "status": "fine", "reason": "x"},
        {"job": 0, "frame": 1, "records": [], "samples": []},
        {"job": 0, "frame": 0, "records": [], "samples": []},
        {"job": 0, "frame": 0, "records": None, "samples": []},
        {"job": 0, "frame": 0, "records": [{"method": "actor", "params": "behaviour=a; size=1", "status": 3}], "samples": []},
        [],
    ],
)
def test_a_line_that_no_run_of_this_config_writes_is_damage(tmp_path, line):
    path, out = study.write(tmp_path, '["a"]'), tmp_path / "out"
    loaded = config.load(path)
    environment = origin.environment_hash(origin.environment(loaded.run.variant))
    with runner.folder.opened("study", out, runner._plan(loaded, environment), resume=False):
        pass
    (out / "journal.jsonl").write_text(json.dumps(line) + "\n")
    with pytest.raises(ValueError, match=r"journal.jsonl: line 1 is damaged \(.*\); accepted: a new run"):
        runner.run(loaded, out, Ear(), resume=True, bench="support.study:Bench")


@pytest.mark.exhaustive
def test_a_damaged_journal_is_refused_or_ends_in_the_rows_of_an_undisturbed_run(tmp_path):
    """16 journals, from one seed."""
    path, out, rng = study.write(tmp_path, '["a", "raises 2"]'), tmp_path / "out", random.Random(11)
    _, rows, _ = run(path, out)
    whole, ends = (out / "journal.jsonl").read_bytes(), Counter()
    for _ in range(16):
        (out / "journal.jsonl").write_bytes(damaged(whole, rng))
        try:
            code, again, _ = run(path, out, resume=True)
        except ValueError as error:
            assert "is damaged" in str(error)
            ends["refused"] += 1
        else:
            assert (code, told(again)) == (3, told(rows))
            ends["same"] += 1
    assert ends["refused"] and ends["same"]


SAYS = """
import json, sys, time
def say(**event): print(json.dumps(event), flush=True)
say(event="ready"); say(event="start", frame=0); say(event="waits", text="another run is timing")
time.sleep(2.5)
say(event="start", frame=0)
time.sleep(60 * ("hangs" in sys.argv))
say(event="frame", frame=0, records=[{"entry": "a"}], samples=[], pictures={})
say(event="done")
"""


@pytest.mark.parametrize(
    ("word", "failed", "events"), [("goes on", None, ["waits", "frame"]), ("hangs", "frame 0 took more than 2 s", ["waits"])]
)
def test_waiting_for_the_machine_is_not_a_frames_time(word, failed, events, tmp_path, monkeypatch):
    (tmp_path / "says.py").write_text(SAYS)
    monkeypatch.syspath_prepend(tmp_path)
    child = processes.Child("says", word, log=tmp_path / "log")
    try:
        said = attempt.heard(child, 2.0, {"a"}, {0}, attempt.Ending())
        heard = []
        while True:
            try:
                heard.append(next(said)["event"])
            except StopIteration as end:
                assert (heard, end.value) == (events, failed)
                break
    finally:
        child.end()


@pytest.mark.exhaustive
def test_the_machine_is_held_while_a_frame_is_timed_and_not_while_its_reference_is_made(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    run(study.write(tmp_path, '["a"]'), tmp_path / "out", "support.study:Watchful")
    assert (tmp_path / "out" / "held").read_text().splitlines() == ["begins free", *3 * ["prepares free", "times held"]]
