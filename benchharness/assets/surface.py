"""Triangles as files have them -> parts: what is nothing is left out, normals are the file's or made, and vertices are few.

A file numbers places, normals, texture coordinates and colours each for itself (OBJ), or all alike (glTF, PLY), or not at all
(STL). So a corner of a triangle is four numbers here, -1 for what it lacks. What is equal counts as one, however often a file
has it, and so do places but for rounding: normals are made over places, not over a seam of a texture or a material, and two
corners are one vertex if all that they have is the same.

The winding of the faces is taken as the file has it, and normals that point away from all faces around them are turned. Which
side of a surface is its front is asked of the whole scene, later.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from benchharness.assets.asset import Findings, Material, Part, Refused
from benchharness.modelling import creases, winding
from benchharness.modelling.rows import distinct

NO_AREA = 1e-7  # of a face's longest edge, squared: what single precision makes of corners in one line
ROUNDED = 2.5e-7  # of a file's size and its way from the origin: places nearer to each other are one, found twice in float32
AT_MOST = 2e-6  # of its size
TURNED_AWAY = 1e-6  # of the area around a vertex: less than this is neither side
OFF_DEG = 30.0  # between a corner's normal and its face: seen from the side, more of it shows what is behind

TWICE = "faces with two corners at one place, left out"
NEEDLES = "faces with their corners in one line, left out"
MADE_ANEW = "vertices whose normal in the file is no direction, made from the faces around"
LACKING = "vertices without a normal in a file that has some, made from the faces around"
AWAY = "vertices whose normal in the file points away from the faces around, turned"
AGAINST = "faces wound against their neighbours, turned"
OFF = f"corners whose normal is more than {OFF_DEG:g} degrees off their face, which may be black at grazing angles"
BY_ANGLE = f"normals are made, with creases where faces turn by {creases.CREASE_DEG:g} degrees or more, as the file has none"
BY_GROUP = "normals are made from the smoothing groups, as the file has none"
NO_COORDINATES = "parts with a picture and no coordinates for it, drawn in their plain colour"
NO_NUMBERS = "corners whose coordinates of a picture or colours are no numbers, left out"


@dataclass(frozen=True, eq=False)
class Corners:
    """Triangles, every corner of which says by number where it is and what it has there; -1 for nothing.

    place, places      int [F, 3], float64 [P, 3]
    normal, normals    int [F, 3], float64 [N, 3], of any length; None without any, as the next two
    uv, uvs            int [F, 3], float64 [T, 2], v up
    colour, colours    int [F, 3], float64 [C, 3], linear RGB, or [C, 4], and alpha
    material           int [F]
    group              int [F], smoothing groups, see `benchharness.modelling.creases`; None without any
    """

    place: np.ndarray
    places: np.ndarray
    material: np.ndarray
    normal: np.ndarray | None = None
    normals: np.ndarray | None = None
    uv: np.ndarray | None = None
    uvs: np.ndarray | None = None
    colour: np.ndarray | None = None
    colours: np.ndarray | None = None
    group: np.ndarray | None = None

    def of(self, faces: np.ndarray) -> Corners:
        """Those of some faces, a mask or numbers."""
        return replace(self, **{name: value[faces] for name, value in self._per_face().items()})

    def wound(self, sign: np.ndarray) -> Corners:
        """With the faces of sign -1 turned."""
        per_corner = {name: winding.turned(value, sign) for name, value in self._per_face().items() if value.ndim == 2}
        return replace(self, **per_corner)

    def _per_face(self) -> dict[str, np.ndarray]:
        names = ("place", "material", "normal", "uv", "colour", "group")
        return {name: getattr(self, name) for name in names if getattr(self, name) is not None}


def parts(
    corners: Corners,
    materials: Sequence[Material],
    name: str,
    findings: Findings,
    nodes: Sequence[tuple[str, ...]] | None = None,
) -> list[Part]:
    """One part for each material that a face has, none of what is nothing; `nodes` is what each hangs on, by material. Raises
    Refused for places that are not finite."""
    if len(corners.place) == 0:
        return []
    corners = _real(_placed(corners), findings)
    if len(corners.place) == 0:
        return []
    corners = _lit(corners, findings)
    findings.count(OFF, _off(corners))
    found = [(m, _part(corners.of(corners.material == m), materials[m], name, findings)) for m in np.unique(corners.material)]
    return [part if nodes is None else replace(part, nodes=nodes[m]) for m, part in found]


def _placed(corners: Corners) -> Corners:
    """With one number for all that is at one place but for rounding, and none that no face has. Raises Refused, see `parts`."""
    used, place = np.unique(corners.place, return_inverse=True)
    places = corners.places[used]
    finite = np.isfinite(places).all(axis=1)
    if not finite.all():
        bad = int(used[~finite][0])
        raise Refused(f"vertex {bad}, counted from 0, is {corners.places[bad]}; accepted: finite coordinates")
    first, kind = distinct(places)
    places = places[first]
    alike = _alike(places)
    first, kind = np.unique(alike[kind], return_inverse=True)
    return replace(corners, place=kind.reshape(-1)[place.reshape(-1, 3)], places=places[first])


def _alike(places: np.ndarray) -> np.ndarray:
    """The first of all places [P, 3] that each is at but for rounding, int [P]: programs that find the two sides of a seam each
    by itself do not find the same."""
    size = float(np.ptp(places, axis=0).max())
    apart = min(ROUNDED * (size + float(np.abs(places).max())), AT_MOST * size)
    near = KDTree(places).query_pairs(apart, output_type="ndarray")
    joined = coo_array((np.ones(len(near)), near.T), shape=(len(places),) * 2)
    _, label = connected_components(joined, directed=False)
    return np.unique(label, return_index=True)[1][label]


def _real(corners: Corners, findings: Findings) -> Corners:
    """Without faces that have a place twice, and without those that have no area and hold nothing together."""
    twice = (corners.place == np.roll(corners.place, 1, axis=1)).any(axis=1)
    findings.count(TWICE, twice.sum())
    corners = corners.of(~twice)
    at = corners.places[corners.place]
    longest = np.square(np.roll(at, 1, axis=1) - at).sum(axis=2).max(axis=1)
    thin = np.linalg.norm(winding.crossed(corners.places, corners.place), axis=1) <= NO_AREA * longest
    if thin.any():  # one that shares all its edges stays, or there would be a gap of no width
        edges = winding.half_edges(corners.place)
        _, which, uses = np.unique(edges.key, return_inverse=True, return_counts=True)
        alone = np.bincount(edges.face, uses[which.reshape(-1)] < 2, len(thin)) > 0
        findings.count(NEEDLES, (thin & alone).sum())
        corners = corners.of(~(thin & alone))
    return corners


def _lit(corners: Corners, findings: Findings) -> Corners:
    """With a unit normal at every corner: the file's, and made ones where it has none."""
    if corners.normals is None or corners.normal is None or (corners.normal < 0).all():
        sign = _consistent(corners)
        findings.count(AGAINST, (sign < 0).sum())
        findings.say(BY_ANGLE if corners.group is None or (corners.group < 0).all() else BY_GROUP)
        corners = corners.wound(sign)
        normal, normals = creases.smoothed(corners.places, corners.place, groups=corners.group)
        return replace(corners, normal=normal, normals=normals)
    with np.errstate(invalid="ignore", over="ignore"):
        length = np.linalg.norm(corners.normals, axis=1)
    usable = np.isfinite(length) & (length > 0)
    normals = np.where(usable[:, None], corners.normals, 0.0) / np.where(usable, length, 1.0)[:, None]
    first, kind = distinct(normals)
    own = np.where(corners.normal < 0, -1, np.where(usable[corners.normal], kind[corners.normal], -1))
    unusable = (corners.normal >= 0) & (own < 0)
    findings.count(MADE_ANEW, len(np.unique(corners.place[unusable])))
    findings.count(LACKING, len(np.unique(corners.place[corners.normal < 0])))
    normal, normals = own, normals[first]
    if (own < 0).any():
        made, which = _made(corners)
        normal, normals = np.where(own < 0, which + len(normals), own), np.concatenate([normals, made])

    # A normal of the file at one place, and the faces that have it there.
    pair, kind = distinct(corners.place.reshape(-1) * np.int64(len(normals)) + normal.reshape(-1))
    around = np.zeros((len(pair), 3))
    faces = np.repeat(winding.crossed(corners.places, corners.place), 3, axis=0)
    np.add.at(around, kind, faces)
    area = np.bincount(kind, np.linalg.norm(faces, axis=1), len(pair))
    normals = normals[normal.reshape(-1)[pair]]
    away = np.einsum("ni,ni->n", normals, around) < -TURNED_AWAY * area
    findings.count(AWAY, (away & (own.reshape(-1)[pair] >= 0)).sum())
    return replace(corners, normal=kind.reshape(-1, 3), normals=np.where(away[:, None], -normals, normals))


def _off(corners: Corners) -> int:
    """How many corners have a normal that is far off their face."""
    assert corners.normal is not None and corners.normals is not None
    upright = winding.crossed(corners.places, corners.place)
    along = np.einsum("fki,fi->fk", corners.normals[corners.normal], upright)
    return int((along < np.cos(np.radians(OFF_DEG)) * np.linalg.norm(upright, axis=1, keepdims=True)).sum())


def _consistent(corners: Corners) -> np.ndarray:
    """Signs with which faces are wound as their neighbours, int [F]."""
    return winding.pieces(winding.Surface(corners.places, corners.place)).sign


def _made(corners: Corners) -> tuple[np.ndarray, np.ndarray]:
    """Normals from the faces, float64 [N, 3], and which each corner has, int [F, 3]: on the side from which its face goes
    round counter-clockwise."""
    sign = _consistent(corners)
    wound = corners.wound(sign)
    which, made = creases.smoothed(wound.places, wound.place, groups=wound.group)
    which = winding.turned(which, sign) + np.where(sign < 0, len(made), 0)[:, None]
    return np.concatenate([made, -made]), which


def _part(corners: Corners, material: Material, name: str, findings: Findings) -> Part:
    """The part of one material's corners, as few vertices as differ in anything."""
    assert corners.normal is not None and corners.normals is not None
    uvs, uv = _attribute(corners.uvs, corners.uv, 0.0, findings)
    colours, colour = _attribute(corners.colours, corners.colour, 1.0, findings)
    has_holes = material.holes is not None and material.holes.picture is not None
    if uvs is None and (material.picture is not None or has_holes):
        findings.count(NO_COORDINATES)
        material = replace(material, picture=None, holes=None if has_holes else material.holes)
    key = distinct(corners.place.reshape(-1))[1]
    for number in (corners.normal, uv, colour):
        if number is not None:
            key = distinct(key * np.int64(number.max() + 1) + number.reshape(-1))[1]
    first, vertex = distinct(key)
    seen = None if colours is None or colour is None else colours[colour.reshape(-1)[first]]
    return Part(
        name=name,
        vertices=corners.places[corners.place.reshape(-1)[first]],
        faces=vertex.reshape(-1, 3).astype(np.int32),
        normals=corners.normals[corners.normal.reshape(-1)[first]],
        material=material,
        uv=None if uvs is None or uv is None else uvs[uv.reshape(-1)[first]],
        colours=None if seen is None else seen[:, :3],
        alpha=None if seen is None or seen.shape[1] < 4 else seen[:, 3],
    )


def _attribute(values: np.ndarray | None, number: np.ndarray | None, missing: float, findings: Findings):
    """Values without doubles and numbers [F, 3] of these, `missing` where a corner has none; None if none has any."""
    if values is None or number is None or (number < 0).all():
        return None, None
    values = np.concatenate([values, np.full((1, values.shape[1]), missing)])
    finite: np.ndarray = np.all(np.isfinite(values), axis=1)
    findings.count(NO_NUMBERS, (~finite[number]).sum())
    values = np.where(finite[:, None], values, missing)
    first, kind = distinct(values)
    return values[first], kind[number]  # -1 is the last, which is `missing`


def together(several: Sequence[Corners]) -> Corners:
    """All in one; who has no normals, coordinates or colours has -1 for each of them. Smoothing groups are dropped."""
    joined: dict[str, Any] = {"material": np.concatenate([one.material for one in several])}
    for number, values in (("place", "places"), ("normal", "normals"), ("uv", "uvs"), ("colour", "colours")):
        tables = [getattr(one, values) for one in several if getattr(one, values) is not None]
        numbers, start = [], 0
        for one in several:
            has = getattr(one, values) is not None
            numbers.append(getattr(one, number) + start if has else np.full(one.place.shape, -1))
            start += len(getattr(one, values)) if has else 0
        joined[number] = np.concatenate(numbers) if tables else None
        joined[values] = np.concatenate(tables) if tables else None
    return Corners(**joined)
