"""The kitchen itself: room, window, cupboards, furniture. What stands on them is in `kitchenware`.

The room is 4.2 x 4 m, 2.5 m high, about the z axis. The back wall (+y) has the long counter with oven and hob, the left
wall (-x) the window over the sink, the right wall (+x) fridge and pictures, the front wall (-y) door and dresser. Walls
exist where they can be seen: behind cupboards there is nothing.
"""

from __future__ import annotations

import numpy as np

from benchharness.scene import Mesh, Object, merged

from ..props.shapes import Colour, arc, ball, bar, box, lathe, placed, sheet, tiles, tube, with_breaks

X, Y, Z = 2.1, 2.0, 2.5
"""Half the room's width and depth, and its height, metres."""
COUNTER, DEPTH, TOP = 0.90, 0.60, 0.04
"""Height and depth of the counters and thickness of their worktops, metres."""
WINDOW = (-0.75, 0.85, 1.12, 2.12)
"""The opening in the left wall: y from, to, z from, to."""

CREAM: Colour = (0.80, 0.70, 0.54)
SAGE: Colour = (0.27, 0.36, 0.27)
OAK: Colour = (0.50, 0.31, 0.16)
DARK_OAK: Colour = (0.27, 0.15, 0.075)
STEEL: Colour = (0.50, 0.50, 0.51)
BLACK: Colour = (0.05, 0.05, 0.05)
WHITE: Colour = (0.80, 0.79, 0.76)


def room(wall_m: float) -> list[Object]:
    """Floor, walls, splashback, ceiling. `wall_m`: distance of base vertices on walls and ceiling."""
    rng = np.random.default_rng(7)
    chequer = (np.add.outer(np.arange(8), np.arange(8)) % 2)[..., None]
    floor = np.where(chequer, (0.46, 0.20, 0.11), (0.70, 0.55, 0.38)) * rng.uniform(0.86, 1.14, (8, 8, 1))
    splash = np.broadcast_to((0.74, 0.73, 0.66), (2, 14, 3)) * rng.uniform(0.88, 1.08, (2, 14, 1))
    splash[rng.uniform(size=(2, 14)) < 0.14] = (0.16, 0.32, 0.42)
    x, y, z = (1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0)
    flat = lambda lo, hi, *breaks: with_breaks(lo, hi, wall_m, breaks)  # noqa: E731
    paint = (0.80, 0.66, 0.45)
    back = sheet((0, Y, 0), x, z, flat(-X, X), flat(COUNTER + 0.54, Z), paint)
    left = [
        sheet((-X, 0, 0), y, z, flat(-Y, Y, *WINDOW[:2]), flat(COUNTER, Z, *WINDOW[2:]), paint, hole=WINDOW),
        sheet((-X, 0, 0), y, z, flat(-Y, -1.2), flat(0, COUNTER), paint),
    ]
    right = sheet((X, 0, 0), y, z, flat(-Y, Y, 0.65, 1.3), flat(0, Z, 1.85), paint, hole=(0.65, 1.3, 0, 1.85))
    front = sheet((0, -Y, 0), x, z, flat(-X, X, 0.55, 1.45), flat(0, Z, 2.05), CREAM, hole=(0.55, 1.45, 0, 2.05))
    return [
        Object(
            "floor",
            tiles((-X, -Y, 0), (2 * X, 0, 0), (0, 2 * Y, 0), (8, 8), floor),
            "two-tone tiles: a regular pattern whose bending in the mirror is plain to see",
        ),
        Object(
            "splashback",
            tiles((-X, Y, COUNTER), (2 * X, 0, 0), (0, 0, 0.54), (14, 2), splash),
            "small tiles right behind the bowl, where direct view and reflection meet at its outline",
        ),
        Object(
            "walls",
            merged(back, *left, _turned(right), _turned(front)),
            "the smooth bright ground that everything else stands out from",
        ),
        Object(
            "ceiling",
            _turned(sheet((0, 0, Z), x, y, flat(-X, X), flat(-Y, Y), (0.84, 0.82, 0.78))),
            "what the bowl's upper half mirrors; sends the window's light down",
        ),
    ]


def _turned(mesh: Mesh) -> Mesh:
    """A sheet with its other side in front."""
    return Mesh(mesh.vertices, mesh.faces[:, ::-1], -mesh.normals, mesh.albedo, mesh.emission)


def window(daylight: float) -> list[Object]:
    """Panes and frame; `daylight` is the sky's radiance. Each pane emits one radiance: renderers can sample it."""
    y0, y1, z0, z1 = WINDOW
    view = [
        (
            "garden",
            z0,
            z0 + 0.26,
            (0.10, 0.17, 0.05),
            "a hedge below the sky, which tells that the window is seen upright",
        ),
        ("haze", z0 + 0.26, z0 + 0.52, (1.10, 1.04, 0.95), "the pale sky over the hedge"),
        ("sky", z0 + 0.52, z1, (0.80, 0.95, 1.15), "daylight: the strongest light in the room and in the bowl"),
    ]
    panes = [
        Object(
            f"window-{name}",
            sheet((-X - 0.10, 0, 0), (0, 1, 0), (0, 0, 1), [y0, y1], [low, high], BLACK, tuple(daylight * np.array(tint))),
            shows,
        )
        for name, low, high, tint, shows in view
    ]
    middle, height = 0.5 * (y0 + y1), z0 + 0.62 * (z1 - z0)
    bars = [
        bar((-X - 0.10, y0, z0 - 0.03), (-X + 0.10, y1, z0), WHITE),
        bar((-X - 0.10, y0, z1), (-X + 0.02, y1, z1 + 0.05), WHITE),
        bar((-X - 0.10, y0 - 0.05, z0 - 0.03), (-X + 0.02, y0, z1 + 0.05), WHITE),
        bar((-X - 0.10, y1, z0 - 0.03), (-X + 0.02, y1 + 0.05, z1 + 0.05), WHITE),
        bar((-X - 0.095, middle - 0.025, z0), (-X - 0.055, middle + 0.025, z1), WHITE),
        bar((-X - 0.095, y0, height - 0.02), (-X - 0.056, y1, height + 0.02), WHITE),
    ]
    return [
        *panes,
        Object("window-frame", merged(*bars), "straight bars against the light, whose images in the bowl are curves"),
    ]


def lamp(radiance: Colour, n: int) -> list[Object]:
    """An opal globe on a rod, over the table."""
    at, radius = (0.25, 0.25, 2.02), 0.15
    globe = placed(ball(radius, n, n // 2 + 2, (0.8, 0.8, 0.8), radiance), at)
    rod = tube([(at[0], at[1], at[2] + radius - 0.005), (at[0], at[1], Z - 0.001)], 0.012, 6, STEEL)
    return [
        Object("lamp", globe, "a round light: its image in the bowl is a small ellipse of known shape"),
        Object("lamp-rod", rod, "a thin straight thing that leads up to the ceiling"),
    ]


def _front(x0: float, x1: float, z0: float, z1: float, colour: Colour, spacing: float, handle: str = "top") -> Mesh:
    """A cupboard door in the plane y = 0 that faces -y, with its handle."""
    gap = 0.004
    door = box((x0 + gap, -0.02, z0 + gap), (x1 - gap, 0, z1 - gap), colour, "+y", spacing, 0.004)
    x = 0.5 * (x0 + x1)
    z = z1 - 0.06 if handle == "top" else z0 + 0.06
    return merged(door, bar((x - 0.08, -0.046, z - 0.007), (x + 0.08, -0.019, z + 0.007), STEEL))


def _units(x0: float, widths: list[float], kinds: str, colour: Colour, spacing: float) -> Mesh:
    """A row of base units along x whose fronts stand in the plane y = 0: d(oor), D(rawers), o(ven)."""
    parts, x = [], x0
    for width, kind in zip(widths, kinds, strict=True):
        x1 = x + width
        if kind == "d":
            parts.append(_front(x, x1, 0.12, COUNTER - TOP, colour, spacing))
        elif kind == "D":
            parts += [_front(x, x1, a, b, colour, spacing) for a, b in ((0.12, 0.40), (0.40, 0.66), (0.66, COUNTER - TOP))]
        else:
            parts.append(_front(x, x1, 0.12, 0.70, BLACK, spacing))
            panel = box((x + 0.004, -0.02, 0.704), (x1 - 0.004, 0, COUNTER - TOP - 0.004), STEEL, "+y", spacing, 0.004)
            knob = lathe([(0.02, 0), (0.02, 0.025), (0, 0.025)], 6, BLACK, sharp_deg=180)
            knobs = [placed(knob, (x + s * width, -0.02, 0.78), tilt_deg=90) for s in (0.25, 0.5, 0.75)]
            glass = box((x + 0.09, -0.026, 0.20), (x1 - 0.09, -0.02, 0.56), (0.10, 0.09, 0.08), "+y", spacing)
            parts += [panel, *knobs, glass]
        x = x1
    # What shows through the gaps, and the recess at the floor.
    parts.append(sheet((0, 0, 0), (1, 0, 0), (0, 0, 1), [x0, x], [0.10, COUNTER - TOP], BLACK))
    parts.append(sheet((0, 0.06, 0), (1, 0, 0), (0, 0, 1), with_breaks(x0, x, spacing, ()), [0, 0.10], (0.10, 0.08, 0.06)))
    return merged(*parts)


def counters(spacing: float, top_m: float) -> list[Object]:
    """Base units and worktops along the back and the left wall, hob, sink and tap."""
    back_y, left_x = Y - DEPTH, -X + DEPTH
    back = placed(_units(left_x, [0.6] * 6, "ddDodd", SAGE, spacing), (0, back_y + 0.02, 0))
    left = placed(_units(-back_y, [0.65] * 4, "dddd", SAGE, spacing), (left_x - 0.02, 0, 0), turn_deg=90)
    end = box((-X, -1.2, 0), (left_x - 0.02, -1.182, COUNTER - TOP), SAGE, "-x +y -z +z", spacing)
    lip, z0 = 0.02, COUNTER - TOP
    sink = (-X + 0.12, -X + 0.50, -0.25, 0.30)
    xs = with_breaks(-X, left_x + lip, top_m, sink[:2])
    ys = with_breaks(-1.22, Y, top_m, (*sink[2:], back_y - lip))
    across = with_breaks(left_x + lip, X, top_m, ())
    deep = ys[ys >= back_y - lip - 1e-9]
    up = (0, 0, COUNTER)
    top = merged(
        sheet(up, (1, 0, 0), (0, 1, 0), xs, ys, OAK, hole=sink),
        sheet(up, (1, 0, 0), (0, 1, 0), across, deep, OAK),
        sheet((0, back_y - lip, 0), (1, 0, 0), (0, 0, 1), across, [z0, COUNTER], OAK),
        sheet((left_x + lip, 0, 0), (0, 1, 0), (0, 0, 1), ys[ys <= back_y - lip + 1e-9], [z0, COUNTER], OAK),
        sheet((0, -1.22, 0), (1, 0, 0), (0, 0, 1), xs, [z0, COUNTER], OAK),
    )
    # The basin: floor and four walls that face inward.
    s0, s1, t0, t1 = sink
    x, y, z, low, zs = (1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0), COUNTER - 0.17, [COUNTER - 0.17, COUNTER]
    basin = merged(
        sheet((0, 0, low), x, y, [s0, s1], [t0, 0.5 * (t0 + t1), t1], STEEL),
        sheet((s0, 0, 0), y, z, [t0, t1], zs, STEEL),
        sheet((0, t1, 0), x, z, [s0, s1], zs, STEEL),
        _turned(sheet((s1, 0, 0), y, z, [t0, t1], zs, STEEL)),
        _turned(sheet((0, t0, 0), x, z, [s0, s1], zs, STEEL)),
    )
    neck = [(0, 0, 0), (0, 0, 0.20), *arc((0.08, 0, 0.20), (-0.08, 0, 0), (0, 0, 0.08), 20, 180, 6), (0.16, 0, 0.17)]
    tap = placed(
        merged(tube(neck, 0.012, 5, STEEL), bar((-0.01, 0.03, 0.02), (0.01, 0.10, 0.04), STEEL)),
        (-X + 0.07, 0.02, COUNTER),
    )
    hob = bar((0.30, back_y + 0.06, COUNTER), (0.90, Y - 0.08, COUNTER + 0.008), BLACK)
    ring = lathe([(0.085, 0.001), (0, 0.001)], 12, (0.16, 0.15, 0.15))
    rings = [placed(ring, (0.45 + 0.3 * i, back_y + 0.19 + 0.25 * j, COUNTER + 0.008)) for i in range(2) for j in range(2)]
    return [
        Object("cupboards-back", back, "doors, drawers and oven: a row of equal upright edges behind the bowl"),
        Object(
            "cupboards-left",
            merged(left, end),
            "doors under the window: the same row, seen at a grazing angle in the bowl",
        ),
        Object("worktop", top, "long level edges at the height of the bowl"),
        Object("sink", merged(basin, tap), "a concave thing and a bent pipe under the window"),
        Object("hob", merged(hob, *rings), "a dark flat area with circles"),
    ]


def high_cupboards(spacing: float) -> list[Object]:
    """Wall cupboards, hood, and the shelf between them on the back wall."""
    z0, z1, y = 1.44, 2.16, Y - 0.35
    parts = []
    for x0, x1 in ((-X, -0.9), (0.9, X)):
        parts.append(box((x0, y, z0), (x1, Y, z1), CREAM, "-y +y", spacing))
        parts += [placed(_front(a, a + 0.6, z0, z1, CREAM, spacing, "bottom"), (0, y, 0)) for a in (x0, x0 + 0.6)]
    hood = merged(
        box((0.30, Y - 0.45, 1.50), (0.88, Y, 1.58), STEEL, "+y", spacing, 0.006),
        box((0.48, Y - 0.28, 1.58), (0.72, Y, Z), STEEL, "+y -z +z", spacing),
    )
    shelf = merged(
        box((-0.88, Y - 0.22, 1.50), (0.22, Y, 1.525), OAK, "+y", 0.4),
        box((-0.88, Y - 0.22, 1.86), (0.22, Y, 1.885), OAK, "+y", 0.4),
    )
    return [
        Object(
            "cupboards-high",
            merged(*parts),
            "bright doors at eye height, darker below: the upper edge of the direct view",
        ),
        Object("hood", hood, "an upright edge from hob to ceiling"),
        Object("shelf", shelf, "carries jars and mugs, small things far from the bowl"),
    ]


def furniture(spacing: float) -> list[Object]:
    """Fridge, door, dresser, pictures: what the bowl mirrors from behind the camera."""
    fridge = merged(
        box((1.47, 0.65, 0.03), (X, 1.3, 1.85), (0.78, 0.77, 0.72), "+x -x -z +y", spacing),
        box((1.45, 0.65, 0.05), (1.475, 1.3, 1.20), (0.80, 0.79, 0.74), "+x", spacing, 0.006),
        box((1.45, 0.65, 1.21), (1.475, 1.3, 1.85), (0.80, 0.79, 0.74), "+x", spacing, 0.006),
        *(bar((1.415, 0.69, a), (1.455, 0.715, b), STEEL) for a, b in ((0.75, 1.12), (1.28, 1.55))),
    )
    panel = lambda lo, hi: bar((lo[0], -Y - 0.025, lo[1]), (hi[0], -Y - 0.005, hi[1]), (0.62, 0.24, 0.12))  # noqa: E731
    door = merged(
        _turned(
            sheet(
                (0, -Y - 0.02, 0),
                (1, 0, 0),
                (0, 0, 1),
                with_breaks(0.6, 1.4, spacing, ()),
                with_breaks(0, 2.0, spacing, ()),
                (0.50, 0.18, 0.09),
            )
        ),
        *(panel(*p) for p in (((0.70, 0.15), (0.96, 0.9)), ((1.04, 0.15), (1.30, 0.9)), ((0.70, 1.05), (1.30, 1.88)))),
        *(box((x, -Y - 0.02, 0), (x + 0.05, -Y + 0.025, 2.05), WHITE, "-y -z", 0.8) for x in (0.55, 1.4)),
        bar((0.6, -Y - 0.02, 2.0), (1.4, -Y + 0.025, 2.05), WHITE),
        bar((1.26, -Y - 0.02, 0.99), (1.37, -Y + 0.05, 1.01), STEEL),
    )
    x0, x1, front = -1.75, -0.55, -Y + 0.42
    base = placed(_units(-x1, [0.6] * 2, "dd", (0.16, 0.28, 0.38), spacing), (0, front - 0.02, 0), turn_deg=180)
    dresser = merged(
        base,
        box((x0, -Y, 0), (x1, front - 0.02, COUNTER - TOP), (0.16, 0.28, 0.38), "-y +y -z +z", spacing),
        box((x0 - 0.02, -Y, COUNTER - TOP), (x1 + 0.02, front + 0.02, COUNTER), OAK, "-y", spacing),
        *(box((x, -Y, COUNTER), (x + 0.025, -Y + 0.24, 1.95), (0.16, 0.28, 0.38), "-y -z", 0.6) for x in (x0, x1 - 0.025)),
        *(box((x0 + 0.025, -Y, z), (x1 - 0.025, -Y + 0.24, z + 0.025), OAK, "-y -x +x", spacing) for z in (1.25, 1.925)),
    )
    pictures = []
    for y, z, w, h, colour in (
        (-0.95, 1.35, 0.5, 0.7, (0.75, 0.32, 0.10)),
        (-0.25, 1.5, 0.42, 0.42, (0.12, 0.30, 0.45)),
    ):
        into = lambda x, lo, hi, colour: _turned(  # noqa: E731
            sheet((x, 0, 0), (0, 1, 0), (0, 0, 1), [lo[0], hi[0]], [lo[1], hi[1]], colour)
        )
        pictures += [
            box((X - 0.02, y, z), (X, y + w, z + h), DARK_OAK, "+x"),
            into(X - 0.022, (y + 0.04, z + 0.04), (y + w - 0.04, z + h - 0.04), WHITE),
            into(X - 0.024, (y + 0.12, z + 0.12), (y + w - 0.12, z + 0.55 * h), colour),
            into(X - 0.024, (y + 0.12, z + 0.58 * h), (y + w - 0.12, z + h - 0.12), (0.80, 0.62, 0.20)),
        ]
    return [
        Object("fridge", fridge, "a large pale upright box at the side"),
        Object("door", door, "a strong warm colour behind the camera, mirrored near the middle of the bowl"),
        Object("dresser", dresser, "shelves behind the camera: fine straight lines in the bowl"),
        Object("pictures", merged(*pictures), "coloured rectangles on the right wall"),
    ]


def chair(colour: Colour) -> Mesh:
    """A kitchen chair at the origin that looks towards +y."""
    w, d, seat, post = 0.20, 0.19, 0.45, 0.036
    legs = [
        bar((x, y, 0), (x + post, y + post, top), colour)
        for x in (-w, w - post)
        for y, top in ((-d, 0.92), (d - post, seat - 0.03))
    ]
    rails = [bar((-w + post, -d + 0.005, z), (w - post, -d + 0.025, z + 0.09), colour) for z in (0.60, 0.80)]
    return merged(*legs, *rails, bar((-w, -d + post, seat - 0.03), (w, d, seat), colour))
