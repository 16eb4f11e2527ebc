"""Random mirrors and vertices that they reflect at known points, and what methods report of them."""

from __future__ import annotations

import functools

import numpy as np
from support.mirror_room import scene, shaded, still
from support.star_shapes import Ellipsoid
from support.truth_shapes import unit

from benchharness.scene import Mesh, Object, Reflector
from benchharness.study import plugins

METHODS = {name: plugin.target for name, plugin in plugins.discover("method").items()}
# Those that may find a point wherever a vertex is.
SEARCHING = ("angle_iteration", "image_space_search", "newton", "secant_triangle", "specular_polynomial")
VERTEXWISE = (*SEARCHING, "explosion_map")  # which report vertices; test_fuzz holds it to what they do
COUNT = 24_000  # vertices of an example
SIZE = (320, 240)
FOV_DEG = 40.0


def reflected(shape, eye, seed: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points [count, 3] of a shape that face the eye, and vertices that they reflect to it; visible if it is convex."""
    rng = np.random.default_rng(seed)
    P = shape.points(rng, 12 * count)
    n, w = shape.normal(P), unit(eye - P)
    P, n, w = (a[(n * w).sum(axis=1) > 0.1][:count] for a in (P, n, w))
    assert len(P) == count
    away = 2 * (n * w).sum(axis=1, keepdims=True) * n - w
    return P, P + np.exp(rng.uniform(np.log(0.05), np.log(20.0), (count, 1))) * away


def points_of(V: np.ndarray) -> Object:
    """Vertices of triangles without area: nothing of them is drawn."""
    one = np.arange(len(V))[:, None].repeat(3, axis=1)
    return Object("points", Mesh(V, one, np.tile([0.0, 0, 1], (len(V), 1)), radiance=np.ones((len(V), 3))), "reflections")


def world(shape, eye, seed: int, count: int = COUNT, fine: int = 5):
    """A mirror, and vertices [count, 3] that it reflects to the eye at points [count, 3]."""
    P, V = reflected(shape, eye, seed, count)
    mesh = shape.mesh(fine)
    camera = still(tuple(eye), (0.0, 0.0, 0.0), FOV_DEG)
    return scene([points_of(V)], [Reflector("mirror", mesh, mesh)], camera, frames=1), P, V


def asked(name: str, made) -> dict[str, np.ndarray]:
    """What a method reports of the vertices of the first object."""
    reported = shaded(METHODS[name](), made, 0, size=SIZE)[0].reflection.vertices
    count = len(made.objects[0].mesh.vertices)
    return {key: np.array(value).T[:count] for key, value in vars(reported).items() if key != "further"}


@functools.cache
def reporting() -> list[str]:
    """Methods that report vertices."""
    made, _, _ = world(Ellipsoid(half=(0.8, 0.8, 0.8)), np.array([0.0, -3.0, 0.5]), 0, count=12, fine=2)
    answers = {
        name: shaded(method(), made, 0, size=(32, 24))[0].reflection
        for name, method in METHODS.items()
        if method().refuses(made) is None
    }
    return [name for name, answer in answers.items() if answer.vertices is not None]
