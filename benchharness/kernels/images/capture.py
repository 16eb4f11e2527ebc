"""A scene on the device, how pictures of its parts are taken, and environment maps of them."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels import cubemap, geometry, optics, surroundings
from benchharness.kernels.images import atlas, extent
from benchharness.kernels.images.roles import Plan
from benchharness.kernels.types import ReflectorLike, SceneLike

NEAR = 1e-3  # metres; nearer to the centre of an environment map than this nothing is drawn


@dataclass(frozen=True)
class CaptureOptions:
    """How pictures are taken and kept.

    size        texels across a picture, at most
    planes      texels across the picture of a plane
    mip         with mip levels
    resolution  texels per edge of an environment map's face
    turn        radians by which a mirror may move around a part, seen from it, before a depth map is taken again
    walls       height of the walls around the ground, metres
    rotations   of a depth map's rows
    points      of a simplified row; 0 for none, where rays march over the texels
    split_jump  depth steps larger than this, of the whole range 1, are no surface; 0 for none
    again       mirrors reflect in mirrors
    density     texels per pixel, of pictures that are as large as they are seen; 0 for pictures that are all of `size`
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
    again: bool = True
    density: float = 0.0

    @property
    def seen(self) -> bool:
        """Whether pictures are as large as they are seen."""
        return self.density > 0


@dataclass
class DeviceScene:
    """A scene on the device.

    plan       who is shown how
    triangles  as `geometry.of_scene_seen` has them
    runs       of the parts' vertices and triangles in them
    infinity   its surroundings
    centre     where the panorama was taken, float64 [3]
    curvatures the least of each mirror, 1 / unit of length, float64 [mirrors] (`kernels.images.extent`)
    metals     as `optics.metals_of` has them
    unit       metres per unit of length
    enclosed   per mirror, as `benchharness.scene.Scene` has it
    """

    plan: Plan
    triangles: geometry.Geometry
    runs: atlas.Runs
    infinity: surroundings.Surroundings
    centre: np.ndarray
    curvatures: np.ndarray
    metals: mi.Float
    unit: float
    enclosed: list[bool]


def uploaded(scene: SceneLike, plan: Plan) -> DeviceScene:
    """A scene on the device. Waits for it."""
    triangles = geometry.of_scene_seen(scene)
    return DeviceScene(
        plan=plan,
        triangles=triangles,
        runs=atlas.runs_of(triangles, len(scene.parts)),
        infinity=surroundings.of_scene(scene),
        centre=np.zeros(3) if scene.environment is None else np.asarray(scene.environment.centre, np.float64),
        curvatures=np.array([_least_curvature(mirror) for mirror in scene.reflectors]),
        metals=optics.metals_of(scene),
        unit=scene.unit,
        enclosed=list(scene.enclosed),
    )


def _least_curvature(mirror: ReflectorLike) -> float:
    """What a normal map bends, may be hollow anywhere."""
    return 0.0 if mirror.normal_map is not None else extent.least_curvature(mirror.mesh)


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
