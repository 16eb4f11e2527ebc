"""Rooms whose walls and a ball in them have pictures; and the same rooms with the pictures in the colours of many vertices."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from oracles.texture_oracle import looked_up
from support.mirror_room import mirror_ball, scene, smooth, still
from support.small_room import box, quad, sphere

from benchharness.modelling.texture import Wrap
from benchharness.scene import Mesh, Object, Reflector, Scene, Texture, subdivided

Wraps = Wrap | tuple[Wrap, Wrap]
SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)  # of `quad`, whose first side is along u
SHEET = Reflector("sheet", quad((-0.7, 0.1, -0.6), (1.4, 0.2, 0.1), (0.05, 0.2, 1.2)))


def noise(width: int = 12, height: int = 9, wrap: Wraps = "repeat", seed: int = 0) -> Texture:
    """Every pixel another colour: what is a pixel off, turned or mirrored, is seen."""
    return Texture(np.random.default_rng(seed).random((height, width, 3)), wrap)


def wavy(wrap: Wraps = "clamp", width: int = 24, height: int = 16) -> Texture:
    """Smooth, unlike itself however it is turned, in [0.1, 1]."""
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    channels = 0.55 + 0.45 * np.sin(5 * x), 0.55 + 0.45 * np.cos(6 * y * y), 0.1 + 0.9 * x * (1 - y)
    return Texture(np.stack(channels, axis=2), wrap)


def walls(texture: Texture, uv: np.ndarray = SQUARE, half: float = 2.0) -> Mesh:
    """Six walls of two triangles each, the picture on every one."""
    mesh = box((-half,) * 3, (half,) * 3, inside=True, uv=uv, texture=texture)
    return replace(mesh, radiance=smooth(mesh.vertices))


def globe(texture: Texture, at=(0.45, -0.85, 0.1), radius: float = 0.25, slices: int = 16) -> Mesh:
    """A ball with the picture around it, u the longitude, v from the lower pole to the upper."""
    mesh = sphere(radius, (0, 0, 0), slices, slices // 2)
    u, v = np.meshgrid(np.linspace(0, 1, slices + 1), np.linspace(1, 0, slices // 2 + 1))
    uv = np.column_stack([u.ravel(), v.ravel()])
    return replace(mesh, vertices=mesh.vertices + np.asarray(at), radiance=0.9 * np.ones(3), uv=uv, texture=texture)


def room(paper: Texture, skin: Texture, mirror: Reflector | None = None, uv: np.ndarray = SQUARE, **more) -> Scene:
    """A mirror in a papered room, and a globe before it."""
    things = Object("walls", walls(paper, uv), "pictures all around"), Object("globe", globe(skin), "a picture near by")
    return scene(things, (mirror_ball(fine=64) if mirror is None else mirror,), more.pop("camera", still()), **more)


def coloured(mesh: Mesh, h: float) -> Mesh:
    """A mesh with its picture in the colours of vertices no farther apart than h; the same surface."""
    assert mesh.texture is not None
    fine = subdivided(replace(mesh, texture=None), h)
    assert fine.radiance is not None and fine.uv is not None
    return replace(fine, radiance=fine.radiance * looked_up(mesh.texture.pixels, mesh.texture.along, fine.uv))


def without_pictures(made: Scene, h: tuple[float, ...]) -> Scene:
    """The same scene, its objects `coloured`."""
    objects = (replace(o, mesh=coloured(o.mesh, step)) for o, step in zip(made.objects, h, strict=True))
    return replace(made, objects=tuple(objects))


def untextured(made: Scene) -> Scene:
    """The scene as it would be if nobody looked at the pictures."""
    return replace(made, objects=tuple(replace(o, mesh=replace(o.mesh, texture=None)) for o in made.objects))
