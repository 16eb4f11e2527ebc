"""Keeping the pictures of a scene true: which of them no longer hold, and taking those again.

A picture is taken again when its part or its mirror has moved since it was taken, never because the eye moved, unless it is as
large as it is seen: then it is taken again when its size changes, and when the mirror has moved around the part by so much
that what stands out farthest has moved by half a texel. It is compared with how things were when it was taken, so that small
steps add up. All is decided on the host, in double precision. A plane's picture is taken once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels import geometry
from benchharness.kernels.eye import Eye
from benchharness.kernels.images import atlas, capture, extent, impostor, rowshelf, shelf
from benchharness.kernels.images.capture import CaptureOptions, DeviceScene
from benchharness.kernels.images.roles import Plan, Slot

STILL = 1e-5  # of a part's radius: a mirror that moved by less, seen from the part, has not moved; poses have single precision


@dataclass
class EnvironmentMap:
    """An environment map.

    poses   where the parts were that it depends on, float64 [N, 3, 4]
    centre  where it was taken, [3]
    near    distance from there to the nearest vertex of what surrounds it
    """

    texels: mi.Float
    poses: np.ndarray
    centre: np.ndarray
    near: float


@dataclass
class Captured:
    """What was taken so far.

    viewpoints    per slot, where its picture is to be seen from, in the space of its part: this decides where the camera
                  stands, [slots, 3]
    cameras       of all slots, in the space of their parts
    planes        pictures of the slots of planes
    pictures      of the other slots
    depths        depth maps of those that need one
    rows          of the depth maps, unless rays march over their texels
    environments  per mirror or, with walls, one; None where all surroundings are at infinity
    maps          those of `environments`, one after the other; None where there are none
    renewed       which slots the last update has taken
    """

    viewpoints: np.ndarray
    cameras: impostor.ImpostorCamera
    planes: shelf.Shelf
    pictures: shelf.Shelf
    depths: shelf.Shelf
    rows: rowshelf.Rows | None
    environments: list[EnvironmentMap | None]
    maps: mi.Float | None
    renewed: list[int]

    @property
    def sizes(self) -> np.ndarray:
        """Texels across the picture of each slot, int [slots]; 0 where there is none."""
        return np.concatenate([self.planes.sizes, self.pictures.sizes])


def nothing(plan: Plan) -> Captured:
    """Before anything was taken."""
    slots, flat = len(plan.slots), plan.plane_slots
    shelves = shelf.empty(flat), shelf.empty(slots - flat), shelf.empty(len(plan.deep_slots))
    return Captured(np.zeros((slots, 3)), impostor.many(slots), *shelves, None, [None] * len(plan.enclosing), None, [])


def refreshed(
    scene: DeviceScene, before: Captured, poses: mi.Float, host: np.ndarray, options: CaptureOptions, eye: Eye | None = None
) -> Captured:
    """The pictures with every part where `poses` (12 floats per part) puts it: those that no longer hold are taken again.
    Waits for the device.

    host  `poses`, as `matrices` has them
    eye   who looks, if pictures are to be as large as they are seen
    """
    plan = scene.plan
    viewpoints = _viewpoints(plan, host)
    sizes = _sizes(scene, before, host, options, eye)
    stale = (sizes > 0) & ((sizes != before.sizes) | ~_holds(plan, before, viewpoints, options, sizes if eye else None))
    new = np.flatnonzero(stale)
    now = replace(before, environments=list(before.environments), renewed=new.tolist())
    if len(new) > 0:
        now.viewpoints, now.cameras = before.viewpoints.copy(), before.cameras.at(np.arange(len(plan.slots)))
        now.viewpoints[new] = viewpoints[new]
        _aim(plan, now.cameras, viewpoints, new)
        world = geometry.placed_seen(scene.triangles, poses, plan.objects)
        _take(scene, now, world, host, sizes, options)
    elif (sizes != before.sizes).any():
        now.pictures = replace(before.pictures, sizes=sizes[plan.plane_slots :])
        now.depths = replace(before.depths, sizes=sizes[plan.deep_slots])
    _refresh_environments(scene, now, poses, host, options, seen=eye is not None)
    return now


def matrices(poses: mi.Float) -> np.ndarray:
    """Poses on the host, float64 [parts, 3, 4]. Waits for the device."""
    return np.array(poses).astype(np.float64).reshape(-1, 3, 4)


def centres_of(plan: Plan, poses: np.ndarray) -> np.ndarray:
    """The centroids of all parts, in world space [parts, 3]."""
    return np.einsum("pij,pj->pi", poses[:, :, :3], plan.centroids) + poses[:, :, 3]


def _viewpoints(plan: Plan, poses: np.ndarray) -> np.ndarray:
    """Where the pictures of all slots are to be seen from, in the space of their parts [slots, 3].

    From their mirror; a mirror's own from beside it, and a plane's amid all other mirrors.
    """
    parts, owners = plan.parts, plan.owners
    centres, mirrors = centres_of(plan, poses), len(plan.shapes) - plan.objects
    shown = (parts >= plan.objects) & (mirrors > 1)  # planes that are mirrors: amid the others
    amid = centres[plan.objects :].sum(axis=0) - shown[:, None] * centres[parts]
    amid = amid / np.maximum(mirrors - shown, 1)[:, None]
    target = np.where((owners < 0)[:, None], amid, centres[owners])
    viewpoints = np.einsum("sji,sj->si", poses[parts, :, :3], target - poses[parts, :, 3])
    for number in np.flatnonzero(parts == owners):
        slot = plan.slots[number]
        shape, sign = plan.shapes[slot.part], 1 - 2 * (slot.direction % 2)
        viewpoints[number] = shape.centroid + sign * shape.radius * np.eye(3)[slot.direction // 2]
    return viewpoints


def _sizes(scene: DeviceScene, before: Captured, poses: np.ndarray, options: CaptureOptions, eye: Eye | None) -> np.ndarray:
    """Texels across the picture of each slot now, int [slots]."""
    plan, flat = scene.plan, scene.plan.plane_slots
    sizes = np.full(len(plan.slots), options.size)
    if eye is not None:
        spheres = extent.Spheres(centres_of(plan, poses), plan.radii)
        wide = extent.pixels(plan, scene.curvatures, spheres, eye, again=options.again)
        sizes = extent.sizes(wide, before.sizes, options.size, options.density)
    sizes[:flat] = options.planes
    return sizes


def _holds(
    plan: Plan, before: Captured, viewpoints: np.ndarray, options: CaptureOptions, sizes: np.ndarray | None
) -> np.ndarray:
    """Whether the picture of each slot, for the viewpoint that it was taken for, holds for another one, bool [slots].

    sizes  texels across, of pictures that are as large as they are seen
    """
    turn = np.zeros(len(plan.slots))
    turn[plan.deep_slots] = options.turn
    if sizes is not None:
        # What stands out by its half width moves across it by the angle: by half a texel of size / 2.
        turn = np.maximum(turn, 1 / np.maximum(sizes, 1))
    centroids = plan.centroids[plan.parts]
    one, other = before.viewpoints - centroids, viewpoints - centroids
    angle = np.arctan2(np.linalg.norm(np.cross(one, other), axis=1), (one * other).sum(axis=1))
    still = np.linalg.norm(one - other, axis=1) < STILL * plan.radii[plan.parts]
    return (plan.owners < 0) | still | (angle < turn)


def _aim(plan: Plan, cameras: impostor.ImpostorCamera, viewpoints: np.ndarray, new: np.ndarray) -> None:
    """Writes the cameras of the slots `new`."""
    for part in np.unique(plan.parts[new]):
        own = new[plan.parts[new] == part]
        shape, flat = plan.shapes[part], own[plan.owners[own] < 0]
        if len(flat) > 0:
            cameras.put(flat, impostor.on_plane(shape, viewpoints[flat[0]]))
        own = own[plan.owners[own] >= 0]
        towards = viewpoints[own] - shape.centroid
        if len(own) > 0:
            first = impostor.facing(shape, towards)
            aside = [n for n, number in enumerate(own) if _is_turned(plan.slots[number], plan.objects)]
            for n in aside:
                slot = plan.slots[own[n]]
                axis = (first.k, first.a, first.b)[slot.direction // 2][n]
                towards[n] = (1 - 2 * (slot.direction % 2)) * axis
            cameras.put(own, impostor.facing(shape, towards) if aside else first)


def _is_turned(slot: Slot, objects: int) -> bool:
    """Whether a slot's camera looks from elsewhere than its viewpoint."""
    return slot.direction > 0 and slot.part != slot.owner(objects)


def _take(
    scene: DeviceScene, now: Captured, world: geometry.Geometry, poses: np.ndarray, sizes: np.ndarray, options: CaptureOptions
) -> None:
    """Takes the pictures of the slots `now.renewed`, whose viewpoints and cameras are there, and puts all in their places."""
    plan, new, flat = scene.plan, np.array(now.renewed), scene.plan.plane_slots
    parts = plan.parts[new]
    seen_from = now.viewpoints[new]
    viewers = np.einsum("sij,sj->si", poses[parts, :, :3], seen_from) + poses[parts, :, 3]
    shots = atlas.Shots(parts, parts >= plan.objects, now.cameras.at(new), sizes[new], viewers)
    sheet, columns, rows = atlas.taken(scene.triangles, scene.runs, world.shine, world.points, shots, options.mip)

    def among(slots: np.ndarray) -> shelf.New:
        """What was taken of `slots`, ascending, by their place among them."""
        taken = np.flatnonzero(np.isin(new, slots))
        return shelf.New(np.searchsorted(slots, new[taken]), columns[taken], rows[taken])

    slots, deep = np.arange(len(plan.slots)), np.array(plan.deep_slots, int)
    if (new < flat).any():
        now.planes = shelf.put(now.planes, sizes[:flat], sheet, among(slots[:flat]), mip=options.mip)
    if (new >= flat).any():
        now.pictures = shelf.put(now.pictures, sizes[flat:], sheet, among(slots[flat:]), mip=options.mip)
    maps = among(deep)
    if len(maps.slots) > 0:
        now.depths = shelf.put(now.depths, sizes[deep], sheet, maps, mip=False, depths=True)
        if options.points > 0:
            now.rows = rowshelf.put(now.rows, now.depths, maps.slots, options)


def _refresh_environments(
    scene: DeviceScene, now: Captured, poses: mi.Float, host: np.ndarray, options: CaptureOptions, *, seen: bool
) -> None:
    """Takes environment maps where a part that is in them has moved, or their mirror; with `seen`, by half a texel."""
    plan, world = scene.plan, None
    shared = plan.ground is not None
    if not shared and not any(plan.enclosing):
        return
    half_texel = 0.25 * np.pi / options.resolution if seen else 0.0
    for mirror in range(1 if shared else len(plan.enclosing)):
        around = set().union(*plan.enclosing) if shared else plan.enclosing[mirror]
        inside = around | {plan.ground} if shared else around | plan.bounds
        centre = scene.centre if shared else centres_of(plan, host)[plan.objects + mirror]
        depends = host[sorted(inside)]
        last = now.environments[mirror]
        if last is not None and (last.poses == depends).all():
            shift = np.linalg.norm(last.centre - centre)
            if shift == 0 or shift < half_texel * last.near:
                continue
        world = geometry.placed_seen(scene.triangles, poses, plan.objects) if world is None else world
        texels = capture.environment_map(scene, world, inside, centre, options.resolution)
        away = [np.linalg.norm(_in_world(plan, part, host) - centre, axis=1).min() for part in around]
        now.environments[mirror] = EnvironmentMap(texels, depends, centre, float(min(away, default=np.inf)))
    if world is not None:
        now.maps = dr.concat([own.texels for own in now.environments if own is not None])


def _in_world(plan: Plan, part: int, poses: np.ndarray) -> np.ndarray:
    """The vertices of a part, [N, 3]."""
    return plan.shapes[part].vertices @ poses[part, :, :3].T + poses[part, :, 3]
