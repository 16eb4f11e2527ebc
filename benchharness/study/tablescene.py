"""A scene out of a TOML table that names mesh files: the user's own models without a line of Python.

    [scenes.mine]
    frames = 25
    background = [0.2, 0.2, 0.2]
    objects = [{name = "room", mesh = "room.obj", albedo = [0.6, 0.5, 0.4], shows = "straight edges"},
               {name = "lamp", mesh = "lamp.obj", emission = [8, 8, 8]},
               {name = "chair", mesh = "chair.glb", fit = {centre = [1, 0, 0.5], size = 1.0}}]
    reflectors = [{name = "ball", mesh = "ball.ply", translate = [0, 0, 1], eta = [0.2, 0.9, 1.1], k = [3.9, 2.4, 2.1]}]
    camera = {path = [[0, -4, 1.5], [1, -4, 1.5]], target = [0, 0, 1], fov_deg = 40}

Paths are relative to the config. OBJ, PLY, STL, GLB and glTF are read by `benchharness.assets`: all parts and materials, right
or refused; what was mended or left out is said. The scene is right-handed, z up, in metres: `up`, `unit`, `scale`,
`rotate_deg`, `translate` and `fit` bring files there (`benchharness.study.placed`). A file's own normals are kept; one without
has the creases of its smoothing groups, or where its faces turn by more than 60 degrees. A file of several materials is an
object for each, `name/material`, in the colours and with the pictures that the file has; `albedo` and `emission` replace these,
and an albedo makes it one object. Light does not hang on how finely they are cut (`benchharness.render.bake`). Edges of objects
longer than `h_max` metres are split before anything else, if that is said: images of straight edges are curves, which some
methods draw straight from vertex to vertex. Objects do not move; the eye goes along `path` at even pace between its points.

In place of `background`, `environment = "sky.exr"` names a panorama (latitude and longitude, EXR or HDR, linear) as it is
photographed, straight up in its first row and +x at its left and right ends, +y a quarter from the right; taken at
`environment_centre`, by default the origin.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, ValidationError

from benchharness.modelling.winding import is_closed
from benchharness.scene import Camera, Environment, Reflector, Scene, subdivided
from benchharness.study import placed, plugins
from benchharness.study.placed import Fit, ObjectTable, Positive, Radiance, ReflectorTable, Table, Vector

PANORAMAS = (".exr", ".hdr")


class CameraTable(Table):
    path: Annotated[list[Vector], Field(min_length=1)]
    target: Vector
    fov_deg: Annotated[float, Field(gt=0, lt=180)]
    up: Vector = (0.0, 0.0, 1.0)


class SceneTable(Table):
    objects: Annotated[list[ObjectTable], Field(min_length=1)]
    reflectors: Annotated[list[ReflectorTable], Field(min_length=1)]
    camera: CameraTable
    frames: Annotated[int, Field(ge=1, le=100_000)] = 1
    fps: Positive = 25.0
    near: Positive | None = None
    background: tuple[Radiance, Radiance, Radiance] = (0.0, 0.0, 0.0)
    environment: str | None = None
    environment_centre: Vector | None = None
    ppd: Positive = 67.0
    exposure: Annotated[float, Field(ge=-64, le=64)] = 0.0
    h_max: Positive | None = None


def validated(table: dict[str, Any], where: str) -> SceneTable:
    """The table, checked. Raises ValueError that names the key, its value and what would be accepted."""
    try:
        return SceneTable.model_validate_json(json.dumps(table, default=str))
    except ValidationError as failed:
        error = failed.errors()[0]
    place = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in error["loc"])
    if error["type"] == "extra_forbidden":
        sections = {"objects": ObjectTable, "reflectors": ReflectorTable, "camera": CameraTable}
        model = sections[str(error["loc"][0])] if len(error["loc"]) > 1 else SceneTable
        model = Fit if "fit" in error["loc"][:-1] else model
        above = place.rpartition(".")[0]
        raise ValueError(f"{where}{above}: key {plugins.unknown(list(error['loc'])[-1], model.model_fields)}")
    if error["type"] == "missing":
        raise ValueError(f"{where}{place} is missing; accepted: see benchharness/study/tablescene.py")
    raise ValueError(f"{where}{place} is {json.dumps(error['input'])}; accepted: {error['msg'].removeprefix('Value error, ')}")


def build(name: str, table: SceneTable, base: Path, where: str) -> Scene:
    """The scene of a validated table. `where` is 'file: section'. Raises ValueError that names the key at fault."""
    return built(name, table, base, where)[0]


def built(name: str, table: SceneTable, base: Path, where: str) -> tuple[Scene, list[str]]:
    """The same, and sentences about what was mended of its files, or left out."""
    objects, reflectors, notes = [], [], []
    for number, entry in enumerate(table.objects):
        key = f"{where}.objects[{number}]"
        asset = placed.read(base / entry.mesh, f"{key}.mesh", entry)
        at = placed.pose(asset, entry, key)
        found, said = _made(placed.objects, f"{key}.mesh: {base / entry.mesh}", asset, entry, at)
        objects += found
        notes += placed.notes("object", entry.name, asset, at, said)
    for number, entry in enumerate(table.reflectors):
        key = f"{where}.reflectors[{number}]"
        if (entry.eta is None) != (entry.k is None):
            raise ValueError(f"{key} has only one of eta and k; accepted: both (a conductor) or none (an ideal mirror)")
        asset = placed.read(base / entry.mesh, f"{key}.mesh", entry)
        at = placed.pose(asset, entry, key)
        mesh = _made(placed.mesh, f"{key}.mesh: {base / entry.mesh}", asset, at)
        notes += placed.notes("mirror", entry.name, asset, at, [])
        closed = None
        if entry.closed is not None:
            around = placed.read(base / entry.closed, f"{key}.closed", entry)
            closed = _made(placed.mesh, f"{key}.closed: {base / entry.closed}", around, at)
            if not is_closed(closed):
                raise ValueError(f"{key}.closed: {entry.closed} is not watertight; accepted: every edge has two faces")
        reflectors.append(Reflector(entry.name, mesh, closed, entry.eta, entry.k))
    for kind, names in [("objects", [o.name for o in objects]), ("reflectors", [r.name for r in reflectors])]:
        twice = sorted({n for n in names if names.count(n) > 1})
        if twice:
            raise ValueError(f"{where}.{kind}: the name {twice[0]!r} is there twice; accepted: one part per name")
    environment = _environment(table, base, where)
    try:
        if table.h_max is not None:
            objects = [replace(o, mesh=subdivided(o.mesh, table.h_max)) for o in objects]
    except ValueError as error:
        raise ValueError(f"{where}.objects: {error}") from None
    scene = Scene(
        name=name,
        objects=tuple(objects),
        reflectors=tuple(reflectors),
        camera=_camera(table),
        frames=table.frames,
        fps=table.fps,
        near=table.near,
        background=table.background,
        ppd=table.ppd,
        exposure=table.exposure,
        source=table.model_dump(mode="json"),
        environment=environment,
        lightmaps=True,
    )
    return scene, notes


def _environment(table: SceneTable, base: Path, where: str) -> Environment | None:
    """The panorama of a table; ValueError beside a background, and for a file that holds none."""
    if table.environment is None:
        if table.environment_centre is not None:
            raise ValueError(f"{where}.environment_centre is there without an environment; accepted: both or none")
        return None
    if any(table.background):
        raise ValueError(f"{where} has a background and an environment; accepted: one of them")
    path = base / table.environment
    if path.suffix.lower() not in PANORAMAS:
        raise ValueError(f"{where}.environment is {str(path)!r}; accepted: a file that ends in {', '.join(PANORAMAS)}")
    if not path.is_file():
        raise ValueError(f"{where}.environment: there is no file {path}; accepted: a path relative to the config")
    import mitsuba as mi  # late: reading a config needs it for panoramas alone

    try:
        picture = mi.Bitmap(str(path)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
        seen = np.array(picture, np.float64)
    except Exception as error:  # whatever a reader of pictures may raise
        raise ValueError(f"{where}.environment: {path} cannot be read: {error}; accepted: an RGB panorama") from error
    try:
        return Environment.from_picture(seen, table.environment_centre or (0.0, 0.0, 0.0))
    except ValueError as error:
        raise ValueError(f"{where}.environment: {path}: {error}") from None


def _made(make: Callable, what: str, *arguments: Any) -> Any:
    """What `make` makes; ValueError that says of `what` where that is no mesh."""
    try:
        return make(*arguments)
    except ValueError as error:
        raise ValueError(f"{what}: {error}") from None


def _camera(table: SceneTable) -> Any:
    """Time in seconds -> Camera: the first eye at frame 0, the last at the last frame."""
    path, camera = np.array(table.camera.path), table.camera
    last = (table.frames - 1) / table.fps

    def at(time: float) -> Camera:
        along = 0.0 if last == 0 else min(max(time / last, 0.0), 1.0) * (len(path) - 1)
        x, y, z = (float(np.interp(along, np.arange(len(path)), path[:, axis])) for axis in range(3))
        return Camera((x, y, z), camera.target, camera.fov_deg, camera.up)

    return at
