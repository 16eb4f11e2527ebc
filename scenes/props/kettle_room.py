"""The room around the kettle: panelled walls, tiles, pictures, the table and the chair beside it.

It is as large as `kitchen_room`'s (4.2 x 4 m, 2.5 m high, about the z axis), with the same window in the left wall.
"""

from __future__ import annotations

import numpy as np

from benchharness.scene import Mesh, Object, merged

from ..props.kitchen_room import DARK_OAK, OAK, WHITE, WINDOW, X, Y, Z
from ..props.shapes import Colour, bar, box, contact_sheet, placed, sheet, tiles, with_breaks

TABLE = (-0.66, 0.25, -0.46, 0.56)
"""The table top: x from, to, y from, to, metres."""
HEIGHT = 0.75
"""Of the table, metres."""
CLOTH = 0.002
"""How far the cloth lies above the table, metres."""
RAIL = 0.92
"""Where panels end and plain walls begin, metres."""

SAGE: Colour = (0.30, 0.42, 0.36)
PAINT: Colour = (0.82, 0.72, 0.54)
RED: Colour = (0.62, 0.10, 0.08)


def shell(wall_m: float) -> list[Object]:
    """Floor, walls, ceiling. `wall_m`: distance of base vertices."""
    rng = np.random.default_rng(11)
    chequer = (np.add.outer(np.arange(10), np.arange(10)) % 2)[..., None]
    floor = np.where(chequer, (0.16, 0.20, 0.24), (0.74, 0.70, 0.62)) * rng.uniform(0.88, 1.1, (10, 10, 1))
    flat = lambda lo, hi, *breaks: with_breaks(lo, hi, wall_m, breaks)  # noqa: E731
    low, high = [], []
    for origin, along, half, faces_in, hole in (
        ((0, Y, 0), (1.0, 0, 0), X, True, None),
        ((0, -Y, 0), (1.0, 0, 0), X, False, None),
        ((-X, 0, 0), (0, 1.0, 0), Y, True, WINDOW),
        ((X, 0, 0), (0, 1.0, 0), Y, False, None),
    ):
        for group, z0, z1, colour in ((low, 0.0, RAIL, SAGE), (high, RAIL, Z, PAINT)):
            gap = hole if z0 >= RAIL else None
            us, vs = flat(-half, half, *(gap[:2] if gap else ())), flat(z0, z1, *(gap[2:] if gap else ()))
            wall = sheet(origin, along, (0, 0, 1.0), us, vs, colour, hole=gap)
            group.append(wall if faces_in else turned(wall))
    strip = 0.022
    rails = [
        box((-X, Y - strip, RAIL - 0.03), (X, Y, RAIL + 0.03), WHITE, "+y -x +x", wall_m),
        box((-X, -Y, RAIL - 0.03), (X, -Y + strip, RAIL + 0.03), WHITE, "-y -x +x", wall_m),
        box((-X, -Y, RAIL - 0.03), (-X + strip, Y, RAIL + 0.03), WHITE, "-x -y +y", wall_m),
        box((X - strip, -Y, RAIL - 0.03), (X, Y, RAIL + 0.03), WHITE, "+x -y +y", wall_m),
    ]
    ceiling = turned(sheet((0, 0, Z), (1, 0, 0), (0, 1, 0), flat(-X, X), flat(-Y, Y), (0.84, 0.82, 0.78)))
    return [
        Object(
            "floor",
            tiles((-X, -Y, 0), (2 * X, 0, 0), (0, 2 * Y, 0), (10, 10), floor),
            "dark and pale tiles: a regular pattern whose bending in the mirror is plain to see",
        ),
        Object("panels", merged(*low), "a green band around the room at the height of the kettle's belly"),
        Object("walls", merged(*high), "the smooth bright ground that everything else stands out from"),
        Object("rail", merged(*rails), "one level white line all around, which the mirror bends"),
        Object("ceiling", ceiling, "what the kettle's dome mirrors; sends the window's light down"),
    ]


def turned(mesh: Mesh) -> Mesh:
    """A sheet with its other side in front."""
    return Mesh(mesh.vertices, mesh.faces[:, ::-1], -mesh.normals, mesh.albedo, mesh.emission)


def _picture(width: float, height: float, frame: Colour, fields: list[tuple[float, float, float, float, Colour]]) -> Mesh:
    """A picture that hangs in the plane y = 0, its lower left corner at the origin, and faces -y.

    fields   rectangles on the paper: x from, z from, x to, z to in shares of the picture, and colour; later ones on top
    """
    parts = [box((0, -0.022, 0), (width, 0, height), frame, "+y", bevel=0.006)]
    for k, (x0, z0, x1, z1, colour) in enumerate([(0.1, 0.1, 0.9, 0.9, WHITE), *fields]):
        parts.append(sheet((0, -0.0235 - 0.0015 * k, 0), (width, 0, 0), (0, 0, height), [x0, x1], [z0, z1], colour))
    return merged(*parts)


def pictures() -> list[Object]:
    """On the back wall, over the kettle; and what the kettle shows of the other walls: a door, a cupboard."""
    night, sand, sky = (0.06, 0.12, 0.30), (0.80, 0.58, 0.22), (0.35, 0.58, 0.72)
    sea = _picture(
        0.62,
        0.46,
        DARK_OAK,
        [
            (0.16, 0.16, 0.84, 0.84, sky),
            (0.16, 0.16, 0.84, 0.42, night),
            (0.40, 0.34, 0.62, 0.40, RED),
            (0.48, 0.40, 0.54, 0.70, WHITE),
        ],
    )
    blocks = _picture(
        0.40, 0.52, (0.10, 0.09, 0.08), [(0.2, 0.2, 0.8, 0.8, sand), (0.2, 0.2, 0.5, 0.5, RED), (0.5, 0.5, 0.8, 0.8, night)]
    )
    stripes = _picture(
        0.46, 0.46, OAK, [(0.2, 0.2 + 0.15 * k, 0.8, 0.3 + 0.15 * k, c) for k, c in enumerate((night, RED, sand, SAGE))]
    )
    hung = [
        placed(sea, (-0.78, Y, 1.12)),
        placed(blocks, (0.02, Y, 1.10)),
        placed(stripes, (0.62, Y, 1.14)),
        placed(blocks, (X, 0.95, 1.20), -90),
        placed(sea, (1.55, -Y, 1.20), 180),
    ]
    teal = (0.06, 0.30, 0.34)
    panels = [
        bar((x, -Y + 0.02, z), (x + 0.28, -Y + 0.045, z + h), (0.09, 0.38, 0.42))
        for x in (-0.34, 0.04)
        for z, h in ((0.15, 0.70), (1.0, 0.85))
    ]
    door = merged(
        box((-0.42, -Y, 0), (0.40, -Y + 0.03, 2.0), teal, "-y -z", 0.7),
        *(box((x, -Y, 0), (x + 0.06, -Y + 0.045, 2.06), WHITE, "-y -z", 0.9) for x in (-0.48, 0.40)),
        box((-0.42, -Y, 2.0), (0.40, -Y + 0.045, 2.06), WHITE, "-y -x +x", 0.9),
        *panels,
        bar((0.30, -Y + 0.03, 0.99), (0.38, -Y + 0.09, 1.015), (0.75, 0.60, 0.25)),
    )
    front, wood, inner = X - 0.36, (0.48, 0.16, 0.09), (0.30, 0.10, 0.06)
    shelf = merged(
        *(box((front, y, 0), (X, y + 0.03, 1.75), wood, "+x -z", 0.6) for y in (-1.30, -0.33)),
        *(box((front, -1.27, z), (X - 0.02, -0.33, z + 0.03), wood, "+x -y +y", 0.6) for z in (0.04, 0.60, 1.15, 1.72)),
        sheet((X - 0.02, 0, 0), (0, -1, 0), (0, 0, 1), [0.33, 0.8, 1.27], [0.07, 0.60, 1.15, 1.72], inner),
        *_books(),
    )
    return [
        Object("pictures", merged(*hung), "coloured rectangles in dark frames, upright and level"),
        Object("door", door, "a strong cool colour behind the camera, mirrored near the middle of the kettle"),
        Object("bookcase", shelf, "rows of thin coloured upright things at the right"),
    ]


def _books() -> list[Mesh]:
    rng, colours = np.random.default_rng(5), [RED, SAGE, (0.10, 0.18, 0.40), (0.78, 0.60, 0.22), (0.72, 0.66, 0.55)]
    books = []
    for z in (0.63, 1.18):
        y = -1.26
        while (thick := rng.uniform(0.045, 0.085)) + y < -0.36:
            tall, colour = rng.uniform(0.24, 0.38), colours[rng.integers(len(colours))]
            books.append(box((X - 0.30, y, z), (X - 0.04, y + thick - 0.003, z + tall), colour, "+x -z"))
            y += thick
    return books


def table(spacing: float, feet: list[tuple[float, float, float]]) -> list[Object]:
    """Table and cloth. `feet`: x, y, radius of what stands on it; `spacing`: distance of base vertices on the top."""
    x0, x1, y0, y1 = TABLE
    top = contact_sheet((x0, y0), (x1, y1), HEIGHT, spacing, feet, OAK)
    grain = 1.0 + 0.10 * np.sin(23.0 * top.vertices[:, 1:2] + 2.0 * np.sin(3.0 * top.vertices[:, :1]))
    top = Mesh(top.vertices, top.faces, top.normals, top.albedo * grain)
    top = _outside_cloth(top)
    low = HEIGHT - 0.035
    sides = box((x0, y0, low), (x1, y1, HEIGHT), OAK, "+z -z", 2 * spacing)
    legs = [
        bar((x - 0.03, y - 0.03, 0), (x + 0.03, y + 0.03, low), DARK_OAK)
        for x in (x0 + 0.07, x1 - 0.07)
        for y in (y0 + 0.07, y1 - 0.07)
    ]
    return [
        Object("table-top", top, "contact shadows around all that stands on it"),
        Object("table-frame", merged(sides, *legs), "the table's edges and legs against the floor"),
        Object("cloth", _cloth(), "a chequered cloth under the kettle, which fills the lower half of its belly"),
    ]


def _cloth_frame() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corner and sides of the cloth, float64 [3] each, metres."""
    side, angle = 0.52, np.radians(14.0)
    u = side * np.array([np.cos(angle), np.sin(angle), 0.0])
    v = side * np.array([-np.sin(angle), np.cos(angle), 0.0])
    return np.array([-0.035, -0.02, HEIGHT + CLOTH]) - 0.5 * (u + v), u, v


def _cloth() -> Mesh:
    """A gingham of two colours, with a blue border."""
    n = 12
    threads = np.arange(n) % 2
    colours = np.array([(0.80, 0.76, 0.68), (0.72, 0.36, 0.30), RED])[threads[:, None] + threads]
    from_edge = np.minimum(np.arange(n), n - 1 - np.arange(n))
    border = np.minimum(from_edge[:, None], from_edge) == 0
    colours[border] = (0.07, 0.16, 0.34)
    return tiles(*_cloth_frame(), (n, n), colours)


def _outside_cloth(top: Mesh) -> Mesh:
    """The table's top without the faces that lie under the cloth: dark, and so close to it that mirrors mix them up."""
    corner, u, v = _cloth_frame()
    share = (top.vertices - corner) @ np.stack([u, v], axis=1) / (u @ u)
    under = np.all((share > 0) & (share < 1), axis=1)
    faces = top.faces[~np.all(under[top.faces], axis=1)]
    used, faces = np.unique(faces, return_inverse=True)
    return Mesh(top.vertices[used], faces.reshape(-1, 3), top.normals[used], top.albedo[used])


CHAIR = (0.287, -0.088, -15.0)
"""The near edge of the chair's back: x, y at its rear side, metres; and azimuth of the back from there, degrees."""
BACK = (0.40, 0.68, 1.14)
"""The chair's back: its width, and the heights between which its panel lies, metres."""


def chair() -> list[Object]:
    """A chair at the table's right end with its back along the line from the kettle: the rear side is seen from in
    front of the kettle, not from its axis. Both sides of the panel have the same lattice and the posts beside it one as
    fine, so that in a mirror so close to them they stay apart."""
    width, z0, z1 = BACK
    wood, post, n, m = DARK_OAK, 0.036, 8, 10
    spacing = max((width - 0.004) / n, (z1 - z0) / m) + 1e-9
    parts = []
    for x in (0.0, width - post):
        parts.append(bar((x, 0.004, 0), (x + post, post, z0), wood))
        parts.append(box((x, 0.004, z0), (x + post, post, z1 + 0.03), wood, "-z", 2 * spacing))
        parts.append(bar((x, 0.40, 0), (x + post, 0.40 + post, 0.42), wood))
    parts.append(box((0, 0.01, 0.42), (width, 0.45, 0.455), wood, "-z", bevel=0.006))
    parts.append(box((0.002, 0.0, z0), (width - 0.002, 0.022, z1), OAK, "-y", spacing))
    x, y, turn = CHAIR
    check = np.add.outer(np.arange(m) // 2, np.arange(n) // 2) % 2
    colours = np.array([(0.50, 0.05, 0.40), (0.85, 0.70, 0.05)])[check]
    rear = tiles((0.002, 0.0, z0), (width - 0.004, 0, 0), (0, 0, z1 - z0), (n, m), colours)
    here = lambda mesh: placed(mesh, (x, y, 0), turn)  # noqa: E731
    return [
        Object("chair", here(merged(*parts)), "a chair beside the picture, whose back is edge-on to the kettle's axis"),
        Object("chair-rear", here(rear), "the yellow and purple rear of its back: seen in the kettle's side, and nowhere else"),
    ]
