"""glTF 2.0, as GLB or as JSON with buffers beside it: what stands in the default scene, in its own space, y up, in metres.

Nodes are put where they stand: winding turned where one mirrors, normals by the inverse transpose. Instances are meshes of
their own. Skins and shapes are as the file poses them. An animation that is asked for moves nodes, from where it has them at
time 0; others are left. Extensions that change numbers are decoded (KHR_mesh_quantization, KHR_texture_transform) or refused by
name; those that change looks are said.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchharness.assets import gltf_animation, gltf_materials, polygons, surface
from benchharness.assets.asset import Asked, Findings, Part, Refused
from benchharness.assets.gltf_accessors import Document
from benchharness.assets.gltf_materials import Look
from benchharness.assets.gltf_nodes import Nodes

DECODED = ("KHR_mesh_quantization", "KHR_texture_transform", "KHR_lights_punctual", "KHR_xmp_json_ld", "EXT_texture_webp")
LOOKS = "KHR_materials_"  # what begins so changes looks alone
CAMERAS, LIGHTS, ANIMATIONS = "cameras, left out", "lights, left out", "animations, left out: all is where the nodes put it"
MODES: dict[int, Callable[[np.ndarray], np.ndarray]] = {
    4: lambda vertices: vertices[: len(vertices) // 3 * 3].reshape(-1, 3),
    5: polygons.of_strip,
    6: polygons.of_fan,
}
"""Triangles, strips and fans. What is less, 0 to 3, is points and lines."""


def read(path: Path, findings: Findings, asked: Asked) -> list[Part]:
    """The parts of a file, one for every material of every node, y up. Raises Refused."""
    document = Document(path)
    required = document.all("extensionsRequired")
    strange = [name for name in required if name not in DECODED and not str(name).startswith(LOOKS)]
    if strange:
        raise Refused(f"it requires {', '.join(map(str, strange))}; accepted: {', '.join(DECODED)} and {LOOKS}*")
    looks = gltf_materials.looks(document, findings)
    nodes = Nodes(document, findings, gltf_animation.read(document, asked.animation, findings))
    parts: list[Part] = []
    for index in nodes.there:
        node = document.one("nodes", index)
        extensions = node.get("extensions", {})
        if "EXT_mesh_gpu_instancing" in extensions:
            raise Refused("it has nodes with EXT_mesh_gpu_instancing; accepted: files without it")
        findings.count(CAMERAS, "camera" in node)
        findings.count(LIGHTS, "KHR_lights_punctual" in extensions)
        if "mesh" in node:
            names, motion = nodes.path(index), nodes.motion(index)
            found = _parts(document, index, nodes, looks, findings)
            parts += [replace(part, nodes=names, motion=motion) for part in found]
    if asked.animation is None:
        findings.count(ANIMATIONS, len(document.all("animations")))
    if not any("mesh" in document.one("nodes", index) for index in nodes.there):
        raise Refused(f"it has {len(document.all('meshes'))} meshes, and none in its scene; accepted: at least one")
    if not parts:
        raise Refused("it has no faces; accepted: a mesh with at least one triangle")
    return parts


def _parts(document: Document, index: int, nodes: Nodes, looks: list[Look], findings: Findings) -> list[Part]:
    """The parts of a node's mesh, all its primitives together, so that none ends where another begins."""
    node = document.one("nodes", index)
    mesh = document.one("meshes", node["mesh"])
    found = []
    for primitive in mesh["primitives"]:
        mode = primitive.get("mode", 4)
        if mode in (0, 1, 2, 3):
            findings.count("primitives of points or lines, left out")
        elif mode not in MODES:
            raise Refused(f"a primitive has mode {mode}; accepted: 0 to 6")
        else:
            found.append(_primitive(document, primitive, index, nodes, looks, findings))
    found = [corners for corners in found if len(corners.place)]
    if not found:
        return []
    name = str(node.get("name") or mesh.get("name") or "")
    return surface.parts(surface.together(found), [look.material for look in looks], name, findings)


def _primitive(
    document: Document,
    primitive: dict[str, Any],
    index: int,
    nodes: Nodes,
    looks: list[Look],
    findings: Findings,
) -> surface.Corners:
    """A primitive's triangles in the scene's space. Raises Refused."""
    node, attributes = document.one("nodes", index), primitive["attributes"]
    if "POSITION" not in attributes:
        raise Refused("a primitive has no POSITION; accepted: attributes with it")
    for extension in primitive.get("extensions", {}):
        if "draco" in extension.lower() and "bufferView" not in document.one("accessors", attributes["POSITION"]):
            raise Refused(f"its numbers are compressed by {extension}; accepted: files without it")
    places = document.positions(attributes["POSITION"])
    if not np.isfinite(places).all():
        raise Refused("a primitive has places that are no numbers; accepted: finite coordinates")
    normals = document.numbers(attributes["NORMAL"]) if "NORMAL" in attributes else None
    places, normals = _morphed(document, primitive, node, places, normals, findings)
    poses = _poses(document, attributes, index, nodes, findings)
    places, normals, mirrored = _moved(poses, places, normals)

    if "indices" in primitive:
        vertices = document.stored(primitive["indices"])[:, 0].astype(np.int64)
    else:
        vertices = np.arange(len(places))
    if len(vertices) and (vertices.min() < 0 or vertices.max() >= len(places)):
        raise Refused(f"a face names vertex {vertices.max()}; accepted: 0 to {len(places) - 1}")
    mode = primitive.get("mode", 4)
    findings.count("corners at the end of a primitive that make no triangle, left out", len(vertices) % 3 if mode == 4 else 0)
    faces = MODES[mode](vertices) if len(vertices) >= 3 else np.zeros((0, 3), np.int64)
    faces = faces[:, ::-1] if mirrored else faces

    none = len(looks) - (1 if "COLOR_0" in attributes else 2)
    material = primitive.get("material", none)
    if material != none and not 0 <= material < len(looks) - 2:
        raise Refused(f"a primitive names material {material} of {len(looks) - 2}; accepted: what is there")
    set_of_uv = f"TEXCOORD_{looks[material].coordinates}"
    uvs = looks[material].placed(document.numbers(attributes[set_of_uv])) if set_of_uv in attributes else None
    colours = _colours(document, attributes, findings, holes=looks[material].material.holes is not None)
    for what, values in (("NORMAL", normals), (set_of_uv, uvs), ("COLOR_0", colours)):
        if values is not None and len(values) != len(places):
            raise Refused(f"a primitive has {len(places)} places and {len(values)} of {what}; accepted: as many")
    return surface.Corners(
        place=faces,
        places=places,
        material=np.full(len(faces), material),
        normal=None if normals is None else faces,
        normals=normals,
        uv=None if uvs is None else faces,
        uvs=uvs,
        colour=None if colours is None else faces,
        colours=colours,
    )


def _colours(document: Document, attributes: dict[str, int], findings: Findings, *, holes: bool) -> np.ndarray | None:
    """Linear colours of vertices and their alpha, which is 1 but for what has `holes`, [V, 4]; integers count as shares of
    their largest, whether they say so or not."""
    if "COLOR_0" not in attributes:
        return None
    colours = document.numbers(attributes["COLOR_0"])
    stored = document.one("accessors", attributes["COLOR_0"])
    if not stored.get("normalized") and stored["componentType"] != 5126:
        colours = colours / np.iinfo(document.stored(attributes["COLOR_0"]).dtype).max
    alpha = colours[:, 3] if colours.shape[1] == 4 else np.ones(len(colours))
    if not holes and (alpha < 1.0 - 1e-3).any():
        findings.say("transparency of colours is ignored")
    return np.clip(np.column_stack([colours[:, :3], alpha if holes else np.ones(len(colours))]), 0.0, 1.0)


def _morphed(
    document: Document,
    primitive: dict[str, Any],
    node: dict[str, Any],
    places: np.ndarray,
    normals: np.ndarray | None,
    findings: Findings,
) -> tuple[np.ndarray, np.ndarray | None]:
    """Places and normals with the shapes added that the file weighs."""
    targets = primitive.get("targets", [])
    if not targets:
        return places, normals
    weights = node.get("weights", document.one("meshes", node["mesh"]).get("weights", []))
    findings.say("meshes that can change their shape have the one that the file gives them")
    for weight, target in zip(weights, targets, strict=False):
        if weight and "POSITION" in target:
            places = places + weight * document.numbers(target["POSITION"])
        if weight and normals is not None and "NORMAL" in target:
            normals = normals + weight * document.numbers(target["NORMAL"])
    return places, normals


def _poses(document: Document, attributes: dict[str, int], index: int, nodes: Nodes, findings: Findings) -> np.ndarray:
    """What puts vertices into the scene: the node's pose, [1, 4, 4], or that of the joints that each hangs on, [V, 4, 4]."""
    node, world = document.one("nodes", index), nodes.world(index)
    if "skin" not in node or not {"JOINTS_0", "WEIGHTS_0"} <= set(attributes):
        return world[None]
    findings.say("meshes that hang on joints have the pose in which the file puts these")
    skin = document.one("skins", node["skin"])
    joints = np.stack([nodes.world(joint) for joint in skin["joints"]])
    if "inverseBindMatrices" in skin:
        joints = joints @ document.numbers(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)[: len(joints)]
    poses, total, number = 0.0, 0.0, 0
    while {f"JOINTS_{number}", f"WEIGHTS_{number}"} <= set(attributes):
        which = document.stored(attributes[f"JOINTS_{number}"]).astype(np.int64)
        weights = document.numbers(attributes[f"WEIGHTS_{number}"])
        if which.size and which.max() >= len(joints):
            raise Refused(f"a vertex names joint {which.max()} of {len(joints)}; accepted: what is there")
        poses = poses + np.einsum("vk,vkij->vij", weights, joints[which])
        total, number = total + weights.sum(axis=1), number + 1
    total = np.asarray(total)
    return np.where(total[:, None, None] > 0, poses / np.where(total > 0, total, 1.0)[:, None, None], world)


def _moved(poses: np.ndarray, places: np.ndarray, normals: np.ndarray | None) -> tuple[np.ndarray, np.ndarray | None, bool]:
    """Places and normals by poses, [1, 4, 4] or one for each, and whether these mirror, in the mean."""
    linear = poses[:, :3, :3]
    size = np.linalg.det(linear)
    if normals is not None:
        # The cofactors, which are the inverse transpose times the determinant, and are there for what is flattened too.
        a, b, c = linear[:, 0], linear[:, 1], linear[:, 2]
        cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
        normals = (cofactors @ normals[:, :, None])[..., 0] * np.where(size < 0, -1.0, 1.0)[:, None]
    return (linear @ places[:, :, None])[..., 0] + poses[:, :3, 3], normals, bool(size.mean() < 0)
