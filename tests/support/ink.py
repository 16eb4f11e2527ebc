"""What is drawn on a chart that was saved as a picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

CLOSE = 3  # of 255, per channel


def pixels(path: Path) -> np.ndarray:
    """The picture, uint8 [H, W, 3]."""
    with Image.open(path) as picture:
        return np.array(picture.convert("RGB"))


def ink(picture: np.ndarray, colour: str) -> int:
    """How many pixels have a colour "#rrggbb"."""
    wanted = [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
    return int((np.abs(picture.astype(int) - wanted).max(axis=-1) <= CLOSE).sum())


def shown(picture: np.ndarray, panel: np.ndarray) -> float:
    """The share of a panel's colours, uint8 [h, w, 3], that are somewhere in the picture."""
    there, asked = ({tuple(c) for c in a.reshape(-1, 3).tolist()} for a in (picture, panel))
    return len(asked & there) / len(asked)
