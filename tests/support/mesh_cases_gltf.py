"""glTF files, small ones, as users have them. In them y is up; what is right is said with z up: (x, y, z) is at (x, -z, y)."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image
from support.gltf_files import Gltf
from support.mesh_cases import (
    BALL,
    BALL_AREA,
    BALL_FACES,
    BALL_VOLUME,
    CUBE,
    GREY,
    MADE,
    PICTURE,
    SQUARE,
    SQUARE_UV,
    TRIANGLES,
    WITHIN_CUBE,
    Case,
    picture,
)

WHITE = (1, 1, 1)
whole_cube = {"area": 24, "volume": 8, "closed": True, "normals": "flat", "says": (MADE,)}
whole_ball = {"area": BALL_AREA, "volume": BALL_VOLUME, "closed": True, "normals": "radial"}
HALF = np.sqrt(0.5)
SQUARE_FACES = [[0, 1, 2], [0, 2, 3]]
DOWN = SQUARE_UV * [1, -1] + [0, 1]  # coordinates of the square as glTF has them, v down
STRIP = SQUARE[[0, 1, 3, 2]]

_png = io.BytesIO()
Image.fromarray(PICTURE).save(_png, "png")
PNG = _png.getvalue()


def made(build: Callable[[Gltf], object], how: str = "glb", cut: int | None = None) -> Callable[[Path], Path]:
    """Writes what `build` puts into a document."""

    def write(folder: Path) -> Path:
        document = Gltf()
        build(document)
        picture(folder)
        path = document.write(folder, how)
        if cut is not None:
            path.write_bytes(path.read_bytes()[:cut])
        return path

    return write


def cube(**node) -> Callable[[Gltf], object]:
    """A cube in a node; keywords of the node, or changes of the document."""
    changes = node.pop("json", {})
    return lambda g: (g.node(g.mesh(g.primitive(CUBE, TRIANGLES)), **node), g.json.update(changes))


def ball(**node) -> Callable[[Gltf], object]:
    return lambda g: g.node(g.mesh(g.primitive(BALL, BALL_FACES, NORMAL=BALL)), **node)


def square(g: Gltf, texture=None, colour=None, uv=None, sampler=None, image=PNG, material=None, **more) -> None:
    """A textured square; `texture` are more words about the texture, `material` about the material."""
    info = {"index": g.texture(image, **(sampler or {})), **(texture or {})}
    uv = DOWN if uv is None else uv
    part = g.primitive(SQUARE, SQUARE_FACES, TEXCOORD_0=uv, **more)
    g.node(g.mesh({**part, "material": g.material(colour, info, **(material or {}))}))


def shown(texture=None, **more) -> Callable[[Gltf], object]:
    return lambda g: square(g, texture, **more)


def moved(**transform) -> dict:
    return {"extensions": {"KHR_texture_transform": transform}}


def at(*seen) -> dict:
    """What is seen at points (x, y) of the square, which stands upright."""
    return {(x, 0.0, y): colour for (x, y), colour in seen}


def quarters(lower_left, lower_right, upper_left, upper_right) -> dict:
    return at(((0.25, 0.25), lower_left), ((0.75, 0.25), lower_right), ((0.25, 0.75), upper_left), ((0.75, 0.75), upper_right))


def sparse(g: Gltf) -> None:
    """A cube of which one corner is elsewhere, and put back by sparse numbers."""
    wrong = CUBE.copy()
    wrong[6] = 0.0
    rows, values = g.view(np.array([6], "<u2").tobytes()), g.view(CUBE[6].astype("<f4").tobytes())
    told = {"count": 1, "indices": {"bufferView": rows, "componentType": 5123}, "values": {"bufferView": values}}
    place = g.numbers(wrong, sparse=told, min=[-1] * 3, max=[1] * 3)
    g.node(g.mesh(g.primitive(place, TRIANGLES)))


def quantised(normalized: bool, required: bool = True) -> Callable[[Gltf], object]:
    """A ball of 16-bit integers; its node brings it to radius 0.6."""

    def build(g: Gltf) -> None:
        place = g.numbers(np.round(BALL * 32767), "int16", bounds=True, pad=2, normalized=normalized)
        normal = g.numbers(np.round(BALL * 127), "int8", pad=1, normalized=True)
        scale = 0.6 if normalized else 0.6 / 32767
        g.node(g.mesh(g.primitive(place, BALL_FACES, NORMAL=normal)), scale=[scale] * 3)
        g.json["extensionsUsed"] = ["KHR_mesh_quantization"]
        if required:
            g.json["extensionsRequired"] = ["KHR_mesh_quantization"]

    return build


def coloured(values, kind: str, **more) -> Callable[[Gltf], object]:
    return lambda g: g.node(g.mesh(g.primitive(SQUARE, SQUARE_FACES, COLOR_0=g.numbers(values, kind, **more))))


def primitives(g: Gltf) -> None:
    """Two of one mesh, with coordinates, of two materials."""
    info = {"index": g.texture(PNG)}
    parts = [g.primitive(np.add(SQUARE, [k, 0, 0]), SQUARE_FACES, TEXCOORD_0=DOWN) for k in range(2)]
    g.node(
        g.mesh({**parts[0], "material": g.material(texture=info)}, {**parts[1], "material": g.material((0.5, 1, 1), info, "n")})
    )


def mode(mode: int, places, indices=None) -> Callable[[Gltf], object]:
    return lambda g: g.node(g.mesh({**g.primitive(places, indices), "mode": mode}))


def skinned(g: Gltf) -> None:
    """A cube that hangs on a joint 3 to the right of where it was bound, in a node whose own place has no meaning."""
    joint = g.node(translation=[5, 0, 0])
    bound = np.eye(4)
    bound[:3, 3] = [-2, 0, 0]
    skin = g.add("skins", {"joints": [joint], "inverseBindMatrices": g.numbers([bound.T])})
    joints, weights = g.numbers(np.zeros((8, 4)), "uint8"), g.numbers(np.tile([255, 0, 0, 0], (8, 1)), "uint8", normalized=True)
    g.node(g.mesh(g.primitive(CUBE, TRIANGLES, JOINTS_0=joints, WEIGHTS_0=weights)), skin=skin, translation=[100, 0, 0])


def morphed(g: Gltf) -> None:
    target = {"POSITION": g.numbers(CUBE)}
    g.node(g.mesh({**g.primitive(CUBE, TRIANGLES), "targets": [target, target]}, weights=[0.5, 0]))


def split_ball(g: Gltf) -> None:
    """A ball without normals, of two primitives that share no vertex with one another, nor their faces."""
    soup = BALL[BALL_FACES].reshape(-1, 3)
    g.node(g.mesh(*(g.primitive(half, np.arange(len(half))) for half in (soup[:480], soup[480:]))))


def draco(g: Gltf, **more) -> None:
    place = g.add("accessors", {"componentType": 5126, "count": 8, "type": "VEC3", "min": [-1] * 3, "max": [1] * 3})
    part = g.primitive(place, TRIANGLES)
    g.node(g.mesh({**part, "extensions": {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}}}))
    g.json.update(more)


def meshopt(g: Gltf) -> None:
    cube()(g)
    for view in g.json["bufferViews"]:
        view["extensions"] = {"EXT_meshopt_compression": {"buffer": 0, "count": 8}}


def changed(kind: str, index: int, **more) -> Callable[[Gltf], object]:
    """A cube, and a change of one thing in it."""
    return lambda g: (cube()(g), g.json[kind][index].update(more))


def instanced(g: Gltf) -> None:
    mesh = g.mesh(g.primitive(CUBE, TRIANGLES))
    for name, place in (("left", [-3, 0, 0]), ("right", [3, 0, 0])):
        g.node(mesh, translation=place, name=name)


def nested(g: Gltf) -> None:
    """Scaled in a node, below one that turns by 90 degrees about z, below one that moves."""
    inner = g.node(g.mesh(g.primitive(CUBE, TRIANGLES)), root=False, scale=[3, 1, 1])
    g.node(translation=[0, 10, 0], children=[g.node(root=False, rotation=[0, 0, HALF, HALF], children=[inner])])


def scenes(g: Gltf) -> None:
    mesh = g.mesh(g.primitive(CUBE, TRIANGLES))
    g.node(mesh, translation=[100, 0, 0])
    g.json["scenes"].append({"nodes": [g.node(mesh, root=False)]})
    g.json["scene"] = 1


def glossy(g: Gltf) -> None:
    other = {"KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [0.25, 0.5, 1, 1]}}
    g.node(g.mesh({**g.primitive(CUBE, TRIANGLES), "material": g.material(extensions=other)}))
    g.json["extensionsRequired"] = ["KHR_materials_pbrSpecularGlossiness"]


def shining(g: Gltf) -> None:
    strong = {"KHR_materials_emissive_strength": {"emissiveStrength": 8}}
    g.node(g.mesh({**g.primitive(CUBE, TRIANGLES), "material": g.material(emissiveFactor=[1, 0.5, 0], extensions=strong)}))


def animated(g: Gltf) -> None:
    cube(translation=[1, 0, 0])(g)
    g.add("animations", {"channels": [], "samplers": []})
    g.node(camera=0)


STANDING = [
    Case("GLB", made(cube()), **whole_cube, box=WITHIN_CUBE, faces=12, parts={"": GREY}),
    Case("JSON and numbers beside it", made(cube(), "beside"), **whole_cube, box=WITHIN_CUBE),
    Case("JSON and numbers in an address", made(cube(), "data"), **whole_cube, box=WITHIN_CUBE),
    Case("its own normals", made(ball()), **whole_ball),
    Case(
        "y is up",
        made(cube(scale=[1, 5, 2], translation=[1, 10, 100])),
        box=((0, -102, 5), (2, -98, 15)),
        volume=80,
        says=(MADE,),
    ),
    Case("a node moved", made(cube(translation=[1, 2, 3])), **whole_cube, box=((0, -4, 1), (2, -2, 3))),
    Case(
        "a node turned",
        made(cube(rotation=[0, 0, np.sin(np.pi / 8), np.cos(np.pi / 8)])),
        **whole_cube,
        box=((-(2**0.5), -1, -(2**0.5)), (2**0.5, 1, 2**0.5)),
    ),
    Case("a node mirrored", made(ball(scale=[-1, 1, 1])), **whole_ball),
    Case("a node mirrored thrice", made(ball(scale=[-1, -1, -1])), **whole_ball),
    Case(
        "a node of a matrix",
        made(cube(matrix=[0, 2, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 7, 0, 0, 1])),
        volume=16,
        box=((6, -1, -2), (8, 1, 2)),
        says=(MADE,),
    ),
    Case(
        "a node scaled unevenly",
        made(ball(scale=[0.5, 2, 1])),
        volume=BALL_VOLUME,
        normals="ellipsoid",
        says=("30 degrees off their face",),
    ),
    Case("nodes below nodes", made(nested), volume=24, box=((-1, -1, 7), (1, 1, 13)), says=(MADE,)),
    Case("a mesh twice", made(instanced), area=48, volume=16, box=((-4, -1, -1), (4, 1, 1)), says=(MADE,)),
    Case("two scenes", made(scenes), **{**whole_cube, "says": (MADE, "of 2 scenes, number 1")}, box=WITHIN_CUBE),
    Case(
        "no scene",
        made(lambda g: (cube()(g), g.json.pop("scene"), g.json.pop("scenes"))),
        **{**whole_cube, "says": (MADE, "there is no scene")},
    ),
    Case("a skin", made(skinned), **{**whole_cube, "says": (MADE, "hang on joints")}, box=((2, -1, -1), (4, 1, 1))),
    Case("a shape", made(morphed), volume=27, says=(MADE, "change their shape")),
    Case(
        "animations and cameras",
        made(animated),
        volume=8,
        box=((0, -1, -1), (2, 1, 1)),
        says=(MADE, "animations, left out.*: 1", "cameras, left out: 1"),
    ),
    Case("a seam without normals", made(split_ball), **whole_ball, says=(MADE,)),
    Case("nodes in a circle", made(lambda g: (g.node(children=[1]), g.node(root=False, children=[0]))), refused="below itself"),
    Case(
        "a node below two", made(lambda g: (cube()(g), g.node(children=[0]), g.node(children=[0]))), refused="below two others"
    ),
    Case(
        "nothing in the scene", made(lambda g: g.mesh(g.primitive(CUBE, TRIANGLES))), refused="1 meshes, and none in its scene"
    ),
]

NUMBERS = [
    Case("sparse", made(sparse), **whole_cube, box=WITHIN_CUBE),
    Case("quantised, normalised", made(quantised(True)), normals="radial", box=((-0.6,) * 3, (0.6,) * 3), closed=True),
    Case("quantised, by the node", made(quantised(False)), normals="radial", box=((-0.6,) * 3, (0.6,) * 3), closed=True),
    Case(
        "quantised, and not said to be", made(quantised(True, required=False)), normals="radial", box=((-0.6,) * 3, (0.6,) * 3)
    ),
    Case(
        "with gaps",
        made(lambda g: g.node(g.mesh(g.primitive(g.numbers(CUBE, bounds=True, pad=12), TRIANGLES)))),
        **whole_cube,
        box=WITHIN_CUBE,
    ),
    Case(
        "without indices", made(lambda g: g.node(g.mesh(g.primitive(CUBE[TRIANGLES].reshape(-1, 3))))), **whole_cube, faces=12
    ),
    Case(
        "indices of 8 bits",
        made(lambda g: g.node(g.mesh({**g.primitive(CUBE), "indices": g.numbers(TRIANGLES.reshape(-1), "uint8")}))),
        **whole_cube,
    ),
    Case(
        "indices of 32 bits",
        made(lambda g: g.node(g.mesh({**g.primitive(CUBE), "indices": g.numbers(TRIANGLES.reshape(-1), "uint32")}))),
        **whole_cube,
    ),
    Case("a strip", made(mode(5, STRIP)), faces=2, area=1, normals=(0, -1, 0), says=(MADE,)),
    Case("a fan", made(mode(6, SQUARE, [0, 1, 2, 3])), faces=2, area=1, normals=(0, -1, 0), says=(MADE,)),
    Case(
        "lines beside triangles",
        made(lambda g: g.node(g.mesh(g.primitive(CUBE, TRIANGLES), {**g.primitive(CUBE), "mode": 1}))),
        **{**whole_cube, "says": (MADE, "points or lines, left out: 1")},
    ),
    Case(
        "corners that are left over",
        made(lambda g: g.node(g.mesh(g.primitive(SQUARE)))),
        faces=1,
        says=(MADE, "no triangle, left out: 1"),
    ),
    Case(
        "a place at infinity",
        made(lambda g: g.node(g.mesh(g.primitive(g.numbers(np.where(CUBE > 0, np.inf, CUBE)), TRIANGLES)), scale=[0, 1, 1])),
        refused="places that are no numbers",
    ),
    Case("points alone", made(mode(0, CUBE)), refused="it has no faces"),
    Case("a mode that there is not", made(mode(7, CUBE)), refused="mode 7"),
    Case("bounds that are others", made(changed("accessors", 0, min=[-5, -5, -5])), refused="accessor 0 has numbers from"),
    Case("bounds that are rounded", made(changed("accessors", 0, min=[-1.001, -1, -1])), **whole_cube),
    Case(
        "a vertex that is not there", made(lambda g: g.node(g.mesh(g.primitive(CUBE, [[0, 1, 9]])))), refused="names vertex 9"
    ),
    Case("numbers behind their end", made(changed("accessors", 0, count=900)), refused="accessor 0 ends behind"),
    Case("a view behind its end", made(changed("bufferViews", 0, byteLength=9000)), refused="view 0 ends behind"),
    Case(
        "as many normals as there are not",
        made(lambda g: g.node(g.mesh(g.primitive(CUBE, TRIANGLES, NORMAL=BALL)))),
        refused="8 places and 162 of NORMAL",
    ),
    Case(
        "a file that is not there",
        made(cube(json={"buffers": [{"byteLength": 240, "uri": "gone.bin"}]}), "beside"),
        refused="gone.bin, which is not there",
    ),
    Case(
        "a buffer that is nowhere", made(cube(json={"buffers": [{"byteLength": 240}]}), "beside"), refused="buffer 0 is nowhere"
    ),
    Case(
        "an accessor that is not there",
        made(lambda g: g.node(g.mesh({"attributes": {"POSITION": 7}}))),
        refused="number 7 of its accessors",
    ),
    Case(
        "compressed by Draco",
        made(lambda g: draco(g, extensionsRequired=["KHR_draco_mesh_compression"])),
        refused="KHR_draco_mesh_compression",
    ),
    Case("compressed by Draco, and not said to be", made(draco), refused="KHR_draco_mesh_compression"),
    Case(
        "numbers that are nowhere",
        made(lambda g: (cube()(g), g.json["accessors"][0].pop("bufferView"))),
        refused="accessor 0 has no numbers",
    ),
    Case("compressed by meshopt", made(meshopt), refused="EXT_meshopt_compression"),
    Case("an extension of the future", made(cube(json={"extensionsRequired": ["EXT_voxels"]})), refused="requires EXT_voxels"),
    Case(
        "instances by an extension", made(cube(extensions={"EXT_mesh_gpu_instancing": {}})), refused="EXT_mesh_gpu_instancing"
    ),
    Case("cut off", made(cube(), cut=-20), refused=r"of \d+ bytes"),
    Case("cut off in its head", made(cube(), cut=10), refused="ends within its head"),
    Case("version 1", made(cube(json={"asset": {"version": "1.0"}})), refused=r"glTF 1\.0"),
    Case("no JSON", made(cube(), "beside", cut=30), refused="neither GLB nor JSON"),
    Case("a list in place of a thing", made(cube(json={"meshes": [[]]})), refused="not what its format asks for"),
]

CASES = [*STANDING, *NUMBERS]
