"""Pictures of surfaces: files into linear RGB, the first row on top."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

from benchharness.assets import files
from benchharness.assets.asset import Findings


def decoded(source: Path | bytes) -> np.ndarray:
    """The picture of a file or of its bytes, float32 [H, W, 3], linear, transparency dropped. Raises whatever Pillow does."""
    with Image.open(io.BytesIO(source) if isinstance(source, bytes) else source) as picture:
        if picture.mode.startswith("I"):  # 16 bits of grey
            grey = np.asarray(picture, np.float64) / 65535.0
            return linear(np.repeat(grey[:, :, None], 3, axis=2)).astype(np.float32)
        if picture.mode == "F":
            return np.repeat(np.asarray(picture, np.float32)[:, :, None], 3, axis=2)
        return _LINEAR[np.asarray(picture.convert("RGB"))]


def alpha(source: Path | bytes) -> np.ndarray | None:
    """The alpha of a picture, 0 to 1, float32 [H, W]; None for one without. Raises whatever Pillow does."""
    with Image.open(io.BytesIO(source) if isinstance(source, bytes) else source) as picture:
        if "A" not in picture.getbands() and "transparency" not in picture.info:
            return None
        return np.asarray(picture.convert("RGBA"), np.float32)[:, :, 3] / 255


def coverage(source: Path) -> np.ndarray:
    """A picture of how much is there, 0 to 1, float32 [H, W]: its alpha, or how bright it is, as encoded, where that says
    nothing. Raises whatever Pillow does."""
    found = alpha(source)
    if found is not None and found.min() < 1:
        return found
    with Image.open(source) as picture:
        if picture.mode.startswith("I"):  # 16 bits
            return np.asarray(picture, np.float32) / 65535
        return np.asarray(picture.convert("L"), np.float32) / 255


def numbers(source: Path) -> np.ndarray:
    """The numbers of a picture's file as they are, 0 to 1, float32 [H, W, 3]. Raises whatever Pillow does."""
    with Image.open(source) as picture:
        return np.asarray(picture.convert("RGB"), np.float32) / 255


def named(
    folder: Path,
    name: str,
    what: str,
    findings: Findings,
    read: Callable[[Path], np.ndarray | None] = decoded,
    instead: str = "drawn in its plain colour",
) -> np.ndarray | None:
    """The picture that a file of `folder` means by `name`; None, and a word on `what` and on what is done `instead`, if it is
    missing or cannot be read."""
    found = files.found(folder, name)
    if found is None:
        findings.say(f"{what} is missing; {instead}")
        return None
    try:
        return read(found)
    except Exception as error:  # Pillow's readers raise what they like, and the mesh is worth reading without its picture
        findings.say(f"{what} cannot be read ({error}); {instead}")
        return None


def linear(encoded: np.ndarray) -> np.ndarray:
    """sRGB, 0 to 1, decoded (IEC 61966-2-1)."""
    encoded = np.clip(encoded, 0.0, 1.0)
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


_LINEAR = linear(np.arange(256) / 255.0).astype(np.float32)
