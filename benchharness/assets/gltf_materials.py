"""Materials of glTF 2.0: the base colour, its picture and where that is, alpha, emission.

What else there is, such as metal, roughness and bumps, has no place in a diffuse material; it is said where it is ignored.
Base colours and colours of vertices are linear, pictures are sRGB. The transform of a picture's coordinates is scale, then
turn, then offset, with v down (KHR_texture_transform).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchharness.assets import pictures
from benchharness.assets.asset import PLAIN, WHITE, Colour, Findings, Material, Refused, Wrap
from benchharness.assets.gltf_accessors import Document
from benchharness.modelling.alpha import AlphaMap
from benchharness.modelling.contour import Holes

WRAPS: dict[int, Wrap] = {33071: "clamp", 33648: "mirror", 10497: "repeat"}
NEAREST = 9728  # what a sampler says of pixels that are seen larger than they are
IGNORED = {
    "normalTexture": "normal maps, ignored",
    "KHR_materials_transmission": "materials that let light through, drawn opaque",
    "KHR_materials_clearcoat": "materials with a clear coat, drawn without",
    "KHR_materials_unlit": "materials without light, drawn as diffuse ones",
}


@dataclass(frozen=True, eq=False)
class Look:
    """A material, which coordinates its picture has, and what takes these there: float64 [2, 3] on (u, v, 1), v down."""

    material: Material
    coordinates: int = 0
    transform: np.ndarray | None = None

    def placed(self, uv: np.ndarray) -> np.ndarray:
        """Coordinates of the file, [N, 2], as a `Part` has them: transformed, v up."""
        if self.transform is not None:
            uv = uv @ self.transform[:, :2].T + self.transform[:, 2]
        return np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=1)


Decoded = dict[tuple[int, Callable[[bytes], np.ndarray | None]], np.ndarray | None]
"""What pictures were decoded to, by their numbers and what did it."""


def looks(document: Document, findings: Findings) -> list[Look]:
    """The materials of a file, and last two for what has none: plain, and white for what has colours at its vertices."""
    decoded: Decoded = {}
    found = [_look(document, k, findings, decoded) for k in range(len(document.all("materials")))]
    return [*found, Look(Material("", PLAIN)), Look(Material("", WHITE))]


def _look(document: Document, index: int, findings: Findings, decoded: Decoded) -> Look:
    said = document.one("materials", index)
    extensions = said.get("extensions", {})
    name = str(said.get("name") or f"material {index}")
    plain = said.get("pbrMetallicRoughness", {})
    factor, texture = plain.get("baseColorFactor", [1, 1, 1, 1]), plain.get("baseColorTexture")
    if "KHR_materials_pbrSpecularGlossiness" in extensions:
        other = extensions["KHR_materials_pbrSpecularGlossiness"]
        factor, texture = other.get("diffuseFactor", [1, 1, 1, 1]), other.get("diffuseTexture")
    elif plain.get("metallicFactor", 1.0) > 0 and ("metallicFactor" in plain or "metallicRoughnessTexture" in plain):
        findings.count("materials of metal, drawn as diffuse ones of its colour")
    for key, words in IGNORED.items():
        findings.count(words, key in said or key in extensions)
    mode = said.get("alphaMode", "OPAQUE")
    cutoff = float(said.get("alphaCutoff", 0.5)) if mode == "MASK" else 0.5
    holes = Holes(cutoff, factor=float(factor[3]) if len(factor) > 3 else 1.0) if mode in ("MASK", "BLEND") else None
    material = Material(
        name,
        _rgb(factor, f"base colour of {name}"),
        emission=_emission(document, said, name, findings, decoded),
        holes=holes,
        blends=mode == "BLEND",
    )
    if texture is None:
        return Look(material)
    picture = _picture(document, texture["index"], f"of material {name}", findings, decoded)
    if picture is None:
        return Look(material)
    transform = texture.get("extensions", {}).get("KHR_texture_transform", {})
    coordinates = transform.get("texCoord", texture.get("texCoord", 0))
    u, v, nearest = _sampler(document, texture["index"])
    material = replace(material, picture=picture, wrap=(u, v))
    if holes is not None:
        alpha = _picture(document, texture["index"], f"of material {name}", findings, decoded, pictures.alpha)
        if alpha is not None:
            material = replace(material, holes=replace(holes, picture=AlphaMap(alpha, material.wrap, nearest)))
    if "emissiveTexture" in said:
        material = _outshone(material, picture, findings)
    return Look(material, coordinates, _matrix(transform) if transform else None)


def _outshone(material: Material, picture: np.ndarray, findings: Findings) -> Material:
    """A material without what a picture says that it emits, where that is darker in the mean than the `picture` of its colour:
    most of what has small lamps on it. It would shine all over, and nothing that shines has a picture."""
    colour = np.array(material.base_colour) * picture.mean(axis=(0, 1), dtype=np.float64)
    if not any(material.emission) or sum(material.emission) > colour.sum():
        return material
    findings.say(f"that is left out of material {material.name}, as the picture of its colour is brighter")
    return replace(material, emission=(0.0, 0.0, 0.0))


def _emission(document: Document, said: dict[str, Any], name: str, findings: Findings, decoded: Decoded) -> Colour:
    """Emitted light: the factor, its strength, and the mean of a picture."""
    emission = np.array(_rgb(said.get("emissiveFactor", [0, 0, 0]), f"emission of {name}"))
    emission *= said.get("extensions", {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
    if "emissiveTexture" in said and emission.any():
        picture = _picture(document, said["emissiveTexture"]["index"], f"of what {name} emits", findings, decoded)
        if picture is not None:
            findings.say(f"what material {name} emits is the mean of its picture")
            emission *= picture.mean(axis=(0, 1), dtype=np.float64)
    r, g, b = emission.tolist()
    return r, g, b


def _picture(
    document: Document,
    texture: int,
    whose: str,
    findings: Findings,
    decoded: Decoded,
    how: Callable[[bytes], np.ndarray | None] = pictures.decoded,
) -> np.ndarray | None:
    """The picture of a texture, or another that is decoded from it; None, and a word, where it cannot be had."""
    said = document.one("textures", texture)
    extensions = said.get("extensions", {})
    source = said.get("source")
    for name in ("EXT_texture_webp", "EXT_texture_avif", "KHR_texture_basisu", "MSFT_texture_dds"):
        if source is None and name in extensions:
            source = extensions[name].get("source")
    if source is None:
        findings.say(f"the picture {whose} is none; drawn in its plain colour")
        return None
    if (source, how) not in decoded:
        decoded[source, how] = None
        try:
            image = document.one("images", source)
            data = document.view(image["bufferView"])[0] if "bufferView" in image else document.fetched(image["uri"], "it")
            decoded[source, how] = how(data)
        except Refused as error:
            findings.say(f"the picture {whose} is missing ({str(error).partition(';')[0]}); drawn in its plain colour")
        except Exception as error:  # of Pillow's readers, or what an image lacks: the mesh is worth reading without its picture
            findings.say(f"the picture {whose} cannot be read ({error}); drawn in its plain colour")
    return decoded[source, how]


def _sampler(document: Document, texture: int) -> tuple[Wrap, Wrap, bool]:
    """How a texture goes on along u and v, and whether nothing is interpolated in it."""
    said = document.one("textures", texture)
    sampler = document.one("samplers", said["sampler"]) if "sampler" in said else {}
    u, v = (sampler.get(key, 10497) for key in ("wrapS", "wrapT"))
    if u not in WRAPS or v not in WRAPS:
        raise Refused(f"a sampler wraps by {u} and {v}; accepted: {', '.join(map(str, WRAPS))}")
    return WRAPS[u], WRAPS[v], sampler.get("magFilter") == NEAREST


def _matrix(said: dict[str, Any]) -> np.ndarray:
    """The transform of coordinates with v down, float64 [2, 3]. An angle turns them counter-clockwise for whoever
    looks at the picture, as the extension says; the matrix in its text has the other sign."""
    (x, y), (ox, oy), angle = said.get("scale", (1, 1)), said.get("offset", (0, 0)), said.get("rotation", 0.0)
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c * x, s * y, ox], [-s * x, c * y, oy]], np.float64)


def _rgb(values: Any, what: str) -> Colour:
    """Three numbers. Raises Refused for others, and for some that are not finite or less than nothing."""
    numbers = np.array(values, np.float64)
    if numbers.ndim != 1 or len(numbers) < 3 or not np.isfinite(numbers).all() or (numbers < 0).any():
        raise Refused(f"{what} is {values}; accepted: three numbers from 0")
    r, g, b = numbers[:3].tolist()
    return r, g, b
