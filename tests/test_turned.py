"""What is decided once about a scene does not depend on how it is turned, how its triangles are numbered, or on rounding."""

from __future__ import annotations

import numpy as np
import pytest
from mirror_room import mirror_ball, scene, walls
from stress_rooms import any_motion, carried

from benchharness.kernels import newton, roles
from benchharness.scene import Object, merged
from benchharness.stability import altered
from scenes.stress.minimal import grid, sphere, thing


def beads() -> Object:
    """A ring around the mirror, whose box holds the mirror if it is turned."""
    angles = np.linspace(0, 2 * np.pi, 13)[:-1]
    return thing("beads", merged(*(sphere(0.2, 1.5 * np.array([np.cos(a), np.sin(a), 0.0]), 8) for a in angles)))


def floor(half: float, z: float) -> Object:
    return thing("floor", grid((-half, -half, z), (2 * half, 0, 0), (0, 2 * half, 0), (4, 4)))


@pytest.mark.parametrize("seed", range(4))
def test_a_turned_scene_has_the_same_roles(seed):
    made = scene((walls(), beads(), floor(1.8, -1.98)), (mirror_ball(),))
    turned = carried(made, any_motion(seed))
    one, other = (roles.plan(s, 1, 0, True, None) for s in (made, turned))
    assert one.enclosing == [{0}] and one.bounds == {2}
    assert (other.enclosing, other.bounds, other.slots, other.maps, other.planes) == (
        one.enclosing, one.bounds, one.slots, one.maps, one.planes,
    )  # fmt: skip


def test_what_is_flat_or_goes_around_a_mirror_does_not_enclose_it_whichever_way_it_is_turned():
    for seed in range(4):
        turned = carried(scene((beads(), floor(4.0, -0.7)), (mirror_ball(),)), any_motion(seed))
        assert roles.plan(turned, 1, 0, True, None).enclosing == [set()]


@pytest.mark.parametrize("change", [altered.rounded, lambda made: altered.renumbered(made)[0]], ids=["rounded", "renumbered"])
def test_walks_start_from_the_same_places_of_a_symmetric_mirror(change):
    made = scene((walls(),), (mirror_ball(),))
    starts = []
    for s in (made, change(made)):
        mesh = s.reflectors[0].mesh
        starts.append(np.array(newton.mesh(mesh.vertices, mesh.normals, mesh.faces).middles).reshape(-1, 8))
    np.testing.assert_allclose(*starts, atol=1e-6)
