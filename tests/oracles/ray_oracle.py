"""First hits by brute force, float64: one ray through each pixel centre, every triangle of a scene tried."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from oracles.texture_oracle import shown

from benchharness.scene import Camera, Reflector, Scene


def rays(camera: Camera, width: int, height: int) -> np.ndarray:
    right, down, forward = camera.axes()
    focal = 0.5 * height / np.tan(0.5 * np.radians(camera.fov_deg))
    x, y = np.meshgrid(np.arange(width) + 0.5 - 0.5 * width, np.arange(height) + 0.5 - 0.5 * height)
    return (forward + x[..., None] / focal * right + y[..., None] / focal * down).reshape(-1, 3)


def first_hits(made: Scene, time: float, width: int, height: int, beyond: np.ndarray | float = 0.0):
    """(part or -1, point, normal, radiance, clear) per pixel, flat; `clear` where rounding cannot change the part.

    beyond   only hits at more than this depth along the view axis count, [H W] or one number
    """
    d, eye = rays(made.camera(time), width, height), np.asarray(made.camera(time).eye)
    count = len(d)
    best, part = np.full(count, np.inf), np.full(count, -1)
    normal, radiance, margin = np.zeros((count, 3)), np.tile(made.background, (count, 1)).astype(float), np.full(count, np.inf)
    for number, thing in enumerate(made.parts):
        mesh = thing.mesh.transformed(thing.pose(time))
        for face in mesh.faces:
            a, b, c = mesh.vertices[face] - eye
            volumes = np.stack([d @ np.cross(b, c), d @ np.cross(c, a), d @ np.cross(a, b)], axis=1)
            total = volumes.sum(axis=1)
            with np.errstate(divide="ignore", invalid="ignore"):
                weights = volumes / total[:, None]
                t = (a @ np.cross(b - a, c - a)) / (d @ np.cross(b - a, c - a))
            inside = (weights >= 0).all(axis=1) & (t > beyond)
            margin = np.where(t > beyond, np.minimum(margin, np.abs(weights).min(axis=1)), margin)
            closer = inside & (t < best)
            margin = np.where(inside & np.isfinite(best), np.minimum(margin, np.abs(t - best)), margin)
            best, part = np.where(closer, t, best), np.where(closer, number, part)
            if isinstance(thing, Reflector):
                normal[closer] = weights[closer] @ mesh.normals[face]
            else:
                radiance[closer] = shown(mesh, face, weights[closer])
    p = eye + np.where(np.isfinite(best), best, 0)[:, None] * d
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    normal *= np.where(((eye - p) * normal).sum(1) < 0, -1, 1)[:, None]
    return part, p, normal, radiance, margin > 1e-4


AT_ONCE = 256  # triangles


def passing(corners: np.ndarray, o: np.ndarray, d: np.ndarray) -> Iterator[np.ndarray]:
    """Of each triangle, corners [F, 3, 3], which lines o + t d, [N, 3] each, pass the ball around it; no other is near it."""
    squared = (d**2).sum(axis=1)
    for some in np.array_split(corners, -(-len(corners) // AT_ONCE)):
        middle = some.mean(axis=1)
        reach = 1.01 * np.linalg.norm(some - middle[:, None], axis=2).max(axis=1)  # a hundredth more, for what is near an edge
        away = (middle**2).sum(axis=1)[:, None] - 2 * middle @ o.T + (o**2).sum(axis=1)  # squared, from o
        along = middle @ d.T - (o * d).sum(axis=1)
        yield from map(np.flatnonzero, (away - reach[:, None] ** 2) * squared <= along**2)


def reflected_hits(made: Scene, time: float, o: np.ndarray, d: np.ndarray, mirror: int):
    """(triangle or -1, distance, radiance, clear) of rays o + t d, [N, 3] each, past mirror number `mirror`; triangles are
    numbered over all parts in their order, backs of closed parts count. `clear`: rounding changes nothing."""
    count = len(o)
    best, which = np.full(count, np.inf), np.full(count, -1)
    radiance, margin = np.tile(made.background, (count, 1)).astype(float), np.full(count, np.inf)
    number = 0
    for place, thing in enumerate(made.parts):
        mesh = thing.mesh.transformed(thing.pose(time))
        if place == len(made.objects) + mirror:
            number += len(mesh.faces)
            continue
        for face, lane in zip(mesh.faces, passing(mesh.vertices[mesh.faces], o, d), strict=True):
            number += 1
            if not len(lane):
                continue
            a, b, c = (mesh.vertices[i] - o[lane] for i in face)
            volumes = np.stack([(d[lane] * np.cross(*pair)).sum(1) for pair in ((b, c), (c, a), (a, b))], axis=1)
            with np.errstate(divide="ignore", invalid="ignore"):
                weights = volumes / volumes.sum(axis=1, keepdims=True)
            t = ((weights[:, :1] * a + weights[:, 1:2] * b + weights[:, 2:] * c) * d[lane]).sum(1)
            inside = (weights >= 0).all(axis=1) & (t > 0)
            near = (weights > -1e-4).all(axis=1) & (t > -1e-4)
            margin[lane[near]] = np.minimum(margin[lane], np.abs(weights).min(axis=1))[near]
            second = inside & np.isfinite(best[lane])
            margin[lane[second]] = np.minimum(margin[lane], np.abs(t - best[lane]))[second]
            closer = inside & (t < best[lane])
            best[lane[closer]], which[lane[closer]] = t[closer], number - 1
            lit = not isinstance(thing, Reflector)
            radiance[lane[closer]] = shown(mesh, face, weights[closer]) if lit else 0
    return which, best, radiance, margin > 1e-4
