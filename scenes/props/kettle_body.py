"""The kettle: its metal body with lid, which is the mirror, and what is attached to it.

The body is the surface of revolution with the support function

    h(χ) = c0 + c2 cos 2χ + c3 cos 3χ,    p(χ, φ) = centre + h n + h' t

χ the angle between the outward unit normal n and the axis, φ its azimuth, t = ∂n/∂χ. So the normal is known exactly
where the point is, the meridian's radius of curvature is h + h'' = c0 - 3 c2 cos 2χ - 8 c3 cos 3χ, and the body is smooth
and strictly convex where that is positive. c2 < 0 makes it squat, c3 > 0 moves the belly down by 3 c3 and draws the
shoulders straight. The distance from a point q to the body is the maximum of n · (q - centre) - h over all n.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from benchharness.scene import Mesh, Object, Reflector, merged

from ..props.bowls import ALUMINIUM_ETA, ALUMINIUM_K
from ..props.shapes import Colour, arc, lathe, placed, tube, unit_sphere

SUPPORT = {0: 0.1380, 2: -0.0160, 3: 0.0050}
"""c_k: metres, by order k. The body is 0.31 m wide and 0.244 m high."""
FOOT = 0.1170
"""From the body's lowest point up to `centre`, metres: h(180°)."""
SEGMENTS, RINGS = 90, 45
"""Vertices around the body, and from pole to pole, at equal angles between their normals."""
SPOUT_DEG = 25.0
"""Azimuth of the spout; the handle's bow stands in the same plane."""

WOOD: Colour = (0.20, 0.075, 0.035)
METAL: Colour = (0.42, 0.42, 0.43)


def support(chi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """h and h' at the angles χ from the axis, radians; any shape."""
    value = sum(c * np.cos(k * chi) for k, c in SUPPORT.items())
    slope = sum(-k * c * np.sin(k * chi) for k, c in SUPPORT.items())
    return np.asarray(value), np.asarray(slope)


def surface(n: np.ndarray) -> np.ndarray:
    """Points [N, 3] of the body about the origin where its outward unit normals are `n` [N, 3]."""
    away = np.hypot(n[:, 0], n[:, 1])
    value, slope = support(np.arctan2(away, n[:, 2]))
    side = n[:, :2] / np.maximum(away, 1e-300)[:, None]
    tangent = np.column_stack([n[:, 2:] * side, -away])
    return value[:, None] * n + slope[:, None] * tangent


def distance(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Signed distance [N] of points `q` [N, 3] to the body about the origin, negative inside, and the normals [N, 3] of
    the nearest points of its surface. Good to 1e-12 m, but for points near the evolute, deep inside."""
    away = np.hypot(q[:, 0], q[:, 1])
    table = np.linspace(0, np.pi, 721)
    h = support(table)[0]
    chi = table[np.argmax(np.outer(away, np.sin(table)) + np.outer(q[:, 2], np.cos(table)) - h, axis=1)]
    # Newton's method for the maximum of f = away sin χ + z cos χ - h.
    for _ in range(4):
        first = away * np.cos(chi) - q[:, 2] * np.sin(chi) - support(chi)[1]
        second = -away * np.sin(chi) - q[:, 2] * np.cos(chi) - sum(-k * k * c * np.cos(k * chi) for k, c in SUPPORT.items())
        chi = np.clip(chi - first / np.minimum(second, -1e-6), 0, np.pi)
    value = away * np.sin(chi) + q[:, 2] * np.cos(chi) - support(chi)[0]
    side = q[:, :2] / np.maximum(away, 1e-300)[:, None]
    return value, np.column_stack([np.sin(chi)[:, None] * side, np.cos(chi)])


def body(centre: tuple[float, float, float]) -> Reflector:
    """The mirror. It is closed and its own proxy."""
    sphere = unit_sphere(SEGMENTS, RINGS)
    n = sphere.vertices / np.linalg.norm(sphere.vertices, axis=1, keepdims=True)
    mesh = Mesh(surface(n) + centre, sphere.faces, n)
    return Reflector("kettle", mesh, mesh, ALUMINIUM_ETA, ALUMINIUM_K)


def vertex(ring: int, segment: int, centre: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Point and unit normal, float64 [3] each, of a vertex of the body: `ring` from the bottom, `segment` from +x."""
    chi, phi = np.pi * (1 - ring / (RINGS - 1)), 2 * np.pi * segment / SEGMENTS
    n = np.array([np.sin(chi) * np.cos(phi), np.sin(chi) * np.sin(phi), np.cos(chi)])
    return surface(n[None])[0] + centre, n


def pressed(mesh: Mesh) -> Mesh:
    """What sticks in the body about the origin is pressed on its surface; faces that would lie between are left out."""
    depth, n = distance(mesh.vertices)
    inside = depth < 0
    vertices = np.where(inside[:, None], mesh.vertices - depth[:, None] * n, mesh.vertices)
    faces = mesh.faces[~inside[mesh.faces].all(axis=1)]
    used, faces = np.unique(faces, return_inverse=True)
    return Mesh(vertices[used], faces.reshape(-1, 3), albedo=mesh.albedo[used])


def attached(centre: tuple[float, float, float], n: int) -> list[Object]:
    """Handle, spout and knob; `n` vertices around a can."""
    top = float(support(np.zeros(1))[0][0])

    # A bow of metal with a wooden grip in the middle.
    bow = arc((0, 0, 0.070), (0.118, 0, 0), (0, 0, 0.165), -8, 188, max(18, 2 * n))
    thick = np.full(len(bow), 0.0062)
    handle = pressed(tube(bow, thick, max(6, n // 2), METAL))
    grip = arc((0, 0, 0.070), (0.118, 0, 0), (0, 0, 0.165), 50, 130, max(9, n))
    s = np.linspace(-1, 1, len(grip))
    wood = tube(grip, 0.0125 * np.sqrt(1 - 0.62 * s**6) * (1 - 0.12 * s * s), max(7, 2 * n // 3), WOOD)

    way = CubicSpline(
        np.linspace(0, 1, 5), [(0.112, 0, 0.010), (0.146, 0, 0.028), (0.172, 0, 0.062), (0.192, 0, 0.102), (0.220, 0, 0.124)]
    )(s := np.linspace(0, 1, max(9, n // 2 + 2)))
    bend = tube(way, 0.0135 + 0.0195 * (1 - s) ** 1.5 + 0.002 * s**8, max(9, 2 * n // 3), (0.16, 0.045, 0.03))
    mouth = np.arange(len(bend.vertices)) == len(bend.vertices) - 1  # the middle of its end
    spout = pressed(replace(bend, albedo=np.where(mouth[:, None], 0.03, bend.albedo)))

    profile = [
        (0.0125, top - 0.004),
        (0.0105, top + 0.006),
        (0.012, top + 0.011),
        (0.0195, top + 0.019),
        (0.0205, top + 0.026),
        (0.015, top + 0.033),
        (0, top + 0.0355),
    ]
    knob = pressed(lathe(profile, max(10, n), WOOD, sharp_deg=180))

    def stood(mesh: Mesh) -> Mesh:
        return placed(mesh, centre, SPOUT_DEG)

    return [
        Object(
            "handle",
            merged(stood(handle), stood(wood)),
            "a bow over the lid that starts from the mirror itself: its image starts where it does",
        ),
        Object("spout", stood(spout), "a thick bent thing that grows out of the mirror"),
        Object("knob", stood(knob), "a small round thing that stands on the mirror, over its own image"),
    ]
