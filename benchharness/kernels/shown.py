"""What a view shows: at every pixel what `raster.rasterize` found nearest, and the surroundings where it found nothing."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels import geometry, raster, surroundings
from benchharness.kernels.types import View


@dataclass
class Shown:
    """One lane per pixel.

    hit    a triangle covers the pixel
    part   whose that is; 0 or any other where not hit
    p      the point of it, world space; of no meaning where not hit
    face, weights  its triangle and where on it, as in `raster.interpolate`; likewise
    value  attributes there, with the highlights that the view's eye sees; where not hit, radiance of the surroundings
    """

    hit: mi.Bool
    part: mi.UInt32
    p: mi.Point3f
    value: mi.Color3f
    face: mi.Vector4u
    weights: mi.Vector3f


def at(
    world: geometry.Geometry,
    visibility: mi.UInt32,
    around: surroundings.Surroundings,
    view: View,
    lane: mi.UInt32,
    active: mi.Bool | bool = True,
    points: mi.Float | None = None,
) -> Shown:
    """What pixels `lane` show of a scene in world space.

    points  where its vertices were drawn, if that is not where they are: `p` is then interpolated as all else is
    """
    drawn = world.points if points is None else points
    hit, face, weights, p = raster.seen(drawn, world.faces, visibility, view, lane, active)
    if points is not None:
        p = mi.Point3f(raster.interpolate(world.points, face, weights, hit).xyz)
    value = geometry.radiance(world, face, weights, view.eye, hit)
    far = surroundings.radiance(around, raster.ray_through(view, lane), ~hit)
    return Shown(hit, geometry.part_of(face), p, dr.select(hit, value, far), face, weights)
