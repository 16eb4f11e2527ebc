"""A verdict for machines: what it says is what the text says, and every reader of its format can read it."""

from __future__ import annotations

import json
import math
from pathlib import Path
from xml.etree import ElementTree

import pytest

from benchharness.tables import formats, times
from benchharness.tables.verdict import Finding, Verdict

GROUP = ("quick", "kitchen", "lean", "secant", "steps=8")
FINE = ("quick", "kitchen", "lean", "newton", "")
WORSE = Finding("regression", "flip", "0.05 -> 0.09 (+80 %)", *GROUP, frame=2, size=0.04)


def verdict(*findings: Finding, paces: tuple[times.Pace, ...] = ()) -> Verdict:
    found = times.Times(paces, (10, 10), None, {"shade": 1.02})
    command = {"config": "/far/quick.toml", "plugins": ["/far/mine.py"]}
    return Verdict(Path("base"), Path("new"), (10, 10), (GROUP, FINE), 6, findings, found, command)


PACE = times.Pace(*GROUP[1:], "shade", "slow", 1.1, 1.05, 1.15, 1e-6)
REPRODUCE = "benchharness run /far/quick.toml --plugin /far/mine.py --only secant"


def test_json_holds_the_verdict_its_findings_and_its_paces():
    document = json.loads(formats.FORMATS["json"](verdict(WORSE, paces=(PACE,))))
    assert (document["verdict"], document["exit_code"], document["rows"]) == ("a regression was found", 1, 6)
    (finding,) = document["findings"]
    assert finding["kind"] == "regression" and finding["frame"] == 2 and finding["reproduce"] == REPRODUCE
    assert document["times"]["paces"][0]["verdict"] == "slow" and document["times"]["drift"] == {"shade": 1.02}


def test_json_has_no_number_that_is_none():
    def refuse(text):
        raise AssertionError(text)

    infinite = Finding("regression", "flip", "0.05 -> nan", *GROUP, size=math.inf)
    text = formats.FORMATS["json"](verdict(infinite))
    assert json.loads(text, parse_constant=refuse)["findings"][0]["size"] is None


def test_junit_has_a_case_per_row_and_fails_what_regressed():
    lost = Finding("incomplete", "missing", "is gone", *FINE)
    note = Finding("note", "counter x", "is counted now", *FINE)
    suite = ElementTree.fromstring(formats.FORMATS["junit"](verdict(WORSE, lost, note)))
    assert (suite.get("tests"), suite.get("failures"), suite.get("errors")) == ("2", "1", "1")
    worse, other = suite.findall("testcase")
    assert worse.get("name") == "kitchen lean · secant · steps=8" and worse.get("classname") == "quick"
    failure = worse.find("failure")
    assert failure is not None and "0.05 -> 0.09" in failure.get("message", "") and REPRODUCE in (failure.text or "")
    assert [child.tag for child in other] == ["error", "system-out"]


def test_junit_of_a_fine_verdict_has_cases_and_no_failure():
    suite = ElementTree.fromstring(formats.FORMATS["junit"](verdict()))
    assert (suite.get("tests"), suite.get("failures"), suite.get("errors")) == ("2", "0", "0")


def test_junit_survives_characters_that_xml_cannot_hold():
    odd = Finding("regression", "status", "was ok, is refused: \x00\x1b[31m \ud800 <&>", *GROUP)
    suite = ElementTree.fromstring(formats.FORMATS["junit"](verdict(odd)).encode())
    assert "<&>" in (suite.findtext("testcase/failure") or "")


def test_markdown_is_one_table_whatever_a_reason_holds():
    odd = Finding("regression", "status", "was ok, is refused: a | b\n| `c` <script>", *GROUP)
    lines = formats.FORMATS["markdown"](verdict(odd, paces=(PACE,))).splitlines()
    assert lines[0] == "### benchharness: a regression was found"
    (row,) = [line for line in lines if line.startswith("| regression")]
    assert row.replace("\\|", "").count("|") == 5 and "\\<script\\>" in row
    assert f"{REPRODUCE}  # to reproduce" in lines
    assert any("10 runs against 10" in line and "1 slow" in line for line in lines)


@pytest.mark.parametrize("form", formats.FORMATS)
def test_every_format_says_what_the_exit_code_says(form):
    assert "a regression was found" in formats.FORMATS[form](verdict(WORSE)) or form == "junit"
    assert formats.FORMATS[form](verdict()) != formats.FORMATS[form](verdict(WORSE))
