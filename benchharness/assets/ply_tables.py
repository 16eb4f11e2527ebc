"""The tables of a PLY file (Turk 1994): its header, and the numbers of its elements, text or binary of either endianness."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from benchharness.assets.asset import Refused

TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_END = re.compile(rb"end_header[ \t]*(\r\n|\n|\r)")


@dataclass(frozen=True)
class Property:
    """A number, or a list of them; `count` is the type of a list's length."""

    name: str
    kind: str
    count: str | None = None


@dataclass(frozen=True)
class Element:
    name: str
    size: int
    properties: list[Property] = field(default_factory=list)


@dataclass(frozen=True)
class Header:
    """elements, byte order (None: text), and the pictures that comments name."""

    elements: list[Element]
    order: str | None
    pictures: list[str]


@dataclass(frozen=True)
class Table:
    """What a file has of one element: numbers [N] by the names of properties; of a list, its lengths [N] and its values, those
    of all rows one after the other. `kinds` are the types that the header gives, such as 'u1'."""

    size: int = 0
    kinds: dict[str, str] = field(default_factory=dict)
    scalars: dict[str, np.ndarray] = field(default_factory=dict)
    lists: dict[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)

    def columns(self, names: tuple[str, ...]) -> np.ndarray | None:
        """Some of the numbers side by side, float64 [N, len(names)]; None unless all are there."""
        if not set(names) <= set(self.scalars):
            return None
        return np.stack([self.scalars[name].astype(np.float64) for name in names], axis=1)


def read(data: bytes) -> tuple[Header, dict[str, Table]]:
    """The header of a file and its tables by their names. Raises Refused."""
    end = _END.search(data)
    if not re.match(rb"ply\s", data) or end is None:
        raise Refused("it does not begin as a PLY file; accepted: 'ply', a header, 'end_header'")
    header = _header(data[: end.start()].decode("latin-1"))
    body = data[end.end() :]
    reader = _Text(body) if header.order is None else _Binary(body, header.order)
    return header, {element.name: reader.table(element) for element in header.elements}


def _header(said: str) -> Header:
    elements: list[Element] = []
    order, pictures = "", []
    for line in re.split(r"\r\n|\n|\r", said)[1:]:
        match line.split():
            case ["format", "ascii", *_]:
                order = None
            case ["format", "binary_little_endian", *_]:
                order = "<"
            case ["format", "binary_big_endian", *_]:
                order = ">"
            case ["comment", key, _, *_] if key.lower() == "texturefile":
                pictures.append(line.split(None, 2)[2].strip())
            case ["element", name, size] if size.isdecimal():
                elements.append(Element(name, int(size)))
            case ["property", "list", count, kind, name] if elements and count in TYPES and kind in TYPES:
                elements[-1].properties.append(Property(name, TYPES[kind], TYPES[count]))
            case ["property", kind, name] if elements and kind in TYPES:
                elements[-1].properties.append(Property(name, TYPES[kind]))
            case ["format" | "element" | "property", *_]:
                raise Refused(f"its header says {line!r}; accepted: format, element, property, comment")
            case _:
                pass  # comments, and what some programs write without that word
    if order == "":
        raise Refused("its header says no format; accepted: ascii, binary_little_endian, binary_big_endian")
    return Header(elements, order, pictures)


class _Binary:
    """Reads elements one after the other from bytes."""

    def __init__(self, body: bytes, order: str) -> None:
        self.body, self.order, self.at = body, order, 0

    def table(self, element: Element) -> Table:
        if element.size == 0:
            return _empty(element)
        lengths = self._lengths(element)
        table = self._alike(element, lengths)
        return self._each(element) if table is None else table

    def _lengths(self, element: Element) -> dict[str, int]:
        """How long the lists of the first row are; nothing is taken."""
        start, lengths = self.at, {}
        for p in element.properties:
            if p.count:
                lengths[p.name] = int(self._take(element, p.count, 1)[0])
            self._take(element, p.kind, lengths.get(p.name, 1))
        self.at = start
        return lengths

    def _alike(self, element: Element, lengths: dict[str, int]) -> Table | None:
        """The table, all lists being as long as in its first row; None where they are not."""
        fields: list = []
        for p in element.properties:
            if p.count:
                fields.append((f"length of {p.name}", self.order + p.count))
            fields.append((p.name, self.order + p.kind, *([(lengths.get(p.name, 0),)] if p.count else [])))
        dtype = np.dtype(fields)
        if len(self.body) - self.at < dtype.itemsize * element.size:
            if not lengths:
                raise _ends(element)
            return None
        rows = np.frombuffer(self.body, dtype, element.size, self.at)
        if any((rows[f"length of {name}"] != length).any() for name, length in lengths.items()):
            return None
        self.at += dtype.itemsize * element.size
        found = {p.name: rows[p.name].reshape(-1) for p in element.properties}
        return _table(element, found, {name: np.full(element.size, length) for name, length in lengths.items()})

    def _each(self, element: Element) -> Table:
        """The table row by row."""
        found: dict[str, list] = {p.name: [] for p in element.properties}
        lengths: dict[str, list[int]] = {p.name: [] for p in element.properties if p.count}
        for _ in range(element.size):
            for p in element.properties:
                length = 1
                if p.count:
                    length = int(self._take(element, p.count, 1)[0])
                    lengths[p.name].append(length)
                found[p.name].append(self._take(element, p.kind, length))
        return _table(element, {n: np.concatenate(v) for n, v in found.items()}, {n: np.array(v) for n, v in lengths.items()})

    def _take(self, element: Element, kind: str, count: int) -> np.ndarray:
        dtype = np.dtype(self.order + kind)
        if count < 0 or len(self.body) - self.at < dtype.itemsize * count:
            raise _ends(element)
        taken = np.frombuffer(self.body, dtype, count, self.at)
        self.at += dtype.itemsize * count
        return taken


class _Text:
    """Reads elements one after the other from words."""

    def __init__(self, body: bytes) -> None:
        self.words, self.at = body.split(), 0

    def table(self, element: Element) -> Table:
        if element.size == 0:
            return _empty(element)
        if not any(p.count for p in element.properties):
            width = len(element.properties)
            rows = _numbers(self._take(element, width * element.size)).reshape(element.size, width)
            return _table(element, {p.name: rows[:, k] for k, p in enumerate(element.properties)}, {})
        found: dict[str, list[bytes]] = {p.name: [] for p in element.properties}
        lengths: dict[str, list[int]] = {p.name: [] for p in element.properties if p.count}
        for _ in range(element.size):
            for p in element.properties:
                length = 1
                if p.count:
                    length = int(_numbers(self._take(element, 1))[0])
                    lengths[p.name].append(length)
                found[p.name].extend(self._take(element, length))
        numbers = {name: _numbers(words) for name, words in found.items()}
        return _table(element, numbers, {name: np.array(values, np.int64) for name, values in lengths.items()})

    def _take(self, element: Element, count: int) -> list[bytes]:
        if count < 0 or self.at + count > len(self.words):
            raise _ends(element)
        self.at += count
        return self.words[self.at - count : self.at]


def _numbers(words: list[bytes]) -> np.ndarray:
    try:
        return np.array([float(word) for word in words], np.float64)
    except ValueError as error:
        raise Refused(f"it has a word where a number is due: {error}; accepted: numbers with a decimal point") from None


def _table(element: Element, found: dict[str, np.ndarray], lengths: dict[str, np.ndarray]) -> Table:
    lists = {name: (length, found[name]) for name, length in lengths.items()}
    listed = {p.name for p in element.properties if p.count}
    scalars = {name: values for name, values in found.items() if name not in listed}
    return Table(element.size, {p.name: p.kind for p in element.properties}, scalars, lists)


def _empty(element: Element) -> Table:
    nothing = {p.name: np.zeros(0) for p in element.properties}
    return _table(element, nothing, {p.name: np.zeros(0, np.int64) for p in element.properties if p.count})


def _ends(element: Element) -> Refused:
    return Refused(f"it ends within its {element.size} elements {element.name!r}; accepted: a whole file")
