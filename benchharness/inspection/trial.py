"""Scenes to look at a mesh file in: as something that a ball mirrors, and as a mirror in coloured surroundings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh

from benchharness.assets.asset import Asset, Material
from benchharness.scene import Camera, Environment, Mesh, Object, Reflector, Scene
from benchharness.study import placed

HALF = 1.0  # of the longest side of the file's box, as it is shown
BANDS = 24  # of the surroundings, around
MOST_NAMED = 12  # materials, or nodes


def read(path: Path) -> Asset:
    """A mesh file. Raises ValueError for one that cannot be read."""
    return placed.read(path, "inspect", placed.ObjectTable(name=path.stem, mesh=str(path)))


def described(asset: Asset) -> Iterator[str]:
    """Sentences about a file itself: how much is in it, how large it is, and what a scene may call its parts."""
    count = sum(len(part.faces) for part in asset.parts)
    size = " x ".join(f"{length:.4g}" for length in np.ptp(asset.box, axis=0))
    meant = "turned from y up to z up"
    if np.array_equal(asset.axes, np.eye(4)):
        meant = "taken for metres with z up, unless `unit` and `up` of a scene say otherwise"
    yield f"file {asset.path.name}: {count:,} triangles, {size} m large, {meant}; drawn {2 * HALF:g} m long below"
    materials = {part.material.name: part.material for part in asset.parts if part.material.name}
    nodes = dict.fromkeys(part.nodes[-1] for part in asset.parts if part.nodes)
    if materials:
        yield f"materials: {_listed(f'{name!r} {_look(look)}' for name, look in materials.items())}"
    if len(nodes) > 1:
        yield f"nodes: {_listed(map(repr, nodes))}"


def _look(material: Material) -> str:
    said = " ".join(f"{x:.3g}" for x in material.base_colour)
    if material.picture is not None:
        height, width = material.picture.shape[:2]
        said = f"picture of {width} x {height}"
    shines = any(material.emission)
    return f"({said}{', shines' if shines else ''})"


def _listed(names: Iterable[str]) -> str:
    names = list(names)
    more = [f"and {len(names) - MOST_NAMED} more"] if len(names) > MOST_NAMED else []
    return ", ".join([*names[:MOST_NAMED], *more])


def scenes(asset: Asset) -> Iterator[tuple[Scene, list[str]]]:
    """Both, and what reading the file had to mend."""
    path = asset.path
    entry = placed.ObjectTable(name=path.stem, mesh=str(path))
    parts, said = placed.objects(asset, entry, np.eye(4))
    notes = placed.notes("file", path.stem, asset, np.eye(4), said)
    low, high = asset.box
    length = float((high - low).max())

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
