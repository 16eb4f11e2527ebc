"""Curved images of what is straight, and what a bowl shows (Roger and Holzschuch 2006, 4.4, 4.5 and 5).

A parabola through the exact image of an edge's middle takes the place of the straight line between its ends, in the picture, in
the distance that sorts what is reflected, or in both. Reflection points are Alhazen's; the unit sphere is seen from (0, 0, 4).
"""

from __future__ import annotations

from functools import cache

import numpy as np
from catalogue.catalogue_row import Row, within
from catalogue.catalogue_triangles import on_screen
from scipy.spatial import KDTree
from support.mirror_room import shaded
from support.placed import EYE, HEIGHT, WIDTH, camera
from support.truth_shapes import Quadric, alhazen, unit

from benchharness.regime import miss
from benchharness.scene import Reflector
from methods.ray_traced import RayTraced
from methods.secant_triangle import SecantTriangle
from scenes.props.minimal import RED, cap, eye, sphere, stage, thing

BALL = Quadric((1.0, 1.0, 1.0))
FINE = 4096


def image(V):
    """Pixels [..., 2] of the images of points V [..., 3], and the distances [...] from there to them."""
    R = alhazen(EYE, V)
    return on_screen(R), np.linalg.norm(V - R, axis=-1)


def parabola(ends, t):
    """What is `ends` (values at 0, 1/2 and 1, [3, ...]), at t [N], [N, ...]."""
    shape = np.stack([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)], axis=1)
    return np.tensordot(shape, ends, axes=1)


# The bar of F-14.


@cache
def bar() -> tuple[np.ndarray, np.ndarray]:
    """The images of FINE + 1 points of a bar from (-2, 1.3, 0.8) to (2, 1.3, 0.8), and their distances."""
    return image(np.array([-2, 1.3, 0.8]) + np.linspace(0, 4, FINE + 1)[:, None] * [1, 0, 0])


def pieces(count: int):
    """Of the bar in so many pieces: (numbers of their points, t of these in their piece), piece by piece."""
    length = FINE // count
    for first in range(0, FINE, length):
        yield first + np.arange(length + 1), np.linspace(0, 1, length + 1)


@cache
def bent(count: int) -> float:
    """px, Hausdorff, between the image of the bar and that of so many parabolas."""
    seen, _ = bar()
    line = np.concatenate([parabola(seen[at[[0, len(at) // 2, -1]]], t) for at, t in pieces(count)])
    return float(max(KDTree(seen).query(line)[0].max(), KDTree(line).query(seen)[0].max()))


@cache
def sorted_by(count: int, curved: bool) -> float:
    """How far off the distances along the bar are, in radii of the ball: interpolated in so many pieces, straight or as
    parabolas."""
    _, distance = bar()
    off = 0.0
    for at, t in pieces(count):
        first, middle, last = distance[at[[0, len(at) // 2, -1]]]
        found = parabola(np.array([first, middle, last]), t) if curved else (1 - t) * first + t * last
        off = max(off, float(np.abs(found - distance[at]).max()))
    return off


def order() -> float:
    """Of the parabolas' decay in the picture, from 8 pieces to 32."""
    return float(np.log2(bent(8) / bent(32)) / 2)


# The sticker of F-16, over a floor that is exact: the ray through each of its pixels is traced.


@cache
def under(edge: float, gap: float, z: float, *, picture: bool, depth: bool) -> float:
    """Share of a sticker's pixels in which a floor `gap` below it wins; curved or straight in the picture and in distance."""
    angle = 2 * np.pi * np.arange(3) / 3 + np.pi / 2
    corner = np.stack([np.cos(angle), np.zeros(3), -np.sin(angle)], axis=1) * edge / np.sqrt(3) + [0, gap - 1.3, z]
    node = np.concatenate([corner, (corner + np.roll(corner, -1, axis=0)) / 2])
    pixel, distance = image(node)

    # Weights of corners and edges' middles at points all over the triangle.
    a, b = (x.ravel() for x in np.meshgrid((np.arange(60) + 0.5) / 60, (np.arange(60) + 0.5) / 60))
    a, b = a[a + b < 1], b[a + b < 1]
    w = np.stack([a, b, 1 - a - b], axis=1)
    straight = np.concatenate([w, np.zeros_like(w)], axis=1)
    curved = np.concatenate([w * (2 * w - 1), 4 * w * np.roll(w, -1, axis=1)], axis=1)

    at = (curved if picture else straight) @ pixel
    own = (curved if depth else straight) @ distance
    matrix = camera().world_to_screen(WIDTH, HEIGHT)[:, :3]
    d = unit(np.column_stack([at, np.ones(len(at))]) @ np.linalg.inv(matrix).T)
    t = BALL.hit(EYE, d)
    P = EYE + t[:, None] * d
    r = d - 2 * (d * P).sum(axis=1, keepdims=True) * P
    floor = np.where(r[:, 1] < 0, (-1.3 - P[:, 1]) / np.where(r[:, 1] < 0, r[:, 1], -1), np.inf)
    return float((floor < own)[np.isfinite(t)].mean())


# What a bowl shows of a ball: 4.4.


@cache
def misplaced(away: float, rim: float = 0.0) -> float:
    """Share of the images of a ball, so many radii from the bottom of a bowl, the method's and the true ones, that is not in
    both; one bounce. The bowl is a ball above z = `rim`."""
    bowl = Reflector("mirror", cap(sphere(), rim, inside_out=True))
    red = thing("ball", sphere(0.08, (0.1, 0.0, 1.0 - away), 24), RED)
    made = stage([red], [bowl], eye((0.25, 0.0, -1.2), (0.0, 0.0, 0.6), 60.0))
    exact, found = (shaded(one, made, 0)[0] for one in (RayTraced(), SecantTriangle(self_reflection="omitted")))
    seen = [one.active & (np.abs(one.L - np.asarray(RED)).max(axis=-1) < 0.05) for one in (exact, found)]
    assert seen[0].sum() > 30
    share = miss(*seen)
    assert share is not None
    return share


PARABOLAS = {1: 3.98, 2: 5.13, 4: 0.812, 8: 0.109, 16: 0.0254, 32: 0.00324}
DISTANCES = {(1, False): 1.08, (1, True): 0.0785, (8, False): 0.0224, (8, True): 0.00049}
STICKER = {(False, False): 0.878, (False, True): 0.0847, (True, False): 0.925, (True, True): 0.0}
BOWLS = {(0.9, 0.6): 0.0, (0.45, 0.6): 0.133, (0.2, 0.6): 0.0159, (0.2, 0.0): 0.785}
OWN = "our own, pinned"

ROWS: list[Row] = [
    *(Row("RH06 4.5", f"px off, bar as {n} parabolas", "curved interpolation mends it", lambda n=n: bent(n), *within(px, 0.03),
          f"{OWN}; float64. Straight, in as many pieces: F-14") for n, px in PARABOLAS.items()),
    *(Row("RH06 4.5", f"distance off, radii, bar in {n} pieces, {'parabolas' if curved else 'straight'}", "more easily mended",
          lambda n=n, curved=curved: sorted_by(n, curved), *within(off, 0.03), f"{OWN}; float64")
      for (n, curved), off in DISTANCES.items()),
    *(Row("RH06 4.5", f"share that the floor wins of a sticker, picture {'curved' if a else 'straight'}, distance "
          f"{'curved' if b else 'straight'}", "curved interpolation mends it",
          lambda a=a, b=b: under(1.0, 0.05, 0.3, picture=a, depth=b), max(share - 0.01, 0), share + 0.01,
          f"{OWN}; float64. Straight in both, as F-16 has it of the kernels") for (a, b), share in STICKER.items()),
    *(Row("RH06 4.4", f"share misplaced of a ball {away} from the bottom, bowl above {rim}", "right near and far, not between",
          lambda away=away, rim=rim: misplaced(away, rim), max(share * 0.8 - 0.01, 0), share * 1.2 + 0.01,
          f"{OWN}; pixels at borders") for (away, rim), share in BOWLS.items()),
]  # fmt: skip
