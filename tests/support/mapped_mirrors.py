"""Mirrors with normal maps: a sheet with ripples, a ball with bumps; and rooms for them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from support.mirror_room import balls, scene, still, walls
from support.small_room import quad, sphere
from support.textured_rooms import SQUARE

from benchharness.modelling.texture import Wrap
from benchharness.scene import Reflector, Scene, Texture


def relief(slope_u: np.ndarray, slope_v: np.ndarray, wrap: Wrap | tuple[Wrap, Wrap] = "repeat") -> Texture:
    """The map of a surface that rises by these slopes along u and v, [H, W] each."""
    n = np.stack([-slope_u, -slope_v, np.ones_like(slope_u)], axis=2)
    return Texture(0.5 + 0.5 * n / np.linalg.norm(n, axis=2, keepdims=True), wrap)


def ripples(steepness: float, width: int = 48, height: int = 40) -> Texture:
    """Waves that go on over the edges, unlike themselves however they are turned or mirrored; slopes reach `steepness`."""
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, 1 - (np.arange(height) + 0.5) / height)
    one, other = 2 * np.pi * (u + 2 * v), 2 * np.pi * (2 * u - v)
    along = 0.6 * np.cos(one) + 0.4 * np.sin(other) ** 2
    across = 0.5 * np.sin(one) ** 3 + 0.5 * np.cos(other)
    most = np.hypot(along, across).max()
    return relief(steepness * along / most, steepness * across / most)


def rough(seed: int = 0, width: int = 7, height: int = 5, wrap: Wrap | tuple[Wrap, Wrap] = "repeat") -> Texture:
    """Every pixel another normal, up to 60 degrees off."""
    along, across = np.random.default_rng(seed).uniform(-1.2, 1.2, (2, height, width))
    return relief(along, across, wrap)


def flat() -> Texture:
    return Texture(np.full((2, 2, 3), [0.5, 0.5, 1.0]))


def sheet(map: Texture | None, uv: np.ndarray = SQUARE, name: str = "sheet", **more) -> Reflector:
    """Leaning and turned, 1.4 x 1.2 m, before the middle of the room."""
    return Reflector(name, quad((-0.7, 0.1, -0.6), (1.4, 0.2, 0.1), (0.05, 0.2, 1.2), uv=uv), normal_map=map, **more)


def ball(map: Texture | None, turns: Sequence[float] = (4, 2), name: str = "ball", fine: int = 64, **more) -> Reflector:
    """The map `turns` times around it and from pole to pole."""
    mesh = sphere(0.5, (0, 0, 0), fine, fine // 2)
    u, v = np.meshgrid(np.linspace(0, turns[0], fine + 1), np.linspace(turns[1], 0, fine // 2 + 1))
    mesh = replace(mesh, uv=np.column_stack([u.ravel(), v.ravel()]))
    return Reflector(name, mesh, normal_map=map, **more)


def room(*mirrors: Reflector, **more) -> Scene:
    """Smooth colours all around, three balls near by."""
    return scene((walls(), *balls()), mirrors, more.pop("camera", still()), **more)


def smooth(made: Scene) -> Scene:
    """Without the maps."""
    return replace(made, reflectors=tuple(replace(mirror, normal_map=None) for mirror in made.reflectors))
