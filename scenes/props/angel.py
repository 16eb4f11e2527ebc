"""An angel with a torch on a round plinth, blended from ellipsoids (`scenes.props.implicit`): the statue of the scene `statue`.

It stands on z = 0 around the z axis and looks towards -y; 0.36 m high with the flame.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchharness.scene import Mesh, merged

from ..props.implicit import Blob, blended, limb, mirrored, polygonised
from ..props.shapes import Colour, lathe

STONE: dict[str, Colour] = {
    "robe": (0.53, 0.45, 0.35),
    "fold": (0.57, 0.49, 0.39),
    "skin": (0.62, 0.53, 0.43),
    "hair": (0.36, 0.25, 0.15),
    "wing": (0.64, 0.57, 0.47),
    "feather": (0.56, 0.48, 0.38),
    "torch": (0.34, 0.20, 0.08),
    "flame": (0.78, 0.46, 0.10),
}
PLINTH = 0.046
"""Height of what the figure stands on, metres."""
REACH = 0.114
"""No point of the statue is further from its axis, metres."""


def blobs() -> list[Blob]:
    """What the figure is made of, in the order in which it is blended."""
    out = [
        limb((0, 0.002, 0.024), (0, 0.000, 0.200), 0.027, 0.024, k=0.006, part="robe"),
        Blob((0, 0.000, 0.066), (0.039, 0.035, 0.038), k=0.006, part="robe"),
        *_folds(),
        Blob((0, -0.001, 0.193), (0.0215, 0.0155, 0.034), k=0.006, part="robe"),
        *mirrored([Blob((0.0095, -0.0125, 0.205), (0.0095, 0.0080, 0.0095), k=0.004, part="robe")]),
        limb((-0.0345, 0.001, 0.2235), (0.0345, 0.001, 0.2235), 0.0105, 0.0110, k=0.006, part="skin"),
        limb((0, 0.002, 0.215), (0, -0.003, 0.262), 0.0078, 0.0082, k=0.004, part="skin"),
        # The head
        Blob((0, -0.005, 0.2660), (0.0135, 0.0155, 0.0185), up=(0, -0.12, 1), k=0.003, part="skin"),
        Blob((0, 0.0035, 0.2730), (0.0160, 0.0165, 0.0145), up=(0, 0.35, 1), k=0.0015, part="hair"),
        Blob((0, 0.0145, 0.2560), (0.0120, 0.0075, 0.0200), k=0.003, part="hair"),
        Blob((0, 0.0185, 0.2790), (0.0085, 0.0085, 0.0080), k=0.002, part="hair"),
        *mirrored([Blob((0.0056, -0.0200, 0.2685), (0.0034, 0.0030, 0.0022), k=0.0012, cut=True, part="skin")]),
        limb((0, -0.0190, 0.2735), (0, -0.0225, 0.2610), 0.0022, 0.0030, k=0.0015, part="skin"),
        Blob((0, -0.0185, 0.2545), (0.0042, 0.0028, 0.0016), k=0.0012, part="skin"),
        # The arm with the torch, and the one that holds the robe
        limb((0.0260, 0.000, 0.226), (0.0620, -0.012, 0.238), 0.0088, k=0.004, part="skin"),
        limb((0.0560, -0.010, 0.232), (0.0640, -0.028, 0.292), 0.0078, k=0.004, part="skin"),
        limb((0.0610, -0.029, 0.262), (0.0680, -0.033, 0.334), 0.0058, k=0.0015, part="torch"),
        Blob((0.0672, -0.0325, 0.3230), (0.0100, 0.0100, 0.0050), k=0.0015, part="torch"),
        Blob((0.0680, -0.0330, 0.3370), (0.0090, 0.0090, 0.0120), k=0.0020, part="flame"),
        Blob((0.0690, -0.0335, 0.3480), (0.0050, 0.0050, 0.0130), up=(0.15, 0, 1), k=0.0040, part="flame"),
        limb((-0.0270, 0.001, 0.230), (-0.0440, -0.006, 0.176), 0.0090, k=0.004, part="skin"),
        limb((-0.0440, -0.004, 0.186), (-0.0080, -0.034, 0.182), 0.0076, k=0.004, part="skin"),
    ]
    return out + mirrored(_wing())


def _folds() -> list[Blob]:
    """The robe's folds: ribs from the waist to the hem."""
    out = []
    for i, angle in enumerate(np.linspace(0, 2 * np.pi, 12, endpoint=False) + 0.13):
        c, s = np.cos(angle), np.sin(angle)
        hem, turn = (0.046, 0.041, 0.049)[i % 3], 0.16
        c1, s1 = np.cos(angle + turn), np.sin(angle + turn)
        foot = (hem * c1, 0.92 * hem * s1, 0.030)
        out.append(limb((0.013 * c, 0.010 * s, 0.186), foot, 0.0092, k=0.0022, part="fold"))
    return out


def _wing() -> list[Blob]:
    """The wing at x > 0: an arched arm, and feathers that hang from it, the outer ones longer."""
    arch = np.array([[0.010, 0.014, 0.205], [0.034, 0.026, 0.250], [0.058, 0.034, 0.272], [0.076, 0.040, 0.256]])
    out = [
        limb(tuple(a), tuple(b), 0.0095, 0.0070, k=0.005, part="wing")
        for a, b in (
            (arch[0], arch[1] + [0.006, 0.002, 0.008]),
            (arch[1] - [0.008, 0.003, 0.012], arch[2] + [0.006, 0.002, 0.0]),
            (arch[2] - [0.010, 0.002, 0.0], arch[3] + [0.004, 0.002, -0.012]),
        )
    ]
    tops = np.column_stack([np.interp(np.linspace(0.30, 3, 6), np.arange(4), arch[:, k]) for k in range(3)])
    share = np.linspace(0, 1, 6)
    ends = np.column_stack([0.020 + 0.074 * share, 0.024 + 0.022 * share, 0.118 + 0.026 * share**2])
    for top, end in zip(tops, ends, strict=True):
        out.append(limb(tuple(top), tuple(end), 0.0112, 0.0068, k=0.0016, part="feather"))
        tip = end + 0.20 * (top - end)
        out.append(Blob(tuple(tip), (0.0098, 0.0066, 0.0150), tuple(top - end), k=0.0030, part="feather"))
    return out


def statuette(cell: float, around: int = 48) -> Mesh:
    """The statue: figure and plinth, two closed surfaces, the figure's hem in the plinth.

    cell    width of the grid's cells that the figure is made from, metres
    around  vertices around the plinth
    """
    b = blobs()
    figure = polygonised(b, cell)
    figure = replace(figure, albedo=blended(b, figure.vertices, STONE, 0.0012))
    profile = [
        (0, 0),
        (0.066, 0),
        (0.066, 0.009),
        (0.058, 0.014),
        (0.053, 0.020),
        (0.052, 0.034),
        (0.059, 0.039),
        (0.059, PLINTH),
        (0, PLINTH),
    ]
    return merged(figure, lathe(profile, around, (0.34, 0.24, 0.19)))
