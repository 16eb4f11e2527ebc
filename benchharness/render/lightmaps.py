"""Light maps of a scene's objects: made of what `finer` finds, kept as plain arrays, and put on meshes.

The corners of a triangle that has a grid become its own (`benchharness.modelling.lightmap`). Triangles keep their order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from benchharness import cache
from benchharness.modelling import lightmap, lightmesh
from benchharness.render import finer
from benchharness.scene import PER_VERTEX, LightMap, Mesh

SOURCES = (__file__, finer.__file__, lightmap.__file__, lightmesh.__file__)
"""What light maps are made by, for content hashes."""


def found(meshes: Sequence[Mesh], size: float, arriving: finer.Arriving) -> cache.Arrays:
    """The light of meshes in world space; `size`: `Scene.size`.

    counts    int64 [meshes, 3]: vertices that each has now, samples in a row of its map, and rows; 0 without a map
    source    int64 [V], which of its mesh's vertices each of those is
    faces     int64 [F, 3], of those
    radiance  float32 [V, 3]
    light_at  float64 [V, 2], as in `Mesh`
    samples   float32 [S, 3], of all maps
    visibility  float64 [V, L], where highlights need it: whoever bakes adds it
    """
    columns, faces, joins, owns, start = [], [], [], [], 0
    for mesh in meshes:
        own = np.concatenate([mesh.vertices, mesh.normals, mesh.albedo, mesh.emission], axis=1)
        own, corners, which = lightmesh.joined(own, mesh.faces)
        columns.append(own)
        faces.append(corners + start)
        joins.append(which + start)
        owns.append(np.full(len(corners), np.linalg.norm(np.ptp(mesh.vertices, axis=0))))
        start += len(own)
    whole = lightmesh.uncut(np.concatenate(columns), np.concatenate(faces))
    made, radiance = finer.found(whole, finer.limits(whole, np.concatenate(owns), size), arriving)
    rows: dict[str, list[np.ndarray]] = {name: [] for name in ("counts", "source", "faces", "radiance", "light_at", "samples")}
    first = 0
    for mesh, which in zip(meshes, joins, strict=True):
        map_, at = lightmap.sheet(made, radiance, first, len(mesh.faces))
        first += len(mesh.faces)
        source, corners, places = _parted(mesh, at)
        samples = np.zeros((0, 0, 3), np.float32) if map_ is None else map_.samples
        rows["counts"].append(np.array([len(source), samples.shape[1], samples.shape[0]]))
        rows["source"].append(source)
        rows["faces"].append(corners)
        rows["radiance"].append(radiance[which[source]].astype(np.float32))
        rows["light_at"].append(places)
        rows["samples"].append(samples.reshape(-1, 3))
    counts = np.stack(rows.pop("counts"))
    return {"counts": counts} | {name: np.concatenate(values) for name, values in rows.items()}


def _parted(mesh: Mesh, at: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices and faces of a mesh whose triangles have their corners at `at` [F, 3, 2] of a map: which of the mesh's vertices
    each of them is, faces of these numbers, and where in the map they are."""
    gridded = at[:, 0, 0] >= 0
    if not gridded.any():
        return np.arange(len(mesh.vertices)), mesh.faces.astype(np.int64), np.full((len(mesh.vertices), 2), lightmap.NOWHERE)
    plain = np.unique(mesh.faces[~gridded])
    faces = np.empty(mesh.faces.shape, np.int64)
    faces[~gridded] = np.searchsorted(plain, mesh.faces[~gridded])
    faces[gridded] = len(plain) + np.arange(3 * int(gridded.sum())).reshape(-1, 3)
    places = np.concatenate([np.full((len(plain), 2), lightmap.NOWHERE), at[gridded].reshape(-1, 2)])
    return np.concatenate([plain, mesh.faces[gridded].ravel()]), faces, places


def applied(meshes: Sequence[Mesh], arrays: cache.Arrays) -> list[Mesh]:
    """The meshes with what `found` says of them."""
    counts, out = arrays["counts"], []
    lengths = counts[:, 0], [len(mesh.faces) for mesh in meshes], counts[:, 1] * counts[:, 2]
    ends = [np.cumsum([0, *each]) for each in lengths]
    for i, mesh in enumerate(meshes):
        mine, corners, sheet = (slice(each[i], each[i + 1]) for each in ends)
        width, height = int(counts[i, 1]), int(counts[i, 2])
        source = arrays["source"][mine]
        carried = {name: value[source] for name in PER_VERTEX if (value := getattr(mesh, name)) is not None}
        carried |= {name: arrays[name][mine] for name in ("radiance", "light_at", "visibility") if name in arrays}
        light = LightMap(arrays["samples"][sheet].reshape(height, width, 3)) if width else None
        made = {"vertices": mesh.vertices[source], "faces": arrays["faces"][corners], "light": light, **carried}
        out.append(replace(mesh, **made))
    return out
