"""Mesh files of a scene's table, put in their place: as objects, one for each material, and as mirrors.

A file is first brought to z up (`up`) and metres (`unit`), then scaled, turned about x, y, z in this order, and moved; or
turned and then brought to a size and a place, whatever its own (`fit`). All of it is: what an entry takes of it, by the names
of nodes and materials, stands where it stands in the whole.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchharness.assets import reading
from benchharness.assets.asset import Asset, Part, Refused
from benchharness.scene import Mesh, Object, Texture, merged
from benchharness.study import plugins
from benchharness.study.entries import ObjectTable, Place, Placed, Taken, Vector
from benchharness.study.moving import Motions

HUGE, TINY = 200.0, 0.005  # metres: what is larger or smaller is said, as it may be meant in another unit
MOST_SAID = 12  # findings of one file
MOST_NAMED = 40  # names of nodes or materials


def read(path: Path, where: str, placed: Placed) -> Asset:
    """A mesh file. Raises ValueError that names the key and the file for what is none, or cannot be read right."""
    if path.suffix.lower() not in reading.SUFFIXES:
        raise ValueError(f"{where} is {str(path)!r}; accepted: a file that ends in {', '.join(reading.SUFFIXES)}")
    with refusals(existing(path, where), where):
        return reading.read(path, placed.up, placed.asked())


def existing(path: Path, where: str) -> Path:
    """The path of a file. Raises ValueError that names the key if there is none."""
    if not path.is_file():
        raise ValueError(f"{where}: there is no file {path}; accepted: a path relative to the config")
    return path


@contextmanager
def refusals(path: Path, where: str) -> Iterator[None]:
    """What is refused of a file is a ValueError that names the key, and where the file is."""
    try:
        yield
    except Refused as error:
        raise ValueError(f"{where}: {path.parent}/{error}") from None


class Files:
    """The mesh files of a table, relative to a folder; each is read once for all entries that ask the same of it. `used`,
    names of files and beginnings of findings, is what the table takes of them elsewhere: it is not said to be left out."""

    def __init__(self, base: Path, used: Iterable[tuple[str | None, str]] = ()) -> None:
        self.base, self._used = base, tuple(used)
        self._read: dict[Any, Asset] = {}

    def asset(self, name: str, where: str, placed: Placed) -> Asset:
        """See `read`."""
        key = name, placed.up, placed.asked()
        if key not in self._read:
            asset, used = read(self.base / name, where, placed), [said for file, said in self._used if file == name]
            left = tuple(said for said in asset.findings if not said.startswith(tuple(used)))
            self._read[key] = replace(asset, findings=left)
        return self._read[key]


def taken(asset: Asset, entry: Placed, where: str) -> Asset:
    """What an entry takes of a file. Raises ValueError for names that are not there, with those that are, and for nothing."""
    parts = _those(asset, entry, where)
    for number, left in enumerate(entry.without):
        key = f"{where}.without[{number}]"
        if left.node is None and left.material is None:
            raise ValueError(f"{key} names nothing; accepted: node, material or both")
        gone = _those(asset, left, key)
        parts = [part for part in parts if part not in gone]
    if not parts:
        raise ValueError(f"{where} takes nothing of {asset.path.name}; accepted: a `without` that leaves some of it")
    return replace(asset, parts=tuple(parts))


def _those(asset: Asset, named: Taken, where: str) -> list[Part]:
    """The parts of nodes and materials; all, where neither is named."""
    nodes = dict.fromkeys(name for part in asset.parts for name in part.nodes)
    materials = dict.fromkeys(part.material.name for part in asset.parts if part.material.name)
    for key, asked, there in (("node", named.node, nodes), ("material", named.material, materials)):
        for name in asked or []:
            if name not in there:
                raise ValueError(f"{where}.{key} of {asset.path.name}: {_unknown(name, list(there))}")
    found = [part for part in asset.parts if named.node is None or not set(named.node).isdisjoint(part.nodes)]
    found = [part for part in found if named.material is None or part.material.name in named.material]
    if not found:
        raise ValueError(f"{where}: no part of {asset.path.name} is of that node and that material; accepted: one of the two")
    return found


def _unknown(name: str, there: list[str]) -> str:
    """What is said of a name that a file does not have."""
    more = [f"and {len(there) - MOST_NAMED} more"] if len(there) > MOST_NAMED else []
    near = plugins.did_you_mean(plugins.close(name, there))
    accepted = ", ".join([*there[:MOST_NAMED], *more]) or "none, as nothing in it has a name"
    return f"{name!r} is unknown{near}; accepted: {accepted}"


def pose(asset: Asset | None, placed: Place, where: str) -> np.ndarray:
    """What takes a file's space to the scene's, float64 [4, 4]. The asset is needed for a `fit` alone. Raises ValueError for a
    `fit` beside what it replaces."""
    turned = turn(placed.rotate_deg)
    out = np.eye(4)
    if placed.fit is None:
        out[:3, :3] = placed.unit * placed.scale * turned
        out[:3, 3] = placed.translate
        return out
    beside = [name for name in ("unit", "scale", "translate") if name in placed.model_fields_set]
    if beside:
        raise ValueError(f"{where} has fit and {', '.join(beside)}; accepted: one of them")
    assert asset is not None
    corners = np.concatenate([part.vertices @ turned.T for part in asset.parts])
    low, high = corners.min(axis=0), corners.max(axis=0)
    factor = placed.fit.size / float((high - low).max())
    out[:3, :3] = factor * turned
    out[:3, 3] = placed.fit.centre - factor * 0.5 * (low + high)
    return out


def turn(degrees: Vector) -> np.ndarray:
    """Turns about x, then y, then z, float64 [3, 3]."""
    out = np.eye(3)
    for axis, angle in enumerate(np.radians(degrees)):
        step, (i, j) = np.eye(3), [(1, 2), (2, 0), (0, 1)][axis]
        step[[i, i, j, j], [i, j, i, j]] = [np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)]
        out = step @ out
    return out


def mesh(asset: Asset, at: np.ndarray) -> Mesh:
    """All of a file as one mesh without a look, with uv if all of it has. Raises ValueError for what is no mesh."""
    return merged(*(Mesh(part.vertices, part.faces, part.normals, uv=part.uv) for part in asset.parts)).transformed(at)


def objects(asset: Asset, entry: ObjectTable, at: np.ndarray, motions: Motions | None = None) -> tuple[list[Object], list[str]]:
    """An object for every material of what moves as one, or one of these if the table gives its albedo; and what has to be said
    of them. Without `motions` they stand."""
    said: list[str] = []
    groups: dict[Any, list[Part]] = {}
    for part in asset.parts:
        m = part.material
        look = None if entry.albedo is not None else (m.name, m.base_colour, id(m.picture), m.wrap, m.emission, part.uv is None)
        motion = None if motions is None else motions.of(part)
        groups.setdefault((look, motion), []).append(part)
    found: list[Object] = []
    made: dict[int, Texture] = {}
    names = _names([_called(parts[0]) for parts in groups.values()]) if len(groups) > 1 else [""]
    for material, ((_, motion), parts) in zip(names, groups.items(), strict=True):
        meshes = [Mesh(part.vertices, part.faces, part.normals, **_look(part, entry, made, said)) for part in parts]
        shown = entry.shows or " of ".join([material, asset.path.name] if material else [asset.path.name])
        name = f"{entry.name}/{material}" if material else entry.name
        found.append(Object(name, merged(*meshes).transformed(at), shown, motion))
    return found, list(dict.fromkeys(said))


def notes(kind: str, name: str, asset: Asset, at: np.ndarray, said: list[str]) -> list[str]:
    """One sentence about a file, if there is anything to say: what was found in it, and a size that is no usual one."""
    said = [*asset.findings, *said]
    low, high = asset.box
    corners = np.stack(np.meshgrid(*zip(low, high, strict=True), indexing="ij"), axis=-1).reshape(-1, 3) @ at[:3, :3].T
    extent = np.ptp(corners, axis=0)
    if not TINY <= extent.max() <= HUGE:
        said.append(f"it is {' x '.join(f'{length:.4g}' for length in extent)} m large: `unit`, `scale` or `fit` change that")
    if len(said) > MOST_SAID:
        said = [*said[:MOST_SAID], f"and {len(said) - MOST_SAID} more"]
    return [f"{kind} {name}, {asset.path.name}: {'; '.join(said)}"] if said else []


def _called(part: Part) -> str:
    """The name of a part's material, after that of the node that moves it, if an animation does."""
    return part.material.name if part.motion is None else "/".join(filter(None, (part.motion.name, part.material.name)))


def _names(materials: list[str]) -> list[str]:
    """Names for objects, none of them twice."""
    plain = [" ".join("".join(c for c in name if c.isprintable()).split()) or "plain" for name in materials]
    out: list[str] = []
    for name in plain:
        number, own = 2, name
        while own in out:
            own, number = f"{name} {number}", number + 1
        out.append(own)
    return out


def _look(part: Part, entry: ObjectTable, pictures: dict[int, Texture], said: list[str]) -> dict[str, Any]:
    """Albedo, [3] or [V, 3], emission, [3], and texture of a part; `pictures` made so far, by the picture they are of."""
    m = part.material
    emission = m.emission if entry.emission is None else entry.emission
    if entry.albedo is not None:
        return {"albedo": entry.albedo, "emission": emission}
    colour = np.array(m.base_colour) * (1.0 if part.colours is None else part.colours)
    if colour.max() > 1.0:
        said.append(f"the colour of material {m.name} goes beyond 1, and is clipped")
    look: dict[str, Any] = {"albedo": np.clip(colour, 0.0, 1.0), "emission": emission}
    if m.picture is None or part.uv is None:
        return look
    if any(emission):
        said.append(f"material {m.name} shines: its picture is left out")
        return look
    if id(m.picture) not in pictures:
        pictures[id(m.picture)] = Texture(np.clip(m.picture, 0.0, 1.0), m.wrap)
    return {**look, "uv": part.uv, "texture": pictures[id(m.picture)]}
