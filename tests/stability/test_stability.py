"""The stability suite: verdicts, the regimes that come with it, and what a run leaves behind."""

from __future__ import annotations

import csv
import os
import re
import signal
import subprocess
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchharness import stability
from benchharness.execution import folder
from benchharness.regime import miss
from benchharness.report import matrix
from benchharness.stability import atlas, children, motion, perturbation, plan
from benchharness.study.methods import Entry
from benchharness.tables import naming
from scenes import stress

REGIMES = atlas.regimes()
OK = {
    "status": "ok",
    "flip": 0.01,
    "coverage": 1.0,
    "doubted": 0.0,
    "converged_ratio": None,
    "wrong_ratio": None,
    "symptom": None,
}


@pytest.mark.parametrize(
    ("record", "expected"),
    [
        ({}, "holds"),
        ({"flip": 0.3}, "fails"),
        ({"flip": 0.3, "coverage": 0.9, "trusted": 0.05}, "degrades"),
        ({"flip": 0.3, "coverage": 0.9, "trusted": 0.2}, "fails"),
        ({"flip": 0.3, "doubted": 0.1, "trusted": 0.05}, "degrades"),
        ({"flip": 0.3, "doubted": 0.1, "trusted": 0.2}, "fails"),
        ({"flip": 0.3, "doubted": 0.0, "trusted": 0.05}, "fails"),
        ({"flip": 0.3, "converged_ratio": 0.9}, "degrades"),
        ({"flip": 0.3, "coverage": 1.0, "converged_ratio": 1.0}, "fails"),
        ({"flip": 0.3, "symptom": 0.05}, "holds"),
        ({"symptom": 0.3}, "fails"),
        ({"wrong_ratio": 0.01, "coverage": 0.5, "trusted": 0.0}, "fails"),
        ({"flip": None}, "holds"),
        ({"status": "refused", "reason": "no"}, "refuses"),
        ({"status": "crashed", "reason": "it ended"}, "fails"),
        ({"status": "invalid", "reason": "3 pixels are NaN"}, "fails"),
    ],
)
def test_verdicts(record, expected):
    assert atlas.verdict(OK | record, 0.1)[0] == expected


def test_masks_miss_each_other_by_what_they_do_not_share():
    one, other = np.zeros((2, 4), bool), np.zeros((2, 4), bool)
    assert miss(one, other) is None
    one[0], other[0, :2], other[1, :2] = True, True, True
    assert miss(one, other) == pytest.approx(1 - 2 / 6) and miss(one, one) == 0


@pytest.mark.parametrize("name", REGIMES)
def test_every_regime_has_scenes_that_need_no_light_and_say_what_they_ask(name):
    regime, build = REGIMES[name]
    assert regime.name == name and regime.title and regime.severity and regime.symptom and regime.why and regime.bound > 0
    assert len(set(regime.severities)) == len(regime.severities) >= 2
    for severity in (regime.severities[0], regime.severities[-1]):
        scene = build(severity)
        assert scene.reflectors and all(o.mesh.radiance is not None for o in scene.objects)
        assert scene.vertices < 120_000


CATALOGUE = {"F": 35, "I": 28, "P": 11}
"""How many entries the catalogue of failures has, by letter."""


def test_every_entry_of_the_catalogue_is_shown_by_regimes_or_tested_elsewhere_or_out_of_reach():
    table = dict(re.findall(r"^ +([FIP]-\d\d) (none: \S.*|[\w/.]+(?:, \w+)*)", stress.__doc__ or "", re.MULTILINE))
    assert list(table) == [f"{letter}-{n:02d}" for letter, count in CATALOGUE.items() for n in range(1, count + 1)]
    claimed = {entry: [] for entry in table}
    for name, (regime, _) in REGIMES.items():
        for entry in regime.entry.split(", "):
            claimed[entry].append(name)
    for entry, where in table.items():
        if where.startswith("tests/"):
            assert (Path(__file__).parents[2] / where).is_file() and not claimed[entry], entry
        else:
            assert ([] if where.startswith("none: ") else where.split(", ")) == claimed[entry], entry


def test_a_run_has_a_row_for_every_severity_and_method_and_a_page(tmp_path):
    wanted = stability.Wanted(only=["environment_map", "ray_traced"], regimes=["contact"], severity=0.0)
    told = []
    outcome = stability.run(tmp_path / "run", wanted=wanted, tell=told.append)
    page = matrix.write(outcome.folder)
    assert told[0].startswith("2 rows (2 of atlas): about ") and told[1:] == ["atlas: contact: 1 holds, 1 degrades"]
    with open(tmp_path / "run" / "stability.csv", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert list(rows[0]) == atlas.COLUMNS
    found = {row["method"]: row for row in rows}
    assert set(found) == {"environment_map", "ray_traced"}
    assert found["ray_traced"]["verdict"] == "holds" and float(found["ray_traced"]["symptom"]) < 0.05
    assert found["environment_map"]["verdict"] == "degrades" and float(found["environment_map"]["symptom"]) > 0.9
    assert float(found["environment_map"]["trusted"]) < 0.2 and 0 < float(found["environment_map"]["doubted"]) < 0.2
    assert (outcome.code, outcome.silent) == (0, 0)
    assert found["environment_map"]["command"] == "benchharness stability --regime contact --severity 0 --only environment_map"
    assert all(row["nonfinite_px"] == "0" for row in rows)
    text = page.read_text()
    assert page.name == "stability.html" and "environment_map" in text and "data:image/png;base64" in text
    assert (tmp_path / "run" / "images" / naming.picture_name("contact", 0.0, "ray_traced")).is_file()


@pytest.mark.exhaustive
def test_bad_input_is_refused_with_what_would_be_accepted(tmp_path):
    for options, message in [
        ({"only": ["ray_trced"]}, "did you mean 'ray_traced'"),
        ({"regimes": ["contct"]}, "did you mean 'contact'"),
        ({"regimes": ["contact"], "severity": 7.0}, "accepted for contact: 2, 1"),
        ({"studies": ["atlsa"]}, "did you mean 'atlas'"),
        ({"scenes": ["kitchn"]}, "did you mean 'kitchen'"),
    ]:
        with pytest.raises(ValueError, match=message):
            stability.run(tmp_path / "bad", wanted=stability.Wanted(**options))
    assert not (tmp_path / "bad").exists()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[atlass]", "did you mean 'atlas'"),
        ("[motion]\nframes = 2", r"\[motion\].frames is 2; accepted"),
        ('[atlas]\nregimes = ["contct"]', "did you mean 'contact'"),
        ("[methods.newton]\nmulti = 0", "multi is 0"),
        ('[motion]\nkinds = ["stedy"]', "kinds is"),
        ("[motion]\nframes = 1_000_000_000", r"\[motion\].frames is 1000000000; accepted: .*at most 100000"),
        ("[motion]\nsize = [100_000, 8]", r"\[motion\].size is"),
        ("[methods.secant_triangle]\ntau = inf", r"\[methods\].secant_triangle.tau is inf; accepted: a finite number"),
        ("[methods.environment_map]\nresolution = 100", "resolution is 100; accepted: a power of two"),
    ],
)
def test_a_wrong_plan_is_refused_before_any_work(plugins_here, tmp_path, text, message):
    (tmp_path / "plan.toml").write_text(text)
    with pytest.raises(ValueError, match=message):
        stability.run(tmp_path / "bad", tmp_path / "plan.toml")
    assert not (tmp_path / "bad").exists()


def test_a_plan_adds_settings_to_what_is_installed(plugins_here, tmp_path):
    (tmp_path / "plan.toml").write_text("[methods.newton]\nmulti = 3\nmax_iter = [20, 60]")
    labels = [plan.label(entry) for entry in plan.load(tmp_path / "plan.toml").entries]
    assert {"newton", "newton max_iter=20; multi=3", "newton multi=3", "ray_traced"} <= set(labels)
    only = plan.load(tmp_path / "plan.toml", only=["newton multi=3", "ray_traced"])
    assert [plan.label(entry) for entry in only.entries] == ["ray_traced", "newton multi=3"]


BROKEN = """
import os, time
from dataclasses import dataclass
from pathlib import Path
from benchharness.api import Method

@dataclass(frozen=True)
class Broken(Method):
    paper = "none"

    def prepare(self, scene):
        {what}

    def shade(self, state, frame):
        raise NotImplementedError
"""


@pytest.mark.parametrize(
    ("what", "timeout_s", "status", "reason"),
    [
        ("os.abort()", 600.0, "crashed", "SIGABRT"),
        pytest.param("time.sleep(600)", 20.0, "timeout", "no answer for 20 s", marks=pytest.mark.exhaustive),
    ],
)
def test_what_ends_or_hangs_a_process_costs_its_own_rows_only(plugins_here, tmp_path, what, timeout_s, status, reason):
    (tmp_path / "broken.py").write_text(BROKEN.format(what=what))
    entries = plan.load(None, [str(tmp_path / "broken.py")], ["broken", "ray_traced"]).entries
    groups = atlas.units([*entries[::-1]], ["contact"], 1.0)
    done = list(children.run([children.Work("atlas", groups)], tmp_path, timeout_s=timeout_s))
    assert [each.place for each in done] == [("atlas", "contact", 0), ("atlas", "contact", 1)]
    records = {each.unit["entry"]["method"]: each.record for each in done}
    assert records["broken"]["status"] == status and reason in records["broken"]["reason"]
    assert records["ray_traced"]["status"] == "ok"
    assert atlas.row(done[0].unit, done[0].record)["verdict"] == "fails"


ODD = """
from dataclasses import dataclass
from benchharness.api import Method

@dataclass(frozen=True)
class Unmade(Method):
    paper = "none"
    def __post_init__(self): raise OSError("no such table")
    def prepare(self, scene): return None
    def shade(self, state, frame): raise NotImplementedError

@dataclass(frozen=True)
class Counting(Method):
    paper = "none"
    def refuses(self, scene): return 7
    def prepare(self, scene): return None
    def shade(self, state, frame): raise NotImplementedError
"""
SMALL = plan.Motion(
    (f"{Path(__file__).parents[1] / 'support' / 'motion_plugins.py'}:turning",), ("cut",), substeps=1, size=(64, 48)
)


@pytest.mark.parametrize(
    ("study", "units"),
    [
        (atlas, lambda entries: atlas.units(entries, ["contact"], 0.0)),
        (motion, lambda entries: motion.units(entries, SMALL)),
        (perturbation, lambda entries: perturbation.units(entries, ["contact"])),
    ],
)
def test_what_cannot_be_made_or_refuses_without_words_is_that_methods_crash(plugins_here, tmp_path, study, units):
    (tmp_path / "odd.py").write_text(ODD)
    ((_, group),) = units([Entry(name, f"{tmp_path / 'odd.py'}:{name}", {}) for name in ("Unmade", "Counting")]).items()
    records = list(study.work(group[:2], tmp_path))
    assert [(record["status"], record["reason"]) for record in records] == [
        ("crashed", "it cannot be made: OSError: no such table"),
        ("crashed", "refuses: TypeError: refuses returns int; accepted: a sentence, or None"),
    ]


def table(folder):
    with open(folder / "stability.csv", newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.mark.exhaustive
def test_a_crash_is_exit_code_three_and_a_used_folder_is_taken_up_or_refused(plugins_here, tmp_path):
    (tmp_path / "broken.py").write_text(BROKEN.format(what="raise RuntimeError('no such root')"))
    wanted = stability.Wanted([str(tmp_path / "broken.py")], ["broken", "ray_traced"], regimes=["contact"], severity=1.0)
    out, told = tmp_path / "run", []
    assert stability.run(out, wanted=wanted, tell=told.append).code == 3
    rows = table(out)
    assert {row["method"]: row["status"] for row in rows} == {"ray_traced": "ok", "broken": "crashed"}
    with pytest.raises(ValueError, match="holds a run; accepted: an empty folder, or --resume"):
        stability.run(out, wanted=wanted, tell=told.append)
    with pytest.raises(folder.Incomparable, match=r"methods: .*is new or is gone"):
        stability.run(out, wanted=replace(wanted, only=["ray_traced"]), tell=told.append, resume=True)

    # Nothing is left; then a picture is.
    journal = folder.Journal(out / "journal.jsonl")
    assert stability.run(out, wanted=wanted, tell=told.append, resume=True).code == 3
    assert (len(journal.lines()), table(out)) == (2, rows)
    picture = out / "images" / naming.picture_name("contact", 1.0, "ray_traced")
    seen = picture.read_bytes()
    picture.write_bytes(seen[:100])
    assert stability.run(out, wanted=wanted, tell=told.append, resume=True).code == 3
    assert (len(journal.lines()), table(out), picture.read_bytes()) == (3, rows, seen)
    assert f"atlas: contact: a row is made again, since pictures are gone or changed: {picture.name}" in told
    journal.append({"study": "atlas", "group": "contact", "unit": 2, "record": {"status": "ok"}, "pictures": {}})
    with pytest.raises(ValueError, match="line 4 is damaged"):
        stability.run(out, wanted=wanted, tell=told.append, resume=True)


@pytest.fixture
def interruptible():
    """A process that was started in the background may ignore SIGINT."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.exhaustive
def test_an_interrupted_suite_keeps_its_rows_ends_at_once_and_is_taken_up(plugins_here, tmp_path, interruptible):
    flag, out = tmp_path / "flag", tmp_path / "run"
    (tmp_path / "broken.py").write_text(BROKEN.format(what=f"if not Path({str(flag)!r}).exists(): time.sleep(600)"))
    wanted = stability.Wanted([str(tmp_path / "broken.py")], ["broken", "ray_traced"], regimes=["contact"], severity=1.0)
    journal = out / "journal.jsonl"

    def interrupt():
        while not (journal.exists() and journal.read_bytes().endswith(b"\n")):
            time.sleep(0.05)
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=interrupt, daemon=True).start()
    with pytest.raises(KeyboardInterrupt):
        stability.run(out, wanted=wanted, tell=lambda line: None)
    first = journal.read_bytes()
    assert len(first.splitlines()) == 1
    # The method sleeps on in no process, and nothing of it is left.
    assert not subprocess.run(["pgrep", "-P", str(os.getpid())], capture_output=True).stdout
    assert [path.suffix for path in (out / "images").iterdir()] == [".png"]
    flag.touch()
    outcome = stability.run(out, wanted=wanted, tell=lambda line: None, resume=True)
    assert journal.read_bytes().startswith(first)
    assert (outcome.code, [row["method"] for row in table(out)]) == (3, ["ray_traced", "broken"])
