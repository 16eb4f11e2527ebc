"""Blended probes: environment maps at regular places of the room, shared by all mirrors, as games have them.

The room is the box around what surrounds the mirrors (`kernels.images.roombox`). It is cut into `probes` cells per axis, with a
cube map in the middle of each. A reflected ray is cut with the room's box, as in `box_projection`, and every map near its start
is looked up where the ray leaves it; their colours are blended, by weights that fall off across the borders of cells
(`kernels.images.probegrid`). Places within a closed object have no map: there, and outside the room, an environment fills
what is missing, the map nearest to the room's middle, looked up by direction alone.

Exact in an empty box of a room. What stands in the room is shown where each map's centre sees it on the walls: midway between
two maps it is there twice. Mirrors are in no map: what another mirror should show of itself is what is behind it, which is
doubted where the ray meets its box. Maps stay where they are, whatever moves. Highlights are those that the maps' places see.
Doubted is a pixel of which more than a fifth is shown by maps that themselves say that it lies beside the ray
(`kernels.images.parallax`). Of a blend no one distance is right: given is that of the surface with the largest share.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import drjit as dr
from pydantic import Field

from benchharness.api import Frame, Knob, Method, Reflection
from benchharness.kernels import passage
from benchharness.kernels.differentials import FirstHits
from benchharness.kernels.images import parallax, probegrid
from benchharness.scene import Scene


@dataclass(frozen=True)
class ProbeBlend(Method):
    """
    probes      maps per axis of the room
    blend       over how much of half a cell, on both sides of its border, a weight falls off; 0 for hard borders
    resolution  texels per edge of a cube face, a power of two
    mip         trilinear lookup in a mip pyramid; else bilinear in the finest level
    """

    probes: Annotated[int, Field(ge=1, le=8)] = 2
    blend: Annotated[float, Field(ge=0, le=1)] = 0.5
    resolution: Annotated[int, Field(ge=4, le=1024)] = 128
    mip: bool = True

    knobs: ClassVar[tuple[Knob, ...]] = (Knob("resolution", (16, 32, 64, 128, 256)), Knob("probes", (1, 2, 3, 4)))
    family: ClassVar[str] = "maps and proxies"
    paper: ClassVar[str] = "Lagarde and Zanuttini 2012"
    limits: ClassVar[dict[str, str]] = parallax.LIMITS

    def __post_init__(self) -> None:
        if self.resolution & (self.resolution - 1):
            raise ValueError(f"probe_blend: resolution is {self.resolution}; accepted: a power of two, such as 128")

    def prepare(self, scene: Scene) -> probegrid.State:
        return probegrid.begun(scene, self.probes, self.blend)

    def update(self, state: probegrid.State, frame: Frame) -> probegrid.State:
        return probegrid.updated(state, frame.poses, self.resolution, mip=self.mip)

    def shade(self, state: probegrid.State, frame: Frame) -> tuple[Reflection, probegrid.State]:
        assert state.maps is not None and state.boxes is not None
        hits = FirstHits(frame.p, frame.n, frame.reflector)
        plain = state.mirrors.surroundings.colour is not None
        L, distance, doubt = probegrid.looked_up(
            state.grid, state.maps, state.boxes, frame.view, hits, frame.active, doubts=frame.doubts, plain=plain
        )
        found = frame.active & ~(passage.walled(state.mirrors.enclosed, frame.reflector) & (distance == dr.inf))
        return Reflection(L, distance, found, doubt=doubt if frame.doubts else None), state
