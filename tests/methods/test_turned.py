"""What is decided once about a scene does not depend on how it is turned, how its triangles are numbered, or on rounding."""

from __future__ import annotations

import numpy as np
import pytest
from support.mirror_room import mirror_ball, scene, walls
from support.stress_rooms import any_motion, carried

from benchharness.kernels.images import roles
from benchharness.kernels.vertices import mirrormesh
from benchharness.scene import Mesh, Object, merged
from benchharness.stability import altered
from scenes.props.minimal import grid, sphere, thing

MIRROR = mirror_ball("mirror", (0.0, 0.0, 0.0), 0.8)


def beads() -> Object:
    """A ring around the mirror and near it, whose box holds the mirror if it is turned."""
    angles = np.linspace(0, 2 * np.pi, 13)[:-1]
    return thing("beads", merged(*(sphere(0.2, 1.5 * np.array([np.cos(a), np.sin(a), 0.0]), 8) for a in angles)))


def open_box(sign: int):
    """Four walls, 4 wide, from height 0 up (or down) to 2: a box without bottom and top."""
    z = (0.0, 2.0 * sign)
    corners = [(2, 2), (-2, 2), (-2, -2), (2, -2)]
    v = np.array([(x, y, h) for x, y in corners for h in z], float)
    i = np.arange(4)
    a, b, c, d = 2 * i, 2 * i + 1, 2 * ((i + 1) % 4), 2 * ((i + 1) % 4) + 1
    return Mesh(v, np.concatenate([np.stack([a, c, b], 1), np.stack([c, d, b], 1)]))


def floor(half: float, z: float) -> Object:
    return thing("floor", grid((-half, -half, z), (2 * half, 0, 0), (0, 2 * half, 0), (4, 4)))


@pytest.mark.parametrize("seed", range(4))
def test_a_turned_scene_has_the_same_roles(seed):
    made = scene((walls(), beads(), floor(1.8, -1.98)), (MIRROR,))
    turned = carried(made, any_motion(seed))
    one, other = (roles.plan(s, maps=1) for s in (made, turned))
    assert one.enclosing == [{0}] and one.bounds == {2}
    assert (other.enclosing, other.bounds, other.slots, other.maps, other.planes) == (
        one.enclosing, one.bounds, one.slots, one.maps, one.planes,
    )  # fmt: skip


def test_what_is_flat_or_goes_around_a_mirror_nearby_does_not_enclose_it_whichever_way_it_is_turned():
    for seed in range(4):
        turned = carried(scene((beads(), floor(4.0, -0.7)), (MIRROR,)), any_motion(seed))
        assert roles.plan(turned, maps=1).enclosing == [set()]


def test_walls_over_a_wainscot_surround_a_mirror_whose_middle_is_at_its_rail():
    """Neither half of the walls holds the mirror in its hull, and no picture from the mirror's side shows it."""
    upper, lower = (thing(f"walls {sign}", open_box(sign)) for sign in (1, -1))
    plan = roles.plan(scene((upper, lower), (MIRROR,)), maps=1)
    assert plan.enclosing == [{0, 1}]


@pytest.mark.parametrize("change", [altered.rounded, lambda made: altered.renumbered(made)[0]], ids=["rounded", "renumbered"])
def test_walks_start_from_the_same_places_of_a_symmetric_mirror(change):
    made = scene((walls(),), (mirror_ball(),))
    starts = []
    for s in (made, change(made)):
        mesh = s.reflectors[0].mesh
        starts.append(np.array(mirrormesh.build(mesh.vertices, mesh.normals, mesh.faces).middles).reshape(-1, 8))
    np.testing.assert_allclose(*starts, atol=1e-6)
