"""What is at infinity: one colour, or a panorama that is looked up by direction.

`benchharness.modelling.panorama` says which direction each texel has. 4 floats per texel, of which one is free, so that
a texel is one packet; the first column is there once more at the end of each row, so that no lookup has to go around.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels import packets
from benchharness.kernels.types import SceneLike


@dataclass
class Surroundings:
    """One colour or a panorama: of `colour` and `texels`, one is None.

    colour         the same in every direction
    texels         4 floats per texel, [height, width + 1]
    height, width  texels of the panorama
    """

    colour: mi.Color3f | None
    texels: mi.Float | None = None
    height: int = 0
    width: int = 0


def of_scene(scene: SceneLike) -> Surroundings:
    """What surrounds a scene, opaque."""
    if scene.environment is None:
        colour = mi.Color3f(scene.background)
        dr.make_opaque(colour)
        return Surroundings(colour)
    values = np.asarray(scene.environment.radiance)
    height, width, _ = values.shape
    closed = np.concatenate([values, values[:, :1]], axis=1)
    return Surroundings(None, mi.Float(packets.of_rows(closed.reshape(-1, 3)).ravel()), height, width)


def radiance(surroundings: Surroundings, direction: mi.Vector3f, active: mi.Bool | bool = True) -> mi.Color3f:
    """Radiance that arrives from `direction`, of any length but 0; of a panorama 0 where not active."""
    if surroundings.texels is None:
        return mi.Color3f(surroundings.colour)
    height, width = surroundings.height, surroundings.width
    d = direction
    # From the azimuth and the angle from straight up, which acos would find badly near its ends.
    theta, phi = dr.atan2(dr.sqrt(d.x * d.x + d.y * d.y), d.z), dr.atan2(d.y, d.x)
    y, x = theta * ((height - 1) * dr.inv_pi), phi * (0.5 * width * dr.inv_pi) - 0.5
    x = dr.select(x < 0, x + width, x)
    row, column = dr.minimum(mi.UInt32(y), height - 2), dr.minimum(mi.UInt32(x), width - 1)
    fy, fx = y - mi.Float(row), x - mi.Float(column)
    first = row * (width + 1) + column
    corners = (first, first + 1, first + width + 1, first + width + 2)
    value = packets.bilinear(surroundings.texels, corners, fx, fy, active)
    return mi.Color3f(value.x, value.y, value.z)
