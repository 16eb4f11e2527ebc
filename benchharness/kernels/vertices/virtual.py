"""Drawing the virtual scene: triangles whose vertices were moved to where a mirror shows them.

A virtual vertex is a point in space behind its mirror, so the ordinary rasterizer draws virtual triangles, nearest first,
at the mirror's own pixels and behind its surface; `assembly` says which triangles, and where they end.

Two ways to interpolate. "perspective": a virtual vertex is a point in space, and its triangle a triangle in space (Estalella
et al. 2006). "screen_linear": a triangle spans the reflection points on the mirror, and its depth is the distance d_V
from there to the vertex, linear on the screen (Roger and Holzschuch 2006, 3.3.6). The second is drawn as triangles in space
too, whose vertices lie on the same rays of the eye at depth 1 / (1 - d_V / d_max): 1 / depth is linear on the screen.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels import depths, geometry, raster
from benchharness.kernels.frozen import frozen
from benchharness.kernels.types import Surface, View
from benchharness.kernels.vertices import bent, slivers, textures
from benchharness.kernels.vertices.assembly import HIDDEN as HIDDEN
from benchharness.kernels.vertices.assembly import NONE as NONE
from benchharness.kernels.vertices.assembly import REFLECTED as REFLECTED
from benchharness.kernels.vertices.assembly import Drawing, Hider, Images, Target, assembled


def sorted_by_length(R: mi.Point3f, d_V: mi.Float, d_max: mi.Float, view: View) -> mi.Point3f:
    """Where to draw a vertex in "screen_linear": on the eye's ray through R, in front of all that is reflected from farther."""
    share = dr.minimum(d_V / d_max, 1 - 1e-4)
    direction = (R - view.eye) * dr.rcp(dr.dot(view.w, mi.Vector4f(R.x, R.y, R.z, 1)))
    # From an eye far away: 1 / depth = (1 - share / view.depth) / view.depth, all within about a unit.
    scale = dr.maximum(view.depth, 1)
    there = share / (1 - share / scale) + (scale - view.depth)
    return mi.Point3f(R + (there - depths.offset(view, R)) * direction)


@dataclass
class Drawn:
    """What one mirror shows, a lane per pixel, 0 where it is not seen: radiance, length of the reflected ray, whether anything
    covers the pixel, and whether that may be wrong."""

    L: mi.Color3f
    distance: mi.Float
    covered: mi.Bool
    doubt: mi.Bool


@dataclass
class Nearest:
    """The nearest virtual triangles, one lane per pixel.

    visibility  of `raster.rasterize`
    spans       the points that triangles lie between, in whose plane what they carry is interpolated
    triangles   what they are images of; their number t is an image of the scene's number t % face_count
    bands       None where no doubt is asked for
    small       per pixel the nearest small triangle, as `slivers` has it; None but where triangles are only named
    """

    visibility: mi.UInt32
    spans: mi.Float
    triangles: geometry.Geometry
    bands: bent.Bands | None
    small: mi.UInt32 | None


def nearest(
    images: Images, triangles: geometry.Geometry, part: mi.UInt32, target: Target, drawing: Drawing, hider: Hider | None = None
) -> Nearest:
    """Which virtual triangles one mirror shows.

    triangles  the scene in world space; from `geometry.placed`, so that highlights are those that each pixel's `p` sees
    part       number of the mirror's part, which does not show itself; per triangle where there are several mirrors
    hider      what is asked whether the mirror hides a point; needed for "cut"
    """
    view = target.view
    made = assembled(images, triangles, part, target, drawing, hider)
    shown = made.triangles
    least = None if made.nearness is None or target.back is None else (made.nearness, target.back)
    layers = None
    if target.layer is not None:  # what was cut comes once more
        layers = (part if shown.face_count == triangles.face_count else dr.concat([part, part]), target.layer)
    visibility = raster.rasterize(
        made.points, shown.faces, shown.face_count, view, limit=made.limit, least=least, layers=layers, drawn=made.drawn
    )
    small = None
    if triangles.attributes is None:
        small = slivers.slivers(made.points, shown.faces, shown.face_count, view, made.limit, layers, made.drawn)
    spans = images.at if drawing.depth == "screen_linear" else made.points
    return Nearest(visibility, spans, shown, made.bands, small)


def nearest_back(surface: Surface, poses: mi.Float, part: mi.UInt32, view: View) -> mi.Float:
    """`depths.nearness` of the nearest triangle of a mirror, part number `part`, that turns its back to the eye, or
    `depths.nowhere`, one lane per pixel."""
    points, _ = textures.posed(surface, poses, part)
    visibility = raster.rasterize(points, surface.faces, surface.face_count, view, cull="front")
    return _nearness_at(points, surface.faces, visibility, view)


@frozen
@dr.syntax
def _nearness_at(points: mi.Float, faces: mi.UInt32, visibility: mi.UInt32, view: View) -> mi.Float:
    pixel = dr.arange(mi.UInt32, view.width * view.height)
    triangle = raster.winner_at(visibility, view, pixel, mi.Bool(True))
    value = mi.Float(depths.nowhere(view))
    if triangle != raster.NONE:
        value = depths.nearness(view, depths.offset(view, raster.met(points, faces, triangle, view, pixel)[2]))
    return value


def interpolated(shown: Nearest, target: Target, depth: str) -> Drawn:
    """What lies between the corners of the nearest triangles, where the eye's ray meets them. `depth`: as `Drawing` has it."""
    banded = None
    if shown.bands is not None:
        banded = bent.covered(shown.bands, target.view, dr.select(target.own, mi.Float(dr.inf), -dr.inf))
    return _interpolated(shown, target, banded, depth)


@frozen
@dr.syntax
def _interpolated(shown: Nearest, target: Target, banded: mi.UInt32 | None, depth: str) -> Drawn:
    """`banded`: the bands that cover a pixel, as `bent.covered` has them."""
    view, p, own, triangles = target.view, target.p, target.own, shown.triangles
    pixel = dr.arange(mi.UInt32, view.width * view.height)
    triangle = raster.winner_at(shown.visibility, view, pixel, own)
    hit = own & (triangle != raster.NONE)
    L, distance = mi.Color3f(0), mi.Float(0)
    if hit:
        face, weights, q = raster.met(shown.spans, triangles.faces, triangle, view, pixel)
        L = geometry.radiance(triangles, face, weights, p, mi.Bool(True))
        if dr.hint(depth == "screen_linear", mode="scalar"):
            distance = dr.norm(raster.interpolate(triangles.points, face, weights, mi.Bool(True)).xyz - p)
        else:
            distance = dr.maximum(dr.dot(q - p, dr.normalize(p - view.eye)), 0)
    doubt = mi.Bool(False)
    if shown.bands is not None:
        # A triangle that was cut is in two slots.
        doubt = hit & dr.gather(mi.Bool, shown.bands.doubted, triangle % (shown.bands.count // 3), hit)
        doubt |= own & (raster.winner_at(banded, view, pixel, own) != raster.NONE)
    return Drawn(L, distance, hit, doubt)


@frozen
def named(shown: Nearest, target: Target, names: mi.UInt32, count: int) -> tuple[mi.UInt32, mi.UInt32]:
    """What the triangle that covers a pixel is called, and what the small one that is seen in it, `raster.NONE` where there is
    none. `names`: of the `count` triangles, whose images come once or several times, in their order."""
    assert shown.small is not None
    pixel = dr.arange(mi.UInt32, target.view.width * target.view.height)

    def called(triangle: mi.UInt32) -> mi.UInt32:
        there = target.own & (triangle != raster.NONE)
        return dr.select(there, dr.gather(mi.UInt32, names, triangle % count, there), raster.NONE)

    return called(raster.winner_at(shown.visibility, target.view, pixel, target.own)), called(shown.small)
