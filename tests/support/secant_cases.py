"""Searches by secants: vertices by surface and incidence, what was measured of them, and searches on the device."""

from __future__ import annotations

from functools import cache

import drjit as dr
import mitsuba as mi
import numpy as np
from oracles import secant_oracle as oracle
from support.placed import EYE, mapped, points
from support.star_shapes import Bumpy, Ellipsoid, Sphere, truths
from support.truth_shapes import unit

from benchharness.kernels import placement
from benchharness.kernels.vertices import secant

# Surface, least and largest cosine of incidence -> stop: mean iterations, stopped over 2 px off of 300, not stopped of 300.
TABLE = {
    ("sphere", 0.5, 1.0): {"area": (5.4, 26, 0), "edge": (7.0, 6, 2)},
    ("sphere", 0.2, 0.5): {"area": (7.0, 54, 0), "edge": (9.0, 8, 4)},
    ("sphere", 0.02, 0.2): {"area": (13.3, 64, 18), "edge": (14.7, 18, 18)},
    ("ellipsoid", 0.5, 1.0): {"area": (5.3, 10, 0), "edge": (6.4, 2, 1)},
    ("ellipsoid", 0.2, 0.5): {"area": None, "edge": None},
    ("ellipsoid", 0.02, 0.2): {"area": (14.7, 63, 33), "edge": (16.8, 12, 35)},
}


def printed(shape, eye, V, u):
    """Equation (1) as the paper has it."""
    e = unit(shape.P(u) - eye) + unit(shape.P(u) - V)
    return (shape.grad_r(u) * e).sum(axis=1, keepdims=True) * u + e - (u * e).sum(axis=1, keepdims=True) * u


MOVED = {"origin": (0.3, -0.2, 0.5), "turn": (0.4, -0.7, 0.2)}
MIRRORS = {
    "sphere": Sphere(),
    "ellipsoid": Ellipsoid(half=(1.0, 0.6, 1.4)),
    "sphere about another point": Sphere(centre=(0.3, -0.2, 0.4)),
    "ellipsoid somewhere": Ellipsoid(half=(1.0, 0.6, 1.7), **MOVED),
    "bumpy": Bumpy(eps=0.3),
    "bumpy somewhere": Bumpy(eps=0.3, **MOVED),
}


@cache
def star_of(name: str, side: float = 1.0):
    return mapped(MIRRORS[name], 128, side)


def solved(star, where: placement.MirrorFrame, stop="edge", start="paper", residual="param", last=None, max_iter=60):
    """A solution, evaluated. `last`: directions [N, 3] to start around, all warm."""
    count = dr.width(where.V)
    u = mi.Vector3f(dr.zeros(mi.Float, count)) if last is None else mi.Vector3f(points(last))
    warm, active = dr.full(mi.Bool, last is not None, count), dr.full(mi.Bool, True, count)
    tau = mi.Float(oracle.TAU[stop])
    s = secant.solve(secant.Options(residual, stop, start), star, where, u, warm, active, tau, mi.UInt32(max_iter))
    dr.eval(s)
    return s


def flags(s) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(converged, behind, iterations)."""
    return np.array(s.converged), np.array(s.behind), np.array(s.iterations).astype(int)


def around(seed, count):
    rng = np.random.default_rng(seed)
    return unit(rng.normal(size=(count, 3))) * rng.uniform(1.8, 5, (count, 1))


@cache
def classed(name, low, high):
    return truths(MIRRORS[name], EYE, 0, 300, low, high)
