"""A run folder -> `report.html`, one file that opens without a network, and the charts as PNG and SVG in `figures/`."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from benchharness.report import chart, images, interactive
from benchharness.report.points import BUDGETS_MS, Look, Point, SceneView, looks, views
from benchharness.tables import origin, results
from benchharness.tables.columns import RESULTS, STATUSES, SUMMARY, Column
from benchharness.tables.files import write_atomic
from benchharness.tables.naming import safe_name
from benchharness.tables.remarks import remarks

LEADING = "frame_ms shade_ms update_ms prepare_ms kernel_ms first_ms flip flip_p95 rmse relmse".split()
"""Columns of a scene's table that come first, in this order."""

PROVENANCE = (
    "run config variant reference_lighting reference_spp reference_noise ppd config_hash scene_hash environment calibration_ms"
).split()


@dataclass(frozen=True)
class Cell:
    """What is shown, what it sorts by ("" for nothing), and whether it is the best of its column."""

    text: str
    sort: float | str
    best: bool = False
    title: str = ""


@dataclass(frozen=True)
class Section:
    """A scene on the page. `notes`: what was wrong in it, and what should not be relied on in its rows."""

    anchor: str
    view: SceneView
    notes: list[str]
    answers: list[Point | None]
    frontier: Markup
    path: Markup
    columns: list[Column]
    rows: list[dict]
    frames: list[images.FrameShots]
    figures: list[str]


def write(run: Path) -> Path:
    """Writes `figures/` and `report.html` into a run folder from its results.csv, environment.json and images/.

    Pictures, numbers and whole rows may be missing: the page says so. Raises ValueError where results.csv is missing,
    malformed or has no rows.
    """
    records = results.read_results(run)
    if not records:
        raise ValueError(f"{run / 'results.csv'}: no rows; accepted: the results of a run")
    styles = looks(records)
    seen = views(records)
    environment = origin.read_environment(run)
    said = environment.get("scenes", {})
    sections = [_section(run, f"scene-{i}", view, styles, said.get(view.scene, "")) for i, view in enumerate(seen)]
    drawn = [view for view in seen if view.points]
    overview = chart.save(chart.overview(drawn, styles), run / "figures" / "overview") if len(drawn) > 1 else []
    loader = jinja2.FileSystemLoader(Path(__file__).parent)
    template = jinja2.Environment(loader=loader, autoescape=True, undefined=jinja2.StrictUndefined).get_template(
        "page.html.jinja"
    )
    text = template.render(
        title=", ".join(dict.fromkeys(r["config"] for r in records if r["config"])) or run.name,
        sections=sections,
        overview=[str(file.relative_to(run)) for file in overview],
        budgets=BUDGETS_MS,
        broken=broken(records),
        columns={column.name: column for column in (*table(), *RESULTS, *SUMMARY) if column.title},
        statuses=STATUSES,
        environment=_flat(environment),
        provenance=_provenance(records),
        hashes=_hashes(records),
        counts={status: sum(r["status"] == status for r in records) for status in STATUSES},
        rows=len(records),
        methods=len(styles),
        time=environment.get("time"),
        number=number,
        plotly=Markup(get_plotlyjs()),
    )
    file = run / "report.html"
    write_atomic(file, text)
    return file


def table() -> list[Column]:
    """The columns of a scene's table, in order; those that no method of the scene has are left out."""
    shown = {column.name: column for column in SUMMARY if column.title and column.over}
    return [shown.pop(name) for name in LEADING] + list(shown.values())


def _section(run: Path, anchor: str, view: SceneView, styles: Mapping[str, Look], said: str) -> Section:
    stem = safe_name(view.scene) + (f"-{safe_name(view.detail)}" if view.detail else "")
    written: list[Path] = []
    frontier = path = Markup()
    if view.points:
        written += chart.save(chart.frontier_chart(view, styles), run / "figures" / f"frontier-{stem}")
        written += chart.save(chart.path_chart(view, styles), run / "figures" / f"path-{stem}")
        frontier = Markup(interactive.html(interactive.frontier_figure(view, styles), f"{anchor}-frontier"))
        path = Markup(interactive.html(interactive.path_figure(view, styles), f"{anchor}-path"))
    shown = [column for column in table() if any(row[column.name] is not None for row in view.rows)]
    return Section(
        anchor=anchor,
        view=view,
        notes=[
            *filter(None, said.split("; ")),
            *remarks(view.rows, lambda row: f"{row['method']} {_label(view, row)}".strip()),
        ],
        answers=[view.within(ms) for ms, _ in BUDGETS_MS] + [view.within(math.inf)],
        frontier=frontier,
        path=path,
        columns=shown,
        rows=[_row(view, row, shown, styles) for row in view.rows],
        frames=images.frames(view, run / "images"),
        figures=[str(file.relative_to(run)) for file in written],
    )


def _label(view: SceneView, row: Mapping[str, Any]) -> str:
    """What differs between a row and others of its method."""
    return view.labels[row["method"], row["params"] or ""]


def _row(view: SceneView, row: dict, shown: Sequence[Column], styles: Mapping[str, Look]) -> dict:
    place = next((place for p, place in zip(view.points, view.places, strict=True) if p.row is row), None)
    reason = next((why for r, why in view.undrawn if r is row), "")
    return {
        "method": row["method"],
        "params": row["params"] or "",
        "label": _label(view, row),
        "colour": styles[row["method"]].colour if row["method"] in styles else "#7F7F7F",
        "place": interactive.standing(view, place) if place else reason,
        "verdict": place.verdict if place else "none",
        "frames": Cell(f"{row['frames_ok']} / {row['frames']}", row["ok_ratio"]),
        "cells": [_cell(view, row, column) for column in shown],
    }


def _cell(view: SceneView, row: dict, column: Column) -> Cell:
    value = row[column.name]
    if value is None:
        return Cell("", "")
    title, text = "", number(value)
    if column.name == "shade_ms" and None not in (row["shade_ms_lo"], row["shade_ms_hi"]):
        title = f"95 % interval {number(row['shade_ms_lo'])} to {number(row['shade_ms_hi'])} ms"
    if column.name == "flip":
        title = f"frames {number(row['flip_min'])} to {number(row['flip_max'])}"
        if value <= (row["reference_noise"] or 0.0):
            text, title = f"≤ {number(row['reference_noise'])}", f"{number(value)} is within the reference's noise"
    ranked = [p.row[column.name] for p in view.ranked if p.row[column.name] is not None]
    best = (max if column.better == "more" else min)(ranked, default=None)
    told_apart = (
        len(set(ranked)) > 1 and bool(column.better) and not text.startswith("≤") and any(p.row is row for p in view.ranked)
    )
    return Cell(text, value, value == best and told_apart, title)


def number(value: Any) -> str:
    """Three digits that matter; "" for what has no meaning."""
    if value is None:
        return ""
    if isinstance(value, int) or not isinstance(value, float):
        return str(value)
    if not math.isfinite(value) or value == 0.0:
        return f"{value:g}"
    size = math.floor(math.log10(abs(value)))
    return f"{value:.2e}" if size < -4 else f"{value:.{max(2 - size, 0)}f}"


def broken(records: Sequence[Mapping]) -> list[dict]:
    """Rows without a picture to count on, frames of one cause together: where it breaks, and why."""
    groups: dict[tuple, list[int]] = {}
    for record in records:
        if record["status"] != "ok":
            names = ("scene", "detail", "method", "params", "status", "reason")
            frames = groups.setdefault(tuple(record[name] or "" for name in names), [])
            frames += [] if record["frame"] is None else [record["frame"]]
    order = list(reversed(STATUSES))
    return [
        dict(zip(("scene", "detail", "method", "params", "status", "reason"), group, strict=True))
        | {"frames": ", ".join(map(str, frames[:12])) + (f" and {len(frames) - 12} more" if len(frames) > 12 else "")}
        for group, frames in sorted(groups.items(), key=lambda item: order.index(item[0][4]))
    ]


def _provenance(records: Sequence[Mapping]) -> list[tuple[str, str]]:
    """Column -> its values in the run, where it has any."""
    out = []
    for name in PROVENANCE:
        values = list(dict.fromkeys(number(record[name]) for record in records if record[name] is not None))
        if values:
            more = f" and {len(values) - 6} more" if len(values) > 6 else ""
            out.append((name, ", ".join(values[:6]) + more))
    return out


def _hashes(records: Sequence[Mapping]) -> list[tuple[str, str]]:
    """Method -> the hash of its code."""
    pairs = {(r["method"], r["method_hash"]) for r in records if r["method"] and r["method_hash"]}
    return sorted(pairs)


def _flat(environment: Mapping[str, Any]) -> list[tuple[str, str]]:
    rows = []
    for name, value in environment.items():
        if isinstance(value, Mapping):
            value = ", ".join(f"{key} {item}" for key, item in value.items())
        elif not isinstance(value, str):
            value = "unknown" if value is None else json.dumps(value)
        rows.append((name, value))
    return rows
