"""Scenes that billboards are tested in, and what the rays of a method's answer are."""

from __future__ import annotations

import numpy as np
from support.mirror_room import Answer, ball, mirror_ball, plain, scene, shaded, smooth, still
from support.small_room import quad

from benchharness.scene import Environment, Mesh, Object, Reflector, Scene, subdivided

SKY = (0.1, 0.2, 0.3)
SIZE = (96, 64)


def one(method, made, size=SIZE, index=0):
    return shaded(method, made, index, size=size)[0]


def rms(one_, other, where) -> float:
    return float(np.sqrt(((one_.L - other.L)[where] ** 2).mean()))


def rays(answer: Answer) -> tuple[np.ndarray, np.ndarray]:
    """Where the pixels' reflected rays start, and their directions, float64 [H, W, 3]; NaN off the mirrors."""
    p, n, v = (
        np.array(x, np.float64).T.reshape(*answer.active.shape, 3) for x in (answer.frame.p, answer.frame.n, answer.frame.v)
    )
    d = 2 * (n * v).sum(axis=-1, keepdims=True) * n - v
    off = ~answer.active
    p[off], d[off] = np.nan, np.nan
    return p, d / np.linalg.norm(d, axis=-1, keepdims=True)


def disc(radius: float, middle, u, v, rings: int = 60, slices: int = 240) -> Mesh:
    """A flat disc along unit u and v, with `smooth` colours."""
    r, angle = np.meshgrid(radius * np.arange(rings + 1) / rings, 2 * np.pi * np.arange(slices) / slices, indexing="ij")
    points = middle + r.reshape(-1, 1) * (np.cos(angle).reshape(-1, 1) * u + np.sin(angle).reshape(-1, 1) * v)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(rings), np.arange(slices), indexing="ij"))
    a, b = i * slices + j, i * slices + (j + 1) % slices
    faces = np.concatenate([np.stack([a, a + slices, b + slices], 1), np.stack([a, b + slices, b], 1)[i > 0]])
    return Mesh(points, faces, radiance=smooth(points, 0.2))


CARD = np.array([0.1, -0.5, 0.9]), np.array([0.8, 0.6, 0.0]), np.array([0.36, -0.48, -0.8])  # middle, two unit axes
CARD_RADIUS = 0.5


def card(**more) -> Scene:
    """A disc of smooth colours over a mirror ball."""
    return scene((Object("card", disc(CARD_RADIUS, *CARD), "a picture"),), (mirror_ball(),), background=SKY, **more)


def floor(half: float = 2.0, z: float = -0.5) -> Object:
    mesh = subdivided(quad((-half, -half, z), (2 * half, 0, 0), (0, 2 * half, 0)), 0.1)
    return Object("floor", Mesh(mesh.vertices, mesh.faces, radiance=smooth(mesh.vertices, 0.3)), "something below")


def row_of_mirrors(objects: int, mirrors: int, **more) -> Scene:
    """`mirrors` balls in rows of three on a floor, which is the first of up to three objects."""
    red = Object("red", ball(0.15, (0.0, -0.7, -0.3), (0.9, 0.1, 0.1)), "something near")
    blue = Object("blue", ball(0.15, (0.6, -0.8, -0.3), (0.1, 0.1, 0.9)), "something near")
    count = min(mirrors, 3)
    at = [((i % 3 - 0.5 * (count - 1)) * 0.8, 0.8 * (i // 3), 0.0) for i in range(mirrors)]
    balls = tuple(mirror_ball(f"m{i}", at[i], 0.35, 48, **more) for i in range(mirrors))
    return scene((floor(), red, blue)[:objects], balls, still((0.1, -2.2, 0.9), (0.0, 0.1, -0.1)), background=SKY)


def sheet(width: float = 4.0) -> Reflector:
    """A plane mirror at y = 1 that faces -y."""
    return Reflector("sheet", plain(quad((-width / 2, 1, -0.8), (width, 0, 0), (0, 0, 1.6)), (0, 0, 0)))


GROUND_CENTRE = np.array([0.0, 0.0, 0.8])


def pattern(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Of the endless ground, [..., 3]; fades far away."""
    far = np.exp(-(x * x + y * y) / 60.0)[..., None]
    waves = np.stack([np.sin(1.7 * x), np.sin(1.3 * y + 1.0), np.sin(1.1 * (x + y) + 2.0)], axis=-1)
    return 0.5 + 0.3 * far * waves


def paint(d: np.ndarray) -> np.ndarray:
    """The sky, and below it the ground as `GROUND_CENTRE` sees it, z = 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(d[:, 2] < -1e-6, -GROUND_CENTRE[2] / d[:, 2], 0.0)
    t = np.minimum(t, 1e3)[:, None]
    ground = pattern(t[:, 0] * d[:, 0], t[:, 0] * d[:, 1])
    return np.where(d[:, 2:] < -1e-6, ground, 0.5 + 0.2 * np.maximum(d[:, 2:], 0))


def on_the_ground(lighter: float = 0.0) -> Scene:
    """A mirror ball over 4 x 4 m of a ground that goes on in the panorama; `lighter` than there by so much."""
    mesh = subdivided(quad((-2, -2, 0), (4, 0, 0), (0, 4, 0)), 0.08)
    ground = Object("ground", Mesh(mesh.vertices, mesh.faces, radiance=pattern(*mesh.vertices.T[:2]) + lighter), "goes on")
    around = Environment.painted(paint, 512, tuple(GROUND_CENTRE), "ground")
    camera = still((0.3, -2.4, 1.2), (0.0, 0.0, 0.45))
    return scene((ground,), (mirror_ball(center=(0.3, 0.1, 0.45), radius=0.4),), camera, environment=around)
