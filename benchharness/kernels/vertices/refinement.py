"""Newton's method on a mirror's mesh, going on from where a triangle of secants ended (`secant`, `newton`)."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels.placement import MirrorFrame
from benchharness.kernels.vertices import newton, secant, several, sight
from benchharness.kernels.vertices.mirrormesh import MirrorMesh, SurfacePoint


@dataclass
class Refined:
    """What was found of every vertex, in the mirror's frame.

    R, n        the point of the mirror and its unit normal
    converged   it is a reflection point
    residual    |half vector - normal| there
    iterations  samples and points looked at
    """

    R: mi.Point3f
    n: mi.Normal3f
    converged: mi.Bool
    residual: mi.Float
    iterations: mi.UInt32


def _ended(
    mesh: MirrorMesh, centre: mi.Point3f, local: MirrorFrame, s: secant.Solution, always: bool
) -> tuple[SurfacePoint, mi.Bool, mi.Bool]:
    """Where on the mesh a triangle ended, whether it did there, and whether that is a reflection point: for sure, or as far as
    the triangle knows if Newton's method follows `always`."""
    first, met = sight.located(mesh, centre, s.u, s.converged)
    return first, met, met if always else newton.arrived(mesh, local, first, met)


def _joined(s: secant.Solution, walked: newton.Solution, goes_on: mi.Bool, converged: mi.Bool) -> Refined:
    """The walk's answer where it went on, else the triangle's."""
    return Refined(
        R=dr.select(goes_on, walked.R, s.R),
        n=dr.select(goes_on, walked.n, s.n),
        converged=dr.select(goes_on, walked.converged, converged),
        residual=dr.select(goes_on, walked.residual, s.residual),
        iterations=s.iterations + walked.iterations,
    )


@dataclass
class Searched:
    """What is known of every vertex before the walk.

    seen      what the ray from the eye through it meets
    searched  whether it is searched at all
    warm      whether the triangle began at the last frame's answer
    """

    seen: sight.Sight
    searched: mi.Bool
    warm: mi.Bool


def refined(
    mesh: MirrorMesh,
    centre: mi.Point3f,
    local: MirrorFrame,
    s: secant.Solution,
    known: Searched,
    max_iter: mi.UInt32,
    *,
    always: bool,
) -> Refined:
    """The triangle's answers about `centre` where they are reflection points, else where a walk ends that goes on from them, or
    begins anew where the triangle was lost. `always`: all go on."""
    seen, shadow = known.seen, known.seen.shadow
    first, met, converged = _ended(mesh, centre, local, s, always)
    goes_on = known.searched & (mi.Bool(always) | ~converged)
    begins_anew = goes_on & ~met & ~seen.near
    candidate, promising = newton.best_candidate(mesh, local, begins_anew, shadow)
    first = dr.select(seen.near, seen.on, dr.select(begins_anew, candidate, first))
    goes_on &= dr.select(begins_anew, promising, met | seen.near)
    briefly = shadow & ~known.warm
    walked = newton.walk(mesh, local, first, goes_on, max_iter, touches=seen.touches, briefly=briefly)
    return _joined(s, walked, goes_on, converged)


def refined_from(
    starts: several.Starts,
    mesh: MirrorMesh,
    centre: mi.Point3f,
    s: secant.Solution,
    max_iter: mi.UInt32,
    *,
    always: bool,
) -> several.Ends:
    """The same for several searches per vertex: where the triangle was lost, the walk begins where that did."""
    local, active = starts.local, starts.active
    first, met, exact = _ended(mesh, centre, local, s, always)
    goes_on = active & (mi.Bool(always) | ~exact | starts.touches)
    met &= ~starts.touches
    first = SurfacePoint(dr.select(met, first.triangle, starts.on.triangle), dr.select(met, first.b, starts.on.b))
    walked = newton.walk(mesh, local, first, goes_on, max_iter, touches=starts.touches)
    end = _joined(s, walked, goes_on, exact)
    return several.Ends(end.R, end.n, end.converged, end.converged, end.residual, end.iterations, None)
