"""Finite sphere: an environment map whose surroundings are a sphere about the reflector's centre (Bjorke 2004).

The map is that of `environment_map`. A reflected ray is cut with a sphere about the map's centre, and the map is looked up
where it leaves the sphere: x + t r with t = -b + sqrt(b² - q), b = x·r, q = x·x - radius² (`kernels.images.proxy`). The
paper's sphere has a radius that an artist chooses; without one, it is here the mean distance of the map's own surfaces, over
all directions, divided by the share of directions that have any. It follows the scene whenever the map is taken again.

Exact for a spherical room about the reflector's centre. What is nearer or farther than the sphere is shown in the wrong
place, by about |x| (1 / D - 1 / radius) radians; with nothing around, the sphere grows beyond all bounds, and what is left
is the environment map. Highlights are those that the reflector's centre sees. What is black because another mirror is there is
doubted, and so is what the map itself says to lie beside the ray (`kernels.images.parallax`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import drjit as dr
import mitsuba as mi
from pydantic import Field

from benchharness.api import Frame, Knob, Method, Reflection
from benchharness.kernels import passage
from benchharness.kernels.differentials import FirstHits
from benchharness.kernels.images import parallax, probe, proxy
from benchharness.scene import Scene


@dataclass
class State:
    """What is kept of a scene: maps, the radius that was asked for in its units (None: fitted), and each map's sphere."""

    taken: probe.State
    radius: mi.Float | None
    spheres: list[proxy.Sphere]


@dataclass(frozen=True)
class FiniteSphere(Method):
    """
    resolution  texels per edge of a cube face, a power of two
    mip         trilinear lookup in a mip pyramid; else bilinear in the finest level
    radius      metres; None: the mean of the map's distances, over all directions
    """

    resolution: Annotated[int, Field(ge=4, le=4096)] = 256
    mip: bool = True
    radius: Annotated[float, Field(gt=0, le=1e9)] | None = None

    knobs: ClassVar[tuple[Knob, ...]] = (Knob("resolution", (16, 32, 64, 128, 256, 512)),)
    family: ClassVar[str] = "maps and proxies"
    paper: ClassVar[str] = "Bjorke 2004"
    limits: ClassVar[dict[str, str]] = parallax.LIMITS

    def __post_init__(self) -> None:
        if self.resolution & (self.resolution - 1):
            raise ValueError(f"finite_sphere: resolution is {self.resolution}; accepted: a power of two, such as 256")

    def prepare(self, scene: Scene) -> State:
        radius = None if self.radius is None else dr.opaque(mi.Float, self.radius / scene.unit)
        return State(probe.begun(scene), radius, [])

    def update(self, state: State, frame: Frame) -> State:
        taken = probe.updated(state.taken, frame.poses, self.resolution, mip=self.mip)
        spheres = [proxy.fitted(one.map) if state.radius is None else proxy.Sphere(state.radius) for one in taken.probes]
        return State(taken, state.radius, spheres)

    def shade(self, state: State, frame: Frame) -> tuple[Reflection, State]:
        hits = FirstHits(frame.p, frame.n, frame.reflector)
        plain = state.taken.surroundings.colour is not None
        L, distance, doubt = parallax.looked_up(
            state.taken.probes, state.spheres, frame.view, hits, frame.active, doubts=frame.doubts, plain=plain
        )
        found = frame.active & ~(passage.walled(state.taken.enclosed, frame.reflector) & (distance == dr.inf))
        return Reflection(L, distance, found, doubt=doubt if frame.doubts else None), state
