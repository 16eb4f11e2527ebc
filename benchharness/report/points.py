"""Records -> what the charts and tables show: per scene its points, their place, curves, and the looks of a method.

No drawing and no files here: plain data, so that the PNG, the interactive chart and the page cannot disagree.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from benchharness.report.frontier import PARTIAL, Place, classify, staircase
from benchharness.tables.parameters import parse_params
from benchharness.tables.summary import summary

BUDGETS_MS = ((6.9, "144 Hz"), (11.1, "90 Hz"), (16.7, "60 Hz"))
"""Frame budgets in ms, and the display that has them: 1000 / 144, 1000 / 90, 1000 / 60."""

FLIP_FLOOR = 5e-4
"""Mean FLIP below this is drawn at it: a log axis has no 0, and what is this small is not seen."""

# Told apart with colour-blind eyes: six of Okabe and Ito's, then indigo, wine and olive of Tol's, and grey.
COLOURS = "#0072B2 #D55E00 #009E73 #CC79A7 #E69F00 #56B4E9 #332288 #882255 #999933 #7F7F7F".split()
MARKERS = (
    ("o", "circle"),
    ("s", "square"),
    ("^", "triangle-up"),
    ("D", "diamond"),
    ("v", "triangle-down"),
    ("P", "cross"),
)
DASHES = (("-", "solid"), ("--", "dash"), (":", "dot"))
SHADES = (0.0, -0.35, 0.4, -0.55)
"""Of the members of a family: shares of the way to white, or to black."""


@dataclass(frozen=True)
class Look:
    """Colour as #rrggbb; marker and dash for (matplotlib, plotly); what kind of method it is, "" for one that does not say."""

    colour: str
    marker: tuple[str, str]
    dash: tuple[str, str]
    family: str = ""


@dataclass(frozen=True)
class Point:
    """A method with one set of parameters in one scene, over the frames that are ok.

    time    ms: median of frame_ms, with its interval: that of shade, the only part that is measured in rounds
    error   mean FLIP over frames; spread: its least and largest frame
    noise   mean FLIP that the reference's own noise causes; the error is known within it
    frames  number of frames that the error is a mean of
    label   parameters in which it differs from other rows of its method, as `name=value; name=value`; "" where it is alone
    row     the summary row (`columns.SUMMARY`)
    """

    method: str
    params: str
    time: float
    time_lo: float
    time_hi: float
    error: float
    spread: tuple[float, float]
    noise: float
    frames: int
    label: str
    row: Mapping

    @property
    def name(self) -> str:
        return f"{self.method} ({self.label})" if self.label else self.method


@dataclass
class SceneView:
    """All that the report says about one (scene, detail).

    rows      summary rows, in the order of the records
    points    the rows that have a time and an error; `places` in the same order. A point with fewer frames than
              others (it crashed in some) is a mean over other pictures: drawn, but not ranked
    undrawn   rows without one of them, with the reason in words
    labels    (method, params) -> `Point.label`, of all rows
    records   the records of the scene
    """

    scene: str
    detail: str
    records: list[dict]
    rows: list[dict]
    points: list[Point] = field(default_factory=list)
    places: list[Place] = field(default_factory=list)
    undrawn: list[tuple[dict, str]] = field(default_factory=list)
    labels: dict[tuple[str, str], str] = field(default_factory=dict)

    @property
    def title(self) -> str:
        return f"{self.scene} · {self.detail}" if self.detail else self.scene

    @property
    def noise(self) -> float:
        """The reference's noise as mean FLIP over the frames; 0 where it has none."""
        return max((point.noise for point in self.points), default=0.0)

    @property
    def floor(self) -> float:
        """The least error that a chart tells apart: FLIP_FLOOR, or well inside the reference's noise."""
        return max(FLIP_FLOOR, self.noise / 3.0)

    def drawn(self, error: float) -> float:
        """An error as it is drawn on a log axis."""
        return max(error, self.floor)

    @property
    def frontier(self) -> list[Point]:
        """The points of the drawn frontier, by ascending time."""
        points = self.ranked
        return [points[i] for i in staircase([p.time for p in points], [p.error for p in points])]

    @property
    def ranked(self) -> list[Point]:
        return [p for p, place in zip(self.points, self.places, strict=True) if place.verdict != PARTIAL]

    @property
    def best(self) -> dict[str, Point]:
        """Per method its point of least error, the faster one of equals, in order of appearance."""
        out: dict[str, Point] = {}
        for point in self.points:
            other = out.get(point.method)
            if other is None or (point.error, point.time) < (other.error, other.time):
                out[point.method] = point
        return out

    def within(self, budget_ms: float) -> Point | None:
        """The most accurate point whose time, with its interval, fits the budget."""
        return min((p for p in self.ranked if p.time_hi <= budget_ms), key=lambda p: (p.error, p.time), default=None)


def views(records: Sequence[dict]) -> list[SceneView]:
    """One view per (scene, detail), in order of appearance."""
    groups: dict[tuple[str, str], list[dict]] = {}
    for record in records:
        groups.setdefault((record["scene"] or "", record["detail"] or ""), []).append(record)
    return [_view(scene, detail, rows) for (scene, detail), rows in groups.items()]


def _view(scene: str, detail: str, records: list[dict]) -> SceneView:
    view = SceneView(scene, detail, records, summary(records))
    view.labels = _labels(view.rows)
    for row in view.rows:
        if row["frames_ok"] == 0:
            view.undrawn.append((row, row["status"] + (f": {row['reason']}" if row["reason"] else "")))
        elif row["flip"] is None and row["frames_in_view"] == 0:
            view.undrawn.append((row, "no mirror in view in any frame, so there is nothing to compare"))
        elif row["flip"] is None or not row["frame_ms"]:
            view.undrawn.append((row, f"has no {'flip' if row['flip'] is None else 'frame_ms'}"))
        else:
            mine = [r for r in records if (r["method"], r["params"]) == (row["method"], row["params"])]
            ok = sum(r["status"] == "ok" and r["flip"] is not None for r in mine)
            view.points.append(_point(row, ok, view.labels[row["method"], row["params"] or ""]))
    most = max((point.frames for point in view.points), default=0)
    full = [i for i, point in enumerate(view.points) if point.frames == most]
    ranked = [view.points[i] for i in full]
    found = classify(
        [p.time_lo for p in ranked],
        [p.time_hi for p in ranked],
        [max(p.error - p.noise, 0.0) for p in ranked],
        [p.error + p.noise for p in ranked],
    )
    view.places = [Place(PARTIAL)] * len(view.points)
    for i, place in zip(full, found, strict=True):
        view.places[i] = Place(place.verdict, tuple(full[j] for j in place.by))
    return view


def _labels(rows: Sequence[dict]) -> dict[tuple[str, str], str]:
    """(method, params) -> the parameters in which a row differs from others of its method."""
    methods: dict[str, list[str]] = {}
    for row in rows:
        methods.setdefault(row["method"], []).append(row["params"] or "")
    out = {}
    for method, texts in methods.items():
        given = [{k: v for k, _, v in (part.partition("=") for part in text.split("; ")) if k} for text in texts]
        names = dict.fromkeys(name for each in given for name in each)
        differ = [name for name in names if len({each.get(name) for each in given}) > 1]
        for text, each in zip(texts, given, strict=True):
            out[method, text] = "; ".join(f"{name}={each[name]}" for name in differ if name in each)
    return out


def _point(row: dict, frames: int, label: str) -> Point:
    below = above = 0.0
    if None not in (row["shade_ms"], row["shade_ms_lo"], row["shade_ms_hi"]):
        below, above = row["shade_ms"] - row["shade_ms_lo"], row["shade_ms_hi"] - row["shade_ms"]
    time = row["frame_ms"]
    return Point(
        method=row["method"],
        params=row["params"] or "",
        time=time,
        time_lo=max(time - max(below, 0.0), 1e-6),
        time_hi=time + max(above, 0.0),
        error=row["flip"],
        spread=(row["flip_min"], row["flip_max"]),
        noise=row["reference_noise"] or 0.0,
        frames=frames,
        label=label,
        row=row,
    )


def looks(records: Sequence[dict]) -> dict[str, Look]:
    """Method -> look, the same in every chart of a run: a colour for each family, shades and markers within it. A method that
    names no family has a colour of its own."""
    kinds = {record["method"]: record.get("family") or "" for record in records if record["method"]}
    groups: dict[str, list[str]] = {}
    for method in sorted(kinds, key=lambda method: (kinds[method] or method, method)):
        groups.setdefault(kinds[method] or method, []).append(method)
    n, out = len(COLOURS), {}
    for i, methods in enumerate(groups.values()):
        for k, method in enumerate(methods):
            marker = MARKERS[(i + i // n + k) % len(MARKERS)]
            dash = DASHES[(i // n + k // len(MARKERS)) % len(DASHES)]
            out[method] = Look(_shade(COLOURS[i % n], SHADES[k % len(SHADES)]), marker, dash, kinds[method])
    return out


def _shade(colour: str, amount: float) -> str:
    """A colour, that share of the way to white, or to black if it is negative."""
    end = 255 if amount > 0 else 0
    parts = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return "#" + "".join(f"{round(part + abs(amount) * (end - part)):02X}" for part in parts)


def curves(points: Sequence[Point]) -> list[list[Point]]:
    """The points of one method as curves: along its numeric parameter of most values, one for each rest of the others.

    A method whose parameters do not vary, or only by name, is a curve of one point each.
    """
    values = [parse_params(point.params) for point in points]
    names = {name: None for each in values for name in each}
    numeric = {
        name: len(seen)
        for name in names
        if all(_is_number(each.get(name)) for each in values) and len(seen := {each[name] for each in values}) > 1
    }
    if not numeric:
        return [[point] for point in points]
    along = max(numeric, key=lambda name: numeric[name])
    groups: dict[tuple, list[tuple[float, Point]]] = {}
    for each, point in zip(values, points, strict=True):
        rest = tuple(sorted((name, str(value)) for name, value in each.items() if name != along))
        groups.setdefault(rest, []).append((float(each[along] or 0), point))
    return [[point for _, point in sorted(group, key=lambda pair: pair[0])] for group in groups.values()]


def _is_number(value) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def by_method(points: Sequence[Point]) -> dict[str, list[Point]]:
    """Method -> its points, in order of appearance."""
    out: dict[str, list[Point]] = {}
    for point in points:
        out.setdefault(point.method, []).append(point)
    return out


def by_family(methods: Sequence[str], looks: Mapping[str, Look]) -> dict[str, list[str]]:
    """Family -> its methods, both in the order of their looks; "" for those that name none, which come last."""
    out: dict[str, list[str]] = {}
    order = list(looks)
    for method in sorted(methods, key=lambda method: (looks[method].family == "", order.index(method))):
        out.setdefault(looks[method].family, []).append(method)
    return out


def along_frames(view: SceneView, point: Point, column: str) -> tuple[list[int], list[float]]:
    """Frames and a column's values of one method and its parameters, where there is a number, by ascending frame."""
    pairs = sorted(
        (record["frame"], record[column])
        for record in view.records
        if (record["method"], record["params"] or "") == (point.method, point.params)
        and record["status"] == "ok"
        and None not in (record["frame"], record[column])
    )
    return [frame for frame, _ in pairs], [value for _, value in pairs]
