"""The charts of a folder of `benchharness speed`, as PNG, from its tables."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchharness.report.points import looks
from benchharness.tables import files, speed
from benchharness.tables.columns import Kind

MOST_SHOWN = 20
"""Iterations; what takes more is drawn as these."""


def write(folder: Path) -> list[Path]:
    """Draws what the folder has tables for; returns the pictures. Raises ValueError for a damaged table."""
    charts: dict[str, tuple[str, Callable[[Path], Figure]]] = {
        speed.VERTICES: (speed.VERTICES_CHART, vertices),
        speed.ITERATIONS: (speed.ITERATIONS_CHART, iterations),
        speed.IMPOSTORS: (speed.IMPOSTORS_CHART, impostors),
    }
    drawn = []
    for table, (picture, chart) in charts.items():
        if (folder / table).is_file():
            chart(folder).savefig(folder / picture)
            drawn.append(folder / picture)
    return drawn


def _table(file: Path, kinds: Mapping[str, Kind]) -> pd.DataFrame:
    return pd.DataFrame(files.read(file, kinds, required=list(kinds), least=-math.inf))


def vertices(folder: Path) -> Figure:
    """Time of a frame and error against vertices: a row of two panels per detail, a colour per method."""
    rows = _table(folder / speed.VERTICES, speed.VERTICES_KINDS)
    fits = _table(folder / speed.FITS, speed.FITS_KINDS).dropna(subset=["ms_per_1000_vertices"]).to_dict("records")
    slopes = {(fit["detail"], fit["method"]): fit["ms_per_1000_vertices"] for fit in fits}
    methods = [name for name in rows["method"].unique() if name != speed.UNREFLECTED]
    colours = {name: look.colour for name, look in looks([{"method": name} for name in methods]).items()}
    colours[speed.UNREFLECTED] = "#555555"
    details = rows["detail"].unique()
    figure = Figure(figsize=(10, 4 * len(details)), dpi=130, layout="constrained")
    for (time, error), detail in zip(figure.subplots(len(details), 2, squeeze=False), details, strict=True):
        for name, own in rows[rows["detail"] == detail].groupby("method", sort=False):
            cost = f" ({slopes[detail, name]:.2f} ms per 1000)" if (detail, name) in slopes else ""
            line = {"ms": 4, "lw": 1, "color": colours[str(name)]}
            time.plot(own["vertices"] / 1e3, own["frame_ms"], "o-", label=f"{name}{cost}", **line)
            if name != speed.UNREFLECTED:
                error.plot(own["vertices"] / 1e3, own["flip"], "o-", label=name, **line)
        time.set(xlabel="thousand vertices", ylabel="frame, ms", title=f"{detail}: cost of a vertex", xlim=(0, None))
        time.set(ylim=(0, None))
        error.set(xlabel="thousand vertices", ylabel="FLIP in the mirror (lower is better)", xlim=(0, None), yscale="log")
        error.set(title=f"{detail}: error left by the tessellation")
        for axes in (time, error):
            axes.grid(alpha=0.25)
        time.legend(fontsize=7, frameon=False)
        error.legend(fontsize=7, frameon=False, loc="upper right", bbox_to_anchor=(1.0, 0.93))
    return figure


def iterations(folder: Path) -> Figure:
    """Where on the mirror searches take how many steps, above, and the histogram of them, below; a column per case."""
    cases = _table(folder / speed.ITERATIONS, speed.ITERATIONS_KINDS)
    steps = _table(folder / speed.STEPS, speed.STEPS_KINDS)
    with np.load(folder / speed.PICTURES) as stored:
        pictures = stored["pictures"]
    columns = len(cases) // 2
    figure = Figure(figsize=(4 * columns, 11), dpi=110, layout="constrained")
    panels = figure.subplots(4, columns, squeeze=False, gridspec_kw={"height_ratios": [3, 1.6] * 2})
    down, across = np.nonzero(np.isfinite(pictures).any(axis=0))
    box = slice(down.min(), down.max() + 1), slice(across.min(), across.max() + 1)
    for k, (case, picture) in enumerate(zip(cases.to_dict("records"), pictures, strict=True)):
        above, below = panels[2 * (k // columns), k % columns], panels[2 * (k // columns) + 1, k % columns]
        image = above.imshow(picture[box], cmap="viridis", vmin=1, vmax=MOST_SHOWN)
        above.set(xticks=[], yticks=[])
        above.set_title(case["case"], fontsize=9)
        own = steps[steps["case"] == case["case"]]
        bins = list(np.arange(0.5, MOST_SHOWN + 1.5))
        share = own["vertices"] / own["vertices"].sum()
        below.hist(np.minimum(own["iterations"], MOST_SHOWN), bins=bins, color="#0072B2", weights=share)
        below.set(xlabel=f"iterations ({MOST_SHOWN}: or more)", ylabel="share of vertices", xlim=(0.5, MOST_SHOWN + 0.5))
        below.set(title=f"mean {case['mean']:.1f}, most {case['max']}")
        figure.colorbar(image, ax=above, shrink=0.8)
    return figure


def impostors(folder: Path) -> Figure:
    """Frames per second of billboards, ours and the paper's, against mirrors and pixels."""
    rows = _table(folder / speed.IMPOSTORS, speed.IMPOSTORS_KINDS)
    figure = Figure(figsize=(10, 4.2), dpi=130, layout="constrained")
    labels = {speed.REFLECTORS: "mirrors", speed.SIZE: "million pixels"}
    for axes, (table, label) in zip(figure.subplots(1, 2), labels.items(), strict=True):
        own = rows.query("table == @table")
        own = own.assign(x=[_across(table, setting) for setting in own["setting"]])
        _billboards(axes, own)
        axes.set(xlabel=label, ylabel="frames per second", yscale="log", title=f"billboards against {table}")
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter("{x:g}")
        axes.tick_params(axis="y", which="minor", labelsize=7)
        if table == speed.REFLECTORS:
            axes.set(xticks=list(own["x"].unique()))
        axes.grid(alpha=0.25, which="both")
        axes.legend(fontsize=8, frameon=False)
    return figure


def _billboards(axes: Axes, rows: pd.DataFrame) -> None:
    frames, shades = (rows.query("quantity == @quantity") for quantity in (speed.FRAME, speed.SHADE))
    paper = frames.dropna(subset=["paper"])
    axes.plot(frames["x"], frames["ours"], "o-", color="#0072B2", label="whole frame")
    axes.fill_between(frames["x"], frames["ours_lo"], frames["ours_hi"], color="#0072B2", alpha=0.2, lw=0)
    axes.plot(shades["x"], 1e3 / shades["ours"], "o--", ms=4, color="#56B4E9", label="shade alone")
    axes.plot(paper["x"], paper["paper"], "s-", color="#D55E00", label="Popescu et al. 2006")


def _across(table: str, setting: str) -> float:
    """Mirrors, or million pixels, of a row."""
    return float(setting) if table == speed.REFLECTORS else 1e-6 * math.prod(int(side) for side in setting.split("x"))
