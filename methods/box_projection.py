"""Box projection: an environment map whose surroundings are a box, of any place and turn (Lagarde and Zanuttini 2012).

The map is that of `environment_map`. A reflected ray is cut with a box, and the map is looked up where the ray leaves it.
Point and direction are turned into the box, the length found there is applied in the world. An artist places the paper's
boxes; without one, each mirror's is fitted at the scene's start to the objects that surround it, along their walls, or to
all that there is where none does (`kernels.images.roombox`).

Exact in an empty box of a room, whatever its place, turn and sides, and wherever the mirror stands in it. What stands in the
room is shown where its shadow from the map's centre falls on the walls. A ray that starts outside of the box ends where it
leaves it; if it never does, its direction is looked up as it is. Highlights are those that the reflector's centre sees. What
is black because another mirror is there is doubted, and so is what the map itself says to lie beside the ray
(`kernels.images.parallax`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import drjit as dr
from pydantic import Field

from benchharness.api import Frame, Knob, Method, Reflection
from benchharness.kernels import passage
from benchharness.kernels.differentials import FirstHits
from benchharness.kernels.images import parallax, probe, proxy, roombox
from benchharness.scene import Scene


@dataclass
class State:
    """What is kept of a scene: maps and boxes, per reflector."""

    taken: probe.State
    boxes: list[proxy.Box]


@dataclass(frozen=True)
class BoxProjection(Method):
    """
    resolution  texels per edge of a cube face, a power of two
    mip         trilinear lookup in a mip pyramid; else bilinear in the finest level
    box         the middle's x, y, z, the sides along x, y, z before the turn, all in metres, and the turn about z in degrees,
                one for all mirrors; None: fitted
    """

    resolution: Annotated[int, Field(ge=4, le=4096)] = 256
    mip: bool = True
    box: tuple[float, float, float, float, float, float, float] | None = None

    knobs: ClassVar[tuple[Knob, ...]] = (Knob("resolution", (16, 32, 64, 128, 256, 512)),)
    family: ClassVar[str] = "maps and proxies"
    paper: ClassVar[str] = "Lagarde and Zanuttini 2012"
    limits: ClassVar[dict[str, str]] = parallax.LIMITS

    def __post_init__(self) -> None:
        if self.resolution & (self.resolution - 1):
            raise ValueError(f"box_projection: resolution is {self.resolution}; accepted: a power of two, such as 256")
        if self.box is not None and not min(self.box[3:6]) > 0:
            raise ValueError(f"box_projection: box is {list(self.box)}; accepted: sides, its numbers 4 to 6, above 0")

    def prepare(self, scene: Scene) -> State:
        if self.box is None:
            boxes = [box.uploaded() for box in roombox.around_mirrors(scene)]
        else:
            boxes = [roombox.given(self.box, scene).uploaded()] * len(scene.reflectors)
        return State(probe.begun(scene), boxes)

    def update(self, state: State, frame: Frame) -> State:
        return replace(state, taken=probe.updated(state.taken, frame.poses, self.resolution, mip=self.mip))

    def shade(self, state: State, frame: Frame) -> tuple[Reflection, State]:
        hits = FirstHits(frame.p, frame.n, frame.reflector)
        plain = state.taken.surroundings.colour is not None
        L, distance, doubt = parallax.looked_up(
            state.taken.probes, state.boxes, frame.view, hits, frame.active, doubts=frame.doubts, plain=plain
        )
        found = frame.active & ~(passage.walled(state.taken.enclosed, frame.reflector) & (distance == dr.inf))
        return Reflection(L, distance, found, doubt=doubt if frame.doubts else None), state
