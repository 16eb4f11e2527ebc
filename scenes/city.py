"""A city square: paving, roads, kerbs and the houses around. What stands and drives on it is in `scenes.street`.

The paved island is about the origin, x east, y north. A road of two lanes runs round it, a pavement along the houses
(`SQUARE`), and streets lead away to the west, the east (two) and the south. Paving and pavements are at z = 0, roads
`KERB` lower. Houses have the sides that can be seen from the square and from above it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from benchharness.scene import Mesh, Object, merged
from scenes.shapes import Colour, bar, box, placed, sheet, steps, tiles, with_breaks

ISLAND = (-7.5, 7.5, -13.0, 7.0)
"""The paved island: x from, to, y from, to, metres."""
ROAD = (-13.5, 13.5, -19.0, 13.0)
"""The outer edge of the road around it."""
SQUARE = (-15.5, 15.5, -21.0, 15.0)
"""Where the houses stand."""
KERB = 0.12
FAR = 38.0
"""Where streets end, metres from the origin."""

ASPHALT: Colour = (0.13, 0.13, 0.14)
PAINT: Colour = (0.75, 0.74, 0.70)
STONE: Colour = (0.52, 0.49, 0.44)
GLASS: Colour = (0.07, 0.10, 0.14)
WHITE: Colour = (0.80, 0.78, 0.73)
SLATE: Colour = (0.17, 0.19, 0.23)
CLAY: Colour = (0.50, 0.17, 0.09)
COPPER: Colour = (0.24, 0.45, 0.37)


def ground(tile_m: float, road_m: float) -> list[Object]:
    """Paving of tiles of `tile_m`, roads and pavements with base vertices `road_m` apart."""
    x0, x1, y0, y1 = ISLAND
    up, x, y = (0, 0, -KERB), (1, 0, 0), (0, 1, 0)
    cut = lambda lo, hi, *breaks: with_breaks(lo, hi, road_m, breaks)  # noqa: E731
    road = merged(
        sheet(up, x, y, cut(*ROAD[:2], x0, x1), cut(*ROAD[2:], y0, y1), ASPHALT, hole=ISLAND),
        *(sheet(up, x, y, cut(*span[:2]), cut(*span[2:]), ASPHALT) for span in STREETS),
    )
    lines = [(x0 - 3.0, y0 - 3.0, y1 + 3.0, 1), (x1 + 3.0, y0 - 3.0, y1 + 3.0, 1),
             (y0 - 3.0, x0 - 2.0, x1 + 2.0, 0), (y1 + 3.0, x0 - 2.0, x1 + 2.0, 0)]  # fmt: skip
    dashes = [_dash(across, s, along) for across, lo, hi, along in lines for s in np.arange(lo + 0.6, hi - 1.8, 2.9)]
    dashes += [_dash(y1 + 3.0, s, 0) for side in (-1, 1) for s in side * np.arange(18.0, 34.0, 2.9)]
    stripes = [sheet((0, 0, 0.008 - KERB), x, y, [x0 - 5.7, x0 - 0.3][::1], [s, s + 0.5], PAINT)
               for s in np.arange(-12.0, -8.0, 1.0)]  # fmt: skip
    kerb = [_edge((x0, y0), (x1, y0)), _edge((x1, y0), (x1, y1)), _edge((x1, y1), (x0, y1)), _edge((x0, y1), (x0, y0))]
    return [
        Object("paving", _mosaic(tile_m),
               "rings and rays of coloured stone right under the saucer, where the mirror bends them most"),
        Object("kerb", merged(*kerb), "the island's edge, a step down to the road"),
        Object("road", road, "the dark ground on which the trucks stand out"),
        Object("road-lines", merged(*dashes, *stripes), "dashes in a straight row and a crossing: their rows bend in the mirror"),
        Object("pavements", merged(*(_pavement(*p, road_m) for p in PAVEMENTS)),
               "a pale band with a kerb along the houses, broken by the streets"),
    ]  # fmt: skip


STREETS = (
    (-FAR, ROAD[0], 7.0, 13.0),
    (ROAD[1], FAR, 7.0, 13.0),
    (ROAD[1], FAR, -19.0, -13.0),
    (-13.5, -7.5, -FAR, ROAD[2]),
)
"""Road surfaces beside the ring: x from, to, y from, to."""

PAVEMENTS = (
    (-FAR, FAR, 13.0, 15.0),
    (-15.5, -13.5, -FAR, 6.0),
    (-15.5, -13.5, 6.0, 7.0),
    (-FAR, -15.5, 6.0, 7.0),
    (13.5, 15.5, -12.0, 6.0),
    (13.5, FAR, 6.0, 7.0),
    (13.5, FAR, -13.0, -12.0),
    (-6.5, FAR, -21.0, -19.0),
    (-7.5, -6.5, -FAR, -19.0),
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
    return sheet((*start, -KERB), (*(way / np.linalg.norm(way)), 0), (0, 0, 1), steps(0, float(np.linalg.norm(way)), 2.5),
                 [0, KERB], STONE)  # fmt: skip


def _mosaic(tile_m: float) -> Mesh:
    """The island's tiles: a rosette of rings and rays around the landing place on a ground of warm grey."""
    x0, x1, y0, y1 = ISLAND
    counts = (round((x1 - x0) / tile_m), round((y1 - y0) / tile_m))
    x = x0 + (np.arange(counts[0]) + 0.5) * (x1 - x0) / counts[0]
    y = (y0 + (np.arange(counts[1]) + 0.5) * (y1 - y0) / counts[1])[:, None]
    r, a = np.hypot(x, y), np.degrees(np.arctan2(y, x))
    cream, rust, dark = np.array([0.66, 0.58, 0.44]), np.array([0.45, 0.19, 0.11]), np.array([0.17, 0.19, 0.22])
    chequer = (np.add.outer(np.arange(counts[1]) // max(1, round(1 / tile_m)),
                            np.arange(counts[0]) // max(1, round(1 / tile_m))) % 2)[..., None]  # fmt: skip
    colour = np.where(chequer, [0.44, 0.41, 0.36], [0.58, 0.54, 0.47])
    ring = r[..., None]
    colour = np.where(ring < 6.3, cream, colour)
    colour = np.where((ring < 6.3) & (ring > 5.3), rust, colour)
    ray = (np.floor((a + 15.0) / 30.0) % 2 == 0)[..., None]
    colour = np.where((ring < 4.3) & ray, dark, colour)
    colour = np.where(ring < 1.4, rust, colour)
    colour = colour * np.random.default_rng(5).uniform(0.9, 1.1, (*colour.shape[:2], 1))
    return tiles((x0, y0, 0), (x1 - x0, 0, 0), (0, y1 - y0, 0), counts, colour)


@dataclass(frozen=True)
class House:
    """A house: where its front begins, which way it faces, and what it looks like.

    at       corner of the front on the ground, x and y; the front runs from there along `turn_deg`
    turn_deg 0 faces south, 90 east, 180 north, -90 west
    width    of the front, metres
    floors, columns   of windows above the ground floor
    roof     "pitched" with the ridge along the front, "flat" with a parapet
    shop     colour of the awning over the ground floor; None for a plain ground floor with a door
    sides    which side walls are seen, and get windows: "", "l", "r"
    plain    farther down a street: windows without sills, of one pane
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
    depth: float = 10.0
    plain: bool = False


GROUND_M, FLOOR_M = 3.8, 3.1
"""Height of the ground floor and of the floors above it."""


def house(h: House, wall_m: float) -> Mesh:
    """Base vertices of the walls are `wall_m` apart."""
    top = GROUND_M + FLOOR_M * h.floors
    xs, zs = steps(0, h.width, wall_m), with_breaks(0, top, wall_m, [GROUND_M])
    ys = steps(0, h.depth, wall_m)
    x, y, z = (1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0)
    parts = [
        sheet((0, 0, 0), x, z, xs, zs, h.wall),
        sheet((h.width, 0, 0), y, z, ys, zs, h.wall),
        sheet((0, h.depth, 0), (0, -1.0, 0), z, ys, zs, h.wall),
        bar((-0.12, -0.32, top - 0.25), (h.width + 0.12, 0.1, top + 0.12), h.trim),
        bar((-0.04, -0.14, GROUND_M - 0.1), (h.width + 0.04, 0.05, GROUND_M + 0.12), h.trim),
    ]
    parts += _roof(h, top, wall_m)
    pitch = h.width / h.columns
    upper = [(pitch * (c + 0.5), GROUND_M + FLOOR_M * f + 0.75) for f in range(h.floors) for c in range(h.columns)]
    parts += [placed(_window(h.trim, h.plain), (u, 0, w)) for u, w in upper]
    parts += _ground_floor(h, pitch)
    for side in h.sides:
        turn, corner = (90.0, (h.width, 0.0)) if side == "r" else (-90.0, (0.0, h.depth))
        count = max(2, int(h.depth / 3.2))
        for f in range(h.floors):
            for c in range(count):
                along = h.depth * (c + 0.5) / count
                place = placed(_window(h.trim, True), (along, 0, GROUND_M + FLOOR_M * f + 0.75))
                parts.append(placed(place, (*corner, 0), turn))
    return placed(merged(*parts), (*h.at, 0), h.turn_deg)


def _window(trim: Colour, plain: bool) -> Mesh:
    """A window on the plane y = 0 that looks to -y, its sill on z = 0: a raised frame and panes; a sill unless `plain`."""
    w, t = 1.05, 1.6
    frame = _panel(-0.5 * w - 0.12, 0.5 * w + 0.12, -0.02, t + 0.12, 0.03, trim)
    if plain:
        return merged(frame, _panel(-0.5 * w, 0.5 * w, 0.08, t, 0.045, GLASS))
    panes = [_panel(side * 0.275 - 0.235, side * 0.275 + 0.235, 0.05, t, 0.045, GLASS) for side in (-1, 1)]
    return merged(frame, *panes, bar((-0.5 * w - 0.2, -0.16, -0.12), (0.5 * w + 0.2, 0.02, 0), trim))


def _panel(x0: float, x1: float, z0: float, z1: float, out: float, colour: Colour) -> Mesh:
    """A flat rectangle `out` metres before the plane y = 0, facing -y."""
    return sheet((0, -out, 0), (1, 0, 0), (0, 0, 1), [x0, x1], [z0, z1], colour)


def _ground_floor(h: House, pitch: float) -> list[Mesh]:
    """Doors, and shop windows under a striped awning."""
    door = pitch * (h.columns // 2 + 0.5)
    out = [
        _panel(door - 0.75, door + 0.75, 0, 2.75, 0.03, h.trim),
        _panel(door - 0.58, door + 0.58, 0, 2.25, 0.05, h.tile if h.shop is None else h.shop),
        _panel(door - 0.58, door + 0.58, 2.3, 2.62, 0.05, GLASS),
    ]
    for c in range(h.columns):
        middle = pitch * (c + 0.5)
        if c == h.columns // 2:
            continue
        if h.shop is None:
            out.append(placed(_window(h.trim, h.plain), (middle, 0, 1.0)))
            continue
        half = 0.5 * pitch - 0.25
        out += [_panel(middle - half, middle + half, 0.5, 2.7, 0.03, h.trim), _panel(middle - half + 0.1, middle + half - 0.1, 0.62, 2.6, 0.05, GLASS)]  # fmt: skip
        stripes = np.array([[h.shop if k % 2 == 0 else WHITE for k in range(6)]])
        drop = (0, 0.95, 0.62)
        cloth = tiles((middle - half, -1.0, 2.62), (2 * half, 0, 0), drop, (6, 1), stripes)
        under = Mesh(cloth.vertices - [0, 0, 0.03], cloth.faces[:, ::-1], -cloth.normals, 0.6 * np.asarray(cloth.albedo))
        lip = tiles((middle - half, -1.0, 2.42), (2 * half, 0, 0), (0, 0, 0.2), (6, 1), stripes)
        out += [cloth, under, lip]
    return out


def _roof(h: House, top: float, wall_m: float) -> list[Mesh]:
    if h.roof == "flat":
        rim = 0.9
        lo, hi = (0.0, 0.0, top), (h.width, h.depth, top + rim)
        inner = [sheet((0, 0.4, top + 0.3), (1, 0, 0), (0, 1, 0), steps(0, h.width, wall_m), steps(0, h.depth - 0.4, wall_m), SLATE)]
        wall = [box(lo, (h.width, 0.4, hi[2]), h.wall, "-z", wall_m),
                box((0, 0.4, top), (0.4, h.depth, hi[2]), h.wall, "-z -y", wall_m),
                box((h.width - 0.4, 0.4, top), (h.width, h.depth, hi[2]), h.wall, "-z -y", wall_m)]  # fmt: skip
        hut = box((0.55 * h.width, 3.0, top + 0.3), (0.55 * h.width + 2.2, 5.0, top + 2.3), STONE, "-z", wall_m)
        return [*inner, *wall, hut]
    half, rise, eave = 0.5 * h.depth, 0.42 * h.depth, 0.35
    slope = np.array([0.0, half, rise]) / np.hypot(half, rise)
    length = float(np.hypot(half, rise))
    xs, ts = steps(-0.15, h.width + 0.15, wall_m), steps(0.0, length + eave, wall_m)
    front = sheet((0, -eave * slope[1], top - eave * slope[2] + 0.15), (1, 0, 0), slope, xs, ts, h.tile)
    back = Mesh(front.vertices * [1, -1, 1] + [0, h.depth, 0], front.faces[:, ::-1], front.normals * [1, -1, 1], h.tile)
    gable = Mesh([[0, 0, top], [0, h.depth, top], [0, half, top + rise]], [[0, 2, 1]], [[-1, 0, 0]] * 3, h.wall)
    other = Mesh(gable.vertices + [h.width, 0, 0], gable.faces[:, ::-1], -gable.normals, h.wall)
    brick = (0.36, 0.16, 0.11)
    stacks = [box((u, 1.7, top + 0.8), (u + 0.7, 2.5, top + 3.3), brick, "-z") for u in (0.12 * h.width, 0.7 * h.width)]
    return [front, back, gable, other, *stacks]


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
    House((-5.5, 15), 0, 11, CREAM, 4, 5, "flat", SLATE, (0.06, 0.25, 0.12)),
    House((5.5, 15), 0, 10, ROSE, 3, 4, "pitched", SLATE),
    House((-26.5, 15), 0, 11, GREY, 3, 4, "pitched", SLATE, plain=True),
    House((-38, 15), 0, 11.5, BRICK, 3, 4, "pitched", CLAY, plain=True),
    House((15.5, 15), 0, 11, SKY, 3, 4, "pitched", CLAY, plain=True),
    House((26.5, 15), 0, 11.5, SAND, 4, 4, "pitched", SLATE, plain=True),
)
WEST = (
    House((-15.5, -21), 90, 9, BRICK, 4, 3, "flat", SLATE, (0.75, 0.52, 0.10)),
    House((-15.5, -12), 90, 9, SAND, 3, 4, "pitched", CLAY),
    House((-15.5, -3), 90, 9, SKY, 3, 3, "pitched", SLATE, (0.08, 0.18, 0.42), sides="r"),
    House((-15.5, -38), 90, 17, GREY, 3, 6, "pitched", SLATE, plain=True),
    House((-26.0, 6), 180, 12, CREAM, 3, 4, "pitched", CLAY, plain=True),
    House((-FAR, 4), 90, 12, MINT, 3, 4, "pitched", CLAY, plain=True),
)
EAST = (
    House((15.5, 6), -90, 9, MINT, 3, 3, "pitched", CLAY, sides="lr"),
    House((15.5, -3), -90, 9, BRICK, 4, 4, "flat", SLATE, (0.80, 0.78, 0.72), sides="r"),
    House((FAR, 16), -90, 12, OCHRE, 3, 4, "pitched", SLATE, plain=True),
    House((FAR, -10), -90, 12, ROSE, 3, 4, "pitched", CLAY, plain=True),
    House((FAR, 6), 180, 12.5, GREY, 3, 4, "flat", SLATE, depth=7.5, plain=True),
    House((25.5, -12), 0, 12.5, SAND, 3, 4, "flat", SLATE, depth=7.5, plain=True),
)
SOUTH = (
    House((15.5, -21), 180, 11, OCHRE, 3, 4, "pitched", CLAY, (0.08, 0.22, 0.42)),
    House((4.5, -21), 180, 11, ROSE, 4, 4, "flat", SLATE, (0.55, 0.07, 0.06), sides="r"),
    House((26.5, -21), 180, 11, CREAM, 3, 4, "pitched", SLATE, plain=True),
    House((FAR, -21), 180, 11.5, SKY, 3, 4, "pitched", CLAY, plain=True),
    House((-5.0, -FAR), 180, 11, CREAM, 4, 4, "pitched", CLAY, plain=True),
)


def houses(wall_m: float) -> list[Object]:
    """All houses, by the side of the square."""
    rows = {
        "north": (NORTH, "coloured fronts behind the saucer: their rows of windows meet its outline directly"),
        "west": (WEST, "fronts at the left, seen in the hull as a narrow bent strip"),
        "east": (EAST, "fronts at the right and the ends of two streets"),
        "south": (SOUTH, "fronts behind the camera: the middle of the hull mirrors them"),
    }
    return [Object(f"houses-{side}", merged(*(house(h, wall_m) for h in row)), shows) for side, (row, shows) in rows.items()]
