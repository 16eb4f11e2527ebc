"""Flat mirrors by brute force, float64: rays that are mirrored at planes, every triangle of a scene tried; images of points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from oracles.fresnel_oracle import fresnel_by_amplitudes
from oracles.ray_oracle import rays

from benchharness.scene import Camera, Scene

CLEAR = 1e-4  # share of a triangle, and metres: where an edge or another surface is nearer than this, rounding may decide


def image(V: np.ndarray, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """The mirror image of points [N, 3] in a plane."""
    return V - 2 * ((V - point) @ normal)[:, None] * normal


def on_screen(X: np.ndarray, camera: Camera, width: int, height: int) -> np.ndarray:
    """Columns and rows of points [N, 3], pixels."""
    right, down, forward = camera.axes()
    way, focal = X - np.asarray(camera.eye), 0.5 * height / np.tan(0.5 * np.radians(camera.fov_deg))
    return np.stack([way @ right, way @ down], 1) / (way @ forward)[:, None] * focal + [0.5 * width, 0.5 * height]


@dataclass
class Met:
    """What rays [N] meet first: part (-1 for nothing), t, face normal, radiance, and whether rounding decides nothing there."""

    part: np.ndarray
    t: np.ndarray
    normal: np.ndarray
    L: np.ndarray
    clear: np.ndarray


def met(made: Scene, time: float, o: np.ndarray, d: np.ndarray, left: np.ndarray) -> Met:
    """`left`: the part that each ray leaves, [N], which it cannot meet again; -1 for none."""
    count = len(d)
    part, normal, L = np.full(count, -1), np.zeros((count, 3)), np.tile(np.asarray(made.background, float), (count, 1))
    best, second, doubted = (np.full(count, np.inf) for _ in range(3))  # nearest hits, and the nearest near miss
    for number, thing in enumerate(made.parts):
        mesh = thing.mesh.transformed(thing.pose(time))
        for face in mesh.faces:
            a, b, c = mesh.vertices[face]
            n = np.cross(b - a, c - a)
            with np.errstate(divide="ignore", invalid="ignore"):
                t = ((a - o) @ n) / (d @ n)
                p = o + t[:, None] * d
                weights = np.stack([np.cross(v - u, p - u) @ n for u, v in ((b, c), (c, a), (a, b))], 1) / (n @ n)
            able = (left != number) & np.isfinite(t)
            near = able & (weights > -CLEAR).all(1) & (t > -CLEAR) & ((weights < CLEAR).any(1) | (t < CLEAR))
            doubted = np.where(near, np.minimum(doubted, t), doubted)
            inside = able & (weights >= 0).all(1) & (t > 0)
            closer = inside & (t < best)
            second = np.where(inside, np.minimum(second, np.where(closer, best, t)), second)
            best[closer], part[closer], normal[closer] = t[closer], number, n / np.linalg.norm(n)
            L[closer] = 0.0 if mesh.radiance is None else weights[closer] @ mesh.radiance[face]
    with np.errstate(invalid="ignore"):
        clear = ~(doubted < best + CLEAR) & ~(second - best <= CLEAR)
    return Met(part, best, normal, L, clear)


@dataclass
class Followed:
    """What mirrors show, [H, W]: radiance before the first mirror's reflectance, length of the first reflected ray, which
    mirror is seen (-1 for none), and where rounding decides nothing."""

    L: np.ndarray
    distance: np.ndarray
    reflector: np.ndarray
    clear: np.ndarray


def followed(made: Scene, size: tuple[int, int], depth: int = 1, time: float = 0.0) -> Followed:
    """Rays through pixel centres over up to `depth` mirrors; the last mirror is black."""
    width, height = size
    camera, objects = made.camera(time), len(made.objects)
    d = rays(camera, width, height)
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    o = np.tile(np.asarray(camera.eye, float), (len(d), 1))
    first = met(made, time, o, d, np.full(len(d), -1))
    L, distance, share = np.zeros_like(d), np.zeros(len(d)), np.ones_like(d)
    active, clear, hit = first.part >= objects, first.clear.copy(), first
    for bounce in range(depth):
        lanes = np.flatnonzero(active)
        o[lanes] += hit.t[active, None] * d[active]
        n = hit.normal[active]
        d[lanes] -= 2 * (d[lanes] * n).sum(1, keepdims=True) * n
        left = hit.part[active]
        found = met(made, time, o[lanes], d[lanes], left)
        if bounce == 0:
            distance[lanes] = found.t
        else:
            cosine = np.abs((d[lanes] * n).sum(1))
            for number in np.unique(left):
                mirror = made.parts[number]
                if mirror.eta is not None:
                    own = left == number
                    share[lanes[own]] *= fresnel_by_amplitudes(cosine[own, None], np.asarray(mirror.eta), np.asarray(mirror.k))
        L[lanes] = share[lanes] * found.L
        clear[lanes] &= found.clear
        grown = {name: np.zeros((len(d), *value.shape[1:]), value.dtype) for name, value in vars(found).items()}
        for name, value in vars(found).items():
            grown[name][lanes] = value
        hit = Met(**grown)
        active = np.zeros(len(d), bool)
        active[lanes] = found.part >= objects
    shape = (height, width)
    reflector = np.where(first.part >= objects, first.part - objects, -1)
    return Followed(L.reshape(*shape, 3), distance.reshape(shape), reflector.reshape(shape), clear.reshape(shape))
