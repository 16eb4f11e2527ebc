"""What is reflected in mirrors whose images are moved vertices: the scene on the device, and the lists it is searched in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mitsuba as mi
import numpy as np

from benchharness.kernels import geometry, passage, planes, surroundings
from benchharness.kernels.types import Frame, MeshLike, SceneLike
from benchharness.kernels.vertices import adjacency, drawlist, flatsheet, higherorder, nearlist

FLAT = 1e-6  # how much normals of a flat mirror differ
HOLLOW = 1e-3  # radians that a normal may turn inwards along an edge of a mirror that is nowhere hollow


@dataclass
class Scenery:
    """What is reflected.

    triangles     the scene in object space; attributes: radiance, black for reflectors
    world         the scene in world space
    surroundings  what is at infinity; None where no mirror can show it, or where it is dark
    objects       how many parts are objects; reflectors come after them
    enclosed      per reflector, `benchharness.scene.Scene.enclosed`
    boxes         that hold all parts; None without surroundings
    beside        `adjacency.neighbours`, None where no ray asks
    groups        numbers of the mirrors that are solved together
    stock         what the groups' draw lists are made of; None where each mirror is alone and searches the scene as it is
    lod_px        pixels that what levels of detail leave out may be seen large
    split_px      pixels that the image of an edge may be off a straight line, or else it is split; 0 where none is
    flat, bulges  per reflector, whether all its normals are one, and whether it is nowhere hollow; False where no edge is split
    plane_of      per reflector, the plane that it is a sheet in, object space; None where it is not flat
    still         the poses of parts that are where they were modelled
    near          which triangles are searched and drawn for which mirror, of a stock of parts as they are; None for all
    mirrors       what rays that meet them go on by; None where they are black in one another
    """

    triangles: geometry.Geometry
    world: geometry.Geometry
    surroundings: surroundings.Surroundings | None
    objects: int
    enclosed: tuple[bool, ...]
    boxes: passage.Boxes | None
    beside: mi.UInt32 | None
    groups: list[list[int]]
    stock: drawlist.Stock | None
    lod_px: float
    split_px: float
    flat: tuple[bool, ...]
    bulges: tuple[bool, ...]
    plane_of: tuple[planes.Plane | None, ...]
    still: mi.Float
    near: nearlist.Near | None = None
    mirrors: higherorder.Mirrors | None = None

    def parts_shown(self, others: str) -> int:
        """Parts from this number on are left out: other mirrors are shown, "black" or "reflective", or "omitted"."""
        return self.objects if others == "omitted" else 0x7FFF_FFFF


SPLIT_PX = 0.5
"""What edges are split by where nothing else is said: what is off by less is still in its pixel."""


def pixels(split_px: float | None, *, told: bool, unsaid: float = SPLIT_PX) -> float:
    """By how many pixels images of edges may be off: what was said, else `unsaid`, and 0, which splits none, where images do
    not tell it: `told`."""
    if split_px is not None:
        return split_px
    return unsaid if told else 0.0


def check(resolve: str, lod_px: float, split_px: float | None, multi: int, name: str, others: str = "black") -> None:
    """Raises ValueError for levels of detail and mirrors in mirrors where nothing shows the parts themselves, and for edges
    that are to be split where a vertex may have several images."""
    if split_px and multi > 1:
        raise ValueError(f"{name}: split_px {split_px:g} with multi {multi}; accepted: 0, or multi 1")
    if lod_px > 0 and resolve != "ray":
        raise ValueError(f'{name}: lod_px {lod_px:g} with resolve "{resolve}"; accepted: 0, or "ray"')
    if others == "reflective" and resolve != "ray":
        raise ValueError(
            f'{name}: other_mirrors "{others}" with resolve "{resolve}"; accepted: "black" or "omitted", or resolve "ray"'
        )


def of_scene(
    scene: SceneLike,
    searched: Sequence[MeshLike],
    resolve: str = "interpolate",
    lod_px: float = 0.0,
    split_px: float = 0.0,
    groups: list[list[int]] | None = None,
    others: str = "black",
) -> Scenery:
    """What a `benchharness.scene.Scene` shows, uploaded.

    searched  the mesh of each mirror that is searched
    resolve   what pixels show, "interpolate" or "ray"
    lod_px, split_px  as `Scenery` has them
    groups    likewise; None for each mirror alone
    others    what mirrors are in one another: "black", "reflective" or "omitted"
    """
    triangles = geometry.of_scene(scene)
    any_light = scene.environment is not None or max(scene.background) > 0
    around = surroundings.of_scene(scene) if any_light and not all(scene.enclosed) else None
    boxes = None if around is None else passage.of_scene(scene)
    beside = adjacency.neighbours(scene) if resolve == "ray" else None
    groups = [[i] for i in range(len(scene.reflectors))] if groups is None else groups
    stock = None
    if resolve == "ray":
        stock = drawlist.stock(scene, searched, "simplified" if lod_px > 0 else "joined", splits=split_px > 0)
    elif split_px > 0 or any(len(group) > 1 for group in groups):
        stock = drawlist.stock(scene, searched, "whole", splits=split_px > 0)
    enclosed = tuple(scene.enclosed)
    flat = tuple(split_px > 0 and bool(np.ptp(np.asarray(mesh.normals), axis=0).max() < FLAT) for mesh in searched)
    bulges = tuple(split_px > 0 and nowhere_hollow(mesh) for mesh in searched)
    mirrors = None
    if others == "reflective":
        hollow = [not nowhere_hollow(reflector.closed or reflector.mesh) for reflector in scene.reflectors]
        mirrors = higherorder.of_scene(scene, hollow) if len(hollow) > 1 else None
    objects, still = len(scene.objects), mi.Float(np.tile(np.eye(3, 4).ravel(), len(scene.parts)))
    return Scenery(
        triangles=triangles,
        world=triangles,
        surroundings=around,
        objects=objects,
        enclosed=enclosed,
        boxes=boxes,
        beside=beside,
        groups=groups,
        stock=stock,
        lod_px=lod_px,
        split_px=split_px,
        flat=flat,
        bulges=bulges,
        plane_of=flatsheet.planes_of(searched),
        still=still,
        mirrors=mirrors,
    )


def posed(seen: Scenery, frame: Frame) -> Scenery:
    """The scenery with every part where it is in this frame."""
    world, mirrors = geometry.placed(seen.triangles, frame.poses), seen.mirrors
    if mirrors is not None:
        mirrors = higherorder.placed(mirrors, world, frame.poses, seen.objects)
    return replace(seen, world=world, mirrors=mirrors)


def nowhere_hollow(mesh: MeshLike) -> bool:
    """Whether normals turn outwards along every edge of a mesh, but for rounding."""
    faces = np.asarray(mesh.faces)
    ends = np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)])
    along, turn = (a[ends[:, 1]] - a[ends[:, 0]] for a in (np.asarray(mesh.vertices), np.asarray(mesh.normals)))
    return bool(((along * turn).sum(axis=1) >= -HOLLOW * np.linalg.norm(along, axis=1)).all())
