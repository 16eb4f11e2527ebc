"""Rooms of few triangles whose light is given as a function of the place, in maps; the same light at the vertices of many."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from support.mirror_room import mirror_ball, scene, still
from support.small_room import box, sphere

from benchharness.modelling import lightmesh
from benchharness.modelling.lightmesh import LightMesh
from benchharness.render import finer, lightmaps
from benchharness.scene import Mesh, Object, Reflector, Scene, subdivided

Field = Callable[[np.ndarray], np.ndarray]
"""Places [N, 3] -> radiance [N, 3]."""


def waves(p: np.ndarray) -> np.ndarray:
    """Unlike itself at every place, in [0.2, 0.8]."""
    return 0.5 + 0.3 * np.sin(3.0 * p[:, [1, 2, 0]] + 1.7 * p + [0.0, 1.0, 2.0])


def disc(p: np.ndarray) -> np.ndarray:
    """Dark but for a ball of light that the floor is in, over a width of 4 cm."""
    away = np.linalg.norm(p - [0.3, -0.9, -2.0], axis=1)
    return np.repeat(0.1 + 0.8 * np.clip((0.6 - away) / 0.04, 0, 1)[:, None], 3, axis=1)


def cut_at_random(mesh: Mesh, rounds: int, seed: int = 0, share: float = 0.4) -> LightMesh:
    """A mesh some of whose triangles are cut, and some of what they become, and so on."""
    rng = np.random.default_rng(seed)
    columns = np.concatenate([mesh.vertices, mesh.normals, mesh.albedo, mesh.emission], axis=1)
    columns, faces, _ = lightmesh.joined(columns, mesh.faces)
    made = lightmesh.uncut(columns, faces)
    for _ in range(rounds):
        chosen = rng.random(len(made.faces)) < share
        made = lightmesh.cut(made, chosen) if chosen.any() else made
    return made


def mapped(mesh: Mesh, field: Field, size: float = 1.0) -> Mesh:
    """A mesh with the light of a field, found as light is that is traced."""

    def arriving(cut: LightMesh, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        there = np.full((len(cut.columns), 3), np.nan)
        there[chosen] = field(cut.places[chosen]) / cut.albedo[chosen]
        return there, np.ones(len(there), np.int64), np.repeat(there[:, None], 2, axis=1)

    return lightmaps.applied([mesh], lightmaps.found([mesh], size, arriving))[0]


def found(mesh: Mesh, field: Field, size: float = 1.0) -> tuple[LightMesh, np.ndarray]:
    """What of a mesh is cut for a field, and the radiance of its vertices."""
    whole = cut_at_random(mesh, 0)

    def arriving(cut: LightMesh, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        there = field(cut.places) / cut.albedo
        return there, np.ones(len(there), np.int64), np.repeat(there[:, None], 2, axis=1)

    return finer.found(whole, finer.limits(whole, np.full(len(mesh.faces), np.inf), size), arriving)


def walls(half: float = 2.0, **look) -> Mesh:
    """Six walls of two triangles each."""
    return box((-half,) * 3, (half,) * 3, inside=True, **look)


def globe(at=(0.45, -0.85, 0.1), radius: float = 0.25) -> Mesh:
    return replace(sphere(radius, at, 16, 8), radiance=0.9 * np.ones(3))


def room(mirror: Reflector | None = None, field: Field = waves, *, in_maps: bool = True, h: float = 0.1, **more) -> Scene:
    """A mirror in a room of twelve triangles; or, not in maps, in one whose edges are no longer than h."""
    mesh = mapped(walls(), field) if in_maps else lit(walls(), field, h)
    things = Object("walls", mesh, "light on every side"), Object("globe", globe(), "something near")
    return scene(things, (mirror_ball(fine=64) if mirror is None else mirror,), more.pop("camera", still()), **more)


def lit(mesh: Mesh, field: Field, h: float) -> Mesh:
    """A mesh with the light of a field at vertices no farther apart than h."""
    fine = subdivided(mesh, h)
    return replace(fine, radiance=field(fine.vertices))
