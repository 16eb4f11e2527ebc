"""Pictures that colour surfaces, and where in them a point is.

u runs to the right and v up: (0, 0) is the lower left corner of a picture, (1, 1) its upper right one. Of H rows and W columns,
rows from the top as in a picture file, the pixel in row i and column j has its centre at

    u = (j + 1/2) / W,    v = 1 - (i + 1/2) / H

Between four centres the picture is bilinear. Nothing else is filtered, by no method and not by the reference: there are no mip
levels, and no anisotropy. What is seen smaller than the picture's pixels is seen as a point's ray finds it; a reference of
several samples per pixel averages over them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from typing import Literal, get_args

import numpy as np

from benchharness.modelling.panorama import read_only

Wrap = Literal["repeat", "mirror", "clamp"]


@dataclass(frozen=True, eq=False)
class Texture:
    """A picture on a surface (`benchharness.modelling.texture` says what is where).

    pixels  float32 [H, W, 3] in [0, 1], linear RGB, rows from the top
    wrap    how it goes on beyond its edges, along u and along v, one name for both: "repeat" begins again, "mirror" runs
            back, "clamp" stays as it is at the edge

    Raises ValueError for other shapes, numbers and names.
    """

    pixels: np.ndarray
    wrap: tuple[Wrap, Wrap] | Wrap = "repeat"

    def __post_init__(self) -> None:
        pixels = np.ascontiguousarray(self.pixels, np.float32)
        if pixels.ndim != 3 or pixels.shape[2] != 3 or min(pixels.shape[:2]) < 1:
            raise ValueError(f"texture: pixels have shape {pixels.shape}; accepted: [H, W, 3], H and W at least 1")
        wrong = ~((pixels >= 0) & (pixels <= 1)).all(axis=2)
        if wrong.any():
            i, j = np.argwhere(wrong)[0]
            raise ValueError(f"texture: the pixel in row {i}, column {j} is {pixels[i, j]}; accepted: numbers from 0 to 1")
        wrap = (self.wrap, self.wrap) if isinstance(self.wrap, str) else tuple(self.wrap)
        if len(wrap) != 2 or not set(wrap) <= set(get_args(Wrap)):
            raise ValueError(f"texture: wrap is {self.wrap!r}; accepted: {', '.join(get_args(Wrap))}, or two of them")
        object.__setattr__(self, "pixels", read_only(pixels))
        object.__setattr__(self, "wrap", wrap)

    @property
    def along(self) -> tuple[Wrap, Wrap]:
        """`wrap` along u and along v."""
        assert isinstance(self.wrap, tuple)
        return self.wrap

    @cached_property
    def digest(self) -> str:
        """Of the pixels, for content hashes."""
        return sha256(repr(self.pixels.shape).encode() + self.pixels.tobytes()).hexdigest()


def among_pixels(uv: np.ndarray, height: int, width: int) -> np.ndarray:
    """Where points uv [..., 2] are among the centres of a picture's pixels, column and row, float64 [..., 2]."""
    return np.stack([uv[..., 0] * width - 0.5, (1.0 - uv[..., 1]) * height - 0.5], axis=-1)


def wrapped(number: np.ndarray, count: int, way: Wrap) -> np.ndarray:
    """Which of `count` columns or rows stands at a place, int, of a row that goes on on both sides."""
    if way == "clamp":
        return np.clip(number, 0, count - 1)
    if way == "repeat":
        return number % count
    there = number % (2 * count)
    return np.minimum(there, 2 * count - 1 - there)
