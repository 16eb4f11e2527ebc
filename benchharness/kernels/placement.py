"""Into a mirror's own frame and back. A mirror that moves never changes there: what is prepared for it once stays true."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels.types import View


@dataclass
class MirrorFrame:
    """The eye, the vertices and the picture in a mirror's own coordinates.

    eye       position
    V         the vertices
    x, y, w   coordinates to screen, as `benchharness.api.View` has it for the world
    """

    eye: mi.Point3f
    V: mi.Point3f
    x: mi.Vector4f
    y: mi.Vector4f
    w: mi.Vector4f

    def pixel(self, p: mi.Point3f) -> tuple[mi.Float, mi.Float]:
        """Column and row of a point in front of the eye, as floats."""
        q = mi.Vector4f(p.x, p.y, p.z, 1)
        scale = dr.rcp(dr.maximum(dr.dot(self.w, q), 1e-6))
        return dr.dot(self.x, q) * scale, dr.dot(self.y, q) * scale

    def step(self, p: mi.Point3f, d: mi.Vector3f) -> mi.Float:
        """How many pixels p + d is from p; behind the eye, in the picture of an eye that looks the other way."""
        q = mi.Vector4f(p.x, p.y, p.z, 1)
        depth, along = dr.dot(self.w, q), dr.dot(self.w.xyz, d)
        here, there = (dr.rcp(dr.select(dr.abs(w) > 1e-6, w, 1e-6)) for w in (depth, depth + along))
        x = dr.dot(self.x.xyz, d) - dr.dot(self.x, q) * here * along
        y = dr.dot(self.y.xyz, d) - dr.dot(self.y, q) * here * along
        return dr.norm(mi.Vector2f(x, y)) * dr.abs(there)


def pose_of(poses: mi.Float, part: mi.UInt32) -> list[mi.Vector4f]:
    """Rows of a part's 3 x 4 object-to-world matrix; see `benchharness.api.Frame`."""
    return [dr.gather(mi.Vector4f, poses, part * 3 + k) for k in range(3)]


def mirror_frame(pose: list[mi.Vector4f], V: mi.Point3f, view: View) -> MirrorFrame:
    """Eye, vertices and picture of the world in the frame of a mirror with rigid pose `pose`."""
    columns = [mi.Vector3f(pose[0][k], pose[1][k], pose[2][k]) for k in range(4)]

    def point(p: mi.Point3f) -> mi.Point3f:
        q = p - columns[3]
        return mi.Point3f(*(dr.dot(columns[k], q) for k in range(3)))

    def row(v: mi.Vector4f) -> mi.Vector4f:
        return mi.Vector4f(*(dr.dot(v.xyz, columns[k]) for k in range(3)), dr.dot(v.xyz, columns[3]) + v.w)

    return MirrorFrame(point(view.eye), point(V), row(view.x), row(view.y), row(view.w))


def point_to_world(pose: list[mi.Vector4f], p: mi.Point3f) -> mi.Point3f:
    return mi.Point3f(*(dr.dot(row.xyz, p) + row.w for row in pose))


def normal_to_world(pose: list[mi.Vector4f], n: mi.Normal3f) -> mi.Normal3f:
    return mi.Normal3f(*(dr.dot(row.xyz, n) for row in pose))


def normal_to_mirror(pose: list[mi.Vector4f], n: mi.Normal3f) -> mi.Normal3f:
    return mi.Normal3f(*(dr.dot(mi.Vector3f(pose[0][k], pose[1][k], pose[2][k]), mi.Vector3f(n)) for k in range(3)))


def unit(v: mi.Vector3f) -> mi.Vector3f:
    """v normalised; (0, 0, 0) stays."""
    return v * dr.rcp(dr.maximum(dr.norm(v), 1e-20))
