"""The pictures of a run, small enough to be carried inside the page."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass, field
from pathlib import Path

import matplotlib as mpl
import numpy as np
from PIL import Image, UnidentifiedImageError

from benchharness.report.points import SceneView
from benchharness.tables.naming import image_name

WIDTH, SMALL = 720, 360
"""Pixels to which wider pictures are reduced: a method's best parameters, and its others."""


@dataclass(frozen=True)
class Shot:
    """A picture and its error map as data: URLs, None where there is none; `record` is of the same frame, `label`
    as in `Point`."""

    record: dict
    label: str
    image: str | None
    error: str | None


@dataclass
class FrameShots:
    """One frame of a scene: the reference, the best parameters of each method, and the others."""

    frame: int
    reference: str | None
    best: list[Shot] = field(default_factory=list)
    others: list[Shot] = field(default_factory=list)


def frames(view: SceneView, folder: Path) -> list[FrameShots]:
    """The frames of a scene of which any picture exists in `folder`, ascending; missing pictures are None."""
    best = {(p.method, p.params) for p in view.best.values()}
    shots: dict[int, FrameShots] = {}
    for record in view.records:
        if record["frame"] is None:
            continue
        where = (view.scene, view.detail, record["frame"])
        reference = folder / image_name(*where, "reference")
        params = record["params"] or ""
        image, error = (folder / image_name(*where, kind, record["method"], params) for kind in ("image", "error"))
        if not (reference.is_file() or image.is_file() or error.is_file()):
            continue
        if record["frame"] not in shots:
            shots[record["frame"]] = FrameShots(record["frame"], data_url(reference, WIDTH))
        if image.is_file() or error.is_file():
            chosen = (record["method"], params) in best
            width = WIDTH if chosen else SMALL
            shot = Shot(
                record, view.labels[record["method"], params], data_url(image, width), data_url(error, width, coloured=True)
            )
            (shots[record["frame"]].best if chosen else shots[record["frame"]].others).append(shot)
    for shot in shots.values():
        shot.best.sort(key=lambda s: np.inf if s.record["flip"] is None else s.record["flip"])
    return [shots[frame] for frame in sorted(shots)]


def data_url(file: Path, width: int, *, coloured: bool = False) -> str | None:
    """A picture as a data: URL (JPEG, colours not subsampled); None where the file is missing or is no picture.

    coloured   a picture of one channel is an error map of 0 .. 255 and is given magma's colours
    """
    try:
        with Image.open(file) as opened:
            opened.load()
            image = opened.copy()
    except (OSError, UnidentifiedImageError):
        return None
    if coloured and image.mode in ("L", "1"):
        image = Image.fromarray(mpl.colormaps["magma"](np.asarray(image.convert("L")), bytes=True)[..., :3])
    image = image.convert("RGB")
    if image.width > width:
        image = image.resize((width, max(1, round(image.height * width / image.width))), Image.Resampling.LANCZOS)
    buffer = io.BytesIO()
    image.save(buffer, "jpeg", quality=90, subsampling=0)
    return f"data:image/jpeg;base64,{base64.b64encode(buffer.getvalue()).decode()}"
