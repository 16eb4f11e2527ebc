"""The files that the gallery's scenes are made of: `python make.py [FOLDER]` writes them anew, the same to the last byte.

    room.glb                        a room: bricks and planks as pictures, a table, a lamp, a round mirror that bulges
    carousel.gltf                   a carousel that turns and its riders, which rise and fall; a light, and a camera on a boom
    yard.obj, yard.mtl, paving.png  a paved yard in centimetres, y up, with a lantern
    ball.ply                        a ball of radius 1, which is a mirror in the yard

Coordinates are rounded, pictures are whole numbers and are not packed: nothing depends on the machine.
"""

from __future__ import annotations

import base64
import json
import struct
import sys
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

DIGITS = 6  # of coordinates
TILE = 64  # pixels along a picture


@dataclass(frozen=True)
class Shape:
    """Triangles, counter-clockwise from outside: places and normals [V, 3], coordinates of a picture with v down [V, 2], faces
    [F, 3]."""

    places: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray
    faces: np.ndarray

    def moved(self, x: float, y: float, z: float) -> Shape:
        return Shape(np.add(self.places, (x, y, z)), self.normals, self.uvs, self.faces)


def together(shapes: Sequence[Shape]) -> Shape:
    starts = np.cumsum([0, *(len(shape.places) for shape in shapes)])
    faces = [shape.faces + start for shape, start in zip(shapes, starts, strict=False)]
    rows = ([getattr(shape, name) for shape in shapes] for name in ("places", "normals", "uvs"))
    places, normals, uvs = (np.concatenate(each) for each in rows)
    return Shape(places, normals, uvs, np.concatenate(faces))


def quad(places: Sequence[Sequence[float]], repeat: tuple[float, float] = (1, 1)) -> Shape:
    """A flat piece by its four corners, from the lower left one on; `repeat` is how often a picture is on it."""
    p = np.array(places, float)
    upright = np.cross(p[2] - p[0], p[3] - p[1])
    u, v = repeat
    uvs = np.array([(0, v), (u, v), (u, 0), (0, 0)], float)
    faces = [f for f in ((0, 1, 2), (0, 2, 3)) if len({tuple(p[k]) for k in f}) == 3]
    return Shape(p, np.tile(upright / np.linalg.norm(upright), (4, 1)), uvs, np.array(faces))


def panel(corner: Sequence[float], along: Sequence[float], up: Sequence[float], tile: float = 1.0) -> Shape:
    """A rectangle, from its lower left corner as it is looked at; a picture is `tile` long on it."""
    c, a, b = (np.array(v, float) for v in (corner, along, up))
    repeat = float(np.linalg.norm(a)) / tile, float(np.linalg.norm(b)) / tile
    return quad([p.tolist() for p in (c, c + a, c + a + b, c + b)], repeat)


def box(low: Sequence[float], high: Sequence[float]) -> Shape:
    (x, y, z), (X, Y, Z) = low, high
    w, h, d = X - x, Y - y, Z - z
    return together(
        [
            panel((x, y, Z), (w, 0, 0), (0, h, 0)),
            panel((X, y, z), (-w, 0, 0), (0, h, 0)),
            panel((X, y, Z), (0, 0, -d), (0, h, 0)),
            panel((x, y, z), (0, 0, d), (0, h, 0)),
            panel((x, Y, Z), (w, 0, 0), (0, 0, -d)),
            panel((x, y, z), (w, 0, 0), (0, 0, d)),
        ]
    )


def turned(profile: Sequence[tuple[float, float]], sides: int = 16) -> Shape:
    """A profile (radius, height), from below on the outside, turned about y, in flat pieces."""

    def at(radius: float, height: float, side: int) -> tuple[float, float, float]:
        angle = 2 * np.pi * (side % sides) / sides
        return round(radius * np.cos(angle), DIGITS) + 0.0, height, round(-radius * np.sin(angle), DIGITS) + 0.0

    pieces = []
    for (r, low), (s, high) in pairwise(profile):
        pieces += [quad([at(r, low, k), at(r, low, k + 1), at(s, high, k + 1), at(s, high, k)]) for k in range(sides)]
    return together(pieces)


def cap(radius: float, half_deg: float, rings: int = 12, sides: int = 36) -> Shape:
    """The part of a ball around +z that is seen from its middle within an angle, its edge at z = 0."""
    theta = np.radians(half_deg) * np.repeat(np.arange(1, rings + 1), sides) / rings
    phi = np.tile(2 * np.pi * np.arange(sides) / sides, rings)
    around = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1)
    normals = np.concatenate([[[0.0, 0.0, 1.0]], around])
    places = radius * (normals - [0, 0, np.cos(np.radians(half_deg))])
    side, after = np.arange(sides), (np.arange(sides) + 1) % sides
    faces = [np.stack([0 * side, 1 + side, 1 + after], axis=1)]
    for ring in range(rings - 1):
        i, o = 1 + ring * sides, 1 + (ring + 1) * sides
        faces += [np.stack([i + side, o + side, o + after], axis=1), np.stack([i + side, o + after, i + after], axis=1)]
    return Shape(places, normals, np.zeros((len(places), 2)), np.concatenate(faces))


def ball(radius: float, times: int = 3) -> Shape:
    """An icosahedron, its triangles cut into four so often."""
    g = (1 + 5**0.5) / 2
    places = [(a, b, 0.0) for a in (-1.0, 1.0) for b in (-g, g)]
    places = [*places, *((0.0, a, b) for a, b, _ in places), *((b, 0.0, a) for a, b, _ in places)]
    points = [np.array(p) / np.linalg.norm(p) for p in places]
    size = min(float(np.linalg.norm(points[0] - p)) for p in points[1:]) * 1.01
    faces = [
        (a, b, c) if np.dot(np.cross(points[a], points[b]), points[c]) > 0 else (a, c, b)
        for a in range(12)
        for b in range(a)
        for c in range(b)
        if all(np.linalg.norm(points[i] - points[j]) < size for i, j in ((a, b), (b, c), (c, a)))
    ]
    for _ in range(times):
        middles: dict[tuple[int, int], int] = {}

        def middle(a: int, b: int, middles: dict[tuple[int, int], int] = middles) -> int:
            key = (min(a, b), max(a, b))
            if key not in middles:
                middles[key] = len(points)
                points.append((points[a] + points[b]) / np.linalg.norm(points[a] + points[b]))
            return middles[key]

        halves = [(f, (middle(f[0], f[1]), middle(f[1], f[2]), middle(f[2], f[0]))) for f in faces]
        faces = [t for (a, b, c), (i, j, k) in halves for t in ((a, i, k), (i, b, j), (k, j, c), (i, j, k))]
    normals = np.array(points)
    return Shape(radius * normals, normals, np.zeros((len(normals), 2)), np.array(faces))


# Pictures


def tiles(rows: int, columns: int, colour: Sequence[int], joint: Sequence[int], *, shift: bool) -> np.ndarray:
    """Bricks, planks or stones and their joints, uint8 [TILE, TILE, 3]; every other row is shifted by half."""
    y, x = np.mgrid[0:TILE, 0:TILE]
    row = y * rows // TILE
    x = (x + np.where(shift & (row % 2 == 1), TILE // (2 * columns), 0)) % TILE
    column = x * columns // TILE
    shade = (row * 73 + column * 151 + row * column * 31) % 17 - 8
    grain = (x * 7 + y * 13 + x * y) % 5 - 2
    out = np.array(colour) + 4 * shade[..., None] + 2 * grain[..., None]
    seam = (y % (TILE // rows) == 0) | (x % (TILE // columns) == 0)
    return np.where(seam[..., None], np.array(joint), out).clip(0, 255).astype(np.uint8)


def png(pixels: np.ndarray) -> bytes:
    """A picture, uint8 [H, W, 3], as a file, its bytes as they are."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows = b"".join(b"\0" + row.tobytes() for row in pixels)
    blocks = [rows[k : k + 65535] for k in range(0, len(rows), 65535)]
    body = b"\x78\x01"
    for k, block in enumerate(blocks, 1):
        body += struct.pack("<BHH", k == len(blocks), len(block), 0xFFFF ^ len(block)) + block
    head = struct.pack(">IIBBBBB", pixels.shape[1], pixels.shape[0], 8, 2, 0, 0, 0)
    packed = body + struct.pack(">I", zlib.adler32(rows))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", packed) + chunk(b"IEND", b"")


BRICKS = tiles(8, 4, (150, 84, 66), (176, 168, 156), shift=True)
PLANKS = tiles(8, 1, (150, 112, 74), (78, 54, 34), shift=False)
PAVING = tiles(4, 4, (138, 136, 130), (84, 82, 78), shift=True)


# glTF


class Gltf:
    """A document that grows."""

    def __init__(self) -> None:
        self.json: dict[str, Any] = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}]}
        self.bytes = b""

    def add(self, kind: str, thing: dict[str, Any]) -> int:
        self.json.setdefault(kind, []).append(thing)
        return len(self.json[kind]) - 1

    def view(self, data: bytes) -> int:
        self.bytes += b"\0" * (-len(self.bytes) % 4)
        start, self.bytes = len(self.bytes), self.bytes + data
        return self.add("bufferViews", {"buffer": 0, "byteOffset": start, "byteLength": len(data)})

    def numbers(self, values: Any, kind: str = "<f4", *, bounds: bool = False) -> int:
        rows = np.asarray(values, float)
        rows = (np.round(rows, DIGITS) + 0.0).reshape(len(rows), -1).astype(kind)
        width = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}[rows.shape[1]]
        said = {"bufferView": self.view(rows.tobytes()), "componentType": {"<f4": 5126, "<u2": 5123}[kind]}
        limits = {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()} if bounds else {}
        return self.add("accessors", {**said, "count": len(rows), "type": width, **limits})

    def material(self, name: str, colour: Sequence[float] = (1, 1, 1), picture: np.ndarray | None = None, **more: Any) -> int:
        plain: dict[str, Any] = {"baseColorFactor": [*colour, 1], "metallicFactor": 0}
        if picture is not None:
            image = self.add("images", {"bufferView": self.view(png(picture)), "mimeType": "image/png"})
            plain["baseColorTexture"] = {"index": self.add("textures", {"source": image})}
        return self.add("materials", {"name": name, "pbrMetallicRoughness": plain, **more})

    def lamp(self, name: str, colour: Sequence[float], strength: float) -> int:
        strong = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
        return self.material(name, (0, 0, 0), emissiveFactor=list(colour), extensions=strong)

    def mesh(self, *pieces: tuple[int, Shape]) -> int:
        """A mesh of materials and their shapes; coordinates are written where the material has a picture."""
        primitives = []
        for material, shape in pieces:
            attributes = {"POSITION": self.numbers(shape.places, bounds=True), "NORMAL": self.numbers(shape.normals)}
            if "baseColorTexture" in self.json["materials"][material]["pbrMetallicRoughness"]:
                attributes["TEXCOORD_0"] = self.numbers(shape.uvs)
            indices = self.numbers(shape.faces.reshape(-1), "<u2")
            primitives.append({"attributes": attributes, "indices": indices, "material": material})
        return self.add("meshes", {"primitives": primitives})

    def node(self, name: str, mesh: int | None = None, *, root: bool = True, **more: Any) -> int:
        index = self.add("nodes", {"name": name, **({} if mesh is None else {"mesh": mesh}), **more})
        if root:
            self.json["scenes"][0]["nodes"].append(index)
        return index

    def channel(self, node: int, path: str, times: Sequence[float], values: Any, how: str = "LINEAR") -> None:
        """One more of the first animation."""
        (animation,) = self.json.setdefault("animations", [{"name": "ride", "channels": [], "samplers": []}])
        sampler = {"input": self.numbers(times, bounds=True), "output": self.numbers(values), "interpolation": how}
        animation["channels"].append({"sampler": len(animation["samplers"]), "target": {"node": node, "path": path}})
        animation["samplers"].append(sampler)

    def glb(self) -> bytes:
        text = json.dumps({"buffers": [{"byteLength": len(self.bytes)}], **self.json}, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        body = self.bytes + b"\0" * (-len(self.bytes) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(body), b"BIN\0") + body
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks

    def gltf(self) -> bytes:
        address = "data:application/octet-stream;base64," + base64.b64encode(self.bytes).decode()
        buffer = {"byteLength": len(self.bytes), "uri": address}
        return (json.dumps({"buffers": [buffer], **self.json}, indent=1) + "\n").encode()


def room() -> bytes:
    """6 x 2.8 x 5 metres, around the middle of its floor; the mirror hangs on the wall at the back, -z."""
    g = Gltf()
    bricks, planks = g.material("bricks", picture=BRICKS), g.material("planks", picture=PLANKS)
    plaster, wood = g.material("plaster", (0.8, 0.78, 0.72)), g.material("wood", (0.35, 0.2, 0.1))
    glaze, paper = g.material("glaze", (0.1, 0.25, 0.6)), g.material("paper", (0.7, 0.12, 0.1))
    lamp, mirror = g.lamp("lamp", (1, 0.94, 0.82), 12), g.material("mirror")
    walls = [
        panel((-3, 0, -2.5), (6, 0, 0), (0, 2.8, 0)),
        panel((3, 0, 2.5), (-6, 0, 0), (0, 2.8, 0)),
        panel((-3, 0, 2.5), (0, 0, -5), (0, 2.8, 0)),
        panel((3, 0, -2.5), (0, 0, 5), (0, 2.8, 0)),
    ]
    floor, ceiling = panel((-3, 0, 2.5), (6, 0, 0), (0, 0, -5)), panel((-3, 2.8, -2.5), (6, 0, 0), (0, 0, 5))
    g.node("walls", g.mesh((bricks, together(walls)), (planks, floor), (plaster, ceiling)))
    g.node("lamp", g.mesh((lamp, box((-0.7, 2.72, -0.4), (0.7, 2.76, 0.4)))))
    legs = [box((x, 0, z), (x + 0.06, 0.7, z + 0.06)) for x in (-0.66, 0.6) for z in (-0.31, 0.25)]
    g.node("table", g.mesh((wood, together([box((-0.7, 0.7, -0.35), (0.7, 0.75, 0.35)), *legs]))), translation=[-0.9, 0, -0.9])
    vase = turned([(0, 0), (0.06, 0), (0.13, 0.1), (0.11, 0.2), (0.05, 0.28), (0.07, 0.34)])
    g.node("vase", g.mesh((glaze, vase)), translation=[-1.2, 0.75, -0.9])
    g.node("book", g.mesh((paper, box((0, 0, 0), (0.3, 0.05, 0.2)))), translation=[-0.75, 0.75, -1.0])
    g.node("cupboard", g.mesh((wood, box((1.8, 0, -0.5), (2.6, 1.9, 0.1)))))
    frame = turned([(0.7, 0), (0.68, 0.08), (0.62, 0.08), (0.6, 0.02)], 36)  # about y, and turned to look along z by its node
    half = round(0.5**0.5, 7)
    rim = g.node("frame", g.mesh((wood, frame)), root=False, rotation=[half, 0, 0, half])
    glass = g.node("glass", g.mesh((mirror, cap(1.2, 30))), root=False, translation=[0, 0, 0.03])
    g.node("round mirror", children=[rim, glass], translation=[0.3, 1.5, -2.5])
    g.json["extensionsUsed"] = ["KHR_materials_emissive_strength"]
    return g.glb()


def about_y(degrees: float) -> list[float]:
    half = np.radians(degrees) / 2
    return [0.0, round(float(np.sin(half)), 7), 0.0, round(float(np.cos(half)), 7)]


def carousel() -> bytes:
    """A carousel around a ball that stands still. All moves in four seconds, "ride"."""
    g = Gltf()
    grass, wood = g.material("grass", (0.16, 0.32, 0.1)), g.material("wood", (0.5, 0.3, 0.15))
    red, gold = g.material("red", (0.7, 0.1, 0.08)), g.material("gold", (0.8, 0.6, 0.15))
    chrome, colours = g.material("chrome"), [(0.1, 0.3, 0.7), (0.75, 0.55, 0.1), (0.6, 0.1, 0.5)]
    g.node("ground", g.mesh((grass, turned([(5, 0), (0, 0)], 24))))
    g.node("ball", g.mesh((chrome, ball(0.6))), translation=[0, 1.1, 0])
    g.node("foot", g.mesh((gold, turned([(0.3, 0.3), (0.2, 0.48), (0, 0.48)]))))

    riders, pole = [], g.mesh((gold, box((1.23, 0.3, -0.02), (1.27, 1.95, 0.02))))
    for k, colour in enumerate(colours):
        coat = g.material(f"coat {k}", colour)
        body = together([box((-0.3, 0, -0.1), (0.3, 0.3, 0.1)), box((0.2, 0.25, -0.07), (0.38, 0.6, 0.07))])
        legs = together([box((x, -0.35, z), (x + 0.08, 0, z + 0.06)) for x in (-0.3, 0.22) for z in (-0.1, 0.04)])
        low, high, still = [1.25, 0.75, 0], [1.25, 1.15, 0], [0, 0, 0]
        keys = [low, high, low] if k % 2 == 0 else [high, low, high]
        hung = {"translation": keys[0], "rotation": about_y(90.0)}
        horse = g.node(f"horse {k}", g.mesh((coat, body), (wood, legs)), root=False, **hung)
        g.channel(horse, "translation", [0, 2, 4], [row for key in keys for row in (still, key, still)], "CUBICSPLINE")
        riders.append(g.node(f"arm {k}", pole, root=False, rotation=about_y(120.0 * k), children=[horse]))
    floor = g.node("floor", g.mesh((red, turned([(1.8, 0.1), (1.8, 0.3), (0, 0.3)], 24))), root=False)
    roof = g.node("roof", g.mesh((red, turned([(0, 1.95), (1.8, 1.95), (0, 2.6)], 12))), root=False)
    wheel = g.node("carousel", children=[floor, roof, *riders])
    g.channel(wheel, "rotation", [0, 1, 2, 3, 4], [about_y(75.0 * k) for k in range(5)])

    board, post = box((-0.4, 1.2, -0.03), (0.4, 1.6, 0.03)), box((-0.04, 0, -0.04), (0.04, 1.2, 0.04))
    sign = g.node("sign", g.mesh((gold, board), (wood, post)), translation=[2.3, 0, 0.6])
    g.channel(sign, "rotation", [0, 1.5, 3], [about_y(20), about_y(-50), about_y(70)], "STEP")

    lens = g.add("cameras", {"type": "perspective", "perspective": {"yfov": 0.6, "znear": 0.1}})
    tilt = np.radians(-10.0) / 2
    down = [round(float(np.sin(tilt)), 7), 0.0, 0.0, round(float(np.cos(tilt)), 7)]
    camera = g.node("camera", root=False, camera=lens, translation=[0, 2.1, 6.4], rotation=down)
    boom = g.node("boom", children=[camera])
    g.channel(boom, "rotation", [0, 4], [about_y(-15), about_y(15)])

    light = {"type": "point", "color": [1, 0.9, 0.7], "intensity": 30}
    g.json["extensions"] = {"KHR_lights_punctual": {"lights": [light]}}
    g.node("lantern", translation=[2.5, 4, 2.5], extensions={"KHR_lights_punctual": {"light": 0}})
    g.json["extensionsUsed"] = ["KHR_lights_punctual"]
    return g.gltf()


def yard() -> dict[str, bytes]:
    """In centimetres, y up: paving, two walls, a bench, a tree, a lantern on the wall."""
    things = {
        ("ground", "paving"): panel((-400, 0, 400), (800, 0, 0), (0, 0, -800), 200),
        ("walls", "render"): together([box((-400, 0, -320), (400, 190, -300)), box((-400, 0, -300), (-380, 190, 400))]),
        ("bench", "timber"): together(
            [box((60, 42, -280), (260, 50, -220)), box((80, 0, -270), (90, 42, -230)), box((230, 0, -270), (240, 42, -230))]
        ),
        ("trunk", "timber"): turned([(16, 0), (12, 130)], 10).moved(-230, 0, -150),
        ("crown", "leaves"): turned([(0, 100), (95, 110), (0, 330)], 14).moved(-230, 0, -150),
        ("lantern", "light"): box((-20, 130, -300), (20, 170, -285)),
    }
    lines, places, uvs, normals = ["# A yard in centimetres, y up.", "mtllib yard.mtl"], 1, 1, 1
    for (name, material), shape in things.items():
        lines += [f"o {name}", f"usemtl {material}"]
        for word, rows in (("v", shape.places), ("vt", shape.uvs * [1, -1] + [0, 1]), ("vn", shape.normals)):
            lines += [" ".join([word, *(f"{value:g}" for value in np.round(row, DIGITS) + 0.0)]) for row in rows]
        lines += ["f " + " ".join(f"{places + k}/{uvs + k}/{normals + k}" for k in face) for face in shape.faces.tolist()]
        places, uvs, normals = (start + len(shape.places) for start in (places, uvs, normals))
    looks = {
        "paving": "Kd 1 1 1\nmap_Kd paving.png",
        "render": "Kd 0.72 0.62 0.45",
        "timber": "Kd 0.3 0.19 0.1",
        "leaves": "Kd 0.12 0.3 0.08",
        "light": "Kd 0 0 0\nKe 8 6 3.5",
    }
    library = "\n\n".join(f"newmtl {name}\n{look}" for name, look in looks.items()) + "\n"
    return {"yard.obj": ("\n".join(lines) + "\n").encode(), "yard.mtl": library.encode(), "paving.png": png(PAVING)}


def ply(shape: Shape) -> bytes:
    """A file of places, normals and triangles."""
    names = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(shape.places)}\n{names}"
    head += f"element face {len(shape.faces)}\nproperty list uchar ushort vertex_indices\nend_header\n"
    rows = (np.round(np.concatenate([shape.places, shape.normals], axis=1), DIGITS) + 0.0).astype("<f4")
    faces = b"".join(struct.pack("<BHHH", 3, *face) for face in shape.faces.tolist())
    return head.encode() + rows.tobytes() + faces


def files() -> dict[str, bytes]:
    return {"room.glb": room(), "carousel.gltf": carousel(), **yard(), "ball.ply": ply(ball(1.0))}


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    for name, data in files().items():
        (folder / name).write_bytes(data)
        print(f"{folder / name}: {len(data):,} bytes")
