"""What pictures in a scene's place can show: taken by another camera, of the mirror itself, or of what is reflected (Popescu et
al. 2006, sections 2, 3 and 6)."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from catalogue.catalogue_row import Row, within
from support.mirror_room import RADIUS, Answer, lit, mirror_ball, scene, shaded, smooth
from support.small_room import box, quad
from support.truth_shapes import alhazen, unit

from benchharness.kernels.images import impostor, roles
from benchharness.measure import metrics
from benchharness.scene import Object
from methods.billboard_impostor import BillboardImpostor
from methods.ray_traced import RayTraced
from scenes.props.minimal import SKY

MAGENTA = (1.0, 0.0, 1.0)  # of nothing in these rooms, whose colours have at least a quarter of green


# 3: by which camera billboards are taken.


def cube(side: float = 0.6):
    """A cube of fine colours beside a mirror ball, two of its own half diagonals from the ball's middle."""
    low = np.array([0.45, -0.95, -0.3])
    thing = Object("cube", lit(box(low, low + side), 0.05, 0.15), "something deep")
    return scene((thing,), (mirror_ball(),), background=SKY)


@cache
def billboard(degrees: float) -> Answer:
    """The cube's billboard, taken by a camera whose field is so wide."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(impostor, "FIELD", np.radians(degrees))
        return shaded(BillboardImpostor(), cube(), 0)[0]


@cache
def traced() -> Answer:
    return shaded(RayTraced(), cube(), 0)[0]


def flip(one: Answer, other: Answer) -> float:
    """FLIP in the mirror."""
    assert (one.active == other.active).all()
    return float(metrics.flip_map(one.L, other.L, one.active, ppd=67.0, exposure=0.0)[one.active].mean())


# 3: what stands in the environment map as well.


def ring() -> tuple[Object, ...]:
    """Walls around a mirror ball, with a floor and a ceiling that are objects of their own."""
    whole = box((-2, -2, -2), (2, 2, 2), inside=True)
    upright = np.abs(whole.normals[whole.faces[:, 0], 2]) < 0.5
    walls = Object("walls", lit(replace(whole, faces=whole.faces[upright]), 0.4), "something on every side")
    floor = Object("floor", lit(quad((-2, -2, -2), (4, 0, 0), (0, 4, 0)), 0.4), "what is below")
    ceiling = Object("ceiling", lit(quad((-2, -2, 2), (0, 4, 0), (4, 0, 0)), 0.4), "what is above")
    return walls, floor, ceiling


@cache
def gaps(both: bool) -> float:
    """Share of the mirror's pixels that show what is behind everything: floor and ceiling are billboards, and in the map of the
    walls too or not."""
    made, plan = scene(ring(), (mirror_ball(),), background=MAGENTA), roles.plan

    def planned(*given, **more):
        made = plan(*given, **more)
        assert made.bounds and made.plane_slots == 2
        return made if both else replace(made, bounds=set())

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(roles, "plan", planned)
        (answer,) = shaded(BillboardImpostor(), made, 0)
    return float((answer.L[answer.active][:, 1] < 0.2).mean())


# 6: a mirror's own billboard. A ring, which shows itself: float64.

MAJOR, MINOR = 1.0, 0.35
AROUND = MAJOR + MINOR


def outside(p):
    """Distance of points from the ring about the z axis, negative inside."""
    return np.hypot(np.linalg.norm(p[..., :2], axis=-1) - MAJOR, p[..., 2]) - MINOR


def outward(p):
    circle = p * [1, 1, 0]
    return unit(p - MAJOR * unit(circle))


def met(o, d, start: float, far: float):
    """Distance along rays [N, 3] to the ring, NaN for a miss."""
    t, hit = np.full(len(o), start), np.zeros(len(o), bool)
    for _ in range(400):
        gap = outside(o + t[:, None] * d)
        hit = gap < 1e-6
        t = np.where(hit | (t > far), t, t + np.maximum(gap, 1e-6))
    return np.where(hit & (t <= far), t, np.nan)


@cache
def own_billboard(elevation: float) -> dict[str, float]:
    """Of the rays that meet the ring again, by tracing, as an eye sees them so many degrees above its plane:
    what crosses the plane of the ring's own billboard, which faces the eye, and what does so where that is opaque."""
    angle = np.radians(elevation)
    eye = 5 * np.array([np.cos(angle), 0, np.sin(angle)])
    x, y = (c.ravel() for c in np.meshgrid(*2 * [np.linspace(-0.32, 0.32, 120)]))
    right = np.array([0.0, 1.0, 0.0])
    up = np.cross(unit(eye), right)
    d = unit(-unit(eye) + x[:, None] * right + y[:, None] * up)
    o = np.broadcast_to(eye, d.shape)
    t = met(o, d, 2.0, 9.0)
    seen = np.isfinite(t)
    P = (o + t[:, None] * d)[seen]
    n = outward(P)
    r = d[seen] - 2 * (d[seen] * n).sum(axis=1, keepdims=True) * n
    again = np.isfinite(met(P + 1e-3 * n, r, 0.0, 4.0))

    k = unit(eye)
    along = r @ k
    cross = -(P @ k) / np.where(np.abs(along) < 1e-12, 1e-12, along)
    crosses = cross > 1e-3
    Q = P + np.where(crosses, cross, 0)[:, None] * r
    camera = AROUND / np.sin(0.5 * impostor.FIELD) * k
    ray = unit(Q - camera)
    opaque = (
        crosses & (np.linalg.norm(Q, axis=1) < AROUND) & np.isfinite(met(np.broadcast_to(camera, ray.shape), ray, 8.0, 30.0))
    )
    return {"crosses": crosses[again].mean(), "shown": opaque[again].mean()}


# 2: pictures of a reflection, shown to another eye. A mirror ball in a room of smooth colours: float64.

TAKEN = np.array([0.2, -1.7, 0.25])  # the eye that the picture is of
HALF = 2.0


def room(p, d, thing=None):
    """Radiance that arrives at p [N, 3] from direction d: of the walls, or of a grey ball of radius 0.3 at `thing`."""
    t = ((np.where(d > 0, HALF, -HALF) - p) / np.where(d == 0, 1e-12, d)).min(axis=1)
    L = smooth(p + t[:, None] * d, HALF / 2)
    if thing is not None:
        to = np.asarray(thing) - p
        along = (to * d).sum(axis=1)
        hit = (along > 0) & ((to**2).sum(axis=1) - along**2 < 0.3**2)
        L = np.where(hit[:, None], 0.1, L)
    return L


def mirrored_towards(eye, P):
    n, w = unit(P), unit(eye - P)
    return 2 * (n * w).sum(axis=1, keepdims=True) * n - w


@cache
def points_seen() -> np.ndarray:
    u = unit(np.random.default_rng(0).normal(size=(40000, 3)))
    return RADIUS * u


def reused(away: float, how: str, was=None, now=None) -> float:
    """Root mean square of radiance in the mirror, for an eye that has gone `away` metres sideways from where a picture of the
    reflection was taken. how: "surface", looked up by the mirror's point; "direction", by the reflected ray's; or "centre", an
    environment map of the mirror's middle. was, now: where a thing stood and stands."""
    eye = TAKEN + away * unit(np.cross(TAKEN, [0.0, 0.0, 1.0]))
    P = points_seen()
    P = P[((eye - P) * P).sum(axis=1) > 0]
    r = mirrored_towards(eye, P)
    true = room(P, r, now)
    if how == "centre":
        shown = room(np.zeros_like(P), r, was)
    elif how == "surface":
        kept = ((TAKEN - P) * P).sum(axis=1) > 0
        true, shown = true[kept], room(P[kept], mirrored_towards(TAKEN, P[kept]), was)
    else:
        n = alhazen(TAKEN / RADIUS, 1e9 * r)  # the point that sends the picture's eye this direction
        kept = (r * n).sum(axis=1) > 0
        true, shown = true[kept], room(RADIUS * n[kept], r[kept], was)
    return float(np.sqrt(((shown - true) ** 2).mean()))


FIELDS = {1.0: 0.0587, 10.0: 0.0574, 40.0: 0.0551, 90.0: 0.0654}
SELF = {30: (0.741, 0.561), 60: (0.939, 0.164), 80: (0.784, 0.105)}
REUSED = {("direction", 0.0): 0.0, ("direction", 0.1): 0.0045, ("direction", 1.0): 0.0447, ("direction", 4.0): 0.074,
          ("surface", 0.1): 0.0238, ("surface", 1.0): 0.166, ("centre", 0.0): 0.0644, ("centre", 4.0): 0.0592}  # fmt: skip
STOOD, STANDS = (1.2, -0.9, 0.2), (0.9, -1.2, 0.2)
OWN = "our own, pinned"

ROWS: list[Row] = [
    Row("PMDS06 3", "FLIP of billboards taken by a camera of 10 degrees, against 1 degree", "not noticeable",
        lambda: flip(billboard(10.0), billboard(1.0)), 0.0055, 0.0095, OWN),
    *(Row("PMDS06 3", f"FLIP of billboards taken by a camera of {degrees:.0f} degrees, against rays", "-",
          lambda degrees=degrees: flip(billboard(degrees), traced()), *within(value, 0.02), OWN)
      for degrees, value in FIELDS.items()),
    Row("PMDS06 3", "share of pixels with gaps, floor and ceiling in the map too", "-", lambda: gaps(True), 0, 0, OWN),
    Row("PMDS06 3", "share of pixels with gaps, floor and ceiling as billboards alone", "-", lambda: gaps(False), 0.018, 0.028,
        OWN),
    *(Row("PMDS06 6", f"of a ring's rays that meet it, {degrees} degrees above: {what}", "none",
          lambda degrees=degrees, key=key: own_billboard(degrees)[key], value - 0.02, value + 0.02, f"{OWN}; float64")
      for degrees, values in SELF.items()
      for key, what, value in zip(("crosses", "shown"), ("they cross its billboard's plane", "where that is opaque"), values,
                                  strict=True)),
    *(Row("PMDS06 2", f"rms of a picture's radiance, {how}, {away} m away", "good near, worse far",
          lambda how=how, away=away: reused(away, how), value * 0.95, value * 1.05 + 1e-9, f"{OWN}; float64")
      for (how, away), value in REUSED.items()),
    Row("PMDS06 2", "rms of a picture's radiance, direction, at its own place, a ball in the room moved by 0.42 m", "obsolete",
        lambda: reused(0.0, "direction", STOOD, STANDS), 0.054, 0.06, f"{OWN}; float64"),
]  # fmt: skip
