"""PLY files: polygons and strips, normals, texture coordinates of vertices or corners, colours of vertices or faces.

Colours of 8 or 16 bits are taken as sRGB, colours in floating point as linear; transparency of both is dropped. A picture is
named in a comment, `TextureFile`, as MeshLab does, and v goes up; where its alpha is below a half there are holes. Of other
elements than vertices and faces nothing is read.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchharness.assets import pictures, ply_tables, polygons, surface
from benchharness.assets.asset import PLAIN, WHITE, Colour, Findings, Material, Part, Refused
from benchharness.assets.ply_tables import Table
from benchharness.modelling.alpha import AlphaMap
from benchharness.modelling.contour import Holes

COORDINATES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
COLOURS = (
    ("red", "green", "blue", "alpha"),
    ("diffuse_red", "diffuse_green", "diffuse_blue", "diffuse_alpha"),
    ("r", "g", "b", "a"),
)
READ = ("vertex", "face", "tristrips")


@dataclass(frozen=True, eq=False)
class _Faces:
    """Triangles of faces.

    place   int [T, 3], vertices
    owner   int [T], the face that each is cut from
    corner  int [T, 3], which of that face's corners, from 0
    table   what the file has of the faces
    """

    place: np.ndarray
    owner: np.ndarray
    corner: np.ndarray
    table: Table


def read(path: Path, findings: Findings) -> list[Part]:
    """The parts of a file, as it stands. Raises Refused."""
    header, tables = ply_tables.read(path.read_bytes())
    for name in tables:
        if name not in READ and tables[name].size:
            findings.say(f"elements {name!r} are left out")
    vertex = tables.get("vertex", Table())
    places = vertex.columns(("x", "y", "z"))
    if places is None:
        raise Refused("it has no vertices with x, y and z; accepted: an element 'vertex' with all three")
    faces = _faces(tables, places, findings)
    if faces is None:
        raise Refused(f"it has no faces, and {len(places)} points; accepted: a mesh with at least one triangle")
    normals = vertex.columns(("nx", "ny", "nz"))
    uvs, uv = _coordinates(vertex, faces, findings)
    colours, colour = _colours(vertex, faces, findings)
    materials, material = _materials(path, header.pictures, faces, PLAIN if colours is None else WHITE, findings)
    corners = surface.Corners(
        place=faces.place,
        places=places,
        material=material,
        normal=None if normals is None else faces.place,
        normals=normals,
        uv=uv,
        uvs=uvs,
        colour=colour,
        colours=colours,
    )
    return surface.parts(corners, materials, path.stem, findings)


def _faces(tables: dict[str, Table], places: np.ndarray, findings: Findings) -> _Faces | None:
    """The triangles of a file; None without any. Raises Refused for vertices that are not there."""
    table = tables.get("face", Table())
    named = [name for name in ("vertex_indices", "vertex_index") if name in table.lists]
    if table.size and not named:
        raise Refused(f"its faces have {sorted(table.kinds)}; accepted: a list vertex_indices")
    if table.size == 0:
        strips = [values for _, values in tables.get("tristrips", Table()).lists.values()]
        place = _strips(strips[0].astype(np.int64)) if strips else np.zeros((0, 3), np.int64)
        _check(place, places)
        owner, corner = np.arange(len(place)), np.zeros((len(place), 3), np.int64)
        return _Faces(place, owner, corner, Table()) if len(place) else None
    sizes, vertices = table.lists[named[0]][0], table.lists[named[0]][1].astype(np.int64)
    _check(vertices, places)
    few = sizes < 3
    findings.count("faces of fewer than three corners, left out", few.sum())
    if few.all():
        return None
    kept = np.flatnonzero(np.repeat(~few, sizes))
    triangles, crossing = polygons.triangulated(places[vertices[kept]], sizes[~few])
    findings.count("polygons that cross themselves, cut as they come", crossing)
    owner = np.flatnonzero(~few)[polygons.owners(sizes[~few])]
    corner = kept[triangles]
    return _Faces(vertices[corner], owner, corner - (np.cumsum(sizes) - sizes)[owner][:, None], table)


def _check(vertices: np.ndarray, places: np.ndarray) -> None:
    if vertices.size and (vertices.min() < 0 or vertices.max() >= len(places)):
        bad = int(vertices.min() if vertices.min() < 0 else vertices.max())
        raise Refused(f"a face names vertex {bad}; accepted: of {len(places)} vertices, from 0 on")


def _strips(values: np.ndarray) -> np.ndarray:
    """Triangles of strips, each of which ends at a -1, int [T, 3]."""
    strips = [strip[strip >= 0] for strip in np.split(values, np.flatnonzero(values < 0))]
    return np.concatenate([np.zeros((0, 3), np.int64), *(polygons.of_strip(strip) for strip in strips if len(strip) >= 3)])


def _coordinates(vertex: Table, faces: _Faces, findings: Findings) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Coordinates [N, 2] and the numbers of those of corners [T, 3]: of the faces' corners, else of vertices, else None."""
    if "texcoord" in faces.table.lists:
        lengths, values = faces.table.lists["texcoord"]
        sizes = next(lengths for name, (lengths, _) in faces.table.lists.items() if name.startswith("vertex_ind"))
        if ((lengths == 2 * sizes) | (lengths == 0)).all():
            start = (np.cumsum(lengths) - lengths) // 2
            has = (lengths > 0)[faces.owner][:, None]
            return values.reshape(-1, 2).astype(np.float64), np.where(has, start[faces.owner][:, None] + faces.corner, -1)
        findings.say("coordinates of faces are left out: they are not two for each corner")
    for names in COORDINATES:
        if (columns := vertex.columns(names)) is not None:
            return columns, faces.place
    return None, None


def _colours(vertex: Table, faces: _Faces, findings: Findings) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Linear colours [N, 3] and the numbers of those of corners [T, 3]: of vertices, else of faces, else None."""
    for table, number in ((vertex, faces.place), (faces.table, np.repeat(faces.owner[:, None], 3, axis=1))):
        for *names, alpha in COLOURS:
            columns = table.columns(tuple(names))
            if columns is None:
                continue
            if alpha in table.scalars:
                findings.say("transparency of colours is ignored")
            return _linear(columns, {table.kinds[name] for name in names}, findings), number
    return None, None


def _linear(values: np.ndarray, kinds: set[str], findings: Findings) -> np.ndarray:
    """Colours of a file, float64 [N, 3], of some types, as linear RGB."""
    if kinds <= {"f4", "f8"}:
        if values.max(initial=0.0) <= 1.0 + 1e-6:
            return np.clip(values, 0.0, 1.0)
        findings.say("colours in floating point go beyond 1, and count up to 255, as sRGB")
    return pictures.linear(values / (65535.0 if "u2" in kinds else 255.0))


def _materials(
    path: Path, named: list[str], faces: _Faces, plain: Colour, findings: Findings
) -> tuple[list[Material], np.ndarray]:
    """A material for every picture, and which each triangle has, int [T]."""
    numbers = faces.table.scalars.get("texnumber")
    if numbers is None and len(named) > 1:
        findings.say(f"pictures are ignored but for the first, as faces do not say which they have: {', '.join(named[1:])}")
    materials = []
    for name in named if numbers is not None else named[:1]:
        picture = pictures.named(path.parent, name, f"picture {name}", findings)
        alpha = None if picture is None else pictures.named(path.parent, name, f"picture {name}", findings, pictures.alpha)
        holes = None if alpha is None else Holes(0.5, AlphaMap(alpha))
        title = name.rpartition("/")[2].rpartition(".")[0]
        materials.append(Material(title, plain if picture is None else WHITE, picture, holes=holes, blends=holes is not None))
    materials.append(Material("", plain))
    none = len(materials) - 1
    if numbers is None:
        return materials, np.zeros(len(faces.owner), np.int64)  # the first picture, or none
    which = numbers.astype(np.int64)[faces.owner]
    return materials, np.where((which >= 0) & (which < none), which, none)
