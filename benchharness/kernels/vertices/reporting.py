"""What a method tells of vertices: what was found of those of the scene in each mirror, and counters of the work.

Solvers tell of the vertices that they searched, in the order of their draw lists; here it is put in that of the scene.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields

import drjit as dr
import mitsuba as mi

from benchharness.kernels.lanes import joined
from benchharness.kernels.types import Vertices
from benchharness.kernels.vertices.adjacency import NONE

NAMES = tuple(f.name for f in fields(Vertices) if f.name != "further")


def of_scene(found: Vertices, lanes: mi.UInt32) -> Vertices:
    """What was found of the scene's vertices, zeros of those that were not searched. `lanes`: as `drawlist.Choice` has them."""
    known = lanes != NONE
    arrays = {name: dr.gather(type(a), a, lanes, known) for name in NAMES for a in [getattr(found, name)]}
    return Vertices(**arrays, further=[of_scene(one, lanes) for one in found.further])


def of_mirrors(parts: Sequence[Vertices]) -> Vertices:
    """What was found in all mirrors, one after the other."""
    vertices = _joined_vertices(parts)
    most = max(len(part.further) for part in parts)
    vertices.further = [_joined_vertices([_place(part, k) for part in parts]) for k in range(most)]
    return vertices


def counters(told: Sequence[tuple[Vertices, Mapping[str, mi.UInt32]]]) -> dict[str, mi.UInt32]:
    """The counters of all groups of mirrors, one after the other; `told`: what each found, and what else it counted."""
    names = dict.fromkeys(name for _, counted in told for name in counted)
    iterations = joined([found.iterations for found, _ in told])
    return {"iterations": iterations, **{name: joined([_counted(*one, name) for one in told]) for name in names}}


def _counted(found: Vertices, counted: Mapping[str, mi.UInt32], name: str) -> mi.UInt32:
    """A counter of a group. Where another may have several reflections per vertex and this one has one at most, its own is
    counted here."""
    if name in counted:
        return counted[name]
    if name == "reflections":
        return dr.select(found.valid, mi.UInt32(1), 0)
    return found.iterations if name == "iterations" else dr.zeros(mi.UInt32, dr.width(found.iterations))


def _joined_vertices(parts: Sequence[Vertices]) -> Vertices:
    """The lanes of several mirrors' vertices, one after the other; `further` is left empty."""
    return Vertices(**{name: joined([getattr(part, name) for part in parts]) for name in NAMES})


def _place(vertices: Vertices, k: int) -> Vertices:
    """A mirror's further reflection number k; zeros where it has none."""
    if k < len(vertices.further):
        return vertices.further[k]
    arrays = {name: getattr(vertices, name) for name in NAMES}
    return Vertices(**{name: dr.zeros(type(array), dr.width(array)) for name, array in arrays.items()})
