"""Cameras and point lights of glTF 2.0, by the nodes on which they hang (specification, section 3.10; KHR_lights_punctual)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchharness.assets import gltf_animation
from benchharness.assets.asset import Findings, Refused
from benchharness.assets.gltf_accessors import Document
from benchharness.assets.gltf_nodes import Nodes

PUNCTUAL = "KHR_lights_punctual"


@dataclass(frozen=True, eq=False)
class Eye:
    """A camera of a file.

    fov_deg  vertical field of view
    aspect   how much wider than high its picture is meant to be; None where the file leaves it open
    pose     time in seconds -> what takes its space, in which it looks along -z, y up, to the file's; float64 [4, 4]
    end      seconds, after which it stands still
    """

    name: str
    fov_deg: float
    aspect: float | None
    pose: Callable[[float], np.ndarray]
    end: float


@dataclass(frozen=True, eq=False)
class Lamp:
    """A point light of a file: where it is in that, float64 [3], and its RGB intensity, float64 [3], in candela."""

    name: str
    position: np.ndarray
    intensity: np.ndarray


def eye(path: Path, node: str | None, animation: str | int | None) -> Eye:
    """The camera at or below a node of this name, or the only one there is. Raises Refused."""
    document, findings = Document(path), Findings()
    nodes = Nodes(document, findings, gltf_animation.read(document, animation, findings))
    there = [index for index in nodes.there if "camera" in document.one("nodes", index)]
    index = one_of(nodes, there, node, "cameras")
    said = document.one("cameras", document.one("nodes", index)["camera"])
    name, kind = nodes.name(index), said.get("type")
    if kind != "perspective":
        raise Refused(f"camera {name!r} is {kind}; accepted: perspective")
    lens = said["perspective"]
    if not 0 < lens["yfov"] < np.pi:
        raise Refused(f"camera {name!r} has yfov {lens['yfov']}; accepted: more than 0 and less than pi")
    return Eye(
        name, float(np.degrees(lens["yfov"])), lens.get("aspectRatio"), lambda time: nodes.world(index, time), nodes.end(index)
    )


def one_of(nodes: Nodes, there: list[int], asked: str | None, what: str) -> int:
    """The one of some nodes that is asked for. Raises Refused for none, and for several."""
    found = [index for index in there if asked is None or asked in nodes.path(index)]
    if len(found) == 1:
        return found[0]
    names = ", ".join(repr(nodes.name(index)) for index in there) or "of which there is none"
    which = "" if asked is None else f" at or below node {asked!r}"
    raise Refused(f"it has {len(found) or 'no'} {what}{which}; accepted: `node` with the name of one, {names}")


def lamps(path: Path, asked: list[str] | None, findings: Findings) -> list[Lamp]:
    """The lights at or below nodes of these names, or all. Raises Refused for spots and for what shines along one direction."""
    document = Document(path)
    nodes = Nodes(document, findings)
    there = [index for index in nodes.there if PUNCTUAL in document.one("nodes", index).get("extensions", {})]
    if not there:
        raise Refused(f"it has no lights in its scene; accepted: nodes with {PUNCTUAL}")
    for name in asked or []:
        if not any(name in nodes.path(index) for index in there):
            names = ", ".join(repr(nodes.name(index)) for index in there)
            raise Refused(f"it has no light at or below node {name!r}; accepted: {names}")
    defined = document.json.get("extensions", {}).get(PUNCTUAL, {}).get("lights", [])
    found = []
    for index in there:
        if asked is not None and set(asked).isdisjoint(nodes.path(index)):
            continue
        number, name = document.one("nodes", index)["extensions"][PUNCTUAL]["light"], nodes.name(index)
        if not 0 <= number < len(defined):
            raise Refused(f"node {name!r} has light {number} of {len(defined)}; accepted: what is there")
        said = defined[number]
        if said.get("type") != "point":
            raise Refused(f"light {name!r} is {said.get('type')}; accepted: point, by `node` where there are others")
        intensity = said.get("intensity", 1.0) * np.array(said.get("color", (1.0, 1.0, 1.0)), np.float64)
        if intensity.shape != (3,) or not (np.isfinite(intensity) & (intensity >= 0)).all():
            what = f"intensity {said.get('intensity')} and color {said.get('color')}"
            raise Refused(f"light {name!r} has {what}; accepted: finite numbers from 0")
        findings.count("lights that end at a range, which shine beyond it", "range" in said)
        found.append(Lamp(name, nodes.world(index)[:3, 3], intensity))
    return found
