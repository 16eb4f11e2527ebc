"""What differs between the points of a method, written beside them where there is room; the page's table has it all."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

from matplotlib.figure import Figure

from benchharness.report.points import Look, SceneView

SIZE = 6.0  # of the letters, in points
ADVANCE, LINE = 0.6, 1.2  # a letter's width and a line's height, of that size; no letter that is common is wider

Box = tuple[float, float, float, float]  # left, bottom, right, top, in points


def write(figure: Figure, views: Sequence[SceneView], looks: Mapping[str, Look]) -> None:
    """Writes as much of `Point.label` as tells it from its method's others into the first axes of a figure, one per view."""
    figure.draw_without_rendering()
    for axes, view in zip(figure.axes, views, strict=False):
        taken: list[Box] = []
        left, right = (x * (72 / figure.dpi) for x in axes.bbox.intervalx)
        for point in (point for point in view.points if point.label):
            others = [other.label for other in view.points if other.method == point.method and other is not point]
            text, at = shortened(point.label, others), (point.time, view.drawn(point.error))
            x, y = axes.transData.transform(at) * (72 / figure.dpi)
            width, height = ADVANCE * SIZE * len(text), LINE * SIZE
            for dx, dy in _places(width, height):
                box = (x + dx, y + dy, x + dx + width, y + dy + height)
                if left <= box[0] and box[2] <= right and not any(_meet(box, other) for other in taken):
                    taken.append(box)
                    style = {"fontsize": SIZE, "color": looks[point.method].colour, "clip_on": True}
                    axes.annotate(text, at, (dx, dy), textcoords="offset points", **style)
                    break


def shortened(label: str, others: Sequence[str]) -> str:
    """The fewest parameters of a label that none of the others has all of, and dots for the rest."""
    parts, taken = label.split("; "), [set(other.split("; ")) for other in others]
    for count in range(1, len(parts)):
        for few in combinations(parts, count):
            if not any(other.issuperset(few) for other in taken):
                return "; ".join(few) + " ..."
    return label


def _places(width: float, height: float) -> Iterator[tuple[float, float]]:
    """Where a label's lower left corner may be, from its point: right or left of it, above or below."""
    for dx in (5.0, -5.0 - width):
        yield from ((dx, dy) for dy in (3.0, -3.0 - height))


def _meet(one: Box, other: Box) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]
