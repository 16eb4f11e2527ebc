"""Drawing the virtual scene: triangles whose vertices were moved to where a mirror shows them.

A virtual vertex is a point in space behind its mirror, so the ordinary rasterizer draws virtual triangles, nearest first,
at the mirror's own pixels and behind its surface. What needs care is triangles that reach into the hidden region, which
no reflection shows (kind HIDDEN). With `cut`, they end where their edges enter that region. There, on the mirror's outline
or where an object goes into the mirror, the image meets what it is the image of: the virtual vertex is the point of the
edge itself. With `drop`, they are left out; with `keep`, their hidden vertices are drawn wherever the caller put them.

Two ways to interpolate. "perspective": a virtual vertex is a point in space, and its triangle a triangle in space (Estalella
et al. 2006). "screen_linear": a triangle spans the reflection points on the mirror, and its depth is the distance d_V
from there to the vertex, linear on the screen (Roger and Holzschuch 2006, 3.3.6). The second is drawn as triangles in space
too, whose vertices lie on the same rays of the eye at depth 1 / (1 - d_V / d_max): 1 / depth is linear on the screen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi

from benchharness.kernels import depths, geometry, raster
from benchharness.kernels.frozen import frozen
from benchharness.kernels.vertices import bent, search

NONE, REFLECTED, HIDDEN = 0, 1, 2
HALVINGS = 10  # of an edge, at most, to find where it enters the hidden region: a thousandth of its length, and
PRECISION = 0.25  # pixels that it is seen long at most
BEHIND = 2.0  # pixels, seen from the side: what is hidden deeper than this behind the mirror does not go into it
CONTACT = 1e-3  # share of the mirror's depth, but of no more than
AT_MOST = 8.0  # units, by which an image may lie in front of it: what touches a mirror is at its depth


@dataclass
class Images:
    """One mirror's virtual vertices, packets of 4 floats each.

    moved  virtual position (what the rasterizer sorts by), kind
    at     reflection point, free
    seen   whether the eye sees the reflection point; None where it sees all. Triangles with none that is seen are not drawn
    sure   packets: the mirror's normal there, and 1 where what is shown may be wrong; None where no doubt is asked for
    """

    moved: mi.Float
    at: mi.Float
    seen: mi.Bool | None = None
    sure: mi.Float | None = None


@dataclass
class Drawing:
    """What the kernels are compiled for.

    hidden   "cut", "drop" or "keep": see above
    depth    "perspective" or "screen_linear"; the latter knows no cut
    behind   whether what lies behind the mirror's own nearest back is left out
    """

    hidden: str
    depth: str = "perspective"
    behind: bool = False


def sorted_by_length(R: mi.Point3f, d_V: mi.Float, d_max: mi.Float, view) -> mi.Point3f:
    """Where to draw a vertex in "screen_linear": on the eye's ray through R, in front of all that is reflected from farther."""
    share = dr.minimum(d_V / d_max, 1 - 1e-4)
    direction = (R - view.eye) * dr.rcp(dr.dot(view.w, mi.Vector4f(R.x, R.y, R.z, 1)))
    # From an eye far away: 1 / depth = (1 - share / view.depth) / view.depth, all within about a unit.
    scale = dr.maximum(view.depth, 1)
    there = share / (1 - share / scale) + (scale - view.depth)
    return mi.Point3f(R + (there - depths.offset(view, R)) * direction)


@dataclass
class Picture:
    """A mirror's texture (`kernels.search`), asked whether the mirror hides a point."""

    texels: mi.Float
    view: Any

    def hides(self, x: mi.Point3f, view, active) -> tuple[mi.Bool, mi.Float]:
        """Whether the mirror stands between the eye and x, and its depth there, from `view.depth`. `view` is the frame's, not
        the texture's."""
        column, row, seen = search.texel_of(self.view, x)
        covered, surface = search.surface(self.texels, self.view, column, row, seen & active)
        return covered & (depths.offset(view, x) > surface), surface


def draw(
    images: Images, triangles: geometry.Geometry, part, view, p: mi.Point3f, reflector, layer, drawing: Drawing, hider=None,
    back: mi.Float | None = None,
):  # fmt: skip
    """What one mirror shows: radiance, length of the reflected ray, coverage, doubt; a lane per pixel, 0 where it is not seen.

    triangles         the scene in world space; from `geometry.placed`, so that highlights are those that each pixel's `p` sees
    part              number of the mirror's part, which does not show itself
    p                 the mirror's point at each pixel
    reflector, layer  number of the mirror at each pixel; this mirror's
    hider             what is asked whether the mirror hides a point, such as `Picture`; needed for "cut"
    back              nearness of the mirror's nearest back at each pixel (`nearest_back`); needed for `behind`
    """
    packets, shown, drawn, limit, inverse, bands = _assembled(
        images, triangles, part, view, p, reflector, layer, hider, drawing
    )
    least = None if inverse is None else (inverse, back)
    visibility = raster.rasterize(packets, shown.faces, shown.face_count, view, limit=limit, least=least, drawn=drawn)
    spans = images.at if drawing.depth == "screen_linear" else packets
    hazy = None if bands is None else bent.covered(bands, view, dr.select(reflector == layer, mi.Float(dr.inf), -dr.inf))
    return _shown(packets, spans, shown, visibility, view, p, reflector, layer, bands, hazy, drawing.depth)


def nearest_back(surface, poses: mi.Float, part: mi.UInt32, view) -> mi.Float:
    """`depths.nearness` of the nearest triangle of a mirror that turns its back to the eye, or `depths.nowhere`, one lane per
    pixel.

    surface   a `benchharness.api.Surface`, part number `part`
    """
    points, _ = search.posed(surface, poses, part)
    visibility = raster.rasterize(points, surface.faces, surface.face_count, view, cull="front")
    return _nearness_at(points, surface.faces, visibility, view)


@frozen
@dr.syntax
def _nearness_at(points, faces, visibility, view):
    pixel = dr.arange(mi.UInt32, view.width * view.height)
    triangle = raster.winner_at(visibility, view, pixel, mi.Bool(True))
    value = mi.Float(depths.nowhere(view))
    if triangle != raster.NONE:
        value = depths.nearness(view, depths.offset(view, raster.met(points, faces, triangle, view, pixel)[2]))
    return value


@frozen
@dr.syntax
def _shown(
    packets, spans, triangles: geometry.Geometry, visibility, view, p: mi.Point3f, reflector, layer, bands, hazy, depth: str
):
    """`spans`: the points that triangles lie between, in whose plane what they carry is interpolated."""
    pixel = dr.arange(mi.UInt32, view.width * view.height)
    own = reflector == layer
    triangle = raster.winner_at(visibility, view, pixel, own)
    hit = own & (triangle != raster.NONE)
    L, distance = mi.Color3f(0), mi.Float(0)
    if hit:
        face, weights, q = raster.met(spans, triangles.faces, triangle, view, pixel)
        L = geometry.radiance(triangles, face, weights, p, mi.Bool(True))
        if dr.hint(depth == "screen_linear", mode="scalar"):
            distance = dr.norm(raster.interpolate(triangles.points, face, weights, mi.Bool(True)).xyz - p)
        else:
            distance = dr.maximum(dr.dot(q - p, dr.normalize(p - view.eye)), 0)
    doubt = mi.Bool(False)
    if bands is not None:
        # A triangle that was cut is in two slots.
        doubt = hit & dr.gather(mi.Bool, bands.doubted, triangle % (bands.count // 3), hit)
        doubt |= own & (raster.winner_at(hazy, view, pixel, own) != raster.NONE)
    return L, distance, hit, doubt


@frozen
def _assembled(images: Images, triangles: geometry.Geometry, part, view, p, reflector, layer, hider, drawing: Drawing):
    """Virtual vertices, the triangles with what they are images of, which to draw, how near a pixel lets them come, where
    what is behind is left out the nearness of the vertices' reflection points, and where doubt is asked for, `bent.Bands`.

    With "cut", two slots per triangle: one may become two. The vertices of the scene come first, then two per triangle f,
    number f and f + face_count of the rest: where it was cut.
    """
    vertex_count, count = triangles.vertex_count, triangles.face_count
    f = dr.arange(mi.UInt32, count)
    face, corner = raster.corners(images.moved, triangles.faces, f, mi.Bool(True))
    kinds = [mi.UInt32(q.w) for q in corner]
    shown = (geometry.part_of(face) != part) & (kinds[0] != NONE) & (kinds[1] != NONE) & (kinds[2] != NONE)
    shown &= (kinds[0] == REFLECTED) | (kinds[1] == REFLECTED) | (kinds[2] == REFLECTED)
    if images.seen is not None:
        sights = [dr.gather(mi.Bool, images.seen, i) for i in (face.x, face.y, face.z)]
        shown &= dr.any([(k == REFLECTED) & seen for k, seen in zip(kinds, sights, strict=True)])
    shown &= _turned_to_mirror(triangles.points, images.at, face, kinds)
    whole = (kinds[0] == REFLECTED) & (kinds[1] == REFLECTED) & (kinds[2] == REFLECTED)
    # A triangle that reaches behind the eye has no image.
    near = [(q.w != REFLECTED) | (dr.dot(view.w, mi.Vector4f(q.x, q.y, q.z, 1)) > view.near) for q in corner]
    shown &= near[0] & near[1] & near[2]
    if drawing.hidden == "drop":
        shown &= whole
    inverse = None
    if drawing.behind:
        R = dr.gather(mi.Vector4f, images.at, dr.arange(mi.UInt32, vertex_count))
        inverse = depths.nearness(view, dr.maximum(depths.offset(view, R.xyz), 1e-12 - view.depth))
    there = depths.offset(view, p)
    nearest = depths.nearness(view, there - CONTACT * dr.minimum(view.depth + there, AT_MOST))
    limit = dr.select(reflector == layer, mi.Float(dr.inf) if drawing.depth == "screen_linear" else nearest, -dr.inf)
    if drawing.hidden != "cut":
        bands = None if images.sure is None else _bands(images, view, f, count, face, kinds, shown, None)
        return images.moved, triangles, shown, limit, inverse, bands

    # Turn the triangle so that its first vertex is reflected and its last is hidden. A reflected pair keeps a
    # quadrilateral, i0 i1 two one; a single vertex a triangle, i0 one two.
    mixed = shown & ~whole
    turn = dr.select(
        (kinds[0] == REFLECTED) & (kinds[2] == HIDDEN), 0, dr.select((kinds[1] == REFLECTED) & (kinds[0] == HIDDEN), 1, 2)
    )
    i, k = _turned(face, turn), _turned(kinds, turn)
    pair = k[1] == REFLECTED
    shine = triangles.shine
    carried = [triangles.attributes]
    if shine is not None:
        carried += [triangles.points, shine.normals, shine.visibility]
    one, one_offset = _cut(triangles.points, carried, i[0], dr.select(pair, i[2], i[1]), hider, view, mixed)
    two, two_offset = _cut(triangles.points, carried, dr.select(pair, i[1], i[0]), i[2], hider, view, mixed)
    first = mi.Vector4u(i[0], dr.select(pair, i[1], vertex_count + f), vertex_count + count + f, face.w)
    second = mi.Vector4u(i[0], vertex_count + count + f, vertex_count + f, face.w)
    slots = [_packed(value, f, count) for value in (dr.select(mixed, first, face), second)]
    ends = [[_packed(value, f, count) for value in end] for end in (one, two)]
    on_mirror = [depths.nearness(view, offset) for offset in (one_offset, two_offset)] if drawing.behind else []
    extra = mixed & pair
    dr.eval(slots, ends, on_mirror, shown, extra)  # one kernel, before the parts are put together
    all_ = [images.moved, *carried]
    packets, *carried = (dr.concat([mine, *others]) for mine, *others in zip(all_, *ends, strict=True))
    faces, drawn = dr.concat(slots), dr.concat([shown, extra])
    if drawing.behind:
        inverse = dr.concat([inverse, *on_mirror])
    points = triangles.points
    if shine is not None:
        points, shine = carried[1], replace(shine, normals=carried[2], visibility=carried[3])
    lit = geometry.Geometry(points, carried[0], faces, vertex_count + 2 * count, 2 * count, shine)
    bands = None
    if images.sure is not None:
        cut = (mixed, pair, turn, _pixel(view, one[0]), _pixel(view, two[0]))
        bands = _bands(images, view, f, count, face, kinds, shown, cut)
    return packets, lit, drawn, limit, inverse, bands


def _bands(images: Images, view, f, count: int, face, kinds: list, shown, cut) -> bent.Bands:
    """Of the edges between reflected corners; and of those that are cut: whether, whether two corners are reflected, which
    comes first, and where the two edges end."""
    index = (face.x, face.y, face.z)
    pixels = [_pixel(view, dr.gather(mi.Vector4f, images.at, i)) for i in index]
    ends = [bent.reflected(view, images.at, images.sure, i, x) for i, x in zip(index, pixels, strict=True)]
    is_reflected = [k == REFLECTED for k in kinds]
    unsure = mi.Bool(False)
    for i, there in zip(index, is_reflected, strict=True):
        unsure |= there & (dr.gather(mi.Float, images.sure, 4 * i + 3) > 0)
    edges = []
    for j, k in ((0, 1), (1, 2), (2, 0)):
        both = is_reflected[j] & is_reflected[k]
        edges.append([pixels[j], pixels[k], dr.select(both, bent.sagitta(ends[j], ends[k]), 0)])
    if cut is None:
        return bent.bands(view, f, count, edges, shown, unsure)
    mixed, pair, turn, one, two = cut
    first, second, _ = _turned(ends, turn)
    whole = _turned(edges, turn)
    other = dr.select(pair, second, first)
    to_one, to_two = bent.sagitta_to_outline(first, one), bent.sagitta_to_outline(other, two)
    edges = [
        whole[0],
        [dr.select(mixed, first.x, whole[1][0]), dr.select(mixed, one, whole[1][1]), dr.select(mixed, to_one, whole[1][2])],
        [dr.select(mixed, other.x, whole[2][0]), dr.select(mixed, two, whole[2][1]), dr.select(mixed, to_two, whole[2][2])],
    ]
    return bent.bands(view, f, count, edges, shown, unsure)


def _packed(value, lane: mi.UInt32, count: int):
    """4 numbers per lane, side by side."""
    out = dr.empty(dr.value_t(type(value)), 4 * count)
    dr.scatter(out, value, lane)
    return out


def _turned(values, turn: mi.UInt32 | mi.Int32) -> list:
    """The first three of `values`, rotated so that number `turn` comes first."""
    return [dr.select(turn == 0, values[k], dr.select(turn == 1, values[(k + 1) % 3], values[(k + 2) % 3])) for k in range(3)]


@dr.syntax
def _cut(points, carried: list, inner, outer, hider, view, active):
    """Where the edge inner -> outer enters the hidden region, just behind the border: packets of position and of `carried`,
    and the depth of the mirror there, from `view.depth`."""
    a, b = dr.gather(mi.Vector4f, points, inner, active), dr.gather(mi.Vector4f, points, outer, active)
    low, high = mi.Float(0), mi.Float(1)
    step, met, surface_offset = mi.UInt32(0), mi.Bool(False), mi.Float(0)
    length = dr.norm(_pixel(view, a) - _pixel(view, b))
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
    x = dr.lerp(a, b, high)
    there = [dr.lerp(*(dr.gather(mi.Vector4f, packets, i, active) for i in (inner, outer)), high) for packets in carried]
    return [mi.Vector4f(x.x, x.y, x.z, HIDDEN), *there], surface_offset


def _pixel(view, p: mi.Vector4f) -> mi.Point2f:
    """Where a point in front of the eye is seen."""
    q = mi.Vector4f(p.x, p.y, p.z, 1)
    scale = dr.rcp(dr.maximum(dr.dot(view.w, q), view.near))
    return mi.Point2f(dr.dot(view.x, q) * scale, dr.dot(view.y, q) * scale)


def _turned_to_mirror(points, at, face, kinds) -> mi.Bool:
    """Whether a triangle shows its front to the reflection point of any of its reflected vertices, or has no back."""
    index = (face.x, face.y, face.z)
    V = [dr.gather(mi.Vector4f, points, i).xyz for i in index]
    normal = dr.cross(V[1] - V[0], V[2] - V[0])
    fronts = (face.w & raster.CLOSED) == 0
    for v, i, kind in zip(V, index, kinds, strict=True):
        fronts |= (kind == REFLECTED) & (dr.dot(dr.gather(mi.Vector4f, at, i).xyz - v, normal) > 0)
    return fronts
