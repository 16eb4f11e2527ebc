"""Cube maps: capture by rasterization, lookup without seams, mip levels.

Faces: 2 * axis + (1 if negative), axis 0, 1, 2 = x, y, z. On a face, u and v in [-1, 1] are the two other coordinates in
cyclic order (axis + 1, axis + 2), divided by the size of the coordinate along the axis. Texel (row i, column j) of a face
with n x n texels has its centre at u = (2 j + 1) / n - 1, v = (2 i + 1) / n - 1.

Every face is stored with a border of one texel that is captured with the face, through a window slightly wider than
90 degrees. So bilinear lookup never has to look across an edge, and the two faces at an edge agree up to the square of
the texel's size. 4 floats per texel: radiance and 1 / distance (0 for the surroundings), which can be averaged.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi

from benchharness.kernels import depths, geometry, packets, raster, shown, surroundings
from benchharness.kernels.types import View


def _unit(axis: int) -> mi.Vector3f:
    """The unit vector along an axis."""
    return mi.Vector3f(*(1.0 if k == axis else 0.0 for k in range(3)))


def _view(face: int, n: int, centre: mi.Point3f, near: mi.Float) -> View:
    """The camera of a face and its border, n + 2 pixels across."""
    axis, sign = face // 2, 1 - 2 * (face % 2)
    forward, u, v = sign * _unit(axis), _unit((axis + 1) % 3), _unit((axis + 2) % 3)
    focal, middle = 0.5 * n, 0.5 * n + 1

    def row(direction: mi.Vector3f) -> mi.Vector4f:
        return mi.Vector4f(direction.x, direction.y, direction.z, -dr.dot(direction, centre))

    return View(
        eye=centre,
        x=row(focal * u + middle * forward),
        y=row(focal * v + middle * forward),
        w=row(forward),
        right=u / focal,
        down=v / focal,
        axis=forward - (middle / focal) * (u + v),
        depth=mi.Float(0),
        origin=centre,
        near=near,
        width=n + 2,
        height=n + 2,
    )


def capture(
    triangles: geometry.Geometry,
    drawn: mi.Bool,
    centre: mi.Point3f,
    n: int,
    near: mi.Float,
    around: surroundings.Surroundings,
    beyond: mi.Float | None = None,
    behind: mi.Float | None = None,
) -> mi.Float:
    """The scene around `centre`, and as seen from there: 4 floats per texel, [6, n + 2, n + 2].

    triangles  in world space
    drawn      Bool [face_count]
    near       metres; what is nearer to the centre along the axis of a face is not drawn
    around     what is seen where nothing else is
    beyond     metres; what is nearer to the centre than this is not drawn, even if it is a part of a triangle; None: all is
    behind     1 / depth along the axis of each face, [6, n + 2, n + 2]; what is nearer than that is not drawn; None: all is
    """
    count = (n + 2) * (n + 2)
    texels = dr.empty(mi.Float, 4 * 6 * count)
    lane = dr.arange(mi.UInt32, count)
    for face in range(6):
        view = _view(face, n, centre, near)
        limit = None
        if beyond is not None:
            limit = depths.nearness(view, beyond * dr.rcp(dr.norm(raster.ray_through(view, lane))))
        if behind is not None:
            limit = dr.gather(mi.Float, behind, lane + face * count)
        visibility = raster.rasterize(triangles.points, triangles.faces, triangles.face_count, view, limit=limit, drawn=drawn)
        seen = shown.at(triangles, visibility, around, view, lane)
        L, inverse = seen.value, dr.select(seen.hit, dr.rcp(dr.norm(seen.p - centre)), 0)
        dr.scatter(texels, mi.Vector4f(L.x, L.y, L.z, inverse), lane + face * count)
    return texels


def named(
    triangles: geometry.Geometry, drawn: mi.Bool, centre: mi.Point3f, n: int, near: mi.Float
) -> tuple[mi.UInt32, mi.Float]:
    """Which triangle is seen around `centre`, `raster.NONE` for none, and 1 / its depth along the axis of the face, 0 for none:
    a number per texel each, [6, n + 2, n + 2]. Arguments as `capture` has them."""
    count = (n + 2) * (n + 2)
    names, nearness = dr.empty(mi.UInt32, 6 * count), dr.empty(mi.Float, 6 * count)
    lane = dr.arange(mi.UInt32, count)
    for face in range(6):
        view = _view(face, n, centre, near)
        visibility = raster.rasterize(triangles.points, triangles.faces, triangles.face_count, view, drawn=drawn)
        triangle = raster.winner_at(visibility, view, lane, True)
        hit = triangle != raster.NONE
        _, _, p = raster.met(triangles.points, triangles.faces, dr.select(hit, triangle, 0), view, lane)
        depth = dr.dot(view.w, mi.Vector4f(p.x, p.y, p.z, 1))
        dr.scatter(names, triangle, lane + face * count)
        dr.scatter(nearness, dr.select(hit, dr.rcp(depth), 0), lane + face * count)
    return names, nearness


def direction(face: mi.UInt32, u: mi.Float, v: mi.Float) -> mi.Vector3f:
    """The direction of a point on a face, unnormalised."""
    axis = face >> 1
    forward = dr.select((face & 1) == 0, mi.Float(1), mi.Float(-1))
    return mi.Vector3f(*(dr.select(axis == k, forward, dr.select((axis + 1) % 3 == k, u, v)) for k in range(3)))


def face_of(d: mi.Vector3f) -> tuple[mi.UInt32, mi.Float, mi.Float]:
    """The face that a direction leaves through, and u, v there. d need not be normalised and must not be zero."""
    ax, ay, az = dr.abs(d.x), dr.abs(d.y), dr.abs(d.z)
    on_x = (ax >= ay) & (ax >= az)
    on_y = ~on_x & (ay >= az)
    forward = dr.select(on_x, d.x, dr.select(on_y, d.y, d.z))
    u = dr.select(on_x, d.y, dr.select(on_y, d.z, d.x))
    v = dr.select(on_x, d.z, dr.select(on_y, d.x, d.y))
    axis = dr.select(on_x, mi.UInt32(0), dr.select(on_y, mi.UInt32(1), mi.UInt32(2)))
    scale = dr.rcp(dr.abs(forward))
    return 2 * axis + dr.select(forward < 0, mi.UInt32(1), mi.UInt32(0)), u * scale, v * scale


def lookup(texels: mi.Float, n: int, d: mi.Vector3f, active: mi.Bool | bool = True, first: mi.UInt32 | int = 0) -> mi.Vector4f:
    """The bilinear value in direction d, of a map with n x n texels per face and a border that starts at texel `first`."""
    return _bilinear(texels, *face_of(d), mi.UInt32(n), mi.UInt32(first), active)


def coarser(texels: mi.Float, n: int) -> mi.Float:
    """The next mip level, n / 2 texels per face: each texel, border included, is the mean of four lookups a quarter texel
    around its centre. n is even."""
    half = n // 2
    count = (half + 2) * (half + 2)
    lane = dr.arange(mi.UInt32, 6 * count)
    face = lane // count
    row = (lane - face * count) // (half + 2)
    column = lane - face * count - row * (half + 2)
    total = mi.Vector4f(0)
    for dy in (-0.25, 0.25):
        for dx in (-0.25, 0.25):
            u = (mi.Float(column) - 0.5 + dx) * (2.0 / half) - 1
            v = (mi.Float(row) - 0.5 + dy) * (2.0 / half) - 1
            total += lookup(texels, n, direction(face, u, v))
    return packets.stored(total * 0.25, 6 * count)


def levels_of(n: int) -> list[int]:
    """Sizes of the mip levels, n first, down to 4 texels per face."""
    sizes = [n]
    while sizes[-1] % 2 == 0 and sizes[-1] > 4:
        sizes.append(sizes[-1] // 2)
    return sizes


@dataclass
class Pyramid:
    """Mip levels of one map, one after the other.

    starts  first texel of each level
    n       texels per edge of a face of the finest
    count   how many levels there are
    first   where the map begins, among others of its size in the same buffer, in texels
    """

    texels: mi.Float
    starts: mi.UInt32
    n: int
    count: int
    first: mi.UInt32 | int = 0


def pyramid(levels: list[mi.Float], n: int) -> Pyramid:
    """Levels as one, the finest first, which has n texels per edge of a face."""
    starts, texels = [0], 0
    for level in levels[:-1]:
        texels += dr.width(level) // 4
        starts.append(texels)
    return Pyramid(dr.concat(levels), mi.UInt32(starts), n, len(levels))


def texels_of(n: int) -> int:
    """Of a map's level with n texels per edge of a face, borders included."""
    return 6 * (n + 2) * (n + 2)


def together(maps: Sequence[Pyramid]) -> Pyramid:
    """Several maps of one size in one buffer; `first` is left to who asks."""
    return replace(maps[0], texels=dr.concat([one.texels for one in maps]))


def lookup_mip(maps: Pyramid, d: mi.Vector3f, level: mi.Float, active: mi.Bool | bool = True) -> mi.Vector4f:
    """The trilinear value: bilinear on the two levels around `level`, of which 0 is the finest."""
    n, level = maps.n, dr.clip(level, 0, maps.count - 1)
    lower = mi.UInt32(level)
    upper = dr.minimum(lower + 1, maps.count - 1)
    face, u, v = face_of(d)
    first = [dr.gather(mi.UInt32, maps.starts, k, active) + maps.first for k in (lower, upper)]
    one = _bilinear(maps.texels, face, u, v, mi.UInt32(n) >> lower, first[0], active)
    two = _bilinear(maps.texels, face, u, v, mi.UInt32(n) >> upper, first[1], active)
    return dr.lerp(one, two, level - mi.Float(lower))


def texel(maps: Pyramid, d: mi.Vector3f, level: mi.Float, active: mi.Bool | bool = True) -> mi.Vector4f:
    """The texel in direction d on the nearest level, as wide as what it stands for: one read."""
    nearest = mi.UInt32(dr.clip(level + 0.5, 0, maps.count - 1))
    size = mi.UInt32(maps.n) >> nearest
    face, u, v = face_of(d)
    column, row = (dr.clip(mi.UInt32((c + 1) * (0.5 * mi.Float(size))), 0, size - 1) for c in (u, v))
    first = dr.gather(mi.UInt32, maps.starts, nearest, active) + maps.first
    return dr.gather(mi.Vector4f, maps.texels, first + (face * (size + 2) + row + 1) * (size + 2) + column + 1, active)


def _bilinear(
    texels: mi.Float,
    face: mi.UInt32,
    u: mi.Float,
    v: mi.Float,
    n: mi.UInt32,
    first: mi.UInt32,
    active: mi.Bool | bool,
) -> mi.Vector4f:
    """The value at u, v of a face of the level that begins at texel `first`, n texels per edge."""
    x, y = (u + 1) * (0.5 * mi.Float(n)) + 0.5, (v + 1) * (0.5 * mi.Float(n)) + 0.5
    column, row = dr.clip(mi.Int32(x), 0, mi.Int32(n)), dr.clip(mi.Int32(y), 0, mi.Int32(n))
    fx, fy = x - mi.Float(column), y - mi.Float(row)
    base = first + (face * (n + 2) + mi.UInt32(row)) * (n + 2) + mi.UInt32(column)
    return packets.bilinear(texels, (base, base + 1, base + n + 2, base + n + 3), fx, fy, active)
