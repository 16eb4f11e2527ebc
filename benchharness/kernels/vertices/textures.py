"""A reflector as its own camera sees it: a texture of first points and normals, and the window of the picture that it covers.

4 floats per texel, row major: depth along the view axis, from `view.depth` (`kernels.depths`), and unit normal; zeros where
the reflector is not. The point is where the texel's own ray has that depth, so that one packet of 16 bytes holds what Estalella
et al. 2006 keep in two textures.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels import depths, raster
from benchharness.kernels.frozen import frozen
from benchharness.kernels.types import Surface, View

WINDOW_STEP = 64  # pixels
CODE_OFFSET = 1 << 14  # pixels; a texel's place in the picture plus this fits 16 bits


@dataclass
class Texture:
    """A reflector alone as its own camera sees it, not occluded by anything.

    texels  4 floats per texel: depth from `view.depth`, unit normal; zeros where the reflector is not
    view    the camera
    """

    texels: mi.Float
    view: View

    def at(self, column: mi.Int32, row: mi.Int32, active: mi.Bool | bool = True) -> tuple[mi.Bool, mi.Point3f, mi.Normal3f]:
        """Whether a texel is covered, its point and its normal; outside the picture nothing is covered."""
        view = self.view
        inside = (column >= 0) & (row >= 0) & (column < view.width) & (row < view.height) & active
        t = dr.gather(mi.Vector4f, self.texels, mi.UInt32(row * view.width + column), inside)
        p = depths.on_ray(view, mi.Float(column) + 0.5, mi.Float(row) + 0.5, t.x)
        return inside & _covered(t), p, mi.Normal3f(t.y, t.z, t.w)

    def seen_at(self, p: mi.Point3f) -> tuple[mi.Int32, mi.Int32, mi.Bool]:
        """Column and row of the texel that p is seen in, and whether it is in front and in the picture."""
        view, q = self.view, mi.Vector4f(p.x, p.y, p.z, 1.0)
        w = dr.dot(view.w, q)
        scale = dr.rcp(dr.maximum(w, 1e-12))
        x, y = dr.dot(view.x, q) * scale, dr.dot(view.y, q) * scale
        seen = (w > view.near) & (x >= 0) & (y >= 0) & (x < view.width) & (y < view.height)
        return dr.select(seen, mi.Int32(x), 0), dr.select(seen, mi.Int32(y), 0), seen

    def hides(self, x: mi.Point3f, view: View, active: mi.Bool) -> tuple[mi.Bool, mi.Float]:
        """Whether the reflector hides x from the eye, and its depth there, from `view.depth`. `view` is the frame's, not the
        texture's."""
        column, row, seen = self.seen_at(x)
        seen &= active
        t = dr.gather(mi.Vector4f, self.texels, mi.UInt32(row * self.view.width + column), seen)
        return seen & _covered(t) & (depths.offset(view, x) > t.x), t.x


def render(surface: Surface, poses: mi.Float, part: mi.UInt32, view: View) -> Texture:
    """The texture of a reflector, part number `part`, seen by `view`; `poses` as in `types.Frame`."""
    points, normals = posed(surface, poses, part)
    visibility = raster.rasterize(points, surface.faces, surface.face_count, view, cull="back")
    return Texture(_texels(points, normals, surface.faces, visibility, view), view)


@frozen
def posed(surface: Surface, poses: mi.Float, part: mi.UInt32) -> tuple[mi.Float, mi.Float]:
    """Points and normals of a surface in world space, 4 floats per vertex."""
    pose = [dr.gather(mi.Vector4f, poses, part * 3 + k) for k in range(3)]
    lane = dr.arange(mi.UInt32, surface.vertex_count)
    p = dr.gather(mi.Vector4f, surface.vertices, lane * 2)
    n = dr.gather(mi.Vector4f, surface.vertices, lane * 2 + 1)
    p.w, n.w = 1.0, 0.0
    points, normals = dr.empty(mi.Float, 4 * surface.vertex_count), dr.empty(mi.Float, 4 * surface.vertex_count)
    dr.scatter(points, mi.Vector4f(*(dr.dot(row, p) for row in pose), 0.0), lane)
    dr.scatter(normals, mi.Vector4f(*(dr.dot(row, n) for row in pose), 0.0), lane)
    return points, normals


@frozen
@dr.syntax
def _texels(points: mi.Float, normals: mi.Float, faces: mi.UInt32, visibility: mi.UInt32, view: View) -> mi.Float:
    texel = dr.arange(mi.UInt32, view.width * view.height)
    triangle = raster.winner_at(visibility, view, texel, mi.Bool(True))
    value = mi.Vector4f(0)
    if triangle != raster.NONE:
        face, weights, q = raster.met(points, faces, triangle, view, texel)
        n = raster.interpolate(normals, face, weights, mi.Bool(True))
        n = dr.normalize(mi.Vector3f(n.x, n.y, n.z))
        # A sheet is a mirror on both sides: seen from behind, it has the normals of that side.
        a, b, c = (corner.xyz for corner in raster.corners(points, faces, triangle, mi.Bool(True))[1])
        n = dr.select(dr.dot(dr.cross(b - a, c - a), view.eye - a) < 0, -n, n)
        value = mi.Vector4f(depths.offset(view, q), n.x, n.y, n.z)
    texels = dr.empty(mi.Float, 4 * view.width * view.height)
    dr.scatter(texels, value, texel)
    return texels


@dataclass
class Window:
    """The part of the picture, widened, that a reflector's texture covers.

    view           the texture's camera
    left, top      pixel of the picture that the first texel lies on; a texel keeps its size and its pixel
    centre_column  texel nearest to the centre of the reflector's box,
    centre_row     and its row
    """

    view: View
    left: mi.Int32
    top: mi.Int32
    centre_column: mi.Int32
    centre_row: mi.Int32

    def code(self, column: mi.Int32, row: mi.Int32) -> mi.UInt32:
        """A texel as one number that holds in the windows of other frames too."""
        return (mi.UInt32(row + self.top + CODE_OFFSET) << 16) | mi.UInt32(column + self.left + CODE_OFFSET)

    def texel(self, code: mi.UInt32) -> tuple[mi.Int32, mi.Int32]:
        """Column and row; may lie outside of this window."""
        return mi.Int32(code & 0xFFFF) - CODE_OFFSET - self.left, mi.Int32(code >> 16) - CODE_OFFSET - self.top


def window(view: View, box: tuple[int, int, int, int], widening: float) -> Window:
    """The window for a reflector that lies within `box` (left, top, right, bottom, pixels of the picture).

    It reaches beyond the picture as far as tan(fov / 2) times `widening` does, and no further. Sizes are multiples of
    WINDOW_STEP, or all that may be seen, so that a moving camera meets few of them.
    """
    left, width, column = _span(box[0], box[2], view.width, widening)
    top, height, row = _span(box[1], box[3], view.height, widening)
    first = dr.opaque(mi.Int32, left), dr.opaque(mi.Int32, top)
    seen = depths.moved(view, *first, width, height)
    return Window(seen, *first, dr.opaque(mi.Int32, column), dr.opaque(mi.Int32, row))


def _span(low: int, high: int, size: int, widening: float) -> tuple[int, int, int]:
    """Along one axis: first pixel, number of texels, and the texel nearest to the middle between `low` and `high`."""
    beyond = math.ceil(0.5 * (widening - 1) * size)
    first, last = max(low - 1, -beyond), min(high + 1, size + beyond)
    count = min(max(-(-(last - first) // WINDOW_STEP), 1) * WINDOW_STEP, size + 2 * beyond)
    first = min(first, size + beyond - count)
    return first, count, min(max((low + high) // 2 - first, 0), count - 1)


def middle(texture: Texture, window: Window) -> tuple[mi.Int32, mi.Int32]:
    """Where a cold search starts: the covered texel nearest to the centre of the reflector's box on the screen.

    (0, 0) if nothing is covered.
    """
    width = window.view.width
    texel = dr.arange(mi.UInt32, width * window.view.height)
    covered = _covered(dr.gather(mi.Vector4f, texture.texels, texel))
    column, row = mi.Int32(texel % width), mi.Int32(texel // width)
    distance = mi.UInt32(dr.square(column - window.centre_column) + dr.square(row - window.centre_row))
    key = dr.select(covered, (mi.UInt64(distance) << 32) | mi.UInt64(texel), 0x7FFF_FFFF_0000_0000)
    nearest = mi.Int32(mi.UInt32(dr.min(key) & 0xFFFF_FFFF))
    return nearest % width, nearest // width


def _covered(texel: mi.Vector4f) -> mi.Bool:
    return dr.squared_norm(texel.yzw) > 0
