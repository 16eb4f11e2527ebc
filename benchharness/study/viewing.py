"""The camera of a scene's table: a path at even pace, keys, or the camera of a glTF file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from benchharness.assets import reading
from benchharness.assets.gltf_viewing import Eye
from benchharness.modelling.motion import Track
from benchharness.scene import Camera
from benchharness.study.entries import Coordinate, Place, Placed, Table, Vector
from benchharness.study.moving import ascending
from benchharness.study.placed import Files, existing, pose, refusals

Degrees = Annotated[float, Field(gt=0, lt=180)]


class CameraKey(Table):
    """Where the eye is at a time; what it does not say of the rest is what the camera says."""

    time: Coordinate
    eye: Vector
    target: Vector | None = None
    fov_deg: Degrees | None = None
    up: Vector | None = None


class CameraTable(Place):
    """One of three: `path`, eyes from the first frame to the last; `keys`, eyes at times; `file`, whose camera it is.

    node       at or below which the camera of a file is, where it has several
    animation  of the file, which moves that node
    fov_deg    vertical; beside a file, in place of its own
    """

    path: Annotated[list[Vector], Field(min_length=1)] | None = None
    keys: Annotated[list[CameraKey], Field(min_length=1)] | None = None
    file: str | None = None
    node: str | None = None
    animation: str | int | None = None
    target: Vector | None = None
    fov_deg: Degrees | None = None
    up: Vector = (0.0, 0.0, 1.0)


BESIDE = {
    "path": ("target", "fov_deg", "up"),
    "keys": ("target", "fov_deg", "up"),
    "file": ("node", "animation", "fov_deg", *Place.model_fields),
}
"""What a camera may have beside each of the three."""


def camera(table: CameraTable, files: Files, last: float, where: str) -> tuple[Callable[[float], Camera], list[str]]:
    """Time in seconds -> Camera, and what has to be said of it; `last` is the time of the last frame. Raises ValueError that
    names the key at fault."""
    given = [name for name in ("path", "keys", "file") if getattr(table, name) is not None]
    if len(given) != 1:
        raise ValueError(f"{where} has {' and '.join(given) or 'no path, keys or file'}; accepted: one of path, keys and file")
    said = {name for name, field in CameraTable.model_fields.items() if getattr(table, name) != field.default}
    strange = sorted(said - {given[0], *BESIDE[given[0]]})
    if strange:
        raise ValueError(f"{where} has {given[0]} and {', '.join(strange)}; accepted beside it: {', '.join(BESIDE[given[0]])}")
    if table.file is not None:
        return _of_file(table, table.file, files, where)
    if table.path is not None:
        return _along(table.path, _of_all(table, "target", where), _of_all(table, "fov_deg", where), table.up, last), []
    keys = table.keys or []
    times = ascending([key.time for key in keys], where)
    rows = []
    for number, key in enumerate(keys):
        target, fov_deg, up = key.target or table.target, key.fov_deg or table.fov_deg, key.up or table.up
        if target is None or fov_deg is None:
            lacks = "target" if target is None else "fov_deg"
            raise ValueError(f"{where}.keys[{number}].{lacks} is missing; accepted: in every key, or once in {where}")
        rows.append([*key.eye, *target, *up, fov_deg])
    return _Keyed(Track(times, np.array(rows, np.float64))), []


def _of_file(table: CameraTable, name: str, files: Files, where: str) -> tuple[Callable[[float], Camera], list[str]]:
    """The camera of a file, which stands where the table puts that file."""
    key = f"{where}.file"
    path = existing(files.base / name, key)
    with refusals(path, key):
        eye = reading.eye(path, table.node, table.animation)
    whole = None if table.fit is None else files.asset(name, key, Placed(name=name, mesh=name, animation=table.animation))
    said = []
    if eye.aspect is not None:
        wide = f"its picture is {eye.aspect:.4g} times as wide as high"
        said = [f"camera {eye.name}, {path.name}: {wide}; any other keeps its height"]
    return _Filmed(eye, pose(whole, table, where), table.fov_deg or eye.fov_deg), said


def _of_all(table: CameraTable, name: str, where: str):
    value = getattr(table, name)
    if value is None:
        raise ValueError(f"{where}.{name} is missing; accepted: see benchharness/study/viewing.py")
    return value


def _along(path: list[Vector], target: Vector, fov_deg: float, up: Vector, last: float) -> Callable[[float], Camera]:
    """The first eye at frame 0, the last at the last frame."""
    points = np.array(path)

    def at(time: float) -> Camera:
        along = 0.0 if last == 0 else min(max(time / last, 0.0), 1.0) * (len(points) - 1)
        x, y, z = (float(np.interp(along, np.arange(len(points)), points[:, axis])) for axis in range(3))
        return Camera((x, y, z), target, fov_deg, up)

    return at


@dataclass(frozen=True, eq=False)
class _Keyed:
    """Between keys: eyes, targets, directions up and fields of view, in a row each."""

    keys: Track

    @property
    def end(self) -> float:
        return float(self.keys.times[-1])

    def __call__(self, time: float) -> Camera:
        ex, ey, ez, tx, ty, tz, ux, uy, uz, fov_deg = self.keys.at(time).tolist()
        return Camera((ex, ey, ez), (tx, ty, tz), fov_deg, (ux, uy, uz))


@dataclass(frozen=True, eq=False)
class _Filmed:
    """A camera of a file. `place` is what takes the file, z up, to the scene, float64 [4, 4]."""

    eye: Eye
    place: np.ndarray
    fov_deg: float

    @property
    def end(self) -> float:
        return self.eye.end

    def __call__(self, time: float) -> Camera:
        pose = self.place @ self.eye.pose(time)
        _, up, back = (axis / np.linalg.norm(axis) for axis in pose[:3, :3].T)
        ex, ey, ez = pose[:3, 3].tolist()
        tx, ty, tz = (pose[:3, 3] - back).tolist()
        ux, uy, uz = up.tolist()
        return Camera((ex, ey, ez), (tx, ty, tz), self.fov_deg, (ux, uy, uz))
