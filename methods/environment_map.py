"""Environment map: the scene as seen from the reflector's centre, looked up by direction alone (Blinn and Newell 1976).

A cube map per reflector, captured in `update` by rasterizing everything but the reflector itself. Each pixel looks up the
mirror direction of its own ray as if all surroundings were infinitely far away.

Assumes distant surroundings. What is near is shown in the wrong place: the parallax between the reflector's centre and
the reflection point is ignored, and contact between an object and its image is lost. Highlights are those that the
reflector's centre sees. With `mip`, the level is chosen from how far the direction turns from one pixel to the next, so
that a strongly curved mirror does not alias.

Doubted: let x be the reflection point seen from the centre, r the mirror direction, and a the turn of r from this pixel to
the next. The centre sees the points x + t r of the ray by angles |x - (x·r) r| / |x + t r| away from r.
* What is shown at a distance D from the centre is about |x - (x·r) r| / (D a) pixels from its place: more than two are doubted.
* What should be shown lies on the ray. With `mip`, four of its points are looked up, in the level whose texels are as wide
  as the gaps between them. Where one is more than two pixels from r and the map shows a surface nearer to the centre
  than it, the ray has met something that is not shown.
* What lies beyond the mirror itself, where a hollow of it is likely met again (`kernels.selfmet`): it is not in its map.
* In a scene of several mirrors, what is black: in the map the others are, and nothing that is lit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import drjit as dr
import mitsuba as mi
from pydantic import Field

from benchharness.api import Frame, Knob, Method, Reflection, View
from benchharness.kernels import cubemap, differentials, passage, selfmet
from benchharness.kernels.differentials import FirstHits
from benchharness.kernels.frozen import frozen
from benchharness.kernels.images import probe
from benchharness.kernels.pixels import WRONG_PX
from benchharness.scene import Scene

WAY = (0.4, 1.0, 2.5, 6.25)  # where a ray's way is looked at, in distances of its start from the centre
SPAN = 0.6  # of the angle between a point of the way and the way's end: so far is the next point, 1 - 1 / 2.5
COVER = 0.1  # share of a texel that what is near has to fill


@dataclass(frozen=True)
class EnvironmentMap(Method):
    """
    resolution  texels per edge of a cube face, a power of two
    mip         trilinear lookup in a mip pyramid; else bilinear in the finest level
    """

    resolution: Annotated[int, Field(ge=4, le=4096)] = 256
    mip: bool = True

    knobs: ClassVar[tuple[Knob, ...]] = (Knob("resolution", (16, 32, 64, 128, 256, 512)),)
    family: ClassVar[str] = "maps and proxies"
    paper: ClassVar[str] = "Blinn and Newell 1976; Greene 1986"
    limits: ClassVar[dict[str, str]] = {
        "F-01": "at grazing incidence something small slips through between the four points of the ray that are looked up",
        "F-03, F-08": "near its silhouette a mirror shows so much in two pixels that what is less far off differs all the same",
        "F-11, F-23, F-25": "rays that meet the mirror again elsewhere than in a hollow of one radius are not traced",
        "F-17": "no frame is compared with the last",
        "F-18": "through a telephoto lens something small slips through between the points of the ray that are looked up",
        "F-21": "something small at the focus fills the mirror, but no texel of the levels in which the ray is looked up",
        "F-25, F-26": "rays that meet the mirror again elsewhere than in a hollow of one radius are not traced",
        "F-30": "what goes into the mirror fills texels only where the mirror's centre sees it",
        "I-03": "a card seen edge-on from the mirror's centre fills no texel of its map",
    }

    def __post_init__(self) -> None:
        if self.resolution & (self.resolution - 1):
            raise ValueError(f"environment_map: resolution is {self.resolution}; accepted: a power of two, such as 256")

    def prepare(self, scene: Scene) -> probe.State:
        return probe.begun(scene)

    def update(self, state: probe.State, frame: Frame) -> probe.State:
        return probe.updated(state, frame.poses, self.resolution, mip=self.mip)

    def shade(self, state: probe.State, frame: Frame) -> tuple[Reflection, probe.State]:
        hits = FirstHits(frame.p, frame.n, frame.reflector)
        L, distance, doubt = _looked_up(state.probes, frame.view, hits, frame.active, doubts=frame.doubts)
        found = frame.active & ~(passage.walled(state.enclosed, frame.reflector) & (distance == dr.inf))
        return Reflection(L, distance, found, doubt=doubt if frame.doubts else None), state


@frozen
def _looked_up(
    probes: list[probe.Probe], view: View, hits: FirstHits, active: mi.Bool, *, doubts: bool
) -> tuple[mi.Color3f, mi.Float, mi.Bool]:
    """Radiance, distance, and doubt if asked for, from the map of each pixel's reflector."""
    p, n = hits.p, hits.n
    r, differential, bends = differentials.reflected(hits, view)
    turn = differential.turn
    value, doubt = mi.Vector4f(0), mi.Bool(False)
    for i, taken in enumerate(probes):
        own = active & (hits.reflector == i)
        value = dr.select(own, probe.far(taken.map, r, turn, own), value)
        if not doubts:
            continue
        doubt |= _misplaced(taken.map, mi.Vector3f(p - taken.place), r, value.w, WRONG_PX * turn, own)
        doubt |= own & (value.w * selfmet.away(p, n, r, differential.dp, bends, taken.box, own) < 1)
    if doubts and len(probes) > 1:
        doubt |= active & (value.w > 0) & (dr.max(value.xyz) <= 0)
    distance = dr.select(active & (value.w <= 0), dr.inf, dr.rcp(dr.select(active, value.w, 1)))
    return mi.Color3f(value.x, value.y, value.z), dr.select(active, distance, 0), doubt


@dr.syntax
def _misplaced(
    map: cubemap.Pyramid, x: mi.Vector3f, r: mi.Vector3f, inverse: mi.Float, angle: mi.Float, active: mi.Bool
) -> mi.Bool:
    """Whether what is shown along r, at 1 / distance `inverse`, belongs more than `angle` away, or something else does there.

    x  start of the ray, from the map's centre
    """
    across, start = dr.norm(x - dr.dot(x, r) * r), dr.norm(x)
    off = active & (across * inverse > angle)
    if active & ~off:  # in a narrow room, few
        for t in WAY if map.count > 1 else ():
            q = x + t * start * r
            away = dr.norm(q)
            level = dr.log2(dr.maximum(across / away * (0.5 * SPAN * map.n), 1))
            nearness = cubemap.texel(map, q, level).w
            off |= (across > angle * away) & (nearness * away > COVER)
    return off
