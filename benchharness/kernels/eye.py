"""The eye of a frame on the host, where it is decided how finely a thing has to be drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchharness.kernels.types import Frame


@dataclass(frozen=True)
class Eye:
    """Who looks at the mirrors.

    place    float64 [3]
    forward  unit direction of the view's axis, float64 [3]
    focal    pixels per radian in the middle of the picture
    visible  per mirror, whether it can be in the picture, bool [mirrors]
    """

    place: np.ndarray
    forward: np.ndarray
    focal: float
    visible: np.ndarray


def eye_of(frame: Frame) -> Eye:
    """Of a frame. Waits for the device."""
    view = frame.view
    place, forward, right = (np.array(v, np.float64).ravel() for v in (view.eye, view.w.xyz, view.right))
    visible = [
        left < view.width and top < view.height and right_ > 0 and bottom > 0 for left, top, right_, bottom in frame.boxes
    ]
    return Eye(place, forward, float(1 / np.linalg.norm(right)), np.array(visible, bool))
