"""Metal bowls: the mirrors of the kitchen. Each is an open sheet, as it is seen, and a watertight proxy around it.

Vertex normals are exact, not averaged from the triangles: a normal interpolated across a triangle of these meshes is
off by less than 0.03 degrees (0 for the spheres).
"""

from __future__ import annotations

import numpy as np
import trimesh

from benchharness.scene import Mesh, Reflector

from ..props.shapes import unit_sphere

ALUMINIUM_ETA = (1.657, 0.880, 0.521)
ALUMINIUM_K = (9.22, 6.27, 4.84)
"""Complex index of refraction of aluminium for red, green and blue (Rakić 1995, as used in Mitsuba's `Al`)."""

RADIUS = 0.26
"""Half the width of every bowl, metres."""
CONVEX_HEIGHT = 0.205
"""Height of the upturned bowl, metres."""
CONCAVE_WALL = 0.004
"""Thickness of the concave bowl's wall, metres."""
TORUS_TUBE = 0.09
"""Radius of the ring mould's tube, metres."""
TORUS_FROM_DEG = -60.0
"""Where the ring mould meets the table, about the tube's centre; its band ends at 90, on top."""


def convex_bowl(at: tuple[float, float, float]) -> Reflector:
    """An upturned bowl whose rim lies on the table around `at`: the upper half of an ellipsoid.

    The proxy is the whole ellipsoid, smooth and strictly convex; its lower half is under the table top.
    """
    axes = np.array([RADIUS, RADIUS, CONVEX_HEIGHT])
    sphere = unit_sphere(segments=96, rings=49)
    n = sphere.vertices / axes
    closed = Mesh(sphere.vertices * axes + at, sphere.faces, _unit(n))
    return _reflector(_part(closed, closed.vertices[closed.faces][:, :, 2].min(axis=1) > at[2] - 1e-9), closed)


def concave_bowl(at: tuple[float, float, float], towards: tuple[float, float, float]) -> Reflector:
    """A hemispherical bowl that lies on the table at `at` and opens towards the point `towards`; its inside is seen.

    The proxy is the bowl's solid wall: inside, rim and outside.
    """
    centre = np.add(at, [0.0, 0.0, RADIUS + CONCAVE_WALL + 0.001])
    turn = np.asarray(trimesh.geometry.align_vectors([0, 0, -1], _unit(np.asarray(towards) - centre)))[:3, :3]
    half = unit_sphere(segments=96, rings=49)
    upper = _part(Mesh(half.vertices, half.faces, half.vertices), half.triangles_center[:, 2] > 0)
    n, f, count = upper.vertices, upper.faces, len(upper.vertices)

    # The outside is the inside's faces turned round; two triangles per segment of the rim join them.
    rim = np.flatnonzero(abs(n[:, 2]) < 1e-9)
    rim = rim[np.argsort(np.arctan2(n[rim, 1], n[rim, 0]))]
    next_rim = np.roll(rim, -1)
    joint = [
        np.stack([rim, next_rim, count + next_rim], axis=1),
        np.stack([rim, count + next_rim, count + rim], axis=1),
    ]
    faces = np.concatenate([f[:, ::-1], count + f, *joint])
    vertices = np.concatenate([RADIUS * n, (RADIUS + CONCAVE_WALL) * n])
    closed = Mesh(vertices @ turn.T + centre, faces, np.concatenate([-n, n]) @ turn.T)
    return _reflector(_part(closed, np.all(faces < count, axis=1)), closed)


def torus_bowl(at: tuple[float, float, float]) -> Reflector:
    """A ring mould around `at`: the outer band of a torus, from the table up to its top circle.

    The proxy is the whole torus; its bottom is under the table top, its inner half under whatever covers the ring.
    """
    ring = RADIUS - TORUS_TUBE
    segments, around = 80, 60
    u, v = np.meshgrid(np.arange(segments), np.arange(around), indexing="ij")
    nxt = [(u + 1) % segments, (v + 1) % around]
    a, b, c, d = (i * around + j for i, j in ((u, v), (nxt[0], v), (nxt[0], nxt[1]), (u, nxt[1])))
    faces = np.concatenate([np.stack([a, b, c], axis=-1).reshape(-1, 3), np.stack([a, c, d], axis=-1).reshape(-1, 3)])
    phi = 2 * np.pi * u.ravel() / segments
    psi = np.radians(TORUS_FROM_DEG) + 2 * np.pi * v.ravel() / around
    outward = np.stack([np.cos(phi), np.sin(phi), np.zeros_like(phi)], axis=1)
    n = np.cos(psi)[:, None] * outward + np.sin(psi)[:, None] * [0.0, 0.0, 1.0]
    centre = np.add(at, [0.0, 0.0, -TORUS_TUBE * np.sin(np.radians(TORUS_FROM_DEG))])
    closed = Mesh(ring * outward + TORUS_TUBE * n + centre, faces, n)
    last = round((90.0 - TORUS_FROM_DEG) / 360.0 * around)
    return _reflector(_part(closed, np.all(closed.faces % around <= last, axis=1)), closed)


def torus_top(at: tuple[float, float, float]) -> tuple[float, float]:
    """Radius and height of the ring mould's top circle, metres."""
    return RADIUS - TORUS_TUBE, at[2] + TORUS_TUBE * (1.0 - np.sin(np.radians(TORUS_FROM_DEG)))


def _reflector(mesh: Mesh, closed: Mesh) -> Reflector:
    return Reflector("bowl", mesh, closed, ALUMINIUM_ETA, ALUMINIUM_K)


def _part(mesh: Mesh, keep: np.ndarray) -> Mesh:
    """The faces that `keep` [F] names, with the vertices that they use, bit for bit."""
    used, faces = np.unique(mesh.faces[keep], return_inverse=True)
    return Mesh(mesh.vertices[used], faces.reshape(-1, 3), mesh.normals[used])


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)
