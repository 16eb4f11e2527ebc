"""Distance impostor: a cube map that knows how far it sees, so that rays find what it shows (Szirmay-Kalos et al. 2005).

A cube map per reflector, captured in `update` from the reflector's centre by rasterizing everything but the reflector itself.
Each pixel looks for the point of its own reflected ray that lies as far from the centre as the map sees in its direction, and
looks up that direction (`kernels.images.distancemap`). So what is near is in its place, unlike in an environment map.

`search = "iterate"` is the iteration of 2005: a guess that is exact where start and end of the ray see the same plane, then
false position. It finds some point where the ray passes behind what the map sees, not always the first. "march" takes steps
along the ray until it passes behind, then secants between the last two (Umenhoffer, Patow, Szirmay-Kalos 2007): the first
such point, but for what is thinner than a step. With one layer, what the centre does not see is not there, and rays behind it
end on a skin between an outline and what lies beyond it. With several `layers`, each shows what comes next behind the one
before it, and a march goes through all of them (`kernels.images.layered`); what is closed takes two, its front and its back.
Highlights are those that the reflector's centre sees.

Doubted:
* where the search has not closed in: the point that is shown lies more than two pixels beside the ray
* where depth jumps between the texels around the point: an outline, or a skin
* rays that start behind what the map sees; of several layers, those that pass through none of them, or close by where one ends
* where a march over every texel ends elsewhere, more than two pixels away as seen from the centre: something lies before
* where half a texel is wider than two pixels
* as in an environment map: what lies beyond a hollow of the mirror that is met again (`kernels.selfmet`); in a scene of several
  mirrors, what is black
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import drjit as dr
import mitsuba as mi
from pydantic import Field

from benchharness.api import Frame, Knob, Method, Reflection, View
from benchharness.kernels import cubemap, differentials, passage, selfmet
from benchharness.kernels.differentials import FirstHits, RayDifferential
from benchharness.kernels.frozen import frozen
from benchharness.kernels.images import distancemap, layered, probe
from benchharness.kernels.pixels import WRONG_PX
from benchharness.scene import Scene

Search = Literal["iterate", "march"]
SURE = 1024  # steps of a march that says whether the first point was found; no more than there are texels are taken


@dataclass
class State:
    """The reflectors' maps, and how far each of them sees; their layers, none where there is one for each."""

    taken: probe.State
    distances: list[distancemap.DistanceMap]
    layers: list[layered.Layers]


@dataclass(frozen=True)
class DistanceImpostor(Method):
    """
    resolution  texels per edge of a cube face, a power of two
    search      "iterate": false position between the start and infinity; "march": steps, then false position between two
    iterations  of false position, after its first guess
    steps       of a march, at most; none is shorter than a texel
    mip         trilinear lookup in a mip pyramid; else bilinear in the finest level. Distances are always of the finest
    layers      surfaces behind one another in each direction, of which the centre sees the first; above 1 for "march" alone
    """

    resolution: Annotated[int, Field(ge=4, le=4096)] = 256
    search: Search = "march"
    iterations: Annotated[int, Field(ge=0, le=64)] = 6
    steps: Annotated[int, Field(ge=1, le=4096)] = 64
    mip: bool = True
    layers: Annotated[int, Field(ge=1, le=8)] = 1

    knobs: ClassVar[tuple[Knob, ...]] = (
        Knob("resolution", (16, 32, 64, 128, 256, 512)),
        Knob("iterations", (0, 1, 2, 4, 8), {"search": "iterate"}),
        Knob("steps", (4, 16, 64, 256), {"search": "march"}),
        Knob("layers", (1, 2, 4), {"search": "march"}),
    )
    family: ClassVar[str] = "maps and proxies"
    paper: ClassVar[str] = "Szirmay-Kalos et al. 2005; Umenhoffer, Patow, Szirmay-Kalos 2007"
    limits: ClassVar[dict[str, str]] = {
        "F-01": "at grazing incidence images are a few pixels wide, and one of them is the outline that the centre sees",
        "F-11, F-23, F-25": "rays that meet the mirror again elsewhere than in a hollow of one radius are not traced",
        "F-17": "no frame is compared with the last",
        "F-18": "through a telephoto lens outlines are off by less than half a texel, which is up to two pixels wide",
        "F-21": "something small at the focus fills the mirror, but few texels of its map",
        "I-03": "a card seen edge-on from the mirror's centre fills no texel of its map",
        "P-04": "a map holds the highlights seen from its centre, and not whose surface they lie on",
    }

    def __post_init__(self) -> None:
        if self.resolution & (self.resolution - 1):
            raise ValueError(f"distance_impostor: resolution is {self.resolution}; accepted: a power of two, such as 256")
        if self.layers > 1 and self.search != "march":
            raise ValueError(f"distance_impostor: layers is {self.layers}; accepted: 1, or search = 'march'")

    def prepare(self, scene: Scene) -> State:
        return State(probe.begun(scene), [], [])

    def update(self, state: State, frame: Frame) -> State:
        taken = probe.updated(state.taken, frame.poses, self.resolution, mip=self.mip)
        if self.layers > 1:
            return State(taken, [], layered.taken(taken, frame.poses, self.resolution, self.layers, mip=self.mip))
        return State(taken, [distancemap.of_map(one.map.texels, self.resolution) for one in taken.probes], [])

    def shade(self, state: State, frame: Frame) -> tuple[Reflection, State]:
        hits = FirstHits(frame.p, frame.n, frame.reflector)
        how = self.search, self.iterations, self.steps
        L, distance, doubt = _looked_up(
            state.taken.probes, state.distances, state.layers, frame.view, hits, frame.active, how, doubts=frame.doubts
        )
        found = frame.active & ~(passage.walled(state.taken.enclosed, frame.reflector) & (distance == dr.inf))
        return Reflection(L, distance, found, doubt=doubt if frame.doubts else None), state


@dataclass
class _End:
    """Where a search has ended: the point, the maps that it is looked up in, and whether there is reason to doubt it."""

    spot: distancemap.Spot
    map: cubemap.Pyramid
    seen: distancemap.DistanceMap
    unsure: mi.Bool


@frozen
def _looked_up(
    probes: list[probe.Probe],
    distances: list[distancemap.DistanceMap],
    layers: list[layered.Layers],
    view: View,
    hits: FirstHits,
    active: mi.Bool,
    how: tuple[Search, int, int],
    *,
    doubts: bool,
) -> tuple[mi.Color3f, mi.Float, mi.Bool]:
    """Radiance, distance, and doubt if asked for, from the map of each pixel's reflector. how: search, iterations, steps."""
    search, iterations, steps = how
    p, n = hits.p, hits.n
    r, differential, bends = differentials.reflected(hits, view)
    value, distance, doubt = mi.Vector4f(0), mi.Float(0), mi.Bool(False)
    for i, taken in enumerate(probes):
        own, box = active & (hits.reflector == i), taken.box
        known = layers[i] if layers else distances[i]
        of = distancemap.ray(mi.Vector3f(p - taken.place), r)
        end = _followed(taken, known, of, how, own)
        d = distancemap.direction(of, end.spot)
        turn = _turn(differential, of, end.spot)
        value = dr.select(own, probe.far(end.map, d, turn, own), value)
        length = distancemap.length(of, end.spot)
        # At infinity where the map sees something: a ray that was lost, which shows what an environment map does.
        length = dr.select((length == dr.inf) & (value.w > 0), dr.rcp(dr.select(value.w > 0, value.w, 1)), length)
        distance = dr.select(own, length, distance)
        if not doubts:
            continue
        doubt |= end.unsure | (own & (_beside(differential, of, end.spot) > WRONG_PX))
        doubt |= own & distancemap.is_edge(end.seen, d, own)
        doubt |= own & (distance > selfmet.away(p, n, r, differential.dp, bends, box, own))
        doubt |= own & (WRONG_PX * turn * taken.map.n < 1)
        if len(probes) > 1:
            sharp = cubemap.lookup_mip(end.map, d, mi.Float(0), own)
            doubt |= own & (sharp.w > 0) & (dr.max(sharp.xyz) <= 0)
        if search == "iterate" or steps < SURE:
            first = _followed(taken, known, of, ("march", iterations, SURE), own)
            apart = dr.norm(dr.normalize(distancemap.direction(of, first.spot)) - dr.normalize(d))
            doubt |= own & (apart > WRONG_PX * dr.maximum(turn, _turn(differential, of, first.spot)))
    return mi.Color3f(value.x, value.y, value.z), distance, doubt


def _followed(
    taken: probe.Probe,
    known: distancemap.DistanceMap | layered.Layers,
    of: distancemap.Ray,
    how: tuple[Search, int, int],
    active: mi.Bool,
) -> _End:
    """The end of rays in a mirror's map, or in its layers."""
    search, iterations, steps = how
    if isinstance(known, layered.Layers):
        met = layered.march(known, of, steps, iterations, active)
        return _End(met.spot, *known.at(met.layer), met.lost | met.beside)
    if search == "march":
        found = distancemap.march(known, of, steps, iterations, active)
    else:
        found = distancemap.iterate(known, of, iterations, active)
    return _End(found.spot, taken.map, known, found.hidden)


def _turn(differential: RayDifferential, of: distancemap.Ray, spot: distancemap.Spot) -> mi.Float:
    """By how much the direction from the map's centre turns from one pixel to the next."""
    far = of.a * spot.t
    across = [dr.norm(spot.s * dp + far * dd) for dp, dd in zip(differential.dp, differential.dd, strict=True)]
    return dr.maximum(*across) * dr.rcp(dr.maximum(dr.norm(distancemap.direction(of, spot)), distancemap.AT_CENTRE))


def _beside(differential: RayDifferential, of: distancemap.Ray, spot: distancemap.Spot) -> mi.Float:
    """How many pixels beside the ray the point lies that is shown: m / (f + s), where the ray is at m / s."""
    m = distancemap.direction(of, spot)
    off = spot.f * dr.rcp(dr.maximum(spot.f + spot.s, 1e-12)) * m
    scaled = RayDifferential([spot.s * dp for dp in differential.dp], differential.dd)
    return dr.select(dr.squared_norm(off) > 0, scaled.pixels(of.a * spot.t, off), 0)
