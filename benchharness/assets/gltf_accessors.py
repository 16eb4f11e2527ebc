"""The numbers of a glTF 2.0 file: its buffers, and accessors that read them (specification, sections 3.6 and 4.4).

Strided, sparse and normalised accessors are read as they are meant. An accessor says the least and the largest of its numbers;
where they differ from what is read, something was not understood, and the file is refused rather than read wrong.
"""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote, unquote_to_bytes

import numpy as np

from benchharness.assets import files
from benchharness.assets.asset import Refused

COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
ROUNDED = 0.01  # of the extent: by how much exporters may round the bounds that they write
COMPRESSION = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")


class Document:
    """A file's JSON and its buffers."""

    def __init__(self, path: Path) -> None:
        """Raises Refused for what is no glTF of version 2."""
        self.folder = path.parent
        self.json, self.rest = _contents(path.read_bytes())
        if not isinstance(self.json, dict) or not isinstance(self.json.get("asset"), dict):
            raise Refused("its JSON has no asset; accepted: glTF 2.0")
        version = str(self.json["asset"].get("version"))
        if not version.startswith("2."):
            raise Refused(f"it is glTF {version}; accepted: glTF 2.0")
        self._buffers: dict[int, bytes] = {}

    def all(self, kind: str) -> list[dict[str, Any]]:
        return self.json.get(kind, [])

    def one(self, kind: str, index: int) -> dict[str, Any]:
        """One thing of a kind by its number. Raises Refused where there is none."""
        if not isinstance(index, int) or not 0 <= index < len(self.all(kind)):
            raise Refused(f"it names number {index} of its {kind}, and has {len(self.all(kind))}; accepted: what is there")
        return self.all(kind)[index]

    def buffer(self, index: int) -> bytes:
        if index not in self._buffers:
            said = self.one("buffers", index)
            if "uri" not in said and (index > 0 or self.rest is None):
                raise Refused(f"buffer {index} is nowhere ({_compression(said)}); accepted: buffers within it or beside it")
            data = (self.rest or b"") if "uri" not in said else self.fetched(said["uri"], f"buffer {index}")
            if len(data) < said["byteLength"]:
                raise Refused(f"buffer {index} has {len(data)} of {said['byteLength']} bytes; accepted: a whole file")
            self._buffers[index] = data
        return self._buffers[index]

    def fetched(self, uri: str, what: str) -> bytes:
        """What is at an address: within it (data:), or a file beside this one. Raises Refused, also for the network's."""
        if uri.startswith("data:"):
            head, _, body = uri.partition(",")
            return base64.b64decode(unquote(body)) if head.endswith(";base64") else unquote_to_bytes(body)
        found = files.found(self.folder, unquote(uri))
        if found is None:
            raise Refused(f"{what} is the file {uri}, which is not there; accepted: files beside this one")
        return found.read_bytes()

    def view(self, index: int) -> tuple[bytes, int]:
        """The bytes of a buffer view, and its stride (0: none). Raises Refused for one that is compressed or cut off."""
        said = self.one("bufferViews", index)
        packed = sorted(set(COMPRESSION) & set(said.get("extensions", {})))
        if packed:
            raise Refused(f"its numbers are compressed by {packed[0]}; accepted: files without it")
        start = said.get("byteOffset", 0)
        data = self.buffer(said["buffer"])
        if start < 0 or start + said["byteLength"] > len(data):
            raise Refused(f"buffer view {index} ends behind its buffer; accepted: a whole file")
        return data[start : start + said["byteLength"]], said.get("byteStride", 0)

    def stored(self, index: int) -> np.ndarray:
        """An accessor's numbers as they are stored, [count, width], sparse ones put in. Raises Refused."""
        said = self.one("accessors", index)
        if said.get("componentType") not in COMPONENTS or said.get("type") not in WIDTHS:
            raise Refused(
                f"accessor {index} has type {said.get('componentType')} {said.get('type')}; accepted: those of glTF 2.0"
            )
        dtype, width, count = np.dtype(COMPONENTS[said["componentType"]]), WIDTHS[said["type"]], said["count"]
        if said["type"].startswith("MAT") and dtype.itemsize < 4:
            raise Refused(f"accessor {index} has matrices of {dtype.name}; accepted: float32")
        if "bufferView" in said:
            values = self._rows(said["bufferView"], said.get("byteOffset", 0), dtype, width, count, f"accessor {index}").copy()
        elif "sparse" in said:
            values = np.zeros((count, width), dtype)
        else:
            raise Refused(f"accessor {index} has no numbers; accepted: a buffer view or sparse numbers")
        if "sparse" in said:
            sparse, number = said["sparse"], said["sparse"]["count"]
            where, what = sparse["indices"], sparse["values"]
            if where["componentType"] not in COMPONENTS:
                raise Refused(
                    f"accessor {index} has sparse indices of type {where['componentType']}; accepted: unsigned integers"
                )
            kind = np.dtype(COMPONENTS[where["componentType"]])
            rows = self._rows(where["bufferView"], where.get("byteOffset", 0), kind, 1, number, f"accessor {index}")[:, 0]
            if number and rows.max() >= count:
                raise Refused(f"accessor {index} has a sparse row {rows.max()}; accepted: 0 to {count - 1}")
            values[rows] = self._rows(what["bufferView"], what.get("byteOffset", 0), dtype, width, number, f"accessor {index}")
        return values

    def numbers(self, index: int) -> np.ndarray:
        """An accessor's numbers as they are meant, float64 [count, width]: normalised where it says so. Raises Refused."""
        stored, said = self.stored(index), self.one("accessors", index)
        return normalised(stored) if said.get("normalized") and stored.dtype.kind in "iu" else stored.astype(np.float64)

    def positions(self, index: int) -> np.ndarray:
        """The same of an accessor of places, [count, 3]. Raises Refused where they are others than the accessor says, too."""
        _check_bounds(index, self.one("accessors", index), self.stored(index))
        return self.numbers(index)

    def _rows(self, view: int, offset: int, dtype: np.dtype, width: int, count: int, what: str) -> np.ndarray:
        data, stride = self.view(view)
        size = dtype.itemsize * width
        stride = stride or size
        if offset < 0 or stride < size or (count and offset + (count - 1) * stride + size > len(data)):
            raise Refused(f"{what} ends behind its buffer view; accepted: a whole file")
        if count == 0:
            return np.zeros((0, width), dtype)
        return np.ndarray((count, width), dtype, data, offset, (stride, dtype.itemsize))


def normalised(values: np.ndarray) -> np.ndarray:
    """Integers as the shares of their largest that they stand for: 0 to 1, or -1 to 1."""
    return np.maximum(values.astype(np.float64) / np.iinfo(values.dtype).max, -1.0)


def _contents(data: bytes) -> tuple[Any, bytes | None]:
    """The JSON and the first buffer of a file, which is None where it has none in it. Raises Refused."""
    if data[:4] != b"glTF":
        try:
            return json.loads(data.decode("utf-8-sig")), None
        except (UnicodeDecodeError, ValueError) as error:
            raise Refused(f"it is neither GLB nor JSON ({error}); accepted: glTF 2.0") from None
    if len(data) < 12:
        raise Refused("it ends within its head; accepted: a whole file")
    version, length = struct.unpack("<II", data[4:12])
    if version != 2:
        raise Refused(f"it is GLB of version {version}; accepted: 2")
    if length > len(data):
        raise Refused(f"it has {len(data)} of {length} bytes; accepted: a whole file")
    chunks, at = {}, 12
    while at + 8 <= length:
        size, kind = struct.unpack("<I4s", data[at : at + 8])
        chunks.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    if b"JSON" not in chunks:
        raise Refused("it has no JSON in it; accepted: glTF 2.0")
    return json.loads(chunks[b"JSON"].decode("utf-8")), chunks.get(b"BIN\0")


def _check_bounds(index: int, said: dict[str, Any], values: np.ndarray) -> None:
    """Raises Refused where the numbers are others than the accessor says."""
    if len(values) == 0 or not {"min", "max"} <= set(said):
        return
    stored, low, high = values.astype(np.float64), np.array(said["min"], np.float64), np.array(said["max"], np.float64)
    slack = ROUNDED * np.maximum(high - low, 0.0).max() + 1e-6 * np.abs([low, high]).max() + 1e-30
    least, most = stored.min(axis=0), stored.max(axis=0)
    if low.shape != least.shape or not ((np.abs(least - low) <= slack) & (np.abs(most - high) <= slack)).all():
        raise Refused(
            f"accessor {index} has numbers from {least.tolist()} to {most.tolist()}, "
            f"and says {low.tolist()} to {high.tolist()}; accepted: numbers that are what the file says of them"
        )


def _compression(said: dict[str, Any]) -> str:
    packed = sorted(set(COMPRESSION) & set(said.get("extensions", {})))
    return f"it is compressed by {packed[0]}" if packed else "it has no uri"
