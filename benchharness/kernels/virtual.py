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

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels import geometry, raster, search
from benchharness.kernels.frozen import frozen

NONE, REFLECTED, HIDDEN = 0, 1, 2
HALVINGS = 10  # of an edge, to find where it enters the hidden region: a thousandth of its length
CONTACT = 1e-3  # share of the mirror's depth by which an image may lie in front of it: what touches a mirror is at its depth


@dataclass
class Images:
    """One mirror's virtual vertices, packets of 4 floats each.

    moved  virtual position (what the rasterizer sorts by), kind
    at     reflection point, free
    """

    moved: mi.Float
    at: mi.Float


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
    depth = dr.rcp(dr.maximum(1 - d_V / d_max, 1e-4))
    direction = (R - view.eye) * dr.rcp(dr.dot(view.w, mi.Vector4f(R.x, R.y, R.z, 1)))
    return mi.Point3f(view.eye + depth * direction)


def draw(
    images: Images, points, triangles: geometry.Geometry, part, view, p: mi.Point3f, reflector, layer, mirror,
    drawing: Drawing, back,
):  # fmt: skip
    """What one mirror shows: radiance, length of the reflected ray, coverage, one lane per pixel; 0 where it is not seen.

    points            the scene's own vertices in world space
    part              number of the mirror's part, which does not show itself
    p                 the mirror's point at each pixel
    reflector, layer  number of the mirror at each pixel; this mirror's
    mirror            (texels, view) of `kernels.search`: what hides a point; None if nothing is cut
    back              1 / depth of the mirror's nearest back at each pixel, 0 for none (`nearest_back`); None if not asked for
    """
    packets, radiance, faces, drawn, limit, inverse = _assembled(
        images, points, triangles, part, view, p, reflector, layer, mirror, drawing
    )
    least = None if inverse is None else (inverse, back)
    slots = 2 if drawing.hidden == "cut" else 1
    visibility = raster.rasterize(packets, faces, slots * triangles.face_count, view, limit=limit, least=least, drawn=drawn)
    if drawing.depth == "screen_linear":
        return _shown_from_mirror(images.at, points, radiance, faces, visibility, view, p, reflector, layer)
    return _shown(packets, radiance, faces, visibility, view, p, reflector, layer)


def nearest_back(surface, poses: mi.Float, part: mi.UInt32, view) -> mi.Float:
    """1 / depth of the nearest triangle of a mirror that turns its back to the eye, one lane per pixel; 0 for none.

    surface   a `benchharness.api.Surface`, part number `part`
    """
    points, _ = search.posed(surface, poses, part)
    visibility = raster.rasterize(points, surface.faces, surface.face_count, view, cull="front")
    return _inverse_depth(points, surface.faces, visibility, view)


@frozen
@dr.syntax
def _inverse_depth(points, faces, visibility, view):
    pixel = dr.arange(mi.UInt32, view.width * view.height)
    triangle = raster.winner_at(visibility, view, pixel, mi.Bool(True))
    value = mi.Float(0)
    if triangle != raster.NONE:
        q = raster.met(points, faces, triangle, view, pixel)[2]
        value = dr.rcp(dr.dot(view.w, mi.Vector4f(q.x, q.y, q.z, 1)))
    return value


@frozen
@dr.syntax
def _shown_from_mirror(at, points, radiance, faces, visibility, view, p: mi.Point3f, reflector, layer):
    """`_shown` with triangles that span reflection points: what they carry is interpolated as seen there."""
    pixel = dr.arange(mi.UInt32, view.width * view.height)
    own = reflector == layer
    triangle = raster.winner_at(visibility, view, pixel, own)
    hit = own & (triangle != raster.NONE)
    L, distance = mi.Color3f(0), mi.Float(0)
    if hit:
        face, weights, _ = raster.met(at, faces, triangle, view, pixel)
        value = raster.interpolate(radiance, face, weights, mi.Bool(True))
        L = mi.Color3f(value.x, value.y, value.z)
        V = raster.interpolate(points, face, weights, mi.Bool(True)).xyz
        distance = dr.norm(V - p)
    return L, distance, hit


@frozen
@dr.syntax
def _shown(packets, radiance, faces, visibility, view, p: mi.Point3f, reflector, layer):
    pixel = dr.arange(mi.UInt32, view.width * view.height)
    own = reflector == layer
    triangle = raster.winner_at(visibility, view, pixel, own)
    hit = own & (triangle != raster.NONE)
    L, distance = mi.Color3f(0), mi.Float(0)
    if hit:
        face, weights, q = raster.met(packets, faces, triangle, view, pixel)
        value = raster.interpolate(radiance, face, weights, mi.Bool(True))
        L = mi.Color3f(value.x, value.y, value.z)
        distance = dr.maximum(dr.norm(q - view.eye) - dr.norm(p - view.eye), 0)
    return L, distance, hit


@frozen
def _assembled(
    images: Images, points, triangles: geometry.Geometry, part, view, p, reflector, layer, mirror, drawing: Drawing
):  # fmt: skip
    """Vertices, their radiance, triangles, which of them to draw, how near a pixel lets them come, and, where what is behind
    is left out, 1 / depth of the vertices' reflection points.

    With "cut", two slots per triangle: one may become two. The vertices of the scene come first, then two per triangle f,
    number f and f + face_count of the rest: where it was cut.
    """
    vertex_count, count = triangles.vertex_count, triangles.face_count
    f = dr.arange(mi.UInt32, count)
    face, corner = raster.corners(images.moved, triangles.faces, f, mi.Bool(True))
    kinds = [mi.UInt32(q.w) for q in corner]
    shown = (geometry.part_of(face) != part) & (kinds[0] != NONE) & (kinds[1] != NONE) & (kinds[2] != NONE)
    shown &= (kinds[0] == REFLECTED) | (kinds[1] == REFLECTED) | (kinds[2] == REFLECTED)
    shown &= _turned_to_mirror(points, images.at, face, kinds)
    whole = (kinds[0] == REFLECTED) & (kinds[1] == REFLECTED) & (kinds[2] == REFLECTED)
    # A triangle that reaches behind the eye has no image.
    near = [(q.w != REFLECTED) | (dr.dot(view.w, mi.Vector4f(q.x, q.y, q.z, 1)) > view.near) for q in corner]
    shown &= near[0] & near[1] & near[2]
    if drawing.hidden == "drop":
        shown &= whole
    packets, radiance, faces, drawn = images.moved, triangles.attributes, triangles.faces, shown
    inverse = None
    if drawing.behind:
        R = dr.gather(mi.Vector4f, images.at, dr.arange(mi.UInt32, vertex_count))
        inverse = dr.rcp(dr.maximum(dr.dot(view.w, mi.Vector4f(R.x, R.y, R.z, 1)), 1e-12))
    if drawing.hidden == "cut":
        # Turn the triangle so that its first vertex is reflected and its last is hidden. A reflected pair keeps a
        # quadrilateral, i0 i1 two one; a single vertex a triangle, i0 one two.
        mixed = shown & ~whole
        turn = dr.select(
            (kinds[0] == REFLECTED) & (kinds[2] == HIDDEN), 0, dr.select((kinds[1] == REFLECTED) & (kinds[0] == HIDDEN), 1, 2)
        )
        i, k = _turned(face, turn), _turned(kinds, turn)
        pair = k[1] == REFLECTED
        one = _cut(points, triangles, i[0], dr.select(pair, i[2], i[1]), mirror, mixed)
        two = _cut(points, triangles, dr.select(pair, i[1], i[0]), i[2], mirror, mixed)
        first = mi.Vector4u(i[0], dr.select(pair, i[1], vertex_count + f), vertex_count + count + f, face.w)
        second = mi.Vector4u(i[0], vertex_count + count + f, vertex_count + f, face.w)
        parts = [_packed(value, f, count) for value in (*one[:2], *two[:2], dr.select(mixed, first, face), second)]
        extra = mixed & pair
        on_mirror = [one[2], two[2]] if drawing.behind else []
        dr.eval(parts, on_mirror, shown, extra)  # one kernel, before the parts are put together
        if drawing.behind:
            inverse = dr.concat([inverse, *on_mirror])
        packets = dr.concat([packets, parts[0], parts[2]])
        radiance = dr.concat([radiance, parts[1], parts[3]])
        faces, drawn = dr.concat([parts[4], parts[5]]), dr.concat([shown, extra])
    nearest = dr.rcp(dr.dot(view.w, mi.Vector4f(p.x, p.y, p.z, 1)) * (1 - CONTACT))
    if drawing.depth == "screen_linear":
        nearest = mi.Float(dr.inf)
    return packets, radiance, faces, drawn, dr.select(reflector == layer, nearest, 0), inverse


def _packed(value, lane: mi.UInt32, count: int):
    """4 numbers per lane, side by side."""
    out = dr.empty(dr.value_t(type(value)), 4 * count)
    dr.scatter(out, value, lane)
    return out


def _turned(values, turn: mi.UInt32 | mi.Int32) -> list:
    """The first three of `values`, rotated so that number `turn` comes first."""
    return [dr.select(turn == 0, values[k], dr.select(turn == 1, values[(k + 1) % 3], values[(k + 2) % 3])) for k in range(3)]


@dr.syntax
def _cut(points, triangles, inner, outer, mirror, active):
    """Where the edge inner -> outer enters the hidden region, just behind the border: packets of position and radiance, and
    1 / depth of the mirror there."""
    texels, view = mirror
    a, b = dr.gather(mi.Vector4f, points, inner, active), dr.gather(mi.Vector4f, points, outer, active)
    low, high = mi.Float(0), mi.Float(1)
    step, met = mi.UInt32(0), mi.Float(0)
    while dr.hint(active & (step < HALVINGS), label="find where an edge enters the hidden region"):
        middle = 0.5 * (low + high)
        x = dr.lerp(a, b, middle)
        column, row, seen = search.texel_of(view, mi.Point3f(x.x, x.y, x.z))
        surface = dr.gather(mi.Vector4f, texels, mi.UInt32(row * view.width + column), seen).x
        behind = seen & (surface > 0) & (dr.dot(view.w, mi.Vector4f(x.x, x.y, x.z, 1)) > surface)
        low, high = dr.select(behind, low, middle), dr.select(behind, middle, high)
        met = dr.select(behind, surface, met)
        step += 1
    x = dr.lerp(a, b, high)
    light = [dr.gather(mi.Vector4f, triangles.attributes, i, active) for i in (inner, outer)]
    depth = dr.select(met > 0, met, dr.dot(view.w, mi.Vector4f(x.x, x.y, x.z, 1)))
    return mi.Vector4f(x.x, x.y, x.z, HIDDEN), dr.lerp(light[0], light[1], high), dr.rcp(depth)


def _turned_to_mirror(points, at, face, kinds) -> mi.Bool:
    """Whether a triangle shows its front to the reflection point of any of its reflected vertices, or has no back."""
    index = (face.x, face.y, face.z)
    V = [dr.gather(mi.Vector4f, points, i).xyz for i in index]
    normal = dr.cross(V[1] - V[0], V[2] - V[0])
    fronts = (face.w & raster.CLOSED) == 0
    for v, i, kind in zip(V, index, kinds, strict=True):
        fronts |= (kind == REFLECTED) & (dr.dot(dr.gather(mi.Vector4f, at, i).xyz - v, normal) > 0)
    return fronts
