"""`new-method`: the first twenty lines of a method, which run."""

from __future__ import annotations

import keyword
import re
from pathlib import Path

from benchharness.study import plugins

METHOD = '''"""{title}: a dome, brighter above, seen by every reflected ray.

Say here: the idea in two sentences; paper, section and equation; what it assumes; where it fails; where it differs from
the paper, and what that changes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import drjit as dr
import mitsuba as mi

from benchharness.api import Frame, Method, Reflection
from benchharness.scene import Scene


@dataclass(frozen=True)
class {name}(Method):
    """
    brightness  radiance of the dome straight up
    """

    paper: ClassVar[str] = "none"
    brightness: float = 1.0

    def prepare(self, scene: Scene) -> mi.Float:
        return dr.opaque(mi.Float, self.brightness)

    def shade(self, state: mi.Float, frame: Frame) -> tuple[Reflection, mi.Float]:
        wo = 2.0 * dr.dot(frame.v, frame.n) * frame.n - frame.v
        L = mi.Color3f(state * (0.5 + 0.5 * wo.z))
        distance = dr.full(mi.Float, 100.0, dr.width(L))  # metres; dr.inf is for the surroundings of an open scene
        return Reflection(L, distance, found=frame.active), state
'''


def new_method(name: str, folder: Path) -> Path:
    """Writes `folder/name.py`. Raises ValueError for what is no module's name, and never writes over a file."""
    if not re.fullmatch(r"[a-z][a-z0-9_]{0,63}", name):
        raise ValueError(f"new-method: {name!r} is no name; accepted: up to 64 small letters, digits and _, such as my_method")
    for taken in (name, plugins.camel_case(name)):
        if keyword.iskeyword(taken) or taken in ("Frame", "Method", "Reflection", "Scene"):
            raise ValueError(f"new-method: {name!r} needs {taken!r}, which has another meaning; accepted: another name")
    path = folder / f"{name}.py"
    try:
        with open(path, "x", encoding="utf-8") as stream:
            stream.write(METHOD.format(title=name.replace("_", " ").capitalize(), name=plugins.camel_case(name)))
    except FileExistsError:
        raise ValueError(f"new-method: {path} exists; accepted: a name that is not taken") from None
    return path
