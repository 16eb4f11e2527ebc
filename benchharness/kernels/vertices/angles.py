"""Turning a direction by what half vector and normal differ in, until they agree (after Estalella et al. 2005, reconstructed).

A mirror around O is looked up by direction u: its point P(u) and its normal n(u). With B the half vector of the directions from
P to the eye and to the vertex, one step is

    u <- unit(u + lam (B - n))

and the reflection point is where nothing changes. On a ball of radius r, at incidence theta, with

    rho = (r cos theta / 2) (1 / d_E + 1 / d_V)

a step multiplies the error within the plane of eye, vertex and centre by 1 - lam (1 + rho), and the error across that plane by
1 - lam (1 + rho / cos^2 theta):

    "naive"  lam = 1, which runs away where rho > 1, as it is for a vertex nearer than about half a radius
    "half"   lam = 1 / 2, which does where rho > 3
    "local"  each of the two parts of B - n by what it is multiplied with: 1 / (1 + rho), 1 / (1 + rho / cos^2 theta)

With one lam = 1 / (1 + rho) for both, what is across the plane grows at grazing incidence, from rounding on. Elsewhere than on
a ball "local" is a guess: where B - n does not become smaller, the step is halved and tried again. Mirrors are seen from
outside: from O's side, B - n leads astray as soon as a mirror is flatter than a ball.

All positions here are in the mirror's own frame, in which its map never changes.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels.placement import MirrorFrame, unit
from benchharness.kernels.vertices import secant, starmap

TOLERANCE = 0.004  # pixels; an iteration whose next step would be shorter has arrived
GRAZING = 1e-3  # least cosine of incidence
LEAST_DAMPING = 1 / 64  # share of a step below which "local" gives up


@dataclass
class At:
    """A direction, and what is known there.

    u       the direction
    size    |half vector - normal|
    step    by what u changes next
    pixels  how far that moves the mirror's point on the screen
    """

    u: mi.Vector3f
    size: mi.Float
    step: mi.Vector3f
    pixels: mi.Float


def first_guess(star: starmap.StarMap, local: MirrorFrame) -> mi.Vector3f:
    """Halfway between the directions to eye and vertex."""
    to_V, to_E = secant.directions_of(star, local)
    mixed = to_V + to_E
    return dr.select(dr.squared_norm(mixed) > 1e-12, unit(mixed), to_E)


def look(damping: str, star: starmap.StarMap, local: MirrorFrame, u: mi.Vector3f, active: mi.Bool | bool) -> At:
    """What half vector and normal differ in at direction u, and the step that follows from it."""
    r, gradient = starmap.sample(star, u, active)
    P = mi.Point3f(star.centre + r * u)
    n = unit(u - gradient)
    to_E, to_V = local.eye - P, local.V - P
    w_E, w_V = unit(to_E), unit(to_V)
    s = w_E + w_V
    f = unit(s) - n
    step = f
    if damping == "half":
        step = 0.5 * f
    if damping == "local":
        cosine = 0.5 * dr.norm(s)
        nearness = dr.rcp(dr.maximum(dr.norm(to_E), 1e-6 * r)) + dr.rcp(dr.maximum(dr.norm(to_V), 1e-6 * r))
        rho = 0.5 * r * cosine * nearness
        normal = unit(dr.cross(w_E, w_V))
        across = dr.dot(normal, f) * normal
        rho_across = rho * dr.rcp(dr.square(dr.maximum(cosine, GRAZING)))
        step = (f - across) * dr.rcp(1 + rho) + across * dr.rcp(1 + rho_across)
    return At(mi.Vector3f(u), dr.norm(f), mi.Vector3f(step), local.step(P, mi.Vector3f(r * step)))


@dr.syntax
def iterate(
    damping: str, star: starmap.StarMap, local: MirrorFrame, first: mi.Vector3f, active: mi.Bool, max_iter: mi.UInt32
) -> secant.Solution:
    """Steps from `first` until the next one would be shorter than TOLERANCE, and what they have come to."""
    at = look(damping, star, local, first, active)
    share = mi.Float(1)  # of the step that is taken, less than 1 only where that did not help
    iterations = mi.UInt32(1)  # directions looked at
    running = active & (at.pixels > TOLERANCE) & (iterations < max_iter)
    while dr.hint(running, label="turn by half vector less normal"):
        new = look(damping, star, local, unit(at.u + share * at.step), running)
        better = mi.Bool(True)
        if dr.hint(damping == "local", mode="scalar"):
            better = new.size < at.size
            share = dr.select(better, dr.minimum(1, 2 * share), 0.5 * share)
        at = dr.select(better, new, at)
        iterations += 1
        running &= (at.pixels > TOLERANCE) & (share >= LEAST_DAMPING) & (iterations < max_iter)
    return secant.judged(star, local, at.u, at.pixels <= TOLERANCE, iterations, mi.UInt32(0), active)
