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
has the creases of its smoothing groups, or where its faces turn by 60 degrees or more. A file of several materials is an
object for each, `name/material`, in the colours and with the pictures that the file has; `albedo` and `emission` replace these,
and an albedo makes it one object. Light does not hang on how finely they are cut (`benchharness.render.bake`). Edges of objects
longer than `h_max` metres are split before anything else, if that is said: images of straight edges are curves, which some
methods draw straight from vertex to vertex.

`normal_map = "waves.png"` of a mirror is a picture of numbers that turn its normals, at the uv of its file
(`benchharness.modelling.normalmap`).

`node` and `material`, a name or a list, take of a file only what is at or below such a node, or of such a material, and
`without = {material = "glass"}` leaves it out: one file can hold a room and its mirrors. Nodes of OBJ are its objects and
groups.

What has `keys = [{time = 0}, {time = 2, translate = [1, 0, 0], rotate_deg = [0, 0, 90]}]` moves, objects and mirrors: at a key
it is where an entry without keys is that says the same (`benchharness.study.moving`). The eye goes along `path` at even pace
between its points; or from key to key, `keys = [{time = 0, eye = [0, -4, 1.5], target = [0, 0, 1]}, ...]`, with `target`,
`fov_deg` and `up` of the keys or of the camera. Times are seconds, frame i being at i / `fps`; all is held beyond the first key
and the last. Light is that of time 0: shadows do not follow what moves.

Of glTF, `animation = "name"`, or its number, moves and turns the nodes of an object or a mirror; what it bends or sizes is
refused. `camera = {file = "room.glb", node = "eye"}` is a camera of such a file, in the place that `scale` and the others give
to that file, moved by an `animation` of its own.

`lights = [{position = [0, 0, 2], intensity = [5, 5, 5]}]` are points that shine, at most four, which stand still; `{file =
"room.glb"}` among them is the point lights of that file (KHR_lights_punctual), where `scale` and the others put it. Their light
is baked with that of all else.

In place of `background`, `environment = "sky.exr"` names a panorama (latitude and longitude, EXR or HDR, linear) as it is
photographed, straight up in its first row and +x at its left and right ends, +y a quarter from the right; taken at
`environment_centre`, by default the origin.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, ValidationError

from benchharness.assets.gltf import ANIMATIONS, CAMERAS, LIGHTS
from benchharness.modelling.winding import is_closed
from benchharness.scene import Environment, Object, Reflector, Scene, subdivided
from benchharness.study import lighting, moving, normalmaps, placed, plugins, viewing
from benchharness.study.entries import Fit, Key, ObjectTable, Placed, Positive, Radiance, ReflectorTable, Table, Taken, Vector
from benchharness.study.lighting import LightTable
from benchharness.study.viewing import CameraKey, CameraTable

PANORAMAS = (".exr", ".hdr")


class SceneTable(Table):
    objects: Annotated[list[ObjectTable], Field(min_length=1)]
    reflectors: Annotated[list[ReflectorTable], Field(min_length=1)]
    camera: CameraTable
    lights: list[LightTable] = Field(default_factory=list)
    frames: Annotated[int, Field(ge=1, le=100_000)] = 1
    fps: Positive = 25.0
    near: Positive | None = None
    background: tuple[Radiance, Radiance, Radiance] = (0.0, 0.0, 0.0)
    environment: str | None = None
    environment_centre: Vector | None = None
    ppd: Positive = 67.0
    exposure: Annotated[float, Field(ge=-64, le=64)] = 0.0
    h_max: Positive | None = None


TABLES: dict[str, type[Table]] = {
    "objects": ObjectTable,
    "reflectors": ReflectorTable,
    "camera": CameraTable,
    "camera.keys": CameraKey,
    "fit": Fit,
    "without": Taken,
    "keys": Key,
    "lights": LightTable,
}
"""What a key of a table is itself, for who asks which keys it may have."""


def validated(table: dict[str, Any], where: str) -> SceneTable:
    """The table, checked. Raises ValueError that names the key, its value and what would be accepted."""
    try:
        return SceneTable.model_validate_json(json.dumps(table, default=str))
    except ValidationError as failed:
        error = failed.errors()[0]
    place = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in error["loc"])
    if error["type"] == "extra_forbidden":
        tables = [step for step in error["loc"][:-1] if isinstance(step, str)]
        model = TABLES.get(".".join(tables)) or TABLES[tables[-1]] if tables else SceneTable
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
    used: list[tuple[str | None, str]] = [(table.camera.file, CAMERAS), *((light.file, LIGHTS) for light in table.lights)]
    used += [(e.mesh, ANIMATIONS) for e in (*table.objects, *table.reflectors) if e.animation is not None]
    files, last = placed.Files(base, used), (table.frames - 1) / table.fps
    for number, entry in enumerate(table.objects):
        found, said = _objects(files, entry, f"{where}.objects[{number}]")
        objects += found
        notes += said
    for number, entry in enumerate(table.reflectors):
        mirror, said = _mirror(files, entry, f"{where}.reflectors[{number}]")
        reflectors.append(mirror)
        notes += said
    for kind, names in [("objects", [o.name for o in objects]), ("reflectors", [r.name for r in reflectors])]:
        twice = sorted({n for n in names if names.count(n) > 1})
        if twice:
            raise ValueError(f"{where}.{kind}: the name {twice[0]!r} is there twice; accepted: one part per name")
    camera, said = viewing.camera(table.camera, files, last, f"{where}.camera")
    lights, words = lighting.lights(table.lights, files, f"{where}.lights")
    notes += [*said, *words]
    notes += _unseen([*(part.motion for part in (*objects, *reflectors)), camera], table, last)
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
        camera=camera,
        frames=table.frames,
        fps=table.fps,
        near=table.near,
        background=table.background,
        ppd=table.ppd,
        exposure=table.exposure,
        source=table.model_dump(mode="json"),
        environment=environment,
        lights=lights,
        lightmaps=True,
    )
    return scene, notes


def _objects(files: placed.Files, entry: ObjectTable, key: str) -> tuple[list[Object], list[str]]:
    """The objects of an entry, and what has to be said of them."""
    asset = files.asset(entry.mesh, f"{key}.mesh", entry)
    at = placed.pose(asset, entry, key)
    asset = placed.taken(asset, entry, key)
    motions = moving.Motions(asset, entry, at, key)
    found, said = _made(placed.objects, f"{key}.mesh: {files.base / entry.mesh}", asset, entry, at, motions)
    return found, placed.notes("object", entry.name, asset, at, said)


def _mirror(files: placed.Files, entry: ReflectorTable, key: str) -> tuple[Reflector, list[str]]:
    """The mirror of an entry, and what has to be said of it."""
    if (entry.eta is None) != (entry.k is None):
        raise ValueError(f"{key} has only one of eta and k; accepted: both (a conductor) or none (an ideal mirror)")
    asset = files.asset(entry.mesh, f"{key}.mesh", entry)
    at = placed.pose(asset, entry, key)
    asset = placed.taken(asset, entry, key)
    motion = moving.Motions(asset, entry, at, key).of_all()
    mesh = _made(placed.mesh, f"{key}.mesh: {files.base / entry.mesh}", asset, at)
    turned, said = None, []
    if entry.normal_map is not None:
        turned, said = normalmaps.read(files.base / entry.normal_map, f"{key}.normal_map", mesh)
    closed = None
    if entry.closed is not None:
        shape = Placed(name=entry.name, mesh=entry.closed, up=entry.up)
        around = files.asset(entry.closed, f"{key}.closed", shape)
        closed = _made(placed.mesh, f"{key}.closed: {files.base / entry.closed}", around, at)
        if not is_closed(closed):
            raise ValueError(f"{key}.closed: {entry.closed} is not watertight; accepted: every edge has two faces")
    mirror = Reflector(entry.name, mesh, closed, entry.eta, entry.k, motion, normal_map=turned)
    return mirror, placed.notes("mirror", entry.name, asset, at, said)


def _unseen(ways: Iterable[Any], table: SceneTable, last: float) -> list[str]:
    """A sentence where motions go on after the last frame."""
    end = max((getattr(way, "end", 0.0) for way in ways), default=0.0)
    if end <= last + 1 / table.fps:
        return []
    said = f"what moves goes on to {end:.4g} s, and {table.frames} frames at {table.fps:g} a second to {last:.4g} s"
    return [f"{said}: see `frames`"]


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
    placed.existing(path, f"{where}.environment")
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
