"""What the mirrors of a scene show in its first frame, traced; and the picture of it, with their outlines."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import ndimage

from benchharness.measure import metrics
from benchharness.measure.bench import DARK
from benchharness.render import reference
from benchharness.render.ready import ready
from benchharness.scene import Scene

MUCH = 0.1  # share of a mirror that is black, shows backs or nothing, from which on that is worth a word
OUTLINE = (255, 0, 200)


@dataclass(frozen=True)
class Mirror:
    """Shares of a mirror's `pixels` in which it is `black`, shows `backs`, `nothing` (no surface, and black surroundings), or
    a `second` mirror."""

    name: str
    pixels: int
    black: float
    backs: float
    nothing: float
    second: float


@dataclass(frozen=True, eq=False)
class FirstFrame:
    """image: uint8 [H, W, 3], as displayed; number: int [H, W], whose mirror a pixel is, -1 for none's."""

    image: np.ndarray
    number: np.ndarray
    mirrors: list[Mirror]


def first_frame(scene: Scene, size: tuple[int, int], bake_spp: int) -> FirstFrame:
    """Lights and traces a scene as its author gave it. Raises ValueError for mirrors that cannot be wound."""
    drawn = ready(scene, bake_spp)
    options = reference.ReferenceOptions(spp=2, bake_spp=bake_spp)
    seen = reference.render(drawn, drawn.time(0), size, options)
    dark = seen.image.max(axis=2) * 2.0**scene.exposure < DARK
    lit = scene.environment is not None or np.any(scene.background)
    nothing = np.isinf(seen.distance) & (not lit)
    mirrors = []
    for number, part in enumerate(scene.reflectors):
        own = seen.reflector == number
        if own.any():
            shares = (float(which[own].mean()) for which in (dark, seen.back, nothing, seen.second))
            mirrors.append(Mirror(part.name, int(own.sum()), *shares))
    return FirstFrame(metrics.tonemap(seen.image, scene.exposure), seen.reflector, mirrors)


def save(path: Path, seen: FirstFrame) -> None:
    """The picture as PNG, mirrors outlined."""
    edge = seen.number != ndimage.grey_erosion(seen.number, size=(3, 3))
    edge |= seen.number != ndimage.grey_dilation(seen.number, size=(3, 3))
    edge &= seen.number >= 0
    metrics.save_png(path, np.where(edge[..., None], np.array(OUTLINE, np.uint8), seen.image))
