"""A picnic outdoors: a chequered cloth in a meadow with hills around it, clouds and a sun; cans and sugar to put on it.

The cloth lies on z = 0. Cans are as built by drawing programs: their labels are strips from rim to rim, one long thin
quad per facet. They are closed, and stand 2 mm deep in the cloth.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from benchharness.scene import Mesh, Object, merged

from ..props.shapes import Colour, arc, ball, box, lathe, placed, pose, tiles, tube

CLOTH = (-1.1, 1.1, -1.40, 0.80)
"""x from, to, y from, to, metres."""
CHECKS = (18, 18)
"""Checks of the cloth along x and y."""
HORIZON = 1.9
"""Radius of the meadow, metres; hills stand around it."""
METAL: Colour = (0.60, 0.60, 0.61)
SUN_AT = (-1.25, -1.15, 2.3)


def wrap(radius: float, z0: float, z1: float, colours: np.ndarray) -> Mesh:
    """An open cylinder about z, one quad from z0 to z1 per colour of `colours` [N, 3], with exact normals.

    Neighbours share their vertices unless their colours differ.
    """
    n = len(colours)
    change = np.flatnonzero((colours != np.roll(colours, 1, axis=0)).any(axis=1))
    runs = [(a, b) for a, b in pairwise([*change, change[0] + n])] if len(change) else [(0, n)]
    pieces = []
    for a, b in runs:
        angle = 2 * np.pi * np.arange(a, b + 1) / n
        normal = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
        low = radius * normal + [0, 0, z0]
        k, m = np.arange(b - a), b - a + 1
        faces = np.concatenate([np.stack([k, k + 1, m + k + 1], axis=1), np.stack([k, m + k + 1, m + k], axis=1)])
        both = np.concatenate([low, low + np.array([0, 0, z1 - z0])])
        pieces.append(Mesh(both, faces, np.concatenate([normal, normal]), tuple(colours[a % n])))
    return merged(*pieces)


def sectors(n: int, pattern: Sequence[tuple[float, Colour]]) -> np.ndarray:
    """Colours [n, 3] of n facets: stretches of the given shares of the way round, which add up to 1, in their order."""
    ends = np.cumsum([share for share, _ in pattern])
    which = np.searchsorted(ends * (1 + 1e-9), (np.arange(n) + 0.5) / n)
    return np.array([colour for _, colour in pattern], np.float64)[which]


def soda(n: int, pattern: Sequence[tuple[float, Colour]], radius: float = 0.085, height: float = 0.30) -> Mesh:
    """A beverage can: a label of upright stripes, drawn-in shoulders, a lid with its tab. Stands on z = 0."""
    r, h = radius, height
    foot = lathe([(0, 0.004), (0.70 * r, 0), (0.78 * r, 0), (r, 0.06 * h)], n, METAL)
    body = wrap(r, 0.06 * h, 0.88 * h, sectors(n, pattern))
    top = [(r, 0.88 * h), (0.84 * r, 0.965 * h), (0.86 * r, h), (0.80 * r, h), (0.78 * r, 0.975 * h), (0, 0.975 * h)]
    shoulder = lathe(top, n, [pattern[0][1], METAL, METAL, METAL, METAL])
    tab = tube(arc((0, 0.16 * r, 0.985 * h), (0.2 * r, 0, 0), (0, 0.30 * r, 0), -90, 270, 8), 0.04 * r, 4, METAL)
    return merged(foot, body, shoulder, tab)


def tin(n: int, pattern: Sequence[tuple[float, Colour]], radius: float = 0.10, height: float = 0.24) -> Mesh:
    """A food tin: a paper label of upright stripes between two rims. Stands on z = 0."""
    r, h, rim = radius, height, 0.012
    low = lathe([(0, 0), (1.03 * r, 0), (1.03 * r, 0.6 * rim), (r, rim)], n, METAL)
    body = wrap(r, rim, h - rim, sectors(n, pattern))
    top = lathe(
        [(r, h - rim), (1.03 * r, h - 0.6 * rim), (1.03 * r, h), (0.96 * r, h), (0.95 * r, h - 0.006), (0, h - 0.006)], n, METAL
    )
    return merged(low, body, top)


def lying(mesh: Mesh, radius: float, x: float, y: float, turn_deg: float, spin_deg: float = 0.0) -> Mesh:
    """A can that stands on z = 0, laid down with its middle over (x, y); `turn_deg` is where its top points, from +y.

    spin_deg  turns it about its own axis first
    """
    middle = 0.5 * (mesh.vertices[:, 2].min() + mesh.vertices[:, 2].max())
    return mesh.transformed(pose((x, y, radius), turn_deg) @ pose(tilt_deg=-90) @ pose((0, 0, -middle), spin_deg))


def cloth() -> Object:
    """Red and white checks, each a quad of its own."""
    x0, x1, y0, y1 = CLOTH
    i, j = np.meshgrid(np.arange(CHECKS[0]), np.arange(CHECKS[1]))
    red, white, pink = (0.52, 0.05, 0.05), (0.78, 0.75, 0.70), (0.63, 0.27, 0.25)
    colour = np.where(((i + j) % 2 == 1)[..., None], pink, np.where((i % 2 == 0)[..., None], white, red))
    mesh = tiles((x0, y0, 0), (x1 - x0, 0, 0), (0, y1 - y0, 0), CHECKS, colour)
    return Object("cloth", mesh, "a gingham cloth: straight lines right under the eyes, contact shadows of feet and cans")


def sugar(bevel: float = 0.004) -> Mesh:
    """Three lumps of sugar about the origin, one on the others."""
    lump = box((-0.032, -0.032, 0.0005), (0.032, 0.032, 0.05), (0.86, 0.85, 0.83), bevel=bevel)
    return merged(placed(lump, (-0.036, 0, 0), 12), placed(lump, (0.040, 0.012, 0), -20), placed(lump, (0.0, 0.004, 0.05), 38))


def meadow(around: int, rings: int) -> Object:
    """Grass from the border of the cloth to the hills; mottled."""
    x0, x1, y0, y1 = CLOTH
    middle = np.array([0.5 * (x0 + x1), 0.5 * (y0 + y1)])
    corners = np.arctan2(*(np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]) - middle).T[::-1])
    angle = np.unique(np.round(np.concatenate([np.linspace(-np.pi, np.pi, around, endpoint=False), corners]), 9))
    way = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    half = 0.5 * np.array([x1 - x0, y1 - y0])
    border = middle + way / (abs(way) / half).max(axis=1, keepdims=True)
    along = way @ middle
    outer = middle + way * (np.sqrt(along**2 + (1.02 * HORIZON) ** 2 - middle @ middle) - along)[:, None]
    share = np.linspace(0, 1, rings) ** 1.3
    p = ((1 - share)[:, None, None] * border + share[:, None, None] * outer).reshape(-1, 2)
    n, k = len(angle), np.arange(len(angle))
    nxt = (k + 1) % n
    faces = []
    for r in range(rings - 1):
        a, b, c, d = r * n + k, r * n + nxt, (r + 1) * n + nxt, (r + 1) * n + k
        faces += [np.stack([a, d, c], axis=1), np.stack([a, c, b], axis=1)]
    rng = np.random.default_rng(11)
    tint = np.array([0.17, 0.34, 0.06]) * rng.uniform(0.65, 1.25, (len(p), 1)) * rng.uniform(0.9, 1.1, (len(p), 3))
    up = np.tile([0.0, 0.0, 1.0], (len(p), 1))
    mesh = Mesh(np.column_stack([p, np.full(len(p), -0.002)]), np.concatenate(faces), up, tint)
    return Object("meadow", mesh, "grass around the cloth: the dark lower half of what the eyes see")


def hills(around: int) -> Object:
    """Two rows of hills all around, the farther ones paler."""
    angle = 2 * np.pi * np.arange(around) / around
    rows = [
        (HORIZON, 0.30 + 0.10 * np.sin(3 * angle) + 0.06 * np.sin(7 * angle + 1), (0.14, 0.29, 0.07), (0.24, 0.42, 0.10)),
        (
            1.06 * HORIZON,
            0.52 + 0.14 * np.sin(2 * angle + 2) + 0.09 * np.sin(5 * angle),
            (0.22, 0.38, 0.26),
            (0.34, 0.47, 0.44),
        ),
    ]
    parts = []
    for radius, height, low, high in rows:
        foot = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(around, -0.02)], axis=1)
        crest = foot * [1.04, 1.04, 0] + np.stack([0 * angle, 0 * angle, height], axis=1)
        k, nxt = np.arange(around), (np.arange(around) + 1) % around
        faces = np.concatenate([np.stack([nxt, k, around + k], axis=1), np.stack([nxt, around + k, around + nxt], axis=1)])
        colour = np.repeat([low, high], around, axis=0)
        parts.append(Mesh(np.concatenate([foot, crest]), faces, albedo=colour))
    return Object("hills", merged(*parts), "the skyline: in every eye a curve that tells what is far from what is near")


def clouds(n: int) -> Object:
    """Three clouds of four puffs each."""
    puff = ball(1.0, n, max(5, n // 2 + 1), (0.86, 0.86, 0.87))
    shape = [(0, 0, 0, 0.22), (0.24, 0.02, -0.05, 0.16), (-0.25, -0.02, -0.06, 0.15), (0.08, 0.05, 0.13, 0.15)]
    parts = []
    for bearing, height, size in ((-62, 1.45, 1.05), (-150, 1.2, 1.2), (25, 1.3, 1.0)):
        cloud = merged(
            *(Mesh(puff.vertices * [r, 0.6 * r, 0.7 * r] + [x, y, z], puff.faces, albedo=puff.albedo) for x, y, z, r in shape)
        )
        a = np.radians(bearing)
        parts.append(placed(cloud, (2.3 * np.cos(a), 2.3 * np.sin(a), height), bearing + 90, scale=size))
    return Object("clouds", merged(*parts), "white shapes in the sky, seen in the upper half of the eyes only")


def sun(n: int, radiance: Colour, radius: float = 0.42) -> Object:
    """A round lamp that faces the middle of the cloth: soft shadows, and a round light in every eye."""
    out = -np.array(SUN_AT) / np.linalg.norm(SUN_AT)
    angle = 2 * np.pi * np.arange(n) / n
    x = np.cross([0.0, 0.0, 1.0], out)
    x /= np.linalg.norm(x)
    y = np.cross(out, x)
    ring = radius * (np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * y)
    vertices = np.concatenate([[[0.0, 0.0, 0.0]], ring]) + SUN_AT
    k = np.arange(n)
    faces = np.stack([np.zeros(n, int), 1 + k, 1 + (k + 1) % n], axis=1)
    mesh = Mesh(vertices, faces, np.tile(out, (n + 1, 1)), (0.05, 0.05, 0.05), radiance)
    return Object("sun", mesh, "the light that casts shadows: a round highlight in every eye")
