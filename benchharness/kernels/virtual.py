"""Drawing the virtual scene: triangles whose vertices were moved to where a mirror shows them.

A virtual vertex is a point in space behind its mirror, so the ordinary rasterizer draws virtual triangles, nearest first,
at the mirror's own pixels and behind its surface. What needs care is triangles that reach into the hidden region, which
no reflection shows (kind HIDDEN). With `cut`, they end where their edges enter that region. There, on the mirror's outline
or where an object goes into the mirror, the image meets what it is the image of: the virtual vertex is the point of the
edge itself. Without, their hidden vertices are drawn wherever the caller put them.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels import geometry, raster, search

NONE, REFLECTED, HIDDEN = 0, 1, 2
HALVINGS = 10  # of an edge, to find where it enters the hidden region: a thousandth of its length
CONTACT = 1e-3  # share of the mirror's depth by which an image may lie in front of it: what touches a mirror is at its depth


@dataclass
class Images:
    """One mirror's virtual vertices, packets of 4 floats each.

    moved  virtual position, kind
    at     reflection point, free
    """

    moved: mi.Float
    at: mi.Float


def draw(images: Images, points, triangles: geometry.Geometry, part, view, p: mi.Point3f, own: mi.Bool, mirror, cut: bool):
    """What one mirror shows: radiance, length of the reflected ray, coverage, one lane per pixel.

    points  the scene's own vertices in world space; part: number of the mirror's part, which does not show itself
    p, own  the mirror's point at each pixel, and whether the pixel is this mirror's
    mirror  (texels, view) of `kernels.search`: what hides a point
    """
    packets, radiance, faces, drawn, limit = _assembled(images, points, triangles, part, view, p, own, mirror, cut)
    visibility = raster.rasterize(packets, faces, 2 * triangles.face_count, view, limit=limit, drawn=drawn)
    return _shown(packets, radiance, faces, visibility, view, p, own)


@dr.freeze
@dr.syntax
def _shown(packets, radiance, faces, visibility, view, p: mi.Point3f, own: mi.Bool):
    pixel = dr.arange(mi.UInt32, view.width * view.height)
    triangle = raster.winner_at(visibility, view, pixel, own)
    hit = own & (triangle != raster.NONE)
    L, distance = mi.Color3f(0), mi.Float(0)
    if hit:
        face, weights, q = raster.met(packets, faces, triangle, view, pixel)
        value = raster.interpolate(radiance, face, weights, mi.Bool(True))
        L = mi.Color3f(value.x, value.y, value.z)
        distance = dr.maximum(dr.norm(q - view.eye) - dr.norm(p - view.eye), 0)
    return L, distance, hit


@dr.freeze
def _assembled(images: Images, points, triangles: geometry.Geometry, part, view, p, own, mirror, cut: bool):
    """Vertices, their radiance, triangles, which of them to draw, and how near a pixel lets them come.

    Two slots per triangle: a cut one may become two.

    The vertices of the scene come first; vertices 2 f and 2 f + 1 after them are where triangle f was cut.
    """
    vertex_count, count = triangles.vertex_count, triangles.face_count
    f = dr.arange(mi.UInt32, count)
    face, corner = raster.corners(images.moved, triangles.faces, f, mi.Bool(True))
    kinds = [mi.UInt32(q.w) for q in corner]
    shown = (geometry.part_of(face) != part) & (kinds[0] != NONE) & (kinds[1] != NONE) & (kinds[2] != NONE)
    shown &= (kinds[0] == REFLECTED) | (kinds[1] == REFLECTED) | (kinds[2] == REFLECTED)
    shown &= _turned_to_mirror(points, images.at, face, kinds)
    packets = dr.empty(mi.Float, 4 * (vertex_count + 2 * count))
    radiance = dr.empty(mi.Float, 4 * (vertex_count + 2 * count))
    faces = dr.empty(mi.UInt32, 4 * 2 * count)
    vertex = dr.arange(mi.UInt32, vertex_count)
    dr.scatter(packets, dr.gather(mi.Vector4f, images.moved, vertex), vertex)
    dr.scatter(radiance, dr.gather(mi.Vector4f, triangles.attributes, vertex), vertex)
    whole = (kinds[0] == REFLECTED) & (kinds[1] == REFLECTED) & (kinds[2] == REFLECTED)
    first, second, extra = face, face, mi.Bool(False)
    if cut:
        # Turn the triangle so that its first vertex is reflected and its last is hidden.
        mixed = shown & ~whole
        turn = dr.select(
            (kinds[0] == REFLECTED) & (kinds[2] == HIDDEN), 0, dr.select((kinds[1] == REFLECTED) & (kinds[0] == HIDDEN), 1, 2)
        )
        i, k = _turned(face, turn), _turned(kinds, turn)
        pair = k[1] == REFLECTED
        one, two = vertex_count + 2 * f, vertex_count + 2 * f + 1
        _cut(packets, radiance, points, triangles, one, i[0], dr.select(pair, i[2], i[1]), mirror, mixed)
        _cut(packets, radiance, points, triangles, two, dr.select(pair, i[1], i[0]), i[2], mirror, mixed)
        # A reflected pair keeps a quadrilateral, i0 i1 two one; a single vertex a triangle, i0 one two.
        first = dr.select(mixed, mi.Vector4u(i[0], dr.select(pair, i[1], one), two, face.w), face)
        second = mi.Vector4u(i[0], two, one, face.w)
        extra = mixed & pair
    dr.scatter(faces, first, f)
    dr.scatter(faces, second, f + count)

    slot = dr.arange(mi.UInt32, 2 * count)
    one_of = dr.select(slot < count, slot, slot - count)
    drawn = dr.select(slot < count, dr.gather(mi.Bool, shown, one_of), dr.gather(mi.Bool, shown & extra, one_of))
    for q in raster.corners(packets, faces, slot, drawn)[1]:
        drawn &= dr.dot(view.w, mi.Vector4f(q.x, q.y, q.z, 1)) > view.near
    depth = dr.dot(view.w, mi.Vector4f(p.x, p.y, p.z, 1))
    return packets, radiance, faces, drawn, dr.select(own, dr.rcp(depth * (1 - CONTACT)), 0)


def _turned(values, turn: mi.UInt32 | mi.Int32) -> list:
    """The first three of `values`, rotated so that number `turn` comes first."""
    return [dr.select(turn == 0, values[k], dr.select(turn == 1, values[(k + 1) % 3], values[(k + 2) % 3])) for k in range(3)]


@dr.syntax
def _cut(packets, radiance, points, triangles, slot, inner, outer, mirror, active):
    """Writes to `slot` the point of the edge inner -> outer at which it enters the hidden region, just behind the border."""
    texels, view = mirror
    a, b = dr.gather(mi.Vector4f, points, inner, active), dr.gather(mi.Vector4f, points, outer, active)
    low, high = mi.Float(0), mi.Float(1)
    step = mi.UInt32(0)
    while dr.hint(active & (step < HALVINGS), label="find where an edge enters the hidden region"):
        middle = 0.5 * (low + high)
        x = dr.lerp(a, b, middle)
        column, row, seen = search.texel_of(view, mi.Point3f(x.x, x.y, x.z))
        covered, surface, _ = search.fetch(texels, view, column, row, seen)
        behind = covered & (
            dr.dot(view.w, mi.Vector4f(x.x, x.y, x.z, 1)) > dr.dot(view.w, mi.Vector4f(surface.x, surface.y, surface.z, 1))
        )
        low, high = dr.select(behind, low, middle), dr.select(behind, middle, high)
        step += 1
    x = dr.lerp(a, b, high)
    dr.scatter(packets, mi.Vector4f(x.x, x.y, x.z, HIDDEN), slot, active)
    light = [dr.gather(mi.Vector4f, triangles.attributes, i, active) for i in (inner, outer)]
    dr.scatter(radiance, dr.lerp(light[0], light[1], high), slot, active)


def _turned_to_mirror(points, at, face, kinds) -> mi.Bool:
    """Whether a triangle shows its front to the reflection point of any of its reflected vertices, or has no back."""
    index = (face.x, face.y, face.z)
    V = [dr.gather(mi.Vector4f, points, i).xyz for i in index]
    normal = dr.cross(V[1] - V[0], V[2] - V[0])
    fronts = (face.w & raster.CLOSED) == 0
    for v, i, kind in zip(V, index, kinds, strict=True):
        fronts |= (kind == REFLECTED) & (dr.dot(dr.gather(mi.Vector4f, at, i).xyz - v, normal) > 0)
    return fronts
