"""Texts in whatever encoding, and files that another file names, wherever its author had them."""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterator
from pathlib import Path

from benchharness.assets.asset import Refused

_CONTINUED = re.compile(r"\\[ \t]*\n")


def text(path: Path) -> str:
    """A file's text, with line feeds alone: UTF-8, UTF-16 with a mark, else Latin-1. Raises Refused for what is no text."""
    data = path.read_bytes()
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        said = data.decode("utf-16", errors="replace")
    elif b"\0" in data:
        raise Refused(f"{path.name} is no text; accepted: what its ending says")
    else:
        try:
            said = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            said = data.decode("latin-1")
    return said.replace("\r\n", "\n").replace("\r", "\n")


def lines(said: str) -> Iterator[tuple[int, str, str]]:
    """Number, first word and the rest of every line that says something; lines that end in a backslash go on in the next."""
    number = 1
    for line in _CONTINUED.sub("\v", said).split("\n"):
        at = number
        number += 1 + line.count("\v")
        word, *rest = line.split(None, 1) or [""]
        if word and not word.startswith("#"):
            yield at, word, rest[0].rstrip() if rest else ""


def found(folder: Path, name: str) -> Path | None:
    """The file that is meant by a name in a file of `folder`: as it stands, with the other kind of slash, in another case, or
    by its last part beside that file, where its author's folders are not here. None where there is none."""
    name = name.strip().strip('"').replace("\\", "/")
    if not name:
        return None
    for candidate in (folder / name, folder / name.rpartition("/")[2]):
        if _is_file(candidate):
            return candidate
        try:
            alike = [p for p in candidate.parent.iterdir() if p.name.lower() == candidate.name.lower() and p.is_file()]
        except (OSError, ValueError):
            continue
        if alike:
            return sorted(alike)[0]
    return None


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that is none here
        return False
