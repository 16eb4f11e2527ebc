"""Pictures of what moves: strips of frames, and animations. Pixels in, pixels or a file's content out."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
from PIL import Image

STRIP = 6  # frames of a strip
GAP = 2  # pixels between pictures
MARGIN = 4  # pixels around the mirrors
FRAME_MS = 80  # slower than life, so that a pop can be told from a step
MOST_BYTES = 150_000  # of an animation: a page carries dozens
QUALITIES = (90, 75, 60, 40)
WHITE = 255

Box = tuple[int, int, int, int]


def crop(masks: Sequence[np.ndarray]) -> Box:
    """Left, top, right, bottom of what the masks [H, W] cover together, and a margin; everything where that is nothing."""
    whole = np.any(masks, axis=0)
    height, width = whole.shape
    if not whole.any():
        return 0, 0, width, height
    rows, columns = np.flatnonzero(whole.any(axis=1)), np.flatnonzero(whole.any(axis=0))
    return (
        max(int(columns[0]) - MARGIN, 0),
        max(int(rows[0]) - MARGIN, 0),
        min(int(columns[-1]) + 1 + MARGIN, width),
        min(int(rows[-1]) + 1 + MARGIN, height),
    )


def chosen(count: int, jump: int | None) -> list[int]:
    """The frames of a strip: evenly over `count`, or the two before a jump and those after it."""
    if jump is not None:
        return [k for k in range(jump - 2, jump + STRIP - 2) if 0 <= k < count]
    return sorted({round(float(k)) for k in np.linspace(0, count - 1, STRIP)})


def strip(
    method: Sequence[np.ndarray], truth: Sequence[np.ndarray], errors: Sequence[np.ndarray], box: Box, frames: Sequence[int]
) -> np.ndarray:
    """The method's frames above the reference's above the errors, uint8 [h, w, 3]; pictures are uint8 [H, W, 3]."""
    rows = [_joined([_cut(pictures[k], box) for k in frames], 1) for pictures in (method, truth, errors)]
    return _joined(rows, 0)


def animated(method: Sequence[np.ndarray], truth: Sequence[np.ndarray], box: Box) -> bytes:
    """The method beside the reference as an endless WebP, which browsers show from a data: URL; under MOST_BYTES.

    The best of QUALITIES that is small enough; where none is, of pictures of half the size, and so on.
    """
    frames = [Image.fromarray(_joined([_cut(m, box), _cut(t, box)], 1)) for m, t in zip(method, truth, strict=True)]
    while True:
        for quality in QUALITIES:
            out = io.BytesIO()
            rest = {"append_images": frames[1:], "duration": FRAME_MS, "loop": 0, "quality": quality}
            frames[0].save(out, "WEBP", save_all=True, **rest)
            if out.tell() <= MOST_BYTES or frames[0].height <= 2:
                return out.getvalue()
        frames = [frame.reduce(2) for frame in frames]


def _cut(picture: np.ndarray, box: Box) -> np.ndarray:
    left, top, right, bottom = box
    return picture[top:bottom, left:right]


def _joined(pictures: Sequence[np.ndarray], axis: int) -> np.ndarray:
    """Side by side (axis 1) or one above the other (axis 0), white between."""
    shape = list(pictures[0].shape)
    shape[axis] = GAP
    between = np.full(shape, WHITE, np.uint8)
    out = [piece for picture in pictures for piece in (between, picture)][1:]
    return np.concatenate(out, axis=axis)
