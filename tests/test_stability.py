"""The stability suite: verdicts, the regimes that come with it, and what a run leaves behind."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
import pytest

from benchharness import results, stability
from benchharness.regime import miss
from benchharness.stability import atlas
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


CATALOGUE = {"F": 35, "I": 27, "P": 10}
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
            assert (Path(__file__).parent.parent / where).is_file() and not claimed[entry], entry
        else:
            assert ([] if where.startswith("none: ") else where.split(", ")) == claimed[entry], entry


def test_a_run_has_a_row_for_every_severity_and_method_and_a_page(tmp_path):
    silent, page = stability.run(
        tmp_path / "run", only=["environment_map", "ray_traced"], regime=["contact"], severity=0.0, tell=lambda line: None
    )
    with open(tmp_path / "run" / "stability.csv", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert list(rows[0]) == atlas.COLUMNS
    found = {row["method"]: row for row in rows}
    assert set(found) == {"environment_map", "ray_traced"}
    assert found["ray_traced"]["verdict"] == "holds" and float(found["ray_traced"]["symptom"]) < 0.05
    assert found["environment_map"]["verdict"] == "degrades" and float(found["environment_map"]["symptom"]) > 0.9
    assert float(found["environment_map"]["trusted"]) < 0.2 and 0 < float(found["environment_map"]["doubted"]) < 0.2
    assert silent == 0
    assert found["environment_map"]["command"] == "benchharness stability --regime contact --severity 0 --only environment_map"
    assert all(row["nonfinite_px"] == "0" for row in rows)
    text = page.read_text()
    assert page.name == "stability.html" and "environment_map" in text and "data:image/png;base64" in text
    assert (tmp_path / "run" / "images" / results.picture_name("contact", 0.0, "ray_traced")).is_file()


def test_bad_input_is_refused_with_what_would_be_accepted(tmp_path):
    for options, message in [
        ({"only": ["ray_trced"]}, "did you mean 'ray_traced'"),
        ({"regime": ["contct"]}, "did you mean 'contact'"),
        ({"regime": ["contact"], "severity": 7.0}, "accepted for contact: 2, 1"),
    ]:
        with pytest.raises(ValueError, match=message):
            stability.run(tmp_path / "bad", **options)
    assert not (tmp_path / "bad").exists()
