"""Normal maps of a table's mirrors: picture files of numbers, which no sRGB is decoded from."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchharness.assets import pictures
from benchharness.modelling import normalmap
from benchharness.scene import Mesh, Texture
from benchharness.study import placed

FLAT = np.array([0.5, 0.5, 1.0])


def read(path: Path, where: str, mesh: Mesh) -> tuple[Texture, list[str]]:
    """A file as the normal map of a mirror's mesh, which repeats beyond its edges; and what has to be said of it.

    Raises ValueError that names the key and the file, for a mesh without uv and for what is no picture.
    """
    if mesh.uv is None:
        raise ValueError(
            f"{where} is {path.name}, and the mirror's file has no uv, or not in all of its parts; accepted: a mesh file with "
            "texture coordinates (vt in OBJ, TEXCOORD_0 in glTF, u and v in PLY)"
        )
    placed.existing(path, where)
    try:
        pixels = pictures.numbers(path)
    except Exception as error:  # Pillow's readers raise what they like
        raise ValueError(f"{where}: {path} cannot be read ({error}); accepted: a picture, such as a PNG") from None
    inward = normalmap.into_surface(pixels)
    if not inward.any():
        return Texture(pixels), []
    said = f"{int(inward.sum())} pixels of {path.name} point into the surface, and are taken as flat"
    return Texture(np.where(inward[..., None], FLAT, pixels)), [said]
