"""What is at infinity: one colour, or a panorama that is looked up by direction.

`benchharness.modelling.panorama` says which direction each texel has. 4 floats per texel, of which one is free, so that
a texel is one packet; the first column is there once more at the end of each row, so that no lookup has to go around.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np


@dataclass
class Surroundings:
    """One of the two is None.

    colour         the same in every direction
    texels         4 floats per texel, [height, width + 1]
    height, width  texels of the panorama
    """

    colour: mi.Color3f | None
    texels: mi.Float | None = None
    height: int = 0
    width: int = 0


def of_scene(scene) -> Surroundings:
    """Those of a `benchharness.scene.Scene`, opaque."""
    if scene.environment is None:
        colour = mi.Color3f(scene.background)
        dr.make_opaque(colour)
        return Surroundings(colour)
    values = np.asarray(scene.environment.radiance)
    height, width, _ = values.shape
    packets = np.zeros((height, width + 1, 4), np.float32)
    packets[:, :width, :3] = values
    packets[:, width] = packets[:, 0]
    return Surroundings(None, mi.Float(packets.ravel()), height, width)


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
    a, b, c, e = (dr.gather(mi.Vector4f, surroundings.texels, first + k, active) for k in (0, 1, width + 1, width + 2))
    value = dr.lerp(dr.lerp(a, b, fx), dr.lerp(c, e, fx), fy)
    return mi.Color3f(value.x, value.y, value.z)
