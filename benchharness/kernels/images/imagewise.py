"""What methods share that meet reflected rays with pictures of the scene: taking them, keeping them true, looking at them.

`kernels.roles` says which parts of the scene are shown by which pictures. A picture is taken again when its part or its
mirror has moved since it was taken, never because the eye moved; which ones that is, is decided on the host, in double
precision. A plane's picture is taken once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels import cubemap, geometry, optics, pixels, surroundings
from benchharness.kernels.frozen import frozen
from benchharness.kernels.images import backdrop, billboard, bounces, depthmap, depthrows, impostor, relief
from benchharness.kernels.images.roles import Listed, Plan, Slot

OWN_START = 0.03  # of a mirror's radius: so far a ray runs before it may meet the mirror's own depth map
STILL = 1e-5  # of a part's radius: a mirror that moved by less, seen from the part, has not moved; poses have single precision
NEAR = 1e-3  # metres; nearer to the centre of an environment map than this nothing is drawn


@dataclass(frozen=True)
class Options:
    """How pictures are kept.

    size        texels across a picture
    planes      texels across the picture of a plane
    mip         with mip levels
    resolution  texels per edge of an environment map's face
    turn        radians by which a mirror may move around a part, seen from it, before a depth map is taken again
    walls       height of the walls around the ground, metres
    rotations   of a depth map's rows
    points      of a simplified row; 0 for none, where rays march over the texels
    jump        depth steps larger than this, of the whole range 1, are no surface; 0 for none
    """

    size: int
    planes: int
    mip: bool
    resolution: int
    turn: float
    walls: float
    rotations: int = 0
    points: int = 0
    jump: float = 0.0


@dataclass
class Stage:
    """The scene on the device: `triangles` as `geometry.of_scene_seen` has them, `metals` as `optics.metals_of`, per part its
    faces and how many; `centre`: where the panorama was taken; `unit`: metres per unit of length; `enclosed`: as
    `benchharness.scene.Scene` has it."""

    plan: Plan
    triangles: geometry.Geometry
    faces: list[tuple[mi.UInt32, int]]
    infinity: surroundings.Surroundings
    centre: np.ndarray
    metals: mi.Float
    unit: float
    enclosed: list[bool]


@dataclass
class Taken:
    """What was taken so far, per slot, None where nothing yet.

    viewpoints  where the picture is to be seen from, in the space of the slot's part: this decides `stands`
    stands      the camera, in the space of the part
    texels      with mip levels if wanted
    depths      depth maps, of slots that need one
    rows        simplified, of those
    dropped     spans that had no room in each of their rows, of those
    spans       all of them together
    poses       per mirror, of the parts that its environment map depends on
    maps        environment maps, per mirror or, with walls, one; none where all surroundings are at infinity
    renewed     which slots the last update has taken
    """

    viewpoints: list
    stands: list
    texels: list
    depths: list
    rows: list
    dropped: list
    spans: list
    poses: list
    maps: list
    renewed: list[int]


def stage(scene, planned: Plan) -> Stage:
    """Uploads a scene. Waits for the device."""
    triangles = geometry.of_scene_seen(scene)
    faces = [impostor.faces_of(triangles, part) for part in range(len(scene.parts))]
    centre = np.zeros(3) if scene.environment is None else np.asarray(scene.environment.centre, np.float64)
    metals, enclosed = optics.metals_of(scene), list(scene.enclosed)
    return Stage(planned, triangles, faces, surroundings.of_scene(scene), centre, metals, scene.unit, enclosed)


def nothing(planned: Plan) -> Taken:
    """Before anything was taken."""
    slots, mirrors = len(planned.slots), len(planned.enclosing)
    return Taken(*([None] * slots for _ in range(7)), [None] * mirrors, [None] * mirrors, [])


def retaken(on: Stage, before: Taken, poses: mi.Float, options: Options) -> Taken:
    """The pictures with every part where `poses` (12 floats per part) puts it: those that no longer hold are taken again.
    Waits for the device."""
    planned = on.plan
    host = np.array(poses).astype(np.float64).reshape(-1, 3, 4)
    world = geometry.placed_seen(on.triangles, poses, planned.objects)
    deep = set(planned.deep_slots)
    now = replace(before, **{name: list(getattr(before, name)) for name in vars(before)})
    now.renewed = []
    for number, slot in enumerate(planned.slots):
        shape, pose = planned.shapes[slot.part], host[slot.part]
        viewpoint, last = _viewpoint(planned, slot, host), before.viewpoints[number]
        if last is not None and _still(shape, slot, last, viewpoint, options.turn if number in deep else 0.0):
            continue
        stand = _stand(shape, slot, viewpoint, slot.part == slot.owner(planned.objects))
        seen_from = mi.Point3f(*map(float, pose[:, :3] @ viewpoint + pose[:, 3]))
        size = options.planes if slot.mirror is None else options.size
        texels, depth = _take(on, world, slot, stand.moved(pose), seen_from, size)
        now.viewpoints[number], now.stands[number] = viewpoint, stand
        now.texels[number] = billboard.with_levels(texels, size) if options.mip else texels
        if number in deep:
            now.depths[number] = depth
            if options.points:
                rows = _simplified(depth, size, options.rotations, options.points, options.jump)
                now.rows[number], now.dropped[number], now.spans[number] = rows
        now.renewed.append(number)
    _renew_maps(on, now, world, host, options)
    return now


def _viewpoint(planned: Plan, slot: Slot, poses: np.ndarray) -> np.ndarray:
    """Where a slot's picture is to be seen from, in the space of its part: its mirror; for a plane, amid all mirrors."""
    shape, own = planned.shapes[slot.part], slot.owner(planned.objects)
    if slot.part == own:
        axis, sign = slot.direction // 2, 1 - 2 * (slot.direction % 2)
        return shape.centroid + sign * shape.radius * np.eye(3)[axis]
    mirrors = range(planned.objects, len(planned.shapes)) if slot.mirror is None else [own]
    mirrors = [m for m in mirrors if m != slot.part] or [slot.part]
    world = np.mean([poses[m, :, :3] @ planned.shapes[m].centroid + poses[m, :, 3] for m in mirrors], axis=0)
    return poses[slot.part, :, :3].T @ (world - poses[slot.part, :, 3])


def _still(shape: impostor.Shape, slot: Slot, last: np.ndarray, now: np.ndarray, turn: float) -> bool:
    """Whether a picture for the viewpoint `last` holds for `now`."""
    if slot.mirror is None or np.linalg.norm(last - now) < STILL * shape.radius:
        return True
    one, other = last - shape.centroid, now - shape.centroid
    return bool(np.arctan2(np.linalg.norm(np.cross(one, other)), np.dot(one, other)) < turn)


def _stand(shape: impostor.Shape, slot: Slot, viewpoint: np.ndarray, own: bool) -> impostor.Stand:
    if slot.mirror is None:
        return impostor.on_plane(shape, viewpoint)
    first = impostor.facing(shape, viewpoint - shape.centroid)
    if own:
        return first
    axis, sign = (first.k, first.a, first.b)[slot.direction // 2], 1 - 2 * (slot.direction % 2)
    return first if slot.direction == 0 else impostor.facing(shape, sign * axis)


def _take(on: Stage, world: geometry.Geometry, slot: Slot, stand: impostor.Stand, viewer: mi.Point3f, size: int):
    depths = mi.Vector2f(stand.near, stand.far)
    dr.make_opaque(depths, viewer)
    faces, count = on.faces[slot.part]
    camera = impostor.window(stand, size)
    return impostor.picture(world, faces, count, camera, viewer, depths, slot.part >= on.plan.objects)


@frozen
def _simplified(depth: mi.Float, size: int, rotations: int, points: int, jump: float) -> tuple[mi.Float, mi.UInt32, mi.UInt32]:
    """The rows of one depth map, how many spans were dropped of each, and of all."""
    rows, dropped = depthrows.build(depth, depthmap.Layout(1, size, rotations, points), jump)
    return rows, dropped, dr.sum(dropped)


def _renew_maps(on: Stage, now: Taken, world: geometry.Geometry, poses: np.ndarray, options: Options) -> None:
    """Takes environment maps where a part that is in them, or their mirror, has moved."""
    planned = on.plan
    shared = planned.ground is not None
    if not shared and not any(planned.enclosing):
        return
    for mirror in range(1 if shared else len(planned.enclosing)):
        inside = {planned.ground}.union(*planned.enclosing) if shared else planned.enclosing[mirror] | planned.bounds
        own = planned.objects + mirror
        depends = poses[sorted(inside) if shared else [*sorted(inside), own]]
        if now.poses[mirror] is not None and (now.poses[mirror] == depends).all():
            continue
        centre = on.centre if shared else _centre(planned, own, poses)
        place, near = mi.Point3f(*map(float, centre)), mi.Float(NEAR)
        shown = mi.UInt32([int(part in inside) for part in range(len(planned.shapes))])
        dr.make_opaque(place, near)
        lane = dr.arange(mi.UInt32, world.face_count)
        owner = geometry.part_of(dr.gather(mi.Vector4u, world.faces, lane))
        wanted = dr.gather(mi.UInt32, shown, owner) == 1
        now.maps[mirror] = cubemap.capture(world, wanted, place, options.resolution, near, on.infinity)
        now.poses[mirror] = depends


def _centre(planned: Plan, part: int, poses: np.ndarray) -> np.ndarray:
    return poses[part, :, :3] @ planned.shapes[part].centroid + poses[part, :, 3]


def _places(planned: Plan, poses: np.ndarray) -> mi.Float | None:
    """Of the mirrors' environment maps, as `backdrop.Backdrop` has them."""
    if planned.ground is not None or not any(planned.enclosing):
        return None
    mirrors = range(planned.objects, len(planned.shapes))
    return mi.Float(np.array([[*_centre(planned, m, poses), 0] for m in mirrors], np.float32).ravel())


def cast(on: Stage, taken: Taken, poses: mi.Float, options: Options, before: bounces.Cast | None) -> bounces.Cast:
    """All that rays can meet, with every part where `poses` puts it. Waits for the device.

    before  of the last update: its texels are used again where no picture was taken
    """
    planned = on.plan
    host = np.array(poses).astype(np.float64).reshape(-1, 3, 4)
    quads = np.zeros((max(len(planned.slots), 1), 4, 4), np.float32)
    for number, slot in enumerate(planned.slots):
        stand = taken.stands[number].moved(host[slot.part])
        quads[number, 0] = [*stand.centre, slot.part - planned.objects if slot.part >= planned.objects else -1]
        deep = planned.shapes[slot.part].plane is None
        quads[number, 1] = [*(stand.a / stand.half[0]), deep * (stand.distance - stand.near)]
        quads[number, 2] = [*(stand.b / stand.half[1]), deep * (stand.far - stand.distance)]
        quads[number, 3] = [*stand.k, deep * planned.shapes[slot.part].radius]
    flat, table = planned.plane_slots, mi.Float(quads.ravel())
    plane_texels = _together(taken, range(flat), None if before is None else before.plane_pictures)
    texels = _together(taken, range(flat, len(planned.slots)), None if before is None else before.pictures)
    return bounces.Cast(
        billboard.Billboards(table, *_lists(planned.planes)),
        billboard.Pictures(plane_texels, options.planes, options.mip),
        billboard.Billboards(table, *_lists(planned.quads)),
        billboard.Pictures(texels, options.size, options.mip, flat),
        _reliefs(on, taken, host, options, None if before is None else before.reliefs),
        backdrop.Backdrop(
            on.infinity, _joined_maps(taken), options.resolution, _walls(on, host, options), _places(planned, host)
        ),
        on.metals,
        None if any(slot.part == slot.owner(planned.objects) for slot in planned.slots) else _boxes(planned, host),
        mi.Bool(on.enclosed) if any(on.enclosed) else None,
    )


def _together(taken: Taken, slots: range, before: billboard.Pictures | None) -> mi.Float:
    """The texels of some slots, one after the other: those of `before` if none was taken since."""
    if before is not None and not any(number in slots for number in taken.renewed):
        return before.texels
    return dr.concat([taken.texels[number] for number in slots]) if slots else dr.zeros(mi.Float, 4)


def _reliefs(
    on: Stage, taken: Taken, poses: np.ndarray, options: Options, before: relief.Reliefs | None
) -> relief.Reliefs | None:
    """The depth maps where `poses` puts them; None for a plan without any."""
    planned = on.plan
    deep = planned.deep_slots
    if not deep:
        return None
    cameras = []
    for number in deep:
        slot, shape = planned.slots[number], planned.shapes[planned.slots[number].part]
        own = slot.part == slot.owner(planned.objects)
        start = OWN_START * shape.radius if own else 0.0
        cameras += impostor.camera(taken.stands[number].moved(poses[slot.part]), options.size, start)
    if before is None or set(taken.renewed) & set(deep):
        depth = dr.concat([taken.depths[number] for number in deep])
        rows, dropped = (
            dr.concat([of[number] for number in deep]) if options.points else None for of in (taken.rows, taken.dropped)
        )
    else:
        depth, rows, dropped = before.depth, before.rows, before.dropped
    parts = mi.UInt32([planned.slots[number].part for number in deep])
    numbers = {number: k for k, number in enumerate(deep)}
    shown = [([numbers[i] for i in objects], [numbers[i] for i in mirrors]) for objects, mirrors in planned.maps]
    layout = depthmap.Layout(len(deep), options.size, max(options.rotations, 1), max(options.points, 2))
    return relief.Reliefs(depth, rows, dropped, mi.Float(cameras), mi.UInt32(deep), parts, *_lists(shown), layout)


def _boxes(planned: Plan, poses: np.ndarray) -> mi.Float:
    """Of all mirrors, as `bounces.Cast.mirrors` has them."""
    rows = [np.zeros((0, 4))]
    for shape, pose in zip(planned.shapes[planned.objects :], poses[planned.objects :], strict=True):
        half = np.maximum(0.5 * (shape.high - shape.low), STILL * shape.radius)
        turn = pose[:, :3].T / half[:, None]
        rows.append(np.column_stack([turn, -turn @ pose[:, 3] - 0.5 * (shape.low + shape.high) / half]))
    return mi.Float(np.concatenate(rows).astype(np.float32).ravel())


def _lists(shown: list[Listed]) -> tuple[mi.UInt32, int, int]:
    """Slots per mirror as a table, how many columns it has, and how many of them are for objects."""
    objects = max((len(own) for own, _ in shown), default=0)
    columns = objects + max((len(mirrors) for _, mirrors in shown), default=0)
    table = np.full((len(shown), max(columns, 1)), billboard.NONE, np.uint32)
    for row, (own, mirrors) in zip(table, shown, strict=True):
        row[: len(own)] = own
        row[objects : objects + len(mirrors)] = mirrors
    return mi.UInt32(table.ravel()), columns, objects


def _joined_maps(taken: Taken) -> mi.Float | None:
    maps = [own for own in taken.maps if own is not None]
    return dr.concat(maps) if maps else None


def _walls(on: Stage, poses: np.ndarray, options: Options) -> backdrop.Walls | None:
    """The box over the ground, on the side of the mirrors."""
    ground = on.plan.ground
    if ground is None:
        return None
    viewpoint = _viewpoint(on.plan, Slot(ground, None), poses)
    stand = impostor.on_plane(on.plan.shapes[ground], viewpoint).moved(poses[ground])
    numbers = (stand.centre, stand.a / stand.half[0], stand.b / stand.half[1], stand.k * (on.unit / options.walls), on.centre)
    middle, a, b, up, centre = ([float(x) for x in v] for v in numbers)
    walls = backdrop.Walls(mi.Point3f(*middle), mi.Vector3f(*a), mi.Vector3f(*b), mi.Vector3f(*up), mi.Point3f(*centre))
    dr.make_opaque(walls)
    return walls


@dataclass
class State:
    """What a method keeps: the scene, what was taken of it, and what rays can meet; None before the first `updated`."""

    stage: Stage
    taken: Taken
    cast: bounces.Cast | None


def begun(scene, planned: Plan) -> State:
    """The state that updates start from. Waits for the device."""
    return State(stage(scene, planned), nothing(planned), None)


def updated(state: State, poses: mi.Float, options: Options) -> State:
    """With every part where `poses` (12 floats per part) puts it. Waits for the device."""
    taken = retaken(state.stage, state.taken, poses, options)
    return State(state.stage, taken, cast(state.stage, taken, poses, options, state.cast))


@dataclass
class Shown:
    """The fields of `benchharness.api.Reflection`, and the state that the next frame starts from."""

    L: mi.Color3f
    distance: mi.Float
    counters: dict[str, mi.UInt32]
    state: State
    doubt: mi.Bool
    found: mi.Bool


def shown(state: State, frame, manner: bounces.Manner, attenuation: float) -> Shown:
    """What all mirrors of a `benchharness.api.Frame` show.

    attenuation  share of the light lost per metre of the reflected ray, as exp(-attenuation distance)

    Counters, one number for each of `frame.pixels`: rays against quads; segments or texels of depth maps; 1 where a ray
    reflects twice. Besides, pictures that the last update took, and spans that its depth maps dropped.
    """
    taken = state.taken
    after = replace(state, taken=replace(taken, renewed=[]))
    renewed = dr.opaque(mi.UInt32, len(taken.renewed))
    spans = [taken.spans[number] for number in taken.renewed if taken.spans[number] is not None]
    counters = {"pictures_taken": renewed, "spans_dropped": dr.concat(spans) if spans else mi.UInt32(0)}
    if dr.width(frame.pixels) == 0:  # no mirror in view
        empty = dr.zeros(mi.Float, dr.width(frame.active))
        return Shown(mi.Color3f(empty), empty, counters, after, mi.Bool(False), mi.Bool(frame.active))
    answer = bounces.reflected(state.cast, frame.view, [frame.p, frame.n, frame.reflector], frame.pixels, manner)
    L = answer.L * dr.exp(-attenuation * state.stage.unit * answer.distance) if attenuation > 0 else answer.L
    values = [L.x, L.y, L.z, answer.distance, answer.doubt]
    x, y, z, distance, doubt = pixels.spread(values, frame.pixels, frame.view)
    found = mi.Bool(frame.active)
    if any(state.stage.enclosed):
        found &= pixels.spread([answer.found], frame.pixels, frame.view)[0]
    counters |= {"quad_tests": answer.tests, "depth_steps": answer.work, "second_order": mi.UInt32(answer.second)}
    return Shown(mi.Color3f(x, y, z), distance, counters, after, doubt, found)
