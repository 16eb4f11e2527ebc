"""One to nine mirror spheres on a checkered floor in an arcaded courtyard, which show each other: after Popescu et al. 2006.

Figure 5 of the paper: nine reflectors, and seventy-two second-order reflections. Triangle meshes, like the paper's, and not
quite round for it. In the first half of the animation the eye goes around them; in the second it hardly moves and one of
them bounces where it stands.

The paper states no vertex counts. `lean` has 1,520 triangles a sphere, its outline round to a quarter of a pixel; `paper`
5,888, 53,000 for nine, round to a tenth of a pixel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from benchharness.scene import Mesh, Reflector, Scene

from .props import courtyard
from .props.shapes import unit_sphere

DetailName = Literal["lean", "paper"]
DETAILS: dict[str, tuple[int, int]] = {"lean": (40, 21), "paper": (64, 48)}
"""Vertices around a sphere, and from pole to pole."""

FRAMES, FPS = 100, 25.0
HALF, END = 50 / FPS, (FRAMES - 1) / FPS
"""Seconds: when the eye comes to rest and the sphere leaves the floor; the last frame."""


@dataclass(frozen=True)
class Place:
    """Where a sphere stands: metal, radius and x, y in metres."""

    metal: str
    radius: float
    at: tuple[float, float]


PLACES = (
    Place("ideal", 0.150, (0.00, 0.00)),
    Place("gold", 0.125, (-0.36, -0.30)),
    Place("copper", 0.125, (0.37, -0.27)),
    Place("silver", 0.115, (0.02, -0.40)),
    Place("ideal", 0.155, (-0.42, 0.38)),
    Place("silver", 0.165, (0.45, 0.37)),
    Place("copper", 0.135, (-0.40, 0.04)),
    Place("gold", 0.140, (0.40, 0.04)),
    Place("silver", 0.160, (0.01, 0.42)),
)
"""In the order in which they join."""
COUNT = len(PLACES)
BOUNCER = 1
"""Which of them bounces."""


@dataclass(frozen=True)
class Bounce:
    """On the floor until `HALF`, then thrown up `height` metres, and up again where it lands, each time to `share` of the
    height before; so many `bounces` that the last ends at `END`."""

    height: float
    share: float = 0.45
    bounces: int = 3

    def __call__(self, time: float) -> np.ndarray:
        # Flights last as the square roots of their heights.
        lasts = np.sqrt(self.share) ** np.arange(self.bounces)
        starts = np.r_[0.0, np.cumsum(lasts)]
        t = np.clip((time - HALF) / (END - HALF), 0.0, 1.0) * starts[-1]
        k = min(int(np.searchsorted(starts, t, side="right")) - 1, self.bounces - 1)
        s = (t - starts[k]) / lasts[k]
        matrix = np.eye(4)
        matrix[2, 3] = self.height * self.share**k * 4 * s * (1 - s)
        return matrix


CAMERA = courtyard.Orbit((-132.0, -108.0, -104.0), (18.0, 12.5, 12.0), (1.72, 1.66, 1.65), (0.0, 0.0, 0.20), 35.0, HALF, END)


def spheres(detail: DetailName = "lean", count: int = COUNT, *, moving: bool = True) -> Scene:
    """The spheres.

    detail   how finely they are modelled
    count    how many there are, 1 to 9; more join the others, which stay as they are
    moving   whether the second of them bounces

    Raises ValueError for anything else.
    """
    if detail not in get_args(DetailName):
        raise ValueError(f"spheres: detail is {detail!r}; accepted: {', '.join(get_args(DetailName))}")
    if isinstance(count, bool) or not isinstance(count, int) or not 1 <= count <= COUNT:
        raise ValueError(f"spheres: count is {count!r}; accepted: whole numbers from 1 to {COUNT}")
    if not isinstance(moving, bool):
        raise ValueError(f"spheres: moving is {moving!r}; accepted: true or false")
    scene = Scene(
        name="spheres",
        objects=(courtyard.floor(),),
        reflectors=tuple(_sphere(k, detail, moving=moving) for k in range(count)),
        camera=CAMERA,
        frames=FRAMES,
        fps=FPS,
        environment=courtyard.environment(),
        exposure=courtyard.EXPOSURE,
        detail=detail,
    )
    scene.source.update(detail=detail, count=count, moving=moving, base_vertices=scene.vertices)
    return scene


def _sphere(k: int, detail: str, *, moving: bool) -> Reflector:
    place, ball = PLACES[k], unit_sphere(*DETAILS[detail])
    n = ball.vertices / np.linalg.norm(ball.vertices, axis=1, keepdims=True)
    mesh = Mesh(place.radius * n + [*place.at, place.radius], ball.faces, n)
    eta, k_ = courtyard.METALS[place.metal]
    bounce = Bounce(0.34) if moving and k == BOUNCER else None
    return Reflector(f"sphere-{k + 1}-{place.metal}", mesh, mesh, eta, k_, bounce)
