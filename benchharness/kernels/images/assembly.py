"""From the pictures of a scene to what rays meet: all of them side by side, where the poses of a frame put them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels.images import backdrop, billboard, candidates, depthmap, impostor, relief
from benchharness.kernels.images.bounces import ImpostorScene
from benchharness.kernels.images.capture import CaptureOptions, DeviceScene
from benchharness.kernels.images.refresh import STILL, Captured, centre_of, matrices, viewpoint_of
from benchharness.kernels.images.roles import Plan, Slot

OWN_START = 0.03  # of a mirror's radius: so far a ray runs before it may meet the mirror's own depth map


def assembled(
    scene: DeviceScene, captured: Captured, poses: mi.Float, options: CaptureOptions, before: ImpostorScene | None
) -> ImpostorScene:
    """All that rays can meet, with every part where `poses` puts it. Waits for the device.

    before  of the last update: its texels are used again where no picture was taken
    """
    plan = scene.plan
    host = matrices(poses)
    cameras = _cameras(plan, captured, host)
    quads = mi.Float(_quads(plan, cameras).ravel())
    flat = plan.plane_slots
    plane_texels = _together(captured, range(flat), None if before is None else before.plane_pictures)
    texels = _together(captured, range(flat, len(plan.slots)), None if before is None else before.pictures)
    self_reflecting = any(slot.part == slot.owner(plan.objects) for slot in plan.slots)
    return ImpostorScene(
        planes=billboard.Billboards(quads, candidates.of_lists(plan.planes)),
        plane_pictures=billboard.Pictures(plane_texels, options.planes, options.mip),
        boards=billboard.Billboards(quads, candidates.of_lists(plan.quads)),
        pictures=billboard.Pictures(texels, options.size, options.mip, flat),
        reliefs=_reliefs(plan, captured, cameras, options, None if before is None else before.reliefs),
        backdrop=backdrop.Backdrop(
            infinity=scene.infinity,
            maps=_joined([own.texels for own in captured.environments if own is not None]),
            resolution=options.resolution,
            walls=_walls(scene, host, options),
            places=_places(plan, host),
        ),
        metals=scene.metals,
        mirrors=None if self_reflecting else _boxes(plan, host),
        enclosed=mi.Bool(scene.enclosed) if any(scene.enclosed) else None,
    )


def _quads(plan: Plan, cameras: list[impostor.ImpostorCamera]) -> np.ndarray:
    """The table of `billboard.Billboards`, float32 [slots, 4, 4]."""
    quads = np.zeros((max(len(plan.slots), 1), 4, 4), np.float32)
    for quad, slot, camera in zip(quads, plan.slots, cameras, strict=False):
        shape = plan.shapes[slot.part]
        deep = shape.plane is None
        quad[0] = [*camera.centre, slot.part - plan.objects if slot.part >= plan.objects else -1]
        quad[1] = [*(camera.a / camera.half[0]), deep * (camera.distance - camera.near)]
        quad[2] = [*(camera.b / camera.half[1]), deep * (camera.far - camera.distance)]
        quad[3] = [*camera.k, deep * shape.radius]
    return quads


def _cameras(plan: Plan, captured: Captured, poses: np.ndarray) -> list[impostor.ImpostorCamera]:
    """The cameras of all slots, in world space."""
    return [captured.picture(number).camera.moved(poses[slot.part]) for number, slot in enumerate(plan.slots)]


def _together(captured: Captured, slots: range, before: billboard.Pictures | None) -> mi.Float:
    """The texels of some slots, one after the other: those of `before` if none was taken since."""
    if before is not None and not any(number in slots for number in captured.renewed):
        return before.texels
    texels = _joined([captured.picture(number).texels for number in slots])
    return dr.zeros(mi.Float, 4) if texels is None else texels


def _joined(buffers: Sequence[Any]) -> Any:
    """Buffers one after the other; None where there are none."""
    return dr.concat(list(buffers)) if buffers else None


def _reliefs(
    plan: Plan,
    captured: Captured,
    cameras: list[impostor.ImpostorCamera],
    options: CaptureOptions,
    before: relief.Reliefs | None,
) -> relief.Reliefs | None:
    """The depth maps where their cameras are; None for a plan without any."""
    deep = plan.deep_slots
    if not deep:
        return None
    numbers = []
    for number in deep:
        slot = plan.slots[number]
        own = slot.part == slot.owner(plan.objects)
        start = OWN_START * plan.shapes[slot.part].radius if own else 0.0
        numbers += impostor.packet_of(cameras[number], options.size, start)
    if before is None or set(captured.renewed) & set(deep):
        pictures = [captured.picture(number) for number in deep]
        simplified = [picture.rows for picture in pictures if picture.rows is not None]
        depth = dr.concat([picture.depth for picture in pictures])
        rows = _joined([own.points for own in simplified])
        dropped = _joined([own.dropped for own in simplified])
    else:
        depth, rows, dropped = before.depth, before.rows, before.dropped
    place = {number: k for k, number in enumerate(deep)}
    shown = [([place[i] for i in objects], [place[i] for i in mirrors]) for objects, mirrors in plan.maps]
    return relief.Reliefs(
        depth=depth,
        rows=rows,
        dropped=dropped,
        cameras=mi.Float(numbers),
        slots=mi.UInt32(deep),
        parts=mi.UInt32([plan.slots[number].part for number in deep]),
        candidates=candidates.of_lists(shown),
        layout=depthmap.Layout(len(deep), options.size, max(options.rotations, 1), max(options.points, 2)),
    )


def _places(plan: Plan, poses: np.ndarray) -> mi.Float | None:
    """Where the mirrors' environment maps were taken, as `backdrop.Backdrop` has it."""
    if plan.ground is not None or not any(plan.enclosing):
        return None
    mirrors = range(plan.objects, len(plan.shapes))
    return mi.Float(np.array([[*centre_of(plan, m, poses), 0] for m in mirrors], np.float32).ravel())


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
    viewpoint = viewpoint_of(plan, Slot(ground, None), poses)
    camera = impostor.on_plane(plan.shapes[ground], viewpoint).moved(poses[ground])
    up = camera.k * (scene.unit / options.walls)
    vectors = (camera.centre, camera.a / camera.half[0], camera.b / camera.half[1], up, scene.centre)
    middle, a, b, up, centre = ([float(x) for x in v] for v in vectors)
    walls = backdrop.Walls(mi.Point3f(*middle), mi.Vector3f(*a), mi.Vector3f(*b), mi.Vector3f(*up), mi.Point3f(*centre))
    dr.make_opaque(walls)
    return walls
