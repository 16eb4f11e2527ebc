"""Rasterizer: triangles -> visibility buffer -> which triangle is nearest at each pixel centre, and where on it.

Visibility is decided in a buffer of one 64-bit number per pixel, (depth key << 32) | triangle, reduced by minimum: the
nearest triangle wins and equal depths go to the lower number, so that the result does not depend on the order in which
lanes run. The depth key is the bit pattern of 1/w, complemented: 1/w is linear on the screen and keeps its relative
precision at all distances.

Two levels. A triangle whose bounding box holds few pixels is walked by its own lane. A larger one is cut into tiles of
16 x 16 pixels; a fixed number of lanes shares all tiles of all large triangles evenly (a prefix sum over the tile counts
says whose tile is whose), so that a wall across the picture does not serialise on one lane.

Fill rule. A pixel centre is inside where all three edge functions are positive, or zero on an edge that owns its points
("top-left"). An edge function is evaluated from its two end points in an order that does not depend on the triangle, so
that the two triangles at an edge see the same number with opposite signs: no holes, no double hits.

Near plane. Nothing is cut: a triangle that crosses it keeps its edges in homogeneous form (Olano and Greer 1997, "Triangle
scan conversion using 2D homogeneous coordinates"), its box is that of the part in front, and pixels in front of the plane
are refused one by one.

Layout. `points` holds 4 floats per vertex (x, y, z and one that is ignored here), `faces` 4 integers per triangle (three
vertices and one whose highest bit, CLOSED, marks triangles whose back is never seen): one packet each. `view` is a
`benchharness.api.View`.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

SMALL_BOX_PX = 384  # largest bounding box that one lane walks
TILE_PX = 16
TILE_LANES = 1 << 13  # lanes that share the tiles of large triangles
CLOSED = 0x8000_0000
EMPTY = 0xFFFF_FFFF_FFFF_FFFF


@dataclass
class Edge:
    """A (px - x) + B (py - y), times the triangle's orientation; `owns`: points with value 0 are inside."""

    x: mi.Float
    y: mi.Float
    A: mi.Float
    B: mi.Float
    owns: mi.Bool

    def inside(self, px: mi.Float, py: mi.Float) -> mi.Bool:
        e = (py - self.y) * self.B + (px - self.x) * self.A
        return (e > 0) | ((e == 0) & self.owns)

    def reaches(self, left: mi.Float, top: mi.Float, size: float) -> mi.Bool:
        """False only if the whole square of pixel centres is outside."""
        far_x = dr.select(self.A > 0, left + size, left)
        far_y = dr.select(self.B > 0, top + size, top)
        return (far_y - self.y) * self.B + (far_x - self.x) * self.A >= 0


@dataclass
class Setup:
    """A triangle ready to be walked: edges, 1/w = g + gx px + gy py (relative to x0, y0), and its box of pixels."""

    edges: list[Edge]
    x0: mi.Float
    y0: mi.Float
    g: mi.Float
    gx: mi.Float
    gy: mi.Float
    g_near: mi.Float
    left: mi.Int32
    top: mi.Int32
    columns: mi.Int32
    rows: mi.Int32

    def covers(self, px: mi.Float, py: mi.Float) -> mi.Bool:
        a, b, c = self.edges
        return a.inside(px, py) & b.inside(px, py) & c.inside(px, py)

    def depth(self, px: mi.Float, py: mi.Float) -> mi.Float:
        return dr.fma(self.gx, px - self.x0, dr.fma(self.gy, py - self.y0, self.g))


def setup(points: mi.Float, faces: mi.UInt32, triangle: mi.UInt32, view, box, active: mi.Bool, cull: bool = False) -> Setup:
    """Loads, projects and prepares triangles.

    box     (left, top, right, bottom) in pixels, half open, Int32: nothing is drawn outside
    cull    drop triangles marked CLOSED that turn their clockwise side to the eye
    """
    face = dr.gather(mi.Vector4u, faces, triangle, active)
    h = [_homogeneous(dr.gather(mi.Vector4f, points, i, active), view) for i in (face.x, face.y, face.z)]
    front = [p.z > view.near for p in h]
    whole = front[0] & front[1] & front[2]
    s = [[p.x * w, p.y * w, w] for p, w in ((p, dr.rcp(p.z)) for p in h)]

    # Orientation and the plane of 1/w, from the screen where the triangle is whole, else from homogeneous coordinates.
    d1x, d1y, d2x, d2y = s[1][0] - s[0][0], s[1][1] - s[0][1], s[2][0] - s[0][0], s[2][1] - s[0][1]
    area = d1x * d2y - d1y * d2x
    lines = [dr.cross(h[k], h[(k + 1) % 3]) for k in range(3)]
    volume = dr.dot(h[2], lines[0])
    size = dr.select(whole, area, volume)
    per_size = dr.rcp(size)
    line = (lines[0] + lines[1] + lines[2]) * per_size
    g1, g2 = s[1][2] - s[0][2], s[2][2] - s[0][2]
    gx = dr.select(whole, (g1 * d2y - g2 * d1y) * per_size, line.x)
    gy = dr.select(whole, (g2 * d1x - g1 * d2x) * per_size, line.y)
    g = dr.select(whole, s[0][2], line.z)
    x0, y0 = dr.select(whole, s[0][0], 0), dr.select(whole, s[0][1], 0)

    # Box of the part in front of the near plane.
    inf = dr.inf
    low_x, low_y, high_x, high_y = mi.Float(inf), mi.Float(inf), mi.Float(-inf), mi.Float(-inf)
    for k in range(3):
        a, b = h[k], h[(k + 1) % 3]
        crosses = front[k] ^ front[(k + 1) % 3]
        t = (view.near - a.z) / (b.z - a.z)
        cut = dr.lerp(a, b, t) / view.near
        for x, y, counts in ((s[k][0], s[k][1], front[k]), (cut.x, cut.y, crosses)):
            low_x, high_x = dr.select(counts, dr.minimum(low_x, x), low_x), dr.select(counts, dr.maximum(high_x, x), high_x)
            low_y, high_y = dr.select(counts, dr.minimum(low_y, y), low_y), dr.select(counts, dr.maximum(high_y, y), high_y)
    left, columns = _pixels(low_x, high_x, box[0], box[2])
    top, rows = _pixels(low_y, high_y, box[1], box[3])
    drawn = active & dr.isfinite(per_size) & (size != 0) & (front[0] | front[1] | front[2])
    if cull:
        # y points down: counter-clockwise in space is negative on the screen.
        drawn &= (size < 0) | ((face.w & CLOSED) == 0)
    edges = [_edge(h[k], h[(k + 1) % 3], s[k], s[(k + 1) % 3], front[k], front[(k + 1) % 3], size > 0) for k in range(3)]
    return Setup(
        edges, x0, y0, g, gx, gy, dr.rcp(view.near), left, top,
        dr.select(drawn, dr.maximum(columns, 0), 0), dr.select(drawn, dr.maximum(rows, 0), 0),
    )  # fmt: skip


def _homogeneous(p: mi.Vector4f, view) -> mi.Vector3f:
    p.w = 1.0
    return mi.Vector3f(dr.dot(view.x, p), dr.dot(view.y, p), dr.dot(view.w, p))


def _pixels(low: mi.Float, high: mi.Float, first: mi.Int32, last: mi.Int32) -> tuple[mi.Int32, mi.Int32]:
    """First pixel whose centre is at or after `low`, and how many up to `high`, within [first, last)."""
    start = mi.Int32(dr.ceil(dr.clip(low, mi.Float(first), mi.Float(last)) - 0.5))
    stop = mi.Int32(dr.floor(dr.clip(high, mi.Float(first), mi.Float(last)) - 0.5))
    start = dr.maximum(start, first)
    return start, dr.minimum(stop, last - 1) - start + 1


def _edge(ha, hb, sa, sb, front_a: mi.Bool, front_b: mi.Bool, positive: mi.Bool) -> Edge:
    """The edge from a to b, computed in the order of its end points' coordinates and not in the triangle's."""
    both = front_a & front_b
    swap = dr.select(both, (sb[0] < sa[0]) | ((sb[0] == sa[0]) & (sb[1] < sa[1])), _before(hb, ha))
    ha, hb = dr.select(swap, hb, ha), dr.select(swap, ha, hb)
    ax, bx = dr.select(swap, sb[0], sa[0]), dr.select(swap, sa[0], sb[0])
    ay, by = dr.select(swap, sb[1], sa[1]), dr.select(swap, sa[1], sb[1])
    front_a, front_b = dr.select(swap, front_b, front_a), dr.select(swap, front_a, front_b)

    line = dr.cross(ha, hb)
    foot = -line.z * dr.rcp(dr.maximum(dr.square(line.x) + dr.square(line.y), 1e-30))
    x = dr.select(front_a, ax, dr.select(front_b, bx, foot * line.x))
    y = dr.select(front_a, ay, dr.select(front_b, by, foot * line.y))
    sign = dr.select(swap ^ positive, mi.Float(1), mi.Float(-1))
    A = sign * dr.select(both, ay - by, line.x)
    B = sign * dr.select(both, bx - ax, line.y)
    return Edge(x, y, A, B, (A > 0) | ((A == 0) & (B > 0)))


def _before(a: mi.Vector3f, b: mi.Vector3f) -> mi.Bool:
    return (a.x < b.x) | ((a.x == b.x) & ((a.y < b.y) | ((a.y == b.y) & (a.z < b.z))))


@dr.syntax
def _walk(t: Setup, triangle: mi.UInt32, left, top, columns, rows, buffer, width: int, limit) -> None:
    """Every lane walks its own box row by row and offers its triangle to the pixels that it covers."""
    column = mi.Int32(0)
    row = mi.Int32(0)
    while dr.hint((row < rows) & (columns > 0), label="walk a box of pixels"):
        px = mi.Float(left + column) + 0.5
        py = mi.Float(top + row) + 0.5
        g = t.depth(px, py)
        lane = mi.UInt32((top + row) * width + left + column)
        hit = t.covers(px, py) & (g > 0) & (g < t.g_near)
        if dr.hint(limit is not None, mode="scalar"):
            hit &= g <= dr.gather(mi.Float, limit, lane, hit)
        key = (mi.UInt64(0xFFFF_FFFF - dr.reinterpret_array(mi.UInt32, g)) << 32) | mi.UInt64(triangle)
        dr.scatter_reduce(dr.ReduceOp.Min, buffer, key, lane, hit, mode=dr.ReduceMode.Direct)
        column += 1
        wrap = column >= columns
        column = dr.select(wrap, 0, column)
        row = dr.select(wrap, row + 1, row)


@dr.syntax
def _walk_tiles(points, faces, starts, face_count: int, view, box, buffer, limit, cull: bool) -> None:
    """A fixed number of lanes takes the tiles of all large triangles in turn."""
    lane = dr.arange(mi.UInt32, TILE_LANES)
    item = mi.UInt32(lane)
    total = dr.gather(mi.UInt32, starts, face_count)
    while dr.hint(item < total, label="tiles of large triangles"):
        # Whose tile: the last triangle whose tiles start at or before this one.
        triangle = dr.binary_search(0, face_count - 1, lambda i: dr.gather(mi.UInt32, starts, i + 1) <= item)  # noqa: B023 (called at once)
        tile = mi.Int32(item - dr.gather(mi.UInt32, starts, triangle))
        t = setup(points, faces, triangle, view, box, mi.Bool(True), cull)
        across = (t.columns + (TILE_PX - 1)) // TILE_PX
        down = tile // dr.maximum(across, 1)
        left = t.left + (tile - down * across) * TILE_PX
        top = t.top + down * TILE_PX

        px, py = mi.Float(left) + 0.5, mi.Float(top) + 0.5
        reached = mi.Bool(True)
        for edge in t.edges:
            reached &= edge.reaches(px, py, TILE_PX - 1)
        rows = dr.select(reached, dr.minimum(t.top + t.rows - top, TILE_PX), 0)
        columns = dr.minimum(t.left + t.columns - left, TILE_PX)
        _walk(t, triangle, left, top, columns, rows, buffer, view.width, limit)
        item += TILE_LANES


def rasterize(
    points: mi.Float,
    faces: mi.UInt32,
    face_count: int,
    view,
    *,
    box=None,
    limit: mi.Float | None = None,
    drawn: mi.Bool | None = None,
    cull: bool = False,
) -> mi.UInt64:
    """Visibility buffer, UInt64 [height * width]; EMPTY where no triangle covers the pixel centre.

    box        (left, top, right, bottom) in pixels, half open; the whole picture if None
    limit      Float [height * width]; only what has 1/w up to this is drawn: a stencil (0 shuts a pixel) and a surface
               behind which everything lies (its own 1/w)
    drawn      Bool [face_count]; the triangles to draw; all if None
    cull       drop triangles marked CLOSED that turn their clockwise side to the eye
    """
    box = (mi.Int32(0), mi.Int32(0), mi.Int32(view.width), mi.Int32(view.height)) if box is None else box
    buffer = dr.full(mi.UInt64, EMPTY, view.width * view.height)
    triangle = dr.arange(mi.UInt32, face_count)
    t = setup(points, faces, triangle, view, box, mi.Bool(True) if drawn is None else drawn, cull)
    small = t.columns * t.rows <= SMALL_BOX_PX
    tiles = ((t.columns + (TILE_PX - 1)) // TILE_PX) * ((t.rows + (TILE_PX - 1)) // TILE_PX)
    counts = dr.zeros(mi.UInt32, face_count + 1)
    dr.scatter(counts, dr.select(small, 0, mi.UInt32(tiles)), triangle + 1)
    rows = dr.select(small, t.rows, 0)
    _walk(t, triangle, t.left, t.top, t.columns, rows, buffer, view.width, limit)
    dr.eval(buffer, counts)
    starts = dr.prefix_reduce(dr.ReduceOp.Add, counts, exclusive=False)
    _walk_tiles(points, faces, starts, face_count, view, box, buffer, limit, cull)
    return buffer


def triangle_of(visibility: mi.UInt64) -> tuple[mi.UInt32, mi.Bool]:
    """Triangle number and whether there is one, per pixel."""
    covered = visibility != EMPTY
    return dr.select(covered, mi.UInt32(visibility & 0xFFFF_FFFF), 0), covered


def ray_through(view, lane: mi.UInt32) -> mi.Vector3f:
    """Unnormalised direction through the centre of pixel `lane`; its length along the view axis is 1."""
    row = lane // view.width
    column = lane - row * view.width
    return view.axis + (mi.Float(column) + 0.5) * view.right + (mi.Float(row) + 0.5) * view.down


def barycentric(a: mi.Vector3f, b: mi.Vector3f, c: mi.Vector3f, d: mi.Vector3f) -> mi.Vector3f:
    """Weights of the corners where the ray from the origin along d meets the triangle a, b, c; not negative, sum 1.

    Perspective-correct by construction: each weight is the volume that the ray spans with the opposite edge. For a ray
    that misses by rounding, the weights are those of a point on the triangle's edge; without a volume, all are equal.
    """
    weights = mi.Vector3f(dr.dot(d, dr.cross(b, c)), dr.dot(d, dr.cross(c, a)), dr.dot(d, dr.cross(a, b)))
    weights = dr.maximum(weights * dr.sign(weights.x + weights.y + weights.z), 0)
    total = weights.x + weights.y + weights.z
    return dr.select(total > 0, weights * dr.rcp(dr.select(total > 0, total, 1)), 1 / 3)


def corners(points: mi.Float, faces: mi.UInt32, triangle: mi.UInt32, active: mi.Bool) -> tuple[mi.Vector4u, list]:
    """The packet of a triangle and those of its three vertices."""
    face = dr.gather(mi.Vector4u, faces, triangle, active)
    return face, [dr.gather(mi.Vector4f, points, i, active) for i in (face.x, face.y, face.z)]


def interpolate(values: mi.Float, face: mi.Vector4u, weights: mi.Vector3f, active: mi.Bool) -> mi.Vector4f:
    """Weighted sum of the packets of a triangle's vertices."""
    a, b, c = (dr.gather(mi.Vector4f, values, i, active) for i in (face.x, face.y, face.z))
    return a * weights.x + b * weights.y + c * weights.z


def seen(points: mi.Float, faces: mi.UInt32, visibility: mi.UInt64, view, lane: mi.UInt32, active: mi.Bool | bool = True):
    """What `rasterize` found at pixel `lane`: (hit, packet of the triangle, its perspective-correct weights, the point)."""
    triangle, hit = triangle_of(dr.gather(mi.UInt64, visibility, lane, active))
    hit &= active
    face, corner = corners(points, faces, triangle, hit)
    a, b, c = (mi.Vector3f(q.x, q.y, q.z) - view.eye for q in corner)
    weights = barycentric(a, b, c, ray_through(view, lane))
    return hit, face, weights, view.eye + weights.x * a + weights.y * b + weights.z * c
