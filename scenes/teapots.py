"""One to four mirror teapots on a checkered floor in an arcaded courtyard, which show each other: after Popescu et al. 2006.

Figure 1 of the paper: four inter-reflecting teapots, with twelve second-order reflections, on a checker that continues
in the panorama around it. In the first half of the animation the eye goes around them; in the second it hardly moves
and the gold pot glides to another place, turning.

The paper states no vertex counts for its teapots. `lean` has 4,000 triangles a pot: normals interpolated on the belly are
good to 0.7 degrees. `paper` has twice as many around and along: 15,000 a pot, good to 0.25 degrees.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import trimesh

from benchharness.scene import Mesh, Reflector, Scene

from .props import courtyard
from .props.pottery import Fineness, teapot
from .props.shapes import placed
from .props.ways import from_rest_to_rest

DetailName = Literal["lean", "paper"]
DETAILS: dict[str, Fineness] = {
    "lean": Fineness(body=48, curve=4, spout=18, spout_rings=10, handle=16, handle_rings=18),
    "paper": Fineness(body=96, curve=8, spout=36, spout_rings=20, handle=32, handle_rings=36),
}

FRAMES, FPS = 100, 25.0
HALF, END = 50 / FPS, (FRAMES - 1) / FPS
"""Seconds: when the eye comes to rest and the pot sets out; the last frame."""
SUNK = 0.0005
"""How deep the pots' bottoms are below the floor, metres: the floor under them is inside, and takes no part in the light."""


@dataclass(frozen=True)
class Place:
    """Where a pot stands: metal, radius of its belly in metres, x and y, azimuth of its spout in degrees."""

    metal: str
    radius: float
    at: tuple[float, float]
    turn_deg: float


PLACES = (
    Place("silver", 0.170, (-0.20, -0.10), 205.0),
    Place("gold", 0.150, (0.24, -0.17), -38.0),
    Place("copper", 0.160, (0.29, 0.33), 12.0),
    Place("ideal", 0.165, (-0.24, 0.40), 150.0),
)
POTS = len(PLACES)


@dataclass(frozen=True)
class Glide:
    """Stands at `start` until `HALF`, then glides by `way` (x, y) metres and turns by `turn_deg` about its axis; arrives at
    `END`."""

    start: tuple[float, float]
    way: tuple[float, float]
    turn_deg: float

    def __call__(self, time: float) -> np.ndarray:
        s = from_rest_to_rest(time - HALF, END - HALF)
        matrix = trimesh.transformations.rotation_matrix(np.radians(s * self.turn_deg), [0, 0, 1], [*self.start, 0.0])
        matrix[:2, 3] += s * np.asarray(self.way)
        return matrix


GLIDER, WAY, TURN_DEG = "gold", (-0.16, -0.26), -85.0
"""Which pot glides, by how much, metres, and how far it turns."""


CAMERA = courtyard.Orbit((-128.0, -92.0, -88.0), (14.0, 10.5, 10.0), (1.55, 1.47, 1.46), (0.0, 0.03, 0.175), 35.5, HALF, END)


def teapots(detail: DetailName = "lean", pots: int = POTS, *, moving: bool = True) -> Scene:
    """The teapots.

    detail   how finely the pots are modelled
    pots     how many there are, 1 to 4; more join the others, which stay as they are
    moving   whether the second of them glides

    Raises ValueError for anything else.
    """
    if detail not in get_args(DetailName):
        raise ValueError(f"teapots: detail is {detail!r}; accepted: {', '.join(get_args(DetailName))}")
    if isinstance(pots, bool) or not isinstance(pots, int) or not 1 <= pots <= POTS:
        raise ValueError(f"teapots: pots is {pots!r}; accepted: whole numbers from 1 to {POTS}")
    if not isinstance(moving, bool):
        raise ValueError(f"teapots: moving is {moving!r}; accepted: true or false")
    scene = Scene(
        name="teapots",
        objects=(courtyard.floor(),),
        reflectors=tuple(_pot(place, DETAILS[detail], moving=moving) for place in PLACES[:pots]),
        camera=CAMERA,
        frames=FRAMES,
        fps=FPS,
        environment=courtyard.environment(),
        exposure=courtyard.EXPOSURE,
        detail=detail,
    )
    scene.source.update(detail=detail, pots=pots, moving=moving, base_vertices=scene.vertices)
    return scene


def _pot(place: Place, fine: Fineness, *, moving: bool) -> Reflector:
    mesh: Mesh = placed(teapot(place.radius, fine), (*place.at, -SUNK), place.turn_deg)
    eta, k = courtyard.METALS[place.metal]
    glide = Glide(place.at, WAY, TURN_DEG) if moving and place.metal == GLIDER else None
    return Reflector(f"pot-{place.metal}", mesh, mesh, eta, k, glide)
