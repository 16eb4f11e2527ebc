"""Draw lists of some of a scene's triangles: for every mirror those that are near it, with the vertices that they have."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np

from benchharness.kernels.lanes import NONE, gathered
from benchharness.kernels.vertices import drawlist, edges


@dataclass(frozen=True, eq=False)
class Near:
    """Which of the scene's triangles are near which mirror, bool [mirrors, F]. Another choice is another object."""

    faces: np.ndarray


@dataclass(frozen=True, eq=False)
class NearChoice(drawlist.Choice):
    """
    near  what was chosen
    held  per lane, number of its mirror in the group times the scene's vertices, plus that of its vertex; ascending
    """

    near: Near
    held: np.ndarray


def chosen(
    stock: drawlist.Stock, group: list[int], near: Near, objects: int, shown_parts: int, before: drawlist.Choice | None
) -> NearChoice:
    """The list of what is near the mirrors `group`; that of the frame before where nothing else is near.

    stock        of parts as they are: kind "whole"
    objects      how many parts are objects
    shown_parts  parts from this number on are left out
    """
    if isinstance(before, NearChoice) and before.near is near:
        return before
    whole = [chain[0] for chain in stock.parts]
    total = sum(part.count for part in whole)
    rows, held, lanes = drawlist.Rows([], [], [], [], [], []), [np.zeros(0, int)], []
    for k, i in enumerate(group):
        lane, face = np.full(total, NONE, np.uint32), 0
        for number, part in enumerate(whole):
            own = near.faces[i, face : face + len(part.faces)]
            face += len(part.faces)
            if number == objects + i or number >= shown_parts or not own.any():
                continue
            vertices, corners = np.unique(part.faces[own, :3], return_inverse=True)
            faces = np.column_stack([corners.reshape(-1, 3), part.faces[own, 3]]).astype(np.uint32)
            source = part.first + vertices.astype(int)
            lane[source] = rows.count + np.arange(len(source))
            held.append(k * total + source)
            rows.add(k, source, faces, part.names[own], None if part.edges is None else _among(part.edges, own, vertices))
        lanes.append(mi.UInt32(lane))
    level = np.zeros((len(group), len(whole)), int)
    return NearChoice(level, level, lanes, rows.made(stock, group, objects), near, np.concatenate(held))


def _among(of_part: edges.Edges, faces: np.ndarray, vertices: np.ndarray) -> edges.Edges:
    """The edges of some faces of a part, bool [F], whose vertices are `vertices`, ascending, and are counted among them."""
    used, sides = np.unique(of_part.sides[faces], return_inverse=True)
    ends = np.searchsorted(vertices, of_part.ends[used])
    _, first, same = np.unique(of_part.decides[used], return_index=True, return_inverse=True)
    return edges.Edges(ends, first[same.reshape(-1)], sides.reshape(-1, 3))


def carried(ends: Any, cold: Any, old: drawlist.Choice | None, new: drawlist.Choice) -> Any:
    """What the last frame's search ended with per vertex, for the vertices of another list: of those that it had; `cold` of
    others. `ends` and `cold`: dataclasses of arrays, some numbers per vertex."""
    assert isinstance(old, NearChoice) and isinstance(new, NearChoice)
    index = np.full(new.made.vertex_count, NONE, np.uint32)
    if len(old.held):
        lane = np.minimum(np.searchsorted(old.held, new.held), len(old.held) - 1)
        known = old.held[lane] == new.held
        index[: len(new.held)] = np.where(known, lane, NONE)
    return gathered(ends, cold, mi.UInt32(index), old.made.vertex_count)
