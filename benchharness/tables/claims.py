"""What papers claim beside what was measured here: the files of `papers/` and the tables of `results/` -> a verdict per claim.

A claim states its verdict. Where the number is in a table, a query reads it from there, and what it expects is what the paper
says: a verdict that the table contradicts is found. Other claims quote a figure and name the page or the test that has it.
A file is a paper, `source` its citation, and an entry of its `claims` has

    id, section, kind   where it stands; `kind` is one of KINDS
    says, measures      the claim in our words with its numbers; method, scene and metric that answer it
    verdict, because    one of VERDICTS, and what has to be known to read it; why something cannot be tested
    query               see `Query`; or else
    found, shown        the figure, and where it stands: `docs/PAGE.md#anchor`, `tests/FILE.py::name`, a picture of
                        results/figures/, or `catalogue: ROW`, a row of tests/catalogue/
    command             what makes the number anew; that of the tests and the catalogue need not be said
"""

from __future__ import annotations

import itertools
import math
import re
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from functools import cache
from pathlib import Path
from typing import Any

from benchharness.exits import Exit
from benchharness.tables import columns, files
from benchharness.tables.parameters import parse_params
from benchharness.tables.summary import OVER

PAPERS = Path(__file__).with_name("papers")
TABLE = "claims.csv"
KINDS = ("table", "figure", "sentence", "equation")
VERDICTS = {
    "reproduced": "what was measured here is what the paper says",
    "not reproduced": "it is something else, or the statement is wrong",
    "cannot be tested": "it is of hardware that nobody has, or of what no number says",
    "not measured yet": "nothing here measures it",
}
CATALOGUE = "PYTHONPATH=tests python -m catalogue.catalogue"
ROW = "catalogue: "
DECIDED = ("reproduced", "not reproduced")
"""Verdicts that rest on a number, and so need a query or a figure."""
_OVER = {column.name: column.over for column in columns.RESULTS}
_BOUND = re.compile(r"(>=|<=|>|<) (\S+)")
_RANGE = re.compile(r"(\S+) to (\S+)")
_FACTOR = re.compile(r"(\S+) within a factor of (\S+)")


@dataclass(frozen=True)
class Query:
    """A number of a table, or the ratio of two.

    table    of the folder of tables, such as `baselines/main.csv`
    column   the numbers: of the rows that are ok and answer `where`
    where    column -> text that it holds; `params` -> a table of parameters. A list asks for each of its values in turn
    over     how rows become one number, a key of `summary.OVER`; by default as in a summary
    against  what is divided by: a table with another `where`, which adds to or takes the place of the first, and `column`
    expect   what the paper says, see `holds`
    unit     of the number; "times" for ratios
    """

    table: str
    column: str
    where: Mapping[str, Any]
    expect: str
    over: str = ""
    against: Mapping[str, Any] | None = None
    unit: str = ""

    def values(self, tables: Path) -> list[tuple[str, float]]:
        """(case, number), a case per value of the lists in `where`. Raises ValueError where the table has no such number."""
        found = []
        for case, where in _cases(self.where):
            value = self._number(tables, where, self.column)
            if self.against is not None:
                other = _merged(where, self.against.get("where", {}))
                value /= self._number(tables, other, self.against.get("column", self.column))
            found.append((case, value))
        return found

    def _number(self, tables: Path, where: Mapping[str, Any], column: str) -> float:
        path = tables / self.table
        rows = [row for row in _rows(path) if row.get("status", "ok") == "ok" and _answers(row, where)]
        if rows and column not in rows[0]:
            raise ValueError(f"{path}: there is no column {column!r}; accepted: {', '.join(rows[0])}")
        numbers = [float(row[column]) for row in rows if row[column]]
        if not numbers:
            raise ValueError(f"{path}: no row with a {column!r} answers {dict(where)}; accepted: values that the table has")
        over = self.over or _OVER.get(column) or "mean"
        return float(OVER[over](numbers))


@dataclass(frozen=True)
class Claim:
    """An entry of a paper's file, see above."""

    id: str
    source: str
    section: str
    kind: str
    says: str
    measures: str
    verdict: str
    command: str = ""
    because: str = ""
    query: Query | None = None
    found: str = ""
    shown: Sequence[str] = field(default=())


def load(folder: Path = PAPERS) -> list[Claim]:
    """All claims, paper by paper. Raises ValueError for an entry that lacks something or has too much."""
    claims = []
    for path in sorted(folder.glob("*.toml")):
        made = tomllib.loads(path.read_text(encoding="utf-8"))
        claims += [_claim(entry | {"source": made["source"]}, path) for entry in made["claims"]]
    if twice := [name for name, count in Counter(claim.id for claim in claims).items() if count > 1]:
        raise ValueError(f"{folder}: claim {twice[0]!r} is there twice; accepted: every id once")
    return claims


def _claim(entry: Mapping[str, Any], path: Path) -> Claim:
    where, query = f"{path}: claim {entry.get('id')!r}", entry.get("query")
    _known(entry, Claim, where)
    if query is not None:
        _known(query, Query, f"{where}, query")
    for key, accepted in (("kind", KINDS), ("verdict", VERDICTS)):
        if entry[key] not in accepted:
            raise ValueError(f"{where}: {key} is {entry[key]!r}; accepted: {', '.join(accepted)}")
    shown = tuple(entry.get("shown", ()))
    made = {"query": None if query is None else Query(**query), "shown": shown, "command": _command(shown)}
    claim = Claim(**{**made, **entry, "query": made["query"], "shown": shown})
    typed = bool(claim.found) and bool(shown)
    if (claim.verdict in DECIDED) != (typed != (claim.query is not None)) or bool(claim.found) != bool(shown):
        raise ValueError(
            f"{where}: {claim.verdict}; accepted: with a query or with found and shown where it is decided, else neither"
        )
    if claim.verdict in DECIDED and not claim.command:
        raise ValueError(f"{where}: no command; accepted: what makes its number")
    if claim.verdict == "cannot be tested" and not claim.because:
        raise ValueError(f"{where}: no reason; accepted: because")
    return claim


def _command(shown: Iterable[str]) -> str:
    """What makes anew what tests and the catalogue show; "" for what else is shown."""
    places = list(shown)
    tests = [place for place in places if place.startswith("tests/")]
    rows = [CATALOGUE] if any(place.startswith(ROW) for place in places) else []
    return "; ".join([*rows, *([f"pytest {' '.join(tests)}"] if tests else [])])


def _known(entry: Mapping[str, Any], kind: type, where: str) -> None:
    names = {one.name: one for one in fields(kind)}
    if unknown := [name for name in entry if name not in names]:
        raise ValueError(f"{where}: {unknown[0]!r} is unknown; accepted: {', '.join(names)}")
    needed = [one.name for one in names.values() if one.default is MISSING and one.default_factory is MISSING]
    if missing := [name for name in needed if not entry.get(name)]:
        raise ValueError(f"{where}: {missing[0]!r} is missing; accepted: at least {', '.join(needed)}")


def records(claims: Iterable[Claim], tables: Path) -> list[dict[str, Any]]:
    """A row of claims.csv per claim. `tables` is the folder that queries read: `results/` of a checkout.

    Raises ValueError for a table, column or row that is not there, with the claim's id.
    """
    return [_record(claim, tables) for claim in claims]


def _record(claim: Claim, tables: Path) -> dict[str, Any]:
    names = ("id", "source", "section", "kind", "says", "measures", "verdict", "because", "command", "found")
    row: dict[str, Any] = {name: getattr(claim, name) for name in names}
    row |= {"expected": "", "shown": "; ".join(claim.shown), "agrees": ""}
    if claim.query is not None:
        try:
            found = claim.query.values(tables)
            agrees = holds(claim.query.expect, [value for _, value in found]) == (claim.verdict == "reproduced")
        except ValueError as error:
            raise ValueError(f"claim {claim.id!r}: {error}") from None
        row |= {
            "found": said(found, claim.query.unit),
            "expected": claim.query.expect,
            "shown": f"{tables.name}/{claim.query.table}",
            "agrees": "yes" if agrees else "no",
        }
    return row


def holds(expect: str, values: Sequence[float]) -> bool:
    """Whether numbers are as expected: each one within a bound (`> 2`, `<= 0.1`, `3 to 10`, `4.7 within a factor of
    1.5`), or in their order `rising` or `falling`. Raises ValueError for an expectation that is none of these."""
    if expect in ("rising", "falling"):
        sign = 1 if expect == "rising" else -1
        return all(sign * (after - before) > 0 for before, after in itertools.pairwise(values))
    if match := _BOUND.fullmatch(expect):
        bound, compared = float(match[2]), match[1]
        tests = {">": float.__gt__, ">=": float.__ge__, "<": float.__lt__, "<=": float.__le__}
        return all(tests[compared](value, bound) for value in values)
    if match := _RANGE.fullmatch(expect):
        return all(float(match[1]) <= value <= float(match[2]) for value in values)
    if match := _FACTOR.fullmatch(expect):
        return all(abs(math.log(value / float(match[1]))) <= math.log(float(match[2])) for value in values)
    accepted = "'> 1', '3 to 10', '4.7 within a factor of 1.5', 'rising' or 'falling'"
    raise ValueError(f"expect is {expect!r}; accepted: such as {accepted}")


def said(found: Sequence[tuple[str, float]], unit: str) -> str:
    """Numbers in words: "kitchen 9.73, ufo 12.1 times"."""
    numbers = [(case, f"{value:,.0f}" if value >= 1000 else f"{value:.3g}") for case, value in found]
    return f"{', '.join(f'{case} {number}'.strip() for case, number in numbers)} {unit}".strip()


def counts(rows: Iterable[Mapping[str, Any]]) -> dict[str, dict[str, int]]:
    """Source -> verdict -> how many claims, in the order of the claims and of VERDICTS."""
    made: dict[str, dict[str, int]] = {}
    for row in rows:
        made.setdefault(row["source"], dict.fromkeys(VERDICTS, 0))[row["verdict"]] += 1
    return made


def contradicted(rows: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """The claims whose verdict is not what the table says."""
    return [row for row in rows if row["agrees"] == "no"]


def exit_code(rows: Iterable[Mapping[str, Any]]) -> Exit:
    """That of a regression where a table contradicts a verdict."""
    return Exit.REGRESSION if contradicted(rows) else Exit.FINE


def write(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    kinds = columns.kinds(columns.CLAIMS)
    files.write(path, rows, list(kinds), kinds)


def _cases(where: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """(its name, `where` with one value of every list)."""
    flat = {("params", key): value for key, value in where.get("params", {}).items()}
    flat |= {(key,): value for key, value in where.items() if key != "params"}
    lists = {key: value for key, value in flat.items() if isinstance(value, list)}
    for chosen in itertools.product(*lists.values()):
        one = _merged(where, {})
        for key, value in zip(lists, chosen, strict=True):
            (one["params"] if len(key) == 2 else one)[key[-1]] = value
        yield " ".join(map(str, chosen)), one


def _merged(where: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
    return {**where, **other, "params": {**where.get("params", {}), **other.get("params", {})}}


def _answers(row: Mapping[str, str], where: Mapping[str, Any]) -> bool:
    for name, wanted in where.items():
        if name == "params":
            given = parse_params(row["params"]) if wanted else {}
            if any(str(given.get(key)) != str(value) for key, value in wanted.items()):
                return False
        elif row.get(name) != str(wanted):
            return False
    return True


@cache
def _rows(path: Path) -> list[dict[str, str]]:
    return files.read(path, {})
