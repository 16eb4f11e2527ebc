"""Morphed reflections: environment maps of several places within a mirror, interpolated for each reflection point.

A reconstruction of Martin and Popescu (2004), whose report was not at hand. Told of it is one sentence of Roger and Holzschuch
(2006, section 2): several environment maps are interpolated, which removes the issues of parallax, takes longer to precompute,
and holds for a mirror within the area that the maps are of. So the maps are of the surroundings, and what is between them is a
place, where the mirror is; they are not pictures of the reflection, between which the eye would be. Ours is all else:

* where they are: at regular places of each mirror's box, about as dense along all its sides, since the points that reflect are
  there, and nothing else stands there; taken anew by `update`, so that the area moves with its mirror, and things may move too
* with which weights: linear ones along the three axes, of the eight maps around the reflection point
* what is interpolated (`kernels.images.morph`). `morph = False`, the least that the sentence can mean, blends what all eight
  show in the ray's own direction: what is near is there up to eight times. With `morph` their pictures are brought to the
  reflection point first, by the distances that they have along the ray.

Exact at a map's own place, and where all is far. With `morph`, also where the eight maps see one plane, along the ray and where
it ends. Else what is shown is off by as much as the maps disagree: that falls at least with the square of their spacing where
the surroundings are smooth, and does not at outlines, where one map sees something near and another what is behind. Rays that
meet the mirror again and other mirrors, which are black in a map, are as in an environment map. Highlights are those that the
maps' places see, blended.

Doubted, as in `probe_blend`, is a pixel of which more than a fifth is shown by maps that themselves say that it lies beside the
ray (`kernels.images.parallax`). Of a blend no one distance is right: given is that of the surface with the largest share.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import drjit as dr
from pydantic import Field

from benchharness.api import Frame, Knob, Method, Reflection
from benchharness.kernels import passage
from benchharness.kernels.differentials import FirstHits
from benchharness.kernels.images import morph, parallax
from benchharness.scene import Scene


@dataclass(frozen=True)
class ReflectionMorph(Method):
    """
    samples     maps along the longest side of a mirror's box, and as many along the others as makes cells about cubes
    morph       pictures of maps are brought to the reflection point before they are blended
    resolution  texels per edge of a cube face, a power of two
    mip         trilinear lookup in a mip pyramid; else bilinear in the finest level. Distances are always of the finest
    """

    samples: Annotated[int, Field(ge=1, le=4)] = 2
    morph: bool = True
    resolution: Annotated[int, Field(ge=4, le=1024)] = 128
    mip: bool = True

    knobs: ClassVar[tuple[Knob, ...]] = (Knob("resolution", (16, 32, 64, 128, 256)), Knob("samples", (1, 2, 3, 4)))
    family: ClassVar[str] = "maps and proxies"
    paper: ClassVar[str] = "Martin and Popescu 2004, reconstructed"
    limits: ClassVar[dict[str, str]] = parallax.LIMITS

    def __post_init__(self) -> None:
        if self.resolution & (self.resolution - 1):
            raise ValueError(f"reflection_morph: resolution is {self.resolution}; accepted: a power of two, such as 128")

    def prepare(self, scene: Scene) -> morph.State:
        return morph.begun(scene, self.samples)

    def update(self, state: morph.State, frame: Frame) -> morph.State:
        return morph.updated(state, frame.poses, self.resolution, mip=self.mip)

    def shade(self, state: morph.State, frame: Frame) -> tuple[Reflection, morph.State]:
        hits = FirstHits(frame.p, frame.n, frame.reflector)
        plain = state.mirrors.surroundings.colour is not None
        L, distance, doubt = morph.looked_up(
            state.grids, frame.view, hits, frame.active, morph=self.morph, doubts=frame.doubts, plain=plain
        )
        found = frame.active & ~(passage.walled(state.mirrors.enclosed, frame.reflector) & (distance == dr.inf))
        return Reflection(L, distance, found, doubt=doubt if frame.doubts else None), state
