"""Billboard impostors: reflected rays meet pictures of the scene's parts instead of the parts (Popescu et al. 2006, section 3).

Every object gets, for every mirror, a quad through its centroid that faces the mirror, with a picture of the object taken
from that side and transparent where the object is not. What is flat is its own quad, one for all mirrors. A reflected ray
shows the nearest quad that it meets at an opaque texel, and the environment map where it meets none. Other mirrors are
quads with a normal per texel, from which the ray goes on once.

Assumes that an object is far from the mirror for its depth: within a quad there is no parallax, and an object that touches
the mirror is cut off or stands off where the quad does. Independent of the mirror's geometry; rebuilt only for what moved.

Doubted, all within reach of what is at hand; two pixels are the bound for what is off:
* hits on a picture of something deep, seen from so far aside of the picture's camera that its depth is off, or from behind;
  and rays that pass so near to it that its depth may meet them (`kernels.images.billboard`)
* the environment map where the ray passes its centre too far away for the distance of what it shows (`kernels.images.backdrop`)
* what lies beyond the mirror itself, where a hollow of it is likely met again (`kernels.selfmet`)
* second reflections that go on towards a further mirror, by its sphere; with `other_mirrors` "black", every one
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from benchharness.api import Frame, Knob, Method, Reflection
from benchharness.kernels.images import bounces, imagewise, roles
from benchharness.kernels.images.capture import CaptureOptions
from benchharness.scene import Scene


@dataclass(frozen=True)
class BillboardImpostor(Method):
    """
    resolution   texels across a picture, a power of two
    mip          lookup in the nearest level of a mip pyramid of the pictures; else in the finest level; both bilinear
    planes       texels across the picture of a flat part, of which there is one for all mirrors; a power of two
    environment  texels per edge of a face of the environment map, where one is taken
    other_mirrors  what other mirrors are: "reflective" billboards, "black" ones, or "omitted"
    walls        height in metres of the walls in which the ground's picture passes into the environment; 0 for none. Only for
                 a scene whose panorama goes on from one of its objects
    sizes        of pictures: "fixed", all of `resolution` and `planes`; or "seen", each as large as its part can be seen in its
                 mirror, a power of two up to `resolution`: none where that is less than a pixel or the mirror is out of the
                 picture, and taken again only once what it shows has moved by half a texel. They depend on the eye then, and
                 `shade` takes them
    attenuation  share of the light lost per metre of the reflected ray, as exp(-attenuation distance)
    """

    resolution: Annotated[int, Field(ge=8, le=4096)] = 256
    mip: bool = True
    planes: Annotated[int, Field(ge=8, le=4096)] = 512
    environment: Annotated[int, Field(ge=4, le=4096)] = 256
    other_mirrors: Literal["reflective", "black", "omitted"] = "reflective"
    sizes: Literal["fixed", "seen"] = "fixed"
    walls: Annotated[float, Field(ge=0, le=1e6)] = 0.0
    attenuation: Annotated[float, Field(ge=0, le=1e6)] = 0.0

    knobs: ClassVar[tuple[Knob, ...]] = (
        Knob("resolution", (16, 32, 64, 128, 256)),
        Knob("planes", (32, 128, 512)),
        Knob("environment", (16, 64, 256)),
    )
    family: ClassVar[str] = "impostors"
    paper: ClassVar[str] = "Popescu et al. 2006 (billboards)"
    limits: ClassVar[dict[str, str]] = {
        "I-04": "what goes around the mirror at a distance is in its environment map, where the rays that should meet it pass",
        "F-11, F-23, F-25": "rays that meet the mirror again elsewhere than in a hollow of one radius are not traced",
        "F-17": "texels flicker by less than two pixels, and no frame is compared with the last",
        "P-04": "a picture holds the highlights seen from its camera, and not whose surface they lie on",
    }

    def __post_init__(self) -> None:
        for name, value in (("resolution", self.resolution), ("planes", self.planes)):
            if value & (value - 1):
                raise ValueError(f"billboard_impostor: {name} is {value}; accepted: a power of two, such as 256")

    def prepare(self, scene: Scene) -> imagewise.State:
        ground = roles.ground_of(scene) if self.walls > 0 else None
        return imagewise.begun(scene, roles.plan(scene, mirrors=self.other_mirrors != "omitted", ground=ground))

    def update(self, state: imagewise.State, frame: Frame) -> imagewise.State:
        return imagewise.updated(state, frame.poses, self._capture())

    def _capture(self) -> CaptureOptions:
        return CaptureOptions(
            size=self.resolution,
            planes=self.planes,
            mip=self.mip,
            resolution=self.environment,
            turn=0.0,
            walls=self.walls,
            again=self.other_mirrors == "reflective",
            density=1.0 if self.sizes == "seen" else 0.0,
        )

    def shade(self, state: imagewise.State, frame: Frame) -> tuple[Reflection, imagewise.State]:
        state = imagewise.seen(state, frame, self._capture())
        options = bounces.TraceOptions(second_bounce=self.other_mirrors == "reflective", doubts=frame.doubts)
        return imagewise.shown(state, frame, options, self.attenuation)
