"""Things that stand about in a kitchen, each on z = 0 around the origin, as large as the real thing (metres).

`n` is the number of vertices around a can; everything else is scaled to it. What is hidden by whatever a thing stands
on is left out; all else is closed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchharness.scene import Mesh, merged

from ..props.shapes import Colour, arc, ball, lathe, tube

STEEL: Colour = (0.55, 0.55, 0.56)
WHITE: Colour = (0.82, 0.80, 0.76)


def can(n: int, label: Colour, band: Colour, radius: float = 0.042, height: float = 0.115) -> Mesh:
    """A tin can: steel rim and top, a coloured label with one band."""
    r, h = radius, height
    profile = [(r, 0), (r, 0.40 * h), (r, 0.68 * h), (r, h - 0.008), (r, h), (r - 0.004, h - 0.004), (0, h - 0.004)]
    return lathe(profile, n, [label, band, label, STEEL, STEEL, STEEL], sharp_deg=60)


def orange(n: int, radius: float = 0.040) -> Mesh:
    """An orange about the origin (not on z = 0), so that it can roll; a green spot shows how far it did."""
    mesh = ball(radius, n, max(6, n // 2 + 1), (0.85, 0.36, 0.04))
    spot = mesh.vertices[:, 2] > 0.93 * radius
    return replace(mesh, albedo=np.where(spot[:, None], (0.12, 0.24, 0.05), mesh.albedo))


def apple(n: int, ripe: Colour = (0.60, 0.06, 0.05), radius: float = 0.042) -> Mesh:
    """An apple, red with a paler side, with its dimple and stalk."""
    a = np.linspace(-0.42 * np.pi, 0.5 * np.pi, max(7, n // 2 + 1))
    r = radius * np.cos(a) * (1 + 0.12 * np.sin(a))
    z = radius * (0.9 * np.sin(a) - 0.32 * (a > 0) * np.exp(-((r / (0.32 * radius)) ** 2)))
    z -= z.min()
    r[-1] = 0.0
    body = lathe(np.stack([r, z], axis=1), n, ripe, sharp_deg=180)
    pale = np.clip(0.5 + 0.6 * body.vertices[:, :1] / radius + 0.4 * np.sin(40 * body.vertices[:, 2:]), 0, 1)
    body = replace(body, albedo=(1 - 0.7 * pale) * np.array(ripe) + 0.7 * pale * np.array([0.62, 0.50, 0.12]))
    stalk = tube([(0, 0, z[-1] - 0.002), (0.001, 0, z[-1] + 0.01), (0.005, 0, z[-1] + 0.02)], 0.0018, 5, (0.16, 0.09, 0.04))
    return merged(body, stalk)


def banana(n: int) -> Mesh:
    """A banana that lies on its side."""
    count = max(7, n // 2 + 1)
    s = np.linspace(-1, 1, count)
    path = arc((0, -0.09, 0.017), (0.12, 0, 0), (0, 0.12, 0), 145, 35, count)
    body = tube(path, 0.017 * np.clip(1.15 * (1 - s**6) ** 0.5, 0.28, 1), max(6, n // 2), (0.82, 0.62, 0.08))
    tip = np.minimum(*(np.linalg.norm(body.vertices - end, axis=1) for end in path[[0, -1]])) < 0.014
    return replace(body, albedo=np.where(tip[:, None], (0.12, 0.08, 0.04), body.albedo))


def mug(n: int, colour: Colour, radius: float = 0.042, height: float = 0.095) -> Mesh:
    """A mug with a handle towards +x, coloured outside and white inside."""
    r, h, wall = radius, height, 0.005
    profile = [(0.93 * r, 0), (r, 0.012), (r, h), (r - wall, h), (r - wall, 0.012), (0, 0.012)]
    cup = lathe(profile, n, [colour, colour, colour, WHITE, WHITE])
    grip = tube(
        arc((r - 0.004, 0, 0.5 * h), (0.034, 0, 0), (0, 0, 0.3 * h), -88, 88, max(6, n // 2)), 0.006, max(5, n // 3), colour
    )
    return merged(cup, grip)


def kettle(n: int, colour: Colour) -> Mesh:
    """An enamel kettle with a spout towards +x and a bow handle."""
    body = [(0.104, 0), (0.110, 0.02), (0.106, 0.06), (0.088, 0.103), (0.050, 0.135)]
    lid = [(0.050, 0.139), (0.012, 0.153), (0.009, 0.160), (0.017, 0.171), (0, 0.182)]
    black = (0.05, 0.045, 0.04)
    pot = lathe([*body, *lid], n + n // 4, [colour, colour, colour, colour, WHITE, colour, black, black, black], 60)
    bend = [(0.085, 0, 0.05), (0.125, 0, 0.075), (0.145, 0, 0.115), (0.165, 0, 0.14)]
    spout = tube(bend, [0.024, 0.018, 0.013, 0.011], max(6, n // 2), colour)
    handle = tube(
        arc((0, 0, 0.10), (0.088, 0, 0), (0, 0, 0.145), 8, 172, max(8, 2 * n // 3)),
        0.008,
        max(6, n // 2),
        (0.07, 0.045, 0.03),
    )
    return merged(pot, spout, handle)


def plate(n: int, rim: Colour, radius: float = 0.125) -> Mesh:
    """A dinner plate with a coloured rim."""
    r = radius
    profile = [(0.55 * r, 0), (r, 0.018), (0.88 * r, 0.015), (0.62 * r, 0.008), (0, 0.007)]
    return lathe(profile, n + n // 3, [WHITE, rim, WHITE, WHITE])


def bottle(n: int, glass: Colour = (0.06, 0.16, 0.06)) -> Mesh:
    """A bottle with a paper label and a cork."""
    profile = [
        (0.037, 0),
        (0.037, 0.04),
        (0.037, 0.13),
        (0.036, 0.18),
        (0.015, 0.23),
        (0.013, 0.29),
        (0.010, 0.305),
        (0, 0.305),
    ]
    cork = (0.55, 0.38, 0.22)
    return lathe(profile, n, [glass, (0.78, 0.70, 0.52), glass, glass, glass, cork, cork], sharp_deg=60)


def jar(n: int, filling: Colour, lid: Colour, radius: float = 0.05, height: float = 0.14) -> Mesh:
    """A storage jar with something in it and a lid."""
    r, h = radius, height
    profile = [(r, 0), (r, 0.78 * h), (1.06 * r, h), (0, h)]
    return lathe(profile, n, [filling, lid, lid])


def pot(n: int, colour: Colour) -> Mesh:
    """A cooking pot with lid, knob and two handles."""
    black = (0.05, 0.05, 0.05)
    profile = [(0.11, 0), (0.11, 0.12), (0.114, 0.127), (0.02, 0.145), (0.022, 0.165), (0, 0.17)]
    body = lathe(profile, n + n // 4, [colour, STEEL, colour, black, black])
    ears = [tube(arc((0, s * 0.108, 0.095), (0.035, 0, 0), (0, s * 0.035, 0), 0, 180, 5), 0.006, 4, black) for s in (-1, 1)]
    return merged(body, *ears)
