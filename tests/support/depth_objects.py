"""Objects that depth maps are tested on, and rays that a mirror ball sends at them."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from oracles.depth_oracle import BACKGROUND, camera, spheres

from benchharness.kernels.images import depthmap, depthray, depthrows

FIGURE = [  # body, head, two ears, two feet: parts in front of others, and gaps between
    (0.0, 0.25, 3.0, 0.55), (-0.1, -0.35, 2.85, 0.3), (-0.3, -0.72, 2.95, 0.14), (0.12, -0.72, 2.9, 0.12),
    (-0.35, 0.75, 2.7, 0.18), (0.35, 0.75, 2.75, 0.18),
]  # fmt: skip


def figure(w=256):
    """A bumpy figure of balls: (camera, zgl [w, w])."""
    cam = camera(w)
    depth = spheres(cam, FIGURE)
    y, x = np.mgrid[:w, :w] * (256 / w)
    return cam, np.where(depth < 1.5, depth + 0.01 * np.sin(x / 9) * np.cos(y / 11), BACKGROUND)


def bump(w=64):
    y, x = np.mgrid[:w, :w] / (w - 1) * 2 - 1
    r = np.hypot(x - 0.03, y + 0.05)
    return np.where(r < 0.9, 0.7 - 0.5 * np.cos(1.5 * r) + 0.02 * np.sin(7.3 * x + 3.1 * y * y), BACKGROUND)


def comb(w=128, teeth=20):
    """A comb's teeth are columns of the map, 3 texels wide and 6 apart; the first is longest."""
    depth = np.full((w, w), BACKGROUND)
    for k in range(teeth):
        depth[20:100, 4 + 6 * k : 7 + 6 * k + (k == 0)] = 0.4 + 0.01 * k
    return depth


def mirror_ball_rays(count, centre=(0.65, -0.15, 0.6), radius=0.75, eye=(-0.8, -0.4, 5.0), seed=5):
    """What a mirror ball reflects of the neighbourhood of (0, 0, 3): origins and directions [count, 3]."""
    rng = np.random.default_rng(seed)
    centre, eye = np.array(centre), np.array(eye)
    o, d = [], []
    while len(o) < count:
        n = rng.normal(size=3)
        n /= np.linalg.norm(n)
        p = centre + radius * n
        view = (p - eye) / np.linalg.norm(p - eye)
        if view @ n >= 0:
            continue
        r = view - 2 * (view @ n) * n
        to = np.array([0.0, 0.0, 3.0]) - p
        if np.linalg.norm(to - (to @ r) * r) < 1.0 and to @ r > 0:
            o.append(p)
            d.append(r)
    return np.array(o), np.array(d)


def device(array) -> mi.Float:
    return mi.Float(np.ascontiguousarray(array, dtype=np.float32).ravel())


def built(depth, n, m, split_jump=None):
    """Rows [count, n, w, m, 2] and dropped spans [count, n, w] of maps [count, w, w] (or one [w, w])."""
    depth = depth[None] if depth.ndim == 2 else depth
    layout = depthmap.Layout(len(depth), depth.shape[-1], n, m)
    rows, dropped = depthrows.build(device(depth), layout, split_jump)
    dr.eval(rows, dropped)
    return layout, rows, dropped


def as_array(layout, rows):
    return np.array(rows).reshape(layout.count, layout.n, layout.w, layout.m, 2)


def seen(cam, o, d, map=None, s_min=0.0):
    o, d = np.atleast_2d(o), np.atleast_2d(d)
    map = np.zeros(len(o), np.uint32) if map is None else np.asarray(map, np.uint32)
    cams = cam if isinstance(cam, list) else [cam]
    packets = device(np.stack([one.packet() for one in cams]))
    points, directions = mi.Point3f(o.T.astype(np.float32)), mi.Vector3f(d.T.astype(np.float32))
    return depthray.project(packets, cams[0].w, mi.UInt32(map), points, directions, s_min)


def by_rows(cam, depth, o, d, n=60, m=16, split_jump=None, **options):
    layout, rows, _ = built(depth, n, m, split_jump)
    segment = seen(cam, o, d)
    return segment, depthray.meet_rows(segment, rows, layout, **options)


def by_texels(cam, depth, o, d, **options):
    segment = seen(cam, o, d)
    return segment, depthray.meet_texels(segment, device(depth), cam.w, **options)
