"""A room to look at: boxes on a floor, a glowing panel in the ceiling, a mirror sphere. About 2,000 vertices."""

from __future__ import annotations

import numpy as np

from benchharness.scene import Camera, Mesh, Object, Reflector, Scene, merged, subdivided


def quad(corner, u, v, **look) -> Mesh:
    """Parallelogram with normal u x v."""
    corner, u, v = (np.asarray(x, float) for x in (corner, u, v))
    return Mesh(np.stack([corner, corner + u, corner + u + v, corner + v]), [[0, 1, 2], [0, 2, 3]], **look)


def box(low, high, inside: bool = False, **look) -> Mesh:
    """Axis-aligned box of six quads, seen from outside, or from inside."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    sides = []
    for axis in range(3):
        u, v = np.zeros(3), np.zeros(3)
        u[(axis + 1) % 3] = (high - low)[(axis + 1) % 3]
        v[(axis + 2) % 3] = (high - low)[(axis + 2) % 3]
        top = low.copy()
        top[axis] = high[axis]
        sides += (
            [quad(top, v, u, **look), quad(low, u, v, **look)]
            if inside
            else [
                quad(top, u, v, **look),
                quad(low, v, u, **look),
            ]
        )
    return merged(*sides)


def sphere(radius: float = 1.0, center=(0.0, 0.0, 0.0), slices: int = 64, stacks: int = 32, **look) -> Mesh:
    """Longitudes by latitudes, with analytic normals; watertight up to coinciding vertices at seam and poles."""
    phi, theta = np.meshgrid(np.linspace(0, 2 * np.pi, slices + 1), np.linspace(0, np.pi, stacks + 1))
    n = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(stacks), np.arange(slices), indexing="ij")
    a = (i * (slices + 1) + j).ravel()
    lower, upper = np.stack([a, a + slices + 1, a + slices + 2], 1), np.stack([a, a + slices + 2, a + 1], 1)
    faces = np.concatenate([lower[i.ravel() < stacks - 1], upper[i.ravel() > 0]])
    return Mesh(radius * n + np.asarray(center, float), faces, normals=n, **look)


def small_room(h: float = 0.2) -> Scene:
    def thing(name: str, mesh: Mesh) -> Object:
        return Object(name, subdivided(mesh, h), shows="something to reflect")

    red, blue, white = (0.7, 0.15, 0.1), (0.15, 0.25, 0.7), (0.7, 0.7, 0.65)
    return Scene(
        name="small_room",
        objects=(
            thing("walls", box((-2, -2, 0), (2, 2, 2.5), inside=True, albedo=white)),
            thing("panel", quad((-0.7, -0.7, 2.49), (0, 1.4, 0), (1.4, 0, 0), emission=(9.0, 8.5, 8.0))),
            thing("red", box((-1.5, -0.2, 0), (-0.9, 0.4, 1.2), albedo=red)),
            thing("blue", box((0.6, -1.2, 0), (1.3, -0.6, 0.6), albedo=blue)),
        ),
        reflectors=(Reflector("ball", sphere(0.6, (0.0, 0.6, 0.6)), eta=(0.2, 0.92, 1.1), k=(3.9, 2.45, 2.1)),),
        camera=lambda time: Camera(eye=(0.3, -1.9, 1.4), target=(0.0, 0.6, 0.6), fov_deg=48.0),
        frames=1,
        exposure=-0.5,
    )
