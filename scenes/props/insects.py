"""An ant as cartoons draw it: large round eyes, one smooth body, six bent legs. About 0.5 m long.

In its own frame it stands on z = 0 and looks towards +y; -x is its left. The eyes are closed ellipsoids sunk into the
head, slightly flattened towards it. Their normals are exact; interpolated across a triangle of the coarser ones they
are off by less than 0.1 degrees. The head has no faces inside an eye: its surface ends just behind the eye's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from benchharness.scene import Mesh, merged

from ..props.shapes import Colour, ball, pose, tube

EYE = (0.056, 0.056, 0.051)
"""Semi-axes of an eye, metres: across, across, and outward from the head."""
EYE_AT, EYE_OUT = (0.067, 0.036, 0.040), (0.70, 0.62, 0.36)
"""Centre of the right eye from the head's, metres, and the way outward; the left one is mirrored."""
HEAD = (0.088, 0.082, 0.074)
"""Half the head's width, length and height, metres."""
HEAD_AT = np.array([0.0, 0.190, 0.192])
"""The head's centre, metres."""
NECK = np.array([0.0, 0.112, 0.170])
"""Where head and body are joined: the head turns about this point, metres."""

BODY = np.array(
    [
        (0.128, 0.173, 0.010),
        (0.118, 0.172, 0.024),
        (0.100, 0.170, 0.037),
        (0.070, 0.168, 0.050),
        (0.035, 0.163, 0.053),
        (0.000, 0.155, 0.046),
        (-0.028, 0.148, 0.032),
        (-0.048, 0.143, 0.018),
        (-0.060, 0.143, 0.015),
        (-0.072, 0.150, 0.024),
        (-0.086, 0.147, 0.019),
        (-0.098, 0.142, 0.014),
        (-0.112, 0.143, 0.034),
        (-0.136, 0.148, 0.062),
        (-0.170, 0.150, 0.080),
        (-0.208, 0.147, 0.083),
        (-0.245, 0.138, 0.071),
        (-0.275, 0.126, 0.048),
        (-0.294, 0.117, 0.022),
        (-0.299, 0.114, 0.006),
    ]
)
"""Thorax, petiole with its node, and gaster: y, z of the middle, radius, metres."""

LEG = np.array(
    [
        (0.00, 0.000, 0.013),
        (0.13, 0.026, 0.014),
        (0.28, 0.066, 0.014),
        (0.43, 0.092, 0.013),
        (0.57, 0.060, 0.011),
        (0.78, -0.058, 0.008),
        (0.87, -0.100, 0.006),
        (1.00, -0.117, 0.005),
    ]
)
"""A leg: share of the way from hip to foot, height over the hip (of 0.125 m), radius, metres."""
HIPS = {"front": (0.030, 0.065, 0.125), "middle": (0.036, 0.025, 0.125), "hind": (0.030, -0.015, 0.125)}
"""Where the legs on the right begin, metres."""
FEET = {"front": (0.16, 0.19), "middle": (0.20, 0.02), "hind": (0.17, -0.19)}
"""Where the right feet stand: x, y, metres."""

Feet = Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class Fineness:
    """Vertices around each part, and from end to end of those that are not drawn along a given path."""

    body: int
    leg: int
    antenna: int
    head: int
    head_rings: int
    eye: int
    eye_rings: int


@dataclass(frozen=True)
class Ant:
    """An ant in the world. `eyes` and `antennae`: left, then right. What turns with the head turns about `neck`."""

    body: Mesh
    head: Mesh
    antennae: tuple[Mesh, Mesh]
    eyes: tuple[Mesh, Mesh]
    neck: np.ndarray
    across: np.ndarray


def ant(stand: np.ndarray, d: Fineness, colour: Colour, look: tuple[float, float] = (0.0, 0.0), feet: Feet = FEET) -> Ant:
    """An ant at the pose `stand` [4, 4].

    colour  of its body; head, legs and gaster differ a little
    look    how far the head is turned to the left and lifted, degrees
    feet    where the right feet stand; the left ones are mirrored
    """
    at_neck = pose(NECK, look[0], look[1]) @ pose(-NECK) @ pose(HEAD_AT)
    eyes = [eye(d, side) for side in (-1, 1)]
    head = merged(_head(d, colour), *(_mandible(d, side) for side in (-1, 1)))
    antennae = [_antenna(d, side, colour) for side in (-1, 1)]
    legs = [_leg(d, name, side, feet[name], colour) for name in HIPS for side in (-1, 1)]
    to_world = stand @ at_neck
    return Ant(
        merged(_body(d, colour), *legs).transformed(stand),
        head.transformed(to_world),
        (antennae[0].transformed(to_world), antennae[1].transformed(to_world)),
        (eyes[0].transformed(to_world), eyes[1].transformed(to_world)),
        stand[:3, :3] @ NECK + stand[:3, 3],
        stand[:3, 0],
    )


def eye(d: Fineness, side: int) -> Mesh:
    """The left (-1) or right (1) eye, from the head's centre; albedo nearly black."""
    axes = np.array(EYE)
    sphere = ball(1.0, d.eye, d.eye_rings, (0.035, 0.033, 0.04))
    frame = _eye_frame(side)
    normals = sphere.vertices / axes
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    vertices = (sphere.vertices * axes) @ frame[:3, :3].T + frame[:3, 3]
    return Mesh(vertices, sphere.faces, normals @ frame[:3, :3].T, sphere.albedo)


def _eye_frame(side: int) -> np.ndarray:
    """Float64 [4, 4], the eye's frame (z outward) to the head's."""
    out = np.array(EYE_OUT) * [side, 1, 1]
    out /= np.linalg.norm(out)
    x = np.cross([0.0, 0.0, 1.0], out)
    x /= np.linalg.norm(x)
    frame = np.eye(4)
    frame[:3, :3] = np.stack([x, np.cross(out, x), out], axis=1)
    frame[:3, 3] = np.array(EYE_AT) * [side, 1, 1]
    return frame


def _head(d: Fineness, colour: Colour) -> Mesh:
    """About the head's centre; narrower at the mouth, darker there; without what lies inside the eyes."""
    sphere = ball(1.0, d.head, d.head_rings, colour)
    x, front, z = sphere.vertices[:, 0], sphere.vertices[:, 2], -sphere.vertices[:, 1]
    narrow = 1.0 - 0.30 * np.clip(front, 0, 1) ** 2
    vertices = np.stack([x * narrow, front, z * (1.0 - 0.18 * front) - 0.14 * np.clip(front, 0, 1) ** 2], axis=1) * HEAD
    shade = 1.08 - 0.35 * np.clip(front, 0, 1)[:, None] ** 2 + 0.10 * z[:, None]
    mesh = Mesh(vertices, sphere.faces, albedo=np.clip(np.array(colour) * shade, 0.03, 0.85))

    hidden = np.zeros(len(vertices), bool)
    for side in (-1, 1):
        frame = _eye_frame(side)
        local = (vertices - frame[:3, 3]) @ frame[:3, :3] / EYE
        hidden |= np.linalg.norm(local, axis=1) < 0.93
    faces = mesh.faces[~hidden[mesh.faces].all(axis=1)]
    used, faces = np.unique(faces, return_inverse=True)
    return Mesh(vertices[used], faces.reshape(-1, 3), mesh.normals[used], mesh.albedo[used])


def _body(d: Fineness, colour: Colour) -> Mesh:
    """Thorax, waist and gaster in one piece; the gaster is darker, with paler bands."""
    path = np.column_stack([np.zeros(len(BODY)), BODY[:, :2]])
    mesh = tube(path, BODY[:, 2], d.body, colour)
    y = mesh.vertices[:, 1]
    gaster = np.clip((-0.095 - y) / 0.02, 0, 1)
    band = np.clip(np.cos(2 * np.pi * (y + 0.17) / 0.074), 0, 1) * gaster
    shade = 1.0 - 0.45 * gaster + 0.75 * band
    return replace(mesh, albedo=np.clip(np.array(colour) * shade[:, None], 0.03, 0.85))


def _leg(d: Fineness, name: str, side: int, foot: tuple[float, float], colour: Colour) -> Mesh:
    hip = np.array(HIPS[name])
    path = hip + LEG[:, :1] * np.array([foot[0] - hip[0], foot[1] - hip[1], 0.0])
    path[:, 2] = hip[2] + LEG[:, 1]
    mesh = tube(path * [side, 1, 1], LEG[:, 2], d.leg, colour)
    joint = np.exp(-(((mesh.vertices[:, 2:] - 0.21) / 0.02) ** 2))
    return replace(mesh, albedo=np.clip(np.array(colour) * (0.80 + 0.35 * joint), 0.03, 0.85))


def _antenna(d: Fineness, side: int, colour: Colour) -> Mesh:
    """From the face between the eyes upward, then outward to a thicker end; from the head's centre."""
    path = [(0.012, 0.066, 0.004), (0.014, 0.100, 0.060), (0.030, 0.104, 0.125), (0.085, 0.125, 0.155), (0.150, 0.160, 0.130)]
    stops = np.linspace(0, len(path) - 1, d.antenna)
    radii = np.interp(stops, [0, 2, 2.3, 3.6, 4], [0.0070, 0.0055, 0.0065, 0.0050, 0.0075])
    smooth = CubicSpline(np.arange(len(path)), np.array(path) * [side, 1, 1])(stops)
    return tube(smooth, radii, d.leg, _darker(colour, 0.75))


def _mandible(d: Fineness, side: int) -> Mesh:
    """A bent pincer in front of the mouth; from the head's centre."""
    path = [
        (0.034, 0.048, -0.046),
        (0.046, 0.082, -0.054),
        (0.040, 0.108, -0.058),
        (0.018, 0.124, -0.060),
        (0.003, 0.126, -0.060),
    ]
    return tube(np.array(path) * [side, 1, 1], [0.017, 0.016, 0.013, 0.008, 0.003], d.leg, (0.07, 0.035, 0.030))


def _darker(colour: Sequence[float], share: float) -> Colour:
    r, g, b = np.clip(np.array(colour) * share, 0.03, 0.85).tolist()
    return r, g, b
