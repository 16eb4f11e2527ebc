"""What the reflection points that a method found are worth: screen distances to the true ones, of a sample of vertices."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from benchharness.api import Frame, Reflection
from benchharness.kernels.pixels import WRONG_PX
from benchharness.measure import metrics, truth
from benchharness.measure.runup import RUN_UP
from benchharness.scene import Scene

SAMPLE = 150  # vertices per reflector whose true reflection point is solved for


def errors(scene: Scene, size: tuple[int, int], frames: Sequence[Frame], answers: Sequence[Reflection]) -> dict[str, Any]:
    """The columns of results.csv that tell of vertices, of the last of `frames`, which follow each other and were answered.

    Empty but for `iterations` and `converged_ratio` where no vertex converged.
    """
    found = answers[-1].vertices
    assert found is not None
    count = scene.vertices
    iterations = np.array(found.iterations)
    searched = iterations > 0
    converged = np.array(found.converged)
    record: dict[str, Any] = {
        "iterations_mean": float(iterations[searched].mean()) if searched.any() else None,
        "iterations_max": int(iterations.max()) if searched.any() else None,
        "converged_ratio": converged_share(converged, np.array(found.region), iterations),
    }
    off, moved = [], []
    for number in range(len(scene.reflectors)):
        here = np.flatnonzero(converged[number * count : (number + 1) * count])
        if not len(here):
            continue
        sample = here[:: max(1, len(here) // SAMPLE)]
        tracks = [_off(scene, size, f, answer, number, sample) for f, answer in zip(frames, answers, strict=True)]
        off.append(tracks[-1][0])
        moved.append(np.stack([track[1] for track in tracks]))
    if off:
        distance = np.concatenate(off)
        known = distance[np.isfinite(distance)]
        record["residual_px"] = float(np.median(known)) if len(known) else None
        record["residual_px_max"] = float(known.max()) if len(known) else None
        record["wrong_ratio"] = float((known > WRONG_PX).mean()) if len(known) else None
        if len(frames) == RUN_UP + 1:
            record["jitter_px"] = metrics.jitter_px(np.concatenate(moved, axis=1))
    return record


def _off(
    scene: Scene, size: tuple[int, int], frame: Frame, answer: Reflection, number: int, sample: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Pixels between found and true R [N], and V' on the screen less the true one's [N, 2]; NaN where none is known."""
    lanes = number * scene.vertices + sample
    assert answer.vertices is not None
    R, virtual = (np.array(a, np.float64).T[lanes] for a in (answer.vertices.R, answer.vertices.virtual))
    usable = np.array(answer.vertices.converged)[lanes]
    seen = truth.Mirror(scene, frame.time, size, number).roots(sample, R, virtual, usable)
    return np.linalg.norm(seen.found - seen.true, axis=1), seen.virtual - seen.image


def converged_share(converged: np.ndarray, region: np.ndarray, iterations: np.ndarray) -> float | None:
    """Share that converged of the vertices that were searched and are not hidden, None if there are none; [N] each, as in
    `benchharness.api.Vertices`. A search that came to nothing leaves its vertex in region 0."""
    counted = (region == 1) | ((region == 0) & (iterations > 0))
    return float(converged[counted].mean()) if counted.any() else None
