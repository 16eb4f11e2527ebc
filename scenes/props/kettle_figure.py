"""A figure who sits at the table and reaches for something with the right hand, until the tip of the nail is on it.

The figure is built facing +x, with the right arm towards -y, and stands on z = 0 around the origin; the hand is built
with its wrist at the origin, its fingers along +x, palm down and thumb towards +y. What the table hides is left out.

Hand, forearm and upper arm are rigid. The hand is shifted along a line without turning (`Reach`); the elbow follows
from the lengths of the arm (`Arm`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from benchharness.scene import Mesh, Object, merged

from ..props.shapes import Colour, ball, lathe, placed, pose, rounded_tube, tube

SKIN: Colour = (0.66, 0.38, 0.25)
HAIR: Colour = (0.16, 0.07, 0.035)
NAIL: Colour = (0.80, 0.03, 0.04)
JUMPER: tuple[Colour, Colour] = ((0.07, 0.16, 0.34), (0.80, 0.74, 0.62))

SHOULDER = (0.0, -0.180, 1.025)
"""The right shoulder's joint, in the figure's own coordinates, metres."""
UPPER, FORE = 0.285, 0.265
"""From shoulder to elbow, from elbow to wrist, metres."""

Point = tuple[float, float, float]


def stretched(mesh: Mesh, scale: Point) -> Mesh:
    """Scaled along the axes about the origin; normals follow."""
    return replace(mesh, vertices=mesh.vertices * scale, normals=_unit(mesh.normals / scale))


def hand(n: int) -> Mesh:
    """A right hand whose index finger points; its red nail ends in one vertex, the foremost of all (`tip`)."""
    k = max(6, n // 2)
    wrist_to_knuckles = [(-0.012, 0, 0), (0.022, 0, 0), (0.060, 0, 0), (0.102, -0.001, 0)]
    palm = rounded_tube(wrist_to_knuckles, [0.026, 0.031, 0.041, 0.041], n, SKIN, count=max(4, k - 3))
    fingers = [
        rounded_tube(
            [(0.082, 0.029, 0), (0.120, 0.031, 0.006), (0.152, 0.031, 0.003), (0.184, 0.031, -0.007)],
            [0.0105, 0.0098, 0.0090, 0.0078],
            k,
            SKIN,
            count=max(6, k),
        ),
        rounded_tube(
            [(0.028, 0.026, -0.006), (0.058, 0.055, -0.014), (0.088, 0.061, -0.022), (0.114, 0.056, -0.026)],
            [0.0145, 0.0115, 0.0105, 0.0085],
            k,
            SKIN,
            count=k - 2,
        ),
    ]
    for y, long, thick in ((0.0095, 1.0, 0.0102), (-0.0115, 0.95, 0.0098), (-0.031, 0.80, 0.0088)):
        bent = np.array([(0, 0, 0.002), (0.030, 0, 0.004), (0.043, 0, -0.012), (0.031, 0, -0.028), (0.008, 0, -0.027)])
        radii = [thick, thick, 0.96 * thick, 0.92 * thick, 0.85 * thick]
        fingers.append(rounded_tube(bent * long + (0.083, y, 0), radii, k, SKIN, count=max(7, k)))
    almond = [(0, 0), (0.0044, 0.003), (0.0057, 0.009), (0.0056, 0.016), (0.0042, 0.0245), (0, 0.0345)]
    nail = stretched(lathe(almond, k, NAIL, sharp_deg=180), (0.42, 1, 1))
    return merged(stretched(palm, (1, 1, 0.42)), *fingers, nail.transformed(pose((0.164, 0.031, 0.0075)) @ _about_y(90 + 13)))


def tip(mesh: Mesh) -> int:
    """The vertex of a `hand` (in its own coordinates) where the nail ends."""
    return int(np.argmax(mesh.vertices[:, 0]))


@dataclass(frozen=True)
class Reach:
    """Where the hand is: turned by `turn` (rows of a rotation), its wrist at `wrist` once it arrived.

    away      offset from there at the start, metres
    start, arrival   seconds: the hand rests before and after
    """

    wrist: Point
    turn: tuple[Point, Point, Point]
    away: Point
    start: float
    arrival: float

    def __call__(self, time: float) -> np.ndarray:
        s = float(np.clip((time - self.start) / (self.arrival - self.start), 0.0, 1.0))
        left = 1.0 - s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
        matrix = np.eye(4)
        matrix[:3, :3] = self.turn
        matrix[:3, 3] = np.add(self.wrist, left * np.asarray(self.away)) if s < 1.0 else self.wrist
        return matrix


@dataclass(frozen=True)
class Arm:
    """The pose of the upper arm or, `fore`, the forearm, both built along +x from their upper joint at the origin.

    shoulder  where it is, metres
    out       the side to which the elbow bends
    """

    reach: Reach
    shoulder: Point
    out: Point
    fore: bool

    def __call__(self, time: float) -> np.ndarray:
        shoulder, wrist = np.asarray(self.shoulder), self.reach(time)[:3, 3]
        span = np.linalg.norm(wrist - shoulder)
        along = (wrist - shoulder) / span
        if not abs(UPPER - FORE) < span < UPPER + FORE:
            raise ValueError(f"arm: the wrist is {span:.3f} m from the shoulder; accepted: below {UPPER + FORE:.3f} m")
        side = np.asarray(self.out) - (self.out @ along) * along
        side /= np.linalg.norm(side)
        foot = (span**2 + UPPER**2 - FORE**2) / (2 * span)
        elbow = shoulder + foot * along + np.sqrt(UPPER**2 - foot**2) * side
        start, end = (elbow, wrist) if self.fore else (shoulder, elbow)
        x = _unit(end - start)
        y = _unit(np.cross(np.cross(along, side), x))
        matrix = np.eye(4)
        matrix[:3, :3] = np.stack([x, y, np.cross(x, y)], axis=1)
        matrix[:3, 3] = start
        return matrix


def upper_arm(n: int) -> Mesh:
    """From the shoulder, in the jumper's sleeve."""
    way = [(-0.045, 0, 0), (0.05, 0, 0), (0.18, 0, 0), (UPPER + 0.036, 0, 0)]
    return rounded_tube(way, [0.060, 0.056, 0.047, 0.043], n, JUMPER[0], count=4)


def forearm(n: int) -> Mesh:
    """From the elbow: sleeve, a pale cuff, and the wrist that comes out of it."""
    sleeve = rounded_tube(
        [(-0.04, 0, 0), (0.06, 0, 0), (0.14, 0, 0), (0.205, 0, 0)], [0.042, 0.045, 0.040, 0.035], n, JUMPER[0], count=4
    )
    cuff = rounded_tube([(0.142, 0, 0), (0.190, 0, 0), (0.222, 0, 0)], [0.034, 0.039, 0.037], n, JUMPER[1], count=2)
    wrist = rounded_tube(
        [(0.15, 0, 0), (0.21, 0, 0), (FORE + 0.012, 0, 0)], [0.027, 0.026, 0.024], max(6, n - 2), SKIN, count=2
    )
    return merged(sleeve, cuff, wrist)


def sitter(n: int, at: Point, turn_deg: float) -> list[Object]:
    """Torso, left arm and head of the figure at `at`, turned about z."""
    heights = [0.60, 0.66, 0.71, 0.76, 0.81, 0.86, 0.91, 0.96, 1.005, 1.045, 1.075, 1.095, 1.105]
    widths = [0.150, 0.150, 0.152, 0.156, 0.162, 0.170, 0.177, 0.182, 0.182, 0.165, 0.125, 0.082, 0.060]
    stripes = [JUMPER[k % 2 if k < 8 else 0] for k in range(len(heights) - 1)]
    torso = stretched(lathe(np.column_stack([widths, heights]), n + n // 2, stripes, sharp_deg=60), (0.62, 1, 1))
    hanging = [(0, 0.165, 1.030), (0.01, 0.215, 0.98), (0.03, 0.245, 0.80), (0.05, 0.23, 0.66)]
    left = rounded_tube(hanging, [0.058, 0.058, 0.048, 0.044], n, JUMPER[0])
    neck = rounded_tube([(0, 0, 1.04), (0.004, 0, 1.10), (0.012, 0, 1.19)], [0.05, 0.049, 0.047], n, SKIN, count=3)
    skull = stretched(ball(1.0, n + 4, n, SKIN), (0.094, 0.080, 0.112))
    nose = rounded_tube(
        [(0.088, 0, 0.012), (0.098, 0, -0.004), (0.104, 0, -0.020)], [0.008, 0.011, 0.013], 6, (0.70, 0.38, 0.26), 2, 2
    )
    eyes = [placed(ball(0.0115, 8, 6, (0.05, 0.04, 0.04)), (0.078, y, 0.012)) for y in (-0.032, 0.032)]
    mouth = tube(
        [(0.078, -0.030, -0.044), (0.086, -0.016, -0.053), (0.088, 0, -0.056), (0.086, 0.016, -0.053), (0.078, 0.030, -0.044)],
        0.0052,
        5,
        (0.55, 0.08, 0.07),
    )
    ears = [placed(stretched(ball(1.0, 8, 6, SKIN), (0.020, 0.011, 0.028)), (-0.004, y, 0.0)) for y in (-0.081, 0.081)]
    face = placed(merged(skull, nose, *eyes, mouth, *ears), (0.015, 0, 1.285))
    cap = stretched(ball(1.0, n + 4, n, HAIR), (0.100, 0.090, 0.108))
    bun = placed(ball(0.044, n, n // 2 + 3, HAIR), (-0.075, 0, 0.105))
    hair = placed(merged(cap.transformed(_about_y(-34)), bun), (-0.012, 0, 1.315))
    here = lambda *meshes: placed(merged(*meshes), at, turn_deg)  # noqa: E731
    return [
        Object("torso", here(torso, left), "a striped jumper: which way the figure is bent in the mirror"),
        Object("head", here(neck, face, hair), "a face, where distortion is noticed first"),
    ]


def shoulder(at: Point, turn_deg: float) -> Point:
    """The right shoulder's joint of the figure at `at`, turned about z."""
    x, y, z = (pose(at, turn_deg) @ [*SHOULDER, 1.0])[:3].tolist()
    return x, y, z


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def _about_y(angle_deg: float) -> np.ndarray:
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    return np.array([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1.0]])
