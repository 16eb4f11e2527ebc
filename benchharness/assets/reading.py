"""`read`: a mesh file of any format that is read, as an `Asset` with z up; `eye`, `lamps`: the cameras and lights
that stand in one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from benchharness.assets import gltf, gltf_viewing, holes, obj, ply, stl
from benchharness.assets.asset import Asked, Asset, Findings, Part, Refused
from benchharness.assets.gltf_viewing import Eye, Lamp

Up = Literal["y", "z"]
Reader = Callable[[Path, Findings, Asked], list[Part]]

READERS: dict[str, tuple[Reader, Up]] = {
    ".obj": (obj.read, "z"),
    ".ply": (lambda path, findings, asked: ply.read(path, findings), "z"),
    ".stl": (lambda path, findings, asked: stl.read(path, findings), "z"),
    ".glb": (gltf.read, "y"),
    ".gltf": (gltf.read, "y"),
}
"""What reads files of an ending, and which axis is up in them: glTF says so itself, of others z is taken for it."""

SUFFIXES = tuple(READERS)
WITH_NODES = (".glb", ".gltf")
PLAINLY = Asked()
UPRIGHT = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # y up -> z up: what was the front is at -y


def read(path: Path, up: Up | None = None, asked: Asked = PLAINLY) -> Asset:
    """The asset of a file. `up` is the axis that is up in it, if not its format's own.

    Raises Refused, with the file's name, for what cannot be read right.
    """
    if path.suffix.lower() not in READERS:
        raise Refused(f"{path.name} is none of the formats; accepted: {', '.join(SUFFIXES)}")
    reader, usual = READERS[path.suffix.lower()]
    if asked.animation is not None:
        _check_nodes(path, "animations")
    findings = Findings()
    with _named_in_refusals(path):
        parts = reader(path, findings, asked)
    if not parts:
        raise Refused(f"{path.name} cannot be read: no face of it has an area; accepted: a mesh with at least one triangle")
    with _named_in_refusals(path):
        parts = holes.cut(parts, findings)
    if not parts:
        raise Refused(f"{path.name} cannot be read: its alpha is below its cutoff everywhere; accepted: a mesh that is seen")
    axes = UPRIGHT if (up or usual) == "y" else np.eye(4)
    if axes is UPRIGHT:
        parts = [part.transformed(UPRIGHT) for part in parts]
    return Asset(path, tuple(_named(parts)), findings.sentences(), axes)


def eye(path: Path, node: str | None, animation: str | int | None) -> Eye:
    """The camera of a file, z up: the one at or below a node, or the only one; moved by an animation, if one is asked for.
    Raises Refused."""
    _check_nodes(path, "cameras")
    with _named_in_refusals(path):
        found = gltf_viewing.eye(path, node, animation)
    return replace(found, pose=lambda time: UPRIGHT @ found.pose(time))


def lamps(path: Path, nodes: list[str] | None) -> tuple[list[Lamp], tuple[str, ...]]:
    """The point lights of a file, z up, at or below nodes or all, and sentences about what was left out. Raises Refused."""
    _check_nodes(path, "lights")
    findings = Findings()
    with _named_in_refusals(path):
        found = gltf_viewing.lamps(path, nodes, findings)
    return [replace(lamp, position=UPRIGHT[:3, :3] @ lamp.position) for lamp in found], findings.sentences()


def _check_nodes(path: Path, what: str) -> None:
    """Raises Refused for files of formats without nodes."""
    if path.suffix.lower() not in WITH_NODES:
        raise Refused(f"{path.name} has no {what}; accepted: files that end in {', '.join(WITH_NODES)}")


@contextmanager
def _named_in_refusals(path: Path) -> Iterator[None]:
    """What goes wrong is a refusal that says of which file."""
    try:
        yield
    except Refused as error:
        raise Refused(f"{path.name} cannot be read: {error}") from None
    except Exception as error:  # whatever a broken file may lead to
        said = f"{type(error).__name__}: {error}"
        raise Refused(
            f"{path.name} cannot be read: it is not what its format asks for ({said}); accepted: a valid file"
        ) from error


def _named(parts: list[Part]) -> list[Part]:
    """The parts, those without a name named by their material or number."""
    return [replace(part, name=part.name or part.material.name or f"part {k}") for k, part in enumerate(parts, 1)]
