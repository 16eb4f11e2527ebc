"""Screen-space reflections: reflected rays march across the picture itself (McGuire and Mara 2014; Uludag 2014).

The main view's colours and depths are all that there is of the scene (`kernels.images.screen`). Each reflected ray is a
straight line across the screen; it meets the first pixel that it comes to be behind, across an edge by no more than
`thickness`. Then the place is halved into and looked up between pixels. Nothing is kept from frame to frame.

Assumes that what is reflected is seen in the picture too. What is out of it, behind something, behind the eye, or turned
away from it is not there: with `fallback = "environment"`, an environment map from the reflector's centre stands in; "none" has
no answer. The frame tells no depth but the mirrors', so that `shade` draws the scene's depths once more. In the picture,
mirrors are black to others; rays pass a reflector's own pixels. Highlights are those that the eye sees. Colours are not
averaged over a ray's footprint: what a curved mirror shows much smaller aliases.

Counters: `screen_steps`, pixels or squares that were looked at; `on_screen`, 1 where the picture has an answer.

Doubted:
* the environment map, wherever it stands in
* rays that were behind something before: what they may have met there is hidden
* where the surface between pixels is not met: at an edge of depth or of a mirror, which is a hit on nothing
* what shows another reflector, which is black
* what lies beyond a hollow of the mirror that is met again (`kernels.selfmet`)
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import drjit as dr
import mitsuba as mi
from pydantic import Field

from benchharness.api import Frame, Knob, Method, Reflection, View
from benchharness.kernels import differentials, geometry, optics, passage, selfmet, surroundings
from benchharness.kernels.differentials import FirstHits
from benchharness.kernels.frozen import frozen
from benchharness.kernels.images import probe, screen
from benchharness.scene import Scene

Fallback = Literal["environment", "none"]
SHORTEST = 1e-6  # units of length: a reflected ray is at least so long


@dataclass
class State:
    """What is kept of a scene.

    world      its triangles in world space; None before the first update
    taken      per reflector a map, for the fallback, and its box
    thickness, max_steps  as of the method, in units of length
    """

    world: geometry.Geometry | None
    taken: probe.State
    thickness: mi.Float
    max_steps: mi.UInt32


@dataclass
class Reach:
    """How thick things are and how many steps there are, on the device."""

    thickness: mi.Float
    max_steps: mi.UInt32


@dataclass(frozen=True)
class Asked:
    """What is asked of a march."""

    march: screen.March
    bisections: int
    fallback: Fallback
    doubts: bool


@dataclass(frozen=True)
class ScreenSpace(Method):
    """
    march       "linear": pixel by pixel; "hierarchical": over a pyramid of least depths
    thickness   metres, along the view axis, that what is seen is taken to be thick
    max_steps   pixels, or squares of the pyramid, that a ray looks at, at most
    bisections  of the place where it was met
    fallback    where the picture has no answer: "environment", a map from the reflector's centre; "none"
    resolution  texels per edge of a face of that map, a power of two
    """

    march: screen.March = "hierarchical"
    thickness: Annotated[float, Field(ge=0, le=1e9)] = 0.2
    max_steps: Annotated[int, Field(ge=1, le=65536)] = 1024
    bisections: Annotated[int, Field(ge=0, le=32)] = 6
    fallback: Fallback = "environment"
    resolution: Annotated[int, Field(ge=4, le=4096)] = 256

    knobs: ClassVar[tuple[Knob, ...]] = (
        Knob("max_steps", (16, 64, 256, 1024)),
        Knob("resolution", (16, 64, 256)),
    )
    family: ClassVar[str] = "screen space"
    paper: ClassVar[str] = "McGuire and Mara 2014; Uludag 2014"
    limits: ClassVar[dict[str, str]] = {
        "F-11, F-23, F-25": "rays that meet the mirror again elsewhere than in a hollow of one radius are not traced",
        "F-17": "no frame is compared with the last",
        "P-04": "the picture holds the highlights that the eye sees, and not whose surface they lie on",
    }

    def __post_init__(self) -> None:
        if self.resolution & (self.resolution - 1):
            raise ValueError(f"screen_space: resolution is {self.resolution}; accepted: a power of two, such as 256")

    def prepare(self, scene: Scene) -> State:
        thickness = dr.opaque(mi.Float, self.thickness / scene.unit)
        max_steps = dr.opaque(mi.UInt32, self.max_steps)
        return State(None, probe.begun(scene), thickness, max_steps)

    def update(self, state: State, frame: Frame) -> State:
        if self.fallback == "environment":
            taken = probe.updated(state.taken, frame.poses, self.resolution, mip=True)
        else:
            taken = probe.without_maps(state.taken, frame.poses)
        return replace(state, world=geometry.placed(taken.geometry, frame.poses), taken=taken)

    def shade(self, state: State, frame: Frame) -> tuple[Reflection, State]:
        assert state.world is not None
        seen = screen.of_view(state.world, frame.view, frame.radiance, frame.reflector)
        hits = FirstHits(frame.p, frame.n, frame.reflector)
        asked = Asked(self.march, self.bisections, self.fallback, frame.doubts)
        reach = Reach(state.thickness, state.max_steps)
        answer = _reflected(seen, state.taken.probes, state.taken.surroundings, frame.view, hits, frame.active, reach, asked)
        found = answer.found & ~(passage.walled(state.taken.enclosed, frame.reflector) & (answer.distance == dr.inf))
        counters = {"screen_steps": answer.steps, "on_screen": mi.UInt32(dr.select(answer.met, 1, 0))}
        doubt = answer.doubt if frame.doubts else None
        return Reflection(answer.L, answer.distance, found, counters=counters, doubt=doubt), state


@dataclass
class Answer:
    """What all pixels show. met: the picture has it."""

    L: mi.Color3f
    distance: mi.Float
    found: mi.Bool
    met: mi.Bool
    doubt: mi.Bool
    steps: mi.UInt32


@frozen
def _reflected(
    seen: screen.Screen,
    maps: list[probe.Probe],
    around: surroundings.Surroundings,
    view: View,
    hits: FirstHits,
    active: mi.Bool,
    reach: Reach,
    asked: Asked,
) -> Answer:
    """From the screen where it has an answer, else from the map of each pixel's reflector."""
    p, n = hits.p, hits.n
    r = optics.reflect(dr.normalize(view.eye - p), n)
    pixel = dr.arange(mi.UInt32, view.width * view.height)
    line = screen.line(view, p, r, hits.reflector, pixel)
    march = screen.linear if asked.march == "linear" else screen.hierarchical
    met = march(seen, line, reach.thickness, reach.max_steps, active)
    tau, closed = screen.refined(seen, line, met, asked.bisections)

    # A ray that ends in the sky of the picture has met that.
    tau = dr.select(met.hit, tau, line.end)
    x, y = line.at(tau)
    there = screen.surface(seen, line, x, y, active)
    column, row = screen.pixel_at(seen, x, y)
    mirror = dr.gather(mi.Int32, seen.reflector, row * seen.width + column, active) >= 0
    sky = active & met.completed & line.far & (there.nearness <= 0) & ~mirror
    found = active & (met.hit | sky)
    L = dr.select(sky, surroundings.radiance(around, r, sky), there.radiance)
    distance = dr.select(sky, dr.inf, dr.maximum(line.length(tau), SHORTEST))

    differential, bends = differentials.of_reflected(hits, view, pixel, hits, r)
    turn = differential.turn
    value, doubt = mi.Vector4f(0), mi.Bool(False)
    for i, one in enumerate(maps):
        own = active & (hits.reflector == i)
        if asked.fallback == "environment":
            value = dr.select(own & ~found, probe.far(one.map, r, turn, own & ~found), value)
        if asked.doubts:
            doubt |= own & found & (distance > selfmet.away(p, n, r, differential.dp, bends, one.box, own))
    if asked.doubts:
        doubt |= found & (met.behind | mirror | there.edge | (met.hit & ~closed))
        doubt |= active & ~found & (asked.fallback == "environment")
    L = dr.select(found, L, mi.Color3f(value.x, value.y, value.z))
    distance = dr.select(found, distance, dr.select(value.w > 0, dr.rcp(dr.select(value.w > 0, value.w, 1)), dr.inf))
    answered = mi.Bool(active) if asked.fallback == "environment" else found
    return Answer(L, distance, answered, found, doubt, dr.select(active, met.steps, 0))
