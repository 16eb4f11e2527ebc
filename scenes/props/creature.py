"""A sitting hare, blended from ellipsoids (`scenes.props.implicit`): the bunny of the scene `bunnies`.

It sits on z = 0 around the origin and looks towards -y; 0.36 m high with its ears, of which one is bent.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

from benchharness.scene import Mesh, merged

from ..props.implicit import Blob, blended, limb, mirrored, polygonised
from ..props.shapes import Colour, ball, placed

FUR: dict[str, Colour] = {
    "back": (0.42, 0.24, 0.12),
    "belly": (0.74, 0.62, 0.48),
    "leg": (0.47, 0.29, 0.16),
    "paw": (0.66, 0.52, 0.38),
    "tail": (0.84, 0.80, 0.74),
    "head": (0.46, 0.27, 0.14),
    "muzzle": (0.78, 0.68, 0.56),
    "nose": (0.62, 0.26, 0.22),
    "ear": (0.34, 0.18, 0.09),
    "inner ear": (0.78, 0.46, 0.38),
}
EYE, EYE_RADIUS = (0.0358, -0.0830, 0.2195), 0.0085
"""Where the right eye is, and its radius, metres."""


def blobs() -> list[Blob]:
    """What the hare is made of, in the order in which it is blended."""
    return [
        Blob((0, 0.050, 0.079), (0.064, 0.076, 0.073), k=0.010, part="back"),
        limb((0, 0.060, 0.030), (0, -0.036, 0.200), 0.049, 0.050, k=0.016, part="back"),
        Blob((0, -0.038, 0.112), (0.039, 0.034, 0.052), k=0.012, part="belly"),
        *mirrored(
            [
                Blob((0.056, 0.044, 0.060), (0.027, 0.054, 0.053), up=(0, -0.35, 1), k=0.0035, part="leg"),
                Blob((0.063, -0.006, 0.0165), (0.019, 0.052, 0.0160), k=0.005, part="paw"),
                limb((0.029, -0.046, 0.135), (0.024, -0.078, 0.008), 0.0170, 0.0180, k=0.006, part="leg"),
                Blob((0.023, -0.088, 0.0150), (0.0165, 0.024, 0.0140), k=0.005, part="paw"),
            ]
        ),
        Blob((0, 0.134, 0.062), (0.027, 0.025, 0.028), k=0.004, part="tail"),
        # The head
        Blob((0, -0.054, 0.208), (0.045, 0.054, 0.045), up=(0, -0.35, 1), k=0.006, part="head"),
        *mirrored(
            [
                Blob((0.024, -0.078, 0.192), (0.024, 0.026, 0.022), k=0.005, part="head"),
                Blob((0.0095, -0.107, 0.190), (0.0135, 0.012, 0.0125), k=0.004, part="muzzle"),
                Blob((0.031, -0.078, 0.2200), (0.0110, 0.0115, 0.0120), k=0.004, part="head"),
            ]
        ),
        Blob((0, -0.102, 0.177), (0.010, 0.010, 0.009), k=0.004, part="muzzle"),
        Blob((0, -0.1170, 0.2005), (0.0075, 0.0050, 0.0050), k=0.002, part="nose"),
        # An upright ear, and one that is bent outward
        limb((0.020, -0.042, 0.232), (0.060, 0.014, 0.362), 0.0230, 0.0125, k=0.005, part="ear"),
        limb((-0.020, -0.042, 0.232), (-0.051, -0.016, 0.336), 0.0220, 0.0125, k=0.005, part="ear"),
        limb((-0.041, -0.020, 0.326), (-0.111, -0.046, 0.290), 0.0125, 0.0205, k=0.006, part="ear"),
        limb((0.024, -0.0590, 0.242), (0.060, -0.0110, 0.340), 0.0130, 0.0085, k=0.006, cut=True, part="inner ear"),
        limb((-0.023, -0.0590, 0.244), (-0.048, -0.0395, 0.310), 0.0125, 0.0085, k=0.006, cut=True, part="inner ear"),
    ]


@lru_cache(maxsize=2)
def body(cell: float) -> Mesh:
    """The hare as one smooth closed surface, from cells `cell` metres wide."""
    return polygonised(blobs(), cell)


def hare(cell: float) -> Mesh:
    """The hare in its fur, with dark eyes: `body`, and two balls in its head."""
    b, skin = blobs(), body(cell)
    skin = replace(skin, albedo=blended(b, skin.vertices, FUR, 0.0035))
    eyes = [placed(ball(EYE_RADIUS, 20, 11, (0.04, 0.03, 0.03)), (side * EYE[0], *EYE[1:])) for side in (-1, 1)]
    return merged(skin, *eyes)
