"""The tables of `benchharness speed` that charts are drawn of: their files, what their rows are called, and their numbers."""

from __future__ import annotations

from benchharness.tables.columns import Kind

VERTICES, FITS, VERTICES_CHART = "vertices.csv", "vertices-fit.csv", "vertices.png"
VERTICES_KINDS: dict[str, Kind] = {"vertices": "integer", "frame_ms": "number", "flip": "number"}
FITS_KINDS: dict[str, Kind] = {"ms_per_1000_vertices": "number"}
UNREFLECTED = "no reflections"
"""The method of a frame without reflections."""

ITERATIONS, STEPS = "iterations.csv", "iterations-vertices.csv"
PICTURES, ITERATIONS_CHART = "iterations-pictures.npz", "iterations.png"
ITERATIONS_KINDS: dict[str, Kind] = {"mean": "number", "max": "integer"}
STEPS_KINDS: dict[str, Kind] = {"iterations": "integer", "vertices": "integer"}

IMPOSTORS, IMPOSTORS_CHART = "impostors.csv", "impostor-cost.png"
IMPOSTORS_KINDS: dict[str, Kind] = {"ours": "number", "ours_lo": "number", "ours_hi": "number", "paper": "number"}
REFLECTORS, SIZE = "reflectors", "size"
"""Tables in it that are against the number of mirrors, and of pixels."""
FRAME, SHADE = "frame", "shade"
"""Quantities: frames per second, and ms."""
