"""Which part of a scene is shown by what, where reflected rays meet pictures of it. Decided once, on the host.

Each mirror sees each part of the scene as one of

    plane         a flat part is a billboard in its own plane, one picture for all mirrors
    impostor      anything else is shown by pictures taken for this mirror: by a billboard or by depth maps
    surroundings  an object whose convex hull holds the mirror (a room), or that goes around the mirror at a distance (walls
                  over a wainscot), has no picture from the mirror's side: it goes to the environment map of this mirror; so
                  do flat objects that close the room, such as its ceiling, so that no gap opens between what has parallax
                  and what has not

Hulls, not boxes along the axes: a scene that is turned has the same roles.

Every picture has a number, its slot.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import ConvexHull

from benchharness.kernels.images import impostor
from benchharness.kernels.images.candidates import Listed
from benchharness.kernels.types import SceneLike

NEAR_WALL = 0.02  # of a room's size: as near as this to a wall, a flat object belongs to it

WIDEST_DEG = 75.0  # of the cone around a part, seen from a mirror, from its axis: what is wider goes around the mirror
DISTANT = 2.0  # radii of a mirror: what goes around it nearer than this has too much parallax for an environment map


@dataclass(frozen=True)
class Slot:
    """A picture.

    part       what it shows
    mirror     for whom, None for a plane's
    direction  of a depth map: 0 from the mirror, 1 from behind, then from both sides, below and above; of a mirror's own: from
               either end of its axes
    """

    part: int
    mirror: int | None
    direction: int = 0

    def owner(self, objects: int) -> int | None:
        """The part that is its mirror; `objects` is the first mirror's."""
        return None if self.mirror is None else objects + self.mirror


@dataclass(frozen=True, eq=False)
class Plan:
    """Who is shown how. Decided once, on the host.

    shapes      of all parts
    objects     how many parts are objects; mirrors come after them
    slots       all pictures, those of planes first
    planes      per mirror, slots that it shows in their own plane: objects, then other mirrors
    quads       per mirror, slots that it shows as billboards, likewise
    maps        per mirror, slots that it shows as depth maps, likewise
    enclosing   per mirror, the objects that surround it; empty if none does
    bounds      flat objects that reach the hull of what surrounds a mirror: they close it
    ground      the object that goes on in the panorama, if the morph is wanted; shown by the environment map
    """

    shapes: list[impostor.Shape]
    objects: int
    slots: list[Slot]
    planes: list[Listed]
    quads: list[Listed]
    maps: list[Listed]
    enclosing: list[set[int]]
    bounds: set[int]
    ground: int | None = None

    @cached_property
    def plane_slots(self) -> int:
        """How many slots are planes'."""
        return sum(slot.mirror is None for slot in self.slots)

    @cached_property
    def deep_slots(self) -> list[int]:
        """The slots that are shown as depth maps, ascending."""
        return sorted({slot for objects, mirrors in self.maps for slot in (*objects, *mirrors)})

    @cached_property
    def parts(self) -> np.ndarray:
        """What each slot shows, int [slots]."""
        return np.array([slot.part for slot in self.slots], int)

    @cached_property
    def owners(self) -> np.ndarray:
        """The part that is each slot's mirror, int [slots]; -1 for a plane's."""
        owners = (slot.owner(self.objects) for slot in self.slots)
        return np.array([-1 if owner is None else owner for owner in owners], int)

    @cached_property
    def centroids(self) -> np.ndarray:
        """Of all parts, in their own space, float64 [parts, 3]."""
        return np.array([shape.centroid for shape in self.shapes]).reshape(-1, 3)

    @cached_property
    def radii(self) -> np.ndarray:
        """Of the spheres around the centroids of all parts, float64 [parts]."""
        return np.array([shape.radius for shape in self.shapes])


def plan(scene: SceneLike, *, maps: int = 0, own_maps: int = 0, mirrors: bool = True, ground: int | None = None) -> Plan:
    """The roles of all parts of a scene at its start.

    maps      depth maps per part and mirror; 0 for billboards
    own_maps  depth maps of each mirror for itself
    mirrors   whether other mirrors are shown at all
    ground    number of the object whose border is morphed, or None
    """
    parts, objects = scene.parts, len(scene.objects)
    shapes = [impostor.shape_of(part.mesh.vertices, part.mesh.faces) for part in parts]
    points = [_in_world(shape, part.pose(0.0)) for shape, part in zip(shapes, parts, strict=True)]
    shown = [n for n in range(objects) if n != ground] + (list(range(objects, len(parts))) if mirrors else [])
    own = range(objects, len(parts))
    hulls: dict[int, np.ndarray] = {}
    enclosing = [{n for n in shown if n < objects and _surrounds(n, shapes, points, hulls, points[m])} for m in own]

    slots: list[Slot] = []
    alone = len(own) == 1  # then nobody shows the mirror
    flat = [n for n in shown if shapes[n].plane is not None and not any(n in around for around in enclosing)]
    flat = [n for n in flat if n < objects or not alone]
    in_plane = {n: _added(slots, Slot(n, None)) for n in flat}
    around = set().union(*enclosing)
    bounds = {n for n in in_plane if n < objects and any(_reaches(points[n], hulls[room], points[room]) for room in around)}
    result = Plan(
        shapes=shapes,
        objects=objects,
        slots=slots,
        planes=[],
        quads=[],
        maps=[],
        enclosing=enclosing,
        bounds=bounds,
        ground=ground,
    )
    for number, mirror in enumerate(own):
        planes, quads, depths = ([], []), ([], []), ([], [])
        for n in shown:
            kind = int(n >= objects)
            if n == mirror or n in enclosing[number]:
                continue
            if n in in_plane:
                planes[kind].append(in_plane[n])
            elif maps == 0:
                quads[kind].append(_added(slots, Slot(n, number)))
            else:
                depths[kind].extend(_added(slots, Slot(n, number, k)) for k in range(maps))
        depths[1].extend(_added(slots, Slot(mirror, number, k)) for k in range(own_maps))
        result.planes.append(planes)
        result.quads.append(quads)
        result.maps.append(depths)
    return result


def _added(slots: list[Slot], slot: Slot) -> int:
    """The number that a slot gets at the end of all."""
    slots.append(slot)
    return len(slots) - 1


def _in_world(shape: impostor.Shape, pose: np.ndarray) -> np.ndarray:
    """The vertices of a part, [N, 3]."""
    return shape.vertices @ pose[:3, :3].T + pose[:3, 3]


def _surrounds(
    part: int, shapes: list[impostor.Shape], points: list[np.ndarray], hulls: dict[int, np.ndarray], mirror: np.ndarray
) -> bool:
    """Whether a part holds a mirror [N, 3] in its convex hull, or goes around it. `hulls`: those made so far, [F, 4] each."""
    if shapes[part].plane is not None or not (_box_holds(points[part], mirror) or _goes_around(points[part], mirror)):
        return False
    if part not in hulls:
        hulls[part] = np.unique(ConvexHull(points[part], qhull_options="QJ").equations, axis=0)
    return _goes_around(points[part], mirror) or bool((_heights(hulls[part], mirror) < 0).all())


def _goes_around(points: np.ndarray, mirror: np.ndarray) -> bool:
    """Whether points, seen from a mirror's middle, fill a cone wider than WIDEST_DEG, and are all DISTANT.

    The cone's axis is the middle of the smallest ball around the directions, found as Badoiu and Clarkson 2003 do; the
    cosine of its opening is how far that middle is from the origin.
    """
    middle = mirror.mean(axis=0)
    away = np.linalg.norm(points - middle, axis=1)
    if away.min() < DISTANT * np.linalg.norm(mirror - middle, axis=1).max():
        return False
    directions = (points - middle) / away[:, None]
    axis = directions[0]
    for step in range(2, 200):
        axis = axis + (directions[np.linalg.norm(directions - axis, axis=1).argmax()] - axis) / step
    return bool(np.linalg.norm(axis) < np.cos(np.radians(WIDEST_DEG)))


def _box_holds(points: np.ndarray, others: np.ndarray) -> bool:
    """Whether the box of points holds others: what the hull holds, it holds, and it is sooner asked."""
    return bool((points.min(axis=0) < others.min(axis=0)).all() and (others.max(axis=0) < points.max(axis=0)).all())


def _reaches(points: np.ndarray, hull: np.ndarray, room: np.ndarray) -> bool:
    """Whether points come near a wall of a room's hull, or go beyond."""
    deep = np.array([np.ptp(room @ wall[:3]) for wall in hull])
    return bool((_heights(hull, points) > -NEAR_WALL * deep).any())


def _heights(hull: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Heights of points [N, 3] over the walls of a hull [F, 4]: negative inside, [N, F]."""
    return points @ hull[:, :3].T + hull[:, 3]


def ground_of(scene: SceneLike) -> int | None:
    """The number of the object that goes on in the panorama of a scene; None if none does."""
    if scene.environment is None or scene.environment.ground is None:
        return None
    return [o.name for o in scene.objects].index(scene.environment.ground)
