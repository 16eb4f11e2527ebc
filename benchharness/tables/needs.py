"""The tables of `benchharness needs`: a row per value of a knob, a row per knob with its knee, and a row per object."""

from __future__ import annotations

from benchharness.tables.columns import Kind

NEEDS, NEEDS_SAMPLES, NEEDS_OBJECTS, PAGE = "needs.csv", "needs-samples.csv", "needs-objects.csv", "needs.html"
NAMES = "scene method knob given".split()
NUMBERS: dict[str, Kind] = {"vertices": "integer", "searched": "integer", "flip": "number", "frame_ms": "number"}
"""Of a model: vertices of the scene that is rendered; how many of them, and of those that were added, were searched in all
mirrors, empty for methods that search none; mean FLIP in mirrors over all frames; and the time of a whole frame in which
everything that can move does."""
SAMPLE_KINDS: dict[str, Kind] = {**NUMBERS, **dict.fromkeys(("flip_lo", "flip_hi", "coverage"), "number")}
SAMPLES = [*NAMES, "value", "status", "reason", *SAMPLE_KINDS]
"""`flip_lo` and `flip_hi`: its 95 % interval."""
ENDS = ("least", "knee", "most")
"""The smallest model, the knee and the largest model: the value of the knob there, and NUMBERS."""
KNEE_KINDS: dict[str, Kind] = {f"{end}_{name}": kind for end in ENDS for name, kind in NUMBERS.items()}
KNEES = [*NAMES, *(name for end in ENDS for name in (end, *(f"{end}_{number}" for number in NUMBERS)))]
OBJECT_KINDS: dict[str, Kind] = {
    "vertices": "integer",
    "lost": "number",
    "change": "number",
    "enough_vertices": "integer",
    "enough_flip": "number",
    "flip": "number",
}
OBJECTS = (
    "scene object shows vertices verdict lost method change order failed judge enough enough_vertices enough_flip flip".split()
)
"""Of an object: its vertices; whether it `judges`, is just `seen`, or is needed for `nothing`; FLIP in mirrors between the
reference and that of the scene without it, `lost`; the `method` whose error changes most without it, by how many half-widths of
its interval, the pairs of methods that change places, `order`, and which `failed` without it, and why. By the method `judge`:
the smallest share of its triangles that is `enough`, how many vertices, the error there, and that of the whole scene."""
