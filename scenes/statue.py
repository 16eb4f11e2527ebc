"""A stone angel on a table between two teapots of silver and gold, which mirror it and one another, in a room.

After figure 4 of Popescu et al. 2006: what the pots show is a statue, a table top that ends, the other pot with what that
one shows, and a room far away. In the first half only the eye moves, around the table; in the second the statue is pushed
from behind the pots to before them, and turned.

`lean` has 6,900 vertices for the statue and 4,500 for each pot. The paper says nothing of its meshes; `paper` is twice as fine
along each direction: 25,900 and 16,700.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, get_args

import numpy as np

from benchharness.scene import Environment, Mesh, Object, Reflector, Scene, merged

from .panoramas import parlour
from .props import angel
from .props.courtyard import METALS
from .props.pottery import Fineness, teapot
from .props.shapes import box, placed, pose, sheet, steps
from .props.ways import Orbit, from_rest_to_rest, mixed

DetailName = Literal["lean", "paper"]


@dataclass(frozen=True)
class Detail:
    """How finely the scene is modelled.

    cell      width of the grid's cells that the statue is made from, metres
    pot       of each teapot
    board     distance of base vertices on the table top, metres
    """

    cell: float
    pot: Fineness
    board: float


DETAILS: dict[str, Detail] = {
    "lean": Detail(0.0039, Fineness(72, 6, 20, 16, 16, 22), 0.036),
    "paper": Detail(0.00195, Fineness(144, 12, 40, 32, 32, 44), 0.018),
}

TABLE = (-0.46, 0.46, -0.30, 0.30)
"""The table top, which is z = 0: x from, to, y from, to, metres."""
CENTRE = (0.0, 0.0, 0.1)
"""Where the panorama is taken, metres."""
ROWS = 768
"""Of the panorama."""
BOARDS = 7
"""Of which it is made, along x."""
SCALE = 0.78
"""Size of the statue."""
RADIUS = 0.098
"""Of the teapots' bellies, metres."""
POTS = {"silver": (-0.200, 0.010, -136.0), "gold": (0.195, -0.015, -50.0)}
"""Where they stand, x and y, metres, and where their spouts point: degrees from +x."""
SUNK = 0.0005
"""How deep what stands on the table reaches into it, metres: the wood below is inside, and takes no part in the light."""
FRAMES, FPS = 100, 25.0
HALF = 50 / FPS
"""When the eye has arrived and the statue sets out, seconds."""
CAMERA = Orbit((0.0, 0.0, 0.105), (-63.0, -97.0), (11.0, 15.5), (1.16, 1.06), fov_deg=28.0, duration=HALF)


def statue(detail: DetailName = "lean", *, moving: bool = True) -> Scene:
    """The statue and the two teapots.

    detail   how finely they are modelled; the same things either way
    moving   whether the statue moves in the second half; otherwise it stays where it is at first

    Raises ValueError for anything else.
    """
    if detail not in get_args(DetailName):
        raise ValueError(f"statue: detail is {detail!r}; accepted: {', '.join(get_args(DetailName))}")
    if not isinstance(moving, bool):
        raise ValueError(f"statue: moving is {moving!r}; accepted: true or false")
    d = DETAILS[detail]
    push, figure = Push(), placed(angel.statuette(d.cell / SCALE), scale=SCALE)
    shows = "a detailed thing between two mirrors: arms, wings and folds, seen in both and in one through the other"
    pot = teapot(RADIUS, d.pot)
    scene = Scene(
        name="statue",
        objects=(
            Object("statue", figure, shows, push) if moving else Object("statue", figure.transformed(push(0.0)), shows),
            Object("table", top(d.board), "boards that end: straight lines under the pots, and the room beyond them"),
            Object("table edge", edge(d.board), "gives the table a thickness, in the picture and in the mirrors"),
        ),
        reflectors=tuple(
            Reflector(f"{metal} teapot", mesh, mesh, *METALS[metal])
            for metal, (x, y, turn_deg) in POTS.items()
            for mesh in [placed(pot, (x, y, -SUNK), turn_deg)]
        ),
        camera=CAMERA,
        frames=FRAMES,
        fps=FPS,
        environment=Environment.painted(parlour.painter(ROWS), ROWS, CENTRE),
        exposure=0.0,
        detail=detail,
    )
    scene.source.update(detail=detail, moving=moving, base_vertices=scene.vertices)
    return scene


@dataclass(frozen=True)
class Push:
    """The statue's way on the table, straight from `away[0]` to `away[1]` (x, y), turning from and to `turn_deg` from where
    it looks along -y; it rests until `start` seconds."""

    away: tuple[tuple[float, float], tuple[float, float]] = ((0.010, 0.135), (-0.025, -0.150))
    turn_deg: tuple[float, float] = (8.0, 68.0)
    start: float = HALF
    duration: float = (FRAMES - 1) / FPS - HALF

    def __call__(self, time: float) -> np.ndarray:
        s = from_rest_to_rest(time - self.start, self.duration)
        (x0, y0), (x1, y1) = self.away
        return pose((mixed((x0, x1), s), mixed((y0, y1), s), -SUNK), mixed(self.turn_deg, s))


def top(spacing: float) -> Mesh:
    """The boards of the table top, at z = 0, facing up: each of a tone of its own, with some grain."""
    x0, x1, y0, y1 = TABLE
    rng, boards = np.random.default_rng(3), []
    for low, high in pairwise(np.linspace(y0, y1, BOARDS + 1)):
        board = sheet((0, 0, 0), (1, 0, 0), (0, 1, 0), steps(x0, x1, spacing), steps(low, high, spacing), (0.40, 0.22, 0.10))
        tone, phase = rng.uniform(0.72, 1.28), rng.uniform(0, 6)
        grain = 1 + 0.10 * np.sin(90 * board.vertices[:, 1:2] + 3 * np.sin(5 * board.vertices[:, :1] + phase))
        boards.append(Mesh(board.vertices, board.faces, board.normals, np.asarray(board.albedo) * tone * grain))
    return merged(*boards)


def edge(spacing: float) -> Mesh:
    """The table's sides and underside, 32 mm high."""
    x0, x1, y0, y1 = TABLE
    return box((x0, y0, -0.032), (x1, y1, 0.0), (0.24, 0.12, 0.055), "+z", 4 * spacing)
