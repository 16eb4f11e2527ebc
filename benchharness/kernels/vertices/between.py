"""Vertices between others: some are searched, and the rest have their reflection points interpolated.

A reflection point moves smoothly with its vertex, whatever mesh that is of. So a part's vertices may be thinned out: those
that are searched keep a distance from one another, those far from the part's middle first, so that its corners are among them.
Each of the others lies in a triangle of three of these, or nearly: of all triples near by, the one whose linear interpolation
is off by least, as sum |w| d² bounds it, with the weights w of the corners and their distances d. What lies in no such
triangle, as the corner of a box, is searched itself. Parts are rigid, so that weights stay what they are.

After what Estalella et al. 2006 say of their level of detail of 2005, which was not at hand: which vertices were exact there,
and how others were interpolated, is ours.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy.spatial import KDTree

from benchharness.kernels import geometry, packets
from benchharness.kernels.types import SceneLike
from benchharness.kernels.vertices.problems import Problem

FEWEST = 4  # places of a part that are searched, at least
ROUNDS = 5  # in which the distance between them is found
NEIGHBOURS = 8  # from which three are chosen
SLIVER = 1e-3  # square of the sine between two sides of a triangle, at least
OUTSIDE = 0.25  # a weight may be negative by so much
ABOVE = 0.2  # of a triangle's reach: how far from its plane what lies in it may be
CHUNK = 4096  # places that are looked at together


@dataclass
class Between:
    """What is searched, and what lies between.

    searched  numbers of the vertices that are searched, one per place
    corners   4 integers per vertex: which three of those it lies between, by their order in `searched`, and 0
    weights   4 floats per vertex: their weights, and 0; 1, 0, 0 of one that is searched itself
    count     vertices that are searched
    """

    searched: mi.UInt32
    corners: mi.UInt32
    weights: mi.Float
    count: int


def of_scene(scene: SceneLike, every: int) -> Between:
    """Of all parts, about one place in `every` is searched. Waits for nothing."""
    searched, corners, weights, vertices, known = [], [], [], 0, 0
    for part in scene.parts:
        own = np.asarray(part.mesh.vertices)
        chosen, triples, shares = planned(own, every)
        searched.append(chosen + vertices)
        corners.append(np.column_stack([triples + known, np.zeros(len(own), int)]))
        weights.append(np.column_stack([shares, np.zeros(len(own))]))
        vertices, known = vertices + len(own), known + len(chosen)
    return Between(
        mi.UInt32(np.concatenate(searched).astype(np.uint32)),
        mi.UInt32(np.concatenate(corners).astype(np.uint32).ravel()),
        mi.Float(np.concatenate(weights).astype(np.float32).ravel()),
        known,
    )


def planned(vertices: np.ndarray, every: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of vertices [N, 3], the numbers of those that are searched [M], and of all the three corners, by their order among these,
    and weights, [N, 3] each."""
    place = geometry.welded(vertices)
    first = np.unique(place, return_index=True)[1]
    points = vertices[first]
    chosen = _spread(points, max(len(points) / every, FEWEST))
    if chosen.sum() < 3:
        chosen[:] = True
    triples, weights = np.tile(np.arange(len(points))[:, None], 3), np.tile([1.0, 0.0, 0.0], (len(points), 1))
    for rest, corners, shares, inside in lying_between(points, chosen):
        triples[rest[inside]], weights[rest[inside]] = corners[inside], shares[inside]
        chosen[rest[~inside]] = True
    order = np.cumsum(chosen) - 1
    return first[chosen], order[triples][place], weights[place]


def _spread(points: np.ndarray, wanted: float) -> np.ndarray:
    """About so many of points [P, 3], none nearer to another than some distance, and all that near to one: bool [P]."""
    if wanted >= len(points):
        return np.ones(len(points), bool)
    tree, away = KDTree(points), np.linalg.norm(points - points.mean(axis=0), axis=1)
    order = np.argsort(-away, kind="stable")
    apart, chosen = 2 * away.max() / np.sqrt(wanted), np.ones(len(points), bool)
    for _ in range(ROUNDS):
        chosen, covered = np.zeros(len(points), bool), np.zeros(len(points), bool)
        for i in order:
            if not covered[i]:
                chosen[i] = True
                covered[tree.query_ball_point(points[i], apart)] = True
        apart *= np.sqrt(chosen.sum() / wanted)
    return chosen


def lying_between(points: np.ndarray, chosen: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    """Of the points that are not chosen, some at a time: their numbers [K], the best three of the chosen near each and their
    weights [K, 3], and whether it lies in their triangle."""
    known, others = np.flatnonzero(chosen), np.flatnonzero(~chosen)
    count = min(NEIGHBOURS, len(known))
    triples = np.array(list(combinations(range(count), 3)))
    tree = KDTree(points[known])
    for rest in np.array_split(others, -(-len(others) // CHUNK)) if len(others) else ():
        corners = known[tree.query(points[rest], count)[1]][:, triples]  # [K, T, 3]
        to = points[corners] - points[rest][:, None, None]
        a, one, two = to[:, :, 0], to[:, :, 1] - to[:, :, 0], to[:, :, 2] - to[:, :, 0]
        g11, g12, g22 = ((p * q).sum(axis=-1) for p, q in ((one, one), (one, two), (two, two)))
        y1, y2, det = -(a * one).sum(axis=-1), -(a * two).sum(axis=-1), g11 * g22 - g12**2
        sound = det > SLIVER * g11 * g22
        s, t = (y / np.where(sound, det, 1) for y in (g22 * y1 - g12 * y2, g11 * y2 - g12 * y1))
        weights, squares = np.stack([1 - s - t, s, t], axis=-1), (to**2).sum(axis=-1)
        off = np.linalg.norm(a + s[..., None] * one + t[..., None] * two, axis=-1)
        reach = np.sqrt(squares.max(axis=-1))
        sound &= (weights.min(axis=-1) >= -OUTSIDE) & (off <= ABOVE * reach)
        # Distance from the plane is what linear interpolation does not know of at all, and counts for more.
        cost = np.where(sound, (np.abs(weights) * squares).sum(axis=-1) + 4 * off * reach, np.inf)
        rows, best = np.arange(len(rest)), cost.argmin(axis=1)
        yield rest, corners[rows, best], weights[rows, best], np.isfinite(cost[rows, best])


def of_searched(problem: Problem, between: Between) -> Problem:
    """The problem of the vertices that are searched."""
    points = packets.stored(dr.gather(mi.Vector4f, problem.world.points, between.searched), between.count)
    world = replace(problem.world, points=points, attributes=None, shine=None, paint=None, vertex_count=between.count)
    return replace(problem, world=world)


@dataclass
class Interpolated:
    """What lies between, one lane per vertex.

    value     sum of the corners' weighted values
    whole     all corners that count are known
    searched  the vertex is searched itself: its value is its own
    own       then its number among those
    """

    value: mi.Vector3f
    whole: mi.Bool
    searched: mi.Bool
    own: mi.UInt32


def interpolated(between: Between, values: mi.Float, known: mi.Bool, lane: mi.UInt32) -> Interpolated:
    """`values`: 3 floats per vertex that is searched; `known`: whether it counts."""
    corner, weight = dr.gather(mi.Vector4u, between.corners, lane), dr.gather(mi.Vector4f, between.weights, lane)
    value, whole = mi.Vector3f(0), mi.Bool(True)
    for i, w in ((corner.x, weight.x), (corner.y, weight.y), (corner.z, weight.z)):
        value += w * dr.gather(mi.Vector3f, values, i)
        whole &= (w == 0) | dr.gather(mi.Bool, known, i)
    return Interpolated(value, whole, (weight.x == 1) & (corner.x == corner.y), corner.x)
