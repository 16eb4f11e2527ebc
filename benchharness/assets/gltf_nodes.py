"""The nodes of a glTF 2.0 file: which of them stand in its scene, what they are called, and where they are."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchharness.assets.asset import Findings, Refused
from benchharness.assets.gltf_accessors import Document


class Nodes:
    """`there`: numbers of the nodes of the default scene, those above first."""

    def __init__(self, document: Document, findings: Findings) -> None:
        """Raises Refused for nodes that are no tree, and for places that are not finite."""
        self._document = document
        self._parents = _parents(document)
        self._own = [_local(node) for node in document.all("nodes")]
        self.there = _there(document, findings)

    def chain(self, index: int) -> list[int]:
        """A node and all above it, from the top."""
        above = [index]
        while (parent := self._parents.get(above[-1])) is not None:
            above.append(parent)
        return above[::-1]

    def name(self, index: int) -> str:
        """A node's own name, else its mesh's, else its number."""
        node = self._document.one("nodes", index)
        mesh = self._document.one("meshes", node["mesh"]) if "mesh" in node else {}
        return str(node.get("name") or mesh.get("name") or f"node {index}")

    def world(self, index: int) -> np.ndarray:
        """What takes a node's space to the file's, float64 [4, 4]."""
        pose = np.eye(4)
        for node in reversed(self.chain(index)):
            pose = self._own[node] @ pose
        return pose


def _parents(document: Document) -> dict[int, int]:
    """What each node is below. Raises Refused for nodes that are no tree."""
    nodes = document.all("nodes")
    parents: dict[int, int] = {}
    for parent, node in enumerate(nodes):
        for child in node.get("children", []):
            document.one("nodes", child)
            if parents.setdefault(child, parent) != parent:
                raise Refused(f"node {child} is below two others; accepted: a tree")
    for index in range(len(nodes)):
        above, steps = parents.get(index), 0
        while above is not None:
            above, steps = parents.get(above), steps + 1
            if steps > len(nodes):
                raise Refused(f"node {index} is below itself; accepted: a tree")
    return parents


def _local(node: dict[str, Any]) -> np.ndarray:
    """A node's own transform: its matrix, or scale, turn and translation in this order; float64 [4, 4]."""
    if "matrix" in node:
        pose = np.array(node["matrix"], np.float64).reshape(4, 4).T
    else:
        x, y, z, w = np.array(node.get("rotation", (0, 0, 0, 1)), np.float64) / max(
            np.linalg.norm(node.get("rotation", 1)), 1e-300
        )
        pose = np.eye(4)
        pose[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
        pose[:3, :3] *= np.array(node.get("scale", (1, 1, 1)), np.float64)
        pose[:3, 3] = node.get("translation", (0, 0, 0))
    if not np.isfinite(pose).all():
        raise Refused("a node's transform is not finite; accepted: finite numbers")
    return pose


def _there(document: Document, findings: Findings) -> list[int]:
    """Numbers of the nodes of the default scene."""
    scenes = document.all("scenes")
    if scenes:
        default = document.json.get("scene", 0)
        left = list(document.one("scenes", default).get("nodes", []))
        if len(scenes) > 1:
            findings.say(f"of {len(scenes)} scenes, number {default} is read, the default")
    else:
        children = {child for node in document.all("nodes") for child in node.get("children", [])}
        left = [index for index in range(len(document.all("nodes"))) if index not in children]
        if left:
            findings.say("there is no scene: all nodes are read")
    there: list[int] = []
    while left:
        index = left.pop(0)
        there.append(index)
        left = [*document.one("nodes", index).get("children", []), *left]
    return there
