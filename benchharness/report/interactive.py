"""The charts of `chart` for the page: plotly figures, as HTML without the library itself (the page has it once)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from html import escape
from typing import Any

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from benchharness.report.chart import ERROR_AXIS, PARTS, REST, TIME_AXIS, limits, parts
from benchharness.report.frontier import ON, PARTIAL, UNDECIDED, Place
from benchharness.report.points import BUDGETS_MS, Look, Point, SceneView, along_frames, by_family, by_method, curves

LAYOUT: Any = {
    "template": "none",
    "font": {"family": "system-ui, sans-serif", "size": 13, "color": "#1F2933"},
    "margin": {"l": 70, "r": 20, "t": 30, "b": 60},
    "hoverlabel": {"align": "left"},
    "legend": {"itemsizing": "constant", "groupclick": "togglegroup"},
}
GRID: Any = {"gridcolor": "#E5E7EB", "zeroline": False, "linecolor": "#6B7280", "ticks": "outside"}
LOG: Any = {**GRID, "type": "log", "dtick": "D2", "exponentformat": "none"}

TITLES = [
    "Median ms (update: when something moves)",
    "Once per scene: prepare ms",
    "Frame ms along the path",
    "FLIP along the path",
]


def html(figure: go.Figure, name: str) -> str:
    """The figure as a <div> with the id `name` and its script."""
    return figure.to_html(
        full_html=False, include_plotlyjs=False, div_id=name, config={"displaylogo": False, "responsive": True}
    )


def frontier_figure(view: SceneView, looks: Mapping[str, Look]) -> go.Figure:
    """As `chart.frontier_chart`; the marker of an undecided point has a dot, of a dominated one is hollow. A method is one
    trace, so that a press on its name hides all of it."""
    (left, right), (bottom, top) = limits(view)
    figure = go.Figure(layout=LAYOUT)
    figure.update_layout(height=560, legend={"groupclick": "toggleitem", "tracegroupgap": 4})
    figure.update_xaxes(title=TIME_AXIS, range=_log10(left, right), **LOG)
    figure.update_yaxes(title=ERROR_AXIS, range=_log10(bottom, top), **LOG)
    _background(figure, view, left, bottom)
    if line := view.frontier:
        x = [line[0].time, *(p.time for p in line), right]
        y = [top, *(view.drawn(p.error) for p in line), view.drawn(line[-1].error)]
        look = {"color": "#C3CAD3", "width": 5, "shape": "hv"}
        figure.add_scatter(x=x, y=y, mode="lines", line=look, name="frontier", hoverinfo="skip")
    places = {id(point): place for point, place in zip(view.points, view.places, strict=True)}
    points = by_method(view.points)
    for methods in by_family(list(points), looks).values():
        for method in methods:
            _method(figure, view, curves(points[method]), looks[method], places)
    return figure


def _log10(low: float, high: float) -> list[float]:
    return [math.log10(low), math.log10(high)]


def _background(figure: go.Figure, view: SceneView, left: float, bottom: float) -> None:
    """Frame budgets and the reference's noise. On a log axis shapes are at values, annotations at their log10."""
    text = {"showarrow": False, "font": {"size": 11, "color": "#6B7280"}}
    for ms, hertz in BUDGETS_MS:
        line = {"color": "#9CA3AF", "width": 1, "dash": "dash"}
        figure.add_shape(type="line", x0=ms, x1=ms, y0=0, y1=1, yref="paper", line=line, layer="below")
        label = f"{ms:g} ms · {hertz}"
        figure.add_annotation(x=math.log10(ms), y=1, yref="paper", yanchor="bottom", text=label, **text)
    if view.noise > 0:
        band = {"x0": 0, "x1": 1, "xref": "paper", "y0": bottom, "y1": view.noise}
        figure.add_shape(type="rect", fillcolor="#F3E8D2", line_width=0, layer="below", **band)
        at = {"x": math.log10(left), "y": math.log10(view.noise), "xanchor": "left", "yanchor": "top"}
        figure.add_annotation(text="reference's noise: not ranked below", **at, **text)


def _method(figure: go.Figure, view: SceneView, curves_: list[list[Point]], look: Look, places: Mapping[int, Place]) -> None:
    """The curves of a method, with a gap between them."""
    gapped = [point for curve in curves_ for point in (*curve, None)][:-1]

    def of(value: Callable[[Point], Any], gap: Any = None) -> list:
        return [gap if point is None else value(point) for point in gapped]

    suffix = {ON: "", UNDECIDED: "-open-dot"}
    figure.add_scatter(
        x=of(lambda p: p.time),
        y=of(lambda p: view.drawn(p.error)),
        mode="lines+markers+text",
        name=curves_[0][0].method,
        legendgroup=look.family or curves_[0][0].method,
        legendgrouptitle_text=escape(look.family) or None,
        line={"color": look.colour, "dash": look.dash[1], "width": 1.6},
        marker={
            "symbol": of(lambda p: look.marker[1] + suffix.get(places[id(p)].verdict, "-open"), look.marker[1]),
            "size": 11,
        },
        text=of(lambda p: escape(p.label).replace("; ", "<br>"), ""),
        textposition="top right",
        textfont={"size": 9, "color": look.colour},
        error_x={
            "array": of(lambda p: p.time_hi - p.time),
            "arrayminus": of(lambda p: p.time - p.time_lo),
            "thickness": 1,
            "width": 2,
        },
        error_y={
            "array": of(lambda p: max(view.drawn(p.spread[1]) - view.drawn(p.error), 0.0)),
            "arrayminus": of(lambda p: max(view.drawn(p.error) - view.drawn(p.spread[0]), 0.0)),
            "thickness": 0.8,
            "width": 0,
        },
        hovertext=of(lambda p: _hover(view, p, places[id(p)]), ""),
        hovertemplate="%{hovertext}<extra></extra>",
    )


def _hover(view: SceneView, point: Point, place: Place) -> str:
    lines = [
        f"<b>{escape(point.method)}</b> {escape(point.label)}",
        f"frame {point.time:.3g} ms [{point.time_lo:.3g}, {point.time_hi:.3g}]",
        f"FLIP {point.error:.3g}, frames {point.spread[0]:.3g} to {point.spread[1]:.3g}",
        standing(view, place),
    ]
    return "<br>".join(lines)


def standing(view: SceneView, place: Place) -> str:
    """A place in words: "dominated by box", "undecided against newton (h_max=0.1) and 2 more"."""
    first = next(iter(place.by), None)
    if first is None:
        return "not in all frames: not ranked" if place.verdict == PARTIAL else place.verdict
    rest = f" and {len(place.by) - 1} more" if len(place.by) > 1 else ""
    word = "against" if place.verdict == UNDECIDED else "by"
    return f"{place.verdict} {word} {view.points[first].name}{rest}"


def path_figure(view: SceneView, looks: Mapping[str, Look]) -> go.Figure:
    """As `chart.path_chart`."""
    best = list(view.best.values())
    names = [p.method for p in best]
    bars = 28 * max(len(best), 3) + 60
    figure = make_subplots(
        rows=2,
        cols=2,
        row_heights=[bars, 330],
        vertical_spacing=90 / (bars + 420),
        horizontal_spacing=0.1,
        subplot_titles=TITLES,
    )
    figure.update_layout(LAYOUT, height=bars + 470, barmode="stack", margin={"l": 160, "r": 20, "t": 40, "b": 50})
    figure.update_xaxes(**GRID)
    figure.update_yaxes(**GRID)
    for k, (name, colour) in enumerate([*((name, colour) for _, name, colour in PARTS), REST]):
        figure.add_bar(
            x=[parts(p)[k] for p in best],
            y=names,
            orientation="h",
            name=name,
            marker_color=colour,
            row=1,
            col=1,
            legendgroup="parts",
            legendgrouptitle_text="part of a frame",
        )
    prepare = [p.row["prepare_ms"] for p in best]
    figure.add_bar(x=prepare, y=names, orientation="h", name="prepare", marker_color="#009E73", showlegend=False, row=1, col=2)
    figure.update_yaxes(autorange="reversed", row=1)
    figure.update_yaxes(showticklabels=False, row=1, col=2)
    figure.update_xaxes(type="log", dtick=1, row=1, col=2)
    figure.update_xaxes(title="frame", row=2)
    figure.update_yaxes(type="log", dtick="D2", row=2)
    for point in best:
        look = looks[point.method]
        for col, column in ((1, "frame_ms"), (2, "flip")):
            frames, values = along_frames(view, point, column)
            figure.add_scatter(
                x=frames,
                y=[view.drawn(v) for v in values] if column == "flip" else values,
                row=2,
                col=col,
                mode="lines+markers",
                line={"color": look.colour, "dash": look.dash[1], "width": 1.6},
                marker={"symbol": look.marker[1], "size": 7},
                name=point.method,
                legendgroup=f"method {point.method}",
                showlegend=col == 1,
                hovertemplate=f"{escape(point.name)}<br>frame %{{x}}: %{{y:.3g}}<extra></extra>",
            )
    return figure
