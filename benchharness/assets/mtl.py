"""Material libraries of OBJ files (MTL): colours, the picture of the diffuse colour and its options, alpha, emission.

Kd and Ke are linear RGB, as programs of today write them; Kd multiplies the picture. A Kd of 0 beside a picture is what
exporters leave behind that mean the picture alone: it counts as 1. Holes are where map_d is below a half, its alpha or how
bright it is; without map_d, where the alpha of map_Kd is.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchharness.assets import files, pictures
from benchharness.assets.asset import PLAIN, WHITE, Colour, Findings, Material, Refused, Wrap
from benchharness.modelling.alpha import AlphaMap
from benchharness.modelling.contour import Holes

# Options of a picture, and how many values each takes at least and at most.
OPTIONS = {
    "-blendu": (1, 1),
    "-blendv": (1, 1),
    "-bm": (1, 1),
    "-boost": (1, 1),
    "-cc": (1, 1),
    "-clamp": (1, 1),
    "-imfchan": (1, 1),
    "-mm": (2, 2),
    "-o": (1, 3),
    "-s": (1, 3),
    "-t": (1, 3),
    "-texres": (1, 1),
    "-type": (1, 1),
}
IGNORED = {
    "d": "transparency",
    "tr": "transparency",
    "map_bump": "bump and normal maps",
    "bump": "bump and normal maps",
    "norm": "bump and normal maps",
    "disp": "displacement",
    "map_ke": "pictures of emission",
}
"""What a library says and a material here does not have."""


@dataclass(frozen=True)
class Look:
    """A material, and what takes the file's texture coordinates to those of its picture: uv * scale + offset."""

    material: Material
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)


def read(path: Path, findings: Findings) -> dict[str, Look]:
    """The materials of a library by their names. What is missing or ignored is said; what cannot be read is Refused."""
    looks: dict[str, Look] = {}
    for name, statements in _blocks(path):
        looks[name] = _look(name, statements, path, findings)
    return looks


def _blocks(path: Path) -> Iterator[tuple[str, dict[str, str]]]:
    """Names of materials, and what is said of each: the word in lower case -> the rest of its last line."""
    name, statements = None, {}
    for _, word, rest in files.lines(files.text(path)):
        if word.lower() == "newmtl":
            if name is not None:
                yield name, statements
            name, statements = rest, {}
        elif name is not None:
            statements[word.lower()] = rest
    if name is not None:
        yield name, statements


def _look(name: str, said: dict[str, str], path: Path, findings: Findings) -> Look:
    base = _colour(said.get("kd"), f"Kd of material {name}", findings)
    emission = _colour(said.get("ke"), f"Ke of material {name}", findings) or (0.0, 0.0, 0.0)
    look = Look(Material(name, base or PLAIN, emission=emission))
    for word in sorted(set(said) & set(IGNORED)):
        if not (word in ("d", "tr") and _opaque(word, said[word])):
            findings.count(f"{IGNORED[word]} of materials, ignored")
    if "map_kd" not in said:
        return _holed(look, said, path, findings)
    file, options = _options(said["map_kd"])
    picture = pictures.named(path.parent, file, f"picture {file} of material {name}", findings)
    if picture is None:
        return _holed(look, said, path, findings)
    if base is not None and not any(base):
        findings.say(f"Kd of material {name} is 0 beside a picture, and counts as 1")
        base = WHITE
    wrap, scale, offset = _placement(options, f"picture of material {name}", findings)
    material = replace(look.material, base_colour=base or WHITE, picture=picture, wrap=wrap)
    return _holed(Look(material, scale, offset), said, path, findings)


def _holed(look: Look, said: dict[str, str], path: Path, findings: Findings) -> Look:
    """With the holes of map_d, or of the alpha of its picture."""
    word, read = ("map_d", pictures.coverage) if "map_d" in said else ("map_kd", pictures.alpha)
    if word not in said or (word == "map_kd" and look.material.picture is None):
        return look
    file, options = _options(said[word])
    name = look.material.name
    found = pictures.named(path.parent, file, f"picture {file} of material {name}", findings, read, "drawn opaque")
    if found is None:
        return look
    if word == "map_kd":
        holes = Holes(0.5, AlphaMap(found, look.material.wrap))
        return replace(look, material=replace(look.material, holes=holes, blends=True))
    wrap, scale, offset = _placement(options, f"alpha of material {name}", findings)
    u, v = (a / b if b else 0.0 for a, b in zip(scale, look.scale, strict=True))  # from where the other picture is
    moved = offset[0] - u * look.offset[0], offset[1] - v * look.offset[1]
    holes = Holes(0.5, AlphaMap(found, wrap), scale=(u, v), offset=moved)
    return replace(look, material=replace(look.material, holes=holes, blends=True))


def _placement(
    options: dict[str, list[str]], what: str, findings: Findings
) -> tuple[tuple[Wrap, Wrap], tuple[float, float], tuple[float, float]]:
    """What the options of a picture say of where it is: how it goes on, and what takes the file's coordinates to its own."""
    ignored = sorted(set(options) & {"-mm", "-t", "-imfchan"})
    if ignored:
        findings.say(f"options {', '.join(ignored)} of the {what} are ignored")
    wrap: Wrap = "clamp" if options.get("-clamp", ["off"])[0].lower() == "on" else "repeat"
    return (wrap, wrap), _pair(options.get("-s"), 1.0), _pair(options.get("-o"), 0.0)


def _pair(values: list[str] | None, missing: float) -> tuple[float, float]:
    """u and v of an option, of which the later ones may be left out."""
    u, v = ([float(value) for value in values or []] + [missing, missing])[:2]
    return u, v


def _options(said: str) -> tuple[str, dict[str, list[str]]]:
    """The name of a file, which may have spaces in it, and the options before it. The last word is never an option's."""
    options: dict[str, list[str]] = {}
    while (match := re.match(r"\s*(-\w+)\s+", said)) and match[1].lower() in OPTIONS:
        least, most = OPTIONS[match[1].lower()]
        said, values = said[match.end() :], []
        while len(values) < most and (word := re.match(r"(\S+)\s+", said)):
            if len(values) >= least and not _is_number(word[1]):
                break
            values.append(word[1])
            said = said[word.end() :]
        options[match[1].lower()] = values
    return said, options


def _colour(said: str | None, what: str, findings: Findings) -> Colour | None:
    """Three numbers, or one for all three; None for what is not said, or is said in another way."""
    if said is None:
        return None
    try:
        values = [float(value) for value in said.split()]
    except ValueError:
        findings.say(f"{what} is {said!r}, and ignored: it is no RGB")
        return None
    values = (values * 3 if len(values) == 1 else values)[:3]
    if len(values) < 3 or not np.isfinite(values).all():
        raise Refused(f"{what} is {said!r}; accepted: three finite numbers")
    return values[0], values[1], values[2]


def _opaque(word: str, said: str) -> bool:
    """Whether a dissolve of 1, or a transparency of 0. Exporters disagree about Tr: both 0 and 1 pass for nothing said."""
    last = said.split()[-1] if said else "1"
    return _is_number(last) and float(last) in ((1.0,) if word == "d" else (0.0, 1.0))


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
