"""A TOML file as it is read, before anybody asks what it means: tables of known names, and numbers within bounds."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchharness.study import plugins, shipped

SECTIONS = ("run", "scenes", "reference", "methods")
DEPTH = 16
"""Tables and arrays within each other in a TOML file; none of ours has more than 5."""


def read(path: Path, sections: Sequence[str] = SECTIONS) -> dict[str, Any]:
    """The TOML document. Raises ValueError for what is no file, no TOML, has unknown sections, or numbers without bounds."""
    if not path.is_file():
        near = plugins.close(path.name, [*(p.name for p in path.parent.glob("*.toml")), *shipped.configs()])
        accepted = "accepted: a TOML file, or a name of `benchharness list configs`"
        raise ValueError(f"{path}: there is no such config{plugins.did_you_mean(near)}; {accepted}")
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except RecursionError:
        raise ValueError(f"{path}: tables or arrays lie too deep within each other; accepted: at most {DEPTH}") from None
    except ValueError as error:  # TOML's, UTF-8's, and a number's of thousands of digits
        raise ValueError(f"{path}: not valid TOML: {error}") from None
    for section, content in document.items():
        if section not in sections:
            raise ValueError(f"{path}: section {plugins.unknown(section, sections)}")
        if not isinstance(content, dict):
            raise ValueError(f"{path}: {section} is {content!r}; accepted: a table [{section}]")
        _check_bounds(content, f"{path}: [{section}]")
    return document


def source(kind: str, name: str, table: Mapping[str, Any], path: Path, where: str) -> str | None:
    """The absolute form of a table's `source`, if it has one; `kind` is "method" or "scene". Raises ValueError where an
    installed plugin has its name."""
    source = table.get("source")
    if source is None:
        return None
    if not isinstance(source, str):
        raise ValueError(f'{where}.source is {source!r}; accepted: "file.py" or "file.py:Name"')
    source = plugins.absolute(source, path.parent)
    plugins.check_free(kind, name, source, where)
    return source


def _check_bounds(table: dict[str, Any], where: str) -> None:
    """Raises ValueError for numbers that are not finite or exceed TOML's 64 bits, and for what lies too deep."""
    level: list[tuple[str, Any]] = [(where, table)]
    for _ in range(DEPTH):
        below: list[tuple[str, Any]] = []
        for name, value in level:
            if isinstance(value, dict):
                below += [(f"{name}.{key}", item) for key, item in value.items()]
            elif isinstance(value, list):
                below += [(f"{name}[{number}]", item) for number, item in enumerate(value)]
            elif isinstance(value, float) and not math.isfinite(value):
                raise ValueError(f"{name} is {value}; accepted: a finite number")
            elif isinstance(value, int) and not -(1 << 63) <= value < 1 << 63:
                raise ValueError(f"{name} is a number of {value.bit_length()} bits; accepted: at most 64, with its sign")
        level = below
    if level:
        raise ValueError(f"{where}: tables or arrays lie too deep within each other; accepted: at most {DEPTH}")
