"""A scene brought to where single precision is at home: its mirrors around the origin, and some units in size.

Mitsuba moves the origins of rays by some 1e-4 (1 + max |p|), and float32 has seven digits: a mirror of a millimetre, or one
that stands a kilometre from the origin, is traced and drawn wrongly whoever asks. Nothing that a picture shows changes under
a similarity, so the scene is moved and scaled as a whole, in double precision, before anything of it goes to a device.
Radiance stays as it is. Lengths are in units of `Scene.unit` metres then, from `Scene.origin` on.

The smallest mirror's half diagonal becomes HALF units, so that of 1e-4 (1 + max |p|) the part that does not follow from
rounding, the 1, is small beside every mirror.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from benchharness.scene import Camera, Environment, Mesh, Motion, Object, PointLight, Reflector, Scene

HALF = 8.0
TIMES = 9  # of the animation, over which the mirrors' middle is taken
CLOSE = 1e-9  # a scene this near to where it should be stays there


def normalised(scene: Scene) -> Scene:
    """The scene with the smallest mirror's half diagonal HALF units long, and the middle of all mirrors' way as origin.

    Without mirrors, objects take their place. A scene that is there already is returned as it is.
    """
    size, centre = scene.size / HALF, _middle(scene)
    if abs(size - 1) < CLOSE and np.abs(centre).max() < CLOSE:
        return scene
    moved = _moved(scene, size, centre)

    def own(part: Object | Reflector) -> np.ndarray:
        return centre if part.motion is None else moved[id(part.motion)].own

    def mirror(part: Reflector) -> Reflector:
        mesh, closed = _scaled(part.mesh, size, own(part)), part.closed
        if closed is not None:
            closed = mesh if closed is part.mesh else _scaled(closed, size, own(part))
        return replace(part, mesh=mesh, closed=closed, motion=moved.get(id(part.motion)))

    environment = scene.environment
    if environment is not None:
        there = (np.asarray(environment.centre) - centre) / size
        environment = Environment(environment.radiance, tuple(there), environment.ground)
    lights = tuple(
        PointLight(tuple((np.asarray(l.position) - centre) / size), tuple(np.asarray(l.intensity) / size**2))
        for l in scene.lights
    )
    return replace(
        scene,
        objects=tuple(
            replace(part, mesh=_scaled(part.mesh, size, own(part)), motion=moved.get(id(part.motion))) for part in scene.objects
        ),
        reflectors=tuple(mirror(part) for part in scene.reflectors),
        camera=_Camera(scene.camera, size, centre),
        near=scene.near_plane / size,
        h_max=None if scene.h_max is None else scene.h_max / size,
        lights=lights,
        environment=environment,
        unit=scene.unit * size,
        origin=tuple(np.asarray(scene.origin) + scene.unit * centre),
    )


def _middle(scene: Scene) -> np.ndarray:
    """The middle of the box around all mirrors, or all objects, over the animation, float64 [3]."""
    frames = np.unique(np.linspace(0, max(scene.frames - 1, 0), TIMES).astype(int))
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for part in scene.reflectors or scene.objects:
        vertices = part.mesh.vertices
        for time in {scene.time(int(frame)) for frame in frames} if part.motion is not None else {0.0}:
            pose = part.pose(time)
            there = vertices @ pose[:3, :3].T + pose[:3, 3]
            low, high = np.minimum(low, there.min(axis=0)), np.maximum(high, there.max(axis=0))
    return 0.5 * (low + high) if np.isfinite(low).all() else np.zeros(3)


def _moved(scene: Scene, size: float, centre: np.ndarray) -> dict[int, _Moved]:
    """The motions of a scene, by their ids: parts that share one go on sharing it."""
    out = {}
    for motion in {id(part.motion): part.motion for part in scene.parts if part.motion is not None}.values():
        own = np.concatenate([part.mesh.vertices for part in scene.parts if part.motion is motion])
        out[id(motion)] = _Moved(motion, size, centre, 0.5 * (own.min(axis=0) + own.max(axis=0)))
    return out


def _scaled(mesh: Mesh, size: float, centre: np.ndarray) -> Mesh:
    return replace(mesh, vertices=(mesh.vertices - centre) / size)


@dataclass(frozen=True, eq=False)
class _Moved:
    """A motion of a part whose vertices were taken from `own`, in a world that was taken from `centre`; lengths by `size`."""

    motion: Motion
    size: float
    centre: np.ndarray
    own: np.ndarray

    def __call__(self, time: float) -> np.ndarray:
        pose = np.array(self.motion(time), np.float64)
        pose[:3, 3] = (pose[:3, :3] @ self.own + pose[:3, 3] - self.centre) / self.size
        return pose


@dataclass(frozen=True, eq=False)
class _Camera:
    camera: Callable[[float], Camera]
    size: float
    centre: np.ndarray

    def __call__(self, time: float) -> Camera:
        before = self.camera(time)
        eye, target = (
            tuple(((np.asarray(p, np.float64) - self.centre) / self.size).tolist()) for p in (before.eye, before.target)
        )
        return replace(before, eye=eye, target=target)
