"""A stretch of a scene's animation at a fine step, with its references.

Three kinds. `steady` is the animation as it is. In `cut` the camera is, from one frame on, where it is towards the
animation's other end; in `teleport` objects and mirrors are where they are half an animation later. All else goes on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from benchharness.api import Frame
from benchharness.measure import host
from benchharness.render import reference
from benchharness.render.ready import ready
from benchharness.scene import Scene
from benchharness.study import params, plugins
from benchharness.study.scenes import SceneSpec

BEFORE, AFTER = 2, 3  # frames of a run with a jump in it
OPTIONS = reference.ReferenceOptions(spp=2)


@dataclass(frozen=True, eq=False)
class Film:
    """Frames `first` to `first + count - 1` of `scene`, as it is drawn, in the steps of that scene.

    size  width and height, pixels
    jump  number of the first frame after the jump; None where there is none
    """

    scene: Scene
    first: int
    count: int
    size: tuple[int, int]
    jump: int | None

    @property
    def numbers(self) -> range:
        return range(self.first, self.first + self.count)

    @cached_property
    def references(self) -> list[reference.Reference]:
        return [reference.render(self.scene, self.scene.time(i), self.size, OPTIONS) for i in self.numbers]

    def mask(self, k: int, frame: Frame) -> np.ndarray:
        """Pixels of frame k of the film that reflect once, in the reference and for the method, bool [H, W]."""
        seen = self.references[k]
        return seen.mask & ~seen.second & host.plane(frame.active, frame)


def spec(name: str) -> SceneSpec:
    """A scene of that name, or of a path `file.py:Name`, at its lean detail and in motion where it offers that.

    Raises ValueError for an unknown one.
    """
    if name.partition(":")[0].endswith(".py"):
        source = plugins.absolute(name, Path.cwd())
        plugin = plugins.from_path("scene", name, Path.cwd(), "--scene")
    else:
        source, plugin = None, plugins.find("scene", name, "--scene")
    declared = params.of_builder(plugin.target)
    wanted = {key: value for key, value in (("detail", "lean"), ("moving", True)) if key in declared}
    return SceneSpec(plugin.name, plugin.name, source, False, params.sweep(wanted, declared, plugin.name)[0], "", plugin.name)


def checked(name: str) -> str:
    """The name of a scene in the tables. Raises ValueError as `spec` does, which imports the scene in this process."""
    return spec(name).label


def film(name: str, kind: str, count: int, substeps: int, start: int | None, size: tuple[int, int]) -> Film:
    """The film of the scene `name`. Bakes it where it needs that.

    kind      one of `plan.KINDS`
    count     frames of a steady run; one with a jump has BEFORE and AFTER
    substeps  frames per frame of the scene's own animation
    start     frame of that animation, at which to begin; None: a steady run where most moves, others at 0

    Raises ValueError for a run that is longer than the animation, or starts too late in it.
    """
    count = count if kind == "steady" else BEFORE + AFTER
    built = spec(name).build()
    built = ready(built, OPTIONS.bake_spp)
    fine = replace(built, fps=built.fps * substeps, frames=(built.frames - 1) * substeps + 1)
    if not 3 <= count <= fine.frames:
        raise ValueError(f"{name}: a run of {count} frames; accepted: 3 to {fine.frames}, the animation in {substeps} substeps")
    latest = fine.frames - count
    if start is None:
        first = _liveliest(fine, count) if kind == "steady" else 0
    elif not 0 <= start * substeps <= latest:
        raise ValueError(f"{name}: start is {start}; accepted: frames 0 to {latest // substeps}")
    else:
        first = start * substeps
    if kind == "steady":
        return Film(fine, first, count, size, None)
    jump = first + BEFORE
    after_s = fine.time(jump) - 0.5 / fine.fps
    if kind == "cut":
        by = fine.time(latest - first) if first <= latest // 2 else -fine.time(first)
        return Film(replace(fine, camera=_Jump(fine.camera, after_s, by)), first, count, size, jump)
    half = fine.time((fine.frames - 1) // 2)
    by = half if fine.time(first + count - 1) + half <= fine.time(fine.frames - 1) else -half
    moved = {
        kinds: tuple(p if p.motion is None else replace(p, motion=_Jump(p.motion, after_s, by)) for p in getattr(fine, kinds))
        for kinds in ("objects", "reflectors")
    }
    return Film(replace(fine, **moved), first, count, size, jump)


@dataclass(frozen=True)
class _Jump:
    """What `path` gives, from time `after` on that of `by` seconds later."""

    path: Callable[[float], Any]
    after: float
    by: float

    def __call__(self, time: float) -> Any:
        return self.path(time + self.by if time > self.after else time)


def _liveliest(scene: Scene, count: int) -> int:
    """The first of `count` frames in which parts move most as the eye sees them: the mean angle that their corners cover."""
    frames = np.arange(0, scene.frames, max(1, count // 6))
    places = np.stack([_corners(scene, scene.time(int(i))) for i in frames])
    steps = np.linalg.norm(np.diff(places, axis=0), axis=2).mean(axis=1)
    reach = max(1, round((count - 1) / (frames[1] - frames[0])))
    total = np.convolve(steps, np.ones(min(reach, len(steps))), "valid")
    return int(min(frames[int(total.argmax())], scene.frames - count))


def _corners(scene: Scene, time: float) -> np.ndarray:
    """Unit directions, seen from the eye and in its axes, to the corners of all parts' boxes [8 P, 3]."""
    camera, found = scene.camera(time), []
    for part in scene.parts:
        ends = np.stack([part.mesh.vertices.min(axis=0), part.mesh.vertices.max(axis=0)])
        box = np.stack(np.meshgrid(*ends.T), axis=-1).reshape(-1, 3)
        pose = part.pose(time)
        found.append(box @ pose[:3, :3].T + pose[:3, 3])
    seen = (np.concatenate(found) - camera.eye) @ camera.axes().T
    return seen / np.maximum(np.linalg.norm(seen, axis=1, keepdims=True), 1e-9)
