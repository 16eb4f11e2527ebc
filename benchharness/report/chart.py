"""The charts as files: PNG to look at, SVG to print. See `interactive` for the same charts on the page.

Frontier: x is the time per frame, y the mean FLIP inside the mirror, both log; less is better in both. A method is a
curve through its swept parameters. Path: where the time goes, and both along the frames of the camera path.
"""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, MaxNLocator

from benchharness.report import labels
from benchharness.report.frontier import ON, UNDECIDED
from benchharness.report.points import BUDGETS_MS, Look, Point, SceneView, along_frames, by_family, by_method, curves

PARTS = (("gbuffer_ms", "G-buffer", "#B8C4CE"), ("update_ms", "update", "#E69F00"), ("shade_ms", "shade", "#0072B2"))
"""Parts of a frame: column, name, colour. What is left of frame_ms is compositing."""
REST = ("composite", "#DDDDDD")

STYLE: Any = {
    "font.size": 10,
    "axes.titlesize": 12,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#6B7280",
    "axes.labelcolor": "#1F2933",
    "xtick.color": "#4B5563",
    "ytick.color": "#4B5563",
    "legend.frameon": False,
    "grid.color": "#E5E7EB",
    "svg.fonttype": "none",
    "svg.hashsalt": "benchharness",
    "figure.facecolor": "white",
}

TIME_AXIS = "time per frame in ms   (← less is better)"
ERROR_AXIS = "mean FLIP in the mirror   (↓ less is better)"


Span = tuple[float, float]


def limits(view: SceneView) -> tuple[Span, Span]:
    """(least, most) ms and (least, most) FLIP of the frontier chart: the points, their bars, and the frame budgets."""
    times = [t for p in view.points for t in (p.time_lo, p.time_hi)] + [ms for ms, _ in BUDGETS_MS]
    errors = [view.drawn(e) for p in view.points for e in (p.error, *p.spread)]
    errors += [view.noise] if view.noise > 0 else []
    return (min(times) / 1.4, max(times) * 1.4), (min(errors) / 1.5, min(max(errors) * 1.6, 1.5))


def frontier_chart(view: SceneView, looks: Mapping[str, Look]) -> Figure:
    """The frontier of one scene that has points."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.2, 5.8), layout="constrained")
        axes = figure.add_subplot()
        axes.set(xlabel=TIME_AXIS, ylabel=ERROR_AXIS)
        axes.set_title(f"{view.title}: speed against accuracy")
        _frontier(axes, view, looks, *limits(view))
        _explain(figure, [view], looks)
        labels.write(figure, [view], looks)
    return figure


def overview(views: Sequence[SceneView], looks: Mapping[str, Look]) -> Figure:
    """The frontiers of several scenes that have points, side by side at one scale."""
    (left, bottom), (right, top) = (
        tuple(pick(values) for values in zip(*((x[k], y[k]) for x, y in map(limits, views)), strict=True))
        for k, pick in ((0, min), (1, max))
    )
    columns = min(len(views), 2)
    rows = math.ceil(len(views) / columns)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(5.1 * columns + 2.4, 3.6 * rows + 0.9), layout="constrained")
        grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        for axes, view in zip(grid.flat, views, strict=False):
            axes.set_title(view.title)
            _frontier(axes, view, looks, (left, right), (bottom, top))
        for axes in grid.flat[len(views) :]:
            axes.set_axis_off()
        figure.supylabel(ERROR_AXIS, fontsize=10)
        for axes in grid[-1]:
            axes.set_xlabel(TIME_AXIS)
        _explain(figure, views, looks)
        labels.write(figure, views, looks)
    return figure


def _frontier(axes: Axes, view: SceneView, looks: Mapping[str, Look], x: Span, y: Span) -> None:
    """Draws the points of a scene, their frontier and what is behind them."""
    axes.set(xscale="log", yscale="log", xlim=x, ylim=y)
    axes.grid(True, which="major")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(FuncFormatter(_minor))
    _background(axes, view)
    places = dict(zip(map(id, view.points), view.places, strict=True))
    for method, points in by_method(view.points).items():
        _method(axes, view, points, looks[method], {id(p): places[id(p)].verdict for p in points})


def _explain(figure: Figure, views: Sequence[SceneView], looks: Mapping[str, Look]) -> None:
    """The legend of all methods, by family, and what the marks mean."""
    handles = {name: handle for axes in figure.axes for handle, name in zip(*axes.get_legend_handles_labels(), strict=True)}
    families = by_family([name for name in handles if name in looks], looks)
    lines, names = [], []
    for family, methods in families.items():
        if family:
            lines.append(Line2D([], [], ls=""))
            names.append(family)
        lines += [handles[method] for method in methods]
        names += methods
    others = [name for name in handles if name not in looks]
    lines, names = [*(handles[name] for name in others), *lines], [*others, *names]
    legend = figure.legend(lines, names, loc="outside right upper", title="method", alignment="left", fontsize=8.5)
    for text in legend.get_texts():
        if text.get_text() in families:
            text.set_fontweight("bold")
    note = "Filled: on the frontier. Half: undecided, intervals overlap. Hollow: dominated, or not in all frames.\n"
    note += "Bars: 95 % interval of the time; least and largest frame's error."
    if floors := [view.floor for view in views if any(p.error < view.floor for p in view.points)]:
        note += f" Errors below {max(floors):g} are drawn there."
    figure.supxlabel(note, x=0.02, ha="left", fontsize=8.5, color="#6B7280")


def _minor(value: float, _) -> str:
    """Labels at 2 and 5 of every decade."""
    digit = value / 10 ** math.floor(math.log10(value)) if value > 0 else 0
    return f"{value:g}" if round(digit) in (2, 5) else ""


def _background(axes: Axes, view: SceneView) -> None:
    """Frame budgets, the reference's noise, and the line of the frontier."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    crowded = right > 100 * left
    for ms, hertz in BUDGETS_MS:
        axes.axvline(ms, color="#9CA3AF", lw=0.9, ls=(0, (4, 3)), zorder=1)
        said, turned = (f"{hertz}  ", 90) if crowded else (f" {ms:g} ms\n {hertz}", 0)
        axes.text(
            ms,
            top,
            said,
            fontsize=8,
            color="#6B7280",
            va="top",
            ha="right" if crowded else "left",
            rotation=turned,
            clip_on=True,
        )
    if view.noise > 0:
        axes.axhspan(bottom, view.noise, color="#F3E8D2", zorder=0)
        said = "  reference's noise: not ranked below"
        axes.text(left, view.noise, said, fontsize=8, va="top", color="#8A6D3B")
    if line := view.frontier:
        x, y = [p.time for p in line], [view.drawn(p.error) for p in line]
        x, y = [x[0], *x, right], [top, *y, y[-1]]
        axes.step(x, y, where="post", color="#C3CAD3", lw=4, zorder=1.5, label="frontier")


def _method(axes: Axes, view: SceneView, points: list[Point], look: Look, verdicts: Mapping[int, str]) -> None:
    for curve in curves(points):
        x, y = [p.time for p in curve], [view.drawn(p.error) for p in curve]
        axes.plot(x, y, color=look.colour, ls=look.dash[0], lw=1.4, alpha=0.8, zorder=2)
    for point in points:
        y = view.drawn(point.error)
        axes.errorbar(
            point.time,
            y,
            xerr=[[point.time - point.time_lo], [point.time_hi - point.time]],
            yerr=[[max(y - view.drawn(point.spread[0]), 0)], [max(view.drawn(point.spread[1]) - y, 0)]],
            color=look.colour,
            lw=0.8,
            alpha=0.45,
            fmt="none",
            zorder=2,
        )
        verdict = verdicts[id(point)]
        fill = {ON: "full", UNDECIDED: "left"}.get(verdict, "none")
        axes.plot(
            [point.time],
            [y],
            color=look.colour,
            marker=look.marker[0],
            ms=7.5,
            fillstyle=fill,
            ls="",
            markerfacecoloralt="white",
            markeredgewidth=1.3,
            zorder=3,
        )
    axes.plot([], [], color=look.colour, marker=look.marker[0], ls=look.dash[0], ms=6.5, label=points[0].method)


def path_chart(view: SceneView, looks: Mapping[str, Look]) -> Figure:
    """Where the time goes and how time and error run along the camera path, each method at its least error."""
    best = list(view.best.values())
    bars = 0.26 * max(len(best), 3) + 1.2
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(11.0, bars + 3.6), layout="constrained")
        grid = figure.add_gridspec(2, 2, height_ratios=[bars, 3.2])
        split, once = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[0, 1])
        _split(split, best)
        prepare = [p.row["prepare_ms"] or math.nan for p in best]
        once.barh([p.method for p in best], prepare, color="#009E73", height=0.6)
        once.set_title("Once per scene: prepare", pad=26)
        once.set(xlabel="ms, log", xscale="log")
        for axes in (split, once):
            axes.invert_yaxis()
            axes.grid(True, axis="x")
            axes.set_axisbelow(True)
        once.tick_params(labelleft=False)
        _along(figure.add_subplot(grid[1, 0]), view, looks, "frame_ms", "Frame time along the path", "ms, log")
        errors = figure.add_subplot(grid[1, 1])
        _along(errors, view, looks, "flip", "Error along the path", "mean FLIP, log")
        if view.noise > 0:
            errors.axhspan(errors.get_ylim()[0], view.noise, color="#F3E8D2", zorder=0)
        figure.suptitle(f"{view.title}: each method at its least error", x=0.01, ha="left", fontweight="bold")
        handles, names = errors.get_legend_handles_labels()
        figure.legend(handles, names, loc="outside right lower", title="method", alignment="left")
    return figure


def _along(axes: Axes, view: SceneView, looks: Mapping[str, Look], column: str, title: str, ylabel: str) -> None:
    for point in view.best.values():
        frames, values = along_frames(view, point, column)
        values = [view.drawn(value) for value in values] if column == "flip" else values
        look = looks[point.method]
        line = {"color": look.colour, "marker": look.marker[0], "ls": look.dash[0], "ms": 4, "lw": 1.3}
        axes.plot(frames, values, label=point.method, **line)
    axes.set(title=title, xlabel="frame", ylabel=ylabel, yscale="log")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=8))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(FuncFormatter(_minor))
    axes.grid(True)


def parts(point: Point) -> list[float]:
    """Milliseconds of PARTS and of the rest of the frame; 0 for a part that a method does not have."""
    values = [point.row[column] or 0.0 for column, _, _ in PARTS]
    return [*values, max(point.time - sum(values), 0.0)]


def _split(axes: Axes, best: list[Point]) -> None:
    left = [0.0] * len(best)
    for k, (name, colour) in enumerate([*((name, colour) for _, name, colour in PARTS), REST]):
        widths = [parts(point)[k] for point in best]
        axes.barh([p.method for p in best], widths, left=left, color=colour, height=0.6, label=name)
        left = [a + b for a, b in zip(left, widths, strict=True)]
    axes.set_title("Median (update: when something moves)", pad=26)
    axes.set_xlabel("ms")
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, fontsize=8.5, handlelength=1, borderpad=0)


def save(figure: Figure, stem: Path) -> list[Path]:
    """`stem`.png (150 dpi) and `stem`.svg, the same bytes for the same data."""
    stem.parent.mkdir(parents=True, exist_ok=True)
    png, svg = stem.with_suffix(".png"), stem.with_suffix(".svg")
    with mpl.rc_context(STYLE):
        figure.savefig(png, dpi=150, metadata={"Software": "benchharness"})
        figure.savefig(svg, metadata={"Date": None, "Creator": "benchharness"})
    return [png, svg]


def inline(figure: Figure) -> Markup:
    """A chart as SVG that stands in a page."""
    out = io.StringIO()
    figure.savefig(out, format="svg")
    text = out.getvalue()
    return Markup(text[text.index("<svg") :])
