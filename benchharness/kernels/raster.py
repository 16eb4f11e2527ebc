"""Rasterizer: triangles -> which one is nearest at each pixel centre, and where on it.

The picture is cut into tiles of 16 x 8 pixels. Every triangle is put on the list of each tile that its box reaches and its
edges do not exclude; then 16 lanes walk a tile's list together, each with a column of 8 pixels whose nearest triangles so
far stay in registers. No lane waits for another's large triangle, and no pixel is written twice: a buffer of 64-bit keys,
reduced by atomic minima, spent most of its time on the atomics (of 16 ms, at three layers of overdraw).

Fill rule. A pixel centre is inside where all three edge functions are positive, or zero on an edge that owns its points
("top-left"). An edge function is evaluated from its two end points in an order that does not depend on the triangle, so
that the two triangles at an edge see the same number with opposite signs: no holes, no double hits. Equal depths go to the
lower number: the result does not depend on the order in which lanes run.

Depth is 1/w, which is linear on the screen and keeps its relative precision at all distances; from an eye far away, its
difference to that of the mirrors (`kernels.depths.nearness`).

Near plane. Nothing is cut: a triangle that crosses it keeps its edges in homogeneous form (Olano and Greer 1997, "Triangle
scan conversion using 2D homogeneous coordinates"), its box is that of the part in front, and pixels in front of the plane
are refused one by one.

Layout. `points` holds 4 floats per vertex (x, y, z and one that is ignored here), `faces` 4 integers per triangle (three
vertices and one whose highest bit, CLOSED, marks triangles whose back is never seen): one packet each. `view` is a
`benchharness.api.View`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import drjit as dr
import mitsuba as mi

from benchharness.kernels import depths
from benchharness.kernels.frozen import frozen

TILE_WIDTH, TILE_HEIGHT = 16, 8  # pixels: a vector of lanes across, what fits the registers down
CLOSED = 0x8000_0000
HEAD_SPACING = 16  # heads of lists lie a cache line apart: two cores that add to two lists do not share one
NONE = 0xFFFF_FFFF  # no triangle; end of a list
OPEN_END = 1.2e-38  # smallest normal float: what an edge that does not own its points asks of its function


@dataclass
class Edge:
    """A (px - x) + B (py - y), times the triangle's orientation: positive inside. `owns`: points with value 0 are inside."""

    x: mi.Float
    y: mi.Float
    A: mi.Float
    B: mi.Float
    owns: mi.Bool

    def reaches(self, left: mi.Float, top: mi.Float) -> mi.Bool:
        """False only if all pixel centres of the tile whose first one is (left, top) are outside."""
        far_x = dr.select(self.A > 0, left + (TILE_WIDTH - 1), left)
        far_y = dr.select(self.B > 0, top + (TILE_HEIGHT - 1), top)
        return (far_y - self.y) * self.B + (far_x - self.x) * self.A >= 0


@dataclass
class Setup:
    """A triangle ready to be walked: edges, nearness = g + gx px + gy py, a second value likewise, and its box of pixels."""

    edges: list[Edge]
    g: mi.Float
    gx: mi.Float
    gy: mi.Float
    second: mi.Vector3f | None
    left: mi.Int32
    top: mi.Int32
    columns: mi.Int32
    rows: mi.Int32


def setup(points: mi.Float, faces: mi.UInt32, triangle: mi.UInt32, view, active, cull: str, values: mi.Float | None) -> Setup:
    """Loads, projects and prepares triangles; no columns or rows where nothing is to be drawn. See `rasterize`."""
    face = dr.gather(mi.Vector4u, faces, triangle, active)
    q = [dr.gather(mi.Vector4f, points, i, active) for i in (face.x, face.y, face.z)]
    for p in q:
        p.w = 1.0
    h = [mi.Vector3f(dr.dot(view.x, p), dr.dot(view.y, p), dr.dot(view.w, p)) for p in q]
    front = [p.z > view.near for p in h]
    whole = front[0] & front[1] & front[2]
    near_row = depths.row(view)
    near = [dr.dot(near_row, p) for p in q]
    s = [[p.x * w, p.y * w, n * w] for p, n, w in ((p, n, dr.rcp(p.z)) for p, n in zip(h, near, strict=True))]

    # Orientation and the plane of nearness, from the screen where the triangle is whole, else from homogeneous coordinates.
    d1x, d1y, d2x, d2y = s[1][0] - s[0][0], s[1][1] - s[0][1], s[2][0] - s[0][0], s[2][1] - s[0][1]
    area = d1x * d2y - d1y * d2x
    lines = [dr.cross(h[k], h[(k + 1) % 3]) for k in range(3)]
    size = dr.select(whole, area, dr.dot(h[2], lines[0]))
    per_size = dr.rcp(size)
    line = (near[2] * lines[0] + near[0] * lines[1] + near[1] * lines[2]) * per_size
    g1, g2 = s[1][2] - s[0][2], s[2][2] - s[0][2]
    gx = dr.select(whole, (g1 * d2y - g2 * d1y) * per_size, line.x)
    gy = dr.select(whole, (g2 * d1x - g1 * d2x) * per_size, line.y)
    g = dr.select(whole, s[0][2] - gx * s[0][0] - gy * s[0][1], line.z)

    second = None
    if values is not None:
        v = [dr.gather(mi.Float, values, i, active) for i in (face.x, face.y, face.z)]
        v1, v2 = v[1] - v[0], v[2] - v[0]
        vx, vy = (v1 * d2y - v2 * d1y) * per_size, (v2 * d1x - v1 * d2x) * per_size
        # A triangle that crosses the near plane has no such plane: it passes every test.
        second = dr.select(whole, mi.Vector3f(v[0] - vx * s[0][0] - vy * s[0][1], vx, vy), mi.Vector3f(1e30, 0, 0))

    # Box of the part in front of the near plane.
    low_x, low_y, high_x, high_y = mi.Float(dr.inf), mi.Float(dr.inf), mi.Float(-dr.inf), mi.Float(-dr.inf)
    for k in range(3):
        a, b = h[k], h[(k + 1) % 3]
        cut = dr.lerp(a, b, (view.near - a.z) / (b.z - a.z)) / view.near
        crosses = front[k] ^ front[(k + 1) % 3]
        for x, y, counts in ((s[k][0], s[k][1], front[k]), (cut.x, cut.y, crosses)):
            low_x, low_y = dr.select(counts & (x < low_x), x, low_x), dr.select(counts & (y < low_y), y, low_y)
            high_x, high_y = dr.select(counts & (x > high_x), x, high_x), dr.select(counts & (y > high_y), y, high_y)
    left, columns = _pixels(low_x, high_x, view.width)
    top, rows = _pixels(low_y, high_y, view.height)
    drawn = active & dr.isfinite(per_size) & (size != 0) & (front[0] | front[1] | front[2]) & (columns > 0) & (rows > 0)
    # y points down: counter-clockwise in space is negative on the screen.
    if cull == "back":
        drawn &= (size < 0) | ((face.w & CLOSED) == 0)
    elif cull == "front":
        drawn &= size > 0
    edges = [_edge(h[k], h[(k + 1) % 3], s[k], s[(k + 1) % 3], front[k], front[(k + 1) % 3], size > 0) for k in range(3)]
    return Setup(edges, g, gx, gy, second, left, top, dr.select(drawn, columns, 0), dr.select(drawn, rows, 0))


def _pixels(low: mi.Float, high: mi.Float, count: int) -> tuple[mi.Int32, mi.Int32]:
    """First pixel whose centre is at or after `low`, and how many from there up to `high`, within [0, count)."""
    start = mi.Int32(dr.ceil(dr.clip(low, 0.5, count + 0.5) - 0.5))
    stop = mi.Int32(dr.floor(dr.clip(high, -0.5, count - 0.5) - 0.5))
    return start, stop - start + 1


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


def rasterize(
    points: mi.Float,
    faces: mi.UInt32,
    face_count: int,
    view,
    *,
    limit: mi.Float | None = None,
    least: tuple[mi.Float, mi.Float] | None = None,
    drawn: mi.Bool | None = None,
    cull: Literal["", "back", "front"] = "",
) -> mi.UInt32:
    """The nearest triangle at each pixel centre, to be asked by `winner_at` or `seen`; NONE where no triangle covers it.

    In the order in which the walk leaves them: row of the tile, then tile, then column of the tile.

    limit      Float [height * width]; only what is as near as this or farther is drawn: a stencil (-inf shuts a pixel) and a
               surface behind which everything lies (its own nearness)
    least      a second value, Float [vertices], linear on the screen, and Float [height * width]; only what has it at
               least that large is drawn
    drawn      Bool [face_count]; the triangles to draw; all if None
    cull       "back": drop triangles marked CLOSED that turn their clockwise side to the eye; "front": drop all that turn
               their counter-clockwise side to it

    Waits for the device once, to learn how long the lists are; not for use inside `dr.freeze`.
    """
    values, floor = least if least is not None else (None, None)
    packed, boxes, ends = _prepared(points, faces, face_count, view, drawn, cull, values)
    total = int(ends[face_count - 1])
    return _nearest(packed, boxes, ends, _roomy(total), face_count, view, limit, floor)


def _roomy(count: int) -> int:
    """`count` rounded up to three significant bits: a few sizes, so that few are recorded."""
    step = 1 << max(count.bit_length() - 3, 4)
    return max(-(-count // step), 1) * step


@frozen
def _prepared(points, faces, face_count: int, view, drawn, cull: str, values):
    """Per triangle four packets of setup (five with a second value), one of integers (first tile: column, row; tiles across,
    in all), and the running sum of the tiles."""
    triangle = dr.arange(mi.UInt32, face_count)
    t = setup(points, faces, triangle, view, mi.Bool(True) if drawn is None else drawn, cull, values)
    owns = sum(dr.select(edge.owns, 1 << k, 0) for k, edge in enumerate(t.edges))
    numbers = [value for e in t.edges for value in (e.x, e.y, e.A, e.B)] + [t.g, t.gx, t.gy, mi.Float(owns)]
    if t.second is not None:
        numbers += [t.second.x, t.second.y, t.second.z, mi.Float(0)]
    packed = [dr.empty(mi.Float, 4 * face_count) for _ in range(len(numbers) // 4)]
    for k in range(len(packed)):
        dr.scatter(packed[k], mi.Vector4f(*numbers[4 * k : 4 * k + 4]), triangle)

    column, row = t.left // TILE_WIDTH, t.top // TILE_HEIGHT
    across = (t.left + t.columns - 1) // TILE_WIDTH - column + 1
    down = (t.top + t.rows - 1) // TILE_HEIGHT - row + 1
    tiles = dr.select((t.columns > 0) & (t.rows > 0), across * down, 0)
    boxes = dr.empty(mi.UInt32, 4 * face_count)
    dr.scatter(boxes, mi.Vector4u(mi.UInt32(column), mi.UInt32(row), mi.UInt32(across), mi.UInt32(tiles)), triangle)
    return packed, boxes, dr.prefix_reduce(dr.ReduceOp.Add, mi.UInt32(tiles), exclusive=False)


def _unpacked(packed: list, triangle: mi.UInt32) -> tuple[list[Edge], mi.Vector3f]:
    """The edges and the plane of nearness that `_prepared` stored."""
    q = [dr.gather(mi.Vector4f, packet, triangle) for packet in packed[:4]]
    owns = mi.UInt32(q[3].w)
    edges = [Edge(q[k].x, q[k].y, q[k].z, q[k].w, (owns & (1 << k)) != 0) for k in range(3)]
    return edges, mi.Vector3f(q[3].x, q[3].y, q[3].z)


@frozen
def _nearest(packed, boxes, ends, room: int, face_count: int, view, limit, floor):
    """Lists per tile, then the walk. `room`: at least as many as there are pairs of a triangle and a tile of its box."""
    # Whose pair: every triangle marks its first, and a running maximum spreads the marks.
    triangle = dr.arange(mi.UInt32, face_count)
    tiles = dr.gather(mi.UInt32, boxes, 4 * triangle + 3)
    owner = dr.zeros(mi.UInt32, room)
    dr.scatter(owner, triangle, ends - tiles, tiles > 0)
    owner = dr.prefix_reduce(dr.ReduceOp.Max, owner, exclusive=False)

    # Every pair that the edges do not exclude goes to the front of its tile's list.
    tiles_across = -(-view.width // TILE_WIDTH)
    tile_count = tiles_across * -(-view.height // TILE_HEIGHT)
    pair = dr.arange(mi.UInt32, room)
    box = dr.gather(mi.Vector4u, boxes, owner)
    number = pair - (dr.gather(mi.UInt32, ends, owner) - box.w)
    down = number // dr.maximum(box.z, 1)  # a vector's idle lanes must not divide by zero either
    column, row = box.x + number - down * box.z, box.y + down
    reached = number < box.w
    for edge in _unpacked(packed, owner)[0]:
        reached &= edge.reaches(mi.Float(column * TILE_WIDTH) + 0.5, mi.Float(row * TILE_HEIGHT) + 0.5)
    first = dr.full(mi.UInt32, NONE, tile_count * HEAD_SPACING)
    following = dr.scatter_exch(first, pair, (row * tiles_across + column) * HEAD_SPACING, reached)
    dr.eval(first, following)
    return _walk(packed, owner, first, following, tiles_across, tile_count, view, limit, floor)


@dr.syntax
def _walk(packed, owner, first, following, tiles_across: int, tile_count: int, view, limit, floor):
    """16 lanes per tile, a column of pixels each: the nearest of the tile's triangles at every pixel."""
    lane = dr.arange(mi.UInt32, tile_count * TILE_WIDTH)
    tile = lane // TILE_WIDTH
    down = tile // tiles_across
    column = (tile - down * tiles_across) * TILE_WIDTH + (lane - tile * TILE_WIDTH)
    top = down * TILE_HEIGHT
    px, py = mi.Float(column) + 0.5, mi.Float(top) + 0.5
    pixel = top * view.width + column
    inside = [(column < view.width) & (top + k < view.height) for k in range(TILE_HEIGHT)]
    nowhere = depths.nowhere(view)
    limits = [dr.select(inside[k], dr.rcp(view.near) + nowhere, nowhere) for k in range(TILE_HEIGHT)]
    if dr.hint(limit is not None, mode="scalar"):
        for k in range(TILE_HEIGHT):
            limits[k] = dr.minimum(limits[k], dr.gather(mi.Float, limit, pixel + k * view.width, inside[k]))
    open_ = limits[0] > nowhere
    for k in range(1, TILE_HEIGHT):
        open_ |= limits[k] > nowhere

    floors = []
    if dr.hint(floor is not None, mode="scalar"):
        floors = [dr.gather(mi.Float, floor, pixel + k * view.width, inside[k]) for k in range(TILE_HEIGHT)]

    nearest = [mi.Float(nowhere) for _ in range(TILE_HEIGHT)]
    winner = [mi.UInt32(NONE) for _ in range(TILE_HEIGHT)]
    node = dr.gather(mi.UInt32, first, tile * HEAD_SPACING)
    while dr.hint((node != NONE) & open_, label="walk the triangles of a tile"):
        triangle = dr.gather(mi.UInt32, owner, node)
        node = dr.gather(mi.UInt32, following, node)
        edges, plane = _unpacked(packed, triangle)
        across = [(px - edge.x) * edge.A for edge in edges]
        least = [dr.select(edge.owns, 0, OPEN_END) for edge in edges]
        g0 = dr.fma(plane.y, px, plane.x)
        second, v0 = mi.Vector4f(0), mi.Float(0)
        if dr.hint(floor is not None, mode="scalar"):
            second = dr.gather(mi.Vector4f, packed[4], triangle)
            v0 = dr.fma(second.y, px, second.x)
        for k in range(TILE_HEIGHT):
            y = py + k
            hit = mi.Bool(True)
            for i in range(3):
                hit &= (y - edges[i].y) * edges[i].B + across[i] >= least[i]
            g = dr.fma(plane.z, y, g0)
            hit &= (g <= limits[k]) & ((g > nearest[k]) | ((g == nearest[k]) & (triangle < winner[k])))
            if dr.hint(floor is not None, mode="scalar"):
                hit &= dr.fma(second.z, y, v0) >= floors[k]
            nearest[k] = dr.select(hit, g, nearest[k])
            winner[k] = dr.select(hit, triangle, winner[k])
    return dr.concat(winner)


def winner_at(visibility: mi.UInt32, view, lane: mi.UInt32, active) -> mi.UInt32:
    """The number of the triangle that `rasterize` found nearest at pixel `lane`; 0 where not active."""
    row = lane // view.width
    column = lane - row * view.width
    across, down = -(-view.width // TILE_WIDTH), -(-view.height // TILE_HEIGHT)
    tile = (row // TILE_HEIGHT) * across + column // TILE_WIDTH
    place = (row % TILE_HEIGHT) * (across * down * TILE_WIDTH) + tile * TILE_WIDTH + column % TILE_WIDTH
    return dr.gather(mi.UInt32, visibility, place, active)


def ray_through(view, lane: mi.UInt32) -> mi.Vector3f:
    """Unnormalised direction through the centre of pixel `lane`; its length along the view axis is 1."""
    return view.axis + _aside(view, lane)


def _aside(view, lane: mi.UInt32) -> mi.Vector3f:
    """By how much the ray through pixel `lane` turns from `view.axis`."""
    row = lane // view.width
    column = lane - row * view.width
    return (mi.Float(column) + 0.5) * view.right + (mi.Float(row) + 0.5) * view.down


def barycentric(a: mi.Point3f, b: mi.Point3f, c: mi.Point3f, o: mi.Point3f, d: mi.Vector3f) -> mi.Vector3f:
    """Weights of the corners where the line through o along d meets the triangle a, b, c; not negative, sum 1.

    As precise as o is near the triangle: each weight is a volume of the line with edges (Moeller and Trumbore 1997), which are
    small where the triangle is, and not with corners as seen from an eye far away. For a line that misses by rounding, the
    weights are those of a point on the triangle's edge; without a volume, all are equal.
    """
    ab, ac, ao = b - a, c - a, o - a
    across = dr.cross(d, ac)
    volume = dr.dot(ab, across)
    of_b, of_c = dr.dot(ao, across), dr.dot(d, dr.cross(ao, ab))
    weights = dr.maximum(mi.Vector3f(volume - of_b - of_c, of_b, of_c) * dr.sign(volume), 0)
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


def met(points: mi.Float, faces: mi.UInt32, triangle: mi.UInt32, view, lane: mi.UInt32):
    """Where the ray through pixel `lane` meets a triangle: packet of the triangle, perspective-correct weights, the point."""
    face, corner = corners(points, faces, triangle, mi.Bool(True))
    a, b, c = (mi.Point3f(q.x, q.y, q.z) for q in corner)
    aside = _aside(view, lane)
    weights = barycentric(a, b, c, view.origin + view.depth * aside, view.axis + aside)
    return face, weights, weights.x * a + weights.y * b + weights.z * c


def seen(points: mi.Float, faces: mi.UInt32, visibility: mi.UInt32, view, lane: mi.UInt32, active: mi.Bool | bool = True):
    """What `rasterize` found at pixel `lane`: whether a triangle covers it, then what `met` returns."""
    triangle = winner_at(visibility, view, lane, active)
    hit = (triangle != NONE) & active
    return hit, *met(points, faces, dr.select(hit, triangle, 0), view, lane)
