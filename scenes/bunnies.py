"""A furry bunny and a mirror-like one that intersect, on stone tiles in a meadow.

After figures 3 and 13 of Popescu et al. 2006: the furry bunny is cut by the mirror, so that object and image meet along
a line, and its image is bent by a body with ears, hollows and creases that mirrors itself, too. In the first half
only the eye moves; in the second the furry bunny goes through the front of the other one, from one side to the other, and
the line with it.

The mirror is not convex, nor star-shaped, and most points have several reflections in it. Light and shadows are baked as
things stand at first, and stay behind where the bunny was; a large soft sun keeps them pale.

`lean` has 6,300 vertices for each bunny. Popescu et al. took the Stanford bunny and say nothing of its detail; `paper` has as
many as the full scan of that bunny, 35,947, within 1 %.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from benchharness.scene import Environment, Mesh, Object, Reflector, Scene

from .panoramas import meadow
from .props import creature
from .props.courtyard import METALS
from .props.shapes import placed, pose, tiles
from .props.ways import Orbit, from_rest_to_rest, mixed, way_to

DetailName = Literal["lean", "paper"]


CELLS: dict[str, float] = {"lean": 0.0066, "paper": 0.002775}
"""Width of the grid's cells that the bunnies are made from, metres."""
TILES = 18
"""Along each side of the floor."""
ROWS = 768
"""Of the panorama."""
MIRROR_DEG = 16.0
"""How far the mirror-like bunny, at the origin, is turned to the right of the picture."""
SCALE = 0.86
"""Size of the furry bunny; the mirror's is 1."""
FLOOR = 1.17
"""Length of the floor's sides, metres."""
FRAMES, FPS = 100, 25.0
HALF = 50 / FPS
"""When the eye has arrived and the bunny sets out, seconds."""
CAMERA = Orbit((0.005, 0.0, 0.152), (-128.0, -84.0), (5.5, 8.5), (1.00, 0.90), fov_deg=29.0, duration=HALF)


def bunnies(detail: DetailName = "lean", *, moving: bool = True) -> Scene:
    """The two bunnies.

    detail   how finely they are modelled; the same things either way
    moving   whether the furry bunny moves in the second half; otherwise it stays where it is at first

    Raises ValueError for anything else.
    """
    if detail not in get_args(DetailName):
        raise ValueError(f"bunnies: detail is {detail!r}; accepted: {', '.join(get_args(DetailName))}")
    if not isinstance(moving, bool):
        raise ValueError(f"bunnies: moving is {moving!r}; accepted: true or false")
    cell = CELLS[detail]
    walk, furry = Walk(), placed(creature.hare(cell), scale=SCALE)
    shows = "cut by the mirror: meets its own image along a line that travels as it moves"
    mirror = placed(creature.body(cell), turn_deg=MIRROR_DEG)
    scene = Scene(
        name="bunnies",
        objects=(
            Object("bunny", furry, shows, walk) if moving else Object("bunny", furry.transformed(walk(0.0)), shows),
            Object("floor", floor(TILES), "straight lines and even steps, which show how the mirror bends what it shows"),
        ),
        reflectors=(Reflector("mirror bunny", mirror, mirror, *METALS["silver"]),),
        camera=CAMERA,
        frames=FRAMES,
        fps=FPS,
        environment=Environment.painted(meadow.painted, ROWS, centre=(0.0, 0.0, 0.15)),
        exposure=0.0,
        detail=detail,
    )
    scene.source.update(detail=detail, moving=moving, base_vertices=scene.vertices)
    return scene


@dataclass(frozen=True)
class Walk:
    """The furry bunny's way through the front of the other one, on an arc, turning; it rests until `start` seconds.

    From and to are azimuth (degrees) and distance (metres) of its middle from the other's, and where it looks, degrees from
    -y to the right.
    """

    azimuth_deg: tuple[float, float] = (-168.0, -8.0)
    distance: float = 0.098
    turn_deg: tuple[float, float] = (-34.0, 48.0)
    start: float = HALF
    duration: float = (FRAMES - 1) / FPS - HALF

    def __call__(self, time: float) -> np.ndarray:
        s = from_rest_to_rest(time - self.start, self.duration)
        x, y, _ = (self.distance * way_to(mixed(self.azimuth_deg, s), 0.0)).tolist()
        return pose((x, y, 0.0), mixed(self.turn_deg, s))


def floor(count: int) -> Mesh:
    """count x count stone tiles around the origin, light and dark in turn, each of a tone of its own; facing up."""
    i, j = np.indices((count, count))
    tone = np.random.default_rng(7).uniform(0.90, 1.10, (count, count, 1))
    colour = np.where(((i + j) % 2 == 0)[..., None], (0.62, 0.56, 0.47), (0.30, 0.24, 0.20)) * tone
    return tiles((-0.5 * FLOOR, -0.5 * FLOOR, 0.0), (FLOOR, 0, 0), (0, FLOOR, 0), (count, count), colour)
