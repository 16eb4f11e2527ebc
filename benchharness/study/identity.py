"""Hashes that say whether two numbers may be compared: of a scene's content, of a method's source, of a config."""

from __future__ import annotations

import hashlib
import inspect
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import benchharness
from benchharness.scene import Mesh, Object, Scene, Texture
from benchharness.study import plugins

LENGTH = 16
"""Hexadecimal digits kept: 64 bits, far beyond chance among the runs of one project."""
STEP = 0.7368e-7
"""Of an array's largest number: what is nearer is the same. Sines and roots differ in their last digit from processor to
processor, and a baseline is for all of them. No round number, as numbers that are made lie on those."""


def of_scene(scene: Scene) -> str:
    """Of everything that a picture of the scene is made from, over its whole animation; names and `shows` are not."""
    digest = hashlib.sha256()
    for part in scene.parts:
        digest.update(type(part).__name__.encode())
        _add_mesh(digest, part.mesh)
        if isinstance(part, Object) and part.gloss is not None:
            digest.update(json.dumps(["gloss", part.gloss.specular, part.gloss.exponent]).encode())
    for reflector in scene.reflectors:
        digest.update(json.dumps([reflector.eta, reflector.k, reflector.closed is not None]).encode())
        if reflector.closed is not None:
            _add_mesh(digest, reflector.closed)
        if reflector.normal_map is not None and reflector.mesh.uv is not None:
            _add_picture(digest, "normal map", reflector.normal_map, reflector.mesh.uv)
    for frame in range(scene.frames):
        time = scene.time(frame)
        camera = scene.camera(time)
        for values in (scene.poses(time), camera.eye, camera.target, camera.up, [camera.fov_deg]):
            _add(digest, values)
    constants = [scene.frames, scene.fps, scene.near_plane, *scene.background, scene.ppd, scene.exposure, scene.h_max or 0.0]
    for constant in constants:
        _add(digest, [constant])
    if scene.lights:
        digest.update(json.dumps(["lights", [[light.position, light.intensity] for light in scene.lights]]).encode())
    if scene.lightmaps:
        digest.update(b"lightmaps")
    if scene.environment is not None:
        digest.update(f"environment {scene.environment.ground}".encode())
        _add(digest, scene.environment.radiance)
        if scene.environment.centre is not None:
            _add(digest, scene.environment.centre)
    return digest.hexdigest()[:LENGTH]


def of_method(method: type) -> str:
    """Of the file that defines the class, of what that imports beside itself, and of the sources of `benchharness.kernels`.

    Raises ValueError where the class has no file.
    """
    try:
        source = inspect.getsourcefile(method)
    except TypeError:
        source = None
    if source is None:
        raise ValueError(f"there is no source file of {method.__name__}; accepted: a class that a file defines")
    kernels = Path(benchharness.__file__).parent / "kernels"
    digest = hashlib.sha256(Path(source).read_bytes())
    for name, file in plugins.beside(Path(source), plugins.package_of(method)):
        digest.update(name.encode() + b"\0" + file.read_bytes())
    for file in sorted(kernels.rglob("*.py")):
        digest.update(file.relative_to(kernels).as_posix().encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()[:LENGTH]


def of_options(options: Mapping[str, Any]) -> str:
    """Of plain values, whatever the order of their keys."""
    return hashlib.sha256(json.dumps(options, sort_keys=True).encode()).hexdigest()[:LENGTH]


def _add_mesh(digest: Any, mesh: Mesh) -> None:
    for values in (mesh.vertices, mesh.faces, mesh.normals, mesh.albedo, mesh.emission, mesh.radiance):
        _add(digest, np.zeros(0) if values is None else values)
    if mesh.visibility is not None:
        digest.update(b"visibility")
        _add(digest, mesh.visibility)
    if mesh.texture is not None and mesh.uv is not None:
        _add_picture(digest, "texture", mesh.texture, mesh.uv)
    if mesh.light is not None and mesh.light_at is not None:
        digest.update(b"light")
        _add(digest, mesh.light_at)
        _add(digest, mesh.light.samples)


def _add_picture(digest: Any, kind: str, picture: Texture, uv: np.ndarray) -> None:
    digest.update(" ".join((kind, *picture.along)).encode())
    _add(digest, uv)
    _add(digest, np.round(65535 * picture.pixels).astype(np.uint16))


def _add(digest: Any, values: ArrayLike) -> None:
    """Shape and numbers: integers as they are, others in multiples of STEP of the largest, which is told to seven digits."""
    array = np.asarray(values)
    if not np.issubdtype(array.dtype, np.integer):
        most = float(np.abs(array).max(initial=0.0))
        digest.update(f"{most:.6e}".encode())
        array = np.round(array / (STEP * max(most, 1e-300))).astype(np.int64)
    digest.update(str(array.shape).encode() + np.ascontiguousarray(array).tobytes())
