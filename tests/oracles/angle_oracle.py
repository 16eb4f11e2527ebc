"""Turning a direction by half vector less normal, on a ball about the origin: what a step does, what it multiplies the error
with, and where it has to end. Float64, arrays [..., 3] and [..., 1].

The reflection point lies on the arc from the direction to the eye to that of the vertex, where the part of the half vector
along the arc changes its sign, once: bisection.
"""

from __future__ import annotations

import numpy as np


def dot(a, b):
    return (a * b).sum(axis=-1, keepdims=True)


def length(x):
    return np.sqrt(dot(x, x))


def unit(x):
    return x / length(x)


def arc(a, b, share):
    """The direction that is a share (0 .. 1) of the angle from a to b away from a."""
    angle = share * np.arccos(np.clip(dot(a, b), -1, 1))
    return np.cos(angle) * a + np.sin(angle) * unit(b - dot(a, b) * a)


def reflection(eye, V, radius):
    """Direction of the reflection point of vertices that the ball does not hide."""
    a, b = unit(eye), unit(V)
    axis = unit(np.cross(a, b))
    low = np.zeros_like(dot(a, b))
    high = np.ones_like(low)
    for _ in range(60):
        u = arc(a, b, 0.5 * (low + high))
        onwards = dot(unit(eye - radius * u) + unit(V - radius * u), np.cross(axis, u)) > 0
        low, high = np.where(onwards, 0.5 * (low + high), low), np.where(onwards, high, 0.5 * (low + high))
    return arc(a, b, 0.5 * (low + high))


def incidence(eye, V, u, radius):
    """The cosine of incidence at direction u, taken as half of |w_E + w_V|, and rho = radius cos / 2 (1 / d_E + 1 / d_V)."""
    to_eye, to_vertex = eye - radius * u, V - radius * u
    cosine = 0.5 * length(unit(to_eye) + unit(to_vertex))
    return cosine, 0.5 * radius * cosine * (1 / length(to_eye) + 1 / length(to_vertex))


def shares(damping, cosine, rho):
    """How much of half vector less normal a step takes within the plane of eye, vertex and centre, and across it. "one" takes
    as much of either as is right within."""
    within = {"naive": 1 + 0 * rho, "half": 0.5 + 0 * rho, "local": 1 / (1 + rho), "one": 1 / (1 + rho)}[damping]
    return within, 1 / (1 + rho / cosine**2) if damping == "local" else within


def factors(damping, cosine, rho):
    """What a small error is multiplied with by a step, within that plane and across it."""
    within, across = shares(damping, cosine, rho)
    return np.abs(1 - within * (1 + rho)), np.abs(1 - across * (1 + rho / cosine**2))


def step(damping, eye, V, u, radius):
    to_eye, to_vertex = unit(eye - radius * u), unit(V - radius * u)
    within, across = shares(damping, *incidence(eye, V, u, radius))
    off = unit(to_eye + to_vertex) - u
    normal = unit(np.cross(to_eye, to_vertex))
    aside = dot(off, normal) * normal
    return unit(u + within * (off - aside) + across * aside)
