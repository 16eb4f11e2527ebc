"""Keeping the pictures of a scene true: which of them no longer hold, and taking those again.

A picture is taken again when its part or its mirror has moved since it was taken, never because the eye moved; which ones
that is, is decided on the host, in double precision. A plane's picture is taken once.
"""

from __future__ import annotations

from dataclasses import dataclass

import mitsuba as mi
import numpy as np

from benchharness.kernels import geometry
from benchharness.kernels.images import billboard, capture, impostor
from benchharness.kernels.images.capture import CaptureOptions, DeviceScene
from benchharness.kernels.images.roles import Plan, Slot

STILL = 1e-5  # of a part's radius: a mirror that moved by less, seen from the part, has not moved; poses have single precision


@dataclass
class Rows:
    """A depth map's simplified rows, spans that had no room in each of them, and those of all together."""

    points: mi.Float
    dropped: mi.UInt32
    dropped_in_all: mi.UInt32


@dataclass
class Picture:
    """A picture of a slot.

    viewpoint  where it is to be seen from, in the space of the slot's part: this decides where the camera stands
    camera     in the space of the part
    texels     with mip levels if wanted
    depth      its depth map, of a slot that needs one
    rows       of the depth map, unless rays march over its texels
    """

    viewpoint: np.ndarray
    camera: impostor.ImpostorCamera
    texels: mi.Float
    depth: mi.Float | None = None
    rows: Rows | None = None


@dataclass
class EnvironmentMap:
    """An environment map, and where the parts were that it depends on, float64 [N, 3, 4]."""

    texels: mi.Float
    poses: np.ndarray


@dataclass
class Captured:
    """What was taken so far.

    pictures      per slot, None where nothing yet
    environments  per mirror or, with walls, one; None where all surroundings are at infinity
    renewed       which slots the last update has taken
    """

    pictures: list[Picture | None]
    environments: list[EnvironmentMap | None]
    renewed: list[int]

    def picture(self, slot: int) -> Picture:
        """The picture of a slot, of which one was taken."""
        picture = self.pictures[slot]
        assert picture is not None, slot
        return picture


def nothing(plan: Plan) -> Captured:
    """Before anything was taken."""
    return Captured([None] * len(plan.slots), [None] * len(plan.enclosing), [])


def refreshed(scene: DeviceScene, before: Captured, poses: mi.Float, options: CaptureOptions) -> Captured:
    """The pictures with every part where `poses` (12 floats per part) puts it: those that no longer hold are taken again.
    Waits for the device."""
    plan = scene.plan
    host = matrices(poses)
    world = geometry.placed_seen(scene.triangles, poses, plan.objects)
    deep = set(plan.deep_slots)
    now = Captured(list(before.pictures), list(before.environments), [])
    for number, slot in enumerate(plan.slots):
        viewpoint, last = viewpoint_of(plan, slot, host), before.pictures[number]
        if last is not None and _holds(plan, slot, last.viewpoint, viewpoint, options.turn if number in deep else 0.0):
            continue
        faces, size = scene.faces[slot.part], options.planes if slot.mirror is None else options.size
        camera, pose = _camera(plan, slot, viewpoint), host[slot.part]
        on_device = capture.on_device(camera.moved(pose), size, pose[:, :3] @ viewpoint + pose[:, 3])
        texels, depth = capture.picture(world, *faces, on_device, mirror=slot.part >= plan.objects)
        texels = billboard.with_levels(texels, size) if options.mip else texels
        kept = _with_rows(depth, options) if number in deep else (None, None)
        now.pictures[number] = Picture(viewpoint, camera, texels, *kept)
        now.renewed.append(number)
    _refresh_environments(scene, now, world, host, options)
    return now


def matrices(poses: mi.Float) -> np.ndarray:
    """Poses on the host, float64 [parts, 3, 4]. Waits for the device."""
    return np.array(poses).astype(np.float64).reshape(-1, 3, 4)


def viewpoint_of(plan: Plan, slot: Slot, poses: np.ndarray) -> np.ndarray:
    """Where a slot's picture is to be seen from, in the space of its part: its mirror; for a plane, amid all mirrors."""
    shape, own = plan.shapes[slot.part], slot.owner(plan.objects)
    if slot.part == own:
        axis, sign = slot.direction // 2, 1 - 2 * (slot.direction % 2)
        return shape.centroid + sign * shape.radius * np.eye(3)[axis]
    mirrors = range(plan.objects, len(plan.shapes)) if slot.mirror is None else [own]
    mirrors = [m for m in mirrors if m != slot.part] or [slot.part]
    world = np.mean([centre_of(plan, m, poses) for m in mirrors], axis=0)
    return poses[slot.part, :, :3].T @ (world - poses[slot.part, :, 3])


def centre_of(plan: Plan, part: int, poses: np.ndarray) -> np.ndarray:
    """The centroid of a part, in world space [3]."""
    return poses[part, :, :3] @ plan.shapes[part].centroid + poses[part, :, 3]


def _holds(plan: Plan, slot: Slot, last: np.ndarray, now: np.ndarray, turn: float) -> bool:
    """Whether a picture for the viewpoint `last` holds for `now`."""
    shape = plan.shapes[slot.part]
    if slot.mirror is None or np.linalg.norm(last - now) < STILL * shape.radius:
        return True
    one, other = last - shape.centroid, now - shape.centroid
    return bool(np.arctan2(np.linalg.norm(np.cross(one, other)), np.dot(one, other)) < turn)


def _camera(plan: Plan, slot: Slot, viewpoint: np.ndarray) -> impostor.ImpostorCamera:
    """The camera of a slot's picture, in the space of its part."""
    shape = plan.shapes[slot.part]
    if slot.mirror is None:
        return impostor.on_plane(shape, viewpoint)
    first = impostor.facing(shape, viewpoint - shape.centroid)
    if slot.direction == 0 or slot.part == slot.owner(plan.objects):
        return first
    axis, sign = (first.k, first.a, first.b)[slot.direction // 2], 1 - 2 * (slot.direction % 2)
    return impostor.facing(shape, sign * axis)


def _with_rows(depth: mi.Float, options: CaptureOptions) -> tuple[mi.Float, Rows | None]:
    """A depth map, and its simplified rows unless rays march over its texels."""
    if options.points == 0:
        return depth, None
    return depth, Rows(*capture.simplified(depth, options.size, options.rotations, options.points, options.split_jump))


def _refresh_environments(
    scene: DeviceScene, now: Captured, world: geometry.Geometry, poses: np.ndarray, options: CaptureOptions
) -> None:
    """Takes environment maps where a part that is in them, or their mirror, has moved."""
    plan = scene.plan
    shared = plan.ground is not None
    if not shared and not any(plan.enclosing):
        return
    for mirror in range(1 if shared else len(plan.enclosing)):
        inside = {plan.ground}.union(*plan.enclosing) if shared else plan.enclosing[mirror] | plan.bounds
        own = plan.objects + mirror
        depends = poses[sorted(inside) if shared else [*sorted(inside), own]]
        last = now.environments[mirror]
        if last is not None and (last.poses == depends).all():
            continue
        centre = scene.centre if shared else centre_of(plan, own, poses)
        texels = capture.environment_map(scene, world, inside, centre, options.resolution)
        now.environments[mirror] = EnvironmentMap(texels, depends)
