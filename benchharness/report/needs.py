"""A folder of `benchharness needs` -> `needs.html`: what is enough, a sentence per scene, method and knob; a chart per knob."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from benchharness.report.chart import STYLE, inline
from benchharness.report.overtime import rendered
from benchharness.report.points import looks
from benchharness.tables import files
from benchharness.tables.files import write_atomic
from benchharness.tables.naming import safe_name
from benchharness.tables.needs import (
    KNEE_KINDS,
    KNEES,
    NEEDS,
    NEEDS_OBJECTS,
    NEEDS_SAMPLES,
    OBJECT_KINDS,
    OBJECTS,
    PAGE,
    SAMPLE_KINDS,
    SAMPLES,
)

VERDICTS = {
    "judges": "judge methods: without one of them an error leaves its interval or methods change places",
    "seen": "are just seen: no method is judged otherwise without one of them",
    "nothing": "are needed for nothing that mirrors show",
    "alone": "is all there is",
}
WORTH = 0.1  # of the error: what more model has to take off to be named a gain


def write(folder: Path) -> Path:
    """Writes `needs.html` and the charts as PNG. Raises ValueError for tables that are missing, damaged or empty."""
    knees = files.read(folder / NEEDS, KNEE_KINDS, required=KNEES, least=-math.inf)
    samples = files.read(folder / NEEDS_SAMPLES, SAMPLE_KINDS, required=SAMPLES, least=-math.inf)
    if not knees:
        raise ValueError(f"{folder / NEEDS}: no rows; accepted: a study that measured at least one knob")
    charts = {}
    for knob in dict.fromkeys((row["method"], row["knob"], row["given"]) for row in knees):
        own = [row for row in samples if (row["method"], row["knob"], row["given"]) == knob and row["status"] == "ok"]
        ends = [row for row in knees if (row["method"], row["knob"], row["given"]) == knob]
        with mpl.rc_context(STYLE):
            figure = chart(own, ends)
            figure.suptitle(named(*knob), x=0.01, ha="left", fontsize=11)
            figure.savefig(folder / f"{safe_name(' '.join(filter(None, knob)))}.png", dpi=130)
            charts[named(*knob)] = inline(figure)
    scenes = {name: [row for row in knees if row["scene"] == name] for name in dict.fromkeys(row["scene"] for row in knees)}
    unmeasured = [row for row in samples if row["status"] != "ok"]
    objects = files.read(folder / NEEDS_OBJECTS, OBJECT_KINDS, required=OBJECTS, least=-math.inf)
    things = {name: [row for row in objects if row["scene"] == name] for name in scenes}
    text = rendered(
        "needs.html.jinja",
        scenes=scenes,
        charts=charts,
        sentence=sentence,
        things=things,
        of_objects=of_objects,
        unmeasured=unmeasured,
        named=named,
    )
    write_atomic(folder / PAGE, text)
    return folder / PAGE


def named(method: str, knob: str, given: str) -> str:
    """A knob in words."""
    return f"{method}: {knob}" + (f" (with {given})" if given else "")


def sentence(row: dict) -> str:
    """What is enough, what it costs, and what more would buy."""
    name = named(row["method"], row["knob"], row["given"])
    knee = f"{name}: {row['knee']} is enough, FLIP {row['knee_flip']:.4f} in {row['knee_frame_ms']:.1f} ms"
    if row["knee"] == row["most"]:
        more = "it is the largest that was tried, and there may be more to gain"
    elif row["knee_flip"] - row["most_flip"] > WORTH * row["knee_flip"]:
        more = f"{row['most']} leaves {row['most_flip']:.4f} in {row['most_frame_ms']:.1f} ms"
    else:
        more = f"up to {row['most']} nothing is gained"
    if row["knee"] == row["least"]:
        return f"{knee}, the smallest that was tried; {more}."
    return f"{knee}; {more}; {row['least']} would leave {row['least_flip']:.4f}."


def of_objects(rows: Sequence[dict]) -> list[str]:
    """What the objects of a scene are needed for, and how many vertices would do."""
    told = []
    for verdict, meaning in VERDICTS.items():
        if names := [row["object"] for row in rows if row["verdict"] == verdict]:
            told.append(f"{len(names)} of {len(rows)} {meaning}: {', '.join(names)}.")
    total, enough = (sum(row[name] for row in rows) for name in ("vertices", "enough_vertices"))
    return [*told, f"Of {total:,} vertices of objects {enough:,} are enough, each object by itself."]


def chart(samples: Sequence[dict], knees: Sequence[dict]) -> Figure:
    """Error and time against the value of one knob, a line per scene; a ring around each knee."""
    values = list(dict.fromkeys(row["value"] for row in samples))
    figure = Figure(figsize=(9.5, 3.4), layout="constrained")
    error, time = figure.subplots(1, 2)
    colours = {name: look.colour for name, look in looks([{"method": row["scene"]} for row in samples]).items()}
    for scene, colour in colours.items():
        own = [row for row in samples if row["scene"] == scene]
        x = [values.index(row["value"]) for row in own]
        error.plot(x, [row["flip"] for row in own], color=colour, marker="o", markersize=3, linewidth=1.2, label=scene)
        error.fill_between(x, [r["flip_lo"] for r in own], [r["flip_hi"] for r in own], color=colour, alpha=0.12, linewidth=0)
        time.plot(x, [row["frame_ms"] for row in own], color=colour, marker="o", markersize=3, linewidth=1.2)
        for knee in (row for row in knees if row["scene"] == scene):
            at = values.index(knee["knee"])
            error.plot(at, knee["knee_flip"], "o", markersize=9, markerfacecolor="none", color=colour)
            time.plot(at, knee["knee_frame_ms"], "o", markersize=9, markerfacecolor="none", color=colour)
    for axes, label in ((error, "FLIP in mirrors"), (time, "frame, ms")):
        axes.set_xticks(range(len(values)), values, fontsize=8)
        axes.set(ylabel=label, xlabel="more model →", ylim=(0, None))
        axes.grid(axis="y")
    figure.legend(fontsize=7, loc="outside right center")
    return figure
