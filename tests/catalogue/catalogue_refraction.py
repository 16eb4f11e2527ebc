"""What both searches find of refracted light and of caustics, which no method here shows. Float64, the unit sphere.

The eye at (0, 0, 4) looks into a ball of glass, an eye in air and a vertex within. Where a light's path P has |EP| + index |PV|
as a stationary length (Fermat), Snell's law holds: e = unit(P - E) + index unit(P - V) stands along the normal. So the secants
of Roger and Holzschuch need another e, and the search of Estalella et al. another half vector. Truths are made from Snell's
law, ray by ray. What comes out of the ball again meets a second surface, at a point that depends on the first: no search here
has two points.

Caustics: the eye's place is taken by a lamp, and a path that a search finds is light that arrives.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from catalogue.catalogue_row import Row, within
from oracles import secant_oracle as oracle
from support.placed import EYE, FPX, off_px
from support.star_shapes import Sphere
from support.truth_shapes import Quadric, alhazen_inside, unit

INDEX = 1.5
CLASSES = ((0.5, 1.0), (0.2, 0.5), (0.02, 0.2))  # cosines of incidence
FORWARD = np.array([0.0, 0.0, -1.0])


def refracted(low: float, high: float, count: int = 300):
    """(V within the ball, P where the eye's ray to it enters), by Snell's law; V lies up to 0.9 of the way through."""
    rng = np.random.default_rng(0)
    P = unit(rng.normal(size=(100 * count, 3)))
    w = unit(EYE - P)
    cosine = (w * P).sum(axis=1)
    kept = np.flatnonzero((cosine > low) & (cosine <= high))[:count]
    P, w, cosine = P[kept], w[kept], cosine[kept, None]
    sine = (cosine * P - w) / INDEX  # the part of the refracted direction along the surface
    d = sine - np.sqrt(1 - (sine**2).sum(axis=1, keepdims=True)) * P
    through = -2 * (d * P).sum(axis=1, keepdims=True)
    return P + rng.uniform(0.1, 0.9, (len(P), 1)) * through * d, P


def bent(P, V):
    """e of the path by way of P."""
    return unit(P - EYE) + INDEX * unit(P - V)


def lawful(P, V) -> np.ndarray:
    """How far the sines of Snell's law differ at P [N, 3]."""
    w_E, w_V = unit(EYE - P), unit(V - P)
    return np.abs(np.linalg.norm(np.cross(P, w_E), axis=1) - INDEX * np.linalg.norm(np.cross(P, w_V), axis=1))


# Roger and Holzschuch, 5: secants.


def closed_in(V, u, gradient, most: int = 60):
    """(best sample [N, 3], whether the longest edge came under a pixel): secant triangles on the unit sphere from directions u
    [N, 3, 3]."""
    u, lane = u.copy(), np.arange(len(V))
    g = gradient(u, V[:, None])
    closed = np.zeros(len(V), bool)
    for _ in range(most):
        closed |= oracle.size_px(u, EYE, FORWARD, FPX, "edge") < 1
        alpha, beta, _ = oracle.combination(g)
        D = alpha[:, None] * u[:, 0] + beta[:, None] * u[:, 1] + (1 - alpha - beta)[:, None] * u[:, 2]
        going = ~closed & (np.linalg.norm(D, axis=1) > 1e-9)
        new = oracle.unit(D)
        worst = np.linalg.norm(g, axis=2).argmax(axis=1)
        i, k = lane[going], worst[going]
        u[i, k], g[i, k] = new[going], gradient(new, V)[going]
    best = np.linalg.norm(g, axis=2).argmin(axis=1)
    return u[lane, best], closed


@cache
def by_secants(low: float, high: float) -> dict[str, float]:
    """Of 300: those that close in within 2 px of P, and those that close in elsewhere on another path, before the ball."""
    V, P = refracted(low, high)

    def gradient(u, V):
        e = bent(u, V)
        return e - (e * u).sum(axis=-1, keepdims=True) * u

    # Around where the straight line to V enters: an eighth of the angle from there to V, as where reflections are begun.
    at = Quadric((1.0, 1.0, 1.0)).hit(EYE, V - EYE)[:, None]
    u = unit(EYE + at * (V - EYE))
    one = oracle.any_tangent(u)
    two, turn = np.cross(u, one), 2 * np.pi / 3 * np.arange(3)
    around = np.stack([unit(u + 0.05 * (np.cos(f) * one + np.sin(f) * two)) for f in turn], axis=1)
    found, closed = closed_in(V, around, gradient)
    off = off_px(found, P)
    good = closed & (off < 2)
    other = closed & ~good & (lawful(found, V) < 1e-2) & (((EYE - found) * found).sum(axis=1) > 0)
    return {"found": int(good.sum()), "other": int(other.sum())}


# Estalella et al., 7: the search in the picture.

SIZE = 256
TAN = 1.05 / np.sqrt(15)  # of half the picture's angle: a little more than the ball's


def pixel(P):
    """Pixels [..., 2] of points in a picture of SIZE² that holds the ball."""
    return SIZE / 2 * (1 + P[..., :2] / (4 - P[..., 2:]) / TAN)


@cache
def pictured():
    """The ball's points, NaN beside it, [SIZE, SIZE, 3]: also its normals."""
    x, y = np.meshgrid(*2 * [((np.arange(SIZE) + 0.5) / SIZE * 2 - 1) * TAN], indexing="ij")
    d = unit(np.stack([x, y, -np.ones_like(x)], axis=-1))
    return EYE + Quadric((1.0, 1.0, 1.0)).hit(EYE, d)[..., None] * d


@cache
def by_search(low: float, high: float, start: str) -> dict[str, float]:
    """Of 300 searches that ask all eight neighbours, from the middle of the picture or "straight" from where V would be seen
    without glass: those that end within 1.5 texels, and those that end elsewhere, at a texel of another path."""
    V, P = refracted(low, high)
    texture, at = pictured(), np.full((len(V), 2), SIZE // 2)
    if start == "straight":
        at = np.floor(pixel(V)).astype(int)
    steps = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)])
    for _ in range(SIZE):
        asked = np.clip(at[:, None] + steps, 0, SIZE - 1)
        p = texture[asked[..., 0], asked[..., 1]]
        score = ((unit(bent(p, V[:, None])) - p) ** 2).sum(axis=-1)  # 0 where e stands along the normal, outward
        best = np.where(np.isnan(score), np.inf, score).argmin(axis=1)
        moved = asked[np.arange(len(V)), best]
        if (moved == at).all():
            break
        at = moved
    off = np.linalg.norm(at + 0.5 - pixel(P), axis=1)
    law = lawful(texture[at[:, 0], at[:, 1]], V) < 2e-2  # a texel is 0.009 wide
    return {"found": int((off < 1.5).sum()), "other": int(((off >= 1.5) & law).sum())}


# Roger and Holzschuch, 5: caustics. A lamp takes the eye's place.

LAMP = np.array([0.0, 0.0, -0.6])


def arriving(R, V) -> float:
    """Light at V on the plane z = V_z by way of R in the hollow ball, by ratio of a small solid angle at the lamp to what it
    comes to there: from rays beside the path, each reflected and met with the plane."""

    def landed(d):
        d = unit(d)
        b = d @ LAMP
        P = LAMP + (-b + np.sqrt(b * b - LAMP @ LAMP + 1)) * d
        r = d - 2 * (d @ P) * P
        return (P + (V[2] - P[2]) / r[2] * r)[:2]

    d, h = unit(R - LAMP), 1e-5
    one = oracle.any_tangent(d)
    two = np.cross(d, one)
    columns = [(landed(d + h * t) - landed(d - h * t)) / (2 * h) for t in (one, two)]
    return 1 / max(abs(float(np.linalg.det(np.array(columns)))), 1e-9)


@cache
def in_a_hollow(z: float) -> dict[str, float]:
    """Of 100 points of a plane across a hollow ball that a lamp lights: those with more than two paths, and the share of the
    light that comes along the one path which secants find, median of all."""
    rng, shares = np.random.default_rng(0), []
    angle, away = rng.uniform(0, 2 * np.pi, 100), 0.9 * np.sqrt(rng.uniform(0, 1 - z * z, 100))
    V = np.stack([away * np.cos(angle), away * np.sin(angle), np.full(100, z)], axis=1)
    found = oracle.secant(Sphere(), LAMP, V, stop="edge", start="paper", forward=np.array([0.0, 0.0, 1.0])).R
    for point, path in zip(V, found, strict=True):
        R = alhazen_inside(LAMP, point)
        light = np.array([arriving(one, point) for one in R])
        off = np.linalg.norm(R - path, axis=1)
        shares.append((len(R), light[off.argmin()] / light.sum() if off.min() < 1e-2 else 0.0))
    paths, share = np.array(shares).T
    return {"several": int((paths > 2).sum()), "share": float(np.median(share))}


SECANTS = {(0.5, 1.0): (299, 1), (0.2, 0.5): (237, 60), (0.02, 0.2): (166, 130)}
SEARCHES = {(0.5, 1.0): (257, 300), (0.2, 0.5): (131, 230), (0.02, 0.2): (79, 158)}
HOLLOWS = {0.0: 0.909, 0.3: 0.822, 0.6: 0.118, 0.9: 0.0559}
OWN = "our own, pinned; float64"

ROWS: list[Row] = [
    *(Row("RH06 5", f"refraction by secants, of 300, cosines {low} to {high}: {kind}", "it can be used",
          lambda low=low, high=high, key=key: by_secants(low, high)[key], count - 2, count + 2, OWN)
      for (low, high), counts in SECANTS.items()
      for key, kind, count in zip(("found", "other"), ("found", "another path"), counts, strict=True)),
    *(Row("EMDT06 7", f"refraction by search, of 300, cosines {low} to {high}: found from {start}", "with ease",
          lambda low=low, high=high, key=key: by_search(low, high, key)["found"], count - 2, count + 2, OWN)
      for (low, high), counts in SEARCHES.items()
      for key, start, count in zip(("middle", "straight"), ("the middle", "the straight line"), counts, strict=True)),
    *(Row("EMDT06 7", f"refraction by search, of 300, cosines {low} to {high}: another path", "-",
          lambda low=low, high=high: by_search(low, high, "straight")["other"], count - 2, count + 2, OWN)
      for (low, high), count in zip(CLASSES, (0, 70, 128), strict=True)),
    *(Row("RH06 5", f"share of a hollow ball's light that the found path carries, median, z = {z}", "caustics",
          lambda z=z: in_a_hollow(z)["share"], *within(share, 0.1), OWN) for z, share in HOLLOWS.items()),
    Row("RH06 5", "points with more than two paths, of 100, z = 0.6", "-", lambda: in_a_hollow(0.6)["several"], 58, 58, OWN),
]  # fmt: skip
