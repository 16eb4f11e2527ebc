"""The nodes of a glTF 2.0 file: which of them stand in its scene, what they are called, where they are, and how they move."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchharness.assets.asset import Findings, Motion, Refused
from benchharness.assets.gltf_accessors import Document
from benchharness.assets.gltf_animation import Animation
from benchharness.modelling.motion import Track, turned

RIGID = 1e-5  # by how much a motion may stretch: single precision, below a few scales
LOOKED_AT = 64  # times of an animation at which that is asked


class Nodes:
    """`there`: numbers of the nodes of the default scene, those above first."""

    def __init__(self, document: Document, findings: Findings, animation: Animation | None = None) -> None:
        """Raises Refused for nodes that are no tree, and for places that are not finite."""
        self._document = document
        self._parents = _parents(document)
        self._own = [_local(node) for node in document.all("nodes")]
        self._animation = animation or Animation()
        self._motions: dict[int, Motion] = {}
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

    def path(self, index: int) -> tuple[str, ...]:
        """The names of a node and of all above it, from the top."""
        return tuple(self.name(node) for node in self.chain(index))

    def world(self, index: int, time: float = 0.0) -> np.ndarray:
        """What takes a node's space to the file's, float64 [4, 4]; time is the animation's, in seconds."""
        pose = np.eye(4)
        for node in reversed(self.chain(index)):
            pose = self._local(node, time) @ pose
        return pose

    def motion(self, index: int) -> Motion | None:
        """How a node moves its mesh, None where it stands still; meshes that move as one have the same."""
        if not self._animation.tracks and not self._animation.shapes:
            return None
        node, name = self._document.one("nodes", index), self.name(index)
        if index in self._animation.shapes:
            return self._faulty(index, f"it changes the shape of node {name!r}")
        if "skin" in node and self._hangs(node):
            joints = self._document.one("skins", node["skin"])["joints"]
            moved = [joint for joint in joints if self._mover(joint) is not None]
            return self._faulty(index, f"it moves the joints on which node {name!r} hangs, and bends it") if moved else None
        mover = self._mover(index)
        if mover is not None and mover not in self._motions:
            self._motions[mover] = self._moved(mover)
        return None if mover is None else self._motions[mover]

    def end(self, index: int) -> float:
        """The time of the last key by which a node moves; 0 without any."""
        return max((float(track.times[-1]) for track in self._tracks(index)), default=0.0)

    def _local(self, node: int, time: float) -> np.ndarray:
        tracks = self._animation.tracks.get(node)
        if tracks is None:
            return self._own[node]
        return _local(self._document.one("nodes", node) | {path: track.at(time) for path, track in tracks.items()})

    def _tracks(self, index: int) -> list[Track]:
        """What moves a node or one above it, but for what says the same at all times."""
        of_nodes = (self._animation.tracks.get(node, {}).values() for node in self.chain(index))
        return [track for tracks in of_nodes for track in tracks if not track.still]

    def _mover(self, index: int) -> int | None:
        """The lowest node from this one up that is moved against what it is below."""
        tracks = self._animation.tracks
        moved = [node for node in self.chain(index) if any(not track.still for track in tracks.get(node, {}).values())]
        return moved[-1] if moved else None

    def _hangs(self, node: dict[str, Any]) -> bool:
        """Whether a mesh says which joints it hangs on."""
        primitives = self._document.one("meshes", node["mesh"])["primitives"] if "mesh" in node else []
        return any({"JOINTS_0", "WEIGHTS_0"} <= set(primitive["attributes"]) for primitive in primitives)

    def _faulty(self, index: int, fault: str) -> Motion:
        return Motion(self.name(index), lambda time: np.eye(4), 0.0, f"animation {self._animation.name}: {fault}")

    def _moved(self, mover: int) -> Motion:
        """The motion of all that a node moves; faulty where it is not rigid."""
        sized = [
            node
            for node in self.chain(mover)
            for path, track in self._animation.tracks.get(node, {}).items()
            if path == "scale" and not track.still
        ]
        if sized:
            return self._faulty(mover, f"it changes the size of node {self.name(sized[0])!r}")
        first = self.world(mover)
        if not abs(np.linalg.det(first)) > 0:
            return self._faulty(mover, f"node {self.name(mover)!r} is flat")
        back = np.linalg.inv(first)
        keys = np.unique(np.concatenate([track.times for track in self._tracks(mover)]))
        times = np.sort(np.concatenate([keys, 0.5 * (keys[1:] + keys[:-1])]))
        for time in times[:: -(-len(times) // LOOKED_AT)]:
            linear = (self.world(mover, float(time)) @ back)[:3, :3]
            if not np.abs(linear @ linear.T - np.eye(3)).max() <= RIGID or np.linalg.det(linear) < 0:
                return self._faulty(mover, f"it stretches node {self.name(mover)!r}, by turning it below an uneven scale")
        return Motion(self.name(mover), lambda time: self.world(mover, time) @ back, self.end(mover))


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
        turn = np.array(node.get("rotation", (0, 0, 0, 1)), np.float64)
        pose = np.eye(4)
        pose[:3, :3] = turned(turn / max(np.linalg.norm(turn), 1e-300))
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
