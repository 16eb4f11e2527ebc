"""How secant triangles go on, and for how long: beside bisection, step by step, thing by thing, and by where things stand.

Roger and Holzschuch 2006, sections 3.1, 4.2 and 4.3. The unit sphere, seen from (0, 0, 4) with 800 px per unit of the focal
length, or the kettle of their figures. Searches start from the paper's first triangle and stop at a longest edge of one pixel.
"""

from __future__ import annotations

from functools import cache

import drjit as dr
import mitsuba as mi
import numpy as np
from catalogue.catalogue_row import Row, within
from oracles import secant_oracle as oracle
from scipy.stats import spearmanr
from support.placed import EYE, off_px, place, points, rows
from support.secant_cases import classed, star_of
from support.star_shapes import Sphere, hidden
from support.truth_shapes import unit

from benchharness.kernels import placement
from benchharness.kernels.vertices import mirrormesh, secant, sight, starmap
from benchharness.render.frame import view_of
from scenes.kettle import kettle

CLASSES = {"head-on": (0.5, 1.0), "slanted": (0.2, 0.5), "grazing": (0.02, 0.2)}  # cosines of incidence
NEAR_PX = 0.5  # so near to the reflection point a search has come to it
MOST = 60  # samples


def samples(star: starmap.StarMap, local: placement.MirrorFrame, count: int) -> np.ndarray:
    """How many the paper's search takes until its triangle is small, [count]; MOST where it never is."""
    every, no = dr.full(mi.Bool, True, count), dr.full(mi.Bool, False, count)
    first = secant.start("param", "paper", star, local, mi.Vector3f(dr.zeros(mi.Float, count)), no, every)
    tau = mi.Float(oracle.TAU["edge"])
    _, closed, taken, _ = secant.close_in("param", "edge", star, local, first, every, tau, mi.UInt32(MOST))
    return np.where(np.array(closed), np.array(taken).astype(int), MOST)


# 3.1: one variable, along the arc that the reflection point lies on.


def arrived(off: np.ndarray) -> np.ndarray:
    """After how many of the steps [S, N] searches are within NEAR_PX for good; S + 1 for never."""
    away = off > NEAR_PX
    last = len(off) - np.argmax(away[::-1], axis=0)
    return np.where(away.any(axis=0), last + 1, 1)


@cache
def on_the_arc(name: str) -> dict[str, float]:
    """Of 300 vertices: mean steps of bisection and of secants, both from the arc's two ends."""
    V, R = classed("sphere", *CLASSES[name])
    x = unit(EYE)
    y = unit(V - (V @ x)[:, None] * x)
    end = np.arccos(np.clip(unit(V) @ x, -1, 1))

    def at(angle):
        return np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * y

    def slope(angle):
        P = at(angle)
        along = np.cos(angle)[:, None] * y - np.sin(angle)[:, None] * x
        return ((unit(P - EYE) + unit(P - V)) * along).sum(axis=1)

    low, high, halved = np.zeros(len(V)), end.copy(), []
    one, two, straight = np.zeros(len(V)), end.copy(), []
    for _ in range(MOST):
        middle = (low + high) / 2
        before = slope(middle) < 0
        low, high = np.where(before, middle, low), np.where(before, high, middle)
        halved.append(off_px(at(middle), R))

        f, g = slope(one), slope(two)
        flat = np.abs(g - f) < 1e-15
        one, two = two, np.where(flat, two, two - g * (two - one) / np.where(flat, 1, g - f))
        straight.append(off_px(at(two), R))
    bisection, secants = arrived(np.array(halved)), arrived(np.nan_to_num(np.array(straight), nan=np.inf))
    return {"bisection": bisection.mean(), "secants": secants.mean()}


# 4.3: how long steps are.


@cache
def stepped(name: str) -> tuple[np.ndarray, np.ndarray]:
    """(px from the last sample to the reflection point, px from it to the next sample), of all steps of 300 searches that begin
    more than NEAR_PX away; without the discarded samples that come back."""
    V, R = classed("sphere", *CLASSES[name])
    shape, lane = Sphere(), np.arange(len(V))
    u = oracle.first_triangle(shape, EYE, V)
    g, _ = oracle.gradient(shape, EYE, V[:, None], u)
    last, distance, length = None, [], []
    for _ in range(20):
        alpha, beta, plane = oracle.combination(g)
        P = shape.P(u)
        new = unit(alpha[:, None] * P[:, 0] + beta[:, None] * P[:, 1] + (1 - alpha - beta)[:, None] * P[:, 2])
        if last is not None:
            away = off_px(last, R)
            kept = (away > NEAR_PX) & (plane > oracle.FLAT)
            distance.append(away[kept])
            length.append(off_px(new, last)[kept])
        worst = np.linalg.norm(g, axis=2).argmax(axis=1)
        u[lane, worst], g[lane, worst] = new, oracle.gradient(shape, EYE, V, new)[0]
        last = shape.P(new)
    return np.concatenate(distance), np.concatenate(length)


def steps_far_over_near() -> float:
    """Median length of steps that begin more than 50 px away, over that of those that begin less than 5 px away."""
    distance, length = (np.concatenate(both) for both in zip(*map(stepped, CLASSES), strict=True))
    return float(np.median(length[distance > 50]) / np.median(length[distance < 5]))


@cache
def rank(name: str) -> float:
    """Of both, Spearman's correlation."""
    return float(spearmanr(*stepped(name)).statistic)


# 4.3: thing by thing, in the kettle of the paper's figures.


@cache
def in_the_kettle() -> tuple[np.ndarray, np.ndarray]:
    """(samples per vertex that the kettle does not hide, MOST for those that never stop; number of the vertex' object)."""
    made = kettle("paper", moving=False)
    meshes = [part.mesh.transformed(part.pose(0.0)) for part in made.parts]
    body, things = meshes[-1], meshes[: len(made.objects)]
    V = np.concatenate([mesh.vertices for mesh in things])
    thing = np.repeat(np.arange(len(things)), [len(mesh.vertices) for mesh in things])
    camera = view_of(made.camera(0.0), 720, 512, 0.01)
    local = placement.mirror_frame(rows(np.eye(4)), points(V), camera)
    mesh = mirrormesh.build(body.vertices, body.normals, body.faces)
    shown = ~np.array(sight.look_at(mesh, local, dr.full(mi.Bool, True, len(V))).shadow)
    star = starmap.build(body.vertices, body.normals, body.faces, 128)
    return samples(star, local, len(V))[shown], thing[shown]


def within_things() -> float:
    """Standard deviation of samples within objects, over that of all vertices."""
    samples, thing = in_the_kettle()
    mean = np.bincount(thing, samples) / np.maximum(np.bincount(thing), 1)
    return float((samples - mean[thing]).std() / samples.std())


def waited_for(lanes: int, *, mixed: bool = False) -> float:
    """Samples until the last of so many vertices in a row has stopped, over the mean of all; `mixed`: of any vertices."""
    samples, _ = in_the_kettle()
    if mixed:
        samples = np.random.default_rng(0).permutation(samples)
    whole = samples[: len(samples) // lanes * lanes].reshape(-1, lanes)
    return float(whole.max(axis=1).mean() / whole.mean())


def spared(share: float) -> float:
    """Mean samples per vertex, over the fixed number after which as large a share of the vertices has stopped."""
    samples, _ = in_the_kettle()
    return float(samples.mean() / np.quantile(samples, share))


# 4.2: where things stand.


def shell(degrees: float | None) -> np.ndarray:
    """1,000 vertices of a ball of radius 0.5 that stands 3 from the mirror's middle, so many degrees from the eye; None: of a
    shell of radius 3 around it. None that the mirror hides."""
    u = unit(np.random.default_rng(0).normal(size=(4000, 3)))
    V = 3 * u
    if degrees is not None:
        angle = np.radians(degrees)
        V = 3 * np.array([np.sin(angle), 0, np.cos(angle)]) + 0.5 * u
    V = V[~hidden(Sphere(), EYE, V)][:1000]
    assert len(V) == 1000
    return V


@cache
def standing(degrees: float | None) -> float:
    """Mean samples of such vertices."""
    return float(samples(star_of("sphere"), place(shell(degrees)), 1000).mean())


ARCS = {"head-on": (7.97, 2.4), "slanted": (7.66, 2.96), "grazing": (5.98, 3.24)}
RANKS = {"head-on": 0.894, "slanted": 0.858, "grazing": 0.772}
PLACES = {30.0: 5.52, 90.0: 7.47, 140.0: 19.4, None: 8.01}
OWN = "our own, pinned"

ROWS: list[Row] = [
    *(Row("RH06 3.1", f"steps of {kind} on the arc of a ball, {name}, mean", "secants take fewer",
          lambda name=name, kind=kind: on_the_arc(name)[kind], *within(value, 0.05), f"{OWN}; float64, of 300")
      for name, values in ARCS.items() for kind, value in zip(("bisection", "secants"), values, strict=True)),
    *(Row("RH06 4.3", f"rank correlation of a step's length with the way that is left, {name}", "large far, small near",
          lambda name=name: rank(name), value - 0.02, value + 0.02, f"{OWN}; float64") for name, value in RANKS.items()),
    Row("RH06 4.3", "median step from over 50 px away, over that from less than 5 px away", "large far, small near",
        steps_far_over_near, 40, 48, f"{OWN}; float64"),
    Row("RH06 4.3", "samples per vertex, kettle, mean", "5 to 10, up to 20", lambda: in_the_kettle()[0].mean(), 7.4, 8.2,
        f"{OWN}; MOST for the hundredth that never closes in"),
    Row("RH06 4.3", "samples, mean, over the number that 99 of 100 vertices need, kettle", "much faster",
        lambda: spared(0.99), 0.12, 0.16, OWN),
    Row("RH06 4.3", "samples, mean, over the number that 95 of 100 vertices need, kettle", "much faster",
        lambda: spared(0.95), 0.65, 0.78, OWN),
    Row("RH06 4.3", "spread of samples within objects, over that of all vertices, kettle", "similar within an object",
        within_things, 0.92, 0.97, f"{OWN}; 1 where objects say nothing, 0 where they say all"),
    Row("RH06 4.3", "samples until the last of 32 neighbours stops, over the mean", "roughly the same", lambda: waited_for(32),
        1.55, 1.75, OWN),
    Row("RH06 4.3", "samples until the last of any 32 vertices stops, over the mean", "more",
        lambda: waited_for(32, mixed=True), 3.1, 3.8, f"{OWN}; another draw, another order"),
    *(Row("RH06 4.2", f"samples, mean, {'around' if where is None else f'{where:.0f} degrees from the eye'}",
          "most where the scene is around", lambda where=where: standing(where), *within(value, 0.05), f"{OWN}; of 1,000")
      for where, value in PLACES.items()),
]  # fmt: skip
