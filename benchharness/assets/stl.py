"""STL files, text and binary: triangles without anything. Their normals say no more than the order of their corners, and are
left; vertices are joined by place, and get creases where faces turn much."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from benchharness.assets import surface
from benchharness.assets.asset import Findings, Material, Part, Refused
from benchharness.modelling import winding

FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
HEAD = 84  # bytes: 80 of text, and the number of facets

_FACET = re.compile(r"\bfacet\s+normal\b(.*?)\bendfacet\b", re.DOTALL | re.IGNORECASE)
_VERTEX = re.compile(r"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)
_NORMAL = re.compile(r"\s*(\S+)\s+(\S+)\s+(\S+)")


def read(path: Path, findings: Findings) -> list[Part]:
    """The parts of a file, as it stands: one. Raises Refused."""
    data = path.read_bytes()
    count = int(np.frombuffer(data, "<u4", 1, 80)[0]) if len(data) >= HEAD else 0
    size = HEAD + FACET.itemsize * count
    if len(data) != size and data.lstrip()[:5].lower() == b"solid" and b"facet" in data[:4096].lower():
        normals, corners = _text(data.decode("latin-1"), findings)
    elif HEAD <= size <= len(data) and len(data) >= HEAD:
        if len(data) > size:
            findings.say(f"{len(data) - size} bytes behind the last facet are left out")
        facets = np.frombuffer(data, FACET, count, HEAD)
        normals, corners = facets["normal"].astype(np.float64), facets["corners"].astype(np.float64)
        if b"COLOR=" in data[:80] or facets["attribute"].any():
            findings.say("colours of facets are ignored, as programs do not agree about them")
    else:
        raise Refused(f"it ends within its {count} facets, or is no STL file; accepted: a whole file, text or binary")
    if len(corners) == 0:
        raise Refused("it has no faces; accepted: a mesh with at least one triangle")
    place = np.arange(3 * len(corners)).reshape(-1, 3)
    places = corners.reshape(-1, 3)
    with np.errstate(invalid="ignore", over="ignore"):
        against = np.einsum("fi,fi->f", winding.crossed(places, place), normals) < 0
    findings.count("facets whose normal is against the order of their corners, which counts", against.sum())
    material = np.zeros(len(place), np.int64)
    return surface.parts(surface.Corners(place, places, material), [Material()], path.stem, findings)


def _text(said: str, findings: Findings) -> tuple[np.ndarray, np.ndarray]:
    """Normals [F, 3] and corners [F, 3, 3] of a text. Raises Refused for a facet that is no triangle."""
    normals, corners = [], []
    for number, facet in enumerate(_FACET.findall(said), 1):
        vertices = _VERTEX.findall(facet)
        if len(vertices) != 3:
            raise Refused(f"facet {number} has {len(vertices)} corners; accepted: three")
        normal = _NORMAL.match(facet)
        try:
            corners.append([[float(x) for x in vertex] for vertex in vertices])
        except ValueError as error:
            raise Refused(f"facet {number}: {error}; accepted: numbers with a decimal point") from None
        normals.append(_direction(normal.groups() if normal else ()))
    if len(re.findall(r"\bfacet\s+normal\b", said, re.IGNORECASE)) != len(corners):
        raise Refused(f"it ends within facet {len(corners) + 1}; accepted: a whole file")
    solids = len(re.findall(r"\bendsolid\b", said, re.IGNORECASE))
    if solids > 1:
        findings.say(f"{solids} solids are read as one")
    return np.array(normals).reshape(-1, 3), np.array(corners).reshape(-1, 3, 3)


def _direction(words: tuple[str, ...]) -> list[float]:
    """A normal's three numbers; nothing where they are none, as it is not needed."""
    try:
        return [float(word) for word in words] if len(words) == 3 else [0.0, 0.0, 0.0]
    except ValueError:
        return [0.0, 0.0, 0.0]
