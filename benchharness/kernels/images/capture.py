"""Pictures of the parts of a scene: what is on the device for them, and taking one.

A picture holds a packet of 4 floats per texel, premultiplied with coverage: radiance of an object, or unit normal of a mirror
in the axes of the camera, then coverage.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels import cubemap, geometry, optics, packets, raster, surroundings
from benchharness.kernels.frozen import frozen
from benchharness.kernels.images import depthmap, depthrows, impostor
from benchharness.kernels.images.roles import Plan
from benchharness.kernels.types import SceneLike, View

NEAR = 1e-3  # metres; nearer to the centre of an environment map than this nothing is drawn


@dataclass(frozen=True)
class CaptureOptions:
    """How pictures are taken and kept.

    size        texels across a picture
    planes      texels across the picture of a plane
    mip         with mip levels
    resolution  texels per edge of an environment map's face
    turn        radians by which a mirror may move around a part, seen from it, before a depth map is taken again
    walls       height of the walls around the ground, metres
    rotations   of a depth map's rows
    points      of a simplified row; 0 for none, where rays march over the texels
    split_jump  depth steps larger than this, of the whole range 1, are no surface; 0 for none
    """

    size: int
    planes: int
    mip: bool
    resolution: int
    turn: float
    walls: float
    rotations: int = 0
    points: int = 0
    split_jump: float = 0.0


@dataclass
class DeviceScene:
    """A scene on the device.

    plan       who is shown how
    triangles  as `geometry.of_scene_seen` has them
    faces      of each part, and how many
    infinity   its surroundings
    centre     where the panorama was taken, float64 [3]
    metals     as `optics.metals_of` has them
    unit       metres per unit of length
    enclosed   per mirror, as `benchharness.scene.Scene` has it
    """

    plan: Plan
    triangles: geometry.Geometry
    faces: list[tuple[mi.UInt32, int]]
    infinity: surroundings.Surroundings
    centre: np.ndarray
    metals: mi.Float
    unit: float
    enclosed: list[bool]


def uploaded(scene: SceneLike, plan: Plan) -> DeviceScene:
    """A scene on the device. Waits for it."""
    triangles = geometry.of_scene_seen(scene)
    return DeviceScene(
        plan=plan,
        triangles=triangles,
        faces=[faces_of(triangles, part) for part in range(len(scene.parts))],
        infinity=surroundings.of_scene(scene),
        centre=np.zeros(3) if scene.environment is None else np.asarray(scene.environment.centre, np.float64),
        metals=optics.metals_of(scene),
        unit=scene.unit,
        enclosed=list(scene.enclosed),
    )


def faces_of(triangles: geometry.Geometry, part: int) -> tuple[mi.UInt32, int]:
    """The triangles of one part, as `kernels.raster` takes them, and how many. Waits for the device."""
    face = dr.gather(mi.Vector4u, triangles.faces, dr.arange(mi.UInt32, triangles.face_count))
    lane = dr.compress(geometry.part_of(face) == part)
    return packets.stored(dr.gather(mi.Vector4u, triangles.faces, lane), dr.width(lane)), dr.width(lane)


@dataclass
class DeviceCamera:
    """An impostor camera on the device.

    view    what it sees, in world space
    viewer  who the highlights are seen from
    depths  near and far, between which depth maps tell depths
    """

    view: View
    viewer: mi.Point3f
    depths: mi.Vector2f


def on_device(camera: impostor.ImpostorCamera, size: int, viewer: np.ndarray) -> DeviceCamera:
    """A camera for pictures of size x size texels, opaque, with highlights seen from `viewer` [3]."""
    depths, seen_from = mi.Vector2f(camera.near, camera.far), mi.Point3f(*map(float, viewer))
    dr.make_opaque(depths, seen_from)
    return DeviceCamera(impostor.view_of(camera, size), seen_from, depths)


def picture(
    world: geometry.Geometry, faces: mi.UInt32, count: int, camera: DeviceCamera, *, mirror: bool
) -> tuple[mi.Float, mi.Float]:
    """Takes the picture of `count` triangles: its packets, and its depth map as `kernels.images.depthmap` has it.

    world   in world space, as `geometry.placed_seen` has it
    mirror  the triangles are a mirror's: normals, not radiance
    """
    visibility = raster.rasterize(world.points, faces, count, camera.view, cull="back")
    return _resolved(world, faces, visibility, camera, mirror=mirror)


@frozen
def _resolved(
    world: geometry.Geometry, faces: mi.UInt32, visibility: mi.UInt32, camera: DeviceCamera, *, mirror: bool
) -> tuple[mi.Float, mi.Float]:
    """A picture and its depth map from the nearest triangle of every texel."""
    view, near, far = camera.view, camera.depths.x, camera.depths.y
    count = view.width * view.height
    hit, face, weights, p = raster.seen(world.points, faces, visibility, view, dr.arange(mi.UInt32, count))
    if mirror:
        n = dr.normalize(raster.interpolate(world.attributes, face, weights, hit).xyz)
        a, b, k = dr.normalize(view.right), dr.normalize(view.down), -view.w.xyz
        value = mi.Vector3f(dr.dot(n, a), dr.dot(n, b), dr.dot(n, k))
    else:
        value = mi.Vector3f(geometry.radiance(world, face, weights, camera.viewer, hit))
    z = dr.dot(p - view.eye, view.w.xyz)
    zgl = (dr.rcp(near) - dr.rcp(z)) / (dr.rcp(near) - dr.rcp(far))
    texels = packets.stored(dr.select(hit, mi.Vector4f(value.x, value.y, value.z, 1), 0), count)
    return texels, dr.select(hit, dr.clip(zgl, 0, 1), depthmap.BACKGROUND)


@frozen
def simplified(
    depth: mi.Float, size: int, rotations: int, points: int, split_jump: float
) -> tuple[mi.Float, mi.UInt32, mi.UInt32]:
    """The rows of one depth map, how many spans were dropped of each, and of all."""
    rows, dropped = depthrows.build(depth, depthmap.Layout(1, size, rotations, points), split_jump)
    return rows, dropped, dr.sum(dropped)


def environment_map(
    scene: DeviceScene, world: geometry.Geometry, parts: set[int], centre: np.ndarray, resolution: int
) -> mi.Float:
    """The cube map of some parts of a scene and of its surroundings, seen from `centre` [3].

    world  its triangles in world space
    """
    place, near = mi.Point3f(*map(float, centre)), mi.Float(NEAR)
    shown = mi.UInt32([int(part in parts) for part in range(len(scene.plan.shapes))])
    dr.make_opaque(place, near)
    lane = dr.arange(mi.UInt32, world.face_count)
    owner = geometry.part_of(dr.gather(mi.Vector4u, world.faces, lane))
    drawn = dr.gather(mi.UInt32, shown, owner) == 1
    return cubemap.capture(world, drawn, place, resolution, near, scene.infinity)
