"""glTF files with colours and pictures."""

from __future__ import annotations

import io
from collections.abc import Callable

import numpy as np
from PIL import Image
from support.gltf_files import Gltf
from support.mesh_cases import BLUE, CUBE, GREEN, HALF_THERE, LIGHT, MADE, MIDDLE, RED, SQUARE, TRIANGLES, Case
from support.mesh_cases_gltf import (
    DOWN,
    SQUARE_FACES,
    WHITE,
    at,
    coloured,
    cube,
    glossy,
    made,
    moved,
    primitives,
    quarters,
    shining,
    shown,
    square,
    whole_cube,
)

_png = io.BytesIO()
Image.fromarray(HALF_THERE).save(_png, "png")
CLAMPED = {"wrapS": 33071, "wrapT": 33071}


def seen_through(
    mode: str, alpha: float = 1.0, cutoff: float | None = None, sampler=CLAMPED, **more
) -> Callable[[Gltf], object]:
    """A square, of whose picture the left half is there, by this mode; `alpha` of the base colour."""
    said = {"alphaMode": mode, **({} if cutoff is None else {"alphaCutoff": cutoff})}

    def build(g: Gltf) -> None:
        square(g, material=said, image=_png.getvalue(), sampler=sampler, **more)
        g.json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = [1, 1, 1, alpha]

    return build


def faded(alphas, mode: str) -> Callable[[Gltf], object]:
    """A square without a picture whose corners have these alphas."""

    def build(g: Gltf) -> None:
        colours = g.numbers([(1, 1, 1, alpha) for alpha in alphas])
        part = g.primitive(SQUARE, SQUARE_FACES, COLOR_0=colours)
        g.node(g.mesh({**part, "material": g.material(alphaMode=mode)}))

    return build


LEFT_HALF = ((0, 0, 0), (0.5, 0, 1))
HOLED, BLENT, THROUGH = "holes where.*cutoff: 1", "shown as cut-outs.*: 1", "let light through, drawn opaque: 1"

# Between the two centres, u = 1/4 and 3/4, alpha falls from 1 to 0: it is a half at 1/2, and c at 3/4 - c / 2.
ALPHA = [
    Case(
        "a mask",
        made(seen_through("MASK")),
        area=0.5,
        box=LEFT_HALF,
        colours=at(((0.2, 0.2), BLUE), ((0.2, 0.8), RED), ((0.45, 0.2), BLUE)),
        says=(MADE, HOLED),
    ),
    Case("a mask by another cutoff", made(seen_through("MASK", cutoff=0.25)), area=0.625, says=(MADE, HOLED)),
    Case("a mask times a base colour", made(seen_through("MASK", 0.625)), area=0.35, says=(MADE, HOLED)),
    # From 7/8 on alpha rises to that of the next picture's left half.
    Case("a mask repeated", made(seen_through("MASK", cutoff=0.25, sampler=None)), area=0.75, says=(MADE, HOLED)),
    Case(
        "a mask mirrored",
        made(seen_through("MASK", uv=DOWN * [2, 1], sampler={"wrapS": 33648, "wrapT": 33648})),
        area=0.5,
        box=((0, 0, 0), (1, 0, 1)),
        says=(MADE, HOLED),
    ),
    Case("a mask moved", made(seen_through("MASK", texture=moved(offset=[0.25, 0]))), area=0.25, says=(MADE, HOLED)),
    Case(
        "a mask that is not interpolated",
        made(seen_through("MASK", cutoff=0.25, sampler={**CLAMPED, "magFilter": 9728})),
        area=0.5,
        box=LEFT_HALF,
        says=(MADE, HOLED),
    ),
    Case("a mask that is not asked for", made(seen_through("OPAQUE", 0.1)), area=1, says=(MADE,)),
    Case("a mask that is everywhere", made(seen_through("MASK", cutoff=0)), faces=2, says=(MADE,)),
    Case("a mask that is nowhere", made(seen_through("MASK", 0.4)), refused="below its cutoff everywhere"),
    Case(
        "a mask of vertices",
        made(faded([1, 0, 0, 1], "MASK")),
        area=0.5,
        box=LEFT_HALF,
        parts={"m": WHITE},
        colours=at(((0.4, 0.5), WHITE)),
        says=(MADE, HOLED),
    ),
    Case(
        "a mask of vertices times a picture",
        made(seen_through("MASK", COLOR_0=[(1, 1, 1, a) for a in (1, 0, 0, 1)])),
        area=(3.5 - 4.25**0.5) / 4,  # (3/2 - 2 u) (1 - u) = 1/2
        says=(MADE, HOLED),
    ),
    Case("what blends with holes", made(seen_through("BLEND", 0.9)), area=0.5, box=LEFT_HALF, says=(MADE, BLENT)),
    Case("what blends as vertices say", made(faded([1, 0, 0, 1], "BLEND")), area=0.5, says=(MADE, BLENT)),
    Case("what blends everywhere", made(faded([0.9] * 4, "BLEND")), area=1, says=(MADE, THROUGH)),
    Case("what hardly is anywhere", made(faded([0.2] * 4, "BLEND")), area=1, says=(MADE, THROUGH)),
]

CASES = [
    *ALPHA,
    Case(
        "a base colour",
        made(lambda g: g.node(g.mesh({**g.primitive(CUBE, TRIANGLES), "material": g.material((0.5, 0.5, 0.25))}))),
        **whole_cube,
        parts={"m": (0.5, 0.5, 0.25)},
    ),
    Case("a picture", made(shown()), colours=quarters(BLUE, LIGHT, RED, GREEN), says=(MADE,)),
    Case(
        "a picture beside it",
        made(shown(image="picture.png"), "beside"),
        colours=quarters(BLUE, LIGHT, RED, GREEN),
        says=(MADE,),
    ),
    Case(
        "a base colour times a picture",
        made(shown(colour=(0.5, 0.5, 0.5))),
        colours=quarters((0, 0, 0.5), (MIDDLE / 2,) * 3, (0.5, 0, 0), (0, 0.5, 0)),
        says=(MADE,),
    ),
    Case(
        "two primitives and materials",
        made(primitives),
        parts={"m": WHITE, "n": (0.5, 1, 1)},
        says=(MADE,),
        colours=at(((0.25, 0.75), RED), ((1.25, 0.75), (0.5, 0, 0)), ((1.75, 0.25), (MIDDLE / 2, MIDDLE, MIDDLE))),
    ),
    Case(
        "a picture repeated",
        made(shown(uv=2 * DOWN)),
        colours=at(((0.1, 0.1), BLUE), ((0.6, 0.1), BLUE), ((0.9, 0.6), LIGHT)),
        says=(MADE,),
    ),
    Case(
        "a picture mirrored along u",
        made(shown(uv=DOWN * [2, 1], sampler={"wrapS": 33648})),
        colours=at(((0.1, 0.25), BLUE), ((0.4, 0.25), LIGHT), ((0.6, 0.25), LIGHT), ((0.9, 0.25), BLUE)),
        says=(MADE,),
    ),
    Case(
        "a picture that ends",
        made(shown(uv=DOWN * 3 - 1, sampler={"wrapS": 33071, "wrapT": 33071})),
        colours=at(((0.1, 0.1), BLUE), ((0.9, 0.1), LIGHT), ((0.1, 0.9), RED)),
        says=(MADE,),
    ),
    Case(
        "a picture scaled and moved",
        made(shown(moved(scale=[0.5, 0.5], offset=[0.5, 0]))),
        colours=quarters(GREEN, GREEN, GREEN, GREEN),
        says=(MADE,),
    ),
    # Counter-clockwise by 90 degrees about the upper left corner: what was on the right is above, and (0, 1) brings it back.
    Case(
        "a picture turned",
        made(shown(moved(rotation=np.pi / 2, offset=[0, 1]))),
        colours=quarters(LIGHT, GREEN, BLUE, RED),
        says=(MADE,),
    ),
    Case(
        "a picture by its second coordinates",
        made(shown(texture={"texCoord": 1}, uv=0 * DOWN, TEXCOORD_1=DOWN)),
        colours=quarters(BLUE, LIGHT, RED, GREEN),
        says=(MADE,),
    ),
    Case(
        "a picture by those of its transform",
        made(shown(moved(texCoord=1), uv=0 * DOWN, TEXCOORD_1=DOWN)),
        colours=quarters(BLUE, LIGHT, RED, GREEN),
        says=(MADE,),
    ),
    Case(
        "coordinates of 16 bits",
        made(lambda g: square(g, uv=g.numbers(DOWN * 65535, "uint16", normalized=True))),
        colours=quarters(BLUE, LIGHT, RED, GREEN),
        says=(MADE,),
    ),
    Case(
        "a picture that is not there",
        made(shown(image="gone.png", colour=RED), "beside"),
        parts={"m": RED},
        says=(MADE, "is missing .*gone.png"),
    ),
    Case("a picture that is none", made(shown(image=b"none")), parts={"m": WHITE}, says=(MADE, "cannot be read")),
    Case(
        "a picture of another format",
        made(
            lambda g: (
                square(g),
                g.json["textures"][0].update(extensions={"KHR_texture_basisu": {}}),
                g.json["textures"][0].pop("source"),
            )
        ),
        parts={"m": WHITE},
        says=(MADE, "is none; drawn in its plain colour"),
    ),
    Case(
        "pictures that have to be of another format",
        made(cube(json={"extensionsRequired": ["KHR_texture_basisu"]})),
        refused="requires KHR_texture_basisu",
    ),
    Case(
        "colours of vertices",
        made(coloured([RED, GREEN, BLUE, (0.5, 0.5, 0.5)], "float32")),
        colours=at(((0, 0), RED), ((1, 0), GREEN), ((0, 1), (0.5,) * 3)),
        says=(MADE,),
    ),
    Case(
        "colours of 8 bits are linear",
        made(coloured([[51, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [0, 0, 0, 0]], "uint8", normalized=True)),
        colours=at(((0, 0), (0.2, 0, 0)), ((1, 0), GREEN)),
        says=(MADE, "transparency"),
    ),
    Case(
        "colours of 16 bits",
        made(coloured(np.array([[13107, 0, 0], [0, 65535, 0], [0, 0, 65535], [0, 0, 0]]), "uint16", pad=2, normalized=True)),
        colours=at(((0, 0), (0.2, 0, 0)), ((1, 0), GREEN)),
        says=(MADE,),
    ),
    Case(
        "colours of vertices times a picture",
        made(shown(COLOR_0=[(0.5, 0.5, 0.5)] * 4)),
        colours=quarters((0, 0, 0.5), (MIDDLE / 2,) * 3, (0.5, 0, 0), (0, 0.5, 0)),
        says=(MADE,),
    ),
    Case("what shines strongly", made(shining), emits={"m": (8, 4, 0)}, says=(MADE,)),
    Case(
        "small lamps beside a picture",
        made(shown(material={"emissiveFactor": [0.5, 0.5, 0.5], "emissiveTexture": {"index": 0}})),
        colours=quarters(BLUE, LIGHT, RED, GREEN),
        emits={"m": (0, 0, 0)},
        says=(MADE, "what material m emits is the mean of its picture", "that is left out of material m"),
    ),
    Case(
        "a bright picture that shines beside one of colours",
        made(shown(colour=(0.25,) * 3, material={"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}})),
        emits={"m": ((1 + MIDDLE) / 4,) * 3},
        says=(MADE, "what material m emits is the mean of its picture"),
    ),
    Case("an older kind of colour", made(glossy), parts={"m": (0.25, 0.5, 1)}, says=(MADE,)),
    Case(
        "metal, glass, bumps",
        made(shown(material={"alphaMode": "BLEND", "normalTexture": {"index": 0}}, COLOR_0=[(1, 1, 1, 0.9)] * 4)),
        colours=quarters(BLUE, LIGHT, RED, GREEN),
        says=(MADE, "normal maps, ignored: 1", "let light through.*: 1"),
    ),
    Case("a sampler that there is not", made(shown(sampler={"wrapS": 1})), refused="wraps by 1"),
    Case("a colour that is none", made(shown(colour=(-1, 0, 0))), refused="base colour of m"),
    Case(
        "a material that is not there",
        made(lambda g: g.node(g.mesh({**g.primitive(CUBE, TRIANGLES), "material": 4}))),
        refused="material 4 of 0",
    ),
]
