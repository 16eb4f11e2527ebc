"""The same scene, hardly otherwise: seen from a tenth of a pixel aside, rounded, numbered in another order, a column wider.

None of it should change what a mirror shows by more than it changes the truth.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchharness.scene import PER_VERTEX, Camera, Mesh, Reflector, Scene


def aside(scene: Scene, pixels: float, height: int) -> Scene:
    """The camera moved to its right, as it is turned, by what `pixels` of a picture `height` pixels high are at its target.

    What is there moves to the left by as much; what is behind it, such as a mirror's images, by less.
    """

    def camera(time: float) -> Camera:
        before = scene.camera(time)
        away = float(np.linalg.norm(np.subtract(before.target, before.eye)))
        width = 2 * away * np.tan(0.5 * np.radians(before.fov_deg)) / height
        eye, target = (p + pixels * width * before.axes()[0] for p in (before.eye, before.target))
        return replace(before, eye=tuple(map(float, eye)), target=tuple(map(float, target)))

    return replace(scene, camera=camera)


def rounded(scene: Scene, seed: int = 0) -> Scene:
    """Every coordinate moved to the next float32 below or above, or to the nearest; vertices at one place move alike.

    So a mirror stays closed, and its stand-in coincides with it where it did.
    """
    rng = np.random.default_rng(seed)

    def moved(*meshes: Mesh) -> list[Mesh]:
        places, which = np.unique(np.concatenate([mesh.vertices for mesh in meshes]), axis=0, return_inverse=True)
        single = places.astype(np.float32)
        towards = np.where(rng.integers(-1, 2, places.shape) > 0, np.float32(np.inf), np.float32(-np.inf))
        stays = rng.integers(0, 3, places.shape) == 0
        new = np.where(stays, single, np.nextafter(single, towards)).astype(np.float64)[which.reshape(-1)]
        starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
        return [replace(m, vertices=new[a:b]) for m, a, b in zip(meshes, starts[:-1], starts[1:], strict=True)]

    return _remade(scene, moved)


def renumbered(scene: Scene, seed: int = 0) -> tuple[Scene, np.ndarray]:
    """Vertices and triangles of every part in a random order; and where each vertex of the scene was before, [V]."""
    rng, was, start = np.random.default_rng(seed), [], 0

    def moved(*meshes: Mesh) -> list[Mesh]:
        nonlocal start
        mixed = []
        for mesh in meshes:
            order = rng.permutation(len(mesh.vertices))
            if not mixed:
                was.append(start + order)
            faces = np.argsort(order)[mesh.faces][rng.permutation(len(mesh.faces))]
            carried = {name: value[order] for name in PER_VERTEX if (value := getattr(mesh, name)) is not None}
            mixed.append(Mesh(mesh.vertices[order], faces, **carried, texture=mesh.texture, light=mesh.light))
        start += len(meshes[0].vertices)
        return mixed

    return _remade(scene, moved), np.concatenate(was)


def _remade(scene: Scene, change: Callable[..., list[Mesh]]) -> Scene:
    """With every part's meshes changed, a mirror's and its stand-in's together; they stay one if they were."""

    def of_mirror(mirror: Reflector) -> Reflector:
        if mirror.closed is None:
            return replace(mirror, mesh=change(mirror.mesh)[0])
        if mirror.closed is mirror.mesh:
            mesh = change(mirror.mesh)[0]
            return replace(mirror, mesh=mesh, closed=mesh)
        mesh, closed = change(mirror.mesh, mirror.closed)
        return replace(mirror, mesh=mesh, closed=closed)

    objects = tuple(replace(thing, mesh=change(thing.mesh)[0]) for thing in scene.objects)
    return replace(scene, objects=objects, reflectors=tuple(of_mirror(mirror) for mirror in scene.reflectors))
