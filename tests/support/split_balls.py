"""A ball as programs write it: the same triangles, their vertices shared or split, in files of several formats.

Coordinates are those of single precision, which every format keeps. The ball lies at the origin, its poles along z, and what
splits it is seen from -y.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from support.gltf_files import Gltf
from support.mesh_cases_obj import faces, rows
from support.mesh_cases_ply import stl

from benchharness.scene import vertex_normals

RADIUS = 0.5
_shape = trimesh.creation.icosphere(subdivisions=5, radius=RADIUS)
PLACES = np.array(_shape.vertices, np.float32).astype(float)
FACES = np.array(_shape.faces)
NORMALS = PLACES / np.linalg.norm(PLACES, axis=1, keepdims=True)
FAR = PLACES[FACES].mean(axis=1) @ (1.0, -0.3, 0.4) > 0.03


def welded(folder: Path) -> Path:
    """A vertex for every place, with its normal."""
    return _obj(folder, rows("v", PLACES) + rows("vn", NORMALS) + faces(FACES, "{0}//{0}"))


def bare(folder: Path) -> Path:
    """A vertex for every place, without a normal."""
    return _obj(folder, rows("v", PLACES) + faces(FACES))


def seam(folder: Path) -> Path:
    """Coordinates of a picture once around it: places come twice where they begin anew, and for every triangle at a pole."""
    place, uv, corners = _split()
    return _obj(folder, _picked(PLACES[place], uv, NORMALS[place], corners))


def rounded(folder: Path) -> Path:
    """The same, what is split found on each side by itself: the last digit of single precision is another."""
    place, uv, corners = _split()
    places = PLACES[place].astype(np.float32)
    twice = np.bincount(place)[place] > 1
    turned = np.random.default_rng(0).choice([-np.inf, np.inf], places[twice].shape).astype(np.float32)
    places[twice] = np.nextafter(places[twice], turned)
    return _obj(folder, _picked(places.astype(float), uv, NORMALS[place], corners))


def torn(folder: Path) -> Path:
    """The same with the normals that each side of the seam would have without the other: an edge that is to be seen."""
    place, uv, corners = _split()
    return _obj(folder, _picked(PLACES[place], uv, vertex_normals(PLACES[place], corners), corners))


def materials(folder: Path) -> Path:
    """Two of them, whose triangles take turns in the file."""
    half = len(FACES) // 4
    near, far = FACES[~FAR], FACES[FAR]
    runs = (("near", near[:half]), ("far", far), ("near", near[half:]))
    said = "".join(f"usemtl {name}\n{faces(some, '{0}//{0}')}" for name, some in runs)
    return _obj(folder, rows("v", PLACES) + rows("vn", NORMALS) + said)


def loose(folder: Path) -> Path:
    """STL: every triangle has vertices of its own, and none a normal."""
    return stl(PLACES[FACES])(folder)


def primitives(folder: Path) -> Path:
    """GLB: two primitives of one mesh, each with vertices of its own; y is up."""
    document, parts = Gltf(), []
    for which in (~FAR, FAR):
        used, corners = np.unique(FACES[which], return_inverse=True)
        places, normals = (np.stack([a[used, 0], a[used, 2], -a[used, 1]], axis=1) for a in (PLACES, NORMALS))
        parts.append(document.primitive(places, corners.reshape(-1, 3), NORMAL=normals))
    document.node(document.mesh(*parts))
    return document.write(folder)


KINDS: dict[str, Callable[[Path], Path]] = {
    kind.__name__: kind for kind in (welded, seam, rounded, materials, bare, loose, primitives, torn)
}


def _split() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The place of each of the split vertices [V], their coordinates [V, 2], and faces [F, 3] of them."""
    u, v = (np.arctan2(PLACES[:, 0], PLACES[:, 1]) / (2 * np.pi))[FACES], np.arccos(NORMALS[:, 2]) / np.pi
    u = u + ((np.ptp(u, axis=1, keepdims=True) > 0.5) & (u < 0))
    pole = np.linalg.norm(PLACES[FACES][..., :2], axis=2) < 1e-6
    u = np.where(pole, u.mean(axis=1, keepdims=True), u)
    at = np.column_stack([FACES.reshape(-1), u.reshape(-1), v[FACES].reshape(-1)])
    vertices, corner = np.unique(at, axis=0, return_inverse=True)
    return vertices[:, 0].astype(int), vertices[:, 1:], corner.reshape(-1, 3)


def _picked(places: np.ndarray, uv: np.ndarray, normals: np.ndarray, corners: np.ndarray) -> str:
    return rows("v", places) + rows("vt", uv) + rows("vn", normals) + faces(corners, "{0}/{0}/{0}")


def _obj(folder: Path, said: str) -> Path:
    (folder / "ball.obj").write_text(said)
    return folder / "ball.obj"
