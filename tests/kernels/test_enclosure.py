"""Enclosed mirrors: where walls shut them in, however they are made; and that no method shows the surroundings there."""

from __future__ import annotations

from dataclasses import replace

import mitsuba as mi  # noqa: F401  (so that the variant is set)
import numpy as np
import pytest
from support.mirror_room import mirror_ball, plain, scene, walls
from support.small_room import box, quad

from benchharness.scene import Mesh, Object, merged

GREY = (0.5, 0.5, 0.5)


def made(*meshes: Mesh, mirrors=None, frames: int = 1, **more):
    things = [Object(f"part {k}", plain(mesh, GREY), "walls") for k, mesh in enumerate(meshes)]
    return scene(things, mirrors or [mirror_ball(fine=24)], frames=frames, **more)


def sheets(half: float = 2.0) -> list[Mesh]:
    """The six sides of a room, the ceiling last."""
    sides = box((-half,) * 3, (half,) * 3, inside=True)
    made_ = [Mesh(sides.vertices[4 * k : 4 * k + 4], [[0, 1, 2], [0, 2, 3]]) for k in range(6)]
    return sorted(made_, key=lambda mesh: mesh.vertices[:, 2].min())


def slabs(half: float = 2.0, gap: float = 0.0) -> list[Mesh]:
    """Six closed boxes around a room, as thick as a hand, floor and ceiling as wide as the room; walls end `gap` below it."""
    out, far = half + 0.1, half - gap
    return [
        box((-out, -out, -out), (out, out, -half)),
        box((-out, -out, half), (out, out, out)),
        box((-out, -out, -out), (-half, out, far)),
        box((half, -out, -out), (out, out, far)),
        box((-out, -out, -out), (out, -half, far)),
        box((-out, half, -out), (out, out, far)),
    ]


def tilted(half: float = 2.0) -> Mesh:
    """A pyramid over a square, of which every side is split where the next is not."""
    ring = half * np.array([[-1, -1, -1.0], [1, -1, -1], [1, 1, -1], [-1, 1, -1]])
    top, sides = np.array([0.0, 0.0, 3.0 * half]), []
    for k in range(4):
        a, b = ring[k], ring[(k + 1) % 4]
        middle = 0.3 * a + 0.7 * b
        sides += [Mesh(np.stack([a, middle, top]), [[0, 1, 2]]), Mesh(np.stack([middle, b, top]), [[0, 1, 2]])]
    return merged(quad(ring[0], ring[1] - ring[0], ring[3] - ring[0]), *sides)


@pytest.mark.parametrize(
    "meshes",
    [
        [box((-2, -2, -2), (2, 2, 2), inside=True)],
        [box((-2, -2, -2), (2, 2, 2))],
        sheets(),
        [sheet if k % 2 else replace(sheet, faces=sheet.faces[:, ::-1]) for k, sheet in enumerate(sheets())],
        slabs(),
        slabs(gap=0.01),  # rays that rise from the mirror by 3 in 4 do not pass 1 in 10
        [tilted()],
        [box((-2, -2, -0.5), (2, 2, 2), inside=True)],
    ],
    ids=[
        "wound in",
        "wound out",
        "six sheets",
        "wound both ways",
        "boxes",
        "a bent gap",
        "split otherwise",
        "mirror on the floor",
    ],
)
def test_walls_enclose_a_mirror_however_they_are_made(meshes):
    assert made(*meshes).enclosed == (True,)


def leaving(time: float) -> np.ndarray:
    """Out by the wall at x = 2, in the last of eight frames."""
    pose = np.eye(4)
    pose[0, 3] = 1.4 if time < 6.5 else 1.7
    return pose


@pytest.mark.parametrize(
    ("meshes", "mirror"),
    [
        (sheets()[:-1], mirror_ball(fine=24)),
        ([*sheets()[:-1], quad((-2, -2, 2), (4, 0, 0), (0, 3.8, 0))], mirror_ball(fine=24)),
        (slabs(gap=0.1), mirror_ball(fine=24)),
        ([*sheets()[:-1], quad((-2, -2, 2.01), (0, 4, 0), (4, 0, 0))], mirror_ball(fine=24)),
        ([quad((-9, -9, -1), (18, 0, 0), (0, 18, 0))], mirror_ball(fine=24)),
        ([box((-2, -2, -2), (2, 2, 2), inside=True)], mirror_ball(center=(2.0, 0, 0), fine=24)),
        ([box((-2, -2, -2), (2, 2, 2), inside=True)], mirror_ball(center=(1.6, 0, 0), fine=24)),
        ([box((-2, -2, -2), (2, 2, 2), inside=True)], mirror_ball(center=(4.0, 0, 0), fine=24)),
        ([], mirror_ball(fine=24)),
    ],
    ids=[
        "no ceiling",
        "a skylight",
        "a gap over boxes",
        "a gap of a centimetre",
        "a courtyard",
        "half outside",
        "a cap outside",
        "beside",
        "alone",
    ],
)
def test_where_any_ray_leads_outside_no_mirror_is_enclosed(meshes, mirror):
    assert made(*meshes, mirrors=[mirror]).enclosed == (False,)


def test_a_mirror_that_leaves_the_room_in_one_frame_is_not_enclosed_and_others_stay_so():
    room = box((-2, -2, -2), (2, 2, 2), inside=True)
    mirrors = [
        replace(mirror_ball("leaves", fine=24), motion=leaving),
        mirror_ball("stays", (-1.0, 0, 0), fine=24),
    ]
    assert made(room, mirrors=mirrors, frames=8, fps=1.0).enclosed == (False, True)
    assert made(room, mirrors=mirrors, frames=6, fps=1.0).enclosed == (True, True)


def test_what_moves_encloses_nothing():
    still, moves = walls(), replace(walls(), motion=lambda time: np.eye(4))
    assert scene([still], [mirror_ball(fine=24)]).enclosed == (True,)
    assert scene([moves], [mirror_ball(fine=24)]).enclosed == (False,)


# What methods answer
