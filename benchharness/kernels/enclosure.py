"""Which mirrors stand wholly within walls: no ray that they reflect ends at infinity.

Asked of rays, not of meshes: what closes a room may be one mesh, wound in or out, or sheets that share no vertices, or
boxes of which none holds the mirror. From a mirror, rays go in all directions, spread evenly over its vertices, the frames
of its motion and the sphere; it is enclosed if each meets an object that stands still. Then fewer than 3 / RAYS of its
directions, one in 22,000, lead outside (with 95 % certainty): a gap that is left shows in few pixels or none.

Wrong the other way, which costs nothing but doubt: a mirror that is a piece of the walls itself, or lies in their plane, or
is shut in by what moves or by other mirrors, is not enclosed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import mitsuba as mi

    from benchharness.kernels.types import ReflectorLike, SceneLike

RAYS = 1 << 16
FEW = 1 << 12  # rays that find every window; without one, all are asked
# Rays start so far, of the way, from the mirror towards its middle: it may touch a wall, or sink into it a little.
PULLED = 0.01
STEPS = 1.1673039782614187 ** -np.arange(1.0, 5.0)  # of the most even sequence in four dimensions: roots of x^5 = x + 1


def enclosed(scene: SceneLike) -> tuple[bool, ...]:
    """Whether each reflector stands within walls in all frames. Waits for the device."""
    walls = [o.mesh.transformed(o.pose(0.0)) for o in scene.objects if o.motion is None]
    if not walls or not scene.reflectors:
        return (False,) * len(scene.reflectors)
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in walls])
    vertices = np.concatenate([mesh.vertices for mesh in walls])
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(walls, starts, strict=False)])
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    traced, answers = None, []
    for reflector in scene.reflectors:
        o, d = _rays(scene, reflector, FEW)
        held = bool(((o > low) & (o < high)).all())
        if held:
            # A device is needed only here: scenes without walls around anything never ask for one.
            from benchharness.kernels import mitsuba_mesh

            traced = mitsuba_mesh.scene(vertices, faces) if traced is None else traced
            held = _all_meet(traced, o, d) and _all_meet(traced, *_rays(scene, reflector, RAYS))
        answers.append(held)
    return tuple(answers)


def _rays(scene: SceneLike, reflector: ReflectorLike, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Origins and unit directions in world space, float64 [count, 3] each; the same ones every time."""
    x = (0.5 + np.arange(count)[:, None] * STEPS) % 1.0
    vertices = reflector.mesh.vertices
    middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    p = vertices[(x[:, 0] * len(vertices)).astype(int)]
    p = p + PULLED * (middle - p)
    frames = 1 if reflector.motion is None else scene.frames
    poses = np.stack([reflector.pose(scene.time(frame))[:3] for frame in range(frames)])
    pose = poses[(x[:, 1] * frames).astype(int)]
    z, angle = 2 * x[:, 2] - 1, 2 * np.pi * x[:, 3]
    across = np.sqrt(1 - z * z)
    directions = np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1)
    return np.einsum("nij,nj->ni", pose[:, :, :3], p) + pose[:, :, 3], directions


def _all_meet(traced: mi.Scene, o: np.ndarray, d: np.ndarray) -> bool:
    """Whether each ray meets anything of a Mitsuba scene."""
    import mitsuba as mi

    origins, directions = (np.ascontiguousarray(a.T, np.float32) for a in (o, d))
    ray = mi.Ray3f(mi.Point3f(origins), mi.Vector3f(directions))
    return bool(np.array(traced.ray_test(ray, coherent=False)).all())
