"""What stands in the way: rays from the eye and from the vertices that a mirror's mesh may stop.

Positions are in the mirror's own frame unless said.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels import depths
from benchharness.kernels.placement import MirrorFrame, mirror_frame, pose_of
from benchharness.kernels.types import View
from benchharness.kernels.vertices.mirrormesh import NEAREST, Joined, MirrorMesh, SurfacePoint

SHADOWED = 1e-4  # of the mirror's size; a vertex is in the mirror's shadow if it is this much behind where its ray meets it
ROUNDED = 1e-6  # of a ray's length; float32 does not know better where it ends
CLOSE = 1e-2  # of the mirror's size; a vertex this much in front of where its ray meets the mirror is reflected near there
LIFT = 1e-4  # of the mirror's size; rays that ask whether the mirror meets itself start this far in front of it


@dataclass
class Sight:
    """What the ray from E through V meets.

    shadow   the mirror, before it comes to V; V on the mirror is not in its shadow
    near     the mirror, close behind V: there a walk should start, for V's reflection point is not far, and the half vector
             changes within as little as V is above the mirror
    touches  the mirror, in V
    on       where it does, defined for the last two
    """

    shadow: mi.Bool
    near: mi.Bool
    touches: mi.Bool
    on: SurfacePoint


def look_at(mesh: MirrorMesh, local: MirrorFrame, active: mi.Bool) -> Sight:
    """What the eye sees in the direction of each vertex."""
    ray, length = sight_line(mesh, local.eye, local.V)
    ray.maxt = dr.minimum(length + CLOSE * mesh.size, _beyond(mesh, ray))
    hit = mesh.scene.ray_intersect_preliminary(ray, coherent=False, active=active)
    met = active & hit.is_valid()
    before = dr.select(met, length - hit.t, -dr.inf)
    shadow = before > SHADOWED * mesh.size
    near = met & ~shadow & (before > -CLOSE * mesh.size)
    return Sight(shadow, near, near & (dr.abs(before) < NEAREST * mesh.size), _point_of(hit, near))


def sight_line(mesh: MirrorMesh, eye: mi.Point3f, p: mi.Point3f) -> tuple[mi.Ray3f, mi.Float]:
    """The eye's ray towards p, and how far along it p is. It starts at the eye, or just before it can meet the mirror: from an
    eye far away, float32 holds no length well enough to say what is close to p."""
    d = p - eye
    length = dr.norm(d)
    d *= dr.rcp(dr.maximum(length, 1e-20))
    outside = dr.dot(mesh.centre - eye, d) > mesh.size
    length = dr.select(outside, dr.dot(p - mesh.centre, d) + mesh.size, length)
    return mi.Ray3f(dr.select(outside, p - length * d, eye), d), length


def _beyond(mesh: MirrorMesh, ray: mi.Ray3f) -> mi.Float:
    """How far along a ray nothing of the mirror comes any more; 0 for a ray that passes it far aside. Other mirrors may."""
    to_centre = mesh.centre - ray.o
    along = dr.dot(to_centre, ray.d)
    aside = dr.squared_norm(to_centre - along * ray.d)
    return dr.select(aside < dr.square(mesh.size), dr.maximum(along + mesh.size, 0), 0)


def located(mesh: MirrorMesh, centre: mi.Point3f, u: mi.Vector3f, active: mi.Bool) -> tuple[SurfacePoint, mi.Bool]:
    """Where the ray from `centre` along u meets the mesh first, and whether it does."""
    return first_met(mesh, mi.Ray3f(centre, u), active)


def first_met(mesh: MirrorMesh, ray: mi.Ray3f, active: mi.Bool) -> tuple[SurfacePoint, mi.Bool]:
    """Where a ray meets the mesh first, and whether it does."""
    hit = mesh.scene.ray_intersect_preliminary(ray, coherent=False, active=active)
    met = active & hit.is_valid()
    return _point_of(hit, met), met


def _point_of(hit: mi.PreliminaryIntersection3f, met: mi.Bool) -> SurfacePoint:
    """The point that a ray met, the first of the mesh where it met none."""
    return SurfacePoint(dr.select(met, hit.prim_index, 0), mi.Point2f(dr.select(met, hit.prim_uv, 0)))


def is_free(mesh: MirrorMesh, R: mi.Point3f, n: mi.Normal3f, end: mi.Point3f, active: mi.Bool) -> mi.Bool:
    """Whether no part of the mirror stands between its point R and another point, such as the eye."""
    lifted = R + LIFT * mesh.size * mi.Vector3f(n)
    d = end - lifted
    length = dr.norm(d)
    ray = mi.Ray3f(lifted, d * dr.rcp(dr.maximum(length, 1e-20)))
    ray.maxt = dr.maximum(length - SHADOWED * mesh.size, 0)
    return active & ~mesh.scene.ray_test(ray, active=active)


def is_seen(mesh: MirrorMesh, local: MirrorFrame, R: mi.Point3f, n: mi.Normal3f, active: mi.Bool) -> mi.Bool:
    """Whether no part of the mirror stands between its point R and the eye, nor between R and V."""
    return is_free(mesh, R, n, local.V, is_free(mesh, R, n, local.eye, active))


@dataclass
class Shadow:
    """A mirror's mesh and pose, asked whether the mirror hides a point of the world."""

    mesh: MirrorMesh
    pose: list[mi.Vector4f]

    def hides(self, x: mi.Point3f, view: View, active: mi.Bool) -> tuple[mi.Bool, mi.Float]:
        """Whether the mirror stands between the eye and x, and its depth there, from `view.depth`; x on it is not hidden."""
        local = mirror_frame(self.pose, x, view)
        ray, length = sight_line(self.mesh, local.eye, local.V)
        ray.maxt = dr.minimum(length - NEAREST * self.mesh.size - ROUNDED * length, _beyond(self.mesh, ray))
        hit = self.mesh.scene.ray_intersect_preliminary(ray, coherent=True, active=active)
        return hit.is_valid(), depths.offset(view, x) - (length - hit.t) * dr.dot(local.w.xyz, ray.d)


@dataclass
class Shadows:
    """Mirrors that are joined, with the poses of all parts, asked whether each lane's, number `mirror` and part `part`, hides a
    point of the world."""

    mirrors: Joined
    poses: mi.Float
    part: mi.UInt32
    mirror: mi.UInt32

    def hides(self, x: mi.Point3f, view: View, active: mi.Bool) -> tuple[mi.Bool, mi.Float]:
        """As `Shadow.hides`, one x per lane."""
        mesh, pose = self.mirrors.at(self.mirror, pose_of(self.poses, self.part))
        return Shadow(mesh, pose).hides(x, view, active)

    def of(self, triangles: mi.UInt32) -> Shadows:
        """The mirrors of other triangles, by the numbers of those that they are pieces of."""
        part, mirror = (dr.gather(mi.UInt32, a, triangles) for a in (self.part, self.mirror))
        return Shadows(self.mirrors, self.poses, part, mirror)
