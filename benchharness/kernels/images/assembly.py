"""From the pictures of a scene to what rays meet: all of them side by side, where the poses of a frame put them."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels.images import backdrop, billboard, candidates, depthmap, impostor, relief, shelf
from benchharness.kernels.images.bounces import ImpostorScene
from benchharness.kernels.images.capture import CaptureOptions, DeviceScene
from benchharness.kernels.images.refresh import STILL, Captured, centres_of
from benchharness.kernels.images.roles import Plan

OWN_START = 0.03  # of a mirror's radius: so far a ray runs before it may meet the mirror's own depth map


def assembled(scene: DeviceScene, captured: Captured, poses: np.ndarray, options: CaptureOptions) -> ImpostorScene:
    """All that rays can meet, with every part where `poses`, float64 [parts, 3, 4], puts it."""
    plan = scene.plan
    cameras = captured.cameras.moved(poses[plan.parts])
    quads = mi.Float(_quads(plan, cameras).ravel())
    flat, there = plan.plane_slots, captured.sizes > 0
    self_reflecting = any(slot.part == slot.owner(plan.objects) for slot in plan.slots)
    return ImpostorScene(
        planes=billboard.Billboards(quads, candidates.of_lists(plan.planes)),
        plane_pictures=_pictures(captured.planes, options.planes, options, 0),
        boards=billboard.Billboards(quads, candidates.of_lists(plan.quads, there)),
        pictures=_pictures(captured.pictures, options.size, options, flat),
        reliefs=_reliefs(plan, captured, cameras, options),
        backdrop=backdrop.Backdrop(
            infinity=scene.infinity,
            maps=captured.maps,
            resolution=options.resolution,
            walls=_walls(scene, poses, options),
            places=_places(plan, captured),
        ),
        metals=scene.metals,
        mirrors=None if self_reflecting else _boxes(plan, poses),
        enclosed=mi.Bool(scene.enclosed) if any(scene.enclosed) else None,
    )


def _pictures(own: shelf.Shelf, size: int, options: CaptureOptions, first: int) -> billboard.Pictures:
    """Pictures of slots from `first` on, of `size` texels at most."""
    return billboard.Pictures(own.texels, size, options.mip, first, own.places)


def _quads(plan: Plan, cameras: impostor.ImpostorCamera) -> np.ndarray:
    """The table of `billboard.Billboards`, float32 [slots, 4, 4]."""
    quads = np.zeros((max(len(plan.slots), 1), 4, 4), np.float32)
    own, parts = quads[: len(plan.slots)], plan.parts
    deep = plan.owners >= 0
    own[:, 0, :3], own[:, 0, 3] = cameras.centre, np.where(parts >= plan.objects, parts - plan.objects, -1)
    own[:, 1, :3], own[:, 1, 3] = cameras.a / cameras.half[:, :1], deep * (cameras.distance - cameras.near)
    own[:, 2, :3], own[:, 2, 3] = cameras.b / cameras.half[:, 1:], deep * (cameras.far - cameras.distance)
    own[:, 3, :3], own[:, 3, 3] = cameras.k, deep * plan.radii[parts]
    return quads


def _reliefs(
    plan: Plan, captured: Captured, cameras: impostor.ImpostorCamera, options: CaptureOptions
) -> relief.Reliefs | None:
    """The depth maps where their cameras are; None for a plan without any."""
    deep, depths, rows = np.array(plan.deep_slots, int), captured.depths, captured.rows
    if len(deep) == 0:
        return None
    parts = plan.parts[deep]
    start = np.where(parts == plan.owners[deep], OWN_START * plan.radii[parts], 0.0)
    packets = impostor.packets_of(cameras.at(deep), depths.sizes, start)
    firsts = np.zeros(len(deep), int) if rows is None else rows.firsts
    places = np.stack([depths.firsts, depths.sizes, firsts, np.zeros(len(deep), int)], axis=1)
    there, place = depths.sizes > 0, {number: k for k, number in enumerate(deep.tolist())}
    shown = [([place[i] for i in objects], [place[i] for i in mirrors]) for objects, mirrors in plan.maps]
    return relief.Reliefs(
        depth=depths.texels,
        rows=None if rows is None else rows.points,
        dropped=None if rows is None else rows.dropped,
        cameras=mi.Float(packets.astype(np.float32).ravel()),
        slots=mi.UInt32(deep),
        parts=mi.UInt32(parts),
        candidates=candidates.of_lists(shown, there),
        layout=depthmap.Layout(
            len(deep), options.size, max(options.rotations, 1), max(options.points, 2), mi.UInt32(places.ravel())
        ),
    )


def _places(plan: Plan, captured: Captured) -> mi.Float | None:
    """Where the mirrors' environment maps were taken, as `backdrop.Backdrop` has it."""
    if plan.ground is not None or not any(plan.enclosing):
        return None
    middles = np.array([own.centre for own in captured.environments if own is not None])
    return mi.Float(np.pad(middles, ((0, 0), (0, 1))).astype(np.float32).ravel())


def _boxes(plan: Plan, poses: np.ndarray) -> mi.Float:
    """The boxes of all mirrors, as `bounces.ImpostorScene.mirrors` has them."""
    rows = [np.zeros((0, 4))]
    for shape, pose in zip(plan.shapes[plan.objects :], poses[plan.objects :], strict=True):
        half = np.maximum(0.5 * (shape.high - shape.low), STILL * shape.radius)
        turn = pose[:, :3].T / half[:, None]
        rows.append(np.column_stack([turn, -turn @ pose[:, 3] - 0.5 * (shape.low + shape.high) / half]))
    return mi.Float(np.concatenate(rows).astype(np.float32).ravel())


def _walls(scene: DeviceScene, poses: np.ndarray, options: CaptureOptions) -> backdrop.Walls | None:
    """The box over the ground, on the side of the mirrors; None where no ground is morphed."""
    plan, ground = scene.plan, scene.plan.ground
    if ground is None:
        return None
    mirrors = centres_of(plan, poses)[plan.objects :].mean(axis=0)
    viewpoint = poses[ground, :, :3].T @ (mirrors - poses[ground, :, 3])
    camera = impostor.on_plane(plan.shapes[ground], viewpoint).moved(poses[ground])
    up = camera.k * (scene.unit / options.walls)
    vectors = (camera.centre, camera.a / camera.half[0], camera.b / camera.half[1], up, scene.centre)
    middle, a, b, up, centre = ([float(x) for x in v] for v in vectors)
    walls = backdrop.Walls(mi.Point3f(*middle), mi.Vector3f(*a), mi.Vector3f(*b), mi.Vector3f(*up), mi.Point3f(*centre))
    dr.make_opaque(walls)
    return walls
