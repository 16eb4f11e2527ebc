"""Writes glTF 2.0 files of arrays: as GLB, as JSON with a file of numbers beside it, or with these in an address."""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

COMPONENTS = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


class Gltf:
    """A document that grows; `json` is what is written, and may be changed by hand."""

    def __init__(self) -> None:
        self.json: dict[str, Any] = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}]}
        self.bytes = b""

    def add(self, kind: str, thing: dict[str, Any]) -> int:
        self.json.setdefault(kind, []).append(thing)
        return len(self.json[kind]) - 1

    def view(self, data: bytes, **more: Any) -> int:
        self.bytes += b"\0" * (-len(self.bytes) % 4)
        self.bytes += data
        return self.add(
            "bufferViews", {"buffer": 0, "byteOffset": len(self.bytes) - len(data), "byteLength": len(data), **more}
        )

    def numbers(self, values: Any, kind: str = "float32", bounds: bool = False, pad: int = 0, **more: Any) -> int:
        """An accessor; `pad` bytes behind every row."""
        values = np.asarray(values, kind)
        values = values.reshape(len(values), -1)
        rows = b"".join(row.tobytes() + b"\x7f" * pad for row in values)
        stride = {"byteStride": values.itemsize * values.shape[1] + pad} if pad else {}
        said = {"bufferView": self.view(rows, **stride), "componentType": COMPONENTS[kind], "count": len(values)}
        if bounds:
            said |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        return self.add("accessors", {**said, "type": TYPES[values.shape[1]], **more})

    def primitive(self, places: Any, faces: Any = None, **attributes: Any) -> dict[str, Any]:
        """A primitive of triangles; attributes are arrays, or numbers of accessors."""
        given = {name: value if isinstance(value, int) else self.numbers(value) for name, value in attributes.items()}
        place = places if isinstance(places, int) else self.numbers(places, bounds=True)
        indices = {} if faces is None else {"indices": self.numbers(np.asarray(faces).reshape(-1), "uint16")}
        return {"attributes": {"POSITION": place, **given}, **indices}

    def mesh(self, *primitives: dict[str, Any], **more: Any) -> int:
        return self.add("meshes", {"primitives": list(primitives), **more})

    def node(self, mesh: int | None = None, root: bool = True, **more: Any) -> int:
        index = self.add("nodes", {**({} if mesh is None else {"mesh": mesh}), **more})
        if root:
            self.json["scenes"][0]["nodes"].append(index)
        return index

    def material(self, colour: Any = None, texture: dict[str, Any] | None = None, name: str = "m", **more: Any) -> int:
        plain = {} if colour is None else {"baseColorFactor": [*colour, 1]}
        plain |= {} if texture is None else {"baseColorTexture": texture}
        return self.add("materials", {"name": name, "pbrMetallicRoughness": plain, **more})

    def texture(self, image: bytes | str, **sampler: Any) -> int:
        """A texture of a picture's bytes, or of an address."""
        source = {"uri": image} if isinstance(image, str) else {"bufferView": self.view(image), "mimeType": "image/png"}
        sampled = {"sampler": self.add("samplers", sampler)} if sampler else {}
        return self.add("textures", {"source": self.add("images", source), **sampled})

    def write(self, folder: Path, how: str = "glb") -> Path:
        """`how`: glb, beside or data."""
        buffer: dict[str, Any] = {"byteLength": len(self.bytes)}
        if how == "beside":
            (folder / "some numbers.bin").write_bytes(self.bytes)
            buffer["uri"] = "some%20numbers.bin"
        elif how == "data":
            buffer["uri"] = "data:application/octet-stream;base64," + base64.b64encode(self.bytes).decode()
        said = {"buffers": [buffer], **self.json} if self.bytes else self.json
        if how != "glb":
            (folder / "a.gltf").write_text(json.dumps(said))
            return folder / "a.gltf"
        text = json.dumps(said).encode()
        text += b" " * (-len(text) % 4)
        body = self.bytes + b"\0" * (-len(self.bytes) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(body), b"BIN\0") + body
        (folder / "a.glb").write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
        return folder / "a.glb"
