"""What the scenes in the courtyard share: its checkered floor, the panorama around it, and metals.

The floor is 6 m square, around the origin, at z = 0; beyond it the checker goes on in the panorama (`surroundings.gallery`),
without a seam as seen from `CENTRE`, as high as what stands there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from benchharness.scene import Camera, Environment, Mesh, Object, merged

from ..panoramas.surroundings import Ground, gallery
from ..props.shapes import Colour
from ..props.ways import from_rest_to_rest, mixed, way_to

SIDE, SQUARE = 6.0, 0.1875
"""Of the floor, and of a square of its checker, metres."""
FINE = 6
"""Squares from the middle to each side that have four quads: where light changes, around what stands there."""
WHITE: Colour = (0.80, 0.775, 0.73)
BLACK: Colour = (0.055, 0.055, 0.06)
CENTRE = (0.0, 0.0, 0.30)
"""Where the panorama is taken, metres."""
LIGHT: Colour = (1.820, 1.807, 1.881)
"""Irradiance of the open floor over π: the radiance of a white floor under the panorama's upper half, measured: it is
painted into the lower half, and has to be measured again when the sky or the walls change."""
ROWS = 768
"""Of the panorama: one sample is 0.23 degrees, 3.4 pixels of the pictures."""
EXPOSURE = -0.85
"""Stops: the white squares in the sun come out a little below white."""

Metal = tuple[Colour, Colour] | tuple[None, None]
METALS: dict[str, Metal] = {
    "silver": ((0.155, 0.117, 0.138), (4.828, 3.122, 2.147)),
    "gold": ((0.143, 0.375, 1.442), (3.983, 2.386, 1.603)),
    "copper": ((0.201, 0.924, 1.102), (3.913, 2.453, 2.142)),
    "ideal": (None, None),
}
"""Complex index of refraction, eta and k, for red, green and blue (as used in Mitsuba's `Ag`, `Au`, `Cu`); "ideal" reflects
everything."""


def floor() -> Object:
    """The floor: a quad, with vertices of its own, for every square; four quads for those within `FINE` squares."""
    half = round(SIDE / SQUARE) // 2
    i, j = (a.ravel() for a in np.meshgrid(np.arange(-half, half), np.arange(-half, half)))
    fine = (np.maximum(abs(i + 0.5), abs(j + 0.5)) < FINE).nonzero()[0]
    pieces = []
    for chosen, n in ((np.setdiff1d(np.arange(len(i)), fine), 1), (fine, 2)):
        s, t = (a.ravel() / n for a in np.meshgrid(np.arange(n + 1), np.arange(n + 1)))
        corner = np.column_stack([i[chosen], j[chosen]])[:, None] + np.column_stack([s, t])
        quad = np.array([k * (n + 1) + m for k in range(n) for m in range(n)])[:, None]
        faces = np.concatenate([np.add(quad, [0, 1, n + 2]), np.add(quad, [0, n + 2, n + 1])])
        faces = faces + (n + 1) ** 2 * np.arange(len(chosen))[:, None, None]
        white = np.repeat((i + j)[chosen] % 2 == 0, (n + 1) ** 2)
        points = np.pad(SQUARE * corner.reshape(-1, 2), ((0, 0), (0, 1)))
        pieces.append(Mesh(points, faces.reshape(-1, 3), albedo=np.where(white[:, None], WHITE, BLACK)))
    return Object(
        "floor", merged(*pieces), "a checker whose lines each mirror bends in its own way, and which goes on beyond it"
    )


@dataclass(frozen=True)
class Orbit:
    """A camera that goes around from the first to the second of each three, and only a little further to the third.

    half, end      seconds: when it comes to rest for the first time, and for good
    """

    azimuth_deg: tuple[float, float, float]
    elevation_deg: tuple[float, float, float]
    distance: tuple[float, float, float]
    target: tuple[float, float, float]
    fov_deg: float
    half: float
    end: float

    def __call__(self, time: float) -> Camera:
        one, two = from_rest_to_rest(time, self.half), from_rest_to_rest(time - self.half, self.end - self.half)

        def at(stops: tuple[float, float, float]) -> float:
            return mixed(stops[:2], one) + two * (stops[2] - stops[1])

        way = way_to(at(self.azimuth_deg), at(self.elevation_deg))
        eye = np.asarray(self.target) + at(self.distance) * way
        return Camera(tuple(eye.tolist()), self.target, self.fov_deg)


@lru_cache(maxsize=1)
def environment() -> Environment:
    """The courtyard around the floor."""
    paint = gallery(Ground(SQUARE, (WHITE, BLACK), LIGHT), CENTRE[2], ROWS)
    return Environment.painted(paint, ROWS, CENTRE, ground="floor")
