"""Draw lists: which vertices are searched, and which triangles drawn, in a group of mirrors that are solved together.

A list has, for every mirror and every part that it can show, the vertices and triangles of one of the part's levels of detail
(`levels`). Without levels, it has the scene itself once per mirror. Triangles name those of the scene that they
stand for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels import geometry, packets, raster
from benchharness.kernels.eye import eye_of
from benchharness.kernels.frozen import frozen, roomy
from benchharness.kernels.lanes import gathered
from benchharness.kernels.types import Frame, MeshLike, SceneLike
from benchharness.kernels.vertices import edges, levels, patches
from benchharness.kernels.vertices.adjacency import NONE

LEFT_OUT = -1  # the level of a part that a mirror cannot show


@dataclass(frozen=True, eq=False)
class Stocked:
    """One level of a part.

    first, count  its vertices in the stock
    faces         packets of its triangles, whose vertices count from the first, uint32 [F, 4]
    names         the scene's triangles that they stand for, uint32 [F]
    error         as `levels.Level` has it
    edge          its longest edge
    edges         its edges; None where none is split
    """

    first: int
    count: int
    faces: np.ndarray
    names: np.ndarray
    error: float
    edge: float
    edges: edges.Edges | None


@dataclass(frozen=True, eq=False)
class Stock:
    """What lists are made of, on the host but for `points`.

    points   packets of all vertices of all levels of all parts, object space
    parts    the levels of each part, finest first
    places   per part, which vertex of its first level each of its own vertices is, int [V]
    bounds   what the errors of levels are told from; None where all parts are searched in all mirrors
    """

    points: mi.Float
    parts: list[list[Stocked]]
    places: list[np.ndarray]
    bounds: Bounds | None


@dataclass(frozen=True, eq=False)
class Bounds:
    """
    mirrors    patches of each mirror
    balls      that hold the parts, in their own spaces: [B, 4]
    of_ball    the part of each, [B]
    ball, off, edge  every ball with every level of its part [N], part by part and then level by level: its number, and the
               level's error and longest edge
    first      of each part and level the first of these, and which part and level that is: [L] each
    part, level
    """

    mirrors: list[patches.Patches]
    balls: np.ndarray
    of_ball: np.ndarray
    ball: np.ndarray
    off: np.ndarray
    edge: np.ndarray
    first: np.ndarray
    part: np.ndarray
    level: np.ndarray


def _bounds(mirrors: list[patches.Patches], balls: list[np.ndarray], parts: list[list[Stocked]]) -> Bounds:
    counts, starts = [len(b) for b in balls], np.cumsum([0, *map(len, balls)])
    rows = [(p, k, level) for p, chain in enumerate(parts) for k, level in enumerate(chain)]
    repeats = np.array([counts[p] for p, _, _ in rows])
    ball = np.concatenate([starts[p] + np.arange(counts[p]) for p, _, _ in rows])
    off, edge = (np.repeat([getattr(level, name) for _, _, level in rows], repeats) for name in ("error", "edge"))
    part, level = (np.array([row[i] for row in rows]) for i in range(2))
    first = np.cumsum([0, *repeats[:-1]])
    return Bounds(mirrors, np.concatenate(balls), np.repeat(np.arange(len(balls)), counts), ball, off, edge, first, part, level)


def stock(
    scene: SceneLike, searched: Sequence[MeshLike], kind: Literal["whole", "joined", "simplified"], *, splits: bool = False
) -> Stock:
    """The stock of a scene.

    searched  the mesh of each mirror that is searched
    kind      parts as they are; or with vertices at one place joined; or all levels of those, chosen from for every frame
    splits    whether edges may be split
    """
    points, rows, places, balls, start, face = [], [], [], [], 0, 0
    for part, one in enumerate(scene.parts):
        v, f = np.asarray(one.mesh.vertices), np.asarray(one.mesh.faces, np.int64)
        chain = [levels.Level(v, f, np.arange(len(f)), 0.0)] if kind == "whole" else levels.chain(v, f)
        places.append(np.arange(len(v)) if kind == "whole" else geometry.welded(v))
        mine = []
        for level in chain if kind == "simplified" else chain[:1]:
            tag = np.where(geometry.oriented_closed_faces(level.vertices, level.faces), part | raster.CLOSED, part)
            packed = np.column_stack([level.faces, tag]).astype(np.uint32)
            corners = level.vertices[level.faces]
            edge = float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max())
            names = (level.names + face).astype(np.uint32)
            of_level = edges.edges_of(level.vertices, level.faces) if splits else None
            mine.append(Stocked(start, len(level.vertices), packed, names, level.error, edge, of_level))
            points.append(packets.of_rows(level.vertices, part))
            start += len(level.vertices)
        rows.append(mine)
        face += len(f)
        if kind == "simplified":
            balls.append(patches.balls_of(v, f))
    bounds = _bounds([patches.of_mesh(mesh) for mesh in searched], balls, rows) if kind == "simplified" else None
    return Stock(mi.Float(np.concatenate(points).ravel()), rows, places, bounds)


@dataclass
class DrawList:
    """A list on the device; lanes are its vertices, mirror by mirror, and then such that fill up.

    source       of each vertex, its number in the stock
    part         the part of the mirror that it is searched in; its own, and it is not searched, where it fills up
    mirror       that mirror's number in the group
    faces        packets of the triangles, with the list's own numbers of vertices
    names        the scene's triangle that each stands for
    face_part, face_mirror  as `part` and `mirror`, per triangle
    edges        the edges of the triangles; None where none is split
    vertex_count, face_count
    """

    source: mi.UInt32
    part: mi.UInt32
    mirror: mi.UInt32
    faces: mi.UInt32
    names: mi.UInt32
    face_part: mi.UInt32
    face_mirror: mi.UInt32
    edges: edges.EdgeList | None
    vertex_count: int
    face_count: int


@dataclass(frozen=True, eq=False)
class Choice:
    """What was chosen for a group of mirrors.

    level   of every part in every mirror, int [mirrors, parts]
    starts  the first lane of each, -1 for none
    lanes   per mirror and vertex of the scene, the lane in which it is searched, NONE where it is not: its part is left out, or
            coarser
    made    the list
    """

    level: np.ndarray
    starts: np.ndarray
    lanes: list[mi.UInt32]
    made: DrawList


def chosen(
    stock: Stock, group: list[int], frame: Frame, objects: int, shown_parts: int, pixels: float, before: Choice | None
) -> Choice:
    """The list of a frame for the mirrors `group`; that of the frame before where nothing else is chosen.

    objects      how many parts are objects
    shown_parts  parts from this number on are left out
    pixels       a level's error may be seen this large; only half as large where it is coarser than the one before
    """
    count = len(stock.parts)
    if stock.bounds is None:
        level = np.zeros((len(group), count), int)
    else:
        level = _levels(stock.bounds, group, frame, objects, pixels, None if before is None else before.level)
    level[:, shown_parts:] = LEFT_OUT
    level[np.arange(len(group)), np.array(group) + objects] = LEFT_OUT
    if before is not None and np.array_equal(level, before.level):
        return before
    return _made(stock, group, objects, level)


def _levels(
    bounds: Bounds, group: list[int], frame: Frame, objects: int, pixels: float, before: np.ndarray | None
) -> np.ndarray:
    """The level of every part in every mirror of a group."""
    eye, poses = eye_of(frame), np.array(frame.poses, np.float64).reshape(-1, 3, 4)
    there = poses[bounds.of_ball]
    centres = np.einsum("bij,bj->bi", there[:, :, :3], bounds.balls[:, :3]) + there[:, :, 3]
    balls = np.column_stack([centres, bounds.balls[:, 3]])
    chosen = np.full((len(group), len(poses)), LEFT_OUT)
    last = bounds.level.max()
    for k, i in enumerate(group):
        if not eye.visible[i]:
            continue
        sight = patches.looked_at(bounds.mirrors[i], poses[objects + i], eye.place, eye.focal, balls)
        shown = np.zeros(len(poses), bool)
        shown[bounds.of_ball[sight.scale.any(axis=0)]] = True
        seen = np.full((len(poses), last + 1), np.inf)
        seen[bounds.part, bounds.level] = np.maximum.reduceat(sight.error(bounds.ball, bounds.off, bounds.edge), bounds.first)
        seen[:, 0] = 0
        coarsest, comfortable = (last - np.argmax(seen[:, ::-1] <= limit, axis=1) for limit in (pixels, 0.5 * pixels))
        old = coarsest
        if before is not None:
            old = np.where(before[k] == LEFT_OUT, coarsest, before[k])
        chosen[k] = np.where(shown, np.clip(old, comfortable, coarsest), LEFT_OUT)
    return chosen


def _made(stock: Stock, group: list[int], objects: int, level: np.ndarray) -> Choice:
    rows = Rows([], [], [], [], [], [])
    starts = np.full(level.shape, -1, int)
    for k in range(len(group)):
        for p, chosen_level in enumerate(level[k]):
            if chosen_level == LEFT_OUT:
                continue
            part = stock.parts[p][chosen_level]
            starts[k, p] = rows.count
            rows.add(k, np.arange(part.first, part.first + part.count), part.faces, part.names, part.edges)
    return Choice(level, starts, _lanes(stock, level, starts), rows.made(stock, group, objects))


@dataclass(frozen=True, eq=False)
class Rows:
    """The rows of a list as it is put together on the host, part by part.

    source, mirror      per vertex, as `DrawList` has them
    faces, names, face_mirror  per triangle, likewise
    sides               edges, and the lane of the first vertex that they count from
    """

    source: list[np.ndarray]
    mirror: list[np.ndarray]
    faces: list[np.ndarray]
    names: list[np.ndarray]
    face_mirror: list[np.ndarray]
    sides: list[tuple[edges.Edges, int]]

    @property
    def count(self) -> int:
        """Vertices so far."""
        return sum(map(len, self.source))

    def add(self, k: int, source: np.ndarray, faces: np.ndarray, names: np.ndarray, sides: edges.Edges | None) -> None:
        """Vertices and triangles of a part for mirror number k of the group. faces: as in `Stocked`, of these vertices."""
        start = self.count
        self.source.append(source)
        self.mirror.append(np.full(len(source), k))
        self.faces.append(faces + np.array([start, start, start, 0], np.uint32))
        self.names.append(names)
        self.face_mirror.append(np.full(len(faces), k))
        if sides is not None:
            self.sides.append((sides, start))

    def made(self, stock: Stock, group: list[int], objects: int) -> DrawList:
        """The list on the device."""
        count, total = self.count, sum(map(len, self.faces))
        vertices, triangles = roomy(count), roomy(total)
        owner = np.array(group) + objects
        # What fills up is a vertex of the first mirror that is not searched in it, and triangles of that.
        own = stock.parts[owner[0]][0].first
        fill, more = vertices - count, triangles - total
        source = np.concatenate([*self.source, np.full(fill, own)])
        mirror = np.concatenate([*self.mirror, np.zeros(fill, int)])
        face_mirror = np.concatenate([*self.face_mirror, np.zeros(more, int)])
        spare = np.tile(np.array([0, 0, 0, owner[0]], np.uint32), (more, 1))
        packed, named = np.concatenate([*self.faces, spare]), np.concatenate([*self.names, np.full(more, NONE)])
        on_device = [mi.UInt32(np.asarray(a, np.uint32).ravel()) for a in (source, owner[mirror], mirror, packed, named)]
        on_device += [mi.UInt32(a.astype(np.uint32)) for a in (owner[face_mirror], face_mirror)]
        split = edges.uploaded(self.sides, triangles) if self.sides else None
        return DrawList(*on_device, split, vertices, triangles)


def _lanes(stock: Stock, level: np.ndarray, starts: np.ndarray) -> list[mi.UInt32]:
    """`Choice.lanes`."""
    lanes = []
    for levels_, firsts in zip(level, starts, strict=True):
        rows = [
            first + place if of == 0 else np.full(len(place), NONE)
            for of, first, place in zip(levels_, firsts, stock.places, strict=True)
        ]
        lanes.append(mi.UInt32(np.concatenate(rows).astype(np.uint32)))
    return lanes


@frozen
def world_of(
    stock_points: mi.Float, made: DrawList, poses: mi.Float, seen: geometry.Geometry, *, carries: bool
) -> geometry.Geometry:
    """A list's triangles in world space. `carries`: with what the scene's vertices `seen` carry, whose numbers are the stock's;
    else without light."""
    count = made.vertex_count
    points = geometry.posed(stock_points, count, poses, made.source)
    attributes, shine, paint = None, None, None
    if carries:
        attributes = packets.stored(dr.gather(mi.Vector4f, seen.attributes, made.source), count)
        if seen.shine is not None:
            normals, visibility = (
                packets.stored(dr.gather(mi.Vector4f, a, made.source), count)
                for a in (seen.shine.normals, seen.shine.visibility)
            )
            shine = replace(seen.shine, normals=normals, visibility=visibility)
        if seen.paint is not None:
            paint = replace(seen.paint, uv=packets.stored(dr.gather(mi.Vector4f, seen.paint.uv, made.source), count))
    return geometry.Geometry(points, attributes, made.faces, count, made.face_count, shine, paint)


def carried(ends: Any, cold: Any, old: Choice, new: Choice, stock: Stock) -> Any:
    """What the last frame's search ended with per vertex, for the vertices of another list: of those that it had; `cold` of
    others. `ends` and `cold`: dataclasses of arrays, some numbers per vertex."""
    index = np.full(new.made.vertex_count, NONE, np.uint32)
    for k, p in np.argwhere((old.level == new.level) & (new.level != LEFT_OUT)):
        count, to = stock.parts[p][new.level[k, p]].count, new.starts[k, p]
        index[to : to + count] = old.starts[k, p] + np.arange(count)
    return gathered(ends, cold, mi.UInt32(index), old.made.vertex_count)
