"""The edges of what depth maps show, against the number of rotations that their rows were simplified in.

The nearest row is turned from a ray's image by up to half the angular increment, so that rays next to a silhouette hit or
miss by mistake: figure 14 of Popescu et al. 2006 shows it, and gives no number. Here a silhouette is compared with that of
the same rays walking over every texel of the same maps, and the picture beside it with the reference.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy import ndimage

from benchharness.kernels import pixels
from benchharness.kernels.differentials import RayDifferential
from benchharness.kernels.images import relief
from benchharness.kernels.images.candidates import Ray
from benchharness.measure import host, metrics
from benchharness.render import reference
from benchharness.speed import popescu
from benchharness.speed.depthmaps import rays
from benchharness.speed.popescu import Settings, row
from benchharness.speed.stage import Stage
from benchharness.study import plugins

EDGES = "edges"
METHOD = "depth_impostor"
BAND_PX = 3.0
DEPTH = 16  # segments of the reference's paths
CROP = 0.11  # of the picture's width, as the sides of what the strip shows


@dataclass
class Panel:
    """What the strip shows: sRGB uint8 [h, w, 3] and its title."""

    title: str
    pixels: np.ndarray


def study(stage: Stage, settings: Settings, say: Callable[[str], None]) -> tuple[list[dict[str, Any]], list[Panel]]:
    """Rows of impostors.csv, and the strip from coarse to fine, then every texel, then the reference."""
    scene, m = stage.scene, settings.rate[1]
    truth = reference.render(scene, stage.frame.time, stage.size, reference.ReferenceOptions(max_depth=DEPTH))
    mirror = host.plane(stage.frame.active, stage.frame)
    exact = _hits(stage, popescu.reliefs(stage, settings.texels, 1, 0))
    outline = silhouette(exact, mirror)
    band = mirror & truth.mask & ~truth.second & (_distance_px(outline) <= BAND_PX)
    rows, pictures, wrong = [], [], np.zeros(mirror.shape)
    for n in (*settings.rotations, None):
        say(f"{EDGES}: {'every texel' if n is None else f'{n} rotations'}")
        setting = "every texel" if n is None else f"{180 / n:g} degrees (n = {n})"
        hits = exact if n is None else _hits(stage, popescu.reliefs(stage, settings.texels, n, m))
        image = _image(stage, settings, n)
        pictures.append((setting, image))
        wrong = np.maximum(wrong, (hits != exact) & mirror)
        rows += _rows(setting, hits, exact, mirror) if n is not None else []
        if band.any():
            flip = metrics.flip_map(image, truth.image, mirror & truth.mask, ppd=scene.ppd, exposure=scene.exposure)
            note = f"within {BAND_PX:g} px of the silhouette, without second reflections; {int(band.sum())} pixels"
            rows.append(row(EDGES, setting, "FLIP to the reference", float(flip[band].mean()), "", note=note))
    window = _window(wrong if wrong.any() else outline.astype(float), stage.size)
    pictures.append(("reference", truth.image))
    return rows, [Panel(title, metrics.tonemap(image[window], scene.exposure)) for title, image in pictures]


def _rows(setting: str, hits: np.ndarray, exact: np.ndarray, mirror: np.ndarray) -> list[dict[str, Any]]:
    shown = int((exact & mirror).sum())
    if shown == 0:
        return []
    differ = (hits != exact) & mirror
    note = f"{int(differ.sum())} pixels; {shown} show the objects"
    rows = [row(EDGES, setting, "pixels that hit or miss by mistake", 1e2 * differ.sum() / shown, "%", note=note)]
    off = apart(silhouette(hits, mirror), silhouette(exact, mirror))
    if off is not None:
        rows.append(row(EDGES, setting, "silhouettes apart", off, "px", note="from that of every texel, mean of both ways"))
    return rows


def _hits(stage: Stage, shown: relief.Reliefs) -> np.ndarray:
    """Pixels that show an object by a depth map, whatever else there is in the scene; bool [H, W]."""
    frame = stage.frame
    if dr.width(frame.pixels) == 0:
        return np.zeros(stage.size[::-1], bool)
    o, d = rays(frame, frame.pixels)
    mirror = mi.UInt32(dr.gather(mi.Int32, frame.reflector, frame.pixels))
    ray = Ray(mirror, o, d, RayDifferential([], []))
    met = relief.nearest(shown, shown.candidates.objects, ray, mi.Float(dr.inf), relief.Walk())
    (hits,) = pixels.spread([mi.Float(dr.select(met.t < dr.inf, 1, 0))], frame.pixels, frame.view)
    return host.plane(hits, frame) > 0


def _image(stage: Stage, settings: Settings, n: int | None) -> np.ndarray:
    """Radiance float32 [H, W, 3]; n None: every texel."""
    how = {"intersector": "march"} if n is None else {"rotations": n, "points": settings.rate[1]}
    kind = plugins.find("method", METHOD, "speed").target(resolution=settings.texels, **how)
    reflection, _ = kind.shade(stage.warmed(kind), stage.frame)
    return host.image(stage.renderer.compose(stage.frame, reflection.L), stage.frame)


def silhouette(hits: np.ndarray, mirror: np.ndarray) -> np.ndarray:
    """Pixels that hit beside one (of four) of the mirror that does not; bool [H, W]."""
    misses = np.pad(mirror & ~hits, 1)
    beside = misses[2:, 1:-1] | misses[:-2, 1:-1] | misses[1:-1, 2:] | misses[1:-1, :-2]
    return hits & mirror & beside


def apart(one: np.ndarray, other: np.ndarray) -> float | None:
    """Mean distance in pixels from one outline to the nearest point of the other, and back; None if either is empty."""
    if not one.any() or not other.any():
        return None
    return float(0.5 * (_distance_px(other)[one].mean() + _distance_px(one)[other].mean()))


def _distance_px(outline: np.ndarray) -> np.ndarray:
    """From every pixel to the nearest of the outline, inf for none; float [H, W]."""
    if not outline.any():
        return np.full(outline.shape, np.inf)
    return np.asarray(ndimage.distance_transform_edt(~outline), float)


def _window(weight: np.ndarray, size: tuple[int, int]) -> tuple[slice, slice]:
    """The square with the most weight in it."""
    side = min(max(int(CROP * size[0]), 8), *size)
    sums = np.pad(weight, ((1, 0), (1, 0))).cumsum(0).cumsum(1)
    inside = sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side]
    top, left = np.unravel_index(int(inside.argmax()), inside.shape)
    return slice(int(top), int(top) + side), slice(int(left), int(left) + side)


def strip(panels: Sequence[Panel], path: Path) -> None:
    """All panels side by side, as PNG."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3 * len(panels), 3.3), dpi=130, layout="constrained")
    for axes, panel in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        axes.imshow(panel.pixels, interpolation="nearest")
        axes.set(xticks=[], yticks=[])
        axes.set_title(panel.title, fontsize=11)
    figure.savefig(path)
