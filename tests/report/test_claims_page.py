"""The page of claims, the table beside it, and what the command says and ends with."""

from __future__ import annotations

import csv
import re
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from benchharness import cli
from benchharness.report import claims as page
from benchharness.tables import claims, columns

ROOT = Path(__file__).resolve().parents[2]


def call(*arguments: object):
    return CliRunner().invoke(cli.app, ["claims", *map(str, arguments)])


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    out = tmp_path_factory.mktemp("claims") / "page.html"
    return out, call("--out", out, "--tables", ROOT / "results")


def test_the_command_counts_verdicts_and_names_the_page(made):
    out, done = made
    assert done.exit_code == 0, done.output
    lines = done.stdout.splitlines()
    assert lines[-1] == str(out)
    total = {verdict: int(count) for count, verdict in re.findall(r"(\d+) ([a-z ]+)", lines[-2])}
    assert lines[-2].startswith("all: ") and set(total) == set(claims.VERDICTS)
    assert sum(total.values()) == len(claims.load())


def test_every_claim_is_a_row_of_the_page_and_of_the_table(made):
    out, _ = made
    text = out.read_text()
    with (out.parent / claims.TABLE).open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == [column.name for column in columns.CLAIMS]
    assert [row["id"] for row in rows] == [claim.id for claim in claims.load()]
    assert all(f'<tr id="{row["id"]}">' in text for row in rows)
    assert "says otherwise" not in text and "Verdicts that a table contradicts" not in text
    assert "http" not in text and len(set(re.findall(r'id="([^"]+)"', text))) == len(re.findall(r'id="', text))


def test_what_a_table_no_longer_says_is_flagged_and_ends_in_one(tmp_path):
    """The environment map's error is set to that of what is exact."""
    shutil.copytree(ROOT / "results", tmp_path / "results", ignore=shutil.ignore_patterns("figures", "runs"))
    table = tmp_path / "results" / "baselines" / "main.csv"
    with table.open(newline="") as file:
        rows = list(csv.DictReader(file))
    changed = [{**row, "flip": "0.0001" if row["method"] == "environment_map" else row["flip"]} for row in rows]
    with table.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(changed)
    out = tmp_path / "page.html"
    done = call("--out", out, "--tables", tmp_path / "results")
    assert done.exit_code == 1
    flagged = re.findall(
        r"^contradicted: (\S+) is called reproduced, but results/baselines/main.csv has", done.stdout, re.MULTILINE
    )
    assert {"roger-environment-map", "estalella-environment-near", "planar-environment-far"} <= set(flagged)
    text = out.read_text()
    assert (
        text.count("the table says otherwise") == len(flagged) == text[text.index('class="wrong"') :].count("of what should be")
    )


def test_tables_that_are_not_there_are_the_users_mistake(tmp_path):
    done = call("--out", tmp_path / "page.html", "--tables", tmp_path)
    assert done.exit_code == 2 and "main.csv: No such file" in done.stderr
    assert not (tmp_path / "page.html").exists()


def test_the_table_in_the_docs_counts_as_the_command_does():
    counts = claims.counts(claims.records(claims.load(), ROOT / "results"))
    lines = [
        [name, *map(str, own.values()), str(sum(own.values()))] for name, own in (counts | {"all": page.total(counts)}).items()
    ]
    text = (ROOT / "docs" / "claims.md").read_text()
    said = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("| ")]
    assert said[0][1:-1] == list(claims.VERDICTS)
    assert said[1 : 1 + len(lines)] == lines


def test_what_the_docs_say_of_contradictions_is_what_the_page_says():
    rows = {row["id"]: row for row in claims.records(claims.load(), ROOT / "results")}
    text = (ROOT / "docs" / "claims.md").read_text()
    bullets = [line for line in text[text.index("## Where papers") :].splitlines() if line.startswith("* ")]
    assert len(bullets) >= 10
    for bullet in bullets:
        names, _, said = bullet.partition(": ")
        told = [rows[name] for name in re.findall(r"`([\w-]+)`", names)]
        assert {row["verdict"] for row in told} == {"not reproduced"}, bullet
        numbers = re.compile(r"\d+(?:\.\d+)?")
        own = {float(number) for row in told for number in numbers.findall(" ".join(map(str, row.values())))}
        assert {float(number) for number in numbers.findall(said)} <= own, bullet
