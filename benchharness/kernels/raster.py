"""Rasterizer: triangles -> which one is nearest at each pixel centre, and where on it.

The picture is cut into tiles of 16 x 8 pixels. Every triangle is put on the list of each tile that its box reaches and its
edges do not exclude; then 16 lanes walk a tile's list together, each with a column of 8 pixels whose nearest triangles so
far stay in registers. No lane waits for another's large triangle, and no pixel is written twice: a buffer of 64-bit keys,
reduced by atomic minima, spent most of its time on the atomics (of 16 ms, at three layers of overdraw).

What is inside of a triangle, and how near it is, `kernels.trianglesetup` says. Equal depths go to the lower number: the
result does not depend on the order in which lanes run.

Layout. `points` holds 4 floats per vertex (x, y, z and one that is ignored here), `faces` 4 integers per triangle (three
vertices and one whose highest bit, CLOSED, marks triangles whose back is never seen): one packet each.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels import depths, packets
from benchharness.kernels.frozen import frozen, roomy
from benchharness.kernels.trianglesetup import CLOSED as CLOSED
from benchharness.kernels.trianglesetup import Cull, DrawCall, Edge, setup
from benchharness.kernels.types import View

TILE_WIDTH, TILE_HEIGHT = 16, 8  # pixels: a vector of lanes across, what fits the registers down
HEAD_SPACING = 16  # heads of lists lie a cache line apart: two cores that add to two lists do not share one
NONE = 0xFFFF_FFFF  # no triangle; end of a list
OPEN_END = 1.2e-38  # smallest normal float: what an edge that does not own its points asks of its function


@dataclass
class PixelTests:
    """What a triangle has to pass at each pixel, besides being inside; None where nothing is asked.

    limit  float [height * width]: its nearness is at most that
    floor  float [height * width]: its second value is at least that
    layer  uint [height * width]: its layer is that
    order  what nearness is here; None for that of `kernels.depths`
    """

    limit: mi.Float | None
    floor: mi.Float | None
    layer: mi.UInt32 | None
    order: depths.Order | None = None


@dataclass
class Packed:
    """Triangles that are set up.

    planes  four buffers of packets: edge function x, y, A, B of each edge; plane of nearness, and who owns the edges and eight
            times the layer. A fifth with the plane of the second value, if there is one
    boxes   packets of integers: column and row of the first tile, tiles across, tiles in all
    ends    running sum of the tiles
    """

    planes: list[mi.Float]
    boxes: mi.UInt32
    ends: mi.UInt32


@dataclass
class TileLists:
    """Linked lists of triangles, one per tile.

    first      its first node, HEAD_SPACING apart; NONE for an empty list
    following  of each node, NONE at the end
    owner      which triangle a node is
    """

    first: mi.UInt32
    following: mi.UInt32
    owner: mi.UInt32


def rasterize(
    points: mi.Float,
    faces: mi.UInt32,
    face_count: int,
    view: View,
    *,
    limit: mi.Float | None = None,
    least: tuple[mi.Float, mi.Float] | None = None,
    layers: tuple[mi.UInt32, mi.UInt32] | None = None,
    drawn: mi.Bool | None = None,
    cull: Cull = "",
    order: depths.Order | None = None,
) -> mi.UInt32:
    """The nearest triangle at each pixel centre, to be asked by `winner_at` or `seen`; NONE where no triangle covers it.

    In the order in which the walk leaves them: row of the tile, then tile, then column of the tile.

    limit      Float [height * width]; only what is as near as this or farther is drawn: a stencil (-inf shuts a pixel) and a
               surface behind which everything lies (its own nearness)
    least      a second value, Float [vertices], linear on the screen, and Float [height * width]; only what has it at
               least that large is drawn
    layers     UInt32 [face_count] and UInt32 [height * width], below 2^20: what is drawn where; in every layer for None
    drawn      Bool [face_count]; the triangles to draw; all if None
    cull       "back": drop triangles marked CLOSED that turn their clockwise side to the eye; "front": drop all that turn
               their counter-clockwise side to it
    order      what is sorted by, in place of nearness; `limit` is of the same kind

    Waits for the device once, to learn how long the lists are; not for use inside `dr.freeze`.
    """
    values, floor = least if least is not None else (None, None)
    layer, shown_layer = layers if layers is not None else (None, None)
    triangles = _packed(DrawCall(points, faces, face_count, view, drawn, cull, values, order), layer)
    pairs = int(triangles.ends[face_count - 1])
    return _nearest(triangles, roomy(pairs), face_count, view, PixelTests(limit, floor, shown_layer, order))


@frozen
def _packed(draw: DrawCall, layer: mi.UInt32 | None) -> Packed:
    """Sets all triangles up."""
    t = setup(draw)
    owns = mi.UInt32(sum(dr.select(edge.owns, 1 << k, 0) for k, edge in enumerate(t.edges)))
    if layer is not None:
        owns += 8 * layer
    values = [mi.Vector4f(e.x, e.y, e.A, e.B) for e in t.edges] + [mi.Vector4f(*t.plane, mi.Float(owns))]
    if t.second is not None:
        values.append(mi.Vector4f(*t.second, 0))

    column, row = t.left // TILE_WIDTH, t.top // TILE_HEIGHT
    across = (t.left + t.columns - 1) // TILE_WIDTH - column + 1
    down = (t.top + t.rows - 1) // TILE_HEIGHT - row + 1
    tiles = mi.UInt32(dr.select((t.columns > 0) & (t.rows > 0), across * down, 0))
    box = mi.Vector4u(mi.UInt32(column), mi.UInt32(row), mi.UInt32(across), tiles)
    return Packed(
        planes=[packets.stored(value, draw.count) for value in values],
        boxes=packets.stored(box, draw.count),
        ends=dr.prefix_reduce(dr.ReduceOp.Add, tiles, exclusive=False),
    )


def _unpacked(planes: list[mi.Float], triangle: mi.UInt32) -> tuple[list[Edge], mi.Vector3f, mi.UInt32]:
    """The edges, the plane of nearness and the layer of a triangle."""
    q = [dr.gather(mi.Vector4f, packet, triangle) for packet in planes[:4]]
    owns = mi.UInt32(q[3].w)
    edges = [Edge(q[k].x, q[k].y, q[k].z, q[k].w, (owns & (1 << k)) != 0) for k in range(3)]
    return edges, mi.Vector3f(q[3].x, q[3].y, q[3].z), owns >> 3


def _reaches(edge: Edge, left: mi.Float, top: mi.Float) -> mi.Bool:
    """False only if all pixel centres of the tile whose first one is (left, top) are outside."""
    far_x = dr.select(edge.A > 0, left + (TILE_WIDTH - 1), left)
    far_y = dr.select(edge.B > 0, top + (TILE_HEIGHT - 1), top)
    return (far_y - edge.y) * edge.B + (far_x - edge.x) * edge.A >= 0


def _tiles(view: View) -> tuple[int, int]:
    """How many tiles there are across the picture, and in all."""
    across = -(-view.width // TILE_WIDTH)
    return across, across * -(-view.height // TILE_HEIGHT)


@frozen
def _nearest(triangles: Packed, room: int, face_count: int, view: View, tests: PixelTests) -> mi.UInt32:
    """Lists per tile, then the walk. `room`: at least as many as there are pairs of a triangle and a tile of its box."""
    # Whose pair: every triangle marks its first, and a running maximum spreads the marks.
    triangle = dr.arange(mi.UInt32, face_count)
    tiles = dr.gather(mi.UInt32, triangles.boxes, 4 * triangle + 3)
    owner = dr.zeros(mi.UInt32, room)
    dr.scatter(owner, triangle, triangles.ends - tiles, tiles > 0)
    owner = dr.prefix_reduce(dr.ReduceOp.Max, owner, exclusive=False)

    # Every pair that the edges do not exclude goes to the front of its tile's list.
    tiles_across, tile_count = _tiles(view)
    pair = dr.arange(mi.UInt32, room)
    box = dr.gather(mi.Vector4u, triangles.boxes, owner)
    number = pair - (dr.gather(mi.UInt32, triangles.ends, owner) - box.w)
    down = number // dr.maximum(box.z, 1)  # a vector's idle lanes must not divide by zero either
    column, row = box.x + number - down * box.z, box.y + down
    reached = number < box.w
    for edge in _unpacked(triangles.planes, owner)[0]:
        reached &= _reaches(edge, mi.Float(column * TILE_WIDTH) + 0.5, mi.Float(row * TILE_HEIGHT) + 0.5)
    first = dr.full(mi.UInt32, NONE, tile_count * HEAD_SPACING)
    following = dr.scatter_exch(first, pair, (row * tiles_across + column) * HEAD_SPACING, reached)
    dr.eval(first, following)
    return _walk(triangles.planes, TileLists(first, following, owner), view, tests)


@dr.syntax
def _walk(planes: list[mi.Float], lists: TileLists, view: View, tests: PixelTests) -> mi.UInt32:
    """16 lanes per tile, a column of pixels each: the nearest of the tile's triangles at every pixel."""
    owner, following, floor, shown_layer = lists.owner, lists.following, tests.floor, tests.layer
    tiles_across, tile_count = _tiles(view)
    lane = dr.arange(mi.UInt32, tile_count * TILE_WIDTH)
    tile = lane // TILE_WIDTH
    down = tile // tiles_across
    column = (tile - down * tiles_across) * TILE_WIDTH + (lane - tile * TILE_WIDTH)
    top = down * TILE_HEIGHT
    px, py = mi.Float(column) + 0.5, mi.Float(top) + 0.5
    pixel = top * view.width + column
    inside = [(column < view.width) & (top + k < view.height) for k in range(TILE_HEIGHT)]

    # What each pixel asks for.
    order = depths.order(view) if tests.order is None else tests.order
    nowhere = order.last
    limits = [dr.select(inside[k], order.first, nowhere) for k in range(TILE_HEIGHT)]
    if dr.hint(tests.limit is not None, mode="scalar"):
        for k in range(TILE_HEIGHT):
            limits[k] = dr.minimum(limits[k], dr.gather(mi.Float, tests.limit, pixel + k * view.width, inside[k]))
    open_ = limits[0] > nowhere
    for k in range(1, TILE_HEIGHT):
        open_ |= limits[k] > nowhere
    floors = []
    if dr.hint(floor is not None, mode="scalar"):
        floors = [dr.gather(mi.Float, floor, pixel + k * view.width, inside[k]) for k in range(TILE_HEIGHT)]
    shown = []
    if dr.hint(shown_layer is not None, mode="scalar"):
        shown = [dr.gather(mi.UInt32, shown_layer, pixel + k * view.width, inside[k]) for k in range(TILE_HEIGHT)]

    nearest = [mi.Float(nowhere) for _ in range(TILE_HEIGHT)]  # of what passed so far, per pixel
    winner = [mi.UInt32(NONE) for _ in range(TILE_HEIGHT)]  # whose that is
    node = dr.gather(mi.UInt32, lists.first, tile * HEAD_SPACING)
    while dr.hint((node != NONE) & open_, label="walk the triangles of a tile"):
        triangle = dr.gather(mi.UInt32, owner, node)
        node = dr.gather(mi.UInt32, following, node)
        edges, plane, layer = _unpacked(planes, triangle)
        across = [(px - edge.x) * edge.A for edge in edges]
        least = [dr.select(edge.owns, 0, OPEN_END) for edge in edges]
        g0 = dr.fma(plane.y, px, plane.x)
        second, v0 = mi.Vector4f(0), mi.Float(0)
        if dr.hint(floor is not None, mode="scalar"):
            second = dr.gather(mi.Vector4f, planes[4], triangle)
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
            if dr.hint(shown_layer is not None, mode="scalar"):
                hit &= layer == shown[k]
            nearest[k] = dr.select(hit, g, nearest[k])
            winner[k] = dr.select(hit, triangle, winner[k])
    return dr.concat(winner)


def winner_at(visibility: mi.UInt32, view: View, lane: mi.UInt32, active: mi.Bool | bool) -> mi.UInt32:
    """The number of the triangle that `rasterize` found nearest at pixel `lane`; 0 where not active."""
    row = lane // view.width
    column = lane - row * view.width
    across, count = _tiles(view)
    tile = (row // TILE_HEIGHT) * across + column // TILE_WIDTH
    place = (row % TILE_HEIGHT) * (count * TILE_WIDTH) + tile * TILE_WIDTH + column % TILE_WIDTH
    return dr.gather(mi.UInt32, visibility, place, active)


def ray_through(view: View, lane: mi.UInt32) -> mi.Vector3f:
    """Unnormalised direction through the centre of pixel `lane`; its length along the view axis is 1."""
    return view.axis + _aside(view, lane)


def _aside(view: View, lane: mi.UInt32) -> mi.Vector3f:
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


def corners(points: mi.Float, faces: mi.UInt32, triangle: mi.UInt32, active: mi.Bool) -> tuple[mi.Vector4u, list[mi.Vector4f]]:
    """The packet of a triangle and those of its three vertices."""
    face = dr.gather(mi.Vector4u, faces, triangle, active)
    return face, [dr.gather(mi.Vector4f, points, i, active) for i in (face.x, face.y, face.z)]


def interpolate(values: mi.Float, face: mi.Vector4u, weights: mi.Vector3f, active: mi.Bool) -> mi.Vector4f:
    """The weighted sum of the packets of a triangle's vertices."""
    a, b, c = (dr.gather(mi.Vector4f, values, i, active) for i in (face.x, face.y, face.z))
    return a * weights.x + b * weights.y + c * weights.z


def met(
    points: mi.Float, faces: mi.UInt32, triangle: mi.UInt32, view: View, lane: mi.UInt32
) -> tuple[mi.Vector4u, mi.Vector3f, mi.Point3f]:
    """Where the ray through pixel `lane` meets a triangle: packet of the triangle, perspective-correct weights, the point."""
    face, corner = corners(points, faces, triangle, mi.Bool(True))
    a, b, c = (mi.Point3f(q.x, q.y, q.z) for q in corner)
    aside = _aside(view, lane)
    weights = barycentric(a, b, c, view.origin + view.depth * aside, view.axis + aside)
    return face, weights, weights.x * a + weights.y * b + weights.z * c


def seen(
    points: mi.Float, faces: mi.UInt32, visibility: mi.UInt32, view: View, lane: mi.UInt32, active: mi.Bool | bool = True
) -> tuple[mi.Bool, mi.Vector4u, mi.Vector3f, mi.Point3f]:
    """What `rasterize` found at pixel `lane`: whether a triangle covers it, then what `met` returns."""
    triangle = winner_at(visibility, view, lane, active)
    hit = (triangle != NONE) & active
    return hit, *met(points, faces, dr.select(hit, triangle, 0), view, lane)
