"""How eyes and things move: shares of a way over time, directions, and a camera that goes around something."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchharness.scene import Camera


def gently(time: float, duration: float) -> float:
    """Share of a way, 0 to 1, that sets out and arrives gently: at `time` of `duration` seconds, and within both ends."""
    s = float(np.clip(time / duration, 0.0, 1.0))
    return s + np.sin(2 * np.pi * s) * -0.6 / (2 * np.pi)  # speed 1 - 0.6 cos: from 0.4 to 1.6 of the mean


def from_rest_to_rest(time: float, duration: float) -> float:
    """Share of a way, 0 to 1, at `time` of `duration` seconds and beyond both ends; without speed or acceleration at either."""
    s = float(np.clip(time / duration, 0.0, 1.0))
    return s * s * s * (s * (6 * s - 15) + 10)


def mixed(ends: tuple[float, float], s: float) -> float:
    """From the first to the second, linear in the share `s`."""
    return (1 - s) * ends[0] + s * ends[1]


def way_to(azimuth_deg: float, elevation_deg: float) -> np.ndarray:
    """Unit vector, float64 [3]; azimuth from x towards y, elevation towards z."""
    azimuth, elevation = np.radians(azimuth_deg), np.radians(elevation_deg)
    return np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])


@dataclass(frozen=True)
class Orbit:
    """A camera that goes around `target` for `duration` seconds and then rests.

    From and to are azimuth and elevation (degrees) and distance (metres) of the eye from there.
    """

    target: tuple[float, float, float]
    azimuth_deg: tuple[float, float]
    elevation_deg: tuple[float, float]
    distance: tuple[float, float]
    fov_deg: float
    duration: float

    def __call__(self, time: float) -> Camera:
        s = gently(time, self.duration)
        way = way_to(mixed(self.azimuth_deg, s), mixed(self.elevation_deg, s))
        eye = np.asarray(self.target) + mixed(self.distance, s) * way
        return Camera(tuple(eye.tolist()), self.target, self.fov_deg)
