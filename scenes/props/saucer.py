"""A flying saucer: the mirror of the city square, its legs and lamps, and its descent.

The hull is a surface of revolution about z, given by its distance from a point inside as a function of the elevation φ:

    r(φ) = (h^p + d^p)^(1/p),    h = 1 / √(cos²φ / A² + sin²φ / C²),    d = Z sin φ + √(R² - Z² cos²φ)

h is an ellipsoid of semi-axes A, A, C, d a ball of radius R whose centre is Z above; the power mean of order p lets one
run smoothly into the other. All of it is analytic, so normals are exact: n ∝ r e_r - r' e_φ. The lower side and the rim
are convex; the foot of the dome is a shallow hollow ring. Every ray from the middle of its bounding box meets the hull
once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchharness.scene import Mesh, Reflector, merged

from ..props.bowls import ALUMINIUM_ETA, ALUMINIUM_K
from ..props.shapes import Colour, ball, lathe, placed, pose, tube

A, C = 4.2, 1.9
"""Semi-axes of the lens, metres."""
R, Z = 1.9, 0.8
"""Radius of the dome and height of its centre over the lens's, metres."""
P = 5.0
"""Order of the power mean: the higher, the narrower the hollow at the dome's foot."""

STEEL: Colour = (0.42, 0.42, 0.44)
AMBER: Colour = (0.85, 0.42, 0.05)
RED: Colour = (0.75, 0.06, 0.04)

LEG_M = 1.3
"""How far the feet are below the lowest point of the hull."""


def profile(elevation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The meridian at elevations φ [N], radians: points and unit outward normals, (radius, z) each, float64 [N, 2].

    Origin: the middle of the hull's bounding box.
    """
    s, c = np.sin(elevation), np.cos(elevation)
    h = (c * c / A**2 + s * s / C**2) ** -0.5
    dh = -(h**3) * s * c * (1 / C**2 - 1 / A**2)
    root = np.sqrt(R**2 - (Z * c) ** 2)
    d = Z * s + root
    dd = Z * c + Z**2 * s * c / root
    r = (h**P + d**P) ** (1 / P)
    dr = (h ** (P - 1) * dh + d ** (P - 1) * dd) * r ** (1 - P)
    along, across = np.stack([c, s], axis=1), np.stack([-s, c], axis=1)
    n = r[:, None] * along - dr[:, None] * across
    return r[:, None] * along - [0.0, _middle()], n / np.linalg.norm(n, axis=1, keepdims=True)


def _middle() -> float:
    """Height of the middle of the bounding box over the lens's centre: top and bottom are on the axis."""
    top, bottom = ((C**P + (R + side * Z) ** P) ** (1 / P) for side in (1, -1))
    return 0.5 * (top - bottom)


HALF = float(profile(np.array([0.5 * np.pi]))[0][0, 1])
"""Half the height of the hull, metres."""


def hull(segments: int, rings: int) -> Mesh:
    """The closed hull about the origin; `rings` vertices from pole to pole, closer where its curvature changes."""
    fine = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 20001)
    p, n = profile(fine)
    # A normal interpolated over a step of length l is off by θ'' l² / 8, θ its angle: steps go with θ''^-1/2. Added to
    # that, nowhere less than a share of the mean turn and of the mean length.
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))])
    angle = np.unwrap(np.arctan2(n[:, 1], n[:, 0]))
    curvature = np.gradient(angle, length)
    density = abs(np.gradient(curvature, length)) ** 0.5 + 0.5 * abs(curvature) + 0.15
    total = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(length))])
    elevation = np.interp(np.linspace(0.0, total[-1], rings), total, fine)[1:-1]

    # Poles once, rings in between; the seam is shared.
    p, n = profile(np.concatenate([[-0.5 * np.pi], elevation, [0.5 * np.pi]]))
    azimuth = np.arange(segments) * (2 * np.pi / segments)
    around = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1)

    def turned(q: np.ndarray) -> np.ndarray:
        ring = np.concatenate([q[1:-1, None, :1] * around, np.repeat(q[1:-1, None, 1:], segments, axis=1)], axis=2)
        return np.concatenate([[[0, 0, q[0, 1]]], ring.reshape(-1, 3), [[0, 0, q[-1, 1]]]])

    k = np.arange(segments)
    nxt = (k + 1) % segments
    low = 1 + segments * np.arange(rings - 3)[:, None]
    a, b, c, d = ((low + i).ravel() for i in (k, nxt, segments + nxt, segments + k))
    first, last = 1, 1 + segments * (rings - 3)
    top = last + segments
    faces = np.concatenate(
        [
            np.stack([np.zeros_like(k), first + nxt, first + k], axis=1),
            np.stack([a, b, c], axis=1),
            np.stack([a, c, d], axis=1),
            np.stack([last + k, last + nxt, np.full_like(k, top)], axis=1),
        ]
    )
    return Mesh(turned(p), faces, turned(n))


def reflector(segments: int, rings: int, motion) -> Reflector:
    mesh = hull(segments, rings)
    return Reflector("saucer", mesh, mesh, ALUMINIUM_ETA, ALUMINIUM_K, motion)


def legs(n: int) -> Mesh:
    """Three legs with round feet, in the hull's space; their upper ends are in the hull."""
    foot = lathe([(0.42, 0), (0.42, 0.07), (0.16, 0.16), (0, 0.16)], n, STEEL)
    parts = []
    for azimuth in (30.0, 150.0, 270.0):
        out = np.array([np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth)), 0.0])
        ankle = 2.3 * out - [0, 0, HALF + LEG_M]
        parts.append(tube([1.75 * out - [0, 0, HALF - 0.5], np.add(ankle, [0, 0, 0.12])], 0.09, max(6, n // 2), STEEL))
        parts.append(placed(foot, ankle))
    return merged(*parts)


def lamps(n: int, count: int = 10) -> Mesh:
    """Amber beads around the lower side, one of them red, in the hull's space; they touch the hull and no more."""
    p, normal = profile(np.radians([-20.0]))
    size = 0.15
    at = p[0] + (size + 0.01) * normal[0]
    parts = []
    for k in range(count):
        a = 2 * np.pi * k / count
        bead = ball(size, n, max(5, n // 2 + 1), RED if k == 0 else AMBER)
        parts.append(placed(bead, (at[0] * np.cos(a), at[0] * np.sin(a), at[1])))
    return merged(*parts)


REST = HALF + LEG_M
"""Height of the hull's middle over the ground when it has landed, metres."""


@dataclass(frozen=True)
class Descent:
    """The saucer's way: down from over a roof, a moment of hovering with a gentle roll, then down on its legs at (0, 0).

    start, hover   where it comes from, and where it hovers; metres
    turn_deg       how far it turns about its axis in all
    tilt_deg       of its axis while it flies
    """

    start: tuple[float, float, float] = (2.5, 5.0, 9.5)
    hover: tuple[float, float, float] = (0.3, 0.2, REST + 1.6)
    turn_deg: float = 70.0
    tilt_deg: float = 7.0
    arrive_s: float = 1.5
    leave_s: float = 1.9
    land_s: float = 3.6

    def __call__(self, time: float) -> np.ndarray:
        down = _eased(time / self.arrive_s)
        land = _eased((time - self.leave_s) / (self.land_s - self.leave_s))
        at = np.asarray(self.start) * (1 - down) + np.asarray(self.hover) * (down - land) + np.array([0, 0, REST]) * land
        # The axis leans, and the lean goes round; upright when it lands.
        lean = pose(turn_deg=200.0 * time / self.land_s)
        tilt = lean @ pose(tilt_deg=self.tilt_deg * (1 - land)) @ lean.T
        return pose(tuple(at.tolist())) @ tilt @ pose(turn_deg=self.turn_deg * _eased(time / self.land_s))


def _eased(s: float) -> float:
    """0 to 1 with no speed and no acceleration at either end."""
    s = float(np.clip(s, 0.0, 1.0))
    return s**3 * (10 - 15 * s + 6 * s * s)
