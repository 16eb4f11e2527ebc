"""Rays that end at infinity: which cannot, and which do for certain, as they meet none of the boxes that hold a scene.

A box is three rows that take a point to [-1, 1] across it (`kernels.boxes`). Along a ray, each is a slab that is entered
and left; the ray meets the box if it enters all before it leaves any (Kay and Kajiya 1986).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels import boxes
from benchharness.kernels.frozen import frozen
from benchharness.kernels.types import SceneLike

MOST = 64  # boxes of a scene
STILL = 1e-12  # per unit of length: a ray along a slab is taken to cross it by so little


@dataclass
class Boxes:
    """rows: 12 floats per box, in the space of its part; parts: their numbers."""

    rows: mi.Float
    parts: mi.UInt32
    count: int


def of_scene(scene: SceneLike) -> Boxes:
    """The boxes of all parts of a `benchharness.scene.Scene`."""
    rows, parts = _found(scene)
    return Boxes(mi.Float(rows.astype(np.float32).ravel()), mi.UInt32(parts.astype(np.uint32)), len(parts))


def of_parts(boxes: Boxes, wanted: np.ndarray) -> Boxes:
    """The boxes of some parts, numbers [P]; all where none of them has one."""
    kept = np.isin(np.array(boxes.parts), wanted)
    if not kept.any():
        return boxes
    rows, parts = np.array(boxes.rows).reshape(-1, 12)[kept], np.array(boxes.parts)[kept]
    return Boxes(mi.Float(rows.ravel()), mi.UInt32(parts), len(parts))


@lru_cache(maxsize=2)
def _found(scene: SceneLike) -> tuple[np.ndarray, np.ndarray]:
    """What `boxes.boxes` has of a scene: every method that asks gets the same."""
    return boxes.boxes([(part.mesh.vertices, part.mesh.faces) for part in scene.parts], MOST)


def walled(enclosed: Sequence[bool], reflector: mi.Int32) -> mi.Bool:
    """Which pixels show a mirror that `benchharness.scene.Scene.enclosed` holds: nothing at infinity is seen there."""
    held = mi.Bool(False)
    for i, within in enumerate(enclosed):
        if within:
            held |= reflector == i
    return held


@frozen
@dr.syntax
def meets(boxes: Boxes, poses: mi.Float, own: mi.UInt32, p: mi.Point3f, d: mi.Vector3f, active: mi.Bool) -> mi.Bool:
    """Whether the ray from p along d meets any box of a part other than `own`, where `poses` puts it; False where not active.

    poses  12 floats per part, rigid
    """
    world = _posed(boxes, poses)
    k, met = mi.UInt32(0), mi.Bool(False)
    while dr.hint(active & ~met & (k < boxes.count), label="look for a box that the ray meets"):
        enter, leave = mi.Float(0), mi.Float(dr.inf)
        for axis in range(3):
            row = dr.gather(mi.Vector4f, world, 3 * k + axis, active)
            start, step = dr.dot(row.xyz, mi.Vector3f(p)) + row.w, dr.dot(row.xyz, d)
            per_step = dr.rcp(dr.select(dr.abs(step) < STILL, STILL, step))
            one, two = (-1 - start) * per_step, (1 - start) * per_step
            enter, leave = dr.maximum(enter, dr.minimum(one, two)), dr.minimum(leave, dr.maximum(one, two))
        met = (enter <= leave) & (dr.gather(mi.UInt32, boxes.parts, k, active) != own)
        k += 1
    return met & active


def _posed(boxes: Boxes, poses: mi.Float) -> mi.Float:
    """The rows that take points of the world: a·x + b with x = Rᵀ (X - t)."""
    lane = dr.arange(mi.UInt32, boxes.count)
    part = dr.gather(mi.UInt32, boxes.parts, lane)
    pose = [dr.gather(mi.Vector4f, poses, part * 3 + k) for k in range(3)]
    world = dr.empty(mi.Float, 12 * boxes.count)
    for axis in range(3):
        row = dr.gather(mi.Vector4f, boxes.rows, lane * 3 + axis)
        a = mi.Vector3f(*(dr.dot(r.xyz, row.xyz) for r in pose))
        b = row.w - dr.dot(a, mi.Vector3f(*(r.w for r in pose)))
        dr.scatter(world, mi.Vector4f(a.x, a.y, a.z, b), lane * 3 + axis)
    return world
