"""Image-space search for reflection points (Estalella, Martin, Drettakis, Tost 2006, section 4).

A reflector is rendered from the eye into a texture of first points and normals. The point R that shows a vertex V to the
eye E is where the half vector B of the directions to E and V is the normal N; the search climbs the agreement of B and N
from texel to neighbouring texel until no neighbour agrees better.

Texture: 4 floats per texel, row major: depth along the view axis, from `view.depth` (`kernels.depths`), and unit normal; zeros
where the reflector is not. The point is where the texel's own ray has that depth, so that one packet of 16 bytes holds what the
paper keeps in two textures. `view` is the camera of the texture.

Where we differ from the paper: the eight neighbours may be taken at a stride that halves from level to level, which is
the same as climbing a pyramid of every second, fourth, ... texel, and takes a cold search from hundreds of steps to tens.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import drjit as dr
import mitsuba as mi

from benchharness.kernels import depths, optics, raster
from benchharness.kernels.frozen import frozen

CROSS = ((0, 1), (0, -1), (1, 0), (-1, 0))
DIAGONALS = ((1, 1), (1, -1), (-1, 1), (-1, -1))
WINDOW_STEP = 64  # pixels
CODE_OFFSET = 1 << 14  # pixels; a texel's place in the picture plus this fits 16 bits
CERTAIN = 1.0  # texels; a search that ended on the best texel leaves at most half a texel per axis, plus the curvature's part
BEND = 0.25  # square of the largest second difference, relative to the first over both sides, of a smooth texture
STRAY = 0.3  # |half vector - normal| of an end that is no reflection; at outlines one texel turns the normal by up to this
KEPT = 0.1  # texels; how far from where the rates put it the reflection point may still be
UNKNOWN_PX = 0.25  # texels that a converged search may be off for what its texture does not tell
OUTSIDE = -8.0  # below every score: "sq" lies in [-4, 0], "dot" in [-1, 1]


def render(surface, poses: mi.Float, part: mi.UInt32, view) -> mi.Float:
    """The texture of a reflector alone, not occluded by anything: 4 floats per texel.

    surface      a `benchharness.api.Surface`, part number `part`
    poses        12 floats per part; see `benchharness.api.Frame`
    """
    points, normals = posed(surface, poses, part)
    visibility = raster.rasterize(points, surface.faces, surface.face_count, view, cull="back")
    return _texels(points, normals, surface.faces, visibility, view)


@frozen
def posed(surface, poses: mi.Float, part: mi.UInt32) -> tuple[mi.Float, mi.Float]:
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
def _texels(points, normals, faces, visibility, view) -> mi.Float:
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


@dataclasses.dataclass
class Window:
    """The part of the picture, widened, that a reflector's texture covers.

    view           the texture's camera
    left, top      pixel of the picture that the first texel lies on; a texel keeps its size and its pixel
    centre_column  texel nearest to the centre of the reflector's box
    centre_row
    """

    view: Any
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


def window(view, box: tuple[int, int, int, int], widening: float) -> Window:
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


def middle(texels, where: Window) -> tuple[mi.Int32, mi.Int32]:
    """Where a cold search starts: the covered texel nearest to the centre of the reflector's box on the screen.

    (0, 0) if nothing is covered.
    """
    width = where.view.width
    texel = dr.arange(mi.UInt32, width * where.view.height)
    covered = _covered(dr.gather(mi.Vector4f, texels, texel))
    column, row = mi.Int32(texel % width), mi.Int32(texel // width)
    distance = mi.UInt32(dr.square(column - where.centre_column) + dr.square(row - where.centre_row))
    key = dr.select(covered, (mi.UInt64(distance) << 32) | mi.UInt64(texel), 0x7FFF_FFFF_0000_0000)
    nearest = mi.Int32(mi.UInt32(dr.min(key) & 0xFFFF_FFFF))
    return nearest % width, nearest // width


def texel_of(view, p: mi.Point3f) -> tuple[mi.Int32, mi.Int32, mi.Bool]:
    """Column and row of the texel that p is seen in, and whether it is in front and in the picture."""
    q = mi.Vector4f(p.x, p.y, p.z, 1.0)
    w = dr.dot(view.w, q)
    scale = dr.rcp(dr.maximum(w, 1e-12))
    x, y = dr.dot(view.x, q) * scale, dr.dot(view.y, q) * scale
    seen = (w > view.near) & (x >= 0) & (y >= 0) & (x < view.width) & (y < view.height)
    return dr.select(seen, mi.Int32(x), 0), dr.select(seen, mi.Int32(y), 0), seen


def fetch(texels: mi.Float, view, column: mi.Int32, row: mi.Int32, active=True):
    """(covered, point, normal) of a texel; outside the picture nothing is covered."""
    inside = (column >= 0) & (row >= 0) & (column < view.width) & (row < view.height) & active
    t = dr.gather(mi.Vector4f, texels, mi.UInt32(row * view.width + column), inside)
    p = depths.on_ray(view, mi.Float(column) + 0.5, mi.Float(row) + 0.5, t.x)
    return inside & _covered(t), p, mi.Normal3f(t.y, t.z, t.w)


def surface(texels: mi.Float, view, column: mi.Int32, row: mi.Int32, active) -> tuple[mi.Bool, mi.Float]:
    """Whether a texel within the picture is covered, and its depth, from `view.depth`."""
    t = dr.gather(mi.Vector4f, texels, mi.UInt32(row * view.width + column), active)
    return active & _covered(t), t.x


def _covered(texel: mi.Vector4f) -> mi.Bool:
    return dr.squared_norm(texel.yzw) > 0


def mismatch(p: mi.Point3f, n: mi.Normal3f, eye: mi.Point3f, vertex: mi.Point3f) -> tuple[mi.Vector3f, mi.Bool]:
    """B - N at a point of the reflector, and whether B is defined."""
    B, defined = optics.half_vector(p, eye, vertex)
    return B - mi.Vector3f(n), defined


def score(kind: str, texels, view, column, row, vertex: mi.Point3f, active) -> mi.Float:
    """How well the texel reflects the vertex: "dot" is B.N as in the paper, "sq" is -|B - N|^2.

    Both have the same maximum; B.N in float32 is flat within 3.5e-4 rad of it, -|B - N|^2 is not. "inverse" is "sq" with
    the roles swapped: the vertex is the image, and what it is the image of is its mirror image at each texel.
    """
    covered, p, n = fetch(texels, view, column, row, active)
    if kind == "inverse":
        vertex = optics.mirrored(vertex, p, n)
    difference, defined = mismatch(p, n, view.eye, vertex)
    if kind == "dot":
        value = dr.select(defined, dr.dot(difference, n) + 1, -1)
    else:
        value = dr.select(defined, -dr.squared_norm(difference), -4)
    return dr.select(covered, value, OUTSIDE)


@dr.syntax
def climb(kind: str, neighbourhood: str, texels, view, vertex, column, row, stride, active, max_iter):
    """Climbs from (column, row) with neighbours `stride` texels away, halving the stride down to 1.

    Returns (column, row, score, iterations, reads, settled): the best texel; neighbourhoods examined, the last one that
    changed nothing included; texels evaluated; whether it ended by itself rather than at `max_iter`.
    Strict improvement at each step, so it ends; neighbours that tie do not move it.
    """
    best = score(kind, texels, view, column, row, vertex, active)
    iterations = mi.UInt32(0)
    reads = mi.UInt32(dr.select(active, 1, 0))
    corners = mi.Bool(False)
    running = mi.Bool(active)
    ended = ~running
    offsets = CROSS + DIAGONALS if neighbourhood == "full8" else CROSS
    while dr.hint(running, label="climb the agreement of half vector and normal"):
        next_column, next_row, next_best = mi.Int32(column), mi.Int32(row), mi.Float(best)
        for k in range(len(offsets)):
            dx, dy = offsets[k]
            if dr.hint(neighbourhood == "cross_then_diag", mode="scalar"):
                dx, dy = dr.select(corners, DIAGONALS[k][0], dx), dr.select(corners, DIAGONALS[k][1], dy)
            c, r = column + dx * stride, row + dy * stride
            s = score(kind, texels, view, c, r, vertex, running)
            better = s > next_best
            next_column, next_row = dr.select(better, c, next_column), dr.select(better, r, next_row)
            next_best = dr.select(better, s, next_best)
        reads += len(offsets)

        improved = next_best > best
        column, row, best = next_column, next_row, next_best
        examined = mi.Bool(improved)
        if dr.hint(neighbourhood == "cross_then_diag", mode="scalar"):
            examined |= corners
            settled = corners & ~improved
            corners = ~corners & ~improved
        else:
            examined |= True
            settled = ~improved
        iterations += dr.select(examined, 1, 0)
        done = settled & (stride <= 1)
        stride = dr.select(settled, dr.maximum(stride >> 1, 1), stride)
        ended |= done
        running &= ~done & (iterations < max_iter)
    return column, row, best, iterations, reads, ended


def around(texels, view, column, row, vertex: mi.Point3f, active):
    """B - N at a texel and its rates of change per column and per row, with the point's own.

    Returns (difference, d_column, d_row, p, n, p_column, p_row, n_column, n_row, complete, smooth, bent): central differences
    over the four neighbours, `complete` where all five are covered and B is defined at each, `smooth` where both sides agree
    too; the sum of the squares of how far they do not.
    """
    covered, p, n = fetch(texels, view, column, row, active)
    centre, complete = mismatch(p, n, view.eye, vertex)
    complete &= covered
    rates, smooth, bent = [], mi.Bool(True), mi.Float(0)
    for dx, dy in ((1, 0), (0, 1)):
        ends = []
        for side in (1, -1):
            covered, q, m = fetch(texels, view, column + side * dx, row + side * dy, active)
            difference, defined = mismatch(q, m, view.eye, vertex)
            complete &= covered & defined
            ends.append((difference, q, mi.Vector3f(m)))
        # Where the two sides change at different rates, a step or an outline lies between.
        bend, turn = ends[0][0] + ends[1][0] - 2 * centre, ends[0][0] - ends[1][0]
        smooth &= dr.squared_norm(bend) <= BEND * dr.squared_norm(turn)
        bent += dr.squared_norm(bend)
        rates.append([0.5 * (a - b) for a, b in zip(*ends, strict=True)])
    (dc, pc, nc), (dr_, pr, nr) = rates
    return centre, dc, dr_, p, n, pc, pr, nc, nr, complete, complete & smooth, bent


def least_squares(f: mi.Vector3f, a: mi.Vector3f, b: mi.Vector3f) -> tuple[mi.Float, mi.Float, mi.Bool]:
    """(x, y) that minimise |f + x a + y b|, within one texel each, and whether they explain f.

    The last is True where the solution lies within CERTAIN texels and leaves less of f than the step of one texel would
    change it: then R is where the texture says that it is, and not where the search merely stopped.
    """
    aa, ab, bb, af, bf = dr.dot(a, a), dr.dot(a, b), dr.dot(b, b), dr.dot(a, f), dr.dot(b, f)
    det = aa * bb - ab * ab
    usable = det > 1e-6 * aa * bb
    scale = dr.select(usable, dr.rcp(dr.select(usable, det, 1)), 0)
    x, y = (ab * bf - bb * af) * scale, (ab * af - aa * bf) * scale
    left = dr.squared_norm(f + x * a + y * b)
    explained = usable & (dr.abs(x) <= CERTAIN) & (dr.abs(y) <= CERTAIN) & (left <= 0.25 * dr.maximum(aa, bb))
    return dr.clip(x, -1, 1), dr.clip(y, -1, 1), explained


def between(view, p, n, p_column, p_row, n_column, n_row, column, row, x, y) -> tuple[mi.Point3f, mi.Normal3f]:
    """The point on the eye's ray through (column + x, row + y) and its unit normal, from a texel's and their rates."""
    q = p + x * p_column + y * p_row
    on_ray = depths.on_ray(view, mi.Float(column) + x + 0.5, mi.Float(row) + y + 0.5, depths.offset(view, q))
    return on_ray, mi.Normal3f(dr.normalize(mi.Vector3f(n) + x * n_column + y * n_row))


@dataclasses.dataclass
class Found:
    """What a search ended with, one lane per vertex.

    column, row  the best texel
    R, n         the reflection point and its unit normal, of that texel or refined between texels
    reflected    V lies in front of the plane at R: region A. Not so where the search ended far from any agreement, as it
                 may on a mirror that is not convex: such a vertex is neither reflected nor hidden
    hidden       it does not: region C, which no reflection point shows
    converged    reflected, and half vector and normal agree within what one texel changes
    valid        converged, and the normal is turned to the eye
    border       the search was stopped by the edge of the texture
    residual     |half vector - normal| at R
    iterations   neighbourhoods examined; reads: texels evaluated while climbing; 0 for inactive lanes
    """

    column: mi.Int32
    row: mi.Int32
    R: mi.Point3f
    n: mi.Normal3f
    reflected: mi.Bool
    hidden: mi.Bool
    converged: mi.Bool
    valid: mi.Bool
    border: mi.Bool
    residual: mi.Float
    iterations: mi.UInt32
    reads: mi.UInt32


def find(kind, neighbourhood, subtexel: bool, texels, view, vertex, column, row, stride, active, max_iter) -> Found:
    """The reflection point of each vertex: climb from (column, row), then look around the texel where that ended."""
    column, row, _, iterations, reads, settled = climb(
        kind, neighbourhood, texels, view, vertex, column, row, stride, active, max_iter
    )
    difference, d_column, d_row, R, n, p_column, p_row, n_column, n_row, complete, smooth, bent = around(
        texels, view, column, row, vertex, active
    )
    covered = fetch(texels, view, column, row, active)[0]
    x, y, explained = least_squares(difference, d_column, d_row)
    # Across a fold of the mirror the rates mean nothing, and what they promise does not come true.
    refined = between(view, R, n, p_column, p_row, n_column, n_row, column, row, x, y)
    step = dr.minimum(dr.squared_norm(d_column), dr.squared_norm(d_row))
    kept = dr.squared_norm(mismatch(*refined, view.eye, vertex)[0]) <= dr.square(KEPT) * step
    certain = explained & smooth & settled & kept
    if subtexel:
        R, n = dr.select(complete, refined[0], R), dr.select(complete, refined[1], n)
    in_front = dr.dot(vertex - R, n) > 0
    residual = dr.norm(mismatch(R, n, view.eye, vertex)[0])
    stray = in_front & ~certain & (residual > STRAY)
    reflected = active & covered & in_front & ~stray
    edge = (column == 0) | (row == 0) | (column == view.width - 1) | (row == view.height - 1)
    # Between texels, second differences leave an eighth of them unknown. Where B - N hardly changes in some direction, as at a
    # focus, that moves the point by pixels.
    aa, ab, bb = dr.squared_norm(d_column), dr.dot(d_column, d_row), dr.squared_norm(d_row)
    least = 0.5 * (aa + bb - dr.sqrt(dr.square(aa - bb) + 4 * ab * ab))
    converged = reflected & certain & (bent <= dr.square(8 * UNKNOWN_PX) * least)
    return Found(
        column=column,
        row=row,
        R=R,
        n=n,
        reflected=reflected,
        hidden=active & covered & ~in_front,
        converged=converged,
        valid=converged & (dr.dot(view.eye - R, n) > 0),
        border=active & edge & ~certain,
        residual=residual,
        iterations=dr.select(active, iterations, 0),
        reads=reads,
    )
