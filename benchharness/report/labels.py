"""What differs between the points of a method, written beside them where there is room; the page's table has it all."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from matplotlib.figure import Figure

from benchharness.report.points import Look, SceneView

SIZE = 6.0  # of the letters, in points
ADVANCE, LINE = 0.6, 1.2  # a letter's width and a line's height, of that size; no letter that is common is wider

Box = tuple[float, float, float, float]  # left, bottom, right, top, in points


def write(figure: Figure, views: Sequence[SceneView], looks: Mapping[str, Look]) -> None:
    """Writes `Point.label`, its first parameter alone, into the first axes of a figure, one for each view."""
    figure.draw_without_rendering()
    for axes, view in zip(figure.axes, views, strict=False):
        taken: list[Box] = []
        for point in (point for point in view.points if point.label):
            first, *others = point.label.split("; ")
            text, at = first + " ..." * bool(others), (point.time, view.drawn(point.error))
            x, y = axes.transData.transform(at) * (72 / figure.dpi)
            width, height = ADVANCE * SIZE * len(text), LINE * SIZE
            for dx, dy in _places(width, height):
                box = (x + dx, y + dy, x + dx + width, y + dy + height)
                if not any(_meet(box, other) for other in taken):
                    taken.append(box)
                    style = {"fontsize": SIZE, "color": looks[point.method].colour, "clip_on": True}
                    axes.annotate(text, at, (dx, dy), textcoords="offset points", **style)
                    break


def _places(width: float, height: float) -> Iterator[tuple[float, float]]:
    """Where a label's lower left corner may be, from its point: right or left of it, above or below."""
    for dx in (5.0, -5.0 - width):
        yield from ((dx, dy) for dy in (3.0, -3.0 - height))


def _meet(one: Box, other: Box) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]
