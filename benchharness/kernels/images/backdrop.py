"""What lies behind impostors: an environment map, and the morph that joins it with the ground.

A ray that meets no impostor is looked up by direction: in a cube map around its mirror where the scene has surroundings of
triangles (a room), else straight in the surroundings at infinity.

Morph (Popescu et al. 2006, 3.2). Where the ground goes on in the environment, its rectangle gets transparent walls around
it. One environment map, taken from where the panorama was, holds the ground too. A ray that leaves this open box through
its floor is looked up towards where it does; through its top, by its direction; through a wall, by a blend of the two with
the height there, so that nothing jumps at the ground's border.

Doubt. A cube map around a mirror's middle shows a ray what lies along its direction from there: as far beside the ray as the
ray passes by the middle. Where the ray moves by less than half of that from one pixel to the next, that is more than two
pixels off.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels import cubemap, surroundings
from benchharness.kernels.images.candidates import Ray


@dataclass
class Walls:
    """The box over the ground: its middle, axes divided by half lengths, normal divided by the walls' height; where the map
    was taken from."""

    middle: mi.Point3f
    a: mi.Vector3f
    b: mi.Vector3f
    up: mi.Vector3f
    centre: mi.Point3f


@dataclass
class Backdrop:
    """What is behind all impostors.

    infinity    the surroundings
    maps        cube maps, one per mirror, or one for all with `walls`; None: look at infinity
    resolution  texels per edge of a face
    places      where they were taken, 4 floats per mirror; None with `walls` or without maps
    """

    infinity: surroundings.Surroundings
    maps: mi.Float | None
    resolution: int
    walls: Walls | None
    places: mi.Float | None = None


def behind(backdrop: Backdrop, o: mi.Point3f, d: mi.Vector3f) -> tuple[mi.Vector3f, mi.Float]:
    """The direction in which a ray is to be looked up, and its distance to the ground: inf without walls, or off it."""
    walls = backdrop.walls
    if walls is None:
        return d, mi.Float(dr.inf)
    start = mi.Vector3f(*(dr.dot(mi.Vector3f(o - walls.middle), axis) for axis in (walls.a, walls.b, walls.up)))
    step = mi.Vector3f(*(dr.dot(d, axis) for axis in (walls.a, walls.b, walls.up)))
    low = mi.Vector3f(-1, -1, 0)
    still = dr.abs(step) < 1e-12
    per_step = dr.rcp(dr.select(still, 1, step))
    one, two = (low - start) * per_step, (1 - start) * per_step
    within = (start >= low) & (start <= 1)
    leave = dr.select(still, dr.select(within, dr.inf, -dr.inf), dr.maximum(one, two))
    enter = dr.select(still, dr.select(within, -dr.inf, dr.inf), dr.minimum(one, two))
    t = dr.minimum(leave.x, dr.minimum(leave.y, leave.z))
    inside = (t > 0) & (dr.max(enter) < t)

    sideways = inside & (leave.z > t)
    ground = inside & ~sideways & (step.z < 0)
    to_exit = dr.normalize(o + dr.select(inside, t, 1) * d - walls.centre)
    height = dr.clip(start.z + t * step.z, 0, 1)
    blend = dr.lerp(to_exit, d, height)
    size = dr.norm(blend)
    blend = dr.select(size > 1e-6, blend * dr.rcp(dr.maximum(size, 1e-6)), d)
    direction = dr.select(ground, to_exit, dr.select(sideways, blend, d))
    return direction, dr.select(ground, t, dr.inf)


def look_up(backdrop: Backdrop, mirror: mi.UInt32, direction: mi.Vector3f, active: mi.Bool) -> tuple[mi.Color3f, mi.Float]:
    """Radiance from a direction around a mirror, and the distance of what is there; inf for the surroundings."""
    if backdrop.maps is None:
        return surroundings.radiance(backdrop.infinity, direction, active), mi.Float(dr.inf)
    first = mi.UInt32(0) if backdrop.walls is not None else mirror * cubemap.texels_of(backdrop.resolution)
    value = cubemap.lookup(backdrop.maps, backdrop.resolution, direction, active, first)
    distance = dr.select(value.w > 0, dr.rcp(dr.select(value.w > 0, value.w, 1)), dr.inf)
    return mi.Color3f(value.x, value.y, value.z), distance


def parallax(backdrop: Backdrop, ray: Ray) -> mi.Vector3f:
    """The way from a ray to the parallel one through the place of its mirror's map, metres; 0 without maps, or with walls."""
    if backdrop.places is None:
        return mi.Vector3f(0)
    x = dr.gather(mi.Vector4f, backdrop.places, ray.mirror).xyz - mi.Vector3f(ray.o)
    return x - dr.dot(x, ray.d) * ray.d
