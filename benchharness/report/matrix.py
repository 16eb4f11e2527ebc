"""A folder of the stability suite -> `stability.html`: which method holds where, from mild to severe, and what it looks like.

One file that opens without a network. Reads the suite's tables and images/; never renders.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
from markupsafe import Markup
from matplotlib.figure import Figure

from benchharness.report import overtime
from benchharness.report.chart import STYLE, inline
from benchharness.report.points import looks
from benchharness.tables.columns import VERDICTS
from benchharness.tables.files import write_atomic
from benchharness.tables.naming import picture_name
from benchharness.tables.stability import read


@dataclass(frozen=True)
class Cell:
    """One method in one regime: its rows from mild to severe, its worst verdict, and the row that shows it: the mildest that
    has it. `picture`: a data: URL of the method's picture, the reference and the error; empty for none."""

    rows: list[dict]
    worst: str
    shown: dict
    picture: str

    @property
    def silent(self) -> list[dict]:
        return [row for row in self.rows if row["verdict"] == "fails"]


@dataclass(frozen=True)
class Line:
    """A regime: what its rows have in common, a cell per method (None where it did not run), and its curves."""

    name: str
    first: dict
    cells: list[Cell | None]
    curves: Markup


def write(folder: Path) -> Path:
    """Writes stability.html. Raises ValueError for a folder without a table of the suite, and for a table without rows."""
    extras = overtime.sections(folder)
    rows = [] if extras and not (folder / "stability.csv").exists() else read(folder / "stability.csv")
    for number, row in enumerate(rows):
        row["id"] = f"row-{number + 1}"
    methods = list(dict.fromkeys(row["label"] for row in rows))
    lines = [
        _line(folder, name, [row for row in rows if row["regime"] == name], methods)
        for name in dict.fromkeys(row["regime"] for row in rows)
    ]
    tallies = [{v: sum(row["verdict"] == v for row in rows if row["label"] == m) for v in VERDICTS} for m in methods]
    text = overtime.rendered("matrix.html.jinja", rows=rows, lines=lines, methods=methods, tallies=tallies, extras=extras)
    file = folder / "stability.html"
    write_atomic(file, text)
    return file


def _line(folder: Path, name: str, rows: list[dict], methods: list[str]) -> Line:
    cells = [_cell(folder, [row for row in rows if row["label"] == method]) for method in methods]
    return Line(name, rows[0], cells, _curves(rows))


def _cell(folder: Path, rows: list[dict]) -> Cell | None:
    if not rows:
        return None
    order = ("fails", "degrades", "refuses", "holds")
    worst = min((row["verdict"] for row in rows), key=order.index)
    shown = next(row for row in rows if row["verdict"] == worst) if worst != "holds" else rows[-1]
    file = folder / "images" / picture_name(shown["regime"], float(shown["severity"]), shown["label"])
    data = f"data:image/png;base64,{base64.b64encode(file.read_bytes()).decode()}" if file.is_file() else ""
    return Cell(rows, worst, shown, data)


def _curves(rows: Sequence[dict]) -> Markup:
    """The error of every method against the severity, as an SVG; severities evenly, in their order."""
    severities = list(dict.fromkeys(row["severity"] for row in rows))
    styles = looks([{"method": row["label"]} for row in rows])
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(4.6, 2.6), layout="constrained")
        axes = figure.subplots()
        for method, look in styles.items():
            own = [
                (severities.index(r["severity"]), float(r["symptom"] or r["flip"]))
                for r in rows
                if r["label"] == method and (r["symptom"] or r["flip"])
            ]
            if own:
                axes.plot(*zip(*own, strict=True), color=look.colour, marker="o", markersize=3, linewidth=1.2, label=method)
        axes.axhline(float(rows[0]["bound"]), color="#6B7280", linewidth=0.8, linestyle="--")
        axes.set_xticks(range(len(severities)), [f"{float(s):g}" for s in severities])
        axes.set_ylim(bottom=0)
        axes.grid(axis="y")
        axes.legend(fontsize=6, loc="upper left", bbox_to_anchor=(1, 1))
        return inline(figure)
