"""Virtual triangles: which of a scene's triangles have an image in a mirror, and where the images end.

A virtual vertex is of one of three kinds: REFLECTED is an image, a point behind its mirror; HIDDEN lies where no reflection
shows it; NONE was not found. What needs care is triangles that reach into the hidden region. With "cut", they end where
their edges enter that region. There, on the mirror's outline or where an object goes into the mirror, the image meets what
it is the image of: the virtual vertex is the point of the edge itself. With "drop", they are left out; with "keep", their
hidden vertices are drawn wherever the caller put them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Protocol

import drjit as dr
import mitsuba as mi

from benchharness.kernels import depths, geometry, packets, raster
from benchharness.kernels.frozen import frozen
from benchharness.kernels.types import View
from benchharness.kernels.vertices import bent, flatsheet

NONE, REFLECTED, HIDDEN = 0, 1, 2
HALVINGS = 10  # of an edge, at most, to find where it enters the hidden region: a thousandth of its length, and
PRECISION = 0.25  # pixels that it is seen long at most
BEHIND = 2.0  # pixels, seen from the side: what is hidden deeper than this behind the mirror does not go into it
CONTACT = 1e-3  # share of the mirror's depth, but of no more than
AT_MOST = 8.0  # units, by which an image may lie in front of it: what touches a mirror is at its depth


@dataclass
class Images:
    """One mirror's virtual vertices, packets of 4 floats each.

    moved   virtual position (what the rasterizer sorts by), kind
    at      reflection point, free
    seen    whether the eye sees the reflection point; None where it sees all. Triangles with none that is seen are not drawn
    unsure  packets: the mirror's normal there, and 1 where what is shown may be wrong; None where no doubt is asked for
    """

    moved: mi.Float
    at: mi.Float
    seen: mi.Bool | None = None
    unsure: mi.Float | None = None


@dataclass
class Drawing:
    """What the kernels are compiled for.

    hidden   "cut", "drop" or "keep": see above
    depth    "perspective" or "screen_linear"; the latter knows no cut
    rigid    images are the scene mirrored in a plane: straight, and whole where they reach behind the eye
    """

    hidden: str
    depth: str = "perspective"
    rigid: bool = False


@dataclass
class Target:
    """Where one mirror's images are drawn, one lane per pixel of `view`.

    view   the camera
    p      the mirror's point
    own    whether the mirror is seen there
    back   nearness of the mirror's nearest back (`nearest_back`), behind which nothing is drawn; None if that is not asked
    layer  which of several mirrors it is: the number of its part; None where there is one
    """

    view: View
    p: mi.Point3f
    own: mi.Bool
    back: mi.Float | None = None
    layer: mi.UInt32 | None = None


class Hider(Protocol):
    """What is asked whether a mirror hides a point of the world: `textures.Texture`, `sight.Shadow`, `sight.Shadows` or
    `flatsheet.Behind`."""

    def hides(self, x: mi.Point3f, view: View, active: mi.Bool) -> tuple[mi.Bool, mi.Float]:
        """Whether it hides x from the eye, and the depth of the mirror there, from `view.depth`; where there are several
        mirrors, one x per triangle."""
        ...


@dataclass
class Assembled:
    """Virtual triangles ready to be drawn.

    points     virtual vertices, and where edges were cut: packets of position and kind
    triangles  what the virtual triangles are images of
    drawn      which of them to draw
    limit      how near each pixel lets them come
    nearness   per vertex, that of its reflection point; None where what is behind the mirror's back is drawn too
    bands      None where no doubt is asked for
    """

    points: mi.Float
    triangles: geometry.Geometry
    drawn: mi.Bool
    limit: mi.Float
    nearness: mi.Float | None
    bands: bent.Bands | None


@dataclass
class _Corners:
    """The scene's triangles, numbers `f` of `count`: their packets in `geometry.Geometry.faces`, and the kinds of their virtual
    vertices."""

    f: mi.UInt32
    count: int
    face: mi.Vector4u
    kinds: list[mi.UInt32]

    @property
    def index(self) -> tuple[mi.UInt32, mi.UInt32, mi.UInt32]:
        """Numbers of the vertices."""
        return self.face.x, self.face.y, self.face.z


@frozen
def assembled(
    images: Images, triangles: geometry.Geometry, part: mi.UInt32, target: Target, drawing: Drawing, hider: Hider | None
) -> Assembled:
    """The virtual triangles. With "cut", two slots per triangle: one may become two."""
    view, count = target.view, triangles.face_count
    f = dr.arange(mi.UInt32, count)
    face, corner = raster.corners(images.moved, triangles.faces, f, mi.Bool(True))
    corners = _Corners(f, count, face, [mi.UInt32(q.w) for q in corner])
    kinds = corners.kinds
    shown = (geometry.part_of(face) != part) & (kinds[0] != NONE) & (kinds[1] != NONE) & (kinds[2] != NONE)
    shown &= (kinds[0] == REFLECTED) | (kinds[1] == REFLECTED) | (kinds[2] == REFLECTED)
    if images.seen is not None:
        sights = [dr.gather(mi.Bool, images.seen, i) for i in corners.index]
        shown &= dr.any([(k == REFLECTED) & seen for k, seen in zip(kinds, sights, strict=True)])
    shown &= _turned_to_mirror(triangles.points, images.at, corners)
    whole = (kinds[0] == REFLECTED) & (kinds[1] == REFLECTED) & (kinds[2] == REFLECTED)
    if not drawing.rigid:  # in a mirror that bulges, a triangle that reaches behind the eye has no image
        near = [(q.w != REFLECTED) | (dr.dot(view.w, mi.Vector4f(q.x, q.y, q.z, 1)) > view.near) for q in corner]
        shown &= near[0] & near[1] & near[2]
    if drawing.hidden == "drop":
        shown &= whole
    nearness = None
    if target.back is not None:
        R = dr.gather(mi.Vector4f, images.at, dr.arange(mi.UInt32, triangles.vertex_count))
        nearness = depths.nearness(view, dr.maximum(depths.offset(view, R.xyz), 1e-12 - view.depth))
    there = depths.offset(view, target.p)
    nearest = depths.nearness(view, there - CONTACT * dr.minimum(view.depth + there, AT_MOST))
    limit = dr.select(target.own, mi.Float(dr.inf) if drawing.depth == "screen_linear" else nearest, -dr.inf)
    if drawing.hidden != "cut":
        bands = None if images.unsure is None else _bands(images, view, corners, shown, None, drawing)
        return Assembled(images.moved, triangles, shown, limit, nearness, bands)
    assert hider is not None
    uncut = Assembled(images.moved, triangles, shown, limit, nearness, None)
    return _cut(images, corners, view, hider, uncut, whole, drawing)


def _cut(
    images: Images, corners: _Corners, view: View, hider: Hider, made: Assembled, whole: mi.Bool, drawing: Drawing
) -> Assembled:
    """The triangles of `made`, those that are not `whole` cut where their edges enter the hidden region.

    The vertices of the scene come first, then two per triangle f, number f and f + count of the rest: where it was cut.
    """
    triangles, f, count, face, kinds = made.triangles, corners.f, corners.count, corners.face, corners.kinds
    vertex_count = triangles.vertex_count
    # Turn the triangle so that its first vertex is reflected and its last is hidden. A reflected pair keeps a
    # quadrilateral, i0 i1 two one; a single vertex a triangle, i0 one two.
    mixed = made.drawn & ~whole
    turn = dr.select(
        (kinds[0] == REFLECTED) & (kinds[2] == HIDDEN), 0, dr.select((kinds[1] == REFLECTED) & (kinds[0] == HIDDEN), 1, 2)
    )
    i, k = turned(corners.index, turn), turned(kinds, turn)
    pair = k[1] == REFLECTED
    shine = triangles.shine
    carried = [] if triangles.attributes is None else [triangles.attributes]
    if shine is not None:
        carried += [triangles.points, shine.normals, shine.visibility]
    if triangles.paint is not None:
        carried.append(triangles.paint.uv)
    one, one_offset = _entry(triangles.points, carried, i[0], dr.select(pair, i[2], i[1]), hider, view, mixed)
    two, two_offset = _entry(triangles.points, carried, dr.select(pair, i[1], i[0]), i[2], hider, view, mixed)
    first = mi.Vector4u(i[0], dr.select(pair, i[1], vertex_count + f), vertex_count + count + f, face.w)
    second = mi.Vector4u(i[0], vertex_count + count + f, vertex_count + f, face.w)
    slots = [packets.stored(value, count) for value in (dr.select(mixed, first, face), second)]
    ends = [[packets.stored(value, count) for value in end] for end in (one, two)]
    on_mirror = []
    if made.nearness is not None:
        on_mirror = [depths.nearness(view, offset) for offset in (one_offset, two_offset)]
    extra = mixed & pair
    dr.eval(slots, ends, on_mirror, made.drawn, extra)  # one kernel, before the parts are put together
    all_ = [images.moved, *carried]
    points, *carried = (dr.concat([mine, *others]) for mine, *others in zip(all_, *ends, strict=True))
    faces, drawn = dr.concat(slots), dr.concat([made.drawn, extra])
    nearness = None if made.nearness is None else dr.concat([made.nearness, *on_mirror])
    lit_from = triangles.points
    if shine is not None:
        lit_from, shine = carried[1], replace(shine, normals=carried[2], visibility=carried[3])
    attributes = None if triangles.attributes is None else carried[0]
    paint = None if triangles.paint is None else replace(triangles.paint, uv=carried[-1])
    lit = geometry.Geometry(lit_from, attributes, faces, vertex_count + 2 * count, 2 * count, shine, paint)
    bands = None
    if images.unsure is not None:
        cuts = _Cuts(mixed, pair, turn, pixel(view, one[0]), pixel(view, two[0]))
        bands = _bands(images, view, corners, made.drawn, cuts, drawing)
    return Assembled(points, lit, drawn, made.limit, nearness, bands)


@dataclass
class _Cuts:
    """Which triangles were cut, and where.

    mixed     whether a triangle was
    pair      whether two of its corners are reflected
    turn      which corner comes first, a reflected one
    one, two  pixels at which the two edges end
    """

    mixed: mi.Bool
    pair: mi.Bool
    turn: mi.UInt32
    one: mi.Point2f
    two: mi.Point2f


def _bands(images: Images, view: View, corners: _Corners, shown: mi.Bool, cuts: _Cuts | None, drawing: Drawing) -> bent.Bands:
    """The bands of the edges between reflected corners, and of those that were cut."""
    assert images.unsure is not None
    index = corners.index
    pixels = [pixel(view, dr.gather(mi.Vector4f, images.at, i)) for i in index]
    ends = [bent.reflected(view, images.at, images.unsure, i, x) for i, x in zip(index, pixels, strict=True)]
    is_reflected = [k == REFLECTED for k in corners.kinds]
    unsure = mi.Bool(False)
    for i, there in zip(index, is_reflected, strict=True):
        unsure |= there & (dr.gather(mi.Float, images.unsure, 4 * i + 3) > 0)
    edges = []
    for j, k in ((0, 1), (1, 2), (2, 0)):
        both = is_reflected[j] & is_reflected[k]
        edges.append(bent.Edge(pixels[j], pixels[k], dr.select(both, bent.sagitta(ends[j], ends[k]), 0)))
    if cuts is not None:
        first, second, _ = turned(ends, cuts.turn)
        whole = turned(edges, cuts.turn)
        other = dr.select(cuts.pair, second, first)
        to_one = bent.Edge(first.x, cuts.one, bent.sagitta_to_outline(first, cuts.one))
        to_two = bent.Edge(other.x, cuts.two, bent.sagitta_to_outline(other, cuts.two))
        edges = [whole[0], dr.select(cuts.mixed, to_one, whole[1]), dr.select(cuts.mixed, to_two, whole[2])]
    if drawing.rigid:
        edges = [replace(edge, sagitta=mi.Float(0)) for edge in edges]
    return bent.bands(view, corners.f, corners.count, edges, shown, unsure)


def turned(values: Any, turn: mi.UInt32 | mi.Int32) -> list:
    """The first three of `values`, rotated so that number `turn` comes first."""
    return [dr.select(turn == 0, values[k], dr.select(turn == 1, values[(k + 1) % 3], values[(k + 2) % 3])) for k in range(3)]


def _entry(
    points: mi.Float,
    carried: list[mi.Float],
    inner: mi.UInt32,
    outer: mi.UInt32,
    hider: Hider,
    view: View,
    active: mi.Bool,
) -> tuple[list[mi.Vector4f], mi.Float]:
    """Where the edge inner -> outer enters the hidden region, just behind the border: packets of position and of `carried`,
    and the depth of the mirror there, from `view.depth`."""
    a, b = dr.gather(mi.Vector4f, points, inner, active), dr.gather(mi.Vector4f, points, outer, active)
    if isinstance(hider, flatsheet.Behind):
        share = hider.share(a, b)
        surface_offset = depths.offset(view, dr.lerp(a, b, share).xyz)
    else:
        share, surface_offset = _entered(a, b, hider, view, active)
    x = dr.lerp(a, b, share)
    there = [dr.lerp(*(dr.gather(mi.Vector4f, buffer, i, active) for i in (inner, outer)), share) for buffer in carried]
    return [mi.Vector4f(x.x, x.y, x.z, HIDDEN), *there], surface_offset


@dr.syntax
def _entered(a: mi.Vector4f, b: mi.Vector4f, hider: Hider, view: View, active: mi.Bool) -> tuple[mi.Float, mi.Float]:
    """At which share of an edge a mirror begins to hide it, and the depth of the mirror there, from `view.depth`."""
    low, high = mi.Float(0), mi.Float(1)
    step, met, surface_offset = mi.UInt32(0), mi.Bool(False), mi.Float(0)
    length = dr.norm(pixel(view, a) - pixel(view, b))
    while dr.hint(
        active & (step < HALVINGS) & ((high - low) * length > PRECISION), label="find where an edge enters the hidden region"
    ):
        middle = 0.5 * (low + high)
        x = dr.lerp(a, b, middle)
        behind, surface = hider.hides(mi.Point3f(x.x, x.y, x.z), view, active)
        low, high = dr.select(behind, low, middle), dr.select(behind, middle, high)
        met |= behind
        surface_offset = dr.select(behind, surface, surface_offset)
        step += 1
    # On the mirror's outline, where the edge goes behind it, end a pixel before: the outline is round, and what is drawn
    # between two ends is straight. Where the edge goes into the mirror, end there.
    x = dr.lerp(a, b, high)
    own = depths.offset(view, x.xyz)
    surface_offset = dr.select(met, surface_offset, own)
    focal = dr.rcp(dr.norm(view.right))
    far_behind = (own - surface_offset) * focal > BEHIND * (view.depth + own)
    high -= dr.select(far_behind, dr.minimum(dr.rcp(dr.maximum(length, 1e-6)), 0.5 * high), 0)
    return high, surface_offset


def pixel(view: View, p: mi.Vector4f) -> mi.Point2f:
    """The pixel in which a point is seen; not before the near plane."""
    q = mi.Vector4f(p.x, p.y, p.z, 1)
    scale = dr.rcp(dr.maximum(dr.dot(view.w, q), view.near))
    return mi.Point2f(dr.dot(view.x, q) * scale, dr.dot(view.y, q) * scale)


def _turned_to_mirror(points: mi.Float, at: mi.Float, corners: _Corners) -> mi.Bool:
    """Whether a triangle shows its front to the reflection point of any of its reflected vertices, or has no back."""
    V = [dr.gather(mi.Vector4f, points, i).xyz for i in corners.index]
    normal = dr.cross(V[1] - V[0], V[2] - V[0])
    fronts = (corners.face.w & raster.CLOSED) == 0
    for v, i, kind in zip(V, corners.index, corners.kinds, strict=True):
        fronts |= (kind == REFLECTED) & (dr.dot(dr.gather(mi.Vector4f, at, i).xyz - v, normal) > 0)
    return fronts
