"""Records and the files of a run folder.

A record is a dict with the keys of COLUMNS, one per scene, frame, method and parameters. This module alone knows how
records become CSV, what the files of a run are called, and where a run came from.
"""

from __future__ import annotations

COLUMNS = ["run", "config", "scene", "detail", "frame", "method", "params", "variant", "status", "reason", "vertices", "triangles", "reflectors", "reflector_px", "prepare_ms", "update_ms", "shade_ms", "shade_ms_lo", "shade_ms_hi", "kernel_ms", "first_ms", "gbuffer_ms", "frame_ms", "rmse", "relmse", "flip", "flip_p95", "coverage", "nonfinite_px", "distance_err", "residual_px", "converged_ratio", "wrong_ratio", "iterations_mean", "iterations_max", "temporal_diff", "jitter_px", "reference_lighting", "reference_spp", "reference_noise", "config_hash", "method_hash", "scene_hash", "environment", "calibration_ms", "ppd", "counters"]
"""Columns of results.csv, in order. `counters` is the canonical `name=value` list; `calibration_ms` the fixed kernel."""
