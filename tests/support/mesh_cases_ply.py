"""PLY and STL files, small ones, as users have them."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from support.mesh_cases import (
    BALL,
    BALL_AREA,
    BALL_FACES,
    BALL_VOLUME,
    BLUE,
    CUBE,
    GREEN,
    GREY,
    HALF_THERE,
    LIGHT,
    MADE,
    MIDDLE,
    QUADS,
    RED,
    SQUARE,
    SQUARE_UV,
    TRIANGLES,
    WITHIN_CUBE,
    Case,
    picture,
    text,
)

CODES = {"char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f", "double": "d"}
whole_cube = {"box": WITHIN_CUBE, "area": 24, "volume": 8, "closed": True, "normals": "flat", "says": (MADE,)}


def ply(order: str, elements: dict[str, tuple[Sequence[str], Sequence[Sequence]]], head: str = "", cut: int | None = None):
    """Writes a PLY file. `order` is ascii, < or >; elements: properties and rows, of which a list is a list."""
    names = {"ascii": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}
    said, body = [f"ply\nformat {names[order]} 1.0\n{head}"], b""
    for name, (properties, rows) in elements.items():
        said.append(f"element {name} {len(rows)}\n" + "".join(f"property {p}\n" for p in properties))
        for row in rows:
            for p, value in zip(properties, row, strict=True):
                body += _value(order, p.split(), value)
            body += b"\n" if order == "ascii" else b""
    data = ("".join(said) + "end_header\n").encode() + body

    def write(folder: Path) -> Path:
        picture(folder)
        picture(folder, "there.png", HALF_THERE)
        (folder / "a.ply").write_bytes(data if cut is None else data[:cut])
        return folder / "a.ply"

    return write


def _value(order: str, words: list[str], value) -> bytes:
    values = [len(value), *value] if words[0] == "list" else [value]
    kinds = [words[1], *[words[2]] * len(value)] if words[0] == "list" else [words[0]]
    if order == "ascii":
        return b"".join(f"{v} ".encode() for v in values)
    return b"".join(struct.pack(order + CODES[kind], v) for kind, v in zip(kinds, values, strict=True))


XYZ = ["float x", "float y", "float z"]
FACE = ["list uchar int vertex_indices"]
RGB = ["uchar red", "uchar green", "uchar blue"]


def mesh(places, faces, more=(), each=(), face=FACE, face_each=None, xyz=XYZ) -> dict:
    """Elements of a mesh; `more` properties of its vertices with values `each`."""
    each = each if len(each) else [()] * len(places)
    rows = [(*map(float, p), *e) for p, e in zip(places, each, strict=True)]
    extra = face_each or [()] * len(faces)
    return {
        "vertex": ([*xyz, *more], rows),
        "face": (face, [(list(map(int, f)), *e) for f, e in zip(faces, extra, strict=True)]),
    }


corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
three = [(188, 0, 0), (0, 255, 0), (0, 0, 255)]
seen = {(0, 0, 0): (MIDDLE, 0, 0), (1, 0, 0): GREEN, (0.5, 0.5, 0): (0, 0.5, 0.5)}
PICTURED = {(0.25, 0.25, 0): BLUE, (0.75, 0.25, 0): LIGHT, (0.25, 0.75, 0): RED, (0.75, 0.75, 0): GREEN}
named = "comment TextureFile picture.png\n"
plain = (
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
)
uv_rows = [tuple(map(float, row)) for row in SQUARE_UV]
flat_square = [[0, 1, 2, 3]]

PLY = [
    Case("text", ply("ascii", mesh(CUBE, TRIANGLES)), **whole_cube),
    Case("little endian", ply("<", mesh(CUBE, TRIANGLES)), **whole_cube),
    Case("big endian", ply(">", mesh(CUBE, TRIANGLES)), **whole_cube),
    Case("squares", ply("<", mesh(CUBE, QUADS)), **whole_cube),
    Case("squares and triangles, big endian", ply(">", mesh(CUBE, [*TRIANGLES[10:], *QUADS[:5]])), **whole_cube),
    Case("squares and triangles, text", ply("ascii", mesh(CUBE, [*QUADS[:5], *TRIANGLES[10:]])), **whole_cube),
    Case(
        "doubles and other integers",
        ply("<", mesh(CUBE, TRIANGLES, xyz=["double x", "double y", "double z"], face=["list int uint vertex_index"])),
        **whole_cube,
    ),
    Case(
        "a header that ends in CR LF",
        text(
            "a.ply",
            plain.replace("\n", "\r\n"),
        ),
        area=0.5,
        says=(MADE,),
    ),
    Case(
        "a header with a comment that is none",
        text("a.ply", plain.replace("element face", "made by X, file:\nelement face")),
        area=0.5,
        says=(MADE,),
    ),
    Case(
        "a concave polygon",
        ply("<", mesh([(1, 0.5, 0), (0, 2, 0), (0, 0, 0), (2, 0, 0), (2, 2, 0)], [[1, 2, 3, 4, 0]])),
        area=2.5,
        normals=(0, 0, 1),
        says=(MADE,),
    ),
    Case(
        "other elements",
        ply("<", {**mesh(CUBE, TRIANGLES), "edge": (["int vertex1", "int vertex2"], [(0, 1)])}),
        **{**whole_cube, "says": (MADE, "'edge' are left out")},
    ),
    Case(
        "properties that nobody knows",
        ply(">", mesh(CUBE, TRIANGLES, ["float quality"], [(0.5,)] * 8, [*FACE, "uchar flags"], [(3,)] * 12)),
        **whole_cube,
    ),
    Case(
        "a strip",
        ply(
            "<",
            {
                "vertex": (XYZ, [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (5, 0, 0), (6, 0, 0), (5, 1, 0)]),
                "tristrips": (["list int int vertex_indices"], [([0, 1, 2, 3, -1, 4, 5, 6],)]),
            },
        ),
        faces=3,
        area=1.5,
        normals=(0, 0, 1),
        says=(MADE,),
    ),
    Case(
        "its own normals",
        ply("<", mesh(BALL, BALL_FACES, ["float nx", "float ny", "float nz"], [tuple(map(float, n)) for n in BALL])),
        normals="radial",
        area=BALL_AREA,
        volume=BALL_VOLUME,
        closed=True,
    ),
    Case(
        "its own tilted normals",
        ply("ascii", mesh(corners, [[0, 1, 2]], ["float nx", "float ny", "float nz"], [(0.0, 0.56, 1.92)] * 3)),
        normals=(0, 0.28, 0.96),
    ),
    Case(
        "every triangle for itself",
        ply("<", mesh(BALL[BALL_FACES].reshape(-1, 3), np.arange(BALL_FACES.size).reshape(-1, 3))),
        normals="radial",
        area=BALL_AREA,
        closed=True,
        says=(MADE,),
    ),
    Case(
        "colours of vertices",
        ply("<", mesh(corners, [[0, 1, 2]], RGB, three)),
        parts={"": (1, 1, 1)},
        colours=seen,
        says=(MADE,),
    ),
    Case(
        "colours of vertices with alpha, text",
        ply("ascii", mesh(corners, [[0, 1, 2]], [*RGB, "uchar alpha"], [(*c, 9) for c in three])),
        colours=seen,
        says=(MADE, "transparency"),
    ),
    Case(
        "colours in floating point",
        ply(
            ">",
            mesh(
                corners,
                [[0, 1, 2]],
                ["float red", "float green", "float blue"],
                [(0.25, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)],
            ),
        ),
        colours={**seen, (0, 0, 0): (0.25, 0, 0)},
        says=(MADE,),
    ),
    Case(
        "colours of 16 bits",
        ply(
            "<",
            mesh(corners, [[0, 1, 2]], [c.replace("uchar", "ushort") for c in RGB], [tuple(257 * x for x in c) for c in three]),
        ),
        colours=seen,
        says=(MADE,),
    ),
    Case(
        "colours in floating point up to 255",
        ply(">", mesh(corners, [[0, 1, 2]], ["float red", "float green", "float blue"], [tuple(map(float, c)) for c in three])),
        colours=seen,
        says=(MADE, "up to 255"),
    ),
    Case(
        "colours of faces with alpha",
        ply(
            "<",
            mesh(
                SQUARE,
                [[0, 1, 2], [0, 2, 3]],
                face=[*FACE, *RGB, "uchar alpha"],
                face_each=[(255, 0, 0, 255), (0, 0, 188, 255)],
            ),
        ),
        colours={(0.9, 0.1, 0): RED, (0.1, 0.9, 0): (0, 0, MIDDLE)},
        says=(MADE, "transparency"),
    ),
    Case(
        "a picture, the same way up as in an OBJ",
        ply("<", mesh(SQUARE, flat_square, ["float s", "float t"], uv_rows), named),
        colours=PICTURED,
        says=(MADE,),
    ),
    Case(
        "a picture by coordinates of corners",
        ply(
            "<",
            mesh(
                SQUARE,
                [[0, 1, 2], [0, 2, 3]],
                face=[*FACE, "list uchar float texcoord"],
                face_each=[(list(SQUARE_UV[[0, 1, 2]].reshape(-1)),), (list(SQUARE_UV[[0, 2, 3]].reshape(-1)),)],
            ),
            named,
        ),
        colours=PICTURED,
        says=(MADE,),
    ),
    Case(
        "holes of a picture with alpha",
        ply("<", mesh(SQUARE, flat_square, ["float u", "float v"], uv_rows), "comment TextureFile there.png\n"),
        area=0.5,
        box=((0, 0, 0), (0.5, 1, 0)),
        colours={(0.25, 0.25, 0): BLUE, (0.25, 0.75, 0): RED},
        says=(MADE, "shown as cut-outs.*: 1"),
    ),
    Case(
        "two pictures",
        ply(
            "ascii",
            mesh(SQUARE, [[0, 1, 2], [0, 2, 3]], ["float u", "float v"], uv_rows, [*FACE, "int texnumber"], [(0,), (1,)]),
            named + "comment TextureFile gone.png\n",
        ),
        parts={"picture": (1, 1, 1), "gone": GREY},
        colours={(0.75, 0.25, 0): LIGHT, (0.25, 0.75, 0): GREY},
        says=(MADE, "gone.png is missing"),
    ),
    Case("points alone", ply("<", {"vertex": (XYZ, corners)}), refused="no faces, and 3 points"),
    Case("points and no faces", ply("<", mesh(corners, [])), refused="no faces, and 3 points"),
    Case("a vertex that is not there", ply("<", mesh(corners, [[0, 1, 9]])), refused="a face names vertex 9"),
    Case("a vertex before the first", ply("<", mesh(corners, [[0, 1, -1]])), refused="a face names vertex -1"),
    Case("cut off, binary", ply("<", mesh(CUBE, TRIANGLES), cut=-20), refused="ends within its 12 elements 'face'"),
    Case("cut off, text", ply("ascii", mesh(CUBE, TRIANGLES), cut=-20), refused="ends within its 12 elements 'face'"),
    Case(
        "cut off, mixed",
        ply("<", mesh(CUBE, [*QUADS[:5], *TRIANGLES[10:]]), cut=-20),
        refused="ends within its 7 elements 'face'",
    ),
    Case("no PLY", text("a.ply", "this is no mesh"), refused="does not begin as a PLY file"),
    Case("no x", ply("<", {"vertex": (["float y"], [(0.0,)])}), refused="no vertices with x, y and z"),
    Case(
        "a word for a number",
        text("a.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n0,5\n"),
        refused="a word where a number is due",
    ),
    Case(
        "a type that there is not",
        text("a.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty real x\nend_header\n0\n"),
        refused="its header says 'property real x'",
    ),
]


def stl(
    triangles: np.ndarray, head: bytes = b"", normals=None, attribute: int = 0, cut: int | None = None
) -> Callable[[Path], Path]:
    normals = np.zeros((len(triangles), 3)) if normals is None else normals
    body = b"".join(struct.pack("<12fH", *n, *t.reshape(-1), attribute) for n, t in zip(normals, triangles, strict=True))
    data = head.ljust(80) + struct.pack("<I", len(triangles)) + body

    def write(folder: Path) -> Path:
        (folder / "a.stl").write_bytes(data if cut is None else data[:cut])
        return folder / "a.stl"

    return write


def solid(triangles: np.ndarray, name: str = "a facet thing", normal: str = "0 0 0") -> str:
    facets = (
        f"  facet normal {normal}\n    outer loop\n"
        + "".join(f"      vertex {x} {y} {z}\n" for x, y, z in t)
        + "    endloop\n  endfacet\n"
        for t in triangles
    )
    return f"solid {name}\n{''.join(facets)}endsolid {name}\n"


cube = CUBE[TRIANGLES]
STL = [
    Case("STL, text", text("a.stl", solid(cube)), **whole_cube, faces=12),
    Case("STL, text in capitals", text("a.stl", solid(cube).upper()), **whole_cube, faces=12),
    Case("STL, text with exponents", text("a.stl", solid(cube).replace("1.0", "1.000000e+00")), **whole_cube, faces=12),
    Case("STL, binary", stl(cube, b"made by hand"), **whole_cube, faces=12),
    Case("STL, binary that begins as a text", stl(cube, b"solid facet"), **whole_cube, faces=12),
    Case("STL, a ball", stl(BALL[BALL_FACES]), normals="radial", closed=True, faces=320, says=(MADE,)),
    Case("STL, two solids", text("a.stl", solid(cube[:6]) + solid(cube[6:])), **{**whole_cube, "says": (MADE, "2 solids")}),
    Case(
        "STL, normals the other way",
        stl(cube, normals=np.cross(cube[:, 2] - cube[:, 0], cube[:, 1] - cube[:, 0])),
        **{**whole_cube, "says": (MADE, "against the order.*: 12")},
    ),
    Case("STL, colours", stl(cube, attribute=0x8FFF), **{**whole_cube, "says": (MADE, "colours of facets")}),
    Case("STL, more behind it", lambda folder: _longer(stl(cube)(folder)), **{**whole_cube, "says": (MADE, "5 bytes behind")}),
    Case("STL, cut off, binary", stl(cube, cut=-20), refused="ends within its 12 facets"),
    Case("STL, cut off, text", text("a.stl", solid(cube)[:-60]), refused="ends within facet 12"),
    Case(
        "STL, a facet of four corners",
        text("a.stl", solid(np.concatenate([cube[:1], cube[:1, :1]], axis=1))),
        refused="facet 1 has 4 corners",
    ),
    Case("STL, empty", text("a.stl", ""), refused="no STL file"),
    Case("STL, no facets", stl(cube[:0]), refused="no faces"),
    Case("STL, a place that is no number", stl(cube[:1] * np.nan), refused="vertex 0, .*finite"),
]


def _longer(path: Path) -> Path:
    path.write_bytes(path.read_bytes() + b"12345")
    return path


CASES = [*PLY, *STL]
