"""The method contract: all that a method author reads, here and in `benchharness.kernels.types`.

A method is a frozen dataclass in a file of its own; its fields are its parameters. It is given a scene once
(`prepare`), told when something moved (`update`) and asked for every frame (`shade`). State goes in and comes out;
`self` never changes. The harness owns time, synchronisation and files.

    View        a pinhole camera on the device
    Surface     a reflector's triangles
    Frame       what is known before any method runs: the first hit of every pixel
    Reflection  a method's answer
    Vertices    what a vertex-driven method found, part of the answer
    Knob        a parameter that says how much model a method takes

Device arrays are Mitsuba's types of the active variant (`mi.Float`, `mi.Point3f`, ...). Per-pixel arrays have one lane
per pixel, row major: lane = row * width + column. All positions and directions are in world space.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from benchharness.kernels.types import Frame as Frame
from benchharness.kernels.types import Reflection as Reflection
from benchharness.kernels.types import Surface as Surface
from benchharness.kernels.types import Vertices as Vertices
from benchharness.kernels.types import View as View

if TYPE_CHECKING:
    from benchharness.scene import Scene


@dataclass(frozen=True)
class Knob:
    """A parameter that says how much model a method takes, for `benchharness needs`.

    parameter  a field of the method
    values     what it is set to, from the smallest model to the largest
    given      what other fields are set to meanwhile
    split      whether edges of the scene are split beforehand (`Scene.h_max`), because the method cannot do so meanwhile
    reference  fields of `benchharness.render.reference.ReferenceOptions` that the largest model is to be judged by
    """

    parameter: str
    values: tuple[Any, ...]
    given: Mapping[str, Any] = field(default_factory=dict)
    split: bool = False
    reference: Mapping[str, Any] = field(default_factory=dict)


class Method(ABC):
    """Base of all methods. Subclasses are `@dataclass(frozen=True)`.

    paper   whose idea it is; `family` is of what kind, by which charts group methods
    knobs   parameters that say how much model it takes
    limits  entry of the catalogue of failures, as in `Regime.entry` -> why the method may fail there and cannot know
    """

    family: ClassVar[str] = ""
    paper: ClassVar[str]
    knobs: ClassVar[tuple[Knob, ...]] = ()
    limits: ClassVar[dict[str, str]] = {}

    def refuses(self, scene: Scene) -> str | None:
        """A sentence why this method cannot serve the scene, or None."""
        return None

    @abstractmethod
    def prepare(self, scene: Scene) -> Any:
        """Once per scene: the state that the other two start from. Timed as `prepare_ms`."""

    def update(self, state: Any, frame: Frame) -> Any:
        """At the start and when a part moved: what does not depend on the eye; other cameras may follow. `update_ms`."""
        return state

    @abstractmethod
    def shade(self, state: Any, frame: Frame) -> tuple[Reflection, Any]:
        """Every frame, never twice the same while time is taken. No NumPy, no printing. Timed as `shade_ms`."""
