"""Scenes to look at a mesh file in: as something that a ball mirrors, and as a mirror in coloured surroundings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh

from benchharness.scene import Camera, Environment, Mesh, Object, Reflector, Scene
from benchharness.study import placed

HALF = 1.0  # of the longest side of the file's box, as it is shown
BANDS = 24  # of the surroundings, around


def scenes(path: Path) -> Iterator[tuple[Scene, list[str]]]:
    """Both, and what reading the file had to mend. Raises ValueError for a file that cannot be read."""
    entry = placed.ObjectTable(name=path.stem, mesh=str(path))
    asset = placed.read(path, "inspect", entry)
    parts, said = placed.objects(asset, entry, np.eye(4))
    notes = placed.notes("file", path.stem, asset, np.eye(4), said)
    everything = np.concatenate([part.mesh.vertices for part in parts])
    low, high = everything.min(axis=0), everything.max(axis=0)
    length = float((high - low).max())
    if not length > 0:
        raise ValueError(f"{path}: all of it is at one point; accepted: triangles with area")

    def standing(mesh: Mesh) -> Mesh:
        """On the ground, its box's longest side 2 HALF, over the origin."""
        foot = np.array([*(0.5 * (low + high))[:2], low[2]])
        return replace(mesh, vertices=(mesh.vertices - foot) * (2 * HALF / length))

    objects = tuple(replace(part, mesh=standing(part.mesh)) for part in parts)
    height = 2 * HALF * float(high[2] - low[2]) / length
    eye, target = (-1.2 * HALF, -4.5 * HALF, 1.0 * HALF + 0.8 * height), (0.6 * HALF, 0.0, 0.45 * max(height, HALF))
    camera = Camera(eye, target, 40.0)
    shape = trimesh.creation.icosphere(subdivisions=4, radius=0.7 * HALF)
    beside = HALF * np.array([2.0, 0.3, 0.7])
    ball = Mesh(shape.vertices + beside, shape.faces, shape.vertices / (0.7 * HALF))
    common: dict = {"frames": 1, "camera": lambda time: camera, "environment": _surroundings(), "lightmaps": True}
    yield Scene(f"{path.stem} seen", (_ground(), *objects), (Reflector("ball", ball),), **common), notes
    mirror = Reflector(path.stem, standing(placed.mesh(asset, np.eye(4))))
    yield Scene(f"{path.stem} as a mirror", (_ground(),), (mirror,), **common), []


def _ground() -> Object:
    """A chequered square."""
    line = np.linspace(-4 * HALF, 4 * HALF, 33)
    x, y = np.meshgrid(line, line, indexing="ij")
    corner = np.arange(32)[:, None] * 33 + np.arange(32)
    quads = np.stack([corner, corner + 33, corner + 34, corner + 1], axis=2).reshape(-1, 4)
    vertices = np.stack([x, y, np.full_like(x, -1e-3 * HALF)], axis=2).reshape(-1, 3)[quads].reshape(-1, 3)
    dark = ((np.arange(32)[:, None] + np.arange(32)) % 2 == 0).reshape(-1)
    albedo = np.repeat(np.where(dark[:, None], (0.25, 0.28, 0.3), (0.7, 0.68, 0.62)), 4, axis=0)
    first = 4 * np.arange(len(quads))[:, None]
    faces = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])])
    return Object("ground", Mesh(vertices, faces, albedo=albedo), "what the file stands on")


def _surroundings() -> Environment:
    """Bands of two colours, brighter upwards: straight where nothing bends them."""
    rows, columns = np.mgrid[0:64, 0:256]
    band = (columns * BANDS // 256) % 2 == 0
    height = 1.2 - rows / 64
    colour = np.where(band[..., None], (0.9, 0.75, 0.5), (0.25, 0.4, 0.6)) * height[..., None]
    return Environment.from_picture(colour, (0.0, 0.0, 0.0))
