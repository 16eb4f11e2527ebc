"""A teapot: a lathed body with foot, lid and knob, a swept spout with an open mouth, a swept handle shaped like an ear.

The type is that of M. Newell's teapot of 1975; the curves are our own. All lengths are shares of the radius of the belly;
z = 0 is what it stands on, the axis is z, the spout points to +x. Three pieces, each closed by itself; the ends of spout
and handle lie inside the body. Normals are those of the true surfaces, from the derivatives of their curves; vertices are
doubled at edges alone: around the bottom, where the belly leaves the foot, around the lid, and at the ends inside the body.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from benchharness.scene import Mesh, merged

Curve = Sequence[tuple[float, float]]

BOTTOM: Curve = ((0.0, 0.0), (0.22, 0.0), (0.44, 0.0), (0.66, 0.0))
FOOT: Curve = ((0.66, 0.0), (0.715, 0.0), (0.735, 0.045), (0.685, 0.075))
BODY: tuple[Curve, ...] = (
    ((0.685, 0.075), (0.87, 0.105), (1.0, 0.24), (1.0, 0.48)),
    ((1.0, 0.48), (1.0, 0.79), (0.875, 0.985), (0.755, 1.13)),
    ((0.755, 1.13), (0.715, 1.1783), (0.665, 1.19), (0.66, 1.135)),
)
LID: tuple[Curve, ...] = (
    ((0.66, 1.135), (0.62, 1.24), (0.22, 1.21), (0.11, 1.29)),
    ((0.11, 1.29), (0.055, 1.33), (0.175, 1.36), (0.175, 1.44)),
    ((0.175, 1.44), (0.175, 1.515), (0.095, 1.56), (0.0, 1.56)),
)
"""Cubic Bezier curves of (radius, z), upward, that go over into each other with one tangent."""
HEIGHT = 1.56
"""Top of the knob."""

SPOUT = np.array(
    [
        # x, z of the middle; half height, half width; direction of the height, degrees from +x towards +z
        (0.72, 0.40, 0.300, 0.250, 96.0),
        (0.98, 0.46, 0.275, 0.225, 104.0),
        (1.20, 0.61, 0.205, 0.170, 118.0),
        (1.36, 0.82, 0.148, 0.128, 128.0),
        (1.49, 1.04, 0.120, 0.108, 138.0),
        (1.63, 1.20, 0.118, 0.105, 146.0),
    ]
)
LIP = 0.022
"""Half the thickness of the wall at the spout's mouth."""
HANDLE = np.array(
    [
        (-0.72, 0.98, 0.075, 0.095, 90.0),
        (-1.00, 1.03, 0.068, 0.090, 94.0),
        (-1.28, 1.02, 0.064, 0.088, 120.0),
        (-1.48, 0.90, 0.062, 0.086, 156.0),
        (-1.53, 0.70, 0.062, 0.086, 192.0),
        (-1.43, 0.50, 0.062, 0.086, 220.0),
        (-1.22, 0.34, 0.064, 0.088, 238.0),
        (-0.98, 0.24, 0.068, 0.090, 252.0),
        (-0.76, 0.20, 0.072, 0.092, 262.0),
    ]
)
REACH = 1.80
"""No point of the pot is further from its axis."""


@dataclass(frozen=True)
class Fineness:
    """How many vertices a teapot has: around body, spout and handle, along each curve of the profile, and along the two."""

    body: int
    curve: int
    spout: int
    spout_rings: int
    handle: int
    handle_rings: int


def teapot(radius: float, fine: Fineness) -> Mesh:
    """A teapot with a belly of `radius` metres, around the origin on z = 0."""
    n = fine.curve
    pieces = [
        # The turn below the belly is the longest: it has half as many steps again.
        _lathed([([BOTTOM], [1]), ([FOOT], [n // 2 + 1]), (BODY, [n + n // 2, n, n]), (LID, [n, n, n])], fine.body),
        _swept(_with_mouth(SPOUT, fine.spout_rings), fine.spout),
        _swept(_along(HANDLE, fine.handle_rings), fine.handle),
    ]
    whole = merged(*pieces)
    return Mesh(radius * whole.vertices, whole.faces, whole.normals)


def _bezier(curve: Curve, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points and derivatives, float64 [N, 2] each, of a cubic Bezier curve."""
    p, t = np.asarray(curve, np.float64), t[:, None]
    s = 1 - t
    points = s**3 * p[0] + 3 * s * s * t * p[1] + 3 * s * t * t * p[2] + t**3 * p[3]
    return points, 3 * (s * s * (p[1] - p[0]) + 2 * s * t * (p[2] - p[1]) + t * t * (p[3] - p[2]))


def _stretch(curves: Sequence[Curve], counts: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """Points and unit normals (radius, z), to the right of the way, of curves that go over into each other smoothly.

    Along each, its `counts` steps share its length and its turn alike: a mirror's picture follows the turn.
    """
    points, normals = [], []
    for curve, count in zip(curves, counts, strict=True):
        t = np.linspace(0, 1, 401)
        p, d = _bezier(curve, t)
        direction = np.unwrap(np.arctan2(d[:, 1], d[:, 0]))
        length, turn = (np.r_[0, np.cumsum(np.abs(x))] for x in (np.hypot(*np.diff(p, axis=0).T), np.diff(direction)))
        share = length / length[-1] + turn / max(turn[-1], 0.3)
        p, d = _bezier(curve, np.interp(np.linspace(0, share[-1], count + 1), share, t))
        n = np.column_stack([d[:, 1], -d[:, 0]])
        skip = 1 if points else 0
        points.append(p[skip:])
        normals.append((n / np.linalg.norm(n, axis=1, keepdims=True))[skip:])
    return np.concatenate(points), np.concatenate(normals)


def _lathed(stretches: Sequence[tuple[Sequence[Curve], Sequence[int]]], around: int) -> Mesh:
    """A closed surface of revolution; smooth within each stretch, whose curves have so many steps each. The first starts
    and the last ends on the axis."""
    angle = 2 * np.pi * np.arange(around) / around
    turn = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    meshes = []
    for curves, counts in stretches:
        p, n = _stretch(curves, counts)
        vertices = np.concatenate([np.column_stack([r * turn, np.full(around, z)]) for r, z in p])
        normals = np.concatenate([np.column_stack([x * turn, np.full(around, y)]) for x, y in n])
        faces = _rings(len(p), around)
        corners = vertices[faces]
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        meshes.append(Mesh(vertices, faces[area > 1e-12], normals))
    return merged(*meshes)


def _rings(count: int, around: int) -> np.ndarray:
    """Faces between rings of vertices, counter-clockwise seen from where the next ring is up and the next vertex right."""
    low = np.arange((count - 1) * around)
    right = low - low % around + (low + 1) % around
    return np.concatenate(
        [np.stack([low, right, right + around], axis=1), np.stack([low, right + around, low + around], axis=1)]
    )


def _along(stations: np.ndarray, count: int) -> np.ndarray:
    """Stations [count, 5] on the spline through `stations`, evenly along the way of the middle."""
    spline, length = _spline(stations)
    return spline(np.linspace(0, length, count))


def _spline(stations: np.ndarray) -> tuple[CubicSpline, float]:
    """Through `stations`, by the way of the middle; and its length."""
    way = np.r_[0, np.hypot(*np.diff(stations[:, :2], axis=0).T).cumsum()]
    return CubicSpline(way, stations), way[-1]


def _with_mouth(stations: np.ndarray, count: int) -> np.ndarray:
    """`count` stations along the spout, which goes on over a rounded lip and back inside, to where it is closed."""
    spline, length = _spline(stations)
    outside, end = _along(stations, count), stations[-1]
    out = np.radians(end[4] - 90)
    out = np.array([np.cos(out), np.sin(out)])
    turn = np.radians(np.linspace(0, 180, 2 * (count // 3) + 1))[1:]
    lip = np.column_stack(
        [
            end[:2] + LIP * np.sin(turn)[:, None] * out,
            end[2:4] - LIP * (1 - np.cos(turn))[:, None],
            np.full(len(turn), end[4]),
        ]
    )
    inside = spline(length - np.array([0.03, 0.09, 0.16]))
    inside[:, 2:4] -= 2 * LIP
    inside[-1, 2:4] *= 0.7
    return np.concatenate([outside, lip, inside])


def _swept(stations: np.ndarray, around: int) -> Mesh:
    """A closed tube through ellipses in the plane y = 0 and across it: stations [N, 5] of x, z, half axes, direction."""
    way = np.r_[0, np.hypot(*np.diff(stations[:, :2], axis=0).T).cumsum() + np.abs(np.diff(stations[:, 2])).cumsum()]
    slope = CubicSpline(way, stations)(way, 1)
    angle = 2 * np.pi * np.arange(around) / around
    c, s = np.cos(angle), np.sin(angle)
    vertices, normals = [], []
    for (x, z, a, b, deg), (dx, dz, da, db, ddeg) in zip(stations, slope, strict=True):
        turn, dturn = np.radians(deg), np.radians(ddeg)
        up, dup = np.array([np.cos(turn), 0, np.sin(turn)]), dturn * np.array([-np.sin(turn), 0, np.cos(turn)])
        side = np.array([0.0, 1.0, 0.0])
        vertices.append([x, 0, z] + a * np.outer(c, up) + b * np.outer(s, side))
        along = np.array([dx, 0, dz]) + np.outer(c, da * up + a * dup) + np.outer(s, db * side)
        across = -a * np.outer(s, up) + b * np.outer(c, side)
        n = np.cross(across, along)
        normals.append(n / np.linalg.norm(n, axis=1, keepdims=True))
    v, n, f = np.concatenate(vertices), np.concatenate(normals), _rings(len(stations), around)

    # Flat ends, with vertices of their own.
    ends = []
    for ring, order in ((vertices[0], -1), (vertices[-1], 1)):
        k = np.arange(around)
        fan = np.stack([np.full(around, around), k, (k + 1) % around], axis=1)[:, ::order]
        ends.append(Mesh(np.concatenate([ring, ring.mean(axis=0)[None]]), fan))
    tube = merged(Mesh(v, f, n), *ends)
    corners = tube.vertices[tube.faces]
    volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    return tube if volume > 0 else Mesh(tube.vertices, tube.faces[:, ::-1], -tube.normals)
