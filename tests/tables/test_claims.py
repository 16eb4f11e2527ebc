"""Claims of papers: that queries read what they say, and that verdicts, figures, places and commands are not made up."""

from __future__ import annotations

import ast
import re
import shlex
from dataclasses import replace
from pathlib import Path

import pytest
import typer.main
from catalogue import catalogue

from benchharness import cli
from benchharness.study import shipped
from benchharness.tables import claims

ROOT = Path(__file__).resolve().parents[2]
TABLES = ROOT / "results"
CLAIMS = claims.load()
NUMBER = re.compile(r"(?<![\w.])-?\d[\d,_]*\.?\d*(?:e-?\d+)?|(?<![\w.])\.\d+")


def each(what) -> list:
    return [pytest.param(claim, id=claim.id) for claim in CLAIMS if what(claim)]


def numbers(text: str) -> set[float]:
    """Those of a text: ".5", "22.", "1,000" and "1_000" are numbers, "F-07" has one and "x2" none."""
    return {float(word.replace(",", "").replace("_", "").rstrip(".")) for word in NUMBER.findall(text)}


# What is read from tables


ROWS = """scene,method,params,status,frame,flip,frame_ms,colour
hall,a,n=1; fine=True,ok,0,0.2,10,red
hall,a,n=1; fine=True,ok,1,0.4,40,red
hall,a,n=1; fine=True,ok,2,0.3,20,red
hall,a,n=2; fine=True,ok,0,0.1,40,
hall,a,n=2; fine=True,crashed,1,9,900,
hall,b,,ok,0,0.05,5,
yard,a,n=1; fine=True,ok,0,0.6,8,
yard,b,,ok,0,0.1,4,
"""


@pytest.fixture
def tables(tmp_path):
    (tmp_path / "t.csv").write_text(ROWS)
    return tmp_path


def query(where, column="flip", expect="> 0", **other):
    return claims.Query("t.csv", column, where, expect, **other)


def test_rows_become_one_number_as_in_a_summary_or_as_told(tables):
    hall = {"scene": "hall", "method": "a", "params": {"n": 1}}
    assert query(hall).values(tables) == [("", pytest.approx(0.3))]  # (0.2 + 0.4 + 0.3) / 3
    assert query(hall, "frame_ms").values(tables) == [("", 20)]  # a time's median
    assert query(hall, "frame_ms", over="max").values(tables) == [("", 40)]
    assert query({**hall, "params": {"n": 2, "fine": True}}).values(tables) == [("", 0.1)]  # what crashed has no number
    assert query({"scene": "hall", "method": "a", "frame": "1"}).values(tables) == [("", 0.4)]


def test_lists_are_asked_value_by_value_and_ratios_keep_the_case(tables):
    asked = query(
        {"scene": ["hall", "yard"], "method": "a", "params": {"n": 1}},
        against={"where": {"method": "b", "params": {"n": "None"}}},
    )
    assert asked.values(tables) == [("hall", pytest.approx(6)), ("yard", pytest.approx(6))]
    by_n = query({"scene": "hall", "params": {"n": [1, 2]}}, "frame_ms", against={"column": "flip"})
    assert by_n.values(tables) == [("1", pytest.approx(20 / 0.3)), ("2", pytest.approx(400))]


@pytest.mark.parametrize(
    ("asked", "text"),
    [(query({"scene": "attic"}), "no row with a 'flip' answers"), (query({"scene": "yard", "method": "a"}, "colour"), "no row"),
     (query({"scene": "hall"}, "warmth"), "there is no column 'warmth'"),
     (replace(query({}), table="u.csv"), "u.csv: No such file")],
)  # fmt: skip
def test_what_is_not_there_is_named(tables, asked, text):
    with pytest.raises(ValueError, match=text):
        asked.values(tables)


@pytest.mark.parametrize(
    ("expect", "good", "bad"),
    [("> 2", [2.1, 3.0], [2.0, 3.0]), (">= 2", [2.0], [1.9]), ("< 0.1", [0.05], [0.05, 0.1]), ("<= 0.1", [0.1], [0.2]),
     ("3 to 10", [3.0, 10.0], [2.9]), ("4 within a factor of 1.5", [2.7, 5.9], [2.6]),
     ("4 within a factor of 1.5", [4.0], [4.0, 6.1]), ("rising", [1.0, 2.0, 3.0], [1.0, 3.0, 3.0]),
     ("falling", [3.0, 1.0], [3.0, 1.0, 2.0])],
)  # fmt: skip
def test_an_expectation_holds_for_all_numbers_or_not(expect, good, bad):
    assert claims.holds(expect, good) and not claims.holds(expect, bad)


@pytest.mark.parametrize("expect", ["about 3", ">2", "", "growing"])
def test_what_is_no_expectation_is_refused(expect):
    with pytest.raises(ValueError, match="accepted: such as '> 1'"):
        claims.holds(expect, [1.0])


# What claims say of themselves


def test_there_are_claims_of_every_paper_and_verdict():
    counts = claims.counts(claims.records(CLAIMS, TABLES))
    assert len(CLAIMS) > 150 and len(counts) == 4
    assert {verdict for own in counts.values() for verdict, count in own.items() if count} == set(claims.VERDICTS)


@pytest.mark.parametrize("claim", each(lambda claim: claim.query is not None))
def test_no_committed_table_contradicts_a_verdict(claim):
    (row,) = claims.records([claim], TABLES)
    assert row["agrees"] == "yes", f"{row['found']}, of what should be {row['expected']}"


def test_the_other_verdict_would_be_contradicted():
    """A query decides: there is no verdict that it lets pass anyway."""
    yes, no = claims.DECIDED
    others = {yes: no, no: yes}
    asked = [replace(claim, verdict=others[claim.verdict]) for claim in CLAIMS if claim.query is not None]
    assert len(claims.contradicted(claims.records(asked, TABLES))) == len(asked) > 50


def test_numbers_of_a_text_by_hand():
    assert numbers("F-07: .5 of 1,000, then 22. And 1_000 at x2, 1e-13") == {7, 0.5, 1000, 22, 1e-13}


@pytest.fixture(scope="module")
def rows():
    return {row.what: row for row in catalogue.table()}


@pytest.mark.parametrize("claim", each(lambda claim: claim.shown))
def test_what_is_quoted_stands_where_it_is_said_to(claim, rows):
    """Every number of it: on the page, in the test's file, or within what the catalogue accepts."""
    there, within = set(), []
    for place in claim.shown:
        if place.startswith(claims.ROW):
            row = rows[place.removeprefix(claims.ROW)]
            within.append((row.low, row.high))
            continue
        name, _, part = place.partition("::" if "::" in place else "#")
        path = ROOT / name
        assert path.is_file(), place
        if path.suffix == ".py":
            names = {node.name for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.FunctionDef)}
            assert part.startswith("test_") and part in names, place
        elif path.suffix == ".md":
            assert part in headings(path), place
        else:
            assert path.suffix == ".png" and not part
            within.append((0.0, float("inf")))  # read off a chart
        if path.suffix != ".png":
            there |= numbers(path.read_text())
    missing = [number for number in numbers(claim.found) - there if not any(low <= number <= high for low, high in within)]
    # "3 of 300": how many there were is in the row's name.
    named = {number for place in claim.shown for number in numbers(place.replace("px", " px"))}
    assert not set(missing) - named, f"{claim.found}: {missing}"


def headings(page: Path) -> set[str]:
    """The anchors that GitHub gives to the headings of a page."""
    titles = re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("command", sorted({part for claim in CLAIMS for part in claim.command.split("; ") if part}))
def test_commands_can_be_typed(command):
    words = shlex.split(command)
    if words[0] == "pytest":
        assert all((ROOT / word.partition("::")[0]).is_file() for word in words[1:])
    elif words[0] == "benchharness":
        context = typer.main.get_group(cli.app).commands[words[1]].make_context(words[1], words[2:])
        if config := context.params.get("config"):
            assert shipped.config(config).is_file(), config
        for regime in context.params.get("regime") or ():
            assert (ROOT / "scenes" / "stress" / f"{regime}.py").is_file()
        for method in context.params.get("only") or ():
            assert (ROOT / "methods" / f"{method}.py").is_file()
    else:
        assert command == claims.CATALOGUE and (ROOT / "tests" / "catalogue" / "catalogue.py").is_file()


# What is refused


ENTRY = """source = "Nobody 2006"
[[claims]]
id = "one"
section = "1"
kind = "sentence"
says = "It is fast."
measures = "time"
verdict = "cannot be tested"
because = "it says not how fast"
"""


@pytest.mark.parametrize(
    ("change", "text"),
    [(("because", "why"), "'why' is unknown"), (('"sentence"', '"poem"'), "kind is 'poem'; accepted: table"),
     (('"cannot be tested"', '"true"'), "verdict is 'true'"), (('measures = "time"\n', ""), "'measures' is missing"),
     (('"cannot be tested"', '"reproduced"'), "reproduced; accepted: with a query or with found"),
     (('because = "it says not how fast"\n', ""), "no reason"), (("because", 'found = "3"\nbecause'), "accepted: with a query"),
     (("because", 'query.speed = 1\nbecause'), "'speed' is unknown")],
)  # fmt: skip
def test_a_claim_that_lacks_something_or_has_too_much_is_refused(tmp_path, change, text):
    (tmp_path / "nobody.toml").write_text(ENTRY)
    assert len(claims.load(tmp_path)) == 1
    assert change[0] in ENTRY
    (tmp_path / "nobody.toml").write_text(ENTRY.replace(*change))
    with pytest.raises(ValueError, match=text):
        claims.load(tmp_path)


def test_an_id_is_there_once(tmp_path):
    for name in ("a", "b"):
        (tmp_path / f"{name}.toml").write_text(ENTRY)
    with pytest.raises(ValueError, match="'one' is there twice"):
        claims.load(tmp_path)
