"""Drawing the virtual scene: triangles whose vertices were moved to where a mirror shows them.

A virtual vertex is a point in space behind its mirror, so the ordinary rasterizer draws virtual triangles, nearest first,
at the mirror's own pixels and behind its surface. What needs care is triangles that reach into the hidden region, which
no reflection shows (kind HIDDEN). With `cut`, they end where their edges enter that region. There, on the mirror's outline
or where an object goes into the mirror, the image meets what it is the image of: the virtual vertex is the point of the
edge itself. Without, their hidden vertices are drawn wherever the caller put them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

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

    moved  virtual position, kind
    at     reflection point, free
    """

    moved: mi.Float
    at: mi.Float


def draw(images: Images, points, triangles: geometry.Geometry, part, view, p: mi.Point3f, reflector, layer, mirror, cut: bool):
    """What one mirror shows: radiance, length of the reflected ray, coverage, one lane per pixel; 0 where it is not seen.

    points            the scene's own vertices in world space
    triangles         their triangles; from `geometry.placed`, so that highlights are those that each pixel's `p` sees
    part              number of the mirror's part, which does not show itself
    p                 the mirror's point at each pixel
    reflector, layer  number of the mirror at each pixel; this mirror's
    mirror            (texels, view) of `kernels.search`: what hides a point
    """
    packets, shown, drawn, limit = _assembled(images, points, triangles, part, view, p, reflector, layer, mirror, cut)
    visibility = raster.rasterize(packets, shown.faces, shown.face_count, view, limit=limit, drawn=drawn)
    return _shown(packets, shown, visibility, view, p, reflector, layer)


@frozen
@dr.syntax
def _shown(packets, triangles: geometry.Geometry, visibility, view, p: mi.Point3f, reflector, layer):
    pixel = dr.arange(mi.UInt32, view.width * view.height)
    own = reflector == layer
    triangle = raster.winner_at(visibility, view, pixel, own)
    hit = own & (triangle != raster.NONE)
    L, distance = mi.Color3f(0), mi.Float(0)
    if hit:
        face, weights, q = raster.met(packets, triangles.faces, triangle, view, pixel)
        L = geometry.radiance(triangles, face, weights, p, mi.Bool(True))
        distance = dr.maximum(dr.norm(q - view.eye) - dr.norm(p - view.eye), 0)
    return L, distance, hit


@frozen
def _assembled(images: Images, points, triangles: geometry.Geometry, part, view, p, reflector, layer, mirror, cut: bool):
    """Virtual vertices, the triangles with what they are images of, which to draw, and how near a pixel lets them come.

    Two slots per triangle: a cut one may become two. The vertices of the scene come first, then two per triangle f, number
    f and f + face_count of the rest: where it was cut.
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
    shine = triangles.shine
    carried = [triangles.attributes] if shine is None else [triangles.attributes, points, shine.normals, shine.visibility]
    if cut:
        # Turn the triangle so that its first vertex is reflected and its last is hidden. A reflected pair keeps a
        # quadrilateral, i0 i1 two one; a single vertex a triangle, i0 one two.
        mixed = shown & ~whole
        turn = dr.select(
            (kinds[0] == REFLECTED) & (kinds[2] == HIDDEN), 0, dr.select((kinds[1] == REFLECTED) & (kinds[0] == HIDDEN), 1, 2)
        )
        i, k = _turned(face, turn), _turned(kinds, turn)
        pair = k[1] == REFLECTED
        one = _cut(points, carried, i[0], dr.select(pair, i[2], i[1]), mirror, mixed)
        two = _cut(points, carried, dr.select(pair, i[1], i[0]), i[2], mirror, mixed)
        first = mi.Vector4u(i[0], dr.select(pair, i[1], vertex_count + f), vertex_count + count + f, face.w)
        second = mi.Vector4u(i[0], vertex_count + count + f, vertex_count + f, face.w)
        slots = [_packed(value, f, count) for value in (dr.select(mixed, first, face), second)]
        ends = [[_packed(value, f, count) for value in end] for end in (one, two)]
        extra = mixed & pair
        dr.eval(slots, ends, shown, extra)  # one kernel, before the parts are put together
        whole = [images.moved, *carried]
        packets, *carried = (dr.concat([mine, *others]) for mine, *others in zip(whole, *ends, strict=True))
        faces, drawn = dr.concat(slots), dr.concat([shown, extra])
    else:
        packets = images.moved
        faces = dr.concat([triangles.faces, triangles.faces])
        drawn = dr.concat([shown, dr.zeros(mi.Bool, count)])
    depth = dr.dot(view.w, mi.Vector4f(p.x, p.y, p.z, 1))
    if shine is not None:
        points, shine = carried[1], replace(shine, normals=carried[2], visibility=carried[3])
    lit = geometry.Geometry(points, carried[0], faces, dr.width(packets) // 4, 2 * count, shine)
    return packets, lit, drawn, dr.select(reflector == layer, dr.rcp(depth * (1 - CONTACT)), 0)


def _packed(value, lane: mi.UInt32, count: int):
    """4 numbers per lane, side by side."""
    out = dr.empty(dr.value_t(type(value)), 4 * count)
    dr.scatter(out, value, lane)
    return out


def _turned(values, turn: mi.UInt32 | mi.Int32) -> list:
    """The first three of `values`, rotated so that number `turn` comes first."""
    return [dr.select(turn == 0, values[k], dr.select(turn == 1, values[(k + 1) % 3], values[(k + 2) % 3])) for k in range(3)]


@dr.syntax
def _cut(points, carried: list, inner, outer, mirror, active):
    """Where the edge inner -> outer enters the hidden region, just behind the border: packets of position and of `carried`."""
    texels, view = mirror
    a, b = dr.gather(mi.Vector4f, points, inner, active), dr.gather(mi.Vector4f, points, outer, active)
    low, high = mi.Float(0), mi.Float(1)
    step = mi.UInt32(0)
    while dr.hint(active & (step < HALVINGS), label="find where an edge enters the hidden region"):
        middle = 0.5 * (low + high)
        x = dr.lerp(a, b, middle)
        column, row, seen = search.texel_of(view, mi.Point3f(x.x, x.y, x.z))
        surface = dr.gather(mi.Vector4f, texels, mi.UInt32(row * view.width + column), seen).x
        behind = seen & (surface > 0) & (dr.dot(view.w, mi.Vector4f(x.x, x.y, x.z, 1)) > surface)
        low, high = dr.select(behind, low, middle), dr.select(behind, middle, high)
        step += 1
    x = dr.lerp(a, b, high)
    there = [dr.lerp(*(dr.gather(mi.Vector4f, packets, i, active) for i in (inner, outer)), high) for packets in carried]
    return [mi.Vector4f(x.x, x.y, x.z, HIDDEN), *there]


def _turned_to_mirror(points, at, face, kinds) -> mi.Bool:
    """Whether a triangle shows its front to the reflection point of any of its reflected vertices, or has no back."""
    index = (face.x, face.y, face.z)
    V = [dr.gather(mi.Vector4f, points, i).xyz for i in index]
    normal = dr.cross(V[1] - V[0], V[2] - V[0])
    fronts = (face.w & raster.CLOSED) == 0
    for v, i, kind in zip(V, index, kinds, strict=True):
        fronts |= (kind == REFLECTED) & (dr.dot(dr.gather(mi.Vector4f, at, i).xyz - v, normal) > 0)
    return fronts
