"""Wavefront OBJ files: polygons that count from the front or from where they stand, smoothing groups, materials.

Libraries lose some of it: relative numbers count from the end of the file, smoothing groups are dropped, concave polygons are
fanned, and only some encodings, blanks and options of pictures pass. Colours behind coordinates are taken as sRGB, as the
programs that write them do.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchharness.assets import files, mtl, pictures, polygons, surface
from benchharness.assets.asset import PLAIN, WHITE, Asked, Colour, Findings, Material, Part, Refused
from benchharness.modelling import creases

FREE_FORM = {"vp", "cstype", "deg", "surf", "curv", "curv2", "bmat", "trim", "hole", "scrv", "parm", "con"}
_COMMENT = re.compile(r"(^|\s)#.*")


@dataclass
class _Run:
    """Faces of one kind and smoothing group, before which there were so many places, coordinates and normals."""

    kind: int
    group: int
    before: tuple[int, int, int]
    lines: list[int] = field(default_factory=list)
    faces: list[list[str]] = field(default_factory=list)


class _Rows:
    """Lines of numbers of one kind."""

    def __init__(self, word: str, least: int) -> None:
        self.word, self.least = word, least
        self.lines: list[int] = []
        self.texts: list[str] = []

    def add(self, line: int, text: str) -> None:
        self.lines.append(line)
        self.texts.append(_COMMENT.sub("", text) if "#" in text else text)

    def array(self) -> np.ndarray:
        """Float64 [N, widest], NaN where a line is shorter. Raises Refused for what is no number, and for too few."""
        rows = [text.split() for text in self.texts]
        widths = {len(row) for row in rows}
        if len(widths) == 1 and min(widths) >= self.least:
            try:
                return np.array(rows, np.float64)
            except ValueError:
                pass  # the line at fault is looked for
        out = np.full((len(rows), max(widths, default=self.least)), np.nan)
        for k, row in enumerate(rows):
            if len(row) < self.least:
                raise Refused(f"line {self.lines[k]}: {self.word} has {len(row)} numbers; accepted: at least {self.least}")
            try:
                out[k, : len(row)] = [np.nan if "#" in word else float(word) for word in row]  # 1.#IND, of another runtime
            except ValueError:
                said = f"{self.word} {self.texts[k]}"
                raise Refused(f"line {self.lines[k]} is {said!r}; accepted: numbers with a decimal point") from None
        return out


def read(path: Path, findings: Findings, asked: Asked) -> list[Part]:
    """The parts of a file, as it stands: of one material each, and of one object and its groups if they are asked for. Raises
    Refused."""
    places, uvs, normals = _Rows("v", 3), _Rows("vt", 1), _Rows("vn", 3)
    rows, libraries = {"v": places, "vt": uvs, "vn": normals}, []
    runs: list[_Run] = []
    kinds: list[tuple[str, tuple[str, ...]]] = [("", ("",))]  # materials; an object, and groups
    kind, group = 0, creases.BY_ANGLE
    for number, word, rest in files.lines(files.text(path)):
        if word in rows:
            rows[word].add(number, rest)
        elif word in ("f", "fo"):
            before = len(places.lines), len(uvs.lines), len(normals.lines)
            state = kind, group, before
            if not runs or (runs[-1].kind, runs[-1].group, runs[-1].before) != state:
                runs.append(_Run(*state))
            runs[-1].lines.append(number)
            runs[-1].faces.append((_COMMENT.sub("", rest) if "#" in rest else rest).split())
        elif word == "usemtl" or (word in ("o", "g") and asked.apart):
            kind = _kind(kinds, kind, word, rest)
        elif word == "s":
            group = _group(rest)
        elif word == "mtllib":
            libraries.append(rest)
        elif word in ("l", "p"):
            findings.count("lines and points, left out")
        elif word in FREE_FORM:
            findings.say("curves and free-form surfaces are left out")
    if not runs:
        raise Refused(f"it has no faces, and {len(places.lines)} points; accepted: a mesh with at least one triangle")
    v, vt, vn = places.array(), uvs.array(), normals.array()
    colours, coloured = _colours(v, findings)
    looks = _looks(path, libraries, [name for name, _ in kinds], PLAIN if colours is None else WHITE, findings)
    corner, size, material, group = _faces(runs, (len(v), len(vt), len(vn)), findings)
    triangles, crossing = polygons.triangulated(v[corner[:, 0], :3], size)
    findings.count("polygons that cross themselves, cut as they come", crossing)
    owner = polygons.owners(size)
    uv, uvs_of_looks = _coordinates(corner[:, 1][triangles], vt, material[owner], looks)
    corners = surface.Corners(
        place=corner[:, 0][triangles],
        places=v[:, :3],
        material=material[owner],
        normal=corner[:, 2][triangles],
        normals=vn[:, :3] if len(vn) else None,
        uv=uv,
        uvs=uvs_of_looks,
        colour=None if colours is None else np.where(coloured[corner[:, 0]], corner[:, 0], -1)[triangles],
        colours=colours,
        group=group[owner],
    )
    nodes = [tuple(filter(None, names)) for _, names in kinds]
    return surface.parts(corners, [look.material for look in looks], path.stem, findings, nodes)


def _kind(kinds: list[tuple[str, tuple[str, ...]]], kind: int, word: str, rest: str) -> int:
    """The number of the kind that faces are of from a line on; it is added where there was none."""
    material, nodes = kinds[kind]
    said = {"usemtl": (rest, nodes), "o": (material, (rest,)), "g": (material, (nodes[0], *rest.split()))}
    new = said[word]
    if new not in kinds:
        kinds.append(new)
    return kinds.index(new)


def _group(said: str) -> int:
    if said.lower() in ("off", "null", ""):
        return creases.FLAT
    if said.lower() == "on":
        return 1
    return int(said) if said.isdecimal() else creases.BY_ANGLE


def _looks(path: Path, libraries: list[str], names: list[str], plain: Colour, findings: Findings) -> list[mtl.Look]:
    """What each material of the file looks like; a plain one where no library has it."""
    known: dict[str, mtl.Look] = {}
    for said in dict.fromkeys(libraries):
        whole = files.found(path.parent, said)  # the name of one file with spaces in it, or several names
        for name in [said] if whole is not None else said.split():
            found = files.found(path.parent, name)
            if found is None:
                findings.say(f"material library {name} is missing: its materials are plain")
                continue
            known = {**mtl.read(found, findings), **known}
    unknown = sorted({name for name in names if name and name not in known})
    if unknown and (not libraries or known):
        findings.say(f"materials that no library has, and are plain: {', '.join(unknown)}")
    return [known.get(name, mtl.Look(Material(name, plain))) for name in names]


def _faces(
    runs: list[_Run], there: tuple[int, int, int], findings: Findings
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Corners of all faces as in `_numbers`, and of each face how many it has, its kind and its smoothing group."""
    numbers, sizes, materials, groups = [], [], [], []
    for run in runs:
        size = np.array([len(face) for face in run.faces])
        findings.count("faces of fewer than three corners, left out", (size < 3).sum())
        kept = size >= 3
        if not kept.any():
            continue
        faces = [face for face in run.faces if len(face) >= 3]
        lines = [line for line, keep in zip(run.lines, kept, strict=True) if keep]
        numbers.append(_numbers(faces, lines, run.before, there, findings))
        sizes.append(size[kept])
        materials.append(np.full(len(faces), run.kind))
        groups.append(np.full(len(faces), run.group))
    if not numbers:
        raise Refused("it has no faces of three corners; accepted: a mesh with at least one triangle")
    return np.concatenate(numbers), np.concatenate(sizes), np.concatenate(materials), np.concatenate(groups)


def _numbers(
    faces: list[list[str]], lines: list[int], before: tuple[int, int, int], there: tuple[int, int, int], findings: Findings
) -> np.ndarray:
    """Places, coordinates and normals of all corners of some faces, int [C, 3], from 0; -1 for what is not there."""
    words = [word for face in faces for word in face]
    slashes = {word.count("/") for word in words}
    try:
        flat = " ".join(words).replace("//", "/0/").replace("/", " ").split()
        if len(slashes) == 1 and max(slashes) <= 2 and len(flat) == len(words) * (max(slashes) + 1):
            given = np.array([int(n) for n in flat], np.int64).reshape(len(words), -1)
            given = np.concatenate([given, np.zeros((len(given), 3 - given.shape[1]), np.int64)], axis=1)
        else:
            given = np.array([[int(n or 0) for n in [*word.split("/"), "", ""][:3]] for word in words], np.int64)
    except (ValueError, OverflowError):
        raise Refused(
            f"line {_line(faces, lines, _is_no_corner)} has a corner that is none; accepted: v, v/t, v//n, v/t/n"
        ) from None
    index = np.where(given > 0, given - 1, np.where(given < 0, given + np.array(before), -1))
    wrong = (index < 0) | (index >= np.array(there))
    if wrong[:, 0].any():
        corner = int(np.flatnonzero(wrong[:, 0])[0])
        line = lines[int(np.searchsorted(np.cumsum([len(face) for face in faces]), corner, side="right"))]
        raise Refused(f"line {line}: a face names vertex {given[corner, 0]}; accepted: of {there[0]} vertices, from 1 on")
    for column, what in ((1, "texture coordinates"), (2, "normals")):
        findings.count(f"corners that name {what} which are not there", (wrong & (given != 0))[:, column].sum())
    return np.where(wrong, -1, index)


def _is_no_corner(word: str) -> bool:
    return re.fullmatch(r"-?\d+(/(-?\d+)?){0,2}", word) is None


def _line(faces: list[list[str]], lines: list[int], fault) -> int:
    return next((line for face, line in zip(faces, lines, strict=True) if any(fault(word) for word in face)), lines[0])


def _coordinates(uv: np.ndarray, vt: np.ndarray, material: np.ndarray, looks: list[mtl.Look]):
    """Coordinates of corners with what their materials' pictures say of them: numbers [F, 3] and values [T, 2]."""
    if len(vt) == 0:
        return None, None
    values = np.concatenate([vt, np.zeros((len(vt), 1))], axis=1)[:, :2]  # one number is u alone
    tables, shift = [values], np.zeros(len(looks), np.int64)
    for k, look in enumerate(looks):
        if (look.scale, look.offset) != ((1.0, 1.0), (0.0, 0.0)):
            shift[k] = sum(map(len, tables))
            tables.append(values * look.scale + look.offset)
    return np.where(uv < 0, -1, uv + shift[material][:, None]), np.concatenate(tables)


def _colours(v: np.ndarray, findings: Findings) -> tuple[np.ndarray | None, np.ndarray]:
    """Linear colours of the vertices, [V, 3], and which have one; None without any."""
    if v.shape[1] < 6:
        if v.shape[1] == 4 and not np.isin(v[:, 3][np.isfinite(v[:, 3])], (0.0, 1.0)).all():
            findings.say("a fourth number of vertices, a weight, is ignored")
        return None, np.zeros(len(v), bool)
    coloured: np.ndarray = np.all(np.isfinite(v[:, 3:6]), axis=1)
    encoded = np.where(coloured[:, None], v[:, 3:6], 1.0)
    if encoded.max() > 1.0 + 1e-6:
        findings.say("colours of vertices go beyond 1, and count up to 255")
        encoded = encoded / 255.0
    findings.count("vertices without a colour in a file that has some, white", (~coloured).sum())
    return pictures.linear(encoded), coloured
