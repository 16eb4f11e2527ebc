"""Frames and answers on the host: arrays [H, W] with row 0 on top, out of one lane per pixel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from benchharness.api import Frame, Reflection


@dataclass(frozen=True, eq=False)
class Answer:
    """What a method says of a frame beside its radiance.

    mirror    pixels of mirrors, bool
    found     those that have an answer, bool
    doubt     those that have one which may be wrong, bool
    distance  metres, float32; inf off the mirrors
    """

    mirror: np.ndarray
    found: np.ndarray
    doubt: np.ndarray
    distance: np.ndarray


def answer(frame: Frame, reflection: Reflection) -> Answer:
    """An answer without what a method leaves at pixels without a mirror: that may be anything, and differ from call to call."""
    mirror = plane(frame.active, frame)
    doubt = False if reflection.doubt is None else plane(reflection.doubt, frame)
    distance = np.where(mirror, plane(reflection.distance, frame), np.float32(np.inf))
    return Answer(mirror, mirror & plane(reflection.found, frame), mirror & doubt, distance)


def plane(values: Any, frame: Frame) -> np.ndarray:
    """One number per pixel, or one for all, [H, W]."""
    view = frame.view
    return np.broadcast_to(np.array(values), view.width * view.height).reshape(view.height, view.width)


def image(colours: Any, frame: Frame) -> np.ndarray:
    """Three channels per pixel, or the same for all, float32 [H, W, 3]."""
    view = frame.view
    lanes = np.broadcast_to(np.array(colours, np.float32).T, (view.width * view.height, 3))
    return lanes.reshape(view.height, view.width, 3)
