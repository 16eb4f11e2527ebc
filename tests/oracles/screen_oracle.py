"""What a picture can say of a mirror, float64 by brute force: where reflected rays end, and whether the eye sees that."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from oracles import ray_oracle

from benchharness.scene import Scene


@dataclass
class Known:
    """Per pixel, flat.

    mirror    it shows a mirror, and rounding changes nothing of what follows
    distance  of the reflected ray; inf where it meets nothing
    radiance  of what it meets
    place     where the eye sees that, pixels; NaN if it is behind it, or infinitely far
    seen      it is within the picture, and nothing is before it
    """

    mirror: np.ndarray
    distance: np.ndarray
    radiance: np.ndarray
    place: np.ndarray
    seen: np.ndarray


def known(made: Scene, width: int, height: int) -> Known:
    """Of a scene with one mirror."""
    camera = made.camera(0.0)
    eye = np.asarray(camera.eye, float)
    part, p, n, _, clear = ray_oracle.first_hits(made, 0.0, width, height)
    mirror = clear & (part == len(made.objects))
    v = eye - p
    v /= np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-30)
    r = 2 * (v * n).sum(axis=1, keepdims=True) * n - v
    which, distance, radiance, sharp = ray_oracle.reflected_hits(made, 0.0, p, r, 0)
    q = p + np.where(which >= 0, distance, 0)[:, None] * r

    # Seen from the eye: the nearest thing in that direction, the mirror too, is there.
    away = np.linalg.norm(q - eye, axis=1)
    origin, d = np.broadcast_to(eye, q.shape), (q - eye) / np.maximum(away, 1e-30)[:, None]
    first = ray_oracle.reflected_hits(made, 0.0, origin, d, -len(made.parts))[1]  # no part has that number: all count
    rows = camera.world_to_screen(width, height)
    h = q @ rows[:, :3].T + rows[:, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        place = np.where((h[:, 2:] > 0) & (which >= 0)[:, None], h[:, :2] / h[:, 2:], np.nan)
    inside = ((place > 0) & (place < [width, height])).all(axis=1)
    return Known(
        mirror & sharp,
        np.where(which >= 0, distance, np.inf),
        radiance,
        place,
        inside & (first > away * (1 - 1e-6)) & (which >= 0),
    )
