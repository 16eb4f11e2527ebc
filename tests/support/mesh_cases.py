"""A mesh file that is written by hand, and what is right of it: numbers that follow from its shape, or words of a refusal."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import trimesh
from PIL import Image

MADE = "normals are made, with creases"
GREY = (0.5, 0.5, 0.5)

# A cube from -1 to 1, counter-clockwise from outside.
CUBE = np.array([[x, y, z] for z in (-1, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))], float)
QUADS = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
TRIANGLES = np.array([t for a, b, c, d in QUADS for t in ((a, b, c), (a, c, d))])
WITHIN_CUBE = ((-1, -1, -1), (1, 1, 1))

_ball = trimesh.creation.icosphere(subdivisions=2)
BALL, BALL_FACES = np.array(_ball.vertices), np.array(_ball.faces)
BALL_AREA, BALL_VOLUME = float(_ball.area), float(_ball.volume)

# A square of 1 and its coordinates, v up.
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
SQUARE_UV = SQUARE[:, :2]

# sRGB, as a file has them: rows from above.
PICTURE = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [188, 188, 188]]], np.uint8)
MIDDLE = ((188 / 255 + 0.055) / 1.055) ** 2.4  # 188, decoded
# The same, of which the left half is there, and how much of it is.
LEFT = np.array([[255, 0], [255, 0]], np.uint8)
HALF_THERE = np.dstack([PICTURE, LEFT])
RED, GREEN, BLUE, LIGHT = (1, 0, 0), (0, 1, 0), (0, 0, 1), (MIDDLE,) * 3

Point = tuple[float, float, float]


@dataclass(frozen=True)
class Case:
    """
    name     what is in the file
    write    writes it into a folder, and all that belongs to it; returns the file to be read
    refused  what the refusal says, an expression; with it nothing else is asked
    box      lowest and highest corner
    area, volume, faces
    closed   whether every edge has two faces
    normals  flat: those of their faces; radial: along the vertices, as on a ball; ellipsoid: see the test; or one for all
    parts    names of materials -> base colours
    colours  points -> what is seen there, linear RGB: base colour times picture times colours of the vertices
    emits    names of materials -> what they emit
    says     one expression for each finding, in any order; nothing else is said
    """

    name: str
    write: Callable[[Path], Path]
    refused: str = ""
    box: tuple[tuple[float, ...], tuple[float, ...]] | None = None
    area: float | None = None
    volume: float | None = None
    faces: int | None = None
    closed: bool | None = None
    normals: Literal["flat", "radial", "ellipsoid"] | Point | None = None
    parts: dict[str, Any] | None = None
    colours: Mapping[Any, Any] | None = None
    emits: dict[str, Any] | None = None
    says: tuple[str, ...] = ()


def picture(folder: Path, name: str = "picture.png", pixels: np.ndarray = PICTURE) -> str:
    Image.fromarray(pixels).save(folder / name)
    return name


def text(name: str, said: str, encoding: str = "utf-8", **others: str) -> Callable[[Path], Path]:
    """Writes a text, and others beside it, whose names end in what follows the last underline; and pictures."""

    def write(folder: Path) -> Path:
        for other, body in others.items():
            (folder / ".".join(other.rsplit("_", 1))).write_text(body)
        picture(folder)
        picture(folder, "there.png", HALF_THERE)
        picture(folder, "left.png", LEFT)
        picture(folder, "faint.png", LEFT // 3)
        (folder / name).write_bytes(said.encode(encoding))
        return folder / name

    return write
