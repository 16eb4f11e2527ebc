"""What can be said of triangles without knowing where they come from: area, volume, whether they are closed, and what colour is
seen at a point of them. One triangle after the other, float64."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np


def area(vertices, faces) -> float:
    return float(sum(np.linalg.norm(np.cross(vertices[b] - vertices[a], vertices[c] - vertices[a])) / 2 for a, b, c in faces))


def volume(vertices, faces) -> float:
    """Signed: positive where faces go round counter-clockwise from outside."""
    return float(sum(np.dot(vertices[a], np.cross(vertices[b], vertices[c])) / 6 for a, b, c in faces))


def closed(vertices, faces) -> bool:
    """Whether every edge is run along once in each direction; vertices at one place are one."""
    at = [tuple(np.round(v, 6) + 0.0) for v in vertices]
    edges = Counter((at[f[k]], at[f[(k + 1) % 3]]) for f in faces for k in range(3))
    return all(edges[b, a] == times for (a, b), times in edges.items())


def weights(point, corners) -> np.ndarray:
    """Barycentric coordinates of the point of a triangle's plane that is nearest to `point`."""
    u, v, w = corners[1] - corners[0], corners[2] - corners[0], np.asarray(point) - corners[0]
    solved = np.linalg.lstsq(np.stack([u, v], axis=1), w, rcond=None)[0]
    return np.array([1 - solved.sum(), *solved])


def texel(picture, uv, wrap) -> np.ndarray:
    """The texel that contains (u, v), v up and row 0 above."""
    height, width = picture.shape[:2]
    number = []
    for x, count, how in ((uv[0], width, wrap[0]), (1 - uv[1], height, wrap[1])):
        k = math.floor(x * count)
        if how == "clamp":
            k = min(max(k, 0), count - 1)
        elif how == "mirror":
            k %= 2 * count
            k = 2 * count - 1 - k if k >= count else k
        else:
            k %= count
        number.append(k)
    return picture[number[1], number[0]]


def colour_at(parts, point) -> np.ndarray:
    """Base colour times picture times colours of vertices where `parts` pass through a point; of the first triangle there."""
    for part in parts:
        for face in part.faces:
            share = weights(point, part.vertices[face])
            if share.min() < -1e-9 or np.linalg.norm(share @ part.vertices[face] - point) > 1e-6:
                continue
            colour = np.array(part.material.base_colour, np.float64)
            if part.colours is not None:
                colour = colour * (share @ part.colours[face])
            if part.material.picture is not None:
                colour = colour * texel(part.material.picture, share @ part.uv[face], part.material.wrap)
            return colour
    raise AssertionError(f"nothing is at {point}")
