"""How many of the reflections that an eye can see a method has found: of vertices that have several, and of those with one.

Truth is `truth.every_reflection_point`, on the mirror as it is seen. Whether another object hides what a reflection point
shows is not asked.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from benchharness.kernels.pixels import WRONG_PX
from benchharness.measure import truth
from benchharness.modelling import winding
from benchharness.regime import Seen
from benchharness.scene import Scene

SAMPLE = 40  # vertices per mirror; one costs two passes over the mirror's triangles
REFLECTED = 1  # benchharness.api.Vertices.region


def counted(seen: Seen) -> tuple[int, int] | None:
    """(found, all) reflections within the picture of a sample of the objects' vertices; None for methods without vertices."""
    if seen.vertices is None:
        return None
    scene, (height, width) = seen.scene, seen.mask.shape
    camera = scene.camera(seen.time)
    slots = [seen.vertices, *seen.vertices["further"]]
    found = total = 0
    for number, (chosen, points, shown) in enumerate(_true(scene, seen.time)):
        lanes = number * scene.vertices + chosen
        R = np.stack([slot["R"][lanes] for slot in slots], axis=1).astype(np.float64)
        filled = np.stack([slot["region"][lanes] == REFLECTED for slot in slots], axis=1)
        pixels = np.where(filled[..., None], truth.on_screen(R, camera, width, height), np.inf)
        for true, is_shown, own in zip(points, shown, pixels, strict=True):
            at = truth.on_screen(true[is_shown], camera, width, height)
            at = at[((at >= 0) & (at < [width, height])).all(axis=1)]
            total += len(at)
            found += sum(bool((np.linalg.norm(own - one, axis=1) < WRONG_PX).any()) for one in at)
    return found, total


@lru_cache(maxsize=1)
def _true(scene: Scene, time: float) -> list[tuple[np.ndarray, list[np.ndarray], list[np.ndarray]]]:
    """Per mirror: numbers of the sampled vertices, and what `truth.every_reflection_point` has of them. Every method asks."""
    eye = np.asarray(scene.camera(time).eye)
    objects = sum(len(part.mesh.vertices) for part in scene.objects)
    chosen = np.unique(np.linspace(0, objects - 1, SAMPLE).astype(int))
    V, found = truth.placed(scene, time, chosen), []
    for reflector in scene.reflectors:
        mesh = reflector.mesh.transformed(reflector.pose(time))
        both = reflector.closed is None and not winding.is_closed(mesh)
        found.append((chosen, *truth.every_reflection_point(mesh.vertices, mesh.normals, mesh.faces, eye, V, both_sides=both)))
    return found


def missing(seen: Seen) -> float | None:
    """Share of the reflections that the eye can see and the method has not found; None where there is nothing to count. What
    `regime.MISSING` names."""
    both = counted(seen)
    return None if both is None or both[1] == 0 else 1.0 - both[0] / both[1]
