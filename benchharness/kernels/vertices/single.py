"""From one point of the mirror per vertex, as a solver found it, to images: which are reflected, hidden, unsure."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels import optics, placement
from benchharness.kernels.types import Vertices
from benchharness.kernels.vertices import problems, sight, virtual
from benchharness.kernels.vertices.mirrormesh import MirrorMesh


@dataclass
class Ended:
    """What a solver found of every vertex, in the mirror's frame.

    R, n        point of the mirror and unit normal
    searched    whether it was searched at all
    hidden      it was not, or what was found says that nothing reflects it; where it is reflected all the same, that counts
    near        R is drawn if it has not converged and is not hidden
    converged   R is a reflection point
    residual    |half vector - normal| at R
    iterations  points looked at
    """

    R: mi.Point3f
    n: mi.Normal3f
    searched: mi.Bool
    hidden: mi.Bool
    near: mi.Bool
    converged: mi.Bool
    residual: mi.Float
    iterations: mi.UInt32


def images_of(
    problem: problems.Problem,
    end: Ended,
    seen: sight.Sight,
    sheet: MirrorMesh | None,
    *,
    flush: bool,
    placed: str = "on_ray",
) -> tuple[virtual.Images, Vertices, mi.Bool]:
    """Virtual vertices, what was found of each vertex, and whether it has an image that the eye sees.

    sheet   what is seen of the mirror; None if it is convex
    flush   whether vertices that lie on the mirror are told from others
    placed  "on_ray" of the eye, or in the "plane" of R and n, mirrored
    """
    (_, V, active), pose, view = problem.vertices(), problem.pose, problem.view
    reflected = end.searched & (end.converged | (~end.hidden & end.near))
    hidden = active & end.hidden & ~reflected
    converged, free = end.converged, None
    if sheet is not None:
        # A point that the mirror hides from the eye is no reflection.
        local = placement.mirror_frame(pose, V, view)
        free = ~reflected | sight.is_free(sheet, end.R, end.n, local.eye, reflected)
        converged = converged & free
    R, n = placement.point_to_world(pose, end.R), placement.normal_to_world(pose, end.n)
    image = optics.mirrored(V, R, n) if placed == "plane" else optics.on_ray(V, R, view.eye)
    answer = problems.Answer(
        R=R,
        n=n,
        image=dr.select(reflected, image, V),
        reflected=reflected,
        hidden=hidden,
        converged=converged,
        unsure=end.searched & ~converged,
        residual=end.residual,
        iterations=end.iterations,
        free=free,
        flush=seen.touches if flush else None,
    )
    return *problems.images_of(problem, answer, by_plane=False), mi.Bool(reflected if free is None else reflected & free)
