"""Rays over meshes: what a ray meets of a triangle, and of those that it comes to from there over the edges that it passes.

No hierarchy is asked: whoever asks names the triangle to begin at. What shares an edge (`adjacency`) stays when things move.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels import geometry, raster
from benchharness.kernels.vertices.adjacency import NONE

STEPS = 16  # triangles that a ray asks from one candidate on, itself included
TOUCH = 1e-6  # of a triangle's size as the ray sees it: a ray this much beside an edge meets both its triangles
JUMP = 0.75  # of the distance: what the pixel beside sees nearer than this share of it may hide what is seen here
BEFORE = 1e-6  # of the coordinates: how much before its start a ray meets what touches the mirror


@dataclass
class Asked:
    """What rays ask.

    world    the scene in world space
    beside   its `adjacency.neighbours`
    objects  number of the first part that is a mirror; no mirror is asked of itself
    """

    world: geometry.Geometry
    beside: mi.UInt32
    objects: mi.UInt32


@dataclass
class Ray:
    """Start, unit direction, and the part of the mirror that it comes from."""

    p: mi.Point3f
    d: mi.Vector3f
    part: mi.UInt32


@dataclass
class Hit:
    """What a ray meets: number of the triangle, NONE for nothing, and how far away."""

    triangle: mi.UInt32
    t: mi.Float


def piece(asked: Asked, triangle: mi.UInt32) -> mi.UInt32:
    """The piece that a triangle is of, NONE for none."""
    there = triangle != NONE
    return dr.select(there, dr.gather(mi.UInt32, asked.beside, 4 * triangle + 3, there), NONE)


@dataclass
class Passed:
    """How a ray passes a triangle.

    face     its packet
    corners  from the ray's start
    sides    volumes of the ray with the edges opposite to them: positive on the inner side, whichever side the ray comes from
    volume   their sum before that, negative if the ray comes from the front
    weights  of the corners where the ray meets it; where it passes beside it, of a point on its edge
    t        how far along the ray that is
    """

    face: mi.Vector4u
    corners: list[mi.Vector3f]
    sides: mi.Vector3f
    volume: mi.Float
    weights: mi.Vector3f
    t: mi.Float


def passed_by(world: geometry.Geometry, ray: Ray, triangle: mi.UInt32) -> Passed:
    """How a ray passes a triangle, by the volumes that it spans with the edges. These are told from the edges themselves, which
    two triangles see alike but for the sign: no ray slips through between them, and small triangles far away lose little."""
    face, corner = raster.corners(world.points, world.faces, triangle, mi.Bool(True))
    a, b, c = (mi.Vector3f(q.xyz) - mi.Vector3f(ray.p) for q in corner)
    sides = mi.Vector3f(*(dr.dot(dr.cross(p - q, p + q), ray.d) for p, q in ((b, c), (c, a), (a, b))))
    volume = sides.x + sides.y + sides.z
    sides *= dr.sign(volume)
    weights = dr.maximum(sides, 0)
    total = weights.x + weights.y + weights.z
    weights = dr.select(total > 0, weights * dr.rcp(dr.select(total > 0, total, 1)), 1 / 3)
    t = dr.dot(weights.x * a + weights.y * b + weights.z * c, ray.d)
    return Passed(face, [a, b, c], sides, volume, weights, t)


@dr.syntax
def asks(asked: Asked, ray: Ray, best: Hit, named: Callable[[mi.UInt32], tuple[mi.UInt32, mi.Float]], count: int) -> Hit:
    """What a ray meets from any of `count` triangles on, if that is nearer than `best`: of pieces that it does not see yet, or
    where these are seen much nearer. `named` gives the triangle of a number, NONE for none, and how near that is seen."""
    sees, last, k = piece(asked, best.triangle), mi.UInt32(NONE), mi.UInt32(0)
    while dr.hint(k < count, label="ask one triangle after another"):
        candidate, t = named(k)
        if (candidate != NONE) & (candidate != last) & ((piece(asked, candidate) != sees) | (t < JUMP * best.t)):
            best = walked(asked, ray, candidate, best, mi.Bool(True))
            sees = piece(asked, best.triangle)
            last = mi.UInt32(candidate)
        k += 1
    return best


@dr.syntax
def walked(asked: Asked, ray: Ray, start: mi.UInt32, best: Hit, active: mi.Bool, steps: int = STEPS) -> Hit:
    """What a ray meets from a triangle on, walking over the edges that it passes, if that is nearer than `best`."""
    here, before, k, going, fronts = mi.UInt32(start), mi.UInt32(NONE), mi.UInt32(0), mi.Bool(active), mi.Bool(False)
    while dr.hint(going & (k < steps), label="walk over the edges that a ray passes"):
        passed = passed_by(asked.world, ray, here)
        least = dr.min(passed.sides)
        inside = (least >= -TOUCH * dr.abs(passed.volume)) & (passed.volume != 0)
        # The back of a closed thing is never seen, and a mirror not in itself.
        front = ((passed.face.w & raster.CLOSED) == 0) | (passed.volume < 0)
        counts = front & (geometry.part_of(passed.face) != ray.part)
        nearer = inside & counts & (passed.t > -BEFORE * (1 + dr.max(dr.abs(ray.p)))) & (passed.t < best.t)
        best = dr.select(nearer, Hit(here, dr.abs(dr.maximum(passed.t, 0))), best)  # no -0, which `exact` takes for much

        # From the front of a closed thing over its outline, and behind what was met already, it is not worth going on.
        a, b, c = (dr.dot(q, ray.d) for q in passed.corners)
        going = ~inside & (front | ~fronts) & (dr.minimum(dr.minimum(a, b), c) < best.t)
        fronts |= front
        beside = dr.gather(mi.Vector4u, asked.beside, here, going)
        there = dr.select(passed.sides.x == least, beside.x, dr.select(passed.sides.y == least, beside.y, beside.z))
        going &= (there != NONE) & (there != before)
        before = mi.UInt32(here)
        here = dr.select(going, there, here)
        k += 1
    return best
