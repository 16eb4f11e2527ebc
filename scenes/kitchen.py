"""A kitchen with one large metal bowl on the table, towards which the camera moves.

The bowl is the mirror (`scenes.props.bowls`): `convex` is an upturned bowl, seen from outside; `concave` a hemisphere seen
from inside; `torus` the outer band of a ring mould. The room has a window, a lamp and surfaces of many albedos, so that
light, contact shadows and long straight edges can all be judged in the reflection.

Two details of the same room. `paper` has as many vertices as the kitchen of Estalella et al. 2006: 11,379 as built and
14,979 after `refined`, spent on round things. `lean` is what the picture needs: about 4,600 (2,305 of them the
bowl's), without SPARED, and drawn as it is built: methods whose images of long edges are off split those themselves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from benchharness.scene import Camera, Object, Reflector, Scene, merged

from .props import bowls, kitchen_room, kitchen_table, kitchenware
from .props.kitchen_table import HEIGHT
from .props.lean import without
from .props.shapes import Colour, box, lathe, placed
from .props.ways import gently, mixed, way_to

DetailName = Literal["lean", "paper"]
BowlName = Literal["convex", "concave", "torus"]


@dataclass(frozen=True)
class Detail:
    """How finely the kitchen is modelled.

    near     vertices around a can on the table; other round things on the table are scaled to it
    far      the same for what stands along the walls
    table    distance of base vertices on the table top, metres; closer around whatever stands there
    wall     distance of base vertices on walls and ceiling, metres
    front    the same on cupboards and furniture
    worktop  distance of base vertices on the worktops, metres
    h_max    longest edge that is drawn, metres; None: as built
    """

    near: int
    far: int
    table: float
    wall: float
    front: float
    worktop: float
    h_max: float | None


DETAILS: dict[str, Detail] = {
    "lean": Detail(near=8, far=6, table=0.13, wall=0.55, front=0.75, worktop=0.5, h_max=None),
    "paper": Detail(near=24, far=18, table=0.05, wall=0.4, front=0.4, worktop=0.3, h_max=0.355),
}

SPARED = (
    "lamp-rod sink hob hood shelf jars pot board dresser-plates chairs can-red can-yellow can-blue kettle bottle plate "
    "apple-one apple-two banana orange-two mug-white"
).split()
"""What the lean kitchen does without: with all of them or with none, no method's error differs by more than its interval. (Of
the floor and the table's frame the bowl shows nothing, but the eye sees them.)"""

BOWL = (0.0, 0.1, HEIGHT)
"""Where the bowl stands on the table."""
FRAMES, FPS = 100, 25.0


def kitchen(detail: DetailName = "lean", bowl: BowlName = "convex", *, moving: bool = False) -> Scene:
    """The kitchen.

    detail   how finely it is modelled, and how many things are there
    bowl     which mirror stands on the table
    moving   whether an orange rolls and, where it is there, a mug slides along the table

    Raises ValueError for anything else.
    """
    for name, value, accepted in (("detail", detail, get_args(DetailName)), ("bowl", bowl, get_args(BowlName))):
        if value not in accepted:
            raise ValueError(f"kitchen: {name} is {value!r}; accepted: {', '.join(accepted)}")
    if not isinstance(moving, bool):
        raise ValueError(f"kitchen: moving is {moving!r}; accepted: true or false")
    d = DETAILS[detail]
    spared = SPARED if detail == "lean" else []
    things, feet = kitchen_table.things(d.near, FRAMES / FPS, moving=moving)
    standing = [foot for name, foot in feet.items() if name not in spared]
    mirror, support = _bowl(bowl, d)
    scene = Scene(
        name="kitchen",
        objects=without(
            (
                *kitchen_room.room(d.wall),
                *kitchen_room.window(14.0),
                *kitchen_room.lamp((15.0, 12.0, 8.0), d.near),
                *kitchen_room.counters(d.front, d.worktop),
                *kitchen_room.high_cupboards(d.front),
                *kitchen_room.furniture(d.front),
                *_along_the_walls(d),
                *kitchen_table.table(d.table, [*standing, _FOOT[bowl]]),
                *things,
                *support,
            ),
            spared,
        ),
        reflectors=(mirror,),
        camera=CAMERAS[bowl],
        frames=FRAMES,
        fps=FPS,
        exposure=0.0,
        detail=detail,
        h_max=d.h_max,
    )
    scene.source.update(detail=detail, bowl=bowl, moving=moving, base_vertices=scene.vertices, h_max=d.h_max)
    return scene


@dataclass(frozen=True)
class Dolly:
    """The camera: draws near to the bowl and a little around it, setting out and arriving gently.

    From and to are direction (azimuth and elevation in degrees) and distance (metres) of the eye from `centre`.
    """

    centre: tuple[float, float, float]
    distance: tuple[float, float]
    azimuth_deg: tuple[float, float] = (-76.0, -96.0)
    elevation_deg: tuple[float, float] = (18.0, 25.0)
    look_above: tuple[float, float] = (0.10, 0.0)
    duration: float = (FRAMES - 1) / FPS

    def __call__(self, time: float) -> Camera:
        s = gently(time, self.duration)
        way = way_to(mixed(self.azimuth_deg, s), mixed(self.elevation_deg, s))
        distance = self.distance[0] * (self.distance[1] / self.distance[0]) ** s
        eye = np.asarray(self.centre) + distance * way
        target = np.add(self.centre, [0.0, 0.0, mixed(self.look_above, s)])
        return Camera(tuple(eye.tolist()), tuple(target.tolist()), fov_deg=45.0)


CAMERAS = {
    "convex": Dolly((BOWL[0], BOWL[1], HEIGHT + 0.10), (1.75, 0.57)),
    "concave": Dolly((BOWL[0], BOWL[1], HEIGHT + bowls.RADIUS), (1.95, 0.65)),
    "torus": Dolly((BOWL[0], BOWL[1], HEIGHT + 0.08), (1.70, 0.59)),
}
"""Each draws near until its bowl covers about half of the picture."""


def _bowl(bowl: str, d: Detail) -> tuple[Reflector, list[Object]]:
    """The mirror, and what holds or covers it."""
    if bowl == "convex":
        return bowls.convex_bowl(BOWL), []
    if bowl == "concave":
        # It opens towards where the camera sets out, so that its outside is never in view.
        wedge = box((-0.07, 0.24, HEIGHT), (0.07, 0.30, HEIGHT + 0.07), kitchen_room.DARK_OAK, "-z", bevel=0.006)
        shows = "a block of wood that keeps the bowl from rolling back"
        return bowls.concave_bowl(BOWL, CAMERAS["concave"](0.0).eye), [
            Object("wedge", placed(wedge, (BOWL[0], BOWL[1], 0)), shows)
        ]
    radius, top = bowls.torus_top(BOWL)
    profile = [
        (radius + 0.006, 0.0005),
        (radius + 0.006, 0.012),
        (0.03, 0.012),
        (0.018, 0.02),
        (0.024, 0.035),
        (0, 0.042),
    ]
    lid = placed(lathe(profile, d.near + d.near // 3, kitchen_room.OAK), (BOWL[0], BOWL[1], top))
    return bowls.torus_bowl(BOWL), [Object("lid", lid, "a wooden lid on the ring mould, so that nobody looks into it")]


_FOOT = {
    "convex": (BOWL[0], BOWL[1], bowls.RADIUS),
    "concave": (BOWL[0], BOWL[1], 0.03),
    "torus": (BOWL[0], BOWL[1], bowls.RADIUS - bowls.TORUS_TUBE * 0.5),
}
"""Where each bowl touches the table: x, y, radius."""


def _along_the_walls(d: Detail) -> list[Object]:
    """What stands on worktops, shelves and dresser."""
    n, counter = d.far, kitchen_room.COUNTER
    oak, sage = kitchen_room.OAK, kitchen_room.SAGE
    fillings: list[tuple[Colour, Colour]] = [
        ((0.75, 0.60, 0.38), oak),
        ((0.45, 0.12, 0.06), oak),
        ((0.30, 0.36, 0.12), oak),
        ((0.16, 0.32, 0.42), sage),
    ]
    jars = [placed(kitchenware.jar(n, *pair), (-0.75 + 0.17 * k, 1.88, 1.525)) for k, pair in enumerate(fillings)]
    dish = kitchenware.plate(n, (0.10, 0.24, 0.45))
    row = [placed(dish, (-1.38 + 0.45 * k, -1.93, 1.4), 180, 80) for k in range(2)]
    board = placed(
        box((-0.16, 0, 0), (0.16, 0.02, 0.42), kitchen_room.DARK_OAK, "-z", bevel=0.005),
        (-0.55, 1.90, counter),
        tilt_deg=-9,
    )
    bread = placed(
        lathe([(0, -0.14), (0.05, -0.13), (0.065, -0.06), (0.065, 0.06), (0.05, 0.13), (0, 0.14)], n + 2, (0.58, 0.33, 0.14)),
        (-0.20, 1.68, counter + 0.062),
        70,
        90,
    )
    return [
        Object("jars", merged(*jars), "a row of small coloured things on the shelf over the worktop"),
        Object(
            "pot",
            placed(kitchenware.pot(n + 2, (0.14, 0.30, 0.40)), (0.45, 1.84, counter + 0.012), 15),
            "a large blue thing on the hob",
        ),
        Object("board", merged(board, bread), "a chopping board and a loaf against the bright splashback"),
        Object("dresser-plates", merged(*row), "round things on straight shelves behind the camera"),
    ]
