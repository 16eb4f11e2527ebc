"""What methods show of the regimes of failure, and of the same scenes turned and moved, or numbered otherwise; and the law of
reflection on a mesh, in float64."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation
from support.known_reflections import METHODS
from support.mirror_room import shaded

from benchharness.measure import runup
from benchharness.render.frame import FrameRenderer
from benchharness.scene import Camera, Mesh, Reflector, Scene, refined
from benchharness.stability import altered, atlas

REGIMES = atlas.regimes()
SIZE = (96, 72)


def extremes(name: str) -> tuple[float, float]:
    """The mildest and the severest severity of a regime."""
    severities = REGIMES[name][0].severities
    return severities[0], severities[-1]


# The same scene, otherwise.


def any_motion(seed: int = 0) -> np.ndarray:
    """A random rigid motion, float64 [4, 4]: any turn, and a shift of up to a unit."""
    rng, pose = np.random.default_rng(seed), np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.random(rng=rng).as_matrix(), rng.uniform(-1, 1, 3)
    return pose


def carried(scene: Scene, pose: np.ndarray) -> Scene:
    """Camera, objects, mirrors and lights, all moved by a rigid motion. A panorama stays: it is made of texels."""
    assert scene.environment is None

    def moved(part):
        more = {} if part.motion is None else {"motion": lambda time: pose @ part.motion(time) @ np.linalg.inv(pose)}
        if isinstance(part, Reflector) and part.closed is not None:
            more["closed"] = part.closed.transformed(pose)
        return replace(part, mesh=part.mesh.transformed(pose), **more)

    def camera(time: float) -> Camera:
        old = scene.camera(time)
        eye, target = (pose[:3, :3] @ p + pose[:3, 3] for p in (old.eye, old.target))
        return Camera(tuple(eye), tuple(target), old.fov_deg, tuple(pose[:3, :3] @ old.up))

    lights = tuple(replace(l, position=tuple(pose[:3, :3] @ l.position + pose[:3, 3])) for l in scene.lights)
    objects, reflectors = (tuple(moved(part) for part in parts) for parts in (scene.objects, scene.reflectors))
    return replace(scene, objects=objects, reflectors=reflectors, camera=camera, lights=lights)


VARIANTS: dict[str, Callable[[Scene], Scene]] = {
    "as it is": lambda scene: scene,
    "again": lambda scene: scene,
    "renumbered": lambda scene: altered.renumbered(scene)[0],
    "carried": lambda scene: carried(scene, any_motion()),
}


# What a method answers.


@dataclass(frozen=True, eq=False)
class Shown:
    """A method's last answer on the host: [H, W, ...], 0 off the mirrors.

    vertices  the fields of `benchharness.api.Vertices`, [mirror, vertex, ...]; None for other methods
    """

    L: np.ndarray
    distance: np.ndarray
    found: np.ndarray
    active: np.ndarray
    vertices: dict[str, np.ndarray] | None

    def bytes(self) -> dict[str, bytes]:
        return {
            **{f.name: getattr(self, f.name).tobytes() for f in fields(self)[:4]},
            **{name: value.tobytes() for name, value in (self.vertices or {}).items()},
        }


@functools.lru_cache(maxsize=8)
def prepared(regime: str, severity: float, variant: str = "as it is") -> tuple[Scene, FrameRenderer]:
    """A regime's scene and what draws it."""
    scene = VARIANTS[variant](refined(REGIMES[regime][1](severity)))
    return scene, FrameRenderer(scene, *SIZE)


def shown(method: str, regime: str, severity: float, variant: str = "as it is", **parameters) -> Shown | None:
    """What a method shows of a regime's frame at the end of its run-up, from a fresh state; None if it refuses the scene."""
    scene, renderer = prepared(regime, severity, variant)
    asked = METHODS[method](**parameters)
    if asked.refuses(scene) is not None:
        return None
    answer = shaded(asked, scene, *runup.numbers(REGIMES[regime][0].frame, scene.frames), size=SIZE, renderer=renderer)[-1]
    vertices = None
    if answer.reflection.vertices is not None:
        fields_of_first = {k: v for k, v in vars(answer.reflection.vertices).items() if k != "further"}
        arrays = {name: np.array(value).T for name, value in fields_of_first.items()}
        shape = (len(scene.reflectors), scene.vertices)
        vertices = {name: a.reshape(*shape, *a.shape[1:]) for name, a in arrays.items()}
    return Shown(answer.L, answer.distance, answer.found, answer.active, vertices)


kept = functools.cache(shown)


# The law of reflection, on a mesh, in float64.


@dataclass(frozen=True, eq=False)
class Law:
    """How well points of a mesh reflect vertices to an eye; one lane per point.

    height   distance of the point given from the mesh
    off      |half vector - normal| at the mesh's nearest point, with its interpolated normal
    towards  cosines of the normal with the directions to the eye and to the vertex, [N, 2]
    least, most  singular values of the derivative of the tangential part of half vector - normal, per unit of length: how fast
             the law is broken in the direction where that goes slowest, and fastest
    reach    distance of the vertex
    pixel    how far on the mesh one pixel's width lies from the next, at most
    """

    height: np.ndarray
    off: np.ndarray
    towards: np.ndarray
    least: np.ndarray
    most: np.ndarray
    reach: np.ndarray
    pixel: np.ndarray


def unit(v: np.ndarray) -> np.ndarray:
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-300)


def nearest_on(mesh: Mesh, x: np.ndarray, candidates: int = 24) -> tuple[np.ndarray, np.ndarray]:
    """Triangles and weights of their corners, [N], [N, 3], where a mesh is nearest to x [N, 3]."""
    corners = mesh.vertices[mesh.faces]
    candidates = min(candidates, len(corners))
    chosen = KDTree(corners.mean(axis=1)).query(x, candidates)[1].reshape(len(x), candidates)
    a, b, c = (corners[chosen, k] for k in range(3))
    e1, e2, d = b - a, c - a, x[:, None] - a
    g11, g12, g22 = ((p * q).sum(-1) for p, q in ((e1, e1), (e1, e2), (e2, e2)))
    y1, y2 = (d * e1).sum(-1), (d * e2).sum(-1)
    det = np.maximum(g11 * g22 - g12**2, 1e-300)
    s, t = (g22 * y1 - g12 * y2) / det, (g11 * y2 - g12 * y1) / det
    inside = (s >= 0) & (t >= 0) & (s + t <= 1)
    tries = [np.stack([1 - s - t, s, t], axis=-1)]
    for first, second in ((0, 1), (1, 2), (2, 0)):
        p, q = (a, b, c)[first], (a, b, c)[second]
        along = ((x[:, None] - p) * (q - p)).sum(-1) / np.maximum(((q - p) ** 2).sum(-1), 1e-300)
        weights = np.zeros((*along.shape, 3))
        weights[..., second] = np.clip(along, 0, 1)
        weights[..., first] = 1 - weights[..., second]
        tries.append(weights)
    tries = np.stack(tries, axis=2)
    points = np.einsum("nktw,nkwd->nktd", tries, corners[chosen])
    away = np.linalg.norm(points - x[:, None, None], axis=-1)
    away[..., 0] = np.where(inside, away[..., 0], np.inf)
    best = away.reshape(len(x), -1).argmin(axis=1)
    rows = np.arange(len(x))
    return chosen[rows, best // 4], tries[rows, best // 4, best % 4]


def law(mesh: Mesh, two_sided: bool, R: np.ndarray, V: np.ndarray, camera: Camera, height: int) -> Law:
    """How well R [N, 3] reflects V [N, 3] in a mesh of a picture `height` pixels high."""
    eye = np.asarray(camera.eye, float)
    triangle, weights = nearest_on(mesh, R)
    p, n = mesh.vertices[mesh.faces[triangle]], mesh.normals[mesh.faces[triangle]]
    P = np.einsum("nk,nkd->nd", weights, p)
    facet = unit(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]))
    if two_sided:
        n = np.where((((eye - P) * facet).sum(-1) < 0)[:, None, None], -n, n)

    # Along two unit tangents of the triangle, how point and normal change.
    s = unit(p[:, 1] - p[:, 0])
    t = np.cross(facet, s)
    edges = np.stack([p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]], axis=1)
    plane = np.stack([(edges * s[:, None]).sum(-1), (edges * t[:, None]).sum(-1)], axis=1)  # [N, tangent, edge]
    per_length = np.linalg.inv(plane)  # barycentric per length along s and t
    turn = np.einsum("nek,ned->nkd", per_length, n[:, 1:] - n[:, :1])
    N = np.einsum("nk,nkd->nd", weights, n)

    def difference(step_s: float, step_t: float) -> np.ndarray:
        q = P + step_s * s + step_t * t
        m = unit(N + step_s * turn[:, 0] + step_t * turn[:, 1])
        return unit(unit(eye - q) + unit(V - q)) - m

    h = 1e-7 * float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    rates = [(difference(h * i, h * (1 - i)) - difference(-h * i, h * (i - 1))) / (2 * h) for i in (1, 0)]
    J = np.stack([[(r * s).sum(-1), (r * t).sum(-1)] for r in rates]).transpose(2, 1, 0)
    sigma = np.linalg.svd(J, compute_uv=False)
    m, w = unit(N), [unit(eye - P), unit(V - P)]
    depth = ((P - eye) * camera.axes()[2]).sum(-1)
    tilt = np.abs((w[0] * facet).sum(-1))
    pixel = depth * 2 * np.tan(0.5 * np.radians(camera.fov_deg)) / height / np.maximum(tilt, 1e-3)
    return Law(
        np.linalg.norm(R - P, axis=1), np.linalg.norm(difference(0, 0), axis=1),
        np.stack([(m * x).sum(-1) for x in w], axis=1), sigma[:, 1], sigma[:, 0], np.linalg.norm(V - P, axis=1), pixel,
    )  # fmt: skip


def positions(scene: Scene, time: float) -> np.ndarray:
    """World positions of all vertices, in their order, [V, 3]."""
    return np.concatenate([part.mesh.transformed(part.pose(time)).vertices for part in scene.parts])


def laws(scene: Scene, vertices: dict[str, np.ndarray], time: float, sample: int | None = None):
    """Per mirror: numbers of vertices called converged (about `sample` of them) and their `Law`."""
    V, camera = positions(scene, time), scene.camera(time)
    for i, mirror in enumerate(scene.reflectors):
        chosen = np.flatnonzero(vertices["converged"][i])
        chosen = chosen[:: max(1, len(chosen) // sample)] if sample else chosen
        mesh = (mirror.closed or mirror.mesh).transformed(mirror.pose(time))
        if len(chosen):
            R = vertices["R"][i, chosen].astype(np.float64)
            yield i, chosen, law(mesh, mirror.closed is None, R, V[chosen], camera, SIZE[1])
