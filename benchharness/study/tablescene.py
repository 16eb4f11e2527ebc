"""A scene out of a TOML table that names mesh files: the user's own models without a line of Python.

    [scenes.mine]
    frames = 25
    background = [0.2, 0.2, 0.2]
    objects = [{name = "room", mesh = "room.obj", albedo = [0.6, 0.5, 0.4], shows = "straight edges"},
               {name = "lamp", mesh = "lamp.obj", emission = [8, 8, 8], shows = "a highlight"}]
    reflectors = [{name = "ball", mesh = "ball.ply", translate = [0, 0, 1], eta = [0.2, 0.9, 1.1], k = [3.9, 2.4, 2.1]}]
    camera = {path = [[0, -4, 1.5], [1, -4, 1.5]], target = [0, 0, 1], fov_deg = 40}

Paths are relative to the config. OBJ, PLY and GLB are read by trimesh, vertices as they stand in the file
(right-handed, z up, metres; `scale`, then `rotate_deg` about x, y, z in this order, then `translate` bring others
there). A file's own normals are kept; one without has creases where
its faces turn by more than 60 degrees. Edges of objects longer than `h_max` metres, by default a twenty-fifth of the diagonal
of the box around all objects, are split before anything else: light lives at vertices, and images of straight edges are curves
that vertices follow. Colours and textures of a file are not read: albedo and emission are one colour
per object. Objects do not move; the eye goes along `path` at even pace between its points.

In place of `background`, `environment = "sky.exr"` names a panorama (latitude and longitude, EXR or HDR, linear) as it is
photographed, straight up in its first row and +x at its left and right ends, +y a quarter from the right; taken at
`environment_centre`, by default the origin.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import trimesh
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from benchharness.modelling.creases import creased
from benchharness.modelling.winding import is_closed
from benchharness.scene import Camera, Environment, Mesh, Object, Reflector, Scene, merged, subdivided, vertex_normals
from benchharness.study import plugins

SUFFIXES = (".obj", ".ply", ".glb")
PANORAMAS = (".exr", ".hdr")
SPLIT = 1 / 25  # of the diagonal of all objects: the longest edge, if nothing is said

Coordinate = Annotated[float, Field(ge=-1e9, le=1e9)]
Vector = tuple[Coordinate, Coordinate, Coordinate]
Share = Annotated[float, Field(ge=0, le=1)]
Positive = Annotated[float, Field(gt=0, le=1e9)]
Radiance = Annotated[float, Field(ge=0, le=1e9)]


class Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


class Placed(Table):
    name: str
    mesh: str
    translate: Vector = (0.0, 0.0, 0.0)
    rotate_deg: Vector = (0.0, 0.0, 0.0)
    scale: Positive = 1.0


class ObjectTable(Placed):
    shows: str
    albedo: tuple[Share, Share, Share] = (0.5, 0.5, 0.5)
    emission: tuple[Radiance, Radiance, Radiance] = (0.0, 0.0, 0.0)


class ReflectorTable(Placed):
    closed: str | None = None
    eta: tuple[Positive, Positive, Positive] | None = None
    k: tuple[Radiance, Radiance, Radiance] | None = None


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
        above = place.rpartition(".")[0]
        raise ValueError(f"{where}{above}: key {plugins.unknown(list(error['loc'])[-1], model.model_fields)}")
    if error["type"] == "missing":
        raise ValueError(f"{where}{place} is missing; accepted: see benchharness/study/tablescene.py")
    raise ValueError(f"{where}{place} is {json.dumps(error['input'])}; accepted: {error['msg']}")


def build(name: str, table: SceneTable, base: Path, where: str) -> Scene:
    """The scene of a validated table. `where` is 'file: section'. Raises ValueError that names the key at fault."""
    objects, reflectors = [], []
    for number, entry in enumerate(table.objects):
        mesh = load_mesh(base / entry.mesh, f"{where}.objects[{number}].mesh", entry)
        mesh = Mesh(mesh.vertices, mesh.faces, mesh.normals, entry.albedo, entry.emission)
        objects.append(Object(entry.name, mesh, entry.shows))
    for number, entry in enumerate(table.reflectors):
        key = f"{where}.reflectors[{number}]"
        if (entry.eta is None) != (entry.k is None):
            raise ValueError(f"{key} has only one of eta and k; accepted: both (a conductor) or none (an ideal mirror)")
        mesh = load_mesh(base / entry.mesh, f"{key}.mesh", entry)
        closed = None
        if entry.closed is not None:
            closed = load_mesh(base / entry.closed, f"{key}.closed", entry)
            if not is_closed(closed):
                raise ValueError(f"{key}.closed: {entry.closed} is not watertight; accepted: every edge has two faces")
        reflectors.append(Reflector(entry.name, mesh, closed, entry.eta, entry.k))
    for kind, names in [("objects", [o.name for o in objects]), ("reflectors", [r.name for r in reflectors])]:
        twice = sorted({n for n in names if names.count(n) > 1})
        if twice:
            raise ValueError(f"{where}.{kind}: the name {twice[0]!r} is there twice; accepted: one part per name")
    environment = _environment(table, base, where)
    corners = np.concatenate([o.mesh.vertices for o in objects])
    h_max = table.h_max or SPLIT * float(np.linalg.norm(np.ptp(corners, axis=0)))
    try:
        split = tuple(replace(o, mesh=subdivided(o.mesh, h_max)) for o in objects)
    except ValueError as error:
        raise ValueError(f"{where}.objects: {error}") from None
    return Scene(
        name=name,
        objects=split,
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
    )


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


def load_mesh(path: Path, where: str, placed: Placed) -> Mesh:
    """A mesh file, put in its place. Raises ValueError for what is no file, no mesh, empty or not finite."""
    if path.suffix.lower() not in SUFFIXES:
        raise ValueError(f"{where} is {str(path)!r}; accepted: a file that ends in {', '.join(SUFFIXES)}")
    if not path.is_file():
        raise ValueError(f"{where}: there is no file {path}; accepted: a path relative to the config")
    try:
        pieces = list(_pieces(trimesh.load_scene(path, process=False)))
    except Exception as error:  # whatever a reader of meshes may raise
        raise ValueError(f"{where}: {path} cannot be read: {error}; accepted: triangle meshes") from error
    if sum(len(faces) for _, faces, _ in pieces) == 0:
        raise ValueError(f"{where}: {path} has no faces; accepted: a mesh with at least one triangle")
    for vertices, _, _ in pieces:
        if not np.isfinite(vertices).all():
            bad = int(np.flatnonzero(~np.isfinite(vertices).all(axis=1))[0])
            raise ValueError(f"{where}: vertex {bad} of {path} is {vertices[bad]}; accepted: finite coordinates")
    try:
        return merged(*(Mesh(v, f, n) for v, f, n in pieces if len(f))).transformed(_pose(placed))
    except ValueError as error:
        raise ValueError(f"{where}: {path}: {error}") from None


def _pieces(loaded: Any) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Vertices, faces and unit normals of every mesh of a trimesh.Scene, in the scene's space."""
    for node in sorted(loaded.graph.nodes_geometry):
        pose, geometry = loaded.graph[node]
        piece = loaded.geometry[geometry]
        if not isinstance(piece, trimesh.Trimesh):  # points and lines
            continue
        linear, faces = pose[:3, :3], np.asarray(piece.faces, np.int64)
        faces = faces[:, ::-1] if np.linalg.det(linear) < 0 else faces
        vertices = np.asarray(piece.vertices) @ linear.T + pose[:3, 3]
        if "vertex_normals" not in piece._cache:  # then trimesh would make some, smooth over every edge
            yield creased(vertices, faces) if len(faces) and np.isfinite(vertices).all() else (vertices, faces, vertices)
            continue
        normals = np.asarray(piece.vertex_normals, np.float64) @ np.linalg.inv(linear)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        own = np.isfinite(length) & (length > 0)
        yield vertices, faces, np.where(own, normals / np.where(own, length, 1.0), vertex_normals(vertices, faces))


def _pose(placed: Placed) -> np.ndarray:
    """Scale, then turns about x, y and z, then the translation, float64 [4, 4]."""
    pose = np.eye(4)
    for axis, angle in enumerate(np.radians(placed.rotate_deg)):
        turn, (i, j) = np.eye(3), [(1, 2), (2, 0), (0, 1)][axis]
        turn[[i, i, j, j], [i, j, i, j]] = [np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)]
        pose[:3, :3] = turn @ pose[:3, :3]
    pose[:3, :3] *= placed.scale
    pose[:3, 3] = placed.translate
    return pose


def _camera(table: SceneTable) -> Any:
    """Time in seconds -> Camera: the first eye at frame 0, the last at the last frame."""
    path, camera = np.array(table.camera.path), table.camera
    last = (table.frames - 1) / table.fps

    def at(time: float) -> Camera:
        along = 0.0 if last == 0 else min(max(time / last, 0.0), 1.0) * (len(path) - 1)
        x, y, z = (float(np.interp(along, np.arange(len(path)), path[:, axis])) for axis in range(3))
        return Camera((x, y, z), camera.target, camera.fov_deg, camera.up)

    return at
