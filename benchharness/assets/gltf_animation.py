"""Animations of glTF 2.0: what moves and turns nodes over time (specification, section 3.11 and appendix C).

Tracks of places, turns and sizes are read as they are meant, LINEAR (turns: slerp), STEP and CUBICSPLINE. Shapes are named, and
who wants their meshes has to refuse them. What an animation changes beside nodes is said.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from benchharness.assets.asset import Findings, Refused
from benchharness.assets.gltf_accessors import Document
from benchharness.modelling.motion import Between, Track

WIDTHS = {"translation": 3, "rotation": 4, "scale": 3}
BETWEEN: dict[str, Between] = {"LINEAR": "linear", "STEP": "step", "CUBICSPLINE": "cubic"}
ELSEWHERE = "things other than nodes that the animation changes, left as they are"


@dataclass(frozen=True, eq=False)
class Animation:
    """
    name    as a reader calls it
    tracks  of nodes: places, turns and sizes, by the words that nodes have for them
    shapes  nodes whose meshes it changes the shapes of
    """

    name: str = ""
    tracks: dict[int, dict[str, Track]] = field(default_factory=dict)
    shapes: frozenset[int] = frozenset()


def read(document: Document, asked: str | int | None, findings: Findings) -> Animation:
    """The animation of a name or number; one in which nothing moves for None. Raises Refused."""
    if asked is None:
        return Animation()
    number = _number(document, asked)
    said = document.one("animations", number)
    tracks: dict[int, dict[str, Track]] = {}
    shapes = set()
    for channel in said["channels"]:
        node, path = channel["target"].get("node"), channel["target"]["path"]
        if node is None or path not in (*WIDTHS, "weights"):
            findings.count(ELSEWHERE)
            continue
        what = f"animation {asked!r}, {path} of node {document.one('nodes', node).get('name', node)!r},"
        if path == "weights":
            shapes.add(node)
        elif "matrix" in document.one("nodes", node):
            raise Refused(f"{what} moves what is placed by a matrix; accepted: translation, rotation and scale")
        elif path in tracks.setdefault(node, {}):
            raise Refused(f"{what} is there twice; accepted: once")
        else:
            tracks[node][path] = _track(document, said["samplers"][channel["sampler"]], path, what)
    return Animation(repr(asked), tracks, frozenset(shapes))


def _number(document: Document, asked: str | int) -> int:
    """Which of the file's animations is asked for."""
    names = [str(animation.get("name", "")) for animation in document.all("animations")]
    accepted = ", ".join(repr(name) if names.count(name) == 1 and name else str(k) for k, name in enumerate(names))
    found = [k for k, name in enumerate(names) if asked in (name, k)]
    if len(found) != 1:
        raise Refused(f"it has {len(found) or 'no'} animations {asked!r}; accepted: {accepted or 'none, as it has none'}")
    return found[0]


def _track(document: Document, sampler: dict[str, Any], path: str, what: str) -> Track:
    """What a sampler says of a node's place, turn or size. Raises Refused."""
    kind = sampler.get("interpolation", "LINEAR")
    if kind not in BETWEEN:
        raise Refused(f"{what} goes by {kind!r}; accepted: {', '.join(BETWEEN)}")
    times, values = document.numbers(sampler["input"])[:, 0], document.numbers(sampler["output"])
    each = 3 if BETWEEN[kind] == "cubic" else 1
    if len(times) == 0 or values.shape != (each * len(times), WIDTHS[path]):
        wanted = f"{each * len(times)} of {WIDTHS[path]}" if len(times) else "at least one time"
        raise Refused(f"{what} has {len(times)} times and {len(values)} rows of {values.shape[1]} numbers; accepted: {wanted}")
    if not np.isfinite(times).all() or not np.isfinite(values).all() or not (np.diff(times) > 0).all():
        raise Refused(f"{what} has times that do not ascend, or no numbers; accepted: finite ones, one time after the other")
    tangents = None
    if each == 3:
        rows = values.reshape(len(times), 3, -1)
        tangents, values = rows[:, [0, 2]], rows[:, 1]
    if path == "rotation":
        length = np.linalg.norm(values, axis=1, keepdims=True)
        if not length.all():
            raise Refused(f"{what} has a turn of length 0; accepted: quaternions")
        values = values / length
    return Track(times, values, path == "rotation", BETWEEN[kind], tangents)
