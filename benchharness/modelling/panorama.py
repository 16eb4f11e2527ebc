"""The surroundings at infinity as a picture: a panorama by direction.

An [H, W, 3] panorama has its samples at these directions, z up:

    row i      at θ = π i / (H - 1) from straight up: the first row is all straight up, the last all straight down
    column j   at azimuth φ = 2 π (j + 1/2) / W, from +x towards +y about +z

In between it is bilinear in θ and φ, and goes around in azimuth. This is Mitsuba's `envmap` emitter to rounding (3.9.1), except
in the one direction (0, 0, -1), where Mitsuba shows the first row. Seen from inside, azimuth grows to the left: the
picture of a photographer's panorama has its columns the other way around (`as_seen`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


def read_only(array: np.ndarray) -> np.ndarray:
    """The same numbers, which nobody writes to through what is returned."""
    view = array.view()
    view.flags.writeable = False
    return view


@dataclass(frozen=True, eq=False)
class Environment:
    """A distant environment: radiance by direction, whatever the point it is looked at from.

    radiance  float64 [H, W, 3] linear RGB, a panorama with z up, rows downwards, columns from +x towards +y about +z
              (`benchharness.modelling.panorama` says where exactly; `Environment.painted` asks by direction)
    centre    [3] metres: where the panorama was taken; what stands near looks right in it only from there
    ground    name of the object that continues in the panorama without a seam, as seen from `centre`; None for none

    Raises ValueError for fewer than 2 rows or columns, and for what is not finite, or negative.
    """

    radiance: np.ndarray
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ground: str | None = None

    def __post_init__(self) -> None:
        radiance = np.ascontiguousarray(self.radiance, np.float64)
        if radiance.ndim != 3 or radiance.shape[2] != 3 or min(radiance.shape[:2]) < 2:
            raise ValueError(f"environment: radiance has shape {radiance.shape}; accepted: [H, W, 3], H and W at least 2")
        wrong = ~(np.isfinite(radiance) & (radiance >= 0)).all(axis=2)
        if wrong.any():
            i, j = np.argwhere(wrong)[0]
            raise ValueError(
                f"environment: radiance in row {i}, column {j} is {radiance[i, j]}; accepted: finite numbers from 0"
            )
        centre = np.asarray(self.centre, np.float64)
        if centre.shape != (3,) or not np.isfinite(centre).all():
            raise ValueError(f"environment: centre is {self.centre}; accepted: three finite numbers")
        object.__setattr__(self, "radiance", read_only(radiance))
        object.__setattr__(self, "centre", tuple(centre.tolist()))

    @classmethod
    def painted(
        cls,
        paint: Callable[[np.ndarray], np.ndarray],
        height: int = 512,
        centre: tuple[float, float, float] = (0.0, 0.0, 0.0),
        ground: str | None = None,
    ) -> Environment:
        """An environment of `height` rows and twice as many columns out of `paint`, which takes unit directions, float64
        [N, 3], to radiance [N, 3]."""
        if height < 2:
            raise ValueError(f"environment: height is {height}; accepted: whole numbers from 2")
        directions = sample_directions(height, 2 * height)
        radiance = np.asarray(paint(directions.reshape(-1, 3)), np.float64)
        if radiance.shape != (directions.size // 3, 3):
            raise ValueError(
                f"environment: paint returned shape {radiance.shape}; accepted: [{directions.size // 3}, 3], as its directions"
            )
        return cls(radiance.reshape(directions.shape), centre, ground)

    @classmethod
    def from_picture(cls, picture: np.ndarray, centre=(0.0, 0.0, 0.0), ground: str | None = None) -> Environment:
        """Out of a panorama as it is photographed, [H, W, 3], +x at its left and right ends; the inverse of `as_seen`."""
        return cls(np.asarray(picture)[:, ::-1], centre, ground)

    def lookup(self, directions: np.ndarray) -> np.ndarray:
        """Radiance that arrives from `directions` [..., 3], float64; of any length but 0."""
        d = np.asarray(directions, np.float64)
        height, width, _ = self.radiance.shape
        y = np.arctan2(np.hypot(d[..., 0], d[..., 1]), d[..., 2]) * ((height - 1) / np.pi)
        x = np.arctan2(d[..., 1], d[..., 0]) * (0.5 * width / np.pi) - 0.5
        i, j = np.minimum(y.astype(int), height - 2), np.floor(x).astype(int)
        fy, fx = (y - i)[..., None], (x - j)[..., None]
        left, right = j % width, (j + 1) % width
        upper = (1 - fx) * self.radiance[i, left] + fx * self.radiance[i, right]
        lower = (1 - fx) * self.radiance[i + 1, left] + fx * self.radiance[i + 1, right]
        return (1 - fy) * upper + fy * lower

    def as_seen(self) -> np.ndarray:
        """The panorama as a picture from inside, +x at its left and right ends: `radiance` with its columns reversed."""
        return np.ascontiguousarray(self.radiance[:, ::-1])


def sample_directions(height: int, width: int) -> np.ndarray:
    """The unit directions of a panorama's samples, float64 [height, width, 3]."""
    theta = np.pi * np.arange(height)[:, None] / (height - 1)
    phi = 2 * np.pi * (np.arange(width) + 0.5) / width
    return np.stack(np.broadcast_arrays(np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)), axis=-1)
