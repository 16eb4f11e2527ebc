"""The box that stands for a room: around what surrounds a mirror, along its walls. NumPy on arrays.

A box along the world's axes is no proxy for a room that is turned. Its walls say how it is turned: the way that most area
faces is one of its axes, and the way that most of what is across faces another. What has no walls, of which less than half
the area faces along these axes, is boxed along the main axes of its vertices. So the box turns with the scene.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels.images import proxy, roles
from benchharness.kernels.types import SceneLike

ALONG_DEG = 2.0  # normals that differ by less face the same way
CANDIDATES = 64  # ways to face that are tried, those of most area
WALLS = 0.5  # of all area: what has less of it facing along its axes has no walls,
SECOND = 0.05  # nor has what has less of it facing along the second of them
THIN = 1e-3  # of a box's largest side: no side is shorter
ALIKE = 0.05  # of the largest variance of vertices along an axis: variances that differ by less are the same
TIE = 1e-6  # of an axis: projections that differ by less are as long


@dataclass(frozen=True)
class HostBox:
    """axes: unit rows, float64 [3, 3]; centre and half its sides, [3] each, in the world; walled: walls gave the axes."""

    axes: np.ndarray
    centre: np.ndarray
    half: np.ndarray
    walled: bool = True

    def uploaded(self) -> proxy.Box:
        offsets = -(self.axes @ self.centre)
        rows = [mi.Vector4f([*axis, offset]) for axis, offset in zip(self.axes.tolist(), offsets.tolist(), strict=True)]
        box = proxy.Box(rows, mi.Vector3f(self.half.tolist()))
        dr.make_opaque(box)
        return box

    def joined(self, other: HostBox) -> HostBox:
        """The box with the axes of this one that holds both."""
        corners = other.centre + (_CORNERS * other.half) @ other.axes
        own = self.centre + (_CORNERS * self.half) @ self.axes
        return _bounds(np.concatenate([own, corners]), self.axes, walled=self.walled)


_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)


def given(values: Sequence[float], scene: SceneLike) -> HostBox:
    """A box that an author gives: middle, sides, and turn about z in degrees, in metres of the author's scene."""
    angle = np.radians(values[6])
    c, s = np.cos(angle), np.sin(angle)
    axes = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    centre = (np.asarray(values[:3], float) - np.asarray(scene.origin)) / scene.unit
    return HostBox(axes, centre, 0.5 * np.asarray(values[3:6], float) / scene.unit)


def around_mirrors(scene: SceneLike) -> list[HostBox]:
    """Per mirror the box, at the scene's start, of the objects that surround it (`kernels.images.roles`); of all objects and
    mirrors where none does."""
    meshes = [part.mesh.transformed(part.pose(0.0)[:4]) for part in scene.parts]
    everything, found = None, []
    for chosen in roles.plan(scene).enclosing:
        if not chosen:
            everything = everything or around([(mesh.vertices, mesh.faces) for mesh in meshes])
            found.append(everything)
        else:
            found.append(around([(meshes[n].vertices, meshes[n].faces) for n in sorted(chosen)]))
    return found


def around(meshes: Sequence[tuple[np.ndarray, np.ndarray]]) -> HostBox:
    """The box around meshes (vertices [V, 3], faces [F, 3]), along their walls."""
    vertices = np.concatenate([v[np.unique(f)] for v, f in meshes])
    corners = np.concatenate([v[f] for v, f in meshes])
    axes = _walls(corners)
    main = np.linalg.eigh(np.cov(vertices.T))[1].T
    return _bounds(vertices, main if axes is None else axes, walled=axes is not None)


def settled(vertices: np.ndarray, faces: np.ndarray) -> HostBox:
    """The box around one mesh. Where it has no walls, and its vertices are about as far spread in several directions, along
    those that are next to the coordinate axes: rounding would choose otherwise."""
    box = around([(vertices, faces)])
    if box.walled:
        return box
    used = vertices[np.unique(faces)]
    spread, main = np.linalg.eigh(np.cov(used.T))
    axes, first = [], 0
    while first < 3:
        last = first + 1
        while last < 3 and spread[last] - spread[last - 1] < ALIKE * spread[2]:
            last += 1
        within = main[:, first:last] @ main[:, first:last].T
        for _ in range(first, last):
            lengths = np.linalg.norm(within, axis=0) + TIE * np.array([2, 1, 0])
            axis = within[:, lengths.argmax()] / np.linalg.norm(within[:, lengths.argmax()])
            axes.append(axis)
            within = within - np.outer(axis, axis)
        first = last
    return _bounds(used, np.array(axes), walled=False)


def _bounds(vertices: np.ndarray, axes: np.ndarray, *, walled: bool) -> HostBox:
    q = vertices @ axes.T
    low, high = q.min(axis=0), q.max(axis=0)
    half = 0.5 * (high - low)
    return HostBox(axes, axes.T @ (0.5 * (low + high)), np.maximum(half, max(THIN * half.max(), 1e-9)), walled)


def _walls(corners: np.ndarray) -> np.ndarray | None:
    """The way that most area of triangles [F, 3, 3] faces, forwards or backwards, the one across it, and the third; None for
    what has no walls."""
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(n, axis=1)
    n, area = n[area > 0] / area[area > 0, None], area[area > 0]
    if not len(n):
        return None
    first = _facing(n, area)
    flat = n - np.outer(n @ first, first)
    across = np.abs(n @ first) < np.sin(np.radians(ALONG_DEG))
    if not across.any():
        return None
    second = _facing(flat[across] / np.linalg.norm(flat[across], axis=1, keepdims=True), area[across])
    second = second - (second @ first) * first
    second /= np.linalg.norm(second)
    axes = np.array([first, second, np.cross(first, second)])
    along = np.abs(n @ axes.T) > np.cos(np.radians(ALONG_DEG))
    shares = area @ along / area.sum()
    return axes if shares.sum() >= WALLS and shares[1] >= SECOND else None


def _facing(n: np.ndarray, area: np.ndarray) -> np.ndarray:
    """Of unit vectors [N, 3], the way of most area, taken as the mean of all within ALONG_DEG of it or of its opposite."""
    _, kind = np.unique(np.round(n, 3), axis=0, return_inverse=True)
    kind = kind.reshape(-1)
    total = np.bincount(kind, area)
    one = np.zeros(len(total), int)
    one[kind] = np.arange(len(n))
    tried = n[one[np.argsort(-total, kind="stable")[:CANDIDATES]]]
    cosine = tried @ n.T
    alike = np.abs(cosine) > np.cos(np.radians(ALONG_DEG))
    best = int((alike * area).sum(axis=1).argmax())
    mean = (np.where(alike[best], area * np.sign(cosine[best]), 0.0)) @ n
    return mean / np.linalg.norm(mean)
