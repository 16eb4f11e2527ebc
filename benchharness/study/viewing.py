"""The camera of a scene's table: a path at even pace, or keys."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from benchharness.modelling.motion import Track
from benchharness.scene import Camera
from benchharness.study.entries import Coordinate, Table, Vector
from benchharness.study.moving import ascending

Degrees = Annotated[float, Field(gt=0, lt=180)]


class CameraKey(Table):
    """Where the eye is at a time; what it does not say of the rest is what the camera says."""

    time: Coordinate
    eye: Vector
    target: Vector | None = None
    fov_deg: Degrees | None = None
    up: Vector | None = None


class CameraTable(Table):
    """path: eyes, from the first frame to the last; keys: eyes at times"""

    path: Annotated[list[Vector], Field(min_length=1)] | None = None
    keys: Annotated[list[CameraKey], Field(min_length=1)] | None = None
    target: Vector | None = None
    fov_deg: Degrees | None = None
    up: Vector = (0.0, 0.0, 1.0)


def camera(table: CameraTable, last: float, where: str) -> Callable[[float], Camera]:
    """Time in seconds -> Camera; `last` is that of the last frame. Raises ValueError that names the key at fault."""
    given = [name for name in ("path", "keys") if getattr(table, name) is not None]
    if len(given) != 1:
        said = "neither path nor keys" if not given else "path and keys"
        raise ValueError(f"{where} has {said}; accepted: one of them")
    if table.path is not None:
        return _along(table.path, _of_all(table, "target", where), _of_all(table, "fov_deg", where), table.up, last)
    keys = table.keys or []
    times = ascending([key.time for key in keys], where)
    rows = []
    for number, key in enumerate(keys):
        of_key = {name: getattr(key, name) for name in ("target", "fov_deg", "up")}
        here = {name: getattr(table, name) if value is None else value for name, value in of_key.items()}
        for name, value in here.items():
            if value is None:
                raise ValueError(f"{where}.keys[{number}].{name} is missing; accepted: in every key, or once in {where}")
        rows.append([*key.eye, *here["target"], *here["up"], here["fov_deg"]])
    return _Keyed(Track(times, np.array(rows, np.float64)))


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
