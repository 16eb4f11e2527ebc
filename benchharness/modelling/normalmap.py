"""Normal maps: pictures of numbers that turn a mirror's normals, point by point.

Numbers c of a picture, from 0 to 1 and linear, stand for the unit normal

    N = x s + y t + z n,    (x, y, z) = (2 c - 1) / |2 c - 1|

n  interpolated vertex normal, unit
s  tangent: the direction in which u grows on the triangle while v stays, without its part along n, unit
t  bitangent: across n and s, on the side to which v grows

So red is to the right in the picture, green up and blue out of the surface, as in glTF, and (0.5, 0.5, 1) leaves n as it
is. Between pixels' centres the three numbers are bilinear (`benchharness.modelling.texture`), and brought to unit length after.
The tangent is the triangle's own, as in Mitsuba and pbrt; MikkTSpace averages at vertices, which differs by as much as
tangents turn from one triangle to the next. A triangle whose uv enclose no area has no tangent, and keeps n.

Where N reflects the eye's ray to below the triangle, r·g < 0 with its own normal g turned to the eye, r is turned round at it,
r - 2 (r·g) g, as if it had met the triangle once more; the normal is then halfway between the eye and that direction. Whoever
sees the mirror's normals sees this one: methods, Fresnel's reflectance, and references. So no ray of a mapped mirror starts
into the triangle that it leaves, as those about smooth normals may at the outline of a coarse one.
"""

from __future__ import annotations

import numpy as np

from benchharness.modelling.texture import Texture

NO_AREA = 1e-6  # of the product of two sides' lengths in uv: less is the rounding of a line


def check(map: Texture, uv: np.ndarray | None, whose: str) -> None:
    """Raises ValueError for a map on a mesh without uv, and for normals that do not point out of the surface."""
    if uv is None:
        raise ValueError(f"{whose}: it has a normal map, and its mesh no uv; accepted: where in the map each vertex is, [V, 2]")
    inward = into_surface(map.pixels)
    if inward.any():
        i, j = np.argwhere(inward)[0]
        raise ValueError(
            f"{whose}: the pixel in row {i}, column {j} of its normal map is {map.pixels[i, j]}, which points into the "
            "surface; accepted: blue above 0.5"
        )


def into_surface(pixels: np.ndarray) -> np.ndarray:
    """Where a map [H, W, 3] does not point out of the surface, bool [H, W]."""
    return pixels[..., 2] <= 0.5


def without_tangent(uv: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Triangles [F, 3] whose uv [V, 2] enclose no area, in single precision, bool [F]."""
    corners = np.asarray(np.asarray(uv, np.float32), np.float64)[faces]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return np.abs(area) <= NO_AREA * np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
