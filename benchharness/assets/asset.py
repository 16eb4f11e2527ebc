"""What a file of meshes holds: parts of one material each, and what had to be mended, made or left out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from benchharness.modelling.contour import Holes

Colour = tuple[float, float, float]
Wrap = Literal["repeat", "mirror", "clamp"]

PLAIN: Colour = (0.5, 0.5, 0.5)  # what says nothing of its colour
WHITE: Colour = (1.0, 1.0, 1.0)


class Refused(ValueError):
    """A file that cannot be read right: which, what is in it, and what would be accepted."""


@dataclass(frozen=True)
class Asked:
    """What is asked of a file beside its meshes.

    apart      whether what has a name of its own in it is parts of its own, where that is left open: objects and groups of OBJ
    animation  name or number of the one that moves its nodes; None: they stand as the file puts them
    """

    apart: bool = False
    animation: str | int | None = None


@dataclass(frozen=True, eq=False)
class Material:
    """What a surface looks like.

    base_colour  linear RGB, which multiplies the picture and the colours of the vertices
    picture      float32 [H, W, 3], linear RGB, the first row on top; None without one
    wrap         what becomes of coordinates outside of 0 and 1, along u and v
    emission     linear RGB
    holes        what surfaces of it are cut by before they are an `Asset`; None for what has none
    blends       whether what is behind is seen through it by degrees: holes are all of that there is
    """

    name: str = ""
    base_colour: Colour = PLAIN
    picture: np.ndarray | None = None
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    emission: Colour = (0.0, 0.0, 0.0)
    holes: Holes | None = None
    blends: bool = False


@dataclass(frozen=True, eq=False)
class Motion:
    """How an animation moves parts of a file; those that move as one share it.

    name   of the node that moves
    pose   time in seconds -> rigid pose in the file's own space, float64 [4, 4], from where they are at time 0
    end    seconds, after which it stands still
    fault  why it is none that is rigid; None where it is
    """

    name: str
    pose: Callable[[float], np.ndarray]
    end: float
    fault: str | None = None


@dataclass(frozen=True, eq=False)
class Part:
    """Triangles of one material.

    vertices  float64 [V, 3]
    faces     int32 [F, 3], counter-clockwise seen from outside
    normals   float64 [V, 3], unit
    uv        float64 [V, 2], u to the right, v up, (0, 0) the lower left corner of the picture, its transform applied; or None
    colours   float64 [V, 3], linear RGB; or None
    alpha     float64 [V], 0 to 1, what `Material.holes` asks for; None for 1
    nodes     what it hangs on by name, from the top: nodes of glTF; objects and groups of OBJ where these were asked for
    motion    how the animation that was asked for moves it, from where it is; None for what stands still
    """

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray
    material: Material
    uv: np.ndarray | None = None
    colours: np.ndarray | None = None
    alpha: np.ndarray | None = None
    nodes: tuple[str, ...] = ()
    motion: Motion | None = None

    def transformed(self, pose: np.ndarray) -> Part:
        """The part moved by an affine pose, float64 [4, 4], that does not mirror."""
        linear = pose[:3, :3]
        normals = self.normals @ np.linalg.inv(linear)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        return replace(self, vertices=self.vertices @ linear.T + pose[:3, 3], normals=normals)


@dataclass(frozen=True, eq=False)
class Asset:
    """A file's parts, z up, and sentences about what was mended, made or left out. `axes` is what brought them from the file's
    own space to z up, float64 [4, 4]."""

    path: Path
    parts: tuple[Part, ...]
    findings: tuple[str, ...]
    axes: np.ndarray = field(default_factory=lambda: np.eye(4))

    @property
    def box(self) -> np.ndarray:
        """Lowest and highest corner, float64 [2, 3]."""
        corners = [p.vertices[p.faces].reshape(-1, 3) for p in self.parts]
        return np.stack([np.min([c.min(axis=0) for c in corners], axis=0), np.max([c.max(axis=0) for c in corners], axis=0)])


class Findings:
    """Sentences, each once, with counts where a reader counts."""

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()
        self._said: dict[str, None] = {}

    def count(self, what: str, number: int = 1) -> None:
        """Adds to how often there is `what`, such as 'faces that are nothing'. Not at all is not said."""
        if number:
            self._said.setdefault(what)
            self._counts[what] += int(number)

    def say(self, sentence: str) -> None:
        self._said.setdefault(sentence)

    def sentences(self) -> tuple[str, ...]:
        return tuple(f"{what}: {self._counts[what]}" if what in self._counts else what for what in self._said)
