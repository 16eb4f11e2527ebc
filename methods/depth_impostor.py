"""Depth-map impostors: reflected rays meet pictures with depth (Popescu et al. 2006, section 4).

Every object is seen by one or more cameras from around it, the first from where the mirror is. A reflected ray is a straight
line in a camera's picture too, so that its hit is found in one dimension, along that line: on one of many turned rows of the
depth map that were simplified to a few segments beforehand (`intersector = "srdm"`), between two of them ("srdm_interpolated",
which section 5 proposes where few are turned), or texel by texel ("march"). What is flat remains a billboard in its own plane,
and the environment map is behind, as in `billboard_impostor`. Mirrors are depth maps with normals, from which the ray goes
on once; with `own_maps` a mirror is reflected in itself too.

Assumes that what matters of an object can be seen by its cameras: what none of them sees is not there. A depth map is rigid:
it moves with its object, and is taken again only once the mirror has moved around the object by more than `turn`.

Doubted (`kernels.images.depthray`, `kernels.images.relief`):
* rays that run behind the surface of all maps of a part, before their hit: what is there no camera saw
* rays over rows that had no room for all their spans
* hits on a step from one sample to the next, a skin that may join what stands apart
and, as in `billboard_impostor`, the environment map where the ray passes its centre too far away; hollows of the mirror
that it meets again, without `own_maps`; second reflections that go on towards a further mirror.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from benchharness.api import Frame, Knob, Method, Reflection
from benchharness.kernels.images import bounces, imagewise, relief, roles
from benchharness.kernels.images.capture import CaptureOptions
from benchharness.kernels.images.depthray import Anchor
from benchharness.scene import Scene

DENSITY = {"srdm": 1.0, "srdm_interpolated": 1.0, "march": 2.0}
"""Texels per pixel, of maps that are as large as they are seen. Rays that march find an outline half a texel too small."""


@dataclass(frozen=True)
class DepthImpostor(Method):
    """
    resolution   texels across a map and its picture, a power of two
    rotations    n: turned sets of rows, over 180 degrees
    points       m: of a simplified row, even
    maps         depth maps per object: from the mirror, from behind, then from the sides, from below and above
    own_maps     depth maps of a mirror in which it is reflected itself, from both ends of its x axis, of y, of z; 0 for no
                 self-reflection
    intersector  "srdm": simplified rows, the nearest; "srdm_interpolated": between the nearest of the two rotations beside the
                 ray's image; "march": every texel along the ray
    anchor       the row is that through the ray's "mid" or "start"
    split_jump   step of depth, of the map's whole range, above which neighbours are not one surface; 0: they always are, and
                 a skin joins parts that stand before one another. Every map has its own skins: with several, or with
                 own_maps, of bodies with limbs and hollows, 0.05 is better
    turn         degrees that the mirror may move around an object before its maps are taken again
    mip          lookup in the nearest level of a mip pyramid of the pictures; else in the finest level; both bilinear
    planes       texels across the picture of a flat part, of which there is one for all mirrors; a power of two
    environment  texels per edge of a face of the environment map, where one is taken
    other_mirrors  what other mirrors are: "reflective", "black", or "omitted"
    walls        height in metres of the walls in which the ground's picture passes into the environment; 0 for none
    sizes        of pictures: "fixed", all of `resolution` and `planes`; or "seen", each as large as its part can be seen in its
                 mirror, a power of two up to `resolution`: none where that is less than a pixel or the mirror is out of the
                 picture, and taken again only once what it shows has moved by half a texel. They depend on the eye then, and
                 `shade` takes them
    attenuation  share of the light lost per metre of the reflected ray, as exp(-attenuation distance)
    """

    resolution: Annotated[int, Field(ge=8, le=2048)] = 256
    rotations: Annotated[int, Field(ge=1, le=180)] = 60
    points: Annotated[int, Field(ge=2, le=64, multiple_of=2)] = 16
    maps: Annotated[int, Field(ge=1, le=6)] = 1
    own_maps: Annotated[int, Field(ge=0, le=6)] = 0
    intersector: Literal["srdm", "srdm_interpolated", "march"] = "srdm"
    anchor: Anchor = "mid"
    split_jump: Annotated[float, Field(ge=0, le=1)] = 0.0
    turn: Annotated[float, Field(ge=0, le=180)] = 0.0
    mip: bool = True
    planes: Annotated[int, Field(ge=8, le=4096)] = 512
    environment: Annotated[int, Field(ge=4, le=4096)] = 256
    other_mirrors: Literal["reflective", "black", "omitted"] = "reflective"
    sizes: Literal["fixed", "seen"] = "fixed"
    walls: Annotated[float, Field(ge=0, le=1e6)] = 0.0
    attenuation: Annotated[float, Field(ge=0, le=1e6)] = 0.0

    knobs: ClassVar[tuple[Knob, ...]] = (
        Knob("resolution", (32, 64, 128, 256)),
        Knob("rotations", (8, 20, 60)),
        Knob("points", (4, 8, 16, 32)),
        Knob("maps", (1, 2, 4), {"split_jump": 0.05}),
    )
    family: ClassVar[str] = "impostors"
    paper: ClassVar[str] = "Popescu et al. 2006 (depth maps)"
    limits: ClassVar[dict[str, str]] = {
        "I-04": "what goes around the mirror at a distance is in its environment map, where the rays that should meet it pass",
        "F-11, F-23, F-25": "rays that meet the mirror again elsewhere than in a hollow of one radius are not traced",
        "F-17": "texels flicker by less than two pixels, and no frame is compared with the last",
        "P-04": "a picture holds the highlights seen from its camera, and not whose surface they lie on",
    }

    def __post_init__(self) -> None:
        for name, value in (("resolution", self.resolution), ("planes", self.planes)):
            if value & (value - 1):
                raise ValueError(f"depth_impostor: {name} is {value}; accepted: a power of two, such as 256")

    def prepare(self, scene: Scene) -> imagewise.State:
        ground = roles.ground_of(scene) if self.walls > 0 else None
        shown = self.other_mirrors != "omitted"
        planned = roles.plan(scene, maps=self.maps, own_maps=self.own_maps, mirrors=shown, ground=ground)
        return imagewise.begun(scene, planned)

    def update(self, state: imagewise.State, frame: Frame) -> imagewise.State:
        return imagewise.updated(state, frame.poses, self._capture())

    def _capture(self) -> CaptureOptions:
        return CaptureOptions(
            size=self.resolution,
            planes=self.planes,
            mip=self.mip,
            resolution=self.environment,
            turn=float(np.radians(self.turn)),
            walls=self.walls,
            rotations=self.rotations,
            points=0 if self.intersector == "march" else self.points,
            split_jump=self.split_jump,
            again=self.other_mirrors == "reflective",
            density=DENSITY[self.intersector] if self.sizes == "seen" else 0.0,
        )

    def shade(self, state: imagewise.State, frame: Frame) -> tuple[Reflection, imagewise.State]:
        state = imagewise.seen(state, frame, self._capture())
        options = bounces.TraceOptions(
            second_bounce=self.other_mirrors == "reflective",
            doubts=frame.doubts,
            walk=relief.Walk(self.split_jump, self.anchor, pair=self.intersector == "srdm_interpolated"),
        )
        return imagewise.shown(state, frame, options, self.attenuation)
