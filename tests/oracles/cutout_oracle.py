"""Where a surface with holes is, point by point, in float64 NumPy: its alpha there, and whether triangles cover it."""

from __future__ import annotations

from collections import Counter

import numpy as np
from oracles.mesh_oracle import texel
from oracles.texture_oracle import looked_up


def alpha(picture: np.ndarray, wrap: tuple[str, str], uv: np.ndarray, nearest: bool = False) -> np.ndarray:
    """The picture [H, W] at uv [N, 2], [N]."""
    if nearest:
        return np.array([texel(picture, point, wrap) for point in uv], float)
    return looked_up(np.repeat(picture[:, :, None], 3, axis=2), wrap, uv)[:, 0]


def on_both_sides(there, uv: np.ndarray, pixels: tuple[int, int], reach: float) -> np.ndarray:
    """Near which points [N, 2] the surface both is and is not, within `reach` pixels of a picture of so many rows and columns;
    `there` says of points whether it is. Asked on five circles around each."""
    angle = np.arange(32) * np.pi / 16
    circle = np.column_stack([np.cos(angle), np.sin(angle)]) / [pixels[1], pixels[0]]
    around = np.concatenate([radius * circle for radius in reach * np.arange(6) / 5])
    return np.array([len(set(there(point + around).tolist())) == 2 for point in uv], bool)


def interpolated(at: np.ndarray, faces: np.ndarray, values: np.ndarray, points: np.ndarray, slack: float = 1e-9) -> np.ndarray:
    """Values of vertices [V, C] at points [N, 2] of the triangles that lie flat at `at` [V, 2]; NaN where there is none."""
    out = np.full((len(points), values.shape[1]), np.nan)
    for a, b, c in faces:
        u, v, w = at[b] - at[a], at[c] - at[a], points - at[a]
        area = u[0] * v[1] - u[1] * v[0]
        if abs(area) < 1e-15:
            continue
        second, third = (w[:, 0] * v[1] - w[:, 1] * v[0]) / area, (u[0] * w[:, 1] - u[1] * w[:, 0]) / area
        inside = (second >= -slack) & (third >= -slack) & (second + third <= 1 + slack)
        share = np.column_stack([1 - second - third, second, third])[inside]
        out[inside] = share @ values[[a, b, c]]
    return out


def open_edges(places: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Both ends of every edge that has one triangle alone, places [E, 2, 3]; vertices at exactly one place are one."""
    at = [tuple(place) for place in (places + 0.0).tolist()]
    ends = Counter(frozenset((at[f[k]], at[f[k - 1]])) for f in faces for k in range(3))
    assert all(len(edge) == 2 for edge in ends), "a triangle has two corners at one place"
    assert max(ends.values()) <= 2, "an edge has three triangles"
    return np.array([sorted(edge) for edge, times in ends.items() if times == 1]).reshape(-1, 2, 3)
