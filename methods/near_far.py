"""Near and far: what is near a mirror is moved vertex by vertex, over an environment map of what is far from it.

Roger and Holzschuch 2006, section 5, recommend it: their search for close objects, an environment map for further ones and the
background. They say neither what is close, nor how both are put together; what follows is ours.

Around the middle of each mirror is a ball, `split` times as large as the mirror. What reaches into it is moved and drawn as
`newton` does it. A cube map from the middle shows what lies beyond; the nearer is not in it, not even as parts of triangles, or
it would be seen twice where what is moved uncovers it. A pixel shows what is moved where that lies within the ball, else the
map. No depths are compared: a ray leaves the ball once, so that whatever is met within comes first (`kernels.images.nearfar`).
The map begins at the share `overlap` of the ball, or a wall that crosses its border would end there twice, with a gap between.
Where a pixel finds something in the map that lies within the ball, which it would have seen moved, it looks where its ray
leaves the ball.

Without `split`, the ball ends where the map's parallax is `parallax_px`: predicted from how the mirror turns the eye's rays and
how far from the middle they start. As the eye moves it stays for a while, and so does the map, which is taken again when the
ball is another one, its mirror has moved, or something has that it shows. What is near may move as it likes.

Of the two methods that it is made of, the nearer one's faults stay near (long edges, one reflection per vertex, no second
bounce) and the farther one's far. Highlights of what is moved are those that the pixel's own point of the mirror sees, the
others those that the mirror's middle sees. Other mirrors are black.

Doubted is what either of them doubts: of what is moved, images of edges that bend, and searches that ended short of a root; of
the map, what its distances say is more than two pixels from its place, or behind something else (`kernels.images.parallax`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import drjit as dr
import mitsuba as mi
import numpy as np
from pydantic import Field

from benchharness.api import Frame, Knob, Method, Reflection, View
from benchharness.kernels import differentials, normalmap, passage, selfmet, surroundings
from benchharness.kernels.differentials import FirstHits
from benchharness.kernels.eye import eye_of
from benchharness.kernels.frozen import frozen
from benchharness.kernels.images import nearfar, parallax, probe, refresh
from benchharness.kernels.vertices import drawlist, problems, scenery, vertexwise, virtual, walks
from benchharness.scene import Scene

MAX_ITER = 60  # points after which a walk gives up, as in `newton`
LOOKUPS = 2  # again, with `far = "distance"`


@dataclass
class State(vertexwise.State):
    """
    mirrors   what walks are on
    probes    the maps of what is far
    division  what is near
    reach     of each mirror, on the device
    boxes     that hold all parts; the scenery has those of parts that are near
    enclosed  as `Scene.enclosed`; the scenery's own says that no mirror is, and its surroundings are black: where nothing is
              moved, the map is asked
    """

    mirrors: walks.Mirrors
    probes: probe.State
    division: nearfar.Division
    reach: list[mi.Float]
    boxes: passage.Boxes
    enclosed: tuple[bool, ...]


@dataclass
class Layer:
    """What is moved, as `Reflection` has it."""

    L: mi.Color3f
    distance: mi.Float
    found: mi.Bool
    doubt: mi.Bool | None


@dataclass(frozen=True)
class NearFar(Method):
    """
    split        radius of the ball within which things are moved, in radii of the mirror about the middle of its box; at least
                 1, so that the mirror lies within; None: by `parallax_px`
    parallax_px  pixels by which what is shown by the map may be off for its parallax; only without `split`
    far          a map is looked up by "direction" alone, as if all were infinitely far away; or again where its own "distance"
                 puts what it shows
    resolution   texels per edge of a cube face, a power of two
    overlap      share of the ball's radius from which on things are in the map, too; 0 for everything
    warm         start where the last frame's walks ended, and keep ball and lists while they serve
    split_px     edges are split whose images are off a straight line by more than this, pixels (kernels.vertices.tessellation);
                 0 for none
    """

    split: Annotated[float, Field(ge=1, le=1e6)] | None = None
    parallax_px: Annotated[float, Field(gt=0, le=1e3)] = 2.0
    far: Literal["direction", "distance"] = "direction"
    resolution: Annotated[int, Field(ge=4, le=4096)] = 256
    overlap: Annotated[float, Field(ge=0, le=1)] = 0.75
    warm: bool = True
    split_px: Annotated[float, Field(ge=0, le=1e3)] = scenery.SPLIT_PX

    knobs: ClassVar[tuple[Knob, ...]] = (
        Knob("split", (1.0, 2.0, 4.0, 8.0, 16.0)),
        Knob("parallax_px", (16.0, 8.0, 4.0, 2.0, 1.0, 0.5)),
    )
    family: ClassVar[str] = "moved vertices"
    paper: ClassVar[str] = "Roger and Holzschuch 2006"
    limits: ClassVar[dict[str, str]] = {
        **parallax.LIMITS,
        "F-15": "where two triangles' edges end in a third's, less than two pixels of bend open a crack, and the map is seen",
        "F-16": "images of two triangles are bent in depth too, and of thin layers either may come out nearer",
        "F-20, F-21": "half a focal length away roots lie so close that a search may stop beside the one it calls its own",
        "F-20": "one reflection per vertex is looked for, and nothing says that there are more",
        "F-21": "at a focus half vector and normal agree all over the mirror, and one root cannot be told from the next",
        "P-04": "a map holds the highlights seen from its centre, and not whose surface they lie on",
    }

    def __post_init__(self) -> None:
        if self.resolution & (self.resolution - 1):
            raise ValueError(f"near_far: resolution is {self.resolution}; accepted: a power of two, such as 256")

    def refuses(self, scene: Scene) -> str | None:
        return normalmap.refusal(scene.reflectors)

    def prepare(self, scene: Scene) -> State:
        mirrors, searched = walks.mirrors_of(scene.reflectors)
        seen = scenery.of_scene(scene, searched, split_px=self.split_px, groups=mirrors.groups)
        nothing, boxes = surroundings.Surroundings(dr.opaque(mi.Color3f, 0.0)), passage.of_scene(scene)
        seen = replace(
            seen,
            surroundings=nothing,
            enclosed=(False,) * len(scene.reflectors),
            boxes=boxes,
            stock=drawlist.stock(scene, searched, "whole") if seen.stock is None else seen.stock,
        )
        division = nearfar.Division.begun(scene)
        return State(seen, [], None, mirrors, probe.begun(scene), division, [], boxes, tuple(scene.enclosed))

    def update(self, state: State, frame: Frame) -> State:
        division = state.division.moved(refresh.matrices(frame.poses))
        state = replace(state, scenery=scenery.posed(state.scenery, frame), division=division)
        if self.split is None:  # an eye decides; until it is there, the last one did
            return self._reaching(state, frame, division.reach.tolist()) if state.reach else state
        return self._reaching(state, frame, [self.split * mirror.extent for mirror in division.mirrors])

    def shade(self, state: State, frame: Frame) -> tuple[Reflection, State]:
        if self.split is None:
            state = self._reaching(state, frame, self._wanted(state.division, frame))
        layer, counters = None, {}
        if state.division.near.faces.any():
            moved, state = self._moved(state, frame)
            layer, counters = Layer(moved.L, moved.distance, moved.found, moved.doubt), moved.counters
        hits = FirstHits(frame.p, frame.n, frame.reflector)
        held = passage.walled(state.enclosed, frame.reflector)
        L, distance, found, doubt = _composed(
            state.probes.probes,
            state.reach,
            frame.view,
            hits,
            frame.active,
            held,
            layer,
            LOOKUPS if self.far == "distance" else 0,
            doubts=frame.doubts,
            plain=state.probes.surroundings.colour is not None,
        )
        counters["near_triangles"] = dr.opaque(mi.UInt32, int(state.division.near.faces.sum()))
        return Reflection(L, distance, found, None, counters, doubt if frame.doubts else None), state

    def _wanted(self, division: nearfar.Division, frame: Frame) -> list[float]:
        """How far the ball around every mirror has to reach for an eye."""
        assert division.poses is not None
        eye, reach = eye_of(frame), []
        for i, mirror in enumerate(division.mirrors):
            before = float(division.reach[i]) if self.warm else 0.0
            if not eye.visible[i]:
                reach.append(before or mirror.extent)
                continue
            pose = division.poses[division.first + i]
            reach.append(nearfar.wanted(mirror, pose, eye.place, eye.focal, self.parallax_px, before))
        return reach

    def _reaching(self, state: State, frame: Frame, reach: list[float]) -> State:
        """With balls of these radii, and the maps taken anew that no longer hold."""
        division, device, probes = state.division.reaching(reach, keeps=self.warm), state.reach, state.probes
        if not device or (division.reach != state.division.reach).any():
            device = [dr.opaque(mi.Float, radius) for radius in division.reach.tolist()]
        if any(again := division.stale(self.overlap)):
            beyond = [dr.opaque(mi.Float, self.overlap * radius) for radius in division.reach.tolist()]
            probes = probe.taken(probes, frame.poses, self.resolution, beyond, again, mip=True)
            division = division.taking(again, self.overlap)
        return replace(
            state,
            scenery=replace(state.scenery, near=division.near),
            division=division,
            reach=device,
            probes=probes,
        )

    def _moved(self, state: State, frame: Frame) -> tuple[Reflection, State]:
        """What is near, moved; elsewhere black, at an infinite distance."""
        seen, drawing = state.scenery, virtual.Drawing("cut")
        if frame.doubts:  # where nothing is drawn, something may be missing of what is near
            parts = np.unique(state.division.owner[state.division.near.faces.any(axis=0)])
            state = replace(state, scenery=replace(seen, boxes=passage.of_parts(state.boxes, parts)))

        def solve(g: int, problem: problems.Problem, last: walks.Ends) -> vertexwise.Solved:
            own = walks.meeting(state.mirrors, g, seen.objects, frame, "black")
            return walks.solved(state.mirrors, g, problem, last, frame, own, drawing)

        return vertexwise.shown(
            state,
            frame,
            solve,
            walks.Ends.cold,
            other_mirrors="black",
            max_iter=MAX_ITER,
            warm=self.warm,
            sheets=None,
        )


@frozen
def _composed(
    probes: list[probe.Probe],
    reach: list[mi.Float],
    view: View,
    hits: FirstHits,
    active: mi.Bool,
    held: mi.Bool,
    layer: Layer | None,
    lookups: int,
    *,
    doubts: bool,
    plain: bool,
) -> tuple[mi.Color3f, mi.Float, mi.Bool, mi.Bool]:
    """What is moved over the maps: radiance, distance, found, and doubt if asked for.

    held     what ends at infinity was lost
    layer    what is moved; None where nothing is near any mirror
    lookups  how often a map is asked again where its distances put what it shows; 0 for its directions alone
    plain    the surroundings are the same in all directions
    """
    p, n = hits.p, hits.n
    r, differential, bends = differentials.reflected(hits, view)
    turn = differential.turn
    L, distance, doubt, near = mi.Color3f(0), mi.Float(0), mi.Bool(False), mi.Bool(False)
    for i, (taken, radius) in enumerate(zip(probes, reach, strict=True)):
        own = active & (hits.reflector == i)
        x, d = mi.Vector3f(p - taken.place), mi.Vector3f(r)
        value = probe.far(taken.map, r, turn, own)
        for _ in range(max(lookups, 1)):
            # Nearer than the border lies nothing that is not moved.
            seen = value.w > 0
            asked = own & ((value.w * radius > 1) | (held & ~seen))
            if lookups > 0:
                asked |= own & seen
            end = x + _away(x, r, dr.maximum(dr.rcp(dr.select(seen, value.w, dr.inf)), radius)) * r
            other = probe.far(taken.map, end, turn, asked)
            better = asked & (other.w * radius <= 1)
            value, d = dr.select(better, other, value), dr.select(better, dr.normalize(end), d)
        away = parallax.shown_at(x, d, value.w)
        moved = mi.Bool(False)
        if layer is not None:
            there = own & layer.found & (layer.distance < dr.inf)
            moved = there & ((dr.norm(x + layer.distance * r) < radius) | (value.w <= 0))
            near |= moved
        L, distance = dr.select(own, mi.Color3f(value.x, value.y, value.z), L), dr.select(own, away, distance)
        if layer is not None:
            L, distance = dr.select(moved, layer.L, L), dr.select(moved, layer.distance, distance)
        if doubts:
            looked = own & ~moved
            doubt |= parallax.misplaced(taken.map, x, r, d, value.w, differential, looked, plain=plain)
            doubt |= looked & (selfmet.away(p, n, r, differential.dp, bends, taken.box, looked) < away)
    if doubts and len(probes) > 1:
        doubt |= active & ~near & (distance < dr.inf) & (dr.max(L) <= 0)
    if doubts and layer is not None and layer.doubt is not None:
        doubt |= active & layer.doubt
    return L, dr.select(active, distance, 0), active & ~(held & (distance == dr.inf)), doubt


def _away(x: mi.Vector3f, r: mi.Vector3f, radius: mi.Float) -> mi.Float:
    """How far along the unit direction r a ray is from its start, at x from the middle of a ball, where it leaves it; where it
    starts beyond, as far as where it is nearest to the middle."""
    along = dr.dot(x, r)
    return dr.maximum(dr.sqrt(dr.maximum(along * along - dr.squared_norm(x) + radius * radius, 0)) - along, 0)
