"""A city square: paving, roads, kerbs and the houses around. What stands and drives on it is in `scenes.props.street`.

The paved island is about the origin, x east, y north. A road of two lanes runs round it, a pavement along the houses
(`SQUARE`), and streets lead away to the west, the east (two) and the south. Paving and pavements are at z = 0, roads
`KERB` lower. Houses have the sides that can be seen from the square and from above it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from benchharness.scene import Mesh, Object, merged

from ..props.shapes import Colour, box, lathe, placed, sheet, steps, tiles, with_breaks

ISLAND = (-7.5, 7.5, -13.0, 7.0)
"""The paved island: x from, to, y from, to, metres."""
ROAD = (-13.5, 13.5, -19.0, 13.0)
"""The outer edge of the road around it."""
SQUARE = (-15.5, 15.5, -21.0, 15.0)
"""Where the houses stand."""
KERB = 0.12
EAST_END, SOUTH_END = 26.5, -32.0
"""Where streets end: x (west, negative) and y, metres."""

ASPHALT: Colour = (0.13, 0.13, 0.14)
PAINT: Colour = (0.75, 0.74, 0.70)
STONE: Colour = (0.52, 0.49, 0.44)
GLASS: Colour = (0.07, 0.10, 0.14)
WHITE: Colour = (0.80, 0.78, 0.73)
SLATE: Colour = (0.17, 0.19, 0.23)
CLAY: Colour = (0.50, 0.17, 0.09)


def ground(tile_m: float, road_m: float) -> list[Object]:
    """Paving of tiles of `tile_m`, roads and pavements with base vertices `road_m` apart."""
    x0, x1, y0, y1 = ISLAND
    up, x, y = (0, 0, -KERB), (1, 0, 0), (0, 1, 0)
    cut = lambda lo, hi, *breaks: with_breaks(lo, hi, road_m, breaks)  # noqa: E731
    road = merged(
        sheet(up, x, y, cut(*ROAD[:2], x0, x1), cut(*ROAD[2:], y0, y1), ASPHALT, hole=ISLAND),
        *(sheet(up, x, y, cut(*span[:2]), cut(*span[2:]), ASPHALT) for span in STREETS),
    )
    lines = [
        (x0 - 3.0, y0 - 3.0, y1 + 3.0, 1),
        (x1 + 3.0, y0 - 3.0, y1 + 3.0, 1),
        (y0 - 3.0, x0 - 2.0, x1 + 2.0, 0),
        (y1 + 3.0, x0 - 2.0, x1 + 2.0, 0),
    ]
    dashes = [_dash(across, s, along) for across, lo, hi, along in lines for s in np.arange(lo + 0.6, hi - 1.8, 2.9)]
    dashes += [_dash(y1 + 3.0, s, 0) for side in (-1, 1) for s in side * np.arange(16.0, 25.0, 2.9)]
    stripes = [
        sheet((0, 0, 0.008 - KERB), x, y, [x0 - 5.7, x0 - 0.3], [s, s + 0.5], PAINT) for s in np.arange(-12.0, -8.0, 1.0)
    ]
    kerb = [_edge((x0, y0), (x1, y0)), _edge((x1, y0), (x1, y1)), _edge((x1, y1), (x0, y1)), _edge((x0, y1), (x0, y0))]
    return [
        Object(
            "paving",
            _mosaic(tile_m),
            "rings and rays of coloured stone right under the saucer, where the mirror bends them most",
        ),
        Object("kerb", merged(*kerb), "the island's edge, a step down to the road"),
        Object("road", road, "the dark ground on which the trucks stand out"),
        Object("road-lines", merged(*dashes, *stripes), "dashes in straight rows and a crossing, bent by the mirror"),
        Object(
            "pavements",
            merged(*(_pavement(*p, road_m) for p in PAVEMENTS)),
            "a pale band with a kerb along the houses, broken by the streets",
        ),
    ]


STREETS = (
    (-EAST_END, ROAD[0], 7.0, 13.0),
    (ROAD[1], EAST_END, 7.0, 13.0),
    (ROAD[1], EAST_END, -19.0, -13.0),
    (-13.5, -7.5, SOUTH_END, ROAD[2]),
)
"""Road surfaces beside the ring: x from, to, y from, to."""

PAVEMENTS = (
    (-EAST_END, EAST_END, 13.0, 15.0),
    (-15.5, -13.5, SOUTH_END, 6.0),
    (-15.5, -13.5, 6.0, 7.0),
    (-EAST_END, -15.5, 6.0, 7.0),
    (13.5, 15.5, -12.0, 6.0),
    (13.5, EAST_END, 6.0, 7.0),
    (13.5, EAST_END, -13.0, -12.0),
    (-6.5, EAST_END, -21.0, -19.0),
    (-7.5, -6.5, SOUTH_END, -19.0),
)


def _pavement(x0: float, x1: float, y0: float, y1: float, spacing: float) -> Mesh:
    return box((x0, y0, -KERB), (x1, y1, 0), STONE, "-z", spacing)


def _dash(across: float, start: float, along: int) -> Mesh:
    lo, hi = np.array([start, across - 0.07]), np.array([start + 1.5, across + 0.07])
    if along == 1:
        lo, hi = lo[::-1], hi[::-1]
    return sheet((0, 0, 0.008 - KERB), (1, 0, 0), (0, 1, 0), [lo[0], hi[0]], [lo[1], hi[1]], PAINT)


def _edge(start: tuple[float, float], end: tuple[float, float]) -> Mesh:
    """A kerb along `start` to `end`, whose face looks to the right of the way."""
    way = np.subtract(end, start)
    return sheet(
        (*start, -KERB),
        (*(way / np.linalg.norm(way)), 0),
        (0, 0, 1),
        steps(0, float(np.linalg.norm(way)), 2.5),
        [0, KERB],
        STONE,
    )


def _mosaic(tile_m: float) -> Mesh:
    """The island's stones: a round rosette about the landing place, square slabs south of it."""
    x0, x1, y0, y1 = ISLAND
    south = -y1
    counts = (max(1, round((x1 - x0) / tile_m)), max(1, round((south - y0) / tile_m)))
    slab = max(1, round(1.0 / tile_m))
    odd = (np.add.outer(np.arange(counts[1]) // slab, np.arange(counts[0]) // slab) % 2)[..., None]
    rng = np.random.default_rng(5)
    colour = np.where(odd, DIM, PALE) * rng.uniform(0.92, 1.08, (counts[1], counts[0], 1))
    return merged(_rosette(tile_m, rng), tiles((x0, y0, 0), (x1 - x0, 0, 0), (0, south - y0, 0), counts, colour))


PALE, DIM = (0.58, 0.54, 0.47), (0.44, 0.41, 0.36)
SANDSTONE, RUST, BASALT = (0.66, 0.58, 0.44), (0.46, 0.18, 0.10), (0.15, 0.17, 0.21)
BANDS = ((0.5, 1.5, RUST, RUST), (1.5, 4.3, BASALT, SANDSTONE), (4.3, 5.3, SANDSTONE, SANDSTONE), (5.3, 6.4, RUST, RUST))
"""Of the rosette: radius from, to, and the colours of its rays in turn."""
RAYS = 16


def _rosette(tile_m: float, rng: np.random.Generator) -> Mesh:
    """Rings of stones about the origin, and what fills the island up to its edges; each stone a quad of its own."""
    sectors = RAYS * max(1, round(2 * np.pi * 3.5 / RAYS / tile_m))
    a = np.arange(sectors + 1) * (2 * np.pi / sectors)
    circle = np.stack([np.cos(a), np.sin(a)], axis=1)
    rim = circle / abs(circle).max(axis=1, keepdims=True) * [ISLAND[1], ISLAND[3]]
    ray = np.arange(sectors) * RAYS // sectors % 2
    rings, colours = [BANDS[0][0] * circle], []
    for inner, outer, one, other in BANDS:
        for r in steps(inner, outer, 1.2 * tile_m)[1:]:
            rings.append(r * circle)
            colours.append(np.where(ray[:, None], one, other))
    fill = steps(0.0, 1.0, 1.2 * tile_m / 2.0)[1:]
    for t in fill:
        rings.append((1 - t) * BANDS[-1][1] * circle + t * rim)
        colours.append(np.broadcast_to(PALE, (sectors, 3)))
    p = np.pad(np.stack(rings), ((0, 0), (0, 0), (0, 1)))  # [rings, sectors + 1, 3]
    quads = np.stack([p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:]], axis=2).reshape(-1, 3)
    albedo = np.repeat((np.stack(colours) * rng.uniform(0.92, 1.08, (len(colours), sectors, 1))).reshape(-1, 3), 4, axis=0)
    first = 4 * np.arange(len(quads) // 4)[:, None]
    faces = np.concatenate([np.add(first, [0, 1, 2]), np.add(first, [0, 2, 3])])
    stones = Mesh(quads, faces, np.tile([0.0, 0.0, 1.0], (len(quads), 1)), albedo)
    return merged(lathe([(BANDS[0][0], 0), (0, 0)], sectors // 2, BASALT), stones)


@dataclass(frozen=True)
class House:
    """A house: where its front begins, which way it faces, and what it looks like.

    at       corner of the front on the ground, x and y; the front runs from there along `turn_deg`
    turn_deg 0 faces south, 90 east, 180 north, -90 west
    width    of the front, metres
    floors, columns   of windows above the ground floor
    roof     "pitched" with the ridge along the front, "flat" with a parapet
    shop     colour of the awning over the ground floor; None for a plain ground floor with a door
    sides    side walls that face a street and get windows: "", "l", "r"
    bare     side walls that rise above a lower neighbour
    plain    down a street: without sills and without a ledge over the ground floor
    """

    at: tuple[float, float]
    turn_deg: float
    width: float
    wall: Colour
    floors: int = 3
    columns: int = 4
    roof: Literal["pitched", "flat"] = "pitched"
    tile: Colour = SLATE
    shop: Colour | None = None
    trim: Colour = WHITE
    sides: str = ""
    bare: str = ""
    depth: float = 10.0
    plain: bool = False


GROUND_M, FLOOR_M, PARAPET_M = 3.8, 3.1, 0.6
"""Height of the ground floor, of the floors above it and of the wall before a flat roof."""
CHIMNEY: Colour = (0.36, 0.16, 0.11)


def house(h: House, wall_m: float, *, sills: bool) -> Mesh:
    """Base vertices of the walls are `wall_m` apart. Backs and party walls, which nobody sees, are left out."""
    top = GROUND_M + FLOOR_M * h.floors + (PARAPET_M if h.roof == "flat" else 0.0)
    zs, ys = with_breaks(0, top, wall_m, [GROUND_M]), steps(0, h.depth, wall_m)
    y, z = (0, 1.0, 0), (0, 0, 1.0)
    parts = [
        sheet((0, 0, 0), (1, 0, 0), z, steps(0, h.width, wall_m), zs, h.wall),
        box((-0.1, -0.32, top - 0.25), (h.width + 0.1, 0, top + 0.1), h.trim, "+y", wall_m),
    ]
    if not h.plain:
        parts.append(box((-0.03, -0.12, GROUND_M - 0.1), (h.width + 0.03, 0, GROUND_M + 0.1), h.trim, "+y", wall_m))
    if "r" in h.sides + h.bare:
        parts.append(sheet((h.width, 0, 0), y, z, ys, zs, h.wall))
    if "l" in h.sides + h.bare:
        parts.append(sheet((0, h.depth, 0), (0, -1.0, 0), z, ys, zs, h.wall))
    if h.roof == "pitched":
        parts += _roof(h, top, wall_m)

    sills = sills and not h.plain
    pitch = h.width / h.columns
    for f in range(h.floors):
        sill_z = GROUND_M + FLOOR_M * f + 0.75
        parts += [placed(_window(h.trim, sill=sills), (pitch * (c + 0.5), 0, sill_z)) for c in range(h.columns)]
        count = max(2, int(h.depth / 3.2))
        for side in h.sides:
            turn, corner = (90.0, (h.width, 0.0)) if side == "r" else (-90.0, (0.0, h.depth))
            row = [placed(_window(h.trim, sill=False), (h.depth * (c + 0.5) / count, 0, sill_z)) for c in range(count)]
            parts += [placed(window, (*corner, 0), turn) for window in row]
    parts += _ground_floor(h, pitch, sills=sills)
    return placed(merged(*parts), (*h.at, 0), h.turn_deg)


def _window(trim: Colour, *, sill: bool) -> Mesh:
    """A window on the plane y = 0 that looks to -y, standing on z = 0: a raised frame, a pane or two over a sill."""
    w, t = 1.05, 1.6
    frame = _panel(-0.5 * w - 0.12, 0.5 * w + 0.12, -0.02, t + 0.12, 0.03, trim)
    if not sill:
        return merged(frame, _panel(-0.5 * w, 0.5 * w, 0.08, t, 0.045, GLASS))
    panes = [_panel(side * 0.275 - 0.235, side * 0.275 + 0.235, 0.05, t, 0.045, GLASS) for side in (-1, 1)]
    return merged(frame, *panes, box((-0.5 * w - 0.2, -0.16, -0.12), (0.5 * w + 0.2, 0, 0), trim, "+y"))


def _panel(x0: float, x1: float, z0: float, z1: float, out: float, colour: Colour) -> Mesh:
    """A flat rectangle `out` metres before the plane y = 0, facing -y."""
    return sheet((0, -out, 0), (1, 0, 0), (0, 0, 1), [x0, x1], [z0, z1], colour)


def _ground_floor(h: House, pitch: float, *, sills: bool) -> list[Mesh]:
    """A door, and windows or shop windows under striped awnings."""
    middle = h.columns // 2
    door = pitch * (middle + 0.5)
    out = [
        _panel(door - 0.75, door + 0.75, 0, 2.75, 0.03, h.trim),
        _panel(door - 0.58, door + 0.58, 0, 2.62, 0.05, h.tile if h.shop is None else h.shop),
    ]
    for c in [c for c in range(h.columns) if c != middle]:
        at = pitch * (c + 0.5)
        if h.shop is None:
            out.append(placed(_window(h.trim, sill=sills), (at, 0, 1.0)))
            continue
        half, count = 0.5 * pitch - 0.25, 5
        stripes = np.array([[h.shop if k % 2 == 0 else WHITE for k in range(count)]])
        corner, across, drop = (at - half, -1.0, 2.6), (2 * half, 0, 0), (0, 0.97, 0.62)
        below = sheet((at - half, -0.03, 3.19), (1, 0, 0), (0, -0.97, -0.62), [0, 2 * half], [0, 1], (0.4, 0.38, 0.35))
        out += [
            _panel(at - half, at + half, 0.5, 2.7, 0.03, h.trim),
            _panel(at - half + 0.1, at + half - 0.1, 0.62, 2.6, 0.05, GLASS),
            tiles(corner, across, drop, (count, 1), stripes),
            tiles((at - half, -1.0, 2.4), across, (0, 0, 0.2), (count, 1), stripes),
            below,
        ]
    return out


def _roof(h: House, top: float, wall_m: float) -> list[Mesh]:
    """The slope to the street, two chimneys; gable and other slope where a side is seen."""
    half, rise, eave = 0.5 * h.depth, 0.42 * h.depth, 0.35
    length = float(np.hypot(half, rise))
    slope = np.array([0.0, half, rise]) / length
    xs, ts = steps(-0.1, h.width + 0.1, wall_m), steps(0.0, length + eave, wall_m)
    front = sheet((0, -eave * slope[1], top - eave * slope[2] + 0.12), (1, 0, 0), slope, xs, ts, h.tile)
    parts = [
        front,
        *(box((u, 1.7, top + 0.8), (u + 0.7, 2.5, top + 3.3), CHIMNEY, "-z") for u in (0.12 * h.width, 0.7 * h.width)),
    ]
    corners = np.array([[0, 0, top], [0, h.depth, top], [0, half, top + rise]])
    gable = Mesh(corners, np.array([[0, 2, 1]]), np.tile([-1.0, 0.0, 0.0], (3, 1)), h.wall)
    if "l" in h.sides + h.bare:
        parts.append(gable)
    if "r" in h.sides + h.bare:
        parts.append(Mesh(np.add(gable.vertices, [h.width, 0, 0]), gable.faces[:, ::-1], -gable.normals, h.wall))
    if h.sides + h.bare:
        turn = [1, -1, 1]
        parts.append(Mesh(front.vertices * turn + [0, h.depth, 0], front.faces[:, ::-1], front.normals * turn, h.tile))
    return parts


OCHRE: Colour = (0.72, 0.48, 0.18)
ROSE: Colour = (0.70, 0.36, 0.30)
CREAM: Colour = (0.76, 0.68, 0.52)
BRICK: Colour = (0.42, 0.15, 0.10)
MINT: Colour = (0.42, 0.56, 0.44)
SKY: Colour = (0.34, 0.46, 0.60)
SAND: Colour = (0.66, 0.55, 0.40)
GREY: Colour = (0.48, 0.48, 0.47)

NORTH = (
    House((-15.5, 15), 0, 10, OCHRE, 3, 4, "pitched", CLAY, (0.55, 0.07, 0.06)),
    House((-5.5, 15), 0, 11, CREAM, 4, 5, "flat", SLATE, (0.06, 0.25, 0.12), bare="lr"),
    House((5.5, 15), 0, 10, ROSE, 3, 4, "pitched", SLATE),
    House((-EAST_END, 15), 0, 11, GREY, 3, 4, "pitched", SLATE, plain=True),
    House((15.5, 15), 0, 11, SKY, 3, 4, "pitched", CLAY, plain=True),
)
WEST = (
    House((-15.5, -21), 90, 9, BRICK, 4, 3, "flat", SLATE, (0.75, 0.52, 0.10), bare="lr"),
    House((-15.5, -12), 90, 9, SAND, 3, 4, "pitched", CLAY),
    House((-15.5, -3), 90, 9, SKY, 3, 3, "pitched", SLATE, (0.08, 0.18, 0.42), sides="r"),
    House((-15.5, SOUTH_END), 90, 11, GREY, 3, 4, "pitched", SLATE, plain=True),
    House((-EAST_END, 4), 90, 12, MINT, 3, 4, "pitched", CLAY, plain=True),
)
EAST = (
    House((15.5, 6), -90, 9, MINT, 3, 3, "pitched", CLAY, sides="l"),
    House((15.5, -3), -90, 9, BRICK, 4, 4, "flat", SLATE, (0.80, 0.78, 0.72), sides="r", bare="l"),
    House((EAST_END, 16), -90, 12, OCHRE, 3, 4, "pitched", SLATE, plain=True),
    House((EAST_END, -10), -90, 12, ROSE, 3, 4, "pitched", CLAY, plain=True),
)
SOUTH = (
    House((15.5, -21), 180, 11, OCHRE, 3, 4, "pitched", CLAY, (0.08, 0.22, 0.42)),
    House((4.5, -21), 180, 11, ROSE, 4, 4, "flat", SLATE, (0.55, 0.07, 0.06), sides="r", bare="l"),
    House((EAST_END, -21), 180, 11, CREAM, 3, 4, "pitched", SLATE, plain=True),
    House((-5.0, SOUTH_END), 180, 11, CREAM, 4, 4, "pitched", CLAY, plain=True),
)


def houses(wall_m: float, *, sills: bool) -> list[Object]:
    """All houses, by the side of the square."""
    rows = {
        "north": (NORTH, "coloured fronts behind the saucer: their rows of windows meet its outline directly"),
        "west": (WEST, "fronts at the left, seen in the hull as a narrow bent strip"),
        "east": (EAST, "fronts at the right and the ends of two streets"),
        "south": (SOUTH, "fronts behind the camera: the middle of the hull mirrors them"),
    }
    return [
        Object(f"houses-{side}", merged(*(house(h, wall_m, sills=sills) for h in row)), shows)
        for side, (row, shows) in rows.items()
    ]
