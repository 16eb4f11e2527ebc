"""What straight triangles between right vertices get wrong: F-12, F-14, F-16. The unit sphere, seen from (0, 0, 4)."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import drjit as dr
import mitsuba as mi
import numpy as np
from catalogue.catalogue_row import Elsewhere, Row, drawn_again, within
from scipy.spatial import KDTree
from support.mirror_room import shaded
from support.placed import EYE, HEIGHT, WIDTH, camera, host, mapped, place, points
from support.star_shapes import Sphere
from support.truth_shapes import Quadric

from benchharness.kernels import optics
from benchharness.kernels.vertices import secant
from benchharness.measure import truth
from benchharness.scene import Mesh
from methods.secant_triangle import SecantTriangle
from scenes.props.minimal import RED, grid, stage, thing

FINE_PX = 0.02  # secants go on until their triangle is this small
LINEAR = SecantTriangle(resolution=64, hidden="drop", depth="screen_linear", newton="off", split_px=0)


@cache
def ball():
    return mapped(Sphere(), 64)


def images(V):
    """Virtual vertices [N, 3] of vertices that are not hidden, by secants."""
    no = dr.full(mi.Bool, False, len(V))
    u = mi.Vector3f(dr.zeros(mi.Float, len(V)))
    options = secant.Options("param", "edge", "near")
    s = secant.solve(options, ball(), place(V), u, no, ~no, mi.Float(FINE_PX), mi.UInt32(60))
    assert np.array(s.converged).mean() > 0.999
    return host(optics.on_ray(points(V), s.R, points(EYE[None])))


def on_screen(P):
    return truth.on_screen(P, camera(), WIDTH, HEIGHT)


@cache
def bars() -> dict[int, float]:
    """F-14: px, Hausdorff, between the image of a bar from (-2, 1.3, 0.8) to (2, 1.3, 0.8) and that of its segments."""
    # All ends of segments are among 4097 places along it.
    curve = images(np.array([-2, 1.3, 0.8]) + np.linspace(0, 4, 4097)[:, None] * [1, 0, 0])
    seen, off = on_screen(curve), {}
    for segments in BARS:
        corner, t = curve[:: 4096 // segments], np.linspace(0, 1, 4096 // segments)[:, None]
        line = on_screen(np.concatenate([(1 - t) * a + t * b for a, b in pairwise(corner)]))
        off[segments] = float(max(KDTree(seen).query(line)[0].max(), KDTree(line).query(seen)[0].max()))
    return off


def order() -> float:
    return float(np.log2(bars()[8] / bars()[32]) / 2)


@cache
def folded() -> dict[str, int]:
    """F-12: 3000 triangles of circumradius 0.4 on the wall z = -2, their middles within 3 of the axis each way."""
    rng = np.random.default_rng(0)
    middle, angle = rng.uniform(-3, 3, (3000, 2)), rng.uniform(0, 2 * np.pi, (3000, 1)) + 2 * np.pi * np.arange(3) / 3
    V = np.stack([middle[:, :1] + 0.4 * np.cos(angle), middle[:, 1:] + 0.4 * np.sin(angle), np.full((3000, 3), -2.0)], -1)
    V = V.reshape(-1, 3)
    d = V - EYE
    t = Quadric((1.0, 1.0, 1.0)).hit(EYE, d)
    hidden = np.nan_to_num(t, nan=9) < 1
    P = EYE + t[hidden, None] * d[hidden]
    image = np.empty_like(V)
    image[~hidden] = images(V[~hidden])
    image[hidden] = host(optics.mirrored(points(V[hidden]), points(P), mi.Normal3f(points(P))))

    def areas(p):
        a, b, c = np.moveaxis(p.reshape(-1, 3, 2), 1, 0)
        (x, y), (u, v) = (b - a).T, (c - a).T
        return x * v - y * u

    kept = areas(on_screen(V)) * areas(on_screen(image)) > 0  # a mirror turns triangles round
    count = hidden.reshape(-1, 3).sum(1)
    behind = (image[:, 2] >= EYE[2]).reshape(-1, 3).any(1)
    return {"shown": int((count == 0).sum()), "shown folded": int((kept & (count == 0)).sum()),
            "hidden": int((count == 3).sum()), "hidden folded": int((kept & (count == 3)).sum()),
            "behind": int(behind.sum()), "nearest": float(4 - image[:, 2].max())}  # fmt: skip


@cache
def under(edge: float, gap: float, z: float = 0.3) -> float:
    """F-16: share of a sticker's pixels in which a floor `gap` below it wins, sorted by d_V; the sticker's middle at x = 0."""
    angle = 2 * np.pi * np.arange(3) / 3 + np.pi / 2
    corner = np.stack([np.cos(angle), np.zeros(3), -np.sin(angle)], 1) * edge / np.sqrt(3) + [0, gap - 1.3, z]
    sticker = thing("sticker", Mesh(corner, np.array([[0, 1, 2]])), RED)
    floor = thing("floor", grid((-3.0, -1.3, -1.5), (0, 0, 5.0), (6.0, 0, 0), (60, 72)))
    alone, both = (shaded(LINEAR, stage(o), 0, size=(320, 320))[0] for o in ([sticker], [floor, sticker]))
    alone, both = (a.active & (np.abs(a.L - np.asarray(RED)).max(-1) < 0.05) for a in (alone, both))
    assert alone.sum() > 50
    return float((alone & ~both).sum() / alone.sum())


BARS = {1: 70, 2: 18.6, 4: 8.0, 8: 2.6, 16: 0.69, 32: 0.18}
WHERE = "where it lies decides: the nearer to the mirror, the more d_V bends"
LAYERS = [
    (1, 0.05, 0.3, "91", 0.6, 1.0, f"{WHERE}: 0.66 at z = 0.8, 0.96 at 0"),
    (1, 0.2, 0.3, "0", 0.0, 0.0, "the gap exceeds the sagitta"), (0.5, 0.01, 0.3, "98", 0.9, 1.0, f"{WHERE}: 0.80 at z = 0.8"),
    (0.25, 0.01, 0.3, "9", 0.0, 0.2, f"{WHERE}: 0 at z = 0.3, 0.67 at 0"),
    (2, 0.2, 1.2, "53", 0.4, 0.7, f"{WHERE}: 0.42 at z = 0.8; at 0.3 a corner is hidden"),
]  # fmt: skip

ROWS: list[Row | Elsewhere] = [
    *(Row("F-14", f"px off, bar in {n} segments", str(px), lambda n=n: bars()[n], *within(px, 0.03), "two digits")
      for n, px in BARS.items()),
    Row("F-14", "order of the decay from 8 to 32 segments", "2", order, 1.85, 2.1, "straight images of curves"),
    Row("F-12", "triangles that the mirror shows all of, of 3000", "2121", lambda: folded()["shown"], *drawn_again(2121, 3000),
        "middles uniform in a square of 6; the wall's size decides"),
    Row("F-12", "of those, folded over", "169", lambda: folded()["shown folded"], *drawn_again(169, 2121), "count"),
    Row("F-12", "triangles hidden altogether, mirrored", "338", lambda: folded()["hidden"], *drawn_again(338, 3000),
        "as above"),
    Row("F-12", "of those hidden, folded over", "40", lambda: folded()["hidden folded"], *drawn_again(40, 338), "count"),
    Row("F-12", "triangles with a virtual vertex behind the eye", "1", lambda: folded()["behind"], *drawn_again(1, 3000),
        "V on the axis, at z = -2, is mirrored into the very eye: 2 (1 + 2) - 2 = 4"),
    Row("F-12", "how near to the eye's plane virtual vertices come", "-", lambda: folded()["nearest"], 0, 0.02, "the same"),
    Elsewhere("F-12", "behind the eye, dropped", "-", "-", "test_virtual.py::test_an_image_behind_the_eye_draws_nothing"),
    *(Row("F-16", f"share of pixels that the floor wins, edge {edge}, gap {gap}, z = {z}", f"{text} %",
          lambda edge=edge, gap=gap, z=z: under(edge, gap, z), low, high, why) for edge, gap, z, text, low, high,
          why in LAYERS),
]  # fmt: skip
