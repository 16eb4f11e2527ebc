"""Point lights of a scene's table: said there, or those of a glTF file."""

from __future__ import annotations

import numpy as np

from benchharness.assets import reading
from benchharness.scene import MOST_LIGHTS, PointLight
from benchharness.study.entries import Names, Place, Placed, Radiance, Vector
from benchharness.study.placed import Files, existing, pose, refusals


class LightTable(Place):
    """A light, `position` in metres and `intensity` in W/sr; or those of a `file`, at or below `node`, a name or a list, where
    the file is placed."""

    position: Vector | None = None
    intensity: tuple[Radiance, Radiance, Radiance] | None = None
    file: str | None = None
    node: Names | None = None


def lights(tables: list[LightTable], files: Files, where: str) -> tuple[tuple[PointLight, ...], list[str]]:
    """The lights, and what has to be said of them. Raises ValueError that names the key at fault."""
    found: list[PointLight] = []
    said: list[str] = []
    for number, table in enumerate(tables):
        key = f"{where}[{number}]"
        given = {name for name, field in LightTable.model_fields.items() if getattr(table, name) != field.default}
        if given == {"position", "intensity"} and table.position is not None and table.intensity is not None:
            found.append(PointLight(table.position, table.intensity))
        elif table.file is not None and not given & {"position", "intensity"}:
            more, words = _of_file(table, table.file, files, key)
            found += more
            said += words
        else:
            has = ", ".join(sorted(given)) or "nothing"
            raise ValueError(f"{key} has {has}; accepted: position and intensity, or a file and where it is")
    if len(found) > MOST_LIGHTS:
        raise ValueError(f"{where} are {len(found)} with those of files; accepted: at most {MOST_LIGHTS}")
    return tuple(found), said


def _of_file(table: LightTable, name: str, files: Files, key: str) -> tuple[list[PointLight], list[str]]:
    """The lights of a file. What they throw on its surfaces stays the same however the table sizes it."""
    path = existing(files.base / name, f"{key}.file")
    with refusals(path, f"{key}.file"):
        lamps, words = reading.lamps(path, table.node)
    whole = None if table.fit is None else files.asset(name, f"{key}.file", Placed(name=name, mesh=name))
    at = pose(whole, table, key)
    larger = float(np.linalg.det(at[:3, :3])) ** (2 / 3)
    found = []
    for lamp in lamps:
        x, y, z = (at[:3, :3] @ lamp.position + at[:3, 3]).tolist()
        r, g, b = (larger * lamp.intensity).tolist()
        found.append(PointLight((x, y, z), (r, g, b)))
    return found, [f"lights, {path.name}: {'; '.join(words)}"] if words else []
