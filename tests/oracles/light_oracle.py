"""Light on triangles that are cut, in float64 NumPy, point by point: by the pieces themselves, and by sheets of samples."""

from __future__ import annotations

import math

import numpy as np

from benchharness.modelling.lightmesh import DEEPEST, LightMesh


def weights_in(point: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Barycentric weights of a point [2] in a triangle [3, 2]."""
    return np.linalg.solve(np.vstack([corners.T, np.ones(3)]), [*point, 1.0])


def on_pieces(mesh: LightMesh, values: np.ndarray, whole: int, weights: np.ndarray) -> np.ndarray:
    """What triangle number `whole` shows at `weights` [N, 3], of values at the corners of the pieces that it was cut into."""
    pieces = np.flatnonzero(mesh.whole == whole)
    corners = mesh.at[pieces] / 2.0**DEEPEST
    out = np.empty((len(weights), values.shape[1]))
    for lane, point in enumerate(np.asarray(weights, np.float64)[:, 1:]):
        found = [weights_in(point, each) for each in corners]
        best = int(np.argmax([w.min() for w in found]))
        assert found[best].min() > -1e-9
        out[lane] = found[best] @ values[mesh.faces[pieces[best]]]
    return out


def on_sheet(samples: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Samples [H, W, 3] at points x, y [N, 2]: linear on the triangles of the grid, whose squares are cut from the upper right
    to the lower left, rows running down."""
    out = np.empty((len(at), 3))
    for lane, (x, y) in enumerate(np.asarray(at, np.float64)):
        j, i = math.floor(x), math.floor(y)
        found = []
        for corners in ([(j, i), (j + 1, i), (j, i + 1)], [(j + 1, i + 1), (j, i + 1), (j + 1, i)]):
            weights = weights_in(np.array([x, y]), np.array(corners, float))
            height, width, _ = samples.shape
            there = [samples[min(row, height - 1), min(column, width - 1)].astype(np.float64) for column, row in corners]
            found.append((weights.min(), weights @ there))
        out[lane] = max(found, key=lambda each: each[0])[1]
    return out
